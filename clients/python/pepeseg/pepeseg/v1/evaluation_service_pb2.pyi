from google.protobuf import duration_pb2 as _duration_pb2
from pepeseg.v1 import access_pb2 as _access_pb2
from pepeseg.v1 import prompt_pb2 as _prompt_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Iterable as _Iterable, Mapping as _Mapping, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class EvaluateModelRequest(_message.Message):
    __slots__ = ["entity_names", "frame", "labels", "model", "options"]
    class EntityNamesEntry(_message.Message):
        __slots__ = ["key", "value"]
        KEY_FIELD_NUMBER: _ClassVar[int]
        VALUE_FIELD_NUMBER: _ClassVar[int]
        key: int
        value: str
        def __init__(self, key: _Optional[int] = ..., value: _Optional[str] = ...) -> None: ...
    class ViewLabels(_message.Message):
        __slots__ = ["ignore_png", "png", "view"]
        IGNORE_PNG_FIELD_NUMBER: _ClassVar[int]
        PNG_FIELD_NUMBER: _ClassVar[int]
        VIEW_FIELD_NUMBER: _ClassVar[int]
        ignore_png: bytes
        png: bytes
        view: str
        def __init__(self, view: _Optional[str] = ..., png: _Optional[bytes] = ..., ignore_png: _Optional[bytes] = ...) -> None: ...
    ENTITY_NAMES_FIELD_NUMBER: _ClassVar[int]
    FRAME_FIELD_NUMBER: _ClassVar[int]
    LABELS_FIELD_NUMBER: _ClassVar[int]
    MODEL_FIELD_NUMBER: _ClassVar[int]
    OPTIONS_FIELD_NUMBER: _ClassVar[int]
    entity_names: _containers.ScalarMap[int, str]
    frame: _prompt_pb2.PixelFrame
    labels: _containers.RepeatedCompositeFieldContainer[EvaluateModelRequest.ViewLabels]
    model: str
    options: EvaluationOptions
    def __init__(self, model: _Optional[str] = ..., labels: _Optional[_Iterable[_Union[EvaluateModelRequest.ViewLabels, _Mapping]]] = ..., entity_names: _Optional[_Mapping[int, str]] = ..., options: _Optional[_Union[EvaluationOptions, _Mapping]] = ..., frame: _Optional[_Union[_prompt_pb2.PixelFrame, str]] = ...) -> None: ...

