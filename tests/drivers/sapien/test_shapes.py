from __future__ import annotations

from math import hypot, pi

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize

from drivers.sapien.shapes import Box, Disc, Shape, bounding_circle, corners, moved

place = st.floats(-0.5, 0.5)
size = st.floats(0.02, 0.5)
discs = st.builds(Disc, x=place, y=place, radius=size)
boxes = st.builds(Box, x=place, y=place, yaw=st.floats(-3, 3), length=size, width=size)
compounds = st.lists(discs | boxes, min_size=1, max_size=4).map(tuple)


def reach(shapes: tuple[Shape, ...], x: float, y: float) -> float:
    """How far the shapes' outlines get from (x, y)."""
    far = 0.0
    for shape in shapes:
        if isinstance(shape, Disc):
            far = max(far, hypot(shape.x - x, shape.y - y) + shape.radius)
        else:
            far = max(far, *(hypot(cx - x, cy - y) for cx, cy in corners(shape)))
    return far


@given(compounds)
def test_bounding_circle_is_the_smallest(shapes: tuple[Shape, ...]) -> None:
    x, y, radius = bounding_circle(shapes)
    assert reach(shapes, x, y) == pytest.approx(radius, abs=1e-7)
    # The reach is convex, so a search from anywhere finds its least value.
    best = minimize(lambda p: reach(shapes, *p), [x + 0.05, y - 0.03], method="Nelder-Mead", tol=1e-9)
    assert radius <= best.fun + 1e-6


def test_bounding_circle_of_one_box_is_its_diagonal() -> None:
    assert bounding_circle((Box(x=1.0, y=2.0, yaw=0.4, length=0.2, width=0.1),)) == pytest.approx(
        (1.0, 2.0, hypot(0.2, 0.1) / 2)
    )


def test_bounding_circle_of_three_equal_discs_in_a_triangle() -> None:
    """Side 1, radius 0.1: the corners' circle of radius 1 / sqrt(3), and 0.1 more."""
    shapes = tuple(Disc(x=x, y=y, radius=0.1) for x, y in ((0, 0), (1, 0), (0.5, 3**0.5 / 2)))
    assert bounding_circle(shapes) == pytest.approx((0.5, 3**0.5 / 6, 1 / 3**0.5 + 0.1))


@given(boxes, place, place, st.floats(-3, 3))
def test_moved_corners_are_turned_corners(box: Box, x: float, y: float, yaw: float) -> None:
    turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
    expected = np.array(corners(box)) @ turn.T + [x, y]
    assert np.array(corners(moved(box, x, y, yaw))) == pytest.approx(expected, abs=1e-12)  # type: ignore[arg-type]


def test_corner_order_is_counter_clockwise() -> None:
    points = np.array(corners(Box(length=2.0, width=1.0, yaw=pi / 5)))
    ahead = np.roll(points, -1, axis=0)
    assert np.sum(points[:, 0] * ahead[:, 1] - ahead[:, 0] * points[:, 1]) / 2 == pytest.approx(2.0)
