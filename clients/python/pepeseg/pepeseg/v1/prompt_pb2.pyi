from pepeseg.v1 import geometry_pb2 as _geometry_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Iterable as _Iterable, Mapping as _Mapping, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor
MASK_ENCODING_COCO_RLE: MaskEncoding
MASK_ENCODING_PNG: MaskEncoding
MASK_ENCODING_UNSPECIFIED: MaskEncoding
PIXEL_FRAME_PHOTOGRAPH: PixelFrame
PIXEL_FRAME_UNSPECIFIED: PixelFrame
PIXEL_FRAME_VIEW: PixelFrame

class BoxPrompt(_message.Message):
    __slots__ = ["height", "width", "x", "y"]
    HEIGHT_FIELD_NUMBER: _ClassVar[int]
    WIDTH_FIELD_NUMBER: _ClassVar[int]
    X_FIELD_NUMBER: _ClassVar[int]
    Y_FIELD_NUMBER: _ClassVar[int]
    height: float
    width: float
    x: float
    y: float
    def __init__(self, x: _Optional[float] = ..., y: _Optional[float] = ..., width: _Optional[float] = ..., height: _Optional[float] = ...) -> None: ...

class CocoRle(_message.Message):
    __slots__ = ["counts", "height", "width"]
    COUNTS_FIELD_NUMBER: _ClassVar[int]
    HEIGHT_FIELD_NUMBER: _ClassVar[int]
    WIDTH_FIELD_NUMBER: _ClassVar[int]
    counts: str
    height: int
    width: int
    def __init__(self, height: _Optional[int] = ..., width: _Optional[int] = ..., counts: _Optional[str] = ...) -> None: ...

class Granularity(_message.Message):
    __slots__ = ["scale_quantile", "scale_units", "threshold"]
    SCALE_QUANTILE_FIELD_NUMBER: _ClassVar[int]
    SCALE_UNITS_FIELD_NUMBER: _ClassVar[int]
    THRESHOLD_FIELD_NUMBER: _ClassVar[int]
    scale_quantile: float
    scale_units: float
    threshold: float
    def __init__(self, scale_quantile: _Optional[float] = ..., scale_units: _Optional[float] = ..., threshold: _Optional[float] = ...) -> None: ...

class MaskImage(_message.Message):
    __slots__ = ["png", "rle"]
    PNG_FIELD_NUMBER: _ClassVar[int]
    RLE_FIELD_NUMBER: _ClassVar[int]
    png: bytes
    rle: CocoRle
    def __init__(self, rle: _Optional[_Union[CocoRle, _Mapping]] = ..., png: _Optional[bytes] = ...) -> None: ...

class PointsPrompt(_message.Message):
    __slots__ = ["points", "previous_mask"]
    class Point(_message.Message):
        __slots__ = ["negative", "x", "y"]
        NEGATIVE_FIELD_NUMBER: _ClassVar[int]
        X_FIELD_NUMBER: _ClassVar[int]
        Y_FIELD_NUMBER: _ClassVar[int]
        negative: bool
        x: float
        y: float
        def __init__(self, x: _Optional[float] = ..., y: _Optional[float] = ..., negative: bool = ...) -> None: ...
    POINTS_FIELD_NUMBER: _ClassVar[int]
    PREVIOUS_MASK_FIELD_NUMBER: _ClassVar[int]
    points: _containers.RepeatedCompositeFieldContainer[PointsPrompt.Point]
    previous_mask: MaskImage
    def __init__(self, points: _Optional[_Iterable[_Union[PointsPrompt.Point, _Mapping]]] = ..., previous_mask: _Optional[_Union[MaskImage, _Mapping]] = ...) -> None: ...

