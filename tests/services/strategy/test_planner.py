"""What the planner goes on from: how a plan ages, when it is held, what is tried where nothing moves."""

from __future__ import annotations

import math

import numpy as np
import pytest

from runtime.messages import ObjectState, Pose2, PushGoal, RobotPose, Vector2, Visibility
from services.geometry.corridor import CorridorGeometry
from services.predictive import model as m
from services.predictive.candidates import AFTER, AFTER_STAND, AHEAD, BODY_OF, CANDIDATE, SPEED_OF, STAND_OF
from services.predictive.situation import Lane
from services.strategy import predictive
from services.strategy.config import PredictiveConfig
from services.strategy.predictive import PlannerState

SECOND = 1_000_000_000
PATH = np.column_stack([np.arange(0.0, 4.01, 0.05), np.zeros(81)])
CORRIDOR = CorridorGeometry.of(PATH, 0, np.full(81, 0.93), 0.46, 0.4)
LANE = Lane.of(CORRIDOR)
BASE = np.array([0.4, 0.1, 0.23])
CONTOUR = m.prior_contour(0.46, 0.4)
RESPONSE = m.prior_response(0.4)
GOAL = PushGoal(id=1, position=Vector2(x=4.0, y=0.0), precision=0.05, active=True)
TURNED = PushGoal(id=1, position=Vector2(x=4.0, y=0.0), precision=0.05, active=True, yaw=1.0, yaw_precision=0.26)


def see(state: PlannerState, now: int, x: float = 1.0, yaw: float = 0.0) -> None:
    """Let the planner see the object at (x, 0) with the robot behind it, and nothing before."""
    state.track.time = 0
    state.track.robot_seen(RobotPose(stamp=now, pose=Pose2(x=x - CONTOUR.mean() - 0.005, y=0.0, theta=0.0)))
    seen = ObjectState(stamp=now, position=Vector2(x=x, y=0.0), diameter=0.4, visibility=Visibility.VISIBLE, yaw=yaw)
    state.track.object_seen(seen, BASE, CONTOUR, RESPONSE)


def planned(state: PlannerState, now: int, goal: PushGoal = GOAL, x: float = 1.0, yaw: float = 0.0) -> None:
    """Plan once, at `now`, ns."""
    see(state, now, x, yaw)
    predictive.choose(
        state, PredictiveConfig(), CORRIDOR, LANE, BASE, CONTOUR, RESPONSE, 50, goal, now
    )  # fmt: skip


def two_pushes() -> list[float]:
    row = np.zeros(CANDIDATE)
    row[[AHEAD, SPEED_OF, BODY_OF, STAND_OF, AFTER, AFTER_STAND]] = 0.3, 1.0, 1.0, 3.0, 0.5, 2.0
    return row.tolist()


def followed(now: int, before: int, *, pushing: bool, walking: float = 0.0) -> PlannerState:
    """Return the state after what was planned at `before` has been carried out until `now`, ns."""
    state = PlannerState(
        favourite=two_pushes(), walking=walking, pushing=pushing, planned=before, chosen=before, since=before
    )
    see(state, now)
    predictive._follow(state, state.track.state, CONTOUR, GOAL, now)
    return state


