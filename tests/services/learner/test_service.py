"""The learner's service: what it does with a yaw that is seen, is not, or comes into sight."""

from __future__ import annotations

import math

from runtime.messages import (
    MotionLimits,
    ObjectState,
    PushGoal,
    PushResponse,
    RobotPose,
    RobotStatus,
    Vector2,
    Visibility,
)
from runtime.service import Publication
from runtime.time import SECOND
from services.learner.config import LearnerConfig
from services.learner.service import LearnerService


def begun() -> LearnerService:
    """Return a learner of a push that has just begun."""
    service = LearnerService(LearnerConfig())
    goal = PushGoal(id=1, active=True, strategy="predictive", controller="predictive")
    service.latest["status"] = RobotStatus(diameter=0.45, limits=MotionLimits(acceleration=0.4, lag=0.1))
    service.latest["push/goal"] = goal
    service.forget(goal, SECOND)
    return service


def see(service: LearnerService, k: int, yaw: float | None) -> tuple[list[PushResponse], list[str]]:
    """Let the object be seen at the k-th time, and return what is published and said."""
    stamp = SECOND + k * SECOND // 20
    service.localised(RobotPose(stamp=stamp), stamp)
    seen = ObjectState(stamp=stamp, position=Vector2(x=1.0), diameter=0.3, visibility=Visibility.VISIBLE)
    if yaw is not None:
        seen.yaw = yaw
    told, said = [], []
    for one in service.answer(seen, stamp) or ():
        assert isinstance(one, Publication)
        if isinstance(one.message, PushResponse):
            told.append(one.message)
        else:
            said.append(one.message.message)  # type: ignore[attr-defined]
    return told, said


def test_a_yaw_that_is_seen_is_the_one_that_is_told() -> None:
    service = begun()
    for k in range(5):
        (told,), said = see(service, k, 0.7)
        assert told.yaw == 0.7
        assert not said
    assert service.state.experience is not None
    assert service.state.experience.heading is None


def test_a_yaw_that_comes_into_sight_ends_what_was_learned_without() -> None:
    service = begun()
    for k in range(5):
        (told,), said = see(service, k, None)
        assert math.isfinite(told.yaw)
        assert not said
    before = service.state.experience
    assert before is not None
    assert before.heading is not None
    (told,), said = see(service, 5, 0.7)
    assert said == ["the object's yaw is seen now: learning anew"]
    assert told.yaw == 0.7
    after = service.state.experience
    assert after is not None
    assert after is not before
    assert after.heading is None
    assert see(service, 6, 0.7)[1] == []
