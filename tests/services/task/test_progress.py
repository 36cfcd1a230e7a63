import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.task.progress import LEASH, PathLength, Progress


def follow(points: np.ndarray, leash: float = LEASH) -> float:
    path = PathLength()
    for x, y in points:
        path.add(x, y, leash)
    return path.length


@given(st.floats(0.0, 5.0), st.integers(1, 300))
def test_a_straight_way_has_its_length(length: float, steps: int) -> None:
    points = np.linspace(0, length, steps + 1)[:, None] * np.array((0.6, 0.8))
    assert follow(points) == pytest.approx(length)


def test_an_arc_is_short_by_the_stated_bias() -> None:
    a = np.linspace(0, 20 * math.tau, 200_00)
    circle = 0.3 * np.column_stack([np.cos(a), np.sin(a)])
    assert follow(circle) / (0.3 * a[-1]) == pytest.approx(1 - LEASH**2 / (2 * 0.3**2), abs=5e-4)


def test_noise_at_rest_does_not_add_up() -> None:
    rng = np.random.default_rng(0)
    noise = rng.normal(0, 0.007, (8000, 2))
    assert np.hypot(*np.diff(noise, axis=0).T).sum() > 90
    assert follow(noise) < 0.05


def test_noise_hardly_lengthens_a_way() -> None:
    rng = np.random.default_rng(1)
    points = np.column_stack([np.arange(0, 5, 0.015), np.zeros(334)])
    assert follow(points + rng.normal(0, 0.007, points.shape)) == pytest.approx(5, abs=0.15)


def circle(turns: float, steps: int = 200) -> Progress:
    progress = Progress()
    for a in np.linspace(0, turns * math.tau, steps):
        progress.add(np.array((1 + 0.4 * math.cos(a), 0.4 * math.sin(a))), np.array((1.0, 0.0)))
    return progress


def test_a_robot_that_goes_round_the_object_orbits() -> None:
    assert circle(1.1).orbiting()
    assert circle(-1.1).orbiting()
    assert not circle(0.9).orbiting()


def test_progress_makes_circling_start_anew() -> None:
    progress = circle(1.5)
    progress.progressed()
    assert not progress.orbiting()


def test_going_to_and_fro_is_no_orbit() -> None:
    progress = Progress()
    for a in np.tile([0.0, 1.0, 2.0, 1.0], 30):
        progress.add(np.array((math.cos(a), math.sin(a))), np.zeros(2))
    assert not progress.orbiting()


def test_lengths_of_both_are_kept_apart() -> None:
    progress = Progress()
    for s in np.linspace(0, 1, 50):
        progress.add(np.array((2 * s, 0.0)), np.array((0.0, s)))
    assert (progress.robot_length, progress.object_length) == pytest.approx((2.0, 1.0))
