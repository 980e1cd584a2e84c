from google.protobuf import empty_pb2 as _empty_pb2
from google.protobuf import timestamp_pb2 as _timestamp_pb2
from pepeseg.v1 import access_pb2 as _access_pb2
from pepeseg.v1 import prompt_pb2 as _prompt_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Iterable as _Iterable, Mapping as _Mapping, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class CreateLabelRequest(_message.Message):
    __slots__ = ["frame", "label", "label_id", "parent", "request_id"]
    FRAME_FIELD_NUMBER: _ClassVar[int]
    LABEL_FIELD_NUMBER: _ClassVar[int]
    LABEL_ID_FIELD_NUMBER: _ClassVar[int]
    PARENT_FIELD_NUMBER: _ClassVar[int]
    REQUEST_ID_FIELD_NUMBER: _ClassVar[int]
    frame: _prompt_pb2.PixelFrame
    label: Label
    label_id: str
    parent: str
    request_id: str
    def __init__(self, parent: _Optional[str] = ..., label_id: _Optional[str] = ..., label: _Optional[_Union[Label, _Mapping]] = ..., request_id: _Optional[str] = ..., frame: _Optional[_Union[_prompt_pb2.PixelFrame, str]] = ...) -> None: ...

class DeleteLabelRequest(_message.Message):
    __slots__ = ["name"]
    NAME_FIELD_NUMBER: _ClassVar[int]
    name: str
    def __init__(self, name: _Optional[str] = ...) -> None: ...

class GetLabelRequest(_message.Message):
    __slots__ = ["frame", "name"]
    FRAME_FIELD_NUMBER: _ClassVar[int]
    NAME_FIELD_NUMBER: _ClassVar[int]
    frame: _prompt_pb2.PixelFrame
    name: str
    def __init__(self, name: _Optional[str] = ..., frame: _Optional[_Union[_prompt_pb2.PixelFrame, str]] = ...) -> None: ...

class Label(_message.Message):
    __slots__ = ["area", "create_time", "mask", "name", "text", "view"]
    AREA_FIELD_NUMBER: _ClassVar[int]
    CREATE_TIME_FIELD_NUMBER: _ClassVar[int]
    MASK_FIELD_NUMBER: _ClassVar[int]
    NAME_FIELD_NUMBER: _ClassVar[int]
    TEXT_FIELD_NUMBER: _ClassVar[int]
    VIEW_FIELD_NUMBER: _ClassVar[int]
    area: int
    create_time: _timestamp_pb2.Timestamp
    mask: _prompt_pb2.MaskImage
    name: str
    text: str
    view: str
    def __init__(self, name: _Optional[str] = ..., text: _Optional[str] = ..., view: _Optional[str] = ..., mask: _Optional[_Union[_prompt_pb2.MaskImage, _Mapping]] = ..., area: _Optional[int] = ..., create_time: _Optional[_Union[_timestamp_pb2.Timestamp, _Mapping]] = ...) -> None: ...

class ListLabelsRequest(_message.Message):
    __slots__ = ["page_size", "page_token", "parent"]
    PAGE_SIZE_FIELD_NUMBER: _ClassVar[int]
    PAGE_TOKEN_FIELD_NUMBER: _ClassVar[int]
    PARENT_FIELD_NUMBER: _ClassVar[int]
    page_size: int
    page_token: str
    parent: str
    def __init__(self, parent: _Optional[str] = ..., page_size: _Optional[int] = ..., page_token: _Optional[str] = ...) -> None: ...

class ListLabelsResponse(_message.Message):
    __slots__ = ["labels", "next_page_token"]
    LABELS_FIELD_NUMBER: _ClassVar[int]
    NEXT_PAGE_TOKEN_FIELD_NUMBER: _ClassVar[int]
    labels: _containers.RepeatedCompositeFieldContainer[Label]
    next_page_token: str
    def __init__(self, labels: _Optional[_Iterable[_Union[Label, _Mapping]]] = ..., next_page_token: _Optional[str] = ...) -> None: ...
