"""What the task takes for a goal, and what it refuses, with words."""

from __future__ import annotations

import math

import pytest

from runtime.guard import Guard
from runtime.messages import ObjectState, PushGoal, PushStatus, Reply, Request, Vector2, Visibility
from runtime.node import Node
from runtime.sample import Sample
from services.names import method
from services.task.config import TaskConfig
from services.task.service import TaskService


def answered(goal: PushGoal, yaw: float | None = 0.3) -> tuple[Reply, list[Sample]]:
    """Return the answer of a task that sees an object, with an orientation or without, and what it published."""
    with Guard() as guard:
        node = Node(TaskService(TaskConfig()), guard)
        node.begin(0)
        seen = ObjectState(
            stamp=1, position=Vector2(x=1.0, y=1.0), diameter=0.3, visibility=Visibility.VISIBLE, yaw=yaw
        )
        node.consume(Sample("object/state", 1, 1, seen.SerializeToString()), 1, 1)
        samples = node.ask(Request(id=1, name="push/goal", payload=goal.SerializeToString()), 2, 2)
    answers = [Reply.FromString(samples[-1].payload)]
    return answers[0], samples[:-1]


@pytest.mark.parametrize(
    ("changes", "yaw", "why"),
    [
        ({"yaw": 0.5, "strategy": "strict"}, 0.3, "strategy 'strict' does not turn objects"),
        ({"yaw": 0.5, "strategy": "predictive"}, None, "does not see this object's orientation"),
        ({"yaw_precision": 0.2}, 0.3, "yaw_precision is of no use without yaw"),
        ({"yaw": 0.5, "yaw_precision": 4.0, "strategy": "predictive"}, 0.3, "yaw_precision 4.0 rad is not from 0.05"),
        ({"yaw": 0.5, "yaw_precision": 0.01, "strategy": "predictive"}, 0.3, "yaw_precision 0.01 rad is not from 0.05"),
        ({"precision": 0.001}, 0.3, "precision 0.001 m is below"),
        ({"strategy": "bang"}, 0.3, "no strategy is called 'bang'"),
        ({"time_limit": -1.0}, 0.3, "time limit -1.0 s is below 0"),
    ],
)
def test_what_cannot_be_done_is_refused(changes: dict[str, object], yaw: float | None, why: str) -> None:
    answer, _ = answered(PushGoal(position=Vector2(x=2.0, y=1.0), **changes), yaw)  # type: ignore[arg-type]
    assert not answer.accepted
    assert why in answer.reason


@pytest.mark.parametrize(
    ("named", "taken"),
    [
        (("", ""), ("predictive", "predictive")),
        (("predictive", ""), ("predictive", "predictive")),
        (("relaxed", ""), ("relaxed", "adaptive")),
        (("", "dipole"), ("strict", "dipole")),
        (("", "predictive"), ("predictive", "predictive")),
        (("predictive", "adaptive"), ("predictive", "adaptive")),
    ],
)
def test_what_is_not_named_goes_with_what_is(named: tuple[str, str], taken: tuple[str, str]) -> None:
    strategy, controller = named
    answer, samples = answered(PushGoal(position=Vector2(x=2.0, y=1.0), strategy=strategy, controller=controller))
    assert answer.accepted, answer.reason
    goal = next(PushGoal.FromString(one.payload) for one in samples if one.topic == "push/goal")
    assert (goal.strategy, goal.controller) == taken


def test_configured_halves_stay_where_they_go_together() -> None:
    assert method("", "dipole", ("relaxed", "adaptive")) == ("relaxed", "dipole")
    assert method("switching", "", ("relaxed", "centroid")) == ("switching", "centroid")
    assert method("", "", ("strict", "adaptive")) == ("strict", "adaptive")


def test_an_orientation_is_taken_with_its_default_precision() -> None:
    answer, samples = answered(PushGoal(position=Vector2(x=2.0, y=1.0), yaw=0.5, strategy="predictive"))
    assert answer.accepted, answer.reason
    taken = next(PushGoal.FromString(one.payload) for one in samples if one.topic == "push/goal")
    assert math.degrees(taken.yaw_precision) == pytest.approx(15.0, abs=0.01)
    assert taken.yaw == 0.5
    status = next(PushStatus.FromString(one.payload) for one in samples if one.topic == "push/status")
    assert status.distance_left == 1.0
