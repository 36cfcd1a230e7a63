from runtime.messages import geometry_pb2 as _geometry_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class Odometry(_message.Message):
    __slots__ = ("stamp", "pose", "twist", "driver_sequence", "covariance")
    STAMP_FIELD_NUMBER: _ClassVar[int]
    POSE_FIELD_NUMBER: _ClassVar[int]
    TWIST_FIELD_NUMBER: _ClassVar[int]
    DRIVER_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    COVARIANCE_FIELD_NUMBER: _ClassVar[int]
    stamp: int
    pose: _geometry_pb2.Pose2
    twist: _geometry_pb2.Twist2
    driver_sequence: int
    covariance: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, stamp: _Optional[int] = ..., pose: _Optional[_Union[_geometry_pb2.Pose2, _Mapping]] = ..., twist: _Optional[_Union[_geometry_pb2.Twist2, _Mapping]] = ..., driver_sequence: _Optional[int] = ..., covariance: _Optional[_Iterable[float]] = ...) -> None: ...

class RangeArray(_message.Message):
    __slots__ = ("stamp", "bearing", "distance", "ring_radius", "minimum", "maximum")
    STAMP_FIELD_NUMBER: _ClassVar[int]
    BEARING_FIELD_NUMBER: _ClassVar[int]
    DISTANCE_FIELD_NUMBER: _ClassVar[int]
    RING_RADIUS_FIELD_NUMBER: _ClassVar[int]
    MINIMUM_FIELD_NUMBER: _ClassVar[int]
    MAXIMUM_FIELD_NUMBER: _ClassVar[int]
    stamp: int
    bearing: _containers.RepeatedScalarFieldContainer[float]
    distance: _containers.RepeatedScalarFieldContainer[float]
    ring_radius: float
    minimum: float
    maximum: float
    def __init__(self, stamp: _Optional[int] = ..., bearing: _Optional[_Iterable[float]] = ..., distance: _Optional[_Iterable[float]] = ..., ring_radius: _Optional[float] = ..., minimum: _Optional[float] = ..., maximum: _Optional[float] = ...) -> None: ...

class MotionLimits(_message.Message):
    __slots__ = ("speed", "angular_speed", "acceleration", "angular_acceleration", "lag")
    SPEED_FIELD_NUMBER: _ClassVar[int]
    ANGULAR_SPEED_FIELD_NUMBER: _ClassVar[int]
    ACCELERATION_FIELD_NUMBER: _ClassVar[int]
    ANGULAR_ACCELERATION_FIELD_NUMBER: _ClassVar[int]
    LAG_FIELD_NUMBER: _ClassVar[int]
    speed: float
    angular_speed: float
    acceleration: float
    angular_acceleration: float
    lag: float
    def __init__(self, speed: _Optional[float] = ..., angular_speed: _Optional[float] = ..., acceleration: _Optional[float] = ..., angular_acceleration: _Optional[float] = ..., lag: _Optional[float] = ...) -> None: ...

