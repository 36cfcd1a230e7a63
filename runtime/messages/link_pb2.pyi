from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class HttpFault(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    HTTP_OK: _ClassVar[HttpFault]
    HTTP_REFUSED: _ClassVar[HttpFault]
    HTTP_TIMEOUT: _ClassVar[HttpFault]
    HTTP_CUT: _ClassVar[HttpFault]
    HTTP_MALFORMED: _ClassVar[HttpFault]
    HTTP_REPLACED: _ClassVar[HttpFault]
HTTP_OK: HttpFault
HTTP_REFUSED: HttpFault
HTTP_TIMEOUT: HttpFault
HTTP_CUT: HttpFault
HTTP_MALFORMED: HttpFault
HTTP_REPLACED: HttpFault

class SerialData(_message.Message):
    __slots__ = ("stamp", "data", "open", "fault")
    STAMP_FIELD_NUMBER: _ClassVar[int]
    DATA_FIELD_NUMBER: _ClassVar[int]
    OPEN_FIELD_NUMBER: _ClassVar[int]
    FAULT_FIELD_NUMBER: _ClassVar[int]
    stamp: int
    data: bytes
    open: bool
    fault: str
    def __init__(self, stamp: _Optional[int] = ..., data: _Optional[bytes] = ..., open: _Optional[bool] = ..., fault: _Optional[str] = ...) -> None: ...

class HttpRequest(_message.Message):
    __slots__ = ("stamp", "id", "lane", "method", "path", "body", "timeout")
    STAMP_FIELD_NUMBER: _ClassVar[int]
    ID_FIELD_NUMBER: _ClassVar[int]
    LANE_FIELD_NUMBER: _ClassVar[int]
    METHOD_FIELD_NUMBER: _ClassVar[int]
    PATH_FIELD_NUMBER: _ClassVar[int]
    BODY_FIELD_NUMBER: _ClassVar[int]
    TIMEOUT_FIELD_NUMBER: _ClassVar[int]
    stamp: int
    id: int
    lane: str
    method: str
    path: str
    body: bytes
    timeout: int
    def __init__(self, stamp: _Optional[int] = ..., id: _Optional[int] = ..., lane: _Optional[str] = ..., method: _Optional[str] = ..., path: _Optional[str] = ..., body: _Optional[bytes] = ..., timeout: _Optional[int] = ...) -> None: ...

class HttpAnswer(_message.Message):
    __slots__ = ("stamp", "id", "path", "fault", "status", "content_type", "body", "reason")
    STAMP_FIELD_NUMBER: _ClassVar[int]
    ID_FIELD_NUMBER: _ClassVar[int]
    PATH_FIELD_NUMBER: _ClassVar[int]
    FAULT_FIELD_NUMBER: _ClassVar[int]
    STATUS_FIELD_NUMBER: _ClassVar[int]
    CONTENT_TYPE_FIELD_NUMBER: _ClassVar[int]
    BODY_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    stamp: int
    id: int
    path: str
    fault: HttpFault
    status: int
    content_type: str
    body: bytes
    reason: str
    def __init__(self, stamp: _Optional[int] = ..., id: _Optional[int] = ..., path: _Optional[str] = ..., fault: _Optional[_Union[HttpFault, str]] = ..., status: _Optional[int] = ..., content_type: _Optional[str] = ..., body: _Optional[bytes] = ..., reason: _Optional[str] = ...) -> None: ...