class Prompt(_message.Message):
    __slots__ = ["box", "label", "mask", "point_mean", "points", "scribbles", "view"]
    BOX_FIELD_NUMBER: _ClassVar[int]
    LABEL_FIELD_NUMBER: _ClassVar[int]
    MASK_FIELD_NUMBER: _ClassVar[int]
    POINTS_FIELD_NUMBER: _ClassVar[int]
    POINT_MEAN_FIELD_NUMBER: _ClassVar[int]
    SCRIBBLES_FIELD_NUMBER: _ClassVar[int]
    VIEW_FIELD_NUMBER: _ClassVar[int]
    box: BoxPrompt
    label: str
    mask: MaskImage
    point_mean: PointsPrompt
    points: PointsPrompt
    scribbles: ScribblesPrompt
    view: Viewpoint
    def __init__(self, view: _Optional[_Union[Viewpoint, _Mapping]] = ..., points: _Optional[_Union[PointsPrompt, _Mapping]] = ..., box: _Optional[_Union[BoxPrompt, _Mapping]] = ..., mask: _Optional[_Union[MaskImage, _Mapping]] = ..., label: _Optional[str] = ..., scribbles: _Optional[_Union[ScribblesPrompt, _Mapping]] = ..., point_mean: _Optional[_Union[PointsPrompt, _Mapping]] = ...) -> None: ...

class ScribblesPrompt(_message.Message):
    __slots__ = ["negative", "positive", "strokes"]
    class Stroke(_message.Message):
        __slots__ = ["negative", "path", "width"]
        class Vertex(_message.Message):
            __slots__ = ["x", "y"]
            X_FIELD_NUMBER: _ClassVar[int]
            Y_FIELD_NUMBER: _ClassVar[int]
            x: float
            y: float
            def __init__(self, x: _Optional[float] = ..., y: _Optional[float] = ...) -> None: ...
        NEGATIVE_FIELD_NUMBER: _ClassVar[int]
        PATH_FIELD_NUMBER: _ClassVar[int]
        WIDTH_FIELD_NUMBER: _ClassVar[int]
        negative: bool
        path: _containers.RepeatedCompositeFieldContainer[ScribblesPrompt.Stroke.Vertex]
        width: float
        def __init__(self, path: _Optional[_Iterable[_Union[ScribblesPrompt.Stroke.Vertex, _Mapping]]] = ..., negative: bool = ..., width: _Optional[float] = ...) -> None: ...
    NEGATIVE_FIELD_NUMBER: _ClassVar[int]
    POSITIVE_FIELD_NUMBER: _ClassVar[int]
    STROKES_FIELD_NUMBER: _ClassVar[int]
    negative: MaskImage
    positive: MaskImage
    strokes: _containers.RepeatedCompositeFieldContainer[ScribblesPrompt.Stroke]
    def __init__(self, strokes: _Optional[_Iterable[_Union[ScribblesPrompt.Stroke, _Mapping]]] = ..., positive: _Optional[_Union[MaskImage, _Mapping]] = ..., negative: _Optional[_Union[MaskImage, _Mapping]] = ...) -> None: ...

class Viewpoint(_message.Message):
    __slots__ = ["free", "view"]
    class FreeCamera(_message.Message):
        __slots__ = ["cam_from_world", "camera"]
        CAMERA_FIELD_NUMBER: _ClassVar[int]
        CAM_FROM_WORLD_FIELD_NUMBER: _ClassVar[int]
        cam_from_world: _geometry_pb2.RigidTransform
        camera: _geometry_pb2.PinholeCamera
        def __init__(self, camera: _Optional[_Union[_geometry_pb2.PinholeCamera, _Mapping]] = ..., cam_from_world: _Optional[_Union[_geometry_pb2.RigidTransform, _Mapping]] = ...) -> None: ...
    FREE_FIELD_NUMBER: _ClassVar[int]
    VIEW_FIELD_NUMBER: _ClassVar[int]
    free: Viewpoint.FreeCamera
    view: str
    def __init__(self, view: _Optional[str] = ..., free: _Optional[_Union[Viewpoint.FreeCamera, _Mapping]] = ...) -> None: ...

class PixelFrame(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = []

class MaskEncoding(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = []
