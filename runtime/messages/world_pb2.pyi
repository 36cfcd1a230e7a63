from runtime.messages import geometry_pb2 as _geometry_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class Visibility(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    VISIBILITY_UNSPECIFIED: _ClassVar[Visibility]
    VISIBLE: _ClassVar[Visibility]
    PREDICTED: _ClassVar[Visibility]
    LOST: _ClassVar[Visibility]
VISIBILITY_UNSPECIFIED: Visibility
VISIBLE: Visibility
PREDICTED: Visibility
LOST: Visibility

class RobotPose(_message.Message):
    __slots__ = ("stamp", "pose", "covariance", "driver_sequence")
    STAMP_FIELD_NUMBER: _ClassVar[int]
    POSE_FIELD_NUMBER: _ClassVar[int]
    COVARIANCE_FIELD_NUMBER: _ClassVar[int]
    DRIVER_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    stamp: int
    pose: _geometry_pb2.Pose2
    covariance: _containers.RepeatedScalarFieldContainer[float]
    driver_sequence: int
    def __init__(self, stamp: _Optional[int] = ..., pose: _Optional[_Union[_geometry_pb2.Pose2, _Mapping]] = ..., covariance: _Optional[_Iterable[float]] = ..., driver_sequence: _Optional[int] = ...) -> None: ...

class ObjectState(_message.Message):
    __slots__ = ("stamp", "position", "yaw", "diameter", "covariance", "yaw_variance", "visibility")
    STAMP_FIELD_NUMBER: _ClassVar[int]
    POSITION_FIELD_NUMBER: _ClassVar[int]
    YAW_FIELD_NUMBER: _ClassVar[int]
    DIAMETER_FIELD_NUMBER: _ClassVar[int]
    COVARIANCE_FIELD_NUMBER: _ClassVar[int]
    YAW_VARIANCE_FIELD_NUMBER: _ClassVar[int]
    VISIBILITY_FIELD_NUMBER: _ClassVar[int]
    stamp: int
    position: _geometry_pb2.Vector2
    yaw: float
    diameter: float
    covariance: _containers.RepeatedScalarFieldContainer[float]
    yaw_variance: float
    visibility: Visibility
    def __init__(self, stamp: _Optional[int] = ..., position: _Optional[_Union[_geometry_pb2.Vector2, _Mapping]] = ..., yaw: _Optional[float] = ..., diameter: _Optional[float] = ..., covariance: _Optional[_Iterable[float]] = ..., yaw_variance: _Optional[float] = ..., visibility: _Optional[_Union[Visibility, str]] = ...) -> None: ...

class SeenFloor(_message.Message):
    __slots__ = ("stamp", "position", "bearing", "first", "last", "met")
    STAMP_FIELD_NUMBER: _ClassVar[int]
    POSITION_FIELD_NUMBER: _ClassVar[int]
    BEARING_FIELD_NUMBER: _ClassVar[int]
    FIRST_FIELD_NUMBER: _ClassVar[int]
    LAST_FIELD_NUMBER: _ClassVar[int]
    MET_FIELD_NUMBER: _ClassVar[int]
    stamp: int
    position: _geometry_pb2.Vector2
    bearing: _containers.RepeatedScalarFieldContainer[float]
    first: _containers.RepeatedScalarFieldContainer[float]
    last: _containers.RepeatedScalarFieldContainer[float]
    met: _containers.RepeatedScalarFieldContainer[bool]
    def __init__(self, stamp: _Optional[int] = ..., position: _Optional[_Union[_geometry_pb2.Vector2, _Mapping]] = ..., bearing: _Optional[_Iterable[float]] = ..., first: _Optional[_Iterable[float]] = ..., last: _Optional[_Iterable[float]] = ..., met: _Optional[_Iterable[bool]] = ...) -> None: ...

class OccupancyGrid(_message.Message):
    __slots__ = ("stamp", "version", "resolution", "width", "height", "origin", "cells")
    STAMP_FIELD_NUMBER: _ClassVar[int]
    VERSION_FIELD_NUMBER: _ClassVar[int]
    RESOLUTION_FIELD_NUMBER: _ClassVar[int]
    WIDTH_FIELD_NUMBER: _ClassVar[int]
    HEIGHT_FIELD_NUMBER: _ClassVar[int]
    ORIGIN_FIELD_NUMBER: _ClassVar[int]
    CELLS_FIELD_NUMBER: _ClassVar[int]
    stamp: int
    version: int
    resolution: float
    width: int
    height: int
    origin: _geometry_pb2.Vector2
    cells: bytes
    def __init__(self, stamp: _Optional[int] = ..., version: _Optional[int] = ..., resolution: _Optional[float] = ..., width: _Optional[int] = ..., height: _Optional[int] = ..., origin: _Optional[_Union[_geometry_pb2.Vector2, _Mapping]] = ..., cells: _Optional[bytes] = ...) -> None: ...

class Truth(_message.Message):
    __slots__ = ("stamp", "robot", "robot_twist", "object", "object_twist", "touching", "robot_hit", "object_hit", "driver_sequence")
    STAMP_FIELD_NUMBER: _ClassVar[int]
    ROBOT_FIELD_NUMBER: _ClassVar[int]
    ROBOT_TWIST_FIELD_NUMBER: _ClassVar[int]
    OBJECT_FIELD_NUMBER: _ClassVar[int]
    OBJECT_TWIST_FIELD_NUMBER: _ClassVar[int]
    TOUCHING_FIELD_NUMBER: _ClassVar[int]
    ROBOT_HIT_FIELD_NUMBER: _ClassVar[int]
    OBJECT_HIT_FIELD_NUMBER: _ClassVar[int]
    DRIVER_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    stamp: int
    robot: _geometry_pb2.Pose2
    robot_twist: _geometry_pb2.Twist2
    object: _geometry_pb2.Pose2
    object_twist: _geometry_pb2.Twist2
    touching: bool
    robot_hit: bool
    object_hit: bool
    driver_sequence: int
    def __init__(self, stamp: _Optional[int] = ..., robot: _Optional[_Union[_geometry_pb2.Pose2, _Mapping]] = ..., robot_twist: _Optional[_Union[_geometry_pb2.Twist2, _Mapping]] = ..., object: _Optional[_Union[_geometry_pb2.Pose2, _Mapping]] = ..., object_twist: _Optional[_Union[_geometry_pb2.Twist2, _Mapping]] = ..., touching: _Optional[bool] = ..., robot_hit: _Optional[bool] = ..., object_hit: _Optional[bool] = ..., driver_sequence: _Optional[int] = ...) -> None: ...