class EvaluateModelResponse(_message.Message):
    __slots__ = ["chosen", "compute", "entities", "fixed_iou", "left_out", "model", "options", "oracle"]
    class Choice(_message.Message):
        __slots__ = ["boundary_iou", "iou", "scale_quantile", "threshold"]
        BOUNDARY_IOU_FIELD_NUMBER: _ClassVar[int]
        IOU_FIELD_NUMBER: _ClassVar[int]
        SCALE_QUANTILE_FIELD_NUMBER: _ClassVar[int]
        THRESHOLD_FIELD_NUMBER: _ClassVar[int]
        boundary_iou: float
        iou: float
        scale_quantile: float
        threshold: float
        def __init__(self, scale_quantile: _Optional[float] = ..., threshold: _Optional[float] = ..., iou: _Optional[float] = ..., boundary_iou: _Optional[float] = ...) -> None: ...
    class Entity(_message.Message):
        __slots__ = ["chosen", "click_x", "click_y", "fixed_iou", "id", "missing", "name", "oracle", "views"]
        CHOSEN_FIELD_NUMBER: _ClassVar[int]
        CLICK_X_FIELD_NUMBER: _ClassVar[int]
        CLICK_Y_FIELD_NUMBER: _ClassVar[int]
        FIXED_IOU_FIELD_NUMBER: _ClassVar[int]
        ID_FIELD_NUMBER: _ClassVar[int]
        MISSING_FIELD_NUMBER: _ClassVar[int]
        NAME_FIELD_NUMBER: _ClassVar[int]
        ORACLE_FIELD_NUMBER: _ClassVar[int]
        VIEWS_FIELD_NUMBER: _ClassVar[int]
        chosen: EvaluateModelResponse.Choice
        click_x: float
        click_y: float
        fixed_iou: _containers.RepeatedScalarFieldContainer[float]
        id: int
        missing: bool
        name: str
        oracle: EvaluateModelResponse.Choice
        views: _containers.RepeatedCompositeFieldContainer[EvaluateModelResponse.ViewScore]
        def __init__(self, id: _Optional[int] = ..., name: _Optional[str] = ..., click_x: _Optional[float] = ..., click_y: _Optional[float] = ..., missing: bool = ..., chosen: _Optional[_Union[EvaluateModelResponse.Choice, _Mapping]] = ..., oracle: _Optional[_Union[EvaluateModelResponse.Choice, _Mapping]] = ..., fixed_iou: _Optional[_Iterable[float]] = ..., views: _Optional[_Iterable[_Union[EvaluateModelResponse.ViewScore, _Mapping]]] = ...) -> None: ...
    class ViewScore(_message.Message):
        __slots__ = ["boundary_iou", "fixed_iou", "iou", "num_pixels", "view"]
        BOUNDARY_IOU_FIELD_NUMBER: _ClassVar[int]
        FIXED_IOU_FIELD_NUMBER: _ClassVar[int]
        IOU_FIELD_NUMBER: _ClassVar[int]
        NUM_PIXELS_FIELD_NUMBER: _ClassVar[int]
        VIEW_FIELD_NUMBER: _ClassVar[int]
        boundary_iou: float
        fixed_iou: _containers.RepeatedScalarFieldContainer[float]
        iou: float
        num_pixels: int
        view: str
        def __init__(self, view: _Optional[str] = ..., num_pixels: _Optional[int] = ..., iou: _Optional[float] = ..., boundary_iou: _Optional[float] = ..., fixed_iou: _Optional[_Iterable[float]] = ...) -> None: ...
    CHOSEN_FIELD_NUMBER: _ClassVar[int]
    COMPUTE_FIELD_NUMBER: _ClassVar[int]
    ENTITIES_FIELD_NUMBER: _ClassVar[int]
    FIXED_IOU_FIELD_NUMBER: _ClassVar[int]
    LEFT_OUT_FIELD_NUMBER: _ClassVar[int]
    MODEL_FIELD_NUMBER: _ClassVar[int]
    OPTIONS_FIELD_NUMBER: _ClassVar[int]
    ORACLE_FIELD_NUMBER: _ClassVar[int]
    chosen: EvaluateModelResponse.Choice
    compute: _duration_pb2.Duration
    entities: _containers.RepeatedCompositeFieldContainer[EvaluateModelResponse.Entity]
    fixed_iou: _containers.RepeatedScalarFieldContainer[float]
    left_out: _containers.RepeatedScalarFieldContainer[int]
    model: str
    options: EvaluationOptions
    oracle: EvaluateModelResponse.Choice
    def __init__(self, entities: _Optional[_Iterable[_Union[EvaluateModelResponse.Entity, _Mapping]]] = ..., left_out: _Optional[_Iterable[int]] = ..., chosen: _Optional[_Union[EvaluateModelResponse.Choice, _Mapping]] = ..., oracle: _Optional[_Union[EvaluateModelResponse.Choice, _Mapping]] = ..., fixed_iou: _Optional[_Iterable[float]] = ..., options: _Optional[_Union[EvaluationOptions, _Mapping]] = ..., compute: _Optional[_Union[_duration_pb2.Duration, _Mapping]] = ..., model: _Optional[str] = ...) -> None: ...

class EvaluationOptions(_message.Message):
    __slots__ = ["fixed_scales", "fixed_threshold", "min_pixels", "scales", "thresholds"]
    FIXED_SCALES_FIELD_NUMBER: _ClassVar[int]
    FIXED_THRESHOLD_FIELD_NUMBER: _ClassVar[int]
    MIN_PIXELS_FIELD_NUMBER: _ClassVar[int]
    SCALES_FIELD_NUMBER: _ClassVar[int]
    THRESHOLDS_FIELD_NUMBER: _ClassVar[int]
    fixed_scales: _containers.RepeatedScalarFieldContainer[float]
    fixed_threshold: float
    min_pixels: int
    scales: _containers.RepeatedScalarFieldContainer[float]
    thresholds: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, scales: _Optional[_Iterable[float]] = ..., thresholds: _Optional[_Iterable[float]] = ..., fixed_scales: _Optional[_Iterable[float]] = ..., fixed_threshold: _Optional[float] = ..., min_pixels: _Optional[int] = ...) -> None: ...
