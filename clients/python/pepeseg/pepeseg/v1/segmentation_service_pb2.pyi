from pepeseg.v1 import access_pb2 as _access_pb2
from pepeseg.v1 import decomposition_pb2 as _decomposition_pb2
from pepeseg.v1 import errors_pb2 as _errors_pb2
from pepeseg.v1 import find_pb2 as _find_pb2
from pepeseg.v1 import prompt_pb2 as _prompt_pb2
from pepeseg.v1 import snapshot_pb2 as _snapshot_pb2
from pepeseg.v1 import timing_pb2 as _timing_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Iterable as _Iterable, Mapping as _Mapping, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class CorrectSegmentRequest(_message.Message):
    __slots__ = ["corrections", "frame", "granularity", "model"]
    class Correction(_message.Message):
        __slots__ = ["mask", "view"]
        MASK_FIELD_NUMBER: _ClassVar[int]
        VIEW_FIELD_NUMBER: _ClassVar[int]
        mask: _prompt_pb2.MaskImage
        view: _prompt_pb2.Viewpoint
        def __init__(self, view: _Optional[_Union[_prompt_pb2.Viewpoint, _Mapping]] = ..., mask: _Optional[_Union[_prompt_pb2.MaskImage, _Mapping]] = ...) -> None: ...
    CORRECTIONS_FIELD_NUMBER: _ClassVar[int]
    FRAME_FIELD_NUMBER: _ClassVar[int]
    GRANULARITY_FIELD_NUMBER: _ClassVar[int]
    MODEL_FIELD_NUMBER: _ClassVar[int]
    corrections: _containers.RepeatedCompositeFieldContainer[CorrectSegmentRequest.Correction]
    frame: _prompt_pb2.PixelFrame
    granularity: _prompt_pb2.Granularity
    model: str
    def __init__(self, model: _Optional[str] = ..., corrections: _Optional[_Iterable[_Union[CorrectSegmentRequest.Correction, _Mapping]]] = ..., granularity: _Optional[_Union[_prompt_pb2.Granularity, _Mapping]] = ..., frame: _Optional[_Union[_prompt_pb2.PixelFrame, str]] = ...) -> None: ...

class CorrectSegmentResponse(_message.Message):
    __slots__ = ["corrected_from", "model", "num_changed", "scale_quantile", "scale_units", "scores", "threshold", "timing"]
    class Score(_message.Message):
        __slots__ = ["iou_after", "iou_before", "view"]
        IOU_AFTER_FIELD_NUMBER: _ClassVar[int]
        IOU_BEFORE_FIELD_NUMBER: _ClassVar[int]
        VIEW_FIELD_NUMBER: _ClassVar[int]
        iou_after: float
        iou_before: float
        view: str
        def __init__(self, view: _Optional[str] = ..., iou_before: _Optional[float] = ..., iou_after: _Optional[float] = ...) -> None: ...
    CORRECTED_FROM_FIELD_NUMBER: _ClassVar[int]
    MODEL_FIELD_NUMBER: _ClassVar[int]
    NUM_CHANGED_FIELD_NUMBER: _ClassVar[int]
    SCALE_QUANTILE_FIELD_NUMBER: _ClassVar[int]
    SCALE_UNITS_FIELD_NUMBER: _ClassVar[int]
    SCORES_FIELD_NUMBER: _ClassVar[int]
    THRESHOLD_FIELD_NUMBER: _ClassVar[int]
    TIMING_FIELD_NUMBER: _ClassVar[int]
    corrected_from: str
    model: str
    num_changed: int
    scale_quantile: float
    scale_units: float
    scores: _containers.RepeatedCompositeFieldContainer[CorrectSegmentResponse.Score]
    threshold: float
    timing: _timing_pb2.QueryTiming
    def __init__(self, model: _Optional[str] = ..., corrected_from: _Optional[str] = ..., scores: _Optional[_Iterable[_Union[CorrectSegmentResponse.Score, _Mapping]]] = ..., scale_quantile: _Optional[float] = ..., scale_units: _Optional[float] = ..., threshold: _Optional[float] = ..., num_changed: _Optional[int] = ..., timing: _Optional[_Union[_timing_pb2.QueryTiming, _Mapping]] = ...) -> None: ...

class ProposeScalesRequest(_message.Message):
    __slots__ = ["frame", "mask_encoding", "max_proposals", "model", "prompt", "refine_borders"]
    FRAME_FIELD_NUMBER: _ClassVar[int]
    MASK_ENCODING_FIELD_NUMBER: _ClassVar[int]
    MAX_PROPOSALS_FIELD_NUMBER: _ClassVar[int]
    MODEL_FIELD_NUMBER: _ClassVar[int]
    PROMPT_FIELD_NUMBER: _ClassVar[int]
    REFINE_BORDERS_FIELD_NUMBER: _ClassVar[int]
    frame: _prompt_pb2.PixelFrame
    mask_encoding: _prompt_pb2.MaskEncoding
    max_proposals: int
    model: str
    prompt: _prompt_pb2.Prompt
    refine_borders: bool
    def __init__(self, model: _Optional[str] = ..., prompt: _Optional[_Union[_prompt_pb2.Prompt, _Mapping]] = ..., max_proposals: _Optional[int] = ..., mask_encoding: _Optional[_Union[_prompt_pb2.MaskEncoding, str]] = ..., frame: _Optional[_Union[_prompt_pb2.PixelFrame, str]] = ..., refine_borders: bool = ...) -> None: ...

class ProposeScalesResponse(_message.Message):
    __slots__ = ["best", "model", "proposals", "snapshot", "timing"]
    class Kind(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = []
    class Proposal(_message.Message):
        __slots__ = ["kind", "mask", "scale_quantile", "scale_units", "stability", "support", "threshold"]
        KIND_FIELD_NUMBER: _ClassVar[int]
        MASK_FIELD_NUMBER: _ClassVar[int]
        SCALE_QUANTILE_FIELD_NUMBER: _ClassVar[int]
        SCALE_UNITS_FIELD_NUMBER: _ClassVar[int]
        STABILITY_FIELD_NUMBER: _ClassVar[int]
        SUPPORT_FIELD_NUMBER: _ClassVar[int]
        THRESHOLD_FIELD_NUMBER: _ClassVar[int]
        kind: ProposeScalesResponse.Kind
        mask: SegmentViewsResponse.ViewMask
        scale_quantile: float
        scale_units: float
        stability: float
        support: float
        threshold: float
        def __init__(self, scale_quantile: _Optional[float] = ..., threshold: _Optional[float] = ..., scale_units: _Optional[float] = ..., support: _Optional[float] = ..., stability: _Optional[float] = ..., mask: _Optional[_Union[SegmentViewsResponse.ViewMask, _Mapping]] = ..., kind: _Optional[_Union[ProposeScalesResponse.Kind, str]] = ...) -> None: ...
    BEST_FIELD_NUMBER: _ClassVar[int]
    KIND_GROUP: ProposeScalesResponse.Kind
    KIND_OBJECT: ProposeScalesResponse.Kind
    KIND_PART: ProposeScalesResponse.Kind
    KIND_UNSPECIFIED: ProposeScalesResponse.Kind
    MODEL_FIELD_NUMBER: _ClassVar[int]
    PROPOSALS_FIELD_NUMBER: _ClassVar[int]
    SNAPSHOT_FIELD_NUMBER: _ClassVar[int]
    TIMING_FIELD_NUMBER: _ClassVar[int]
    best: int
    model: str
    proposals: _containers.RepeatedCompositeFieldContainer[ProposeScalesResponse.Proposal]
    snapshot: _snapshot_pb2.Snapshot
    timing: _timing_pb2.QueryTiming
    def __init__(self, proposals: _Optional[_Iterable[_Union[ProposeScalesResponse.Proposal, _Mapping]]] = ..., timing: _Optional[_Union[_timing_pb2.QueryTiming, _Mapping]] = ..., model: _Optional[str] = ..., best: _Optional[int] = ..., snapshot: _Optional[_Union[_snapshot_pb2.Snapshot, _Mapping]] = ...) -> None: ...

class SegmentViewsRequest(_message.Message):
    __slots__ = ["frame", "granularity", "mask_encoding", "model", "prompt", "refine_borders", "sam_borders", "sam_clicks", "targets", "want_similarity"]
    class Targets(_message.Message):
        __slots__ = ["group", "views"]
        class Group(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
            __slots__ = []
        GROUP_ALL: SegmentViewsRequest.Targets.Group
        GROUP_FIELD_NUMBER: _ClassVar[int]
        GROUP_HELD_OUT: SegmentViewsRequest.Targets.Group
        GROUP_UNSPECIFIED: SegmentViewsRequest.Targets.Group
        VIEWS_FIELD_NUMBER: _ClassVar[int]
        group: SegmentViewsRequest.Targets.Group
        views: _containers.RepeatedScalarFieldContainer[str]
        def __init__(self, group: _Optional[_Union[SegmentViewsRequest.Targets.Group, str]] = ..., views: _Optional[_Iterable[str]] = ...) -> None: ...
    FRAME_FIELD_NUMBER: _ClassVar[int]
    GRANULARITY_FIELD_NUMBER: _ClassVar[int]
    MASK_ENCODING_FIELD_NUMBER: _ClassVar[int]
    MODEL_FIELD_NUMBER: _ClassVar[int]
    PROMPT_FIELD_NUMBER: _ClassVar[int]
    REFINE_BORDERS_FIELD_NUMBER: _ClassVar[int]
    SAM_BORDERS_FIELD_NUMBER: _ClassVar[int]
    SAM_CLICKS_FIELD_NUMBER: _ClassVar[int]
    TARGETS_FIELD_NUMBER: _ClassVar[int]
    WANT_SIMILARITY_FIELD_NUMBER: _ClassVar[int]
    frame: _prompt_pb2.PixelFrame
    granularity: _prompt_pb2.Granularity
    mask_encoding: _prompt_pb2.MaskEncoding
    model: str
    prompt: _prompt_pb2.Prompt
    refine_borders: bool
    sam_borders: bool
    sam_clicks: bool
    targets: SegmentViewsRequest.Targets
    want_similarity: bool
    def __init__(self, model: _Optional[str] = ..., prompt: _Optional[_Union[_prompt_pb2.Prompt, _Mapping]] = ..., granularity: _Optional[_Union[_prompt_pb2.Granularity, _Mapping]] = ..., targets: _Optional[_Union[SegmentViewsRequest.Targets, _Mapping]] = ..., mask_encoding: _Optional[_Union[_prompt_pb2.MaskEncoding, str]] = ..., want_similarity: bool = ..., frame: _Optional[_Union[_prompt_pb2.PixelFrame, str]] = ..., refine_borders: bool = ..., sam_borders: bool = ..., sam_clicks: bool = ...) -> None: ...

class SegmentViewsResponse(_message.Message):
    __slots__ = ["box_agreement", "masks", "model", "scale_quantile", "scale_units", "snapshot", "threshold", "timing"]
    class BorderImage(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = []
    class Box(_message.Message):
        __slots__ = ["height", "width", "x", "y"]
        HEIGHT_FIELD_NUMBER: _ClassVar[int]
        WIDTH_FIELD_NUMBER: _ClassVar[int]
        X_FIELD_NUMBER: _ClassVar[int]
        Y_FIELD_NUMBER: _ClassVar[int]
        height: int
        width: int
        x: int
        y: int
        def __init__(self, x: _Optional[int] = ..., y: _Optional[int] = ..., width: _Optional[int] = ..., height: _Optional[int] = ...) -> None: ...
    class SimilarityMap(_message.Message):
        __slots__ = ["height", "values", "width"]
        HEIGHT_FIELD_NUMBER: _ClassVar[int]
        VALUES_FIELD_NUMBER: _ClassVar[int]
        WIDTH_FIELD_NUMBER: _ClassVar[int]
        height: int
        values: bytes
        width: int
        def __init__(self, width: _Optional[int] = ..., height: _Optional[int] = ..., values: _Optional[bytes] = ...) -> None: ...
    class ViewMask(_message.Message):
        __slots__ = ["area", "border_image", "box", "png", "rle", "score", "similarity", "view"]
        AREA_FIELD_NUMBER: _ClassVar[int]
        BORDER_IMAGE_FIELD_NUMBER: _ClassVar[int]
        BOX_FIELD_NUMBER: _ClassVar[int]
        PNG_FIELD_NUMBER: _ClassVar[int]
        RLE_FIELD_NUMBER: _ClassVar[int]
        SCORE_FIELD_NUMBER: _ClassVar[int]
        SIMILARITY_FIELD_NUMBER: _ClassVar[int]
        VIEW_FIELD_NUMBER: _ClassVar[int]
        area: int
        border_image: SegmentViewsResponse.BorderImage
        box: SegmentViewsResponse.Box
        png: bytes
        rle: _prompt_pb2.CocoRle
        score: float
        similarity: SegmentViewsResponse.SimilarityMap
        view: str
        def __init__(self, view: _Optional[str] = ..., rle: _Optional[_Union[_prompt_pb2.CocoRle, _Mapping]] = ..., png: _Optional[bytes] = ..., score: _Optional[float] = ..., box: _Optional[_Union[SegmentViewsResponse.Box, _Mapping]] = ..., area: _Optional[int] = ..., similarity: _Optional[_Union[SegmentViewsResponse.SimilarityMap, _Mapping]] = ..., border_image: _Optional[_Union[SegmentViewsResponse.BorderImage, str]] = ...) -> None: ...
    BORDER_IMAGE_PHOTOGRAPH: SegmentViewsResponse.BorderImage
    BORDER_IMAGE_RENDERING: SegmentViewsResponse.BorderImage
    BORDER_IMAGE_UNSPECIFIED: SegmentViewsResponse.BorderImage
    BOX_AGREEMENT_FIELD_NUMBER: _ClassVar[int]
    MASKS_FIELD_NUMBER: _ClassVar[int]
    MODEL_FIELD_NUMBER: _ClassVar[int]
    SCALE_QUANTILE_FIELD_NUMBER: _ClassVar[int]
    SCALE_UNITS_FIELD_NUMBER: _ClassVar[int]
    SNAPSHOT_FIELD_NUMBER: _ClassVar[int]
    THRESHOLD_FIELD_NUMBER: _ClassVar[int]
    TIMING_FIELD_NUMBER: _ClassVar[int]
    box_agreement: float
    masks: _containers.RepeatedCompositeFieldContainer[SegmentViewsResponse.ViewMask]
    model: str
    scale_quantile: float
    scale_units: float
    snapshot: _snapshot_pb2.Snapshot
    threshold: float
    timing: _timing_pb2.QueryTiming
    def __init__(self, masks: _Optional[_Iterable[_Union[SegmentViewsResponse.ViewMask, _Mapping]]] = ..., scale_quantile: _Optional[float] = ..., scale_units: _Optional[float] = ..., threshold: _Optional[float] = ..., timing: _Optional[_Union[_timing_pb2.QueryTiming, _Mapping]] = ..., model: _Optional[str] = ..., box_agreement: _Optional[float] = ..., snapshot: _Optional[_Union[_snapshot_pb2.Snapshot, _Mapping]] = ...) -> None: ...

class StreamSegmentsRequest(_message.Message):
    __slots__ = ["segment", "sequence"]
    SEGMENT_FIELD_NUMBER: _ClassVar[int]
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    segment: SegmentViewsRequest
    sequence: int
    def __init__(self, sequence: _Optional[int] = ..., segment: _Optional[_Union[SegmentViewsRequest, _Mapping]] = ...) -> None: ...

class StreamSegmentsResponse(_message.Message):
    __slots__ = ["error", "segment", "sequence"]
    ERROR_FIELD_NUMBER: _ClassVar[int]
    SEGMENT_FIELD_NUMBER: _ClassVar[int]
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    error: _errors_pb2.Error
    segment: SegmentViewsResponse
    sequence: int
    def __init__(self, sequence: _Optional[int] = ..., segment: _Optional[_Union[SegmentViewsResponse, _Mapping]] = ..., error: _Optional[_Union[_errors_pb2.Error, _Mapping]] = ...) -> None: ...
