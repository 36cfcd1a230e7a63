"""Every message on the bus: our own, generated from the .proto files beside, and Foxglove's."""

from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.ImageAnnotations_pb2 import ImageAnnotations
from foxglove_schemas_protobuf.LaserScan_pb2 import LaserScan
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.PointsAnnotation_pb2 import PointsAnnotation

from runtime.messages.base_pb2 import Charger, Count, MotionLimits, Odometry, RangeArray, RobotStatus, VelocityCommand
from runtime.messages.geometry_pb2 import Polyline, Pose2, Twist2, Vector2
from runtime.messages.link_pb2 import HttpAnswer, HttpFault, HttpRequest, SerialData
from runtime.messages.push_pb2 import (
    CancelRequest,
    Corridor,
    FailureCause,
    PushBehaviour,
    PushGoal,
    PushOutcome,
    PushPhase,
    PushPlan,
    PushResponse,
    PushStatus,
    PushTarget,
)
from runtime.messages.session_pb2 import (
    Alive,
    EntryKind,
    Health,
    InputHealth,
    Journal,
    RecordingQuery,
    RecordingStart,
    RecordingStatus,
    RecordingStop,
    Reply,
    Request,
    Snapshot,
)
from runtime.messages.world_pb2 import ObjectState, OccupancyGrid, RobotPose, SeenFloor, Truth, Visibility

__all__ = [
    "Alive",
    "CameraCalibration",
    "CancelRequest",
    "Charger",
    "CompressedImage",
    "Corridor",
    "Count",
    "EntryKind",
    "FailureCause",
    "FrameTransform",
    "Health",
    "HttpAnswer",
    "HttpFault",
    "HttpRequest",
    "ImageAnnotations",
    "InputHealth",
    "Journal",
    "LaserScan",
    "Log",
    "MotionLimits",
    "ObjectState",
    "OccupancyGrid",
    "Odometry",
    "PointsAnnotation",
    "Polyline",
    "Pose2",
    "PushBehaviour",
    "PushGoal",
    "PushOutcome",
    "PushPhase",
    "PushPlan",
    "PushResponse",
    "PushStatus",
    "PushTarget",
    "RangeArray",
    "RecordingQuery",
    "RecordingStart",
    "RecordingStatus",
    "RecordingStop",
    "Reply",
    "Request",
    "RobotPose",
    "RobotStatus",
    "SeenFloor",
    "SerialData",
    "Snapshot",
    "Truth",
    "Twist2",
    "Vector2",
    "VelocityCommand",
    "Visibility",
]
