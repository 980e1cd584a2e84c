from google.protobuf import empty_pb2 as _empty_pb2
from google.protobuf import timestamp_pb2 as _timestamp_pb2
from pepeseg.v1 import access_pb2 as _access_pb2
from pepeseg.v1 import prompt_pb2 as _prompt_pb2
from pepeseg.v1 import segmentation_service_pb2 as _segmentation_service_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Iterable as _Iterable, Mapping as _Mapping, Optional as _Optional, Union as _Union

ANNOTATION_FORMAT_COCO: AnnotationFormat
ANNOTATION_FORMAT_CVAT: AnnotationFormat
ANNOTATION_FORMAT_IDS: AnnotationFormat
ANNOTATION_FORMAT_LABELME: AnnotationFormat
ANNOTATION_FORMAT_MASKS: AnnotationFormat
ANNOTATION_FORMAT_UNSPECIFIED: AnnotationFormat
ANNOTATION_FORMAT_YOLO: AnnotationFormat
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

class ExportAnnotationsRequest(_message.Message):
    __slots__ = ["format", "labels", "model", "sam_borders", "segments", "table", "targets"]
    class Segments(_message.Message):
        __slots__ = ["level", "scales"]
        LEVEL_FIELD_NUMBER: _ClassVar[int]
        SCALES_FIELD_NUMBER: _ClassVar[int]
        level: int
        scales: _containers.RepeatedScalarFieldContainer[float]
        def __init__(self, scales: _Optional[_Iterable[float]] = ..., level: _Optional[int] = ...) -> None: ...
    FORMAT_FIELD_NUMBER: _ClassVar[int]
    LABELS_FIELD_NUMBER: _ClassVar[int]
    MODEL_FIELD_NUMBER: _ClassVar[int]
    SAM_BORDERS_FIELD_NUMBER: _ClassVar[int]
    SEGMENTS_FIELD_NUMBER: _ClassVar[int]
    TABLE_FIELD_NUMBER: _ClassVar[int]
    TARGETS_FIELD_NUMBER: _ClassVar[int]
    format: AnnotationFormat
    labels: _containers.RepeatedScalarFieldContainer[str]
    model: str
    sam_borders: bool
    segments: ExportAnnotationsRequest.Segments
    table: bool
    targets: _segmentation_service_pb2.SegmentViewsRequest.Targets
    def __init__(self, model: _Optional[str] = ..., format: _Optional[_Union[AnnotationFormat, str]] = ..., labels: _Optional[_Iterable[str]] = ..., targets: _Optional[_Union[_segmentation_service_pb2.SegmentViewsRequest.Targets, _Mapping]] = ..., sam_borders: bool = ..., segments: _Optional[_Union[ExportAnnotationsRequest.Segments, _Mapping]] = ..., table: bool = ...) -> None: ...

class ExportAnnotationsResponse(_message.Message):
    __slots__ = ["chunk", "header", "progress"]
    class Header(_message.Message):
        __slots__ = ["model", "num_bytes", "num_things", "num_views", "sha256"]
        MODEL_FIELD_NUMBER: _ClassVar[int]
        NUM_BYTES_FIELD_NUMBER: _ClassVar[int]
        NUM_THINGS_FIELD_NUMBER: _ClassVar[int]
        NUM_VIEWS_FIELD_NUMBER: _ClassVar[int]
        SHA256_FIELD_NUMBER: _ClassVar[int]
        model: str
        num_bytes: int
        num_things: int
        num_views: int
        sha256: str
        def __init__(self, model: _Optional[str] = ..., num_things: _Optional[int] = ..., num_views: _Optional[int] = ..., num_bytes: _Optional[int] = ..., sha256: _Optional[str] = ...) -> None: ...
    class Progress(_message.Message):
        __slots__ = ["num_masks", "num_masks_done"]
        NUM_MASKS_DONE_FIELD_NUMBER: _ClassVar[int]
        NUM_MASKS_FIELD_NUMBER: _ClassVar[int]
        num_masks: int
        num_masks_done: int
        def __init__(self, num_masks_done: _Optional[int] = ..., num_masks: _Optional[int] = ...) -> None: ...
    CHUNK_FIELD_NUMBER: _ClassVar[int]
    HEADER_FIELD_NUMBER: _ClassVar[int]
    PROGRESS_FIELD_NUMBER: _ClassVar[int]
    chunk: bytes
    header: ExportAnnotationsResponse.Header
    progress: ExportAnnotationsResponse.Progress
    def __init__(self, header: _Optional[_Union[ExportAnnotationsResponse.Header, _Mapping]] = ..., chunk: _Optional[bytes] = ..., progress: _Optional[_Union[ExportAnnotationsResponse.Progress, _Mapping]] = ...) -> None: ...

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

class AnnotationFormat(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = []
