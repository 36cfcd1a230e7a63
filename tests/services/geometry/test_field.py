import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.geometry.corridor import CorridorGeometry
from services.geometry.field import Field, depth
from services.geometry.path import BadPath, cumulative, resample

coordinate = st.floats(-3, 9)


def s_corridor(seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    s = np.linspace(0, 6, 400)
    path = resample(np.column_stack([s, rng.uniform(0.5, 1.5) * np.sin(s)]), 0.05)
    arc = cumulative(path)
    return path, 0.5 + 0.2 * np.sin(rng.uniform(0.5, 3) * arc)


def discs(path: np.ndarray, width: np.ndarray, x: float, y: float, between: int = 400) -> float:
    """The union of discs of Definition 1, with many more discs laid between the path's points."""
    k = np.arange(len(path))
    dense = np.linspace(0, len(path) - 1, between * (len(path) - 1) + 1)
    qx, qy, w = (np.interp(dense, k, v) for v in (path[:, 0], path[:, 1], width))
    return float((w - np.hypot(qx - x, qy - y)).max())


PATH, WIDTH = s_corridor()
FIELD = Field.build(PATH, WIDTH)


@settings(max_examples=40)
@given(coordinate, coordinate)
def test_depth_is_that_of_the_union_of_discs(x: float, y: float) -> None:
    assert depth(x, y, PATH, WIDTH) == pytest.approx(discs(PATH, WIDTH, x, y), abs=1e-4)


@given(coordinate, coordinate)
def test_depth_is_at_least_that_of_the_given_discs_and_little_more(x: float, y: float) -> None:
    given_discs = float((WIDTH - np.hypot(PATH[:, 0] - x, PATH[:, 1] - y)).max())
    found = depth(x, y, PATH, WIDTH)
    assert given_discs - 1e-12 <= found <= given_discs + 0.025 * 1.1


@given(coordinate, coordinate, coordinate, coordinate)
def test_depth_is_1_lipschitz(ax: float, ay: float, bx: float, by: float) -> None:
    apart = math.hypot(ax - bx, ay - by)
    assert abs(depth(ax, ay, PATH, WIDTH) - depth(bx, by, PATH, WIDTH)) <= apart + 1e-9


@given(st.floats(0.2, 3.8), st.floats(-1.5, 1.5))
def test_depth_of_a_straight_corridor(x: float, y: float) -> None:
    path = np.column_stack([np.arange(0, 4.01, 0.05), np.zeros(81)])
    assert depth(x, y, path, np.full(81, 0.7)) == pytest.approx(0.7 - abs(y), abs=1e-12)


@given(st.floats(0.1, 2.0), st.floats(0.1, math.pi - 0.1))
def test_depth_of_an_annulus_bend(rho: float, theta: float) -> None:
    around = np.linspace(0, math.pi, 400)
    path = 1.5 * np.column_stack([np.cos(around), np.sin(around)])
    found = depth(rho * math.cos(theta), rho * math.sin(theta), path, np.full(400, 0.6))
    assert found == pytest.approx(0.6 - abs(rho - 1.5), abs=1e-4)


def test_widths_that_grow_faster_than_the_path_advances_are_the_larger_disc() -> None:
    path = np.array([[0, 0], [1, 0]], float)
    assert depth(0.0, 0.5, path, np.array((0.5, 3.0))) == pytest.approx(3 - math.hypot(1, 0.5))


def test_the_grid_holds_the_depth_at_its_points() -> None:
    # Seen to fail with too few candidates to a tile.
    ny, nx = FIELD.values.shape
    for j in range(0, ny, 7):
        for i in range(0, nx, 5):
            x, y = FIELD.origin + FIELD.resolution * np.array((i, j))
            assert FIELD.values[j, i] == pytest.approx(depth(x, y, PATH, WIDTH), abs=1e-12)


@given(coordinate, coordinate)
def test_lookup_is_close_to_the_depth_inside_and_a_lower_bound_far_outside(x: float, y: float) -> None:
    exact, found = depth(x, y, PATH, WIDTH), FIELD.value(x, y)
    if exact > -0.4:
        assert -0.013 <= found - exact <= 0.002
    else:
        assert found <= exact + 0.002


@given(st.floats(0.3, 3.7), st.floats(0.06, 0.65))
def test_gradient_of_a_straight_corridor_points_to_its_path(x: float, y: float) -> None:
    path = np.column_stack([np.arange(0, 4.01, 0.05), np.zeros(81)])
    field = Field.build(path, np.full(81, 0.7))
    assert field.gradient(x, y) == pytest.approx((0, -1), abs=1e-6)
    assert field.gradient(x, -y) == pytest.approx((0, 1), abs=1e-6)


@given(st.floats(0, 6), st.floats(-1, 1), st.floats(0, 6), st.floats(-1, 1))
def test_minimum_along_is_that_of_dense_samples(ax: float, ay: float, bx: float, by: float) -> None:
    a, b = np.array((ax, ay)), np.array((bx, by))
    dense = min(FIELD.value(*(a + t * (b - a))) for t in np.linspace(0, 1, 500))
    found = FIELD.minimum_along(a, b)
    assert dense - 1e-9 <= found + 0.02
    assert abs(found - dense) <= 0.5 * FIELD.resolution + math.hypot(*(b - a)) / 499


def test_edges_of_a_straight_corridor_are_its_parallels() -> None:
    path = np.column_stack([np.arange(0, 4.01, 0.05), np.zeros(81)])
    geometry = CorridorGeometry.of(path, 0, np.full(81, 1.03), 0.46, 0.3)
    assert geometry.width_push == pytest.approx(0.8)
    assert geometry.width_object == pytest.approx(0.8 - 0.38)
    for lines, half in ((geometry.edge_push(), 0.8), (geometry.edge_object(), 0.42)):
        (line,) = lines
        assert (line[0] == line[-1]).all()
        along = line[(line[:, 0] > 0) & (line[:, 0] < 4)]
        assert np.abs(along[:, 1]) == pytest.approx(half, abs=1e-6)
        around = line[line[:, 0] > 4] - (4, 0)
        assert np.hypot(*around.T) == pytest.approx(half, abs=1e-3)


def test_the_object_corridor_has_no_edge_where_it_vanishes() -> None:
    path = np.column_stack([np.arange(0, 4.01, 0.05), np.zeros(81)])
    assert CorridorGeometry.of(path, 0, np.full(81, 0.5), 0.46, 0.3).edge_object() == []


def test_bad_widths_are_refused() -> None:
    with pytest.raises(BadPath, match="81 finite"):
        Field.build(np.column_stack([np.arange(81.0), np.zeros(81)]), np.zeros(80))
    with pytest.raises(BadPath):
        depth(0.0, 0.0, PATH, np.full(len(PATH), np.inf))
