"""The one table of topics: message type, delivery and expected rate of everything on the bus.

A topic has one publisher, so (topic, sequence) names a message. Topics of the runtime itself exist once for
every node and are made by the functions at the end.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Any, Generic, TypeVar

from google.protobuf.message import Message

from runtime import messages as m

M = TypeVar("M", bound=Message)


class Delivery(Enum):
    """What a consumer's queue keeps when its service is busy."""

    RELIABLE = "reliable"  # every message, in order
    LATEST = "latest"  # only the newest; an older one that still waits is dropped and counted


@dataclass(frozen=True)
class Topic(Generic[M]):
    """A row of the table.

    Attributes:
        rate: expected rate in Hz; None for topics published on change or on request.
        latched: a late joiner gets the last value at once.
        scoring_only: for experiments and pictures; services may not subscribe.
        tolerance: largest absolute difference of a field that replay accepts where it cannot compare bytes because
            CPU features or package versions differ from the recording's.
        tolerances: the same by field path or its beginning, where fields differ in what may be accepted.
    """

    name: str
    message: type[M]
    rate: float | None = None
    delivery: Delivery = Delivery.RELIABLE
    latched: bool = False
    scoring_only: bool = False
    tolerance: float = 1e-6
    tolerances: tuple[tuple[str, float], ...] = ()

    def allowed(self, path: str) -> float:
        """Return the tolerance of the field at `path`, such as twist.vx or ranges[]."""
        fitting = [(name, value) for name, value in self.tolerances if path.startswith(name)]
        return max(fitting, key=lambda item: len(item[0]))[1] if fitting else self.tolerance


# What the simulated world gives depends on contacts, where last digits grow: centimetres within the 5 s between two
# snapshots. What services compute from recorded inputs does not.
ODOMETRY = Topic("odometry", m.Odometry, rate=20, tolerances=(("pose", 0.02), ("twist", 0.05), ("covariance", 1e-3)))
SCAN = Topic("scan", m.LaserScan, rate=10, delivery=Delivery.LATEST, tolerances=(("ranges", 0.2),))
RANGES = Topic("ranges", m.RangeArray, rate=20, delivery=Delivery.LATEST, tolerances=(("distance", 0.2),))
STATUS = Topic("status", m.RobotStatus, rate=5, latched=True)
# What a driver and its base say to each other over a wire; only where the base has one. Over HTTP as often as is set.
SERIAL_SENT = Topic("serial/sent", m.SerialData, rate=50)
SERIAL_RECEIVED = Topic("serial/received", m.SerialData, rate=50)
HTTP_REQUEST = Topic("http/request", m.HttpRequest)
HTTP_ANSWER = Topic("http/answer", m.HttpAnswer)
# A camera's picture is drawn by the machine's graphics: where that differs, pictures do.
IMAGE = Topic("image", m.CompressedImage, rate=10, delivery=Delivery.LATEST)
DEPTH = Topic("depth", m.CompressedImage, rate=10, delivery=Delivery.LATEST)
CALIBRATION = Topic("calibration", m.CameraCalibration, latched=True)
CAMERA_MOUNT = Topic("camera/mount", m.FrameTransform, latched=True)
IMAGE_ANNOTATIONS = Topic("image/annotations", m.ImageAnnotations, rate=10, delivery=Delivery.LATEST)
SEEN_FLOOR = Topic("floor", m.SeenFloor, rate=5, delivery=Delivery.LATEST)
ROBOT_POSE = Topic("robot/pose", m.RobotPose, rate=20, delivery=Delivery.LATEST)
MAP = Topic("map", m.OccupancyGrid, latched=True)
OBJECT_STATE = Topic("object/state", m.ObjectState, rate=20, delivery=Delivery.LATEST)
PUSH_GOAL = Topic("push/goal", m.PushGoal, latched=True)
CORRIDOR = Topic("corridor", m.Corridor, latched=True)
PUSH_TARGET = Topic("push/target", m.PushTarget, rate=20)
PUSH_BEHAVIOUR = Topic("push/behaviour", m.PushBehaviour, rate=20)
PUSH_RESPONSE = Topic("push/response", m.PushResponse, rate=20, delivery=Delivery.LATEST)
ALIVE = Topic("alive", m.Alive, latched=True)
COMMAND = Topic("command", m.VelocityCommand, rate=20, delivery=Delivery.LATEST)
PUSH_STATUS = Topic("push/status", m.PushStatus, rate=5, latched=True)
_TRUTH = (("robot.", 0.02), ("object.", 0.05), ("robot_twist", 0.05), ("object_twist", 0.1))
TRUTH = Topic("truth", m.Truth, rate=20, scoring_only=True, tolerances=_TRUTH)

_TABLE: tuple[Topic[Any], ...] = (
    ODOMETRY,
    SCAN,
    RANGES,
    STATUS,
    SERIAL_SENT,
    SERIAL_RECEIVED,
    HTTP_REQUEST,
    HTTP_ANSWER,
    IMAGE,
    DEPTH,
    CALIBRATION,
    CAMERA_MOUNT,
    IMAGE_ANNOTATIONS,
    SEEN_FLOOR,
    ROBOT_POSE,
    MAP,
    OBJECT_STATE,
    PUSH_GOAL,
    CORRIDOR,
    PUSH_TARGET,
    PUSH_BEHAVIOUR,
    PUSH_RESPONSE,
    ALIVE,
    COMMAND,
    PUSH_STATUS,
    TRUTH,
)
TOPICS: dict[str, Topic[Any]] = {topic.name: topic for topic in _TABLE}


def journal(node: str) -> Topic[m.Journal]:
    """What `node` consumed and produced, in order, in batches."""
    return Topic(f"journal/{node}", m.Journal, rate=10)


def snapshot(node: str) -> Topic[m.Snapshot]:
    """The whole state of `node`, now and then."""
    return Topic(f"snapshot/{node}", m.Snapshot, latched=True)


def health(node: str) -> Topic[m.Health]:
    """Handler times, queue lengths and drops of `node`; live mode only."""
    return Topic(f"health/{node}", m.Health, rate=1, latched=True)


def request(node: str) -> Topic[m.Request]:
    """Requests that `node` was asked, as they came."""
    return Topic(f"request/{node}", m.Request)


def reply(node: str) -> Topic[m.Reply]:
    """The answers of `node` to its requests."""
    return Topic(f"reply/{node}", m.Reply)


def log(node: str) -> Topic[m.Log]:
    """What `node` has to say in words."""
    return Topic(f"log/{node}", m.Log)
