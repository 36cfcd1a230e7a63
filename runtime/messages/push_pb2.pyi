from runtime.messages import geometry_pb2 as _geometry_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class PushPhase(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    PHASE_UNSPECIFIED: _ClassVar[PushPhase]
    IDLE: _ClassVar[PushPhase]
    PLANNING: _ClassVar[PushPhase]
    PUSHING: _ClassVar[PushPhase]
    WAITING: _ClassVar[PushPhase]
    ENDED: _ClassVar[PushPhase]

class PushOutcome(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    OUTCOME_UNSPECIFIED: _ClassVar[PushOutcome]
    DELIVERED: _ClassVar[PushOutcome]
    FAILED: _ClassVar[PushOutcome]
    CANCELLED: _ClassVar[PushOutcome]

class FailureCause(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    CAUSE_NONE: _ClassVar[FailureCause]
    NO_PATH: _ClassVar[FailureCause]
    ROBOT_OUT: _ClassVar[FailureCause]
    OBJECT_OUT: _ClassVar[FailureCause]
    TIME_LIMIT: _ClassVar[FailureCause]
    STALL: _ClassVar[FailureCause]
    OBJECT_LOST: _ClassVar[FailureCause]
    ORBIT: _ClassVar[FailureCause]
PHASE_UNSPECIFIED: PushPhase
IDLE: PushPhase
PLANNING: PushPhase
PUSHING: PushPhase
WAITING: PushPhase
ENDED: PushPhase
OUTCOME_UNSPECIFIED: PushOutcome
DELIVERED: PushOutcome
FAILED: PushOutcome
CANCELLED: PushOutcome
CAUSE_NONE: FailureCause
NO_PATH: FailureCause
ROBOT_OUT: FailureCause
OBJECT_OUT: FailureCause
TIME_LIMIT: FailureCause
STALL: FailureCause
OBJECT_LOST: FailureCause
ORBIT: FailureCause

class PushGoal(_message.Message):
    __slots__ = ("stamp", "id", "position", "precision", "strategy", "controller", "time_limit", "yaw", "active", "yaw_precision")
    STAMP_FIELD_NUMBER: _ClassVar[int]
    ID_FIELD_NUMBER: _ClassVar[int]
    POSITION_FIELD_NUMBER: _ClassVar[int]
    PRECISION_FIELD_NUMBER: _ClassVar[int]
    STRATEGY_FIELD_NUMBER: _ClassVar[int]
    CONTROLLER_FIELD_NUMBER: _ClassVar[int]
    TIME_LIMIT_FIELD_NUMBER: _ClassVar[int]
    YAW_FIELD_NUMBER: _ClassVar[int]
    ACTIVE_FIELD_NUMBER: _ClassVar[int]
    YAW_PRECISION_FIELD_NUMBER: _ClassVar[int]
    stamp: int
    id: int
    position: _geometry_pb2.Vector2
    precision: float
    strategy: str
    controller: str
    time_limit: float
    yaw: float
    active: bool
    yaw_precision: float
    def __init__(self, stamp: _Optional[int] = ..., id: _Optional[int] = ..., position: _Optional[_Union[_geometry_pb2.Vector2, _Mapping]] = ..., precision: _Optional[float] = ..., strategy: _Optional[str] = ..., controller: _Optional[str] = ..., time_limit: _Optional[float] = ..., yaw: _Optional[float] = ..., active: _Optional[bool] = ..., yaw_precision: _Optional[float] = ...) -> None: ...

class CancelRequest(_message.Message):
    __slots__ = ("reason",)
    REASON_FIELD_NUMBER: _ClassVar[int]
    reason: str
    def __init__(self, reason: _Optional[str] = ...) -> None: ...

class Corridor(_message.Message):
    __slots__ = ("stamp", "version", "goal_id", "map_version", "path", "start", "clearance", "width_push", "width_object", "edge_push", "edge_object", "robot_diameter", "object_diameter", "found", "reason")
    STAMP_FIELD_NUMBER: _ClassVar[int]
    VERSION_FIELD_NUMBER: _ClassVar[int]
    GOAL_ID_FIELD_NUMBER: _ClassVar[int]
    MAP_VERSION_FIELD_NUMBER: _ClassVar[int]
    PATH_FIELD_NUMBER: _ClassVar[int]
    START_FIELD_NUMBER: _ClassVar[int]
    CLEARANCE_FIELD_NUMBER: _ClassVar[int]
    WIDTH_PUSH_FIELD_NUMBER: _ClassVar[int]
    WIDTH_OBJECT_FIELD_NUMBER: _ClassVar[int]
    EDGE_PUSH_FIELD_NUMBER: _ClassVar[int]
    EDGE_OBJECT_FIELD_NUMBER: _ClassVar[int]
    ROBOT_DIAMETER_FIELD_NUMBER: _ClassVar[int]
    OBJECT_DIAMETER_FIELD_NUMBER: _ClassVar[int]
    FOUND_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    stamp: int
    version: int
    goal_id: int
    map_version: int
    path: _geometry_pb2.Polyline
    start: int
    clearance: _containers.RepeatedScalarFieldContainer[float]
    width_push: _containers.RepeatedScalarFieldContainer[float]
    width_object: _containers.RepeatedScalarFieldContainer[float]
    edge_push: _containers.RepeatedCompositeFieldContainer[_geometry_pb2.Polyline]
    edge_object: _containers.RepeatedCompositeFieldContainer[_geometry_pb2.Polyline]
    robot_diameter: float
    object_diameter: float
    found: bool
    reason: str
    def __init__(self, stamp: _Optional[int] = ..., version: _Optional[int] = ..., goal_id: _Optional[int] = ..., map_version: _Optional[int] = ..., path: _Optional[_Union[_geometry_pb2.Polyline, _Mapping]] = ..., start: _Optional[int] = ..., clearance: _Optional[_Iterable[float]] = ..., width_push: _Optional[_Iterable[float]] = ..., width_object: _Optional[_Iterable[float]] = ..., edge_push: _Optional[_Iterable[_Union[_geometry_pb2.Polyline, _Mapping]]] = ..., edge_object: _Optional[_Iterable[_Union[_geometry_pb2.Polyline, _Mapping]]] = ..., robot_diameter: _Optional[float] = ..., object_diameter: _Optional[float] = ..., found: _Optional[bool] = ..., reason: _Optional[str] = ...) -> None: ...

class PushTarget(_message.Message):
    __slots__ = ("stamp", "corridor_version", "target", "object", "push_position", "strategy", "fallback", "distance_to_go", "plan")
    STAMP_FIELD_NUMBER: _ClassVar[int]
    CORRIDOR_VERSION_FIELD_NUMBER: _ClassVar[int]
    TARGET_FIELD_NUMBER: _ClassVar[int]
    OBJECT_FIELD_NUMBER: _ClassVar[int]
    PUSH_POSITION_FIELD_NUMBER: _ClassVar[int]
    STRATEGY_FIELD_NUMBER: _ClassVar[int]
    FALLBACK_FIELD_NUMBER: _ClassVar[int]
    DISTANCE_TO_GO_FIELD_NUMBER: _ClassVar[int]
    PLAN_FIELD_NUMBER: _ClassVar[int]
    stamp: int
    corridor_version: int
    target: _geometry_pb2.Vector2
    object: _geometry_pb2.Vector2
    push_position: _geometry_pb2.Vector2
    strategy: str
    fallback: bool
    distance_to_go: float
    plan: PushPlan
    def __init__(self, stamp: _Optional[int] = ..., corridor_version: _Optional[int] = ..., target: _Optional[_Union[_geometry_pb2.Vector2, _Mapping]] = ..., object: _Optional[_Union[_geometry_pb2.Vector2, _Mapping]] = ..., push_position: _Optional[_Union[_geometry_pb2.Vector2, _Mapping]] = ..., strategy: _Optional[str] = ..., fallback: _Optional[bool] = ..., distance_to_go: _Optional[float] = ..., plan: _Optional[_Union[PushPlan, _Mapping]] = ...) -> None: ...

class PushPlan(_message.Message):
    __slots__ = ("ahead", "bias", "speed", "side", "cost", "object_path", "robot_path", "speed_full", "approach", "slowest", "margin", "body", "stand", "lean", "speed_walk")
    AHEAD_FIELD_NUMBER: _ClassVar[int]
    BIAS_FIELD_NUMBER: _ClassVar[int]
    SPEED_FIELD_NUMBER: _ClassVar[int]
    SIDE_FIELD_NUMBER: _ClassVar[int]
    COST_FIELD_NUMBER: _ClassVar[int]
    OBJECT_PATH_FIELD_NUMBER: _ClassVar[int]
    ROBOT_PATH_FIELD_NUMBER: _ClassVar[int]
    SPEED_FULL_FIELD_NUMBER: _ClassVar[int]
    APPROACH_FIELD_NUMBER: _ClassVar[int]
    SLOWEST_FIELD_NUMBER: _ClassVar[int]
    MARGIN_FIELD_NUMBER: _ClassVar[int]
    BODY_FIELD_NUMBER: _ClassVar[int]
    STAND_FIELD_NUMBER: _ClassVar[int]
    LEAN_FIELD_NUMBER: _ClassVar[int]
    SPEED_WALK_FIELD_NUMBER: _ClassVar[int]
    ahead: float
    bias: float
    speed: float
    side: float
    cost: float
    object_path: _geometry_pb2.Polyline
    robot_path: _geometry_pb2.Polyline
    speed_full: float
    approach: float
    slowest: float
    margin: float
    body: float
    stand: float
    lean: float
    speed_walk: float
    def __init__(self, ahead: _Optional[float] = ..., bias: _Optional[float] = ..., speed: _Optional[float] = ..., side: _Optional[float] = ..., cost: _Optional[float] = ..., object_path: _Optional[_Union[_geometry_pb2.Polyline, _Mapping]] = ..., robot_path: _Optional[_Union[_geometry_pb2.Polyline, _Mapping]] = ..., speed_full: _Optional[float] = ..., approach: _Optional[float] = ..., slowest: _Optional[float] = ..., margin: _Optional[float] = ..., body: _Optional[float] = ..., stand: _Optional[float] = ..., lean: _Optional[float] = ..., speed_walk: _Optional[float] = ...) -> None: ...

class PushResponse(_message.Message):
    __slots__ = ("stamp", "contour", "response", "touches", "windows", "error", "prior_error", "yaw", "spread")
    STAMP_FIELD_NUMBER: _ClassVar[int]
    CONTOUR_FIELD_NUMBER: _ClassVar[int]
    RESPONSE_FIELD_NUMBER: _ClassVar[int]
    TOUCHES_FIELD_NUMBER: _ClassVar[int]
    WINDOWS_FIELD_NUMBER: _ClassVar[int]
    ERROR_FIELD_NUMBER: _ClassVar[int]
    PRIOR_ERROR_FIELD_NUMBER: _ClassVar[int]
    YAW_FIELD_NUMBER: _ClassVar[int]
    SPREAD_FIELD_NUMBER: _ClassVar[int]
    stamp: int
    contour: _containers.RepeatedScalarFieldContainer[float]
    response: _containers.RepeatedScalarFieldContainer[float]
    touches: int
    windows: int
    error: float
    prior_error: float
    yaw: float
    spread: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, stamp: _Optional[int] = ..., contour: _Optional[_Iterable[float]] = ..., response: _Optional[_Iterable[float]] = ..., touches: _Optional[int] = ..., windows: _Optional[int] = ..., error: _Optional[float] = ..., prior_error: _Optional[float] = ..., yaw: _Optional[float] = ..., spread: _Optional[_Iterable[float]] = ...) -> None: ...

class PushBehaviour(_message.Message):
    __slots__ = ("stamp", "alpha", "gamma", "mean_gamma", "mu", "kappa", "alpha_p", "sample_count", "reading_count", "moving")
    STAMP_FIELD_NUMBER: _ClassVar[int]
    ALPHA_FIELD_NUMBER: _ClassVar[int]
    GAMMA_FIELD_NUMBER: _ClassVar[int]
    MEAN_GAMMA_FIELD_NUMBER: _ClassVar[int]
    MU_FIELD_NUMBER: _ClassVar[int]
    KAPPA_FIELD_NUMBER: _ClassVar[int]
    ALPHA_P_FIELD_NUMBER: _ClassVar[int]
    SAMPLE_COUNT_FIELD_NUMBER: _ClassVar[int]
    READING_COUNT_FIELD_NUMBER: _ClassVar[int]
    MOVING_FIELD_NUMBER: _ClassVar[int]
    stamp: int
    alpha: float
    gamma: float
    mean_gamma: float
    mu: float
    kappa: float
    alpha_p: float
    sample_count: int
    reading_count: int
    moving: bool
    def __init__(self, stamp: _Optional[int] = ..., alpha: _Optional[float] = ..., gamma: _Optional[float] = ..., mean_gamma: _Optional[float] = ..., mu: _Optional[float] = ..., kappa: _Optional[float] = ..., alpha_p: _Optional[float] = ..., sample_count: _Optional[int] = ..., reading_count: _Optional[int] = ..., moving: _Optional[bool] = ...) -> None: ...

class PushStatus(_message.Message):
    __slots__ = ("stamp", "goal_id", "phase", "distance_left", "elapsed", "robot_path_length", "object_path_length", "robot_violations", "object_violations", "outcome", "cause", "reason", "yaw_left")
    STAMP_FIELD_NUMBER: _ClassVar[int]
    GOAL_ID_FIELD_NUMBER: _ClassVar[int]
    PHASE_FIELD_NUMBER: _ClassVar[int]
    DISTANCE_LEFT_FIELD_NUMBER: _ClassVar[int]
    ELAPSED_FIELD_NUMBER: _ClassVar[int]
    ROBOT_PATH_LENGTH_FIELD_NUMBER: _ClassVar[int]
    OBJECT_PATH_LENGTH_FIELD_NUMBER: _ClassVar[int]
    ROBOT_VIOLATIONS_FIELD_NUMBER: _ClassVar[int]
    OBJECT_VIOLATIONS_FIELD_NUMBER: _ClassVar[int]
    OUTCOME_FIELD_NUMBER: _ClassVar[int]
    CAUSE_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    YAW_LEFT_FIELD_NUMBER: _ClassVar[int]
    stamp: int
    goal_id: int
    phase: PushPhase
    distance_left: float
    elapsed: float
    robot_path_length: float
    object_path_length: float
    robot_violations: int
    object_violations: int
    outcome: PushOutcome
    cause: FailureCause
    reason: str
    yaw_left: float
    def __init__(self, stamp: _Optional[int] = ..., goal_id: _Optional[int] = ..., phase: _Optional[_Union[PushPhase, str]] = ..., distance_left: _Optional[float] = ..., elapsed: _Optional[float] = ..., robot_path_length: _Optional[float] = ..., object_path_length: _Optional[float] = ..., robot_violations: _Optional[int] = ..., object_violations: _Optional[int] = ..., outcome: _Optional[_Union[PushOutcome, str]] = ..., cause: _Optional[_Union[FailureCause, str]] = ..., reason: _Optional[str] = ..., yaw_left: _Optional[float] = ...) -> None: ...
