import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.geometry.angles import DegenerateDirection
from services.learner.movement import Accept, MovementState, TimeOrder, alpha, observe

coordinates = st.tuples(st.floats(-5, 5), st.floats(-5, 5)).map(np.array)


def rotation(theta: float) -> np.ndarray:
    return np.array([[math.cos(theta), -math.sin(theta)], [math.sin(theta), math.cos(theta)]])


def test_alpha_of_figure_6() -> None:
    r, o = np.array((0.0, 0.0)), np.array((0.5, 0.0))
    assert alpha(r, o, np.array((2.0, 0.0))) == 0.0
    assert alpha(r, o, np.array((0.5, 1.0))) == pytest.approx(math.pi / 2)
    assert alpha(r, o, np.array((0.5, -1.0))) == pytest.approx(-math.pi / 2)
    assert alpha(r, o, np.array((-2.0, 0.0))) == math.pi


@given(coordinates, coordinates, coordinates, st.floats(-3, 3))
def test_alpha_turns_the_robots_line_into_the_push_line(
    r: np.ndarray, o: np.ndarray, t: np.ndarray, theta: float
) -> None:
    if min(np.hypot(*(o - r)), np.hypot(*(t - o))) < 1e-3:
        return
    found = alpha(r, o, t)
    turned = rotation(found) @ (o - r) / np.hypot(*(o - r))
    assert turned == pytest.approx((t - o) / np.hypot(*(t - o)), abs=1e-9)
    matrix = rotation(theta)
    moved = alpha(matrix @ r, matrix @ o, matrix @ t)
    assert math.cos(moved - found) == pytest.approx(1.0, abs=1e-9)


def test_alpha_needs_three_points() -> None:
    with pytest.raises(DegenerateDirection):
        alpha(np.zeros(2), np.ones(2), np.ones(2))


def drive(headings: list[float], desired: float = 0.0, step: float = 0.01, accept: Accept = Accept.DECREASING):
    """Move an object `step` m a tick at 20 Hz in the given directions and return the state and the readings."""
    state, o, readings = MovementState(), np.zeros(2), []
    readings.append(observe(state, 0.0, o, desired, accept=accept))
    for k, heading in enumerate(headings, 1):
        o = o + step * np.array((math.cos(heading), math.sin(heading)))
        readings.append(observe(state, 0.05 * k, o, desired, accept=accept))
    return state, readings


def test_gamma_is_desired_less_executed() -> None:
    _, readings = drive([0.4] * 10, desired=0.1)
    assert [r.moving for r in readings[:5]] == [False, False, False, True, True]
    assert readings[-1].gamma == pytest.approx(-0.3)
    assert readings[-1].mean_gamma == pytest.approx(-0.3)


def test_gamma_is_wrapped() -> None:
    _, readings = drive([3.1] * 6, desired=-3.1)
    assert readings[-1].gamma == pytest.approx(math.tau - 6.2)


def test_the_direction_is_that_since_the_newest_point_far_enough() -> None:
    # After a corner, 0.03 m of travel on the new side are forgotten about the old one.
    _, readings = drive([0.0] * 10 + [math.pi / 2] * 3)
    assert readings[-1].gamma == pytest.approx(-math.pi / 2)
    assert abs(readings[-2].gamma) < math.pi / 2 - 0.1


def test_slow_travel_gives_no_reading() -> None:
    _, readings = drive([0.0] * 100, step=0.0012)
    assert not any(r.moving for r in readings)
    _, readings = drive([0.0] * 100, step=0.0016)
    assert readings[-1].moving


def test_the_state_holds_no_more_than_its_memory() -> None:
    state, _ = drive([0.0] * 200)
    assert len(state.times) == len(state.positions) == 21


def test_the_mean_is_over_all_readings() -> None:
    rng = np.random.default_rng(0)
    state, readings = drive(list(rng.normal(0, 0.5, 60)))
    moving = [r.gamma for r in readings if r.moving]
    assert state.readings == len(moving)
    assert state.mean_gamma == pytest.approx(np.mean(moving))


def test_decreasing_accepts_what_is_less_than_before() -> None:
    _, readings = drive(list(np.random.default_rng(1).normal(0, 0.8, 80)))
    for before, now in pairwise(readings):
        expected = before.moving and now.moving and abs(now.gamma) < abs(before.gamma)
        assert now.good == expected


def test_small_accepts_what_is_below_the_limit() -> None:
    _, readings = drive(list(np.random.default_rng(1).normal(0, 0.8, 80)), accept=Accept.SMALL)
    for now in readings:
        assert now.good == (now.moving and abs(now.gamma) < 0.3)
    assert any(r.good for r in readings)


def test_a_pause_ends_a_run_of_readings() -> None:
    state, _ = drive([0.2] * 10)
    still = state.positions[-1].copy()
    for k in range(30):
        last = observe(state, 1.0 + 0.05 * k, still, 0.0)
    assert not last.moving
    assert last.gamma == pytest.approx(-0.2)
    again = observe(state, 2.5, still + np.array((0.1, 0.0)), 0.0)
    assert again.moving
    assert not again.good


def test_time_must_go_forward() -> None:
    state = MovementState()
    observe(state, 1.0, np.zeros(2), 0.0)
    with pytest.raises(TimeOrder):
        observe(state, 1.0, np.zeros(2), 0.0)
