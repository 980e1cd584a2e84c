from google.protobuf import empty_pb2 as _empty_pb2
from google.protobuf import timestamp_pb2 as _timestamp_pb2
from pepeseg.v1 import access_pb2 as _access_pb2
from pepeseg.v1 import decomposition_pb2 as _decomposition_pb2
from pepeseg.v1 import geometry_pb2 as _geometry_pb2
from pepeseg.v1 import prompt_pb2 as _prompt_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Iterable as _Iterable, Mapping as _Mapping, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor
SET_OPERATION_INTERSECT: SetOperation
SET_OPERATION_REPLACE: SetOperation
SET_OPERATION_SUBTRACT: SetOperation
SET_OPERATION_UNION: SetOperation
SET_OPERATION_UNSPECIFIED: SetOperation

class CombineSelectionsRequest(_message.Message):
    __slots__ = ["first", "operation", "request_id", "second"]
    FIRST_FIELD_NUMBER: _ClassVar[int]
    OPERATION_FIELD_NUMBER: _ClassVar[int]
    REQUEST_ID_FIELD_NUMBER: _ClassVar[int]
    SECOND_FIELD_NUMBER: _ClassVar[int]
    first: str
    operation: SetOperation
    request_id: str
    second: str
    def __init__(self, first: _Optional[str] = ..., second: _Optional[str] = ..., operation: _Optional[_Union[SetOperation, str]] = ..., request_id: _Optional[str] = ...) -> None: ...

class CreateSelectionRequest(_message.Message):
    __slots__ = ["base", "display_name", "frame", "gaussians", "granularity", "keep_disconnected", "model", "num_views", "operation", "prompt", "request_id", "sam_clicks", "segment"]
    BASE_FIELD_NUMBER: _ClassVar[int]
    DISPLAY_NAME_FIELD_NUMBER: _ClassVar[int]
    FRAME_FIELD_NUMBER: _ClassVar[int]
    GAUSSIANS_FIELD_NUMBER: _ClassVar[int]
    GRANULARITY_FIELD_NUMBER: _ClassVar[int]
    KEEP_DISCONNECTED_FIELD_NUMBER: _ClassVar[int]
    MODEL_FIELD_NUMBER: _ClassVar[int]
    NUM_VIEWS_FIELD_NUMBER: _ClassVar[int]
    OPERATION_FIELD_NUMBER: _ClassVar[int]
    PROMPT_FIELD_NUMBER: _ClassVar[int]
    REQUEST_ID_FIELD_NUMBER: _ClassVar[int]
    SAM_CLICKS_FIELD_NUMBER: _ClassVar[int]
    SEGMENT_FIELD_NUMBER: _ClassVar[int]
    base: str
    display_name: str
    frame: _prompt_pb2.PixelFrame
    gaussians: GaussianBits
    granularity: _prompt_pb2.Granularity
    keep_disconnected: bool
    model: str
    num_views: int
    operation: SetOperation
    prompt: _prompt_pb2.Prompt
    request_id: str
    sam_clicks: bool
    segment: _decomposition_pb2.SegmentRef
    def __init__(self, model: _Optional[str] = ..., prompt: _Optional[_Union[_prompt_pb2.Prompt, _Mapping]] = ..., segment: _Optional[_Union[_decomposition_pb2.SegmentRef, _Mapping]] = ..., gaussians: _Optional[_Union[GaussianBits, _Mapping]] = ..., granularity: _Optional[_Union[_prompt_pb2.Granularity, _Mapping]] = ..., num_views: _Optional[int] = ..., keep_disconnected: bool = ..., base: _Optional[str] = ..., operation: _Optional[_Union[SetOperation, str]] = ..., request_id: _Optional[str] = ..., frame: _Optional[_Union[_prompt_pb2.PixelFrame, str]] = ..., sam_clicks: bool = ..., display_name: _Optional[str] = ...) -> None: ...

class DeleteSelectionRequest(_message.Message):
    __slots__ = ["name"]
    NAME_FIELD_NUMBER: _ClassVar[int]
    name: str
    def __init__(self, name: _Optional[str] = ...) -> None: ...

class GaussianBits(_message.Message):
    __slots__ = ["bits"]
    BITS_FIELD_NUMBER: _ClassVar[int]
    bits: bytes
    def __init__(self, bits: _Optional[bytes] = ...) -> None: ...

class GetSelectionRequest(_message.Message):
    __slots__ = ["name", "want_gaussians"]
    NAME_FIELD_NUMBER: _ClassVar[int]
    WANT_GAUSSIANS_FIELD_NUMBER: _ClassVar[int]
    name: str
    want_gaussians: bool
    def __init__(self, name: _Optional[str] = ..., want_gaussians: bool = ...) -> None: ...

class ListSelectionsRequest(_message.Message):
    __slots__ = ["page_size", "page_token", "parent"]
    PAGE_SIZE_FIELD_NUMBER: _ClassVar[int]
    PAGE_TOKEN_FIELD_NUMBER: _ClassVar[int]
    PARENT_FIELD_NUMBER: _ClassVar[int]
    page_size: int
    page_token: str
    parent: str
    def __init__(self, parent: _Optional[str] = ..., page_size: _Optional[int] = ..., page_token: _Optional[str] = ...) -> None: ...

class ListSelectionsResponse(_message.Message):
    __slots__ = ["next_page_token", "selections"]
    NEXT_PAGE_TOKEN_FIELD_NUMBER: _ClassVar[int]
    SELECTIONS_FIELD_NUMBER: _ClassVar[int]
    next_page_token: str
    selections: _containers.RepeatedCompositeFieldContainer[Selection]
    def __init__(self, selections: _Optional[_Iterable[_Union[Selection, _Mapping]]] = ..., next_page_token: _Optional[str] = ...) -> None: ...

class Selection(_message.Message):
    __slots__ = ["base", "box", "create_time", "display_name", "gaussians", "model", "name", "num_gaussians"]
    BASE_FIELD_NUMBER: _ClassVar[int]
    BOX_FIELD_NUMBER: _ClassVar[int]
    CREATE_TIME_FIELD_NUMBER: _ClassVar[int]
    DISPLAY_NAME_FIELD_NUMBER: _ClassVar[int]
    GAUSSIANS_FIELD_NUMBER: _ClassVar[int]
    MODEL_FIELD_NUMBER: _ClassVar[int]
    NAME_FIELD_NUMBER: _ClassVar[int]
    NUM_GAUSSIANS_FIELD_NUMBER: _ClassVar[int]
    base: str
    box: _geometry_pb2.BoundingBox
    create_time: _timestamp_pb2.Timestamp
    display_name: str
    gaussians: GaussianBits
    model: str
    name: str
    num_gaussians: int
    def __init__(self, name: _Optional[str] = ..., model: _Optional[str] = ..., num_gaussians: _Optional[int] = ..., box: _Optional[_Union[_geometry_pb2.BoundingBox, _Mapping]] = ..., base: _Optional[str] = ..., create_time: _Optional[_Union[_timestamp_pb2.Timestamp, _Mapping]] = ..., display_name: _Optional[str] = ..., gaussians: _Optional[_Union[GaussianBits, _Mapping]] = ...) -> None: ...

class UndoSelectionRequest(_message.Message):
    __slots__ = ["name"]
    NAME_FIELD_NUMBER: _ClassVar[int]
    name: str
    def __init__(self, name: _Optional[str] = ...) -> None: ...

class SetOperation(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = []
