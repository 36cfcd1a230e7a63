from __future__ import annotations

import math
from collections.abc import Iterator

from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
from google.protobuf.descriptor import FieldDescriptor
from google.protobuf.message import Message
from hypothesis import given
from hypothesis import strategies as st

from runtime.finite import nonfinite, surely_finite
from runtime.messages import (
    Corridor,
    LaserScan,
    ObjectState,
    Odometry,
    Polyline,
    Pose2,
    PushGoal,
    Truth,
    VelocityCommand,
)

BAD = st.sampled_from([math.nan, math.inf, -math.inf])
FINITE = st.floats(allow_nan=False, allow_infinity=False)


def full_corridor() -> Corridor:
    corridor = Corridor(stamp=1, clearance=[0.1, 0.2, 0.3], width_push=[1.0], robot_diameter=0.5, object_diameter=1)
    corridor.path.x.extend([1, 2, 3])
    corridor.path.y.extend([1, 2, 3])
    corridor.edge_push.extend([Polyline(x=[1, 2], y=[3, 4]), Polyline(x=[5], y=[6])])
    return corridor


def full_truth() -> Truth:
    truth = Truth(stamp=1)
    for name in ("robot", "object"):
        getattr(truth, name).theta = 1
        getattr(truth, f"{name}_twist").omega = 1
    return truth


def full_scan() -> LaserScan:
    scan = LaserScan(frame_id="base", start_angle=-1, end_angle=1, ranges=[1, 2, 3], intensities=[4, 5])
    scan.pose.position.x = 1
    scan.pose.orientation.w = 1
    return scan


FULL = [
    full_corridor(),
    full_truth(),
    full_scan(),
    PushGoal(precision=0.1, yaw=0.3, time_limit=1, position={"x": 1, "y": 2}),
    ObjectState(yaw=0.0, covariance=[1, 2, 3, 4], position={"x": 1}),
    VelocityCommand(psi_push=1, twist={"vx": 1}),
]


def places(message: Message, path: str = "") -> Iterator[str]:
    """Return the path of every float that is in `message`, in the order of the field numbers' declaration."""
    for field in message.DESCRIPTOR.fields:
        value = getattr(message, field.name)
        if field.type in (FieldDescriptor.TYPE_DOUBLE, FieldDescriptor.TYPE_FLOAT):
            if field.is_repeated:
                yield from (f"{path}{field.name}[{index}]" for index in range(len(value)))
            else:
                yield f"{path}{field.name}"
        elif field.type == FieldDescriptor.TYPE_MESSAGE:
            if field.is_repeated:
                for index, inner in enumerate(value):
                    yield from places(inner, f"{path}{field.name}[{index}].")
            elif message.HasField(field.name):
                yield from places(value, f"{path}{field.name}.")


def put(message: Message, path: str, value: float) -> None:
    """Set the float at `path`."""
    *parents, last = path.split(".")
    target = message
    for part in parents:
        name, _, index = part.rstrip("]").partition("[")
        target = getattr(target, name)[int(index)] if index else getattr(target, name)
    name, _, index = last.rstrip("]").partition("[")
    if index:
        getattr(target, name)[int(index)] = value
    else:
        setattr(target, name, value)


@given(st.sampled_from(FULL), st.data(), BAD)
def test_a_number_that_is_not_finite_is_found_wherever_it_is(example: Message, data: st.DataObject, bad: float) -> None:
    message = type(example).FromString(example.SerializeToString())
    assert nonfinite(message) is None
    path = data.draw(st.sampled_from(list(places(message))))
    put(message, path, bad)
    assert nonfinite(message) == path


@given(st.sampled_from(FULL), st.data(), BAD, BAD)
def test_of_several_the_first_is_reported(example: Message, data: st.DataObject, one: float, two: float) -> None:
    message = type(example).FromString(example.SerializeToString())
    paths = list(places(message))
    chosen = sorted(data.draw(st.lists(st.integers(0, len(paths) - 1), min_size=2, max_size=2)))
    put(message, paths[chosen[1]], two)
    put(message, paths[chosen[0]], one)
    assert nonfinite(message) == paths[chosen[0]]


@given(st.lists(st.sampled_from([1e308, -1e308, 1.7e308]) | FINITE, max_size=8))
def test_big_finite_numbers_are_finite_though_their_sum_is_not(values: list[float]) -> None:
    assert nonfinite(Odometry(covariance=values)) is None


def test_opposite_infinities_do_not_cancel() -> None:
    assert nonfinite(Odometry(covariance=[0.0, math.inf, -math.inf])) == "covariance[1]"


def test_an_absent_optional_or_inner_message_is_finite_and_stays_absent() -> None:
    goal = PushGoal()
    assert nonfinite(goal) is None
    assert not goal.HasField("position") and not goal.HasField("yaw")


def test_messages_without_floats_are_finite() -> None:
    assert nonfinite(SceneEntity(id="x")) is None


@given(st.sampled_from(FULL), st.data(), BAD)
def test_bytes_that_hold_a_number_that_is_not_finite_are_never_called_finite(
    example: Message, data: st.DataObject, bad: float
) -> None:
    message = type(example).FromString(example.SerializeToString())
    put(message, data.draw(st.sampled_from(list(places(message)))), bad)
    assert not surely_finite(message.SerializeToString())


def test_bytes_of_usual_messages_are_called_finite() -> None:
    assert surely_finite(Odometry(stamp=2**40, pose=Pose2(x=1.5, y=-2.5)).SerializeToString())
    assert surely_finite(b"")
