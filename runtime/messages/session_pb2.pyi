from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class EntryKind(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    ENTRY_UNSPECIFIED: _ClassVar[EntryKind]
    STARTED: _ClassVar[EntryKind]
    MESSAGE: _ClassVar[EntryKind]
    TIMER: _ClassVar[EntryKind]
    REQUEST: _ClassVar[EntryKind]
    PRODUCED: _ClassVar[EntryKind]
    REPLIED: _ClassVar[EntryKind]
    SNAPSHOT: _ClassVar[EntryKind]
    FINISHED: _ClassVar[EntryKind]
ENTRY_UNSPECIFIED: EntryKind
STARTED: EntryKind
MESSAGE: EntryKind
TIMER: EntryKind
REQUEST: EntryKind
PRODUCED: EntryKind
REPLIED: EntryKind
SNAPSHOT: EntryKind
FINISHED: EntryKind

class Journal(_message.Message):
    __slots__ = ("node", "first", "names", "kind", "name", "sequence", "time", "digest")
    NODE_FIELD_NUMBER: _ClassVar[int]
    FIRST_FIELD_NUMBER: _ClassVar[int]
    NAMES_FIELD_NUMBER: _ClassVar[int]
    KIND_FIELD_NUMBER: _ClassVar[int]
    NAME_FIELD_NUMBER: _ClassVar[int]
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    TIME_FIELD_NUMBER: _ClassVar[int]
    DIGEST_FIELD_NUMBER: _ClassVar[int]
    node: str
    first: int
    names: _containers.RepeatedScalarFieldContainer[str]
    kind: _containers.RepeatedScalarFieldContainer[int]
    name: _containers.RepeatedScalarFieldContainer[int]
    sequence: _containers.RepeatedScalarFieldContainer[int]
    time: _containers.RepeatedScalarFieldContainer[int]
    digest: _containers.RepeatedScalarFieldContainer[int]
    def __init__(self, node: _Optional[str] = ..., first: _Optional[int] = ..., names: _Optional[_Iterable[str]] = ..., kind: _Optional[_Iterable[int]] = ..., name: _Optional[_Iterable[int]] = ..., sequence: _Optional[_Iterable[int]] = ..., time: _Optional[_Iterable[int]] = ..., digest: _Optional[_Iterable[int]] = ...) -> None: ...

class Snapshot(_message.Message):
    __slots__ = ("node", "number", "time", "entry", "digest", "service", "host")
    NODE_FIELD_NUMBER: _ClassVar[int]
    NUMBER_FIELD_NUMBER: _ClassVar[int]
    TIME_FIELD_NUMBER: _ClassVar[int]
    ENTRY_FIELD_NUMBER: _ClassVar[int]
    DIGEST_FIELD_NUMBER: _ClassVar[int]
    SERVICE_FIELD_NUMBER: _ClassVar[int]
    HOST_FIELD_NUMBER: _ClassVar[int]
    node: str
    number: int
    time: int
    entry: int
    digest: int
    service: bytes
    host: bytes
    def __init__(self, node: _Optional[str] = ..., number: _Optional[int] = ..., time: _Optional[int] = ..., entry: _Optional[int] = ..., digest: _Optional[int] = ..., service: _Optional[bytes] = ..., host: _Optional[bytes] = ...) -> None: ...

class Request(_message.Message):
    __slots__ = ("id", "name", "type", "payload")
    ID_FIELD_NUMBER: _ClassVar[int]
    NAME_FIELD_NUMBER: _ClassVar[int]
    TYPE_FIELD_NUMBER: _ClassVar[int]
    PAYLOAD_FIELD_NUMBER: _ClassVar[int]
    id: int
    name: str
    type: str
    payload: bytes
    def __init__(self, id: _Optional[int] = ..., name: _Optional[str] = ..., type: _Optional[str] = ..., payload: _Optional[bytes] = ...) -> None: ...

class Reply(_message.Message):
    __slots__ = ("id", "name", "accepted", "reason")
    ID_FIELD_NUMBER: _ClassVar[int]
    NAME_FIELD_NUMBER: _ClassVar[int]
    ACCEPTED_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    id: int
    name: str
    accepted: bool
    reason: str
    def __init__(self, id: _Optional[int] = ..., name: _Optional[str] = ..., accepted: _Optional[bool] = ..., reason: _Optional[str] = ...) -> None: ...

class Alive(_message.Message):
    __slots__ = ("stamp", "nodes")
    STAMP_FIELD_NUMBER: _ClassVar[int]
    NODES_FIELD_NUMBER: _ClassVar[int]
    stamp: int
    nodes: _containers.RepeatedScalarFieldContainer[str]
    def __init__(self, stamp: _Optional[int] = ..., nodes: _Optional[_Iterable[str]] = ...) -> None: ...

class InputHealth(_message.Message):
    __slots__ = ("topic", "consumed", "dropped", "age", "lost", "refused", "repeated", "refusal")
    TOPIC_FIELD_NUMBER: _ClassVar[int]
    CONSUMED_FIELD_NUMBER: _ClassVar[int]
    DROPPED_FIELD_NUMBER: _ClassVar[int]
    AGE_FIELD_NUMBER: _ClassVar[int]
    LOST_FIELD_NUMBER: _ClassVar[int]
    REFUSED_FIELD_NUMBER: _ClassVar[int]
    REPEATED_FIELD_NUMBER: _ClassVar[int]
    REFUSAL_FIELD_NUMBER: _ClassVar[int]
    topic: str
    consumed: int
    dropped: int
    age: float
    lost: int
    refused: int
    repeated: int
    refusal: str
    def __init__(self, topic: _Optional[str] = ..., consumed: _Optional[int] = ..., dropped: _Optional[int] = ..., age: _Optional[float] = ..., lost: _Optional[int] = ..., refused: _Optional[int] = ..., repeated: _Optional[int] = ..., refusal: _Optional[str] = ...) -> None: ...

class Health(_message.Message):
    __slots__ = ("stamp", "node", "inputs", "handled", "queue_length", "busy_mean", "busy_max")
    STAMP_FIELD_NUMBER: _ClassVar[int]
    NODE_FIELD_NUMBER: _ClassVar[int]
    INPUTS_FIELD_NUMBER: _ClassVar[int]
    HANDLED_FIELD_NUMBER: _ClassVar[int]
    QUEUE_LENGTH_FIELD_NUMBER: _ClassVar[int]
    BUSY_MEAN_FIELD_NUMBER: _ClassVar[int]
    BUSY_MAX_FIELD_NUMBER: _ClassVar[int]
    stamp: int
    node: str
    inputs: _containers.RepeatedCompositeFieldContainer[InputHealth]
    handled: int
    queue_length: int
    busy_mean: float
    busy_max: float
    def __init__(self, stamp: _Optional[int] = ..., node: _Optional[str] = ..., inputs: _Optional[_Iterable[_Union[InputHealth, _Mapping]]] = ..., handled: _Optional[int] = ..., queue_length: _Optional[int] = ..., busy_mean: _Optional[float] = ..., busy_max: _Optional[float] = ...) -> None: ...

class RecordingStart(_message.Message):
    __slots__ = ("name", "topics", "split")
    NAME_FIELD_NUMBER: _ClassVar[int]
    TOPICS_FIELD_NUMBER: _ClassVar[int]
    SPLIT_FIELD_NUMBER: _ClassVar[int]
    name: str
    topics: _containers.RepeatedScalarFieldContainer[str]
    split: str
    def __init__(self, name: _Optional[str] = ..., topics: _Optional[_Iterable[str]] = ..., split: _Optional[str] = ...) -> None: ...

class RecordingStop(_message.Message):
    __slots__ = ()
    def __init__(self) -> None: ...

class RecordingQuery(_message.Message):
    __slots__ = ()
    def __init__(self) -> None: ...

class RecordingStatus(_message.Message):
    __slots__ = ("recording", "file", "parts", "messages", "seconds", "missed", "failure")
    RECORDING_FIELD_NUMBER: _ClassVar[int]
    FILE_FIELD_NUMBER: _ClassVar[int]
    PARTS_FIELD_NUMBER: _ClassVar[int]
    MESSAGES_FIELD_NUMBER: _ClassVar[int]
    SECONDS_FIELD_NUMBER: _ClassVar[int]
    MISSED_FIELD_NUMBER: _ClassVar[int]
    FAILURE_FIELD_NUMBER: _ClassVar[int]
    recording: bool
    file: str
    parts: int
    messages: int
    seconds: float
    missed: int
    failure: str
    def __init__(self, recording: _Optional[bool] = ..., file: _Optional[str] = ..., parts: _Optional[int] = ..., messages: _Optional[int] = ..., seconds: _Optional[float] = ..., missed: _Optional[int] = ..., failure: _Optional[str] = ...) -> None: ...
