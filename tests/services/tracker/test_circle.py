"""The smallest circle, against all circles through two and three points, and against scipy's search."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize

from services.tracker.circle import smallest_circle

METRES = st.floats(-5.0, 5.0).map(lambda x: round(x, 4))
POINTS = st.lists(st.tuples(METRES, METRES), min_size=1, max_size=9)


def brute_radius(points: np.ndarray) -> float:
    """The smallest radius of all circles on two or three points that hold all."""
    centres = [points[0]] + [(a + b) / 2 for a, b in combinations(points, 2)]
    for a, b, c in combinations(points, 3):
        sides = 2 * np.array([b - a, c - a])
        if abs(np.linalg.det(sides)) > 1e-9:
            centres.append(np.linalg.solve(sides, [b @ b - a @ a, c @ c - a @ a]))
    return min(np.hypot(*(points - centre).T).max() for centre in centres)


@given(POINTS)
def test_it_is_the_smallest_of_all_circles_that_hold_the_points(given_points: list[tuple[float, float]]) -> None:
    points = np.array(given_points)
    centre, diameter = smallest_circle(points)
    assert np.hypot(*(points - centre).T).max() <= diameter / 2 + 1e-9
    assert diameter / 2 == pytest.approx(brute_radius(points), abs=1e-7)


@pytest.mark.parametrize("seed", range(5))
def test_a_general_search_finds_none_smaller(seed: int) -> None:
    points = np.random.default_rng(seed).normal(size=(500, 2))
    centre, diameter = smallest_circle(points)
    found = minimize(lambda c: np.hypot(*(points - c).T).max(), points.mean(axis=0), method="Nelder-Mead", tol=1e-10)
    assert diameter / 2 == pytest.approx(found.fun, rel=1e-6)
    assert centre == pytest.approx(found.x, abs=1e-3)


@given(METRES, METRES, st.floats(0.01, 3.0), st.floats(0.0, 6.3))
def test_three_points_around_a_circle_give_it_back(x: float, y: float, radius: float, turn: float) -> None:
    angles = turn + np.array([0.0, 1.9, 4.2])
    points = np.array([x, y]) + radius * np.column_stack([np.cos(angles), np.sin(angles)])
    centre, diameter = smallest_circle(points)
    assert centre == pytest.approx([x, y], abs=1e-9)
    assert diameter == pytest.approx(2 * radius, abs=1e-9)


def test_no_points_have_no_circle() -> None:
    with pytest.raises(ValueError, match="no points"):
        smallest_circle(np.empty((0, 2)))