class RobotStatus(_message.Message):
    __slots__ = ("stamp", "bumper", "emergency_stop", "motors_enabled", "battery_voltage", "limits", "diameter", "commands_accepted", "commands_clamped", "commands_refused", "commands_stale", "charging", "battery_low", "link_down", "faults", "chargers")
    STAMP_FIELD_NUMBER: _ClassVar[int]
    BUMPER_FIELD_NUMBER: _ClassVar[int]
    EMERGENCY_STOP_FIELD_NUMBER: _ClassVar[int]
    MOTORS_ENABLED_FIELD_NUMBER: _ClassVar[int]
    BATTERY_VOLTAGE_FIELD_NUMBER: _ClassVar[int]
    LIMITS_FIELD_NUMBER: _ClassVar[int]
    DIAMETER_FIELD_NUMBER: _ClassVar[int]
    COMMANDS_ACCEPTED_FIELD_NUMBER: _ClassVar[int]
    COMMANDS_CLAMPED_FIELD_NUMBER: _ClassVar[int]
    COMMANDS_REFUSED_FIELD_NUMBER: _ClassVar[int]
    COMMANDS_STALE_FIELD_NUMBER: _ClassVar[int]
    CHARGING_FIELD_NUMBER: _ClassVar[int]
    BATTERY_LOW_FIELD_NUMBER: _ClassVar[int]
    LINK_DOWN_FIELD_NUMBER: _ClassVar[int]
    FAULTS_FIELD_NUMBER: _ClassVar[int]
    CHARGERS_FIELD_NUMBER: _ClassVar[int]
    stamp: int
    bumper: bool
    emergency_stop: bool
    motors_enabled: bool
    battery_voltage: float
    limits: MotionLimits
    diameter: float
    commands_accepted: int
    commands_clamped: int
    commands_refused: int
    commands_stale: int
    charging: bool
    battery_low: bool
    link_down: bool
    faults: _containers.RepeatedCompositeFieldContainer[Count]
    chargers: _containers.RepeatedCompositeFieldContainer[Charger]
    def __init__(self, stamp: _Optional[int] = ..., bumper: _Optional[bool] = ..., emergency_stop: _Optional[bool] = ..., motors_enabled: _Optional[bool] = ..., battery_voltage: _Optional[float] = ..., limits: _Optional[_Union[MotionLimits, _Mapping]] = ..., diameter: _Optional[float] = ..., commands_accepted: _Optional[int] = ..., commands_clamped: _Optional[int] = ..., commands_refused: _Optional[int] = ..., commands_stale: _Optional[int] = ..., charging: _Optional[bool] = ..., battery_low: _Optional[bool] = ..., link_down: _Optional[bool] = ..., faults: _Optional[_Iterable[_Union[Count, _Mapping]]] = ..., chargers: _Optional[_Iterable[_Union[Charger, _Mapping]]] = ...) -> None: ...

class Charger(_message.Message):
    __slots__ = ("number", "voltage", "current", "temperature", "state")
    NUMBER_FIELD_NUMBER: _ClassVar[int]
    VOLTAGE_FIELD_NUMBER: _ClassVar[int]
    CURRENT_FIELD_NUMBER: _ClassVar[int]
    TEMPERATURE_FIELD_NUMBER: _ClassVar[int]
    STATE_FIELD_NUMBER: _ClassVar[int]
    number: int
    voltage: float
    current: float
    temperature: _containers.RepeatedScalarFieldContainer[float]
    state: str
    def __init__(self, number: _Optional[int] = ..., voltage: _Optional[float] = ..., current: _Optional[float] = ..., temperature: _Optional[_Iterable[float]] = ..., state: _Optional[str] = ...) -> None: ...

class Count(_message.Message):
    __slots__ = ("name", "value")
    NAME_FIELD_NUMBER: _ClassVar[int]
    VALUE_FIELD_NUMBER: _ClassVar[int]
    name: str
    value: int
    def __init__(self, name: _Optional[str] = ..., value: _Optional[int] = ...) -> None: ...

class VelocityCommand(_message.Message):
    __slots__ = ("stamp", "twist", "driver_sequence", "deadline", "controller", "psi_push", "psi_relocate", "limited")
    STAMP_FIELD_NUMBER: _ClassVar[int]
    TWIST_FIELD_NUMBER: _ClassVar[int]
    DRIVER_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    DEADLINE_FIELD_NUMBER: _ClassVar[int]
    CONTROLLER_FIELD_NUMBER: _ClassVar[int]
    PSI_PUSH_FIELD_NUMBER: _ClassVar[int]
    PSI_RELOCATE_FIELD_NUMBER: _ClassVar[int]
    LIMITED_FIELD_NUMBER: _ClassVar[int]
    stamp: int
    twist: _geometry_pb2.Twist2
    driver_sequence: int
    deadline: int
    controller: str
    psi_push: float
    psi_relocate: float
    limited: bool
    def __init__(self, stamp: _Optional[int] = ..., twist: _Optional[_Union[_geometry_pb2.Twist2, _Mapping]] = ..., driver_sequence: _Optional[int] = ..., deadline: _Optional[int] = ..., controller: _Optional[str] = ..., psi_push: _Optional[float] = ..., psi_relocate: _Optional[float] = ..., limited: _Optional[bool] = ...) -> None: ...