@pytest.mark.parametrize(("pushing", "walking", "left"), [(True, 0.0, 0.95), (False, 0.0, 1.0), (False, 1.0, 1.0)])
def test_a_plan_ages_only_by_pushing(pushing: bool, walking: float, left: float) -> None:
    state = followed(10 * SECOND, 10 * SECOND - SECOND // 20, pushing=pushing, walking=walking)
    assert state.favourite[BODY_OF] == pytest.approx(left)
    assert (state.walked == 10 * SECOND) == (walking == 1.0)


def test_while_nobody_plans_a_plan_hardly_ages_and_no_patience_is_lost() -> None:
    """The object was lost for 5 s: the base stood, as the controller makes it."""
    state = PlannerState(favourite=two_pushes(), pushing=True, planned=10 * SECOND, since=9 * SECOND)
    state.anchor = [1.0, 0.0, 0.0]
    see(state, 15 * SECOND)
    predictive._follow(state, state.track.state, CONTOUR, GOAL, 15 * SECOND)
    assert state.favourite[BODY_OF] == pytest.approx(0.85)
    assert (15 * SECOND - state.since) * 1e-9 == pytest.approx(1.15)


@pytest.mark.parametrize("now", [SECOND // 2, 100 * SECOND])
def test_what_has_done_what_it_was_chosen_for_is_held_no_longer(now: int) -> None:
    """At the start of the clock as well, where little time has passed since anything."""
    for after, begun in ((0.5, now - SECOND // 4), (0.0, now - 8 * SECOND)):
        state = PlannerState(favourite=two_pushes(), pushing=True, planned=now - SECOND // 20, chosen=now - SECOND // 4)
        state.favourite[BODY_OF], state.favourite[AFTER] = 0.04, after
        see(state, now)
        predictive._follow(state, state.track.state, CONTOUR, GOAL, now)
        assert state.favourite[BODY_OF] == pytest.approx(after, abs=0.011)
        assert state.chosen == begun


def test_a_plan_that_began_with_a_walk_is_held_and_one_that_disappoints_is_not() -> None:
    now = 100 * SECOND
    row = np.zeros(CANDIDATE)
    row[[AHEAD, SPEED_OF]] = 0.05, 0.5  # none that would be chosen: slow, and steered by what is right before it
    found = {}
    for promised in (30.0, -30.0):
        state = PlannerState(
            favourite=row.tolist(), planned=now, chosen=now - SECOND, walked=now - SECOND // 2, since=now,
            promised=promised,
        )  # fmt: skip
        planned(state, now)
        found[promised] = state.favourite == row.tolist()
    assert found == {30.0: True, -30.0: False}


def test_the_object_moves_where_it_turns_only_if_its_orientation_counts() -> None:
    for goal, moved in ((GOAL, False), (TURNED, True)):
        state = PlannerState(anchor=[1.0, 0.0, 0.0], since=SECOND, planned=19 * SECOND)
        see(state, 19 * SECOND + SECOND // 20, yaw=0.2)
        predictive._follow(state, state.track.state, CONTOUR, goal, 19 * SECOND + SECOND // 20)
        assert (state.since > SECOND) == moved


def whims(idle: float, *, speed: float, chosen: float, tried: float) -> np.ndarray:
    """Return the whims of 200 candidates, with ages in s: since when nothing moves, and of the last choices."""
    now = 1000 * SECOND
    state = PlannerState(since=now - round(idle * SECOND), chosen=now - round(chosen * SECOND))
    state.tried = now - round(tried * SECOND)
    start = np.zeros(m.STATE)
    start[m.RVX] = speed
    return predictive._whims(state, start, 200, now)


def test_nothing_is_tried_while_something_moves() -> None:
    assert not whims(7.9, speed=0.0, chosen=100.0, tried=100.0).any()


@pytest.mark.parametrize(
    ("speed", "chosen", "tried", "drawn"),
    [
        (0.0, 0.5, 1.5, True),  # stands: another, at once
        (0.0, 0.5, 0.5, False),  # but not at every tick
        (0.1, 5.0, 5.0, False),  # moves: it is given time
        (0.1, 9.0, 9.0, True),
    ],
)
def test_what_is_tried_is_given_time_while_it_moves(speed: float, chosen: float, tried: float, drawn: bool) -> None:
    found = whims(20.0, speed=speed, chosen=chosen, tried=tried)
    if drawn:
        assert len(np.unique(found)) == 200
        assert found[:-37].max() == pytest.approx(0.7 * 12.0, rel=0.05) and found[:-37].min() < 0.5
        assert found[-37:].min() >= 15.0, "what led nowhere, and what is near to it"
    else:
        assert found[-1] == 0.0 and (found[:-1] == 15.0).all()


def test_whims_are_no_wilder_than_ten_seconds() -> None:
    assert 9.5 < whims(500.0, speed=0.0, chosen=9.0, tried=9.0)[:-37].max() <= 10.0
    assert math.isfinite(whims(1e6, speed=0.0, chosen=9.0, tried=9.0).sum())


def test_what_lies_within_the_precision_is_left_to_the_task_for_a_while() -> None:
    """At 40 mm of 50: plans aim at 30, and would push it. Noise may keep the task from judging: not for ever."""
    state, speeds = PlannerState(), []
    for k in range(60):
        now = 10 * SECOND + k * SECOND // 20
        see(state, now, x=3.96)
        _, message = predictive.choose(
            state, PredictiveConfig(), CORRIDOR, LANE, BASE, CONTOUR, RESPONSE, 50, GOAL, now
        )  # fmt: skip
        speeds.append(message.speed)
    assert speeds[:30] == [0.0] * 30
    assert speeds[30] > 0.0
    see(state, 20 * SECOND, x=3.9)
    predictive.choose(state, PredictiveConfig(), CORRIDOR, LANE, BASE, CONTOUR, RESPONSE, 50, GOAL, 20 * SECOND)
    assert state.arrived == 0
