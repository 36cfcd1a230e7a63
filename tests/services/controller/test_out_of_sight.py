"""What the controller does while the object is only predicted, or lost: slower, then no push, and it looks for it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from runtime.messages import (
    Corridor,
    MotionLimits,
    ObjectState,
    Odometry,
    Pose2,
    PushBehaviour,
    PushGoal,
    PushTarget,
    RobotPose,
    RobotStatus,
    Vector2,
    VelocityCommand,
    Visibility,
)
from runtime.time import SECOND, Time
from services.controller.config import ControllerConfig
from services.controller.heading import sweep
from services.controller.service import ControllerService

RATE = 0.5


def controller(visibility: Visibility, theta: float = 0.0, **config: float) -> ControllerService:
    """Return a controller in the middle of a push, the object 0.4 m ahead on the map."""
    service = ControllerService(ControllerConfig(**config))
    limits = MotionLimits(speed=1.0, angular_speed=3.0, acceleration=0.4, angular_acceleration=3.0, lag=0.1)
    o, g = Vector2(x=0.4, y=0.0), Vector2(x=4.0, y=0.0)
    x = np.linspace(-1.0, 4.0, 101).tolist()
    corridor = Corridor(version=1, goal_id=1, found=True, robot_diameter=0.45, object_diameter=0.3)
    corridor.path.x.extend(x)
    corridor.path.y.extend([0.0] * 101)
    corridor.clearance.extend([1.5] * 101)
    messages = {
        "odometry": Odometry(stamp=SECOND, driver_sequence=7),
        "status": RobotStatus(diameter=0.45, limits=limits),
        "robot/pose": RobotPose(stamp=SECOND, pose=Pose2(theta=theta)),
        "object/state": ObjectState(stamp=SECOND, position=o, diameter=0.3, visibility=visibility),
        "push/goal": PushGoal(id=1, active=True, controller="adaptive", position=g),
        "corridor": corridor,
        "push/target": PushTarget(stamp=SECOND, corridor_version=1, target=Vector2(x=1.4), object=o),
        "push/behaviour": PushBehaviour(stamp=SECOND, kappa=5.0),
    }
    for topic, message in messages.items():
        service.latest[topic] = message
        handler = service.contract.handlers.get(topic)
        if handler is not None:
            list(getattr(service, handler)(message, SECOND) or ())
    return service


def command(service: ControllerService, now: Time = SECOND) -> VelocityCommand:
    (found,) = service.control(now)
    assert isinstance(found.message, VelocityCommand)  # type: ignore[union-attr]
    return found.message  # type: ignore[union-attr]


def test_it_goes_on_with_half_the_speed_while_the_object_is_predicted() -> None:
    seen, predicted = (command(controller(kind)).twist for kind in (Visibility.VISIBLE, Visibility.PREDICTED))
    assert seen.vx == pytest.approx(0.3, abs=0.01)
    assert (predicted.vx, predicted.vy) == pytest.approx((0.5 * seen.vx, 0.5 * seen.vy))
    stopped = command(controller(Visibility.PREDICTED, predicted_share=0.0)).twist
    assert (stopped.vx, stopped.vy) == (0.0, 0.0)


@pytest.mark.parametrize("theta", [-1.0, 1.0])
def test_it_turns_to_where_a_lost_object_should_be_and_goes_nowhere(theta: float) -> None:
    twist = command(controller(Visibility.LOST, theta)).twist
    assert (twist.vx, twist.vy) == (0.0, 0.0)
    assert twist.omega == pytest.approx(-math.copysign(RATE, theta))
    still = command(controller(Visibility.LOST, theta, seek=0.0)).twist
    assert (still.vx, still.vy, still.omega) == (0.0, 0.0, 0.0)


def test_it_does_not_look_for_an_object_that_nobody_wants_moved() -> None:
    service = controller(Visibility.LOST, 1.0)
    service.latest["push/goal"] = PushGoal(id=1, active=False, controller="adaptive")
    assert command(service).twist.omega == 0.0
    service = controller(Visibility.LOST, 1.0)
    assert command(service, 3 * SECOND).twist.omega == 0.0, "nothing is known of now"


def test_it_looks_to_both_sides() -> None:
    angles = np.array([sweep(0.05 * k, RATE) for k in range(600)])
    assert angles[0] == 0.0
    assert np.abs(np.diff(angles)).max() <= 0.05 * RATE + 1e-9
    quarter = angles[: round(2 * math.pi / RATE / 0.05) // 2]
    assert quarter.max() == pytest.approx(math.pi / 4, abs=0.03)
    assert quarter.min() == pytest.approx(-math.pi / 4, abs=0.03)
    assert angles.max() >= math.pi / 2 - 0.03 and angles.min() <= -math.pi / 2 + 0.03


@given(st.floats(0.0, 200.0), st.floats(0.1, 3.0))
def test_it_never_looks_faster_than_it_may(time: float, rate: float) -> None:
    step = 0.01
    assert abs(sweep(time + step, rate) - sweep(time, rate)) <= rate * step + 1e-9


def test_in_the_end_it_looks_all_around() -> None:
    legs = 2.0 * (0.25 + 0.25 + 0.5 + 0.5) * math.pi / RATE
    found = {round(math.remainder(sweep(legs + 0.05 * k, RATE), math.tau), 1) for k in range(300)}
    assert len(found) > 60
