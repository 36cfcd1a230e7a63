import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.corridor.update import (
    disagrees,
    distance_robot_closest_obstacle,
    distance_robot_corridor_edge,
    external,
)
from services.geometry.field import Field

D_R = 0.46
# A straight corridor along x with C = 0.8 m: (Q, C) ends at |y| = 0.8.
PATH = np.column_stack([np.arange(0, 6.01, 0.05), np.zeros(121)])
FIELD = Field.build(PATH, np.full(121, 0.8 - 0.5 * D_R))


def test_the_closest_hit_is_found() -> None:
    hits = np.array([[3, 0.9], [2, -0.8], [5, 5]], float)
    found = distance_robot_closest_obstacle(hits, np.array((2.0, 0.0)))
    assert found is not None
    assert (found.distance, found.bearing, found.point.tolist()) == (0.8, -math.pi / 2, [2.0, -0.8])
    assert distance_robot_closest_obstacle(np.zeros((0, 2)), np.zeros(2)) is None


@given(st.floats(1, 5), st.floats(-0.5, 0.5), st.floats(0.9, math.pi - 0.9))
def test_the_edge_along_a_ray_in_a_straight_corridor(x: float, y: float, bearing: float) -> None:
    expected = (0.8 - y) / math.sin(bearing)
    if 0 < x + expected * math.cos(bearing) < 6:
        assert distance_robot_corridor_edge(FIELD, D_R, np.array((x, y)), bearing) == pytest.approx(expected, abs=3e-3)


def test_the_edge_is_limited_and_negative_outside() -> None:
    assert distance_robot_corridor_edge(FIELD, D_R, np.array((1.0, 0.0)), 0.0, limit=2.0) == 2.0
    assert distance_robot_corridor_edge(FIELD, D_R, np.array((1.0, 1.0)), 0.0) == pytest.approx(-0.2, abs=2e-3)


@pytest.mark.parametrize(
    ("wall", "nearer", "farther"),
    [(0.80, False, False), (0.84, False, False), (0.76, False, False), (0.74, True, False), (0.86, False, True)],
)
def test_a_disagreement_is_more_than_the_threshold(wall: float, nearer: bool, farther: bool) -> None:
    hits = np.column_stack([np.linspace(1, 4, 60), np.full(60, wall)])
    found = disagrees(FIELD, D_R, np.array((2.0, 0.1)), hits)
    assert (found.nearer, found.farther) == (nearer, farther)
    assert found.difference == pytest.approx(wall - 0.8, abs=5e-3)


def test_nothing_in_sight_is_no_disagreement() -> None:
    found = disagrees(FIELD, D_R, np.zeros(2), np.zeros((0, 2)))
    assert (found.nearer, found.farther, found.difference) == (False, False, 0.0)


def test_hits_on_the_object_and_the_robot_are_taken_out() -> None:
    r, o = np.array((1.0, 0.0)), np.array((1.5, 0.0))
    hits = np.array([[1.5, 0.15], [1.5, 0.26], [1.2, 0.0], [1.0, 0.3], [4, 0]], float)
    assert external(hits, r, o, D_R, 0.3, 0.1).tolist() == [[1.5, 0.26], [1.0, 0.3], [4.0, 0.0]]
