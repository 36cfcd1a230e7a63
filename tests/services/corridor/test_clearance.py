import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from services.corridor.clearance import BadGrid, measure

ORIGIN = np.array((-1.0, 2.0))
NO_DISCS = np.zeros((0, 3))
grids = arrays(
    np.uint8, st.tuples(st.integers(1, 14), st.integers(1, 14)), elements=st.sampled_from([0, 0, 0, 0, 100, 255])
)


def brute(cells: np.ndarray, resolution: float, x: float, y: float) -> float:
    """Distance from (x, y) to the nearest occupied square, or to the border of the grid."""
    ny, nx = cells.shape
    gx, gy = x - ORIGIN[0], y - ORIGIN[1]
    best = min(gx, gy, nx * resolution - gx, ny * resolution - gy)
    for j, i in zip(*np.nonzero(cells), strict=True):
        dx = max(i * resolution - gx, 0.0, gx - (i + 1) * resolution)
        dy = max(j * resolution - gy, 0.0, gy - (j + 1) * resolution)
        best = min(best, float(np.hypot(dx, dy)))
    return best


@settings(max_examples=30)
@given(grids)
def test_clearance_is_the_distance_to_the_nearest_square(cells: np.ndarray) -> None:
    found = measure(cells, 0.05, ORIGIN, NO_DISCS)
    rows, columns = found.values.shape
    assert (rows, columns) == (2 * cells.shape[0] + 1, 2 * cells.shape[1] + 1)
    for j in range(rows):
        for i in range(columns):
            x, y = ORIGIN + 0.025 * np.array((i, j))
            assert found.values[j, i] == pytest.approx(max(0.0, brute(cells, 0.05, x, y)), abs=1e-9)


@given(st.integers(0, 10_000), st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_between_the_lattice_points_clearance_is_hardly_too_much(seed: int, u: float, v: float) -> None:
    cells = np.where(np.random.default_rng(seed).random((60, 60)) < 0.005, 100, 0).astype(np.uint8)
    found = measure(cells, 0.05, ORIGIN, NO_DISCS)
    x, y = ORIGIN + 3.0 * np.array((u, v))
    exact = brute(cells, 0.05, x, y)
    assert found.at(x, y) >= exact - 0.013
    if exact > 0.2:
        assert found.at(x, y) <= exact + 0.0005


def test_discs_are_cleared_and_nothing_else() -> None:
    cells = np.full((40, 40), 100, np.uint8)
    disc = np.array([[0.0, 3.0, 0.31]])
    found = measure(cells, 0.05, ORIGIN, disc)
    for j in range(40):
        for i in range(40):
            x, y = ORIGIN + 0.05 * (np.array((i, j)) + 0.5)
            inside = np.hypot(x - 0.0, y - 3.0) <= 0.31
            assert (found.at(x, y) > 0) == inside


def test_discs_may_reach_beyond_the_grid() -> None:
    cells = np.full((10, 10), 100, np.uint8)
    found = measure(cells, 0.05, ORIGIN, np.array([[-1.0, 2.0, 0.2], [50.0, 50.0, 1.0]]))
    assert found.at(-0.975, 2.025) > 0


def test_beyond_the_map_clearance_is_negative() -> None:
    found = measure(np.zeros((10, 10), np.uint8), 0.05, ORIGIN, NO_DISCS)
    assert found.at(-1.3, 2.2) == pytest.approx(-0.3)


def test_grids_that_cannot_be_used_are_refused() -> None:
    good = np.zeros((4, 4), np.uint8)
    with pytest.raises(BadGrid, match="uint8"):
        measure(good.astype(np.int8), 0.05, ORIGIN, NO_DISCS)
    with pytest.raises(BadGrid, match="found 50"):
        measure(good + np.uint8(50), 0.05, ORIGIN, NO_DISCS)
    with pytest.raises(BadGrid, match="resolution"):
        measure(good, 0.0, ORIGIN, NO_DISCS)
