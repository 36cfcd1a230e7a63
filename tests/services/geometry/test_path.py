from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from services.geometry.path import BadPath, at_arc, check, closest, closest_in_sight, cumulative, resample

points = arrays(np.float64, st.tuples(st.integers(2, 12), st.just(2)), elements=st.floats(-5, 5, width=32))


def usable(path: np.ndarray) -> bool:
    return bool((np.hypot(*np.diff(path, axis=0).T) > 1e-3).all())


def test_cumulative_of_a_square() -> None:
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]], float)
    assert cumulative(square).tolist() == [0, 1, 2, 3, 4]


@given(points.filter(usable), st.tuples(st.floats(-6, 6), st.floats(-6, 6)))
def test_closest_is_as_near_as_dense_sampling_finds(path: np.ndarray, point: tuple[float, float]) -> None:
    p = np.array(point)
    found = closest(path, p)
    t = np.linspace(0, 1, 200)[:, None]
    dense = np.vstack([a + t * (b - a) for a, b in pairwise(path)])
    least = np.hypot(*(dense - p).T).min()
    longest = np.hypot(*np.diff(path, axis=0).T).max()
    assert found.distance <= least + 1e-9
    assert found.distance >= least - longest / 199
    a, b = path[found.index], path[found.index + 1]
    assert found.point == pytest.approx(a + found.fraction * (b - a), abs=1e-9)
    assert np.hypot(*(found.point - p)) == pytest.approx(found.distance, abs=1e-9)
    assert at_arc(path, cumulative(path), found.arc) == pytest.approx(found.point, abs=1e-6)


def test_closest_looks_at_the_path_from_first_on() -> None:
    path = np.array([[0, 0], [1, 0], [2, 0], [2, 2]], float)
    assert closest(path, np.array((0.1, 0.1))).index == 0
    later = closest(path, np.array((0.1, 0.1)), 1)
    assert (later.index, later.arc, later.point.tolist()) == (1, 1.0, [1.0, 0.0])


def test_a_branch_behind_a_wall_does_not_come_closer() -> None:
    # Two legs 1 m apart, a wall at y = 0.7: clearances 0.7 on the first leg and 0.3 on the second.
    path = np.array([[0, 0], [3, 0], [3, 1], [0, 1]], float)
    reach = np.array((0.7, 0.7, 0.3, 0.3))
    o = np.array((1.0, 0.6))
    assert closest(path, o).index == 2
    assert closest_in_sight(path, reach, o).index == 0
    assert closest_in_sight(path, np.full(4, 0.01), o).index == 2


@given(points.filter(usable), st.floats(0.05, 1.0))
def test_resample_spaces_evenly_and_keeps_the_ends(path: np.ndarray, spacing: float) -> None:
    dense = resample(path, spacing)
    assert (dense[0] == path[0]).all()
    assert (dense[-1] == path[-1]).all()
    assert np.hypot(*np.diff(dense, axis=0).T).max() <= spacing * (1 + 1e-9)
    assert max(closest(path, q).distance for q in dense) < 1e-9


def test_at_arc_stops_at_the_ends() -> None:
    path = np.array([[0, 0], [1, 0], [1, 1]], float)
    arc = cumulative(path)
    assert [at_arc(path, arc, s).tolist() for s in (-1, 0.5, 1.5, 9)] == [[0, 0], [0.5, 0], [1, 0.5], [1, 1]]


@pytest.mark.parametrize(
    "path", [np.zeros((1, 2)), np.zeros((3, 3)), np.zeros((2, 2)), np.array([[0, 0], [np.nan, 1]])]
)
def test_unusable_paths_are_refused(path: np.ndarray) -> None:
    with pytest.raises(BadPath):
        check(path)
