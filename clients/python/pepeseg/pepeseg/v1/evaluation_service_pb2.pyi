from google.protobuf import duration_pb2 as _duration_pb2
from pepeseg.v1 import access_pb2 as _access_pb2
from pepeseg.v1 import prompt_pb2 as _prompt_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Iterable as _Iterable, Mapping as _Mapping, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor
EVALUATION_PROTOCOL_CLICKS: EvaluationProtocol
EVALUATION_PROTOCOL_LABEL_PROPAGATION: EvaluationProtocol
EVALUATION_PROTOCOL_LABEL_PROPAGATION_PIXELS: EvaluationProtocol
EVALUATION_PROTOCOL_PROMPT: EvaluationProtocol
EVALUATION_PROTOCOL_PROMPTABLE: EvaluationProtocol
EVALUATION_PROTOCOL_SAM_AGREEMENT: EvaluationProtocol
EVALUATION_PROTOCOL_UNSPECIFIED: EvaluationProtocol

class EntityMask(_message.Message):
    __slots__ = ["entity", "mask"]
    ENTITY_FIELD_NUMBER: _ClassVar[int]
    MASK_FIELD_NUMBER: _ClassVar[int]
    entity: str
    mask: _prompt_pb2.MaskImage
    def __init__(self, entity: _Optional[str] = ..., mask: _Optional[_Union[_prompt_pb2.MaskImage, _Mapping]] = ...) -> None: ...

class EvaluateModelRequest(_message.Message):
    __slots__ = ["entity_names", "frame", "ignore_label", "model", "options", "own_masks", "prompts", "sam_views", "views"]
    class EntityNamesEntry(_message.Message):
        __slots__ = ["key", "value"]
        KEY_FIELD_NUMBER: _ClassVar[int]
        VALUE_FIELD_NUMBER: _ClassVar[int]
        key: int
        value: str
        def __init__(self, key: _Optional[int] = ..., value: _Optional[str] = ...) -> None: ...
    class OwnMasksEntry(_message.Message):
        __slots__ = ["key", "value"]
        KEY_FIELD_NUMBER: _ClassVar[int]
        VALUE_FIELD_NUMBER: _ClassVar[int]
        key: str
        value: str
        def __init__(self, key: _Optional[str] = ..., value: _Optional[str] = ...) -> None: ...
    class PromptsEntry(_message.Message):
        __slots__ = ["key", "value"]
        KEY_FIELD_NUMBER: _ClassVar[int]
        VALUE_FIELD_NUMBER: _ClassVar[int]
        key: str
        value: _prompt_pb2.Prompt
        def __init__(self, key: _Optional[str] = ..., value: _Optional[_Union[_prompt_pb2.Prompt, _Mapping]] = ...) -> None: ...
    ENTITY_NAMES_FIELD_NUMBER: _ClassVar[int]
    FRAME_FIELD_NUMBER: _ClassVar[int]
    IGNORE_LABEL_FIELD_NUMBER: _ClassVar[int]
    MODEL_FIELD_NUMBER: _ClassVar[int]
    OPTIONS_FIELD_NUMBER: _ClassVar[int]
    OWN_MASKS_FIELD_NUMBER: _ClassVar[int]
    PROMPTS_FIELD_NUMBER: _ClassVar[int]
    SAM_VIEWS_FIELD_NUMBER: _ClassVar[int]
    VIEWS_FIELD_NUMBER: _ClassVar[int]
    entity_names: _containers.ScalarMap[int, str]
    frame: _prompt_pb2.PixelFrame
    ignore_label: int
    model: str
    options: EvaluationOptions
    own_masks: _containers.ScalarMap[str, str]
    prompts: _containers.MessageMap[str, _prompt_pb2.Prompt]
    sam_views: _containers.RepeatedCompositeFieldContainer[SamViewMasks]
    views: _containers.RepeatedCompositeFieldContainer[ViewTruth]
    def __init__(self, model: _Optional[str] = ..., views: _Optional[_Iterable[_Union[ViewTruth, _Mapping]]] = ..., entity_names: _Optional[_Mapping[int, str]] = ..., prompts: _Optional[_Mapping[str, _prompt_pb2.Prompt]] = ..., own_masks: _Optional[_Mapping[str, str]] = ..., sam_views: _Optional[_Iterable[_Union[SamViewMasks, _Mapping]]] = ..., options: _Optional[_Union[EvaluationOptions, _Mapping]] = ..., frame: _Optional[_Union[_prompt_pb2.PixelFrame, str]] = ..., ignore_label: _Optional[int] = ...) -> None: ...

class EvaluateModelResponse(_message.Message):
    __slots__ = ["categories", "compute", "entities", "left_out", "model", "notes", "num_void_pixels", "options", "sam_agreement", "scene"]
    class Choice(_message.Message):
        __slots__ = ["mean", "scale_quantile", "threshold", "views"]
        MEAN_FIELD_NUMBER: _ClassVar[int]
        SCALE_QUANTILE_FIELD_NUMBER: _ClassVar[int]
        THRESHOLD_FIELD_NUMBER: _ClassVar[int]
        VIEWS_FIELD_NUMBER: _ClassVar[int]
        mean: EvaluateModelResponse.Scores
        scale_quantile: float
        threshold: float
        views: _containers.RepeatedCompositeFieldContainer[EvaluateModelResponse.Scores]
        def __init__(self, scale_quantile: _Optional[float] = ..., threshold: _Optional[float] = ..., mean: _Optional[_Union[EvaluateModelResponse.Scores, _Mapping]] = ..., views: _Optional[_Iterable[_Union[EvaluateModelResponse.Scores, _Mapping]]] = ...) -> None: ...
    class Click(_message.Message):
        __slots__ = ["iou", "negative", "reference_iou", "x", "y"]
        IOU_FIELD_NUMBER: _ClassVar[int]
        NEGATIVE_FIELD_NUMBER: _ClassVar[int]
        REFERENCE_IOU_FIELD_NUMBER: _ClassVar[int]
        X_FIELD_NUMBER: _ClassVar[int]
        Y_FIELD_NUMBER: _ClassVar[int]
        iou: float
        negative: bool
        reference_iou: float
        x: float
        y: float
        def __init__(self, x: _Optional[float] = ..., y: _Optional[float] = ..., negative: bool = ..., reference_iou: _Optional[float] = ..., iou: _Optional[float] = ...) -> None: ...
    class Entity(_message.Message):
        __slots__ = ["automatic", "category", "clicks", "iou_by_scale", "missing", "name", "num_clicks", "paper", "reached", "reference", "reference_view", "views"]
        AUTOMATIC_FIELD_NUMBER: _ClassVar[int]
        CATEGORY_FIELD_NUMBER: _ClassVar[int]
        CLICKS_FIELD_NUMBER: _ClassVar[int]
        IOU_BY_SCALE_FIELD_NUMBER: _ClassVar[int]
        MISSING_FIELD_NUMBER: _ClassVar[int]
        NAME_FIELD_NUMBER: _ClassVar[int]
        NUM_CLICKS_FIELD_NUMBER: _ClassVar[int]
        PAPER_FIELD_NUMBER: _ClassVar[int]
        REACHED_FIELD_NUMBER: _ClassVar[int]
        REFERENCE_FIELD_NUMBER: _ClassVar[int]
        REFERENCE_VIEW_FIELD_NUMBER: _ClassVar[int]
        VIEWS_FIELD_NUMBER: _ClassVar[int]
        automatic: EvaluateModelResponse.Choice
        category: str
        clicks: _containers.RepeatedCompositeFieldContainer[EvaluateModelResponse.Click]
        iou_by_scale: _containers.RepeatedScalarFieldContainer[float]
        missing: bool
        name: str
        num_clicks: int
        paper: EvaluateModelResponse.Choice
        reached: bool
        reference: EvaluateModelResponse.Choice
        reference_view: str
        views: _containers.RepeatedCompositeFieldContainer[EvaluateModelResponse.ScoredView]
        def __init__(self, name: _Optional[str] = ..., category: _Optional[str] = ..., reference_view: _Optional[str] = ..., views: _Optional[_Iterable[_Union[EvaluateModelResponse.ScoredView, _Mapping]]] = ..., clicks: _Optional[_Iterable[_Union[EvaluateModelResponse.Click, _Mapping]]] = ..., missing: bool = ..., paper: _Optional[_Union[EvaluateModelResponse.Choice, _Mapping]] = ..., reference: _Optional[_Union[EvaluateModelResponse.Choice, _Mapping]] = ..., automatic: _Optional[_Union[EvaluateModelResponse.Choice, _Mapping]] = ..., iou_by_scale: _Optional[_Iterable[float]] = ..., reached: bool = ..., num_clicks: _Optional[int] = ...) -> None: ...
    class GroupScores(_message.Message):
        __slots__ = ["automatic", "iou_after", "iou_by_scale", "name", "num_clicks", "num_entities", "paper", "reached", "reference"]
        AUTOMATIC_FIELD_NUMBER: _ClassVar[int]
        IOU_AFTER_FIELD_NUMBER: _ClassVar[int]
        IOU_BY_SCALE_FIELD_NUMBER: _ClassVar[int]
        NAME_FIELD_NUMBER: _ClassVar[int]
        NUM_CLICKS_FIELD_NUMBER: _ClassVar[int]
        NUM_ENTITIES_FIELD_NUMBER: _ClassVar[int]
        PAPER_FIELD_NUMBER: _ClassVar[int]
        REACHED_FIELD_NUMBER: _ClassVar[int]
        REFERENCE_FIELD_NUMBER: _ClassVar[int]
        automatic: EvaluateModelResponse.Scores
        iou_after: _containers.RepeatedScalarFieldContainer[float]
        iou_by_scale: _containers.RepeatedScalarFieldContainer[float]
        name: str
        num_clicks: float
        num_entities: int
        paper: EvaluateModelResponse.Scores
        reached: float
        reference: EvaluateModelResponse.Scores
        def __init__(self, name: _Optional[str] = ..., num_entities: _Optional[int] = ..., paper: _Optional[_Union[EvaluateModelResponse.Scores, _Mapping]] = ..., reference: _Optional[_Union[EvaluateModelResponse.Scores, _Mapping]] = ..., automatic: _Optional[_Union[EvaluateModelResponse.Scores, _Mapping]] = ..., iou_by_scale: _Optional[_Iterable[float]] = ..., num_clicks: _Optional[float] = ..., reached: _Optional[float] = ..., iou_after: _Optional[_Iterable[float]] = ...) -> None: ...
    class SamAgreement(_message.Message):
        __slots__ = ["best_iou", "first_iou", "num_masks", "views"]
        BEST_IOU_FIELD_NUMBER: _ClassVar[int]
        FIRST_IOU_FIELD_NUMBER: _ClassVar[int]
        NUM_MASKS_FIELD_NUMBER: _ClassVar[int]
        VIEWS_FIELD_NUMBER: _ClassVar[int]
        best_iou: float
        first_iou: float
        num_masks: int
        views: _containers.RepeatedCompositeFieldContainer[EvaluateModelResponse.SamView]
        def __init__(self, views: _Optional[_Iterable[_Union[EvaluateModelResponse.SamView, _Mapping]]] = ..., num_masks: _Optional[int] = ..., first_iou: _Optional[float] = ..., best_iou: _Optional[float] = ...) -> None: ...
    class SamView(_message.Message):
        __slots__ = ["best_iou", "first_iou", "num_masks", "view"]
        BEST_IOU_FIELD_NUMBER: _ClassVar[int]
        FIRST_IOU_FIELD_NUMBER: _ClassVar[int]
        NUM_MASKS_FIELD_NUMBER: _ClassVar[int]
        VIEW_FIELD_NUMBER: _ClassVar[int]
        best_iou: float
        first_iou: float
        num_masks: int
        view: str
        def __init__(self, view: _Optional[str] = ..., num_masks: _Optional[int] = ..., first_iou: _Optional[float] = ..., best_iou: _Optional[float] = ...) -> None: ...
    class ScoredView(_message.Message):
        __slots__ = ["num_pixels", "view"]
        NUM_PIXELS_FIELD_NUMBER: _ClassVar[int]
        VIEW_FIELD_NUMBER: _ClassVar[int]
        num_pixels: int
        view: str
        def __init__(self, view: _Optional[str] = ..., num_pixels: _Optional[int] = ...) -> None: ...
    class Scores(_message.Message):
        __slots__ = ["accuracy", "boundary_iou", "iou"]
        ACCURACY_FIELD_NUMBER: _ClassVar[int]
        BOUNDARY_IOU_FIELD_NUMBER: _ClassVar[int]
        IOU_FIELD_NUMBER: _ClassVar[int]
        accuracy: float
        boundary_iou: float
        iou: float
        def __init__(self, iou: _Optional[float] = ..., accuracy: _Optional[float] = ..., boundary_iou: _Optional[float] = ...) -> None: ...
    CATEGORIES_FIELD_NUMBER: _ClassVar[int]
    COMPUTE_FIELD_NUMBER: _ClassVar[int]
    ENTITIES_FIELD_NUMBER: _ClassVar[int]
    LEFT_OUT_FIELD_NUMBER: _ClassVar[int]
    MODEL_FIELD_NUMBER: _ClassVar[int]
    NOTES_FIELD_NUMBER: _ClassVar[int]
    NUM_VOID_PIXELS_FIELD_NUMBER: _ClassVar[int]
    OPTIONS_FIELD_NUMBER: _ClassVar[int]
    SAM_AGREEMENT_FIELD_NUMBER: _ClassVar[int]
    SCENE_FIELD_NUMBER: _ClassVar[int]
    categories: _containers.RepeatedCompositeFieldContainer[EvaluateModelResponse.GroupScores]
    compute: _duration_pb2.Duration
    entities: _containers.RepeatedCompositeFieldContainer[EvaluateModelResponse.Entity]
    left_out: _containers.RepeatedScalarFieldContainer[str]
    model: str
    notes: _containers.RepeatedScalarFieldContainer[str]
    num_void_pixels: int
    options: EvaluationOptions
    sam_agreement: EvaluateModelResponse.SamAgreement
    scene: EvaluateModelResponse.GroupScores
    def __init__(self, entities: _Optional[_Iterable[_Union[EvaluateModelResponse.Entity, _Mapping]]] = ..., left_out: _Optional[_Iterable[str]] = ..., categories: _Optional[_Iterable[_Union[EvaluateModelResponse.GroupScores, _Mapping]]] = ..., scene: _Optional[_Union[EvaluateModelResponse.GroupScores, _Mapping]] = ..., sam_agreement: _Optional[_Union[EvaluateModelResponse.SamAgreement, _Mapping]] = ..., options: _Optional[_Union[EvaluationOptions, _Mapping]] = ..., compute: _Optional[_Union[_duration_pb2.Duration, _Mapping]] = ..., model: _Optional[str] = ..., num_void_pixels: _Optional[int] = ..., notes: _Optional[_Iterable[str]] = ...) -> None: ...

class EvaluationOptions(_message.Message):
    __slots__ = ["accept_trained_views", "clicks", "fixed_threshold", "label_propagation", "min_pixels", "promptable", "protocol", "refine_borders", "sam_agreement", "scales", "score_reference", "thresholds"]
    class Clicks(_message.Message):
        __slots__ = ["max_clicks", "min_iou"]
        MAX_CLICKS_FIELD_NUMBER: _ClassVar[int]
        MIN_IOU_FIELD_NUMBER: _ClassVar[int]
        max_clicks: int
        min_iou: float
        def __init__(self, min_iou: _Optional[float] = ..., max_clicks: _Optional[int] = ...) -> None: ...
    class LabelPropagation(_message.Message):
        __slots__ = ["max_pixels", "min_cosine", "min_covered", "min_inside"]
        MAX_PIXELS_FIELD_NUMBER: _ClassVar[int]
        MIN_COSINE_FIELD_NUMBER: _ClassVar[int]
        MIN_COVERED_FIELD_NUMBER: _ClassVar[int]
        MIN_INSIDE_FIELD_NUMBER: _ClassVar[int]
        max_pixels: int
        min_cosine: float
        min_covered: float
        min_inside: float
        def __init__(self, min_cosine: _Optional[float] = ..., min_inside: _Optional[float] = ..., min_covered: _Optional[float] = ..., max_pixels: _Optional[int] = ...) -> None: ...
    class Promptable(_message.Message):
        __slots__ = ["max_points", "min_cosine"]
        MAX_POINTS_FIELD_NUMBER: _ClassVar[int]
        MIN_COSINE_FIELD_NUMBER: _ClassVar[int]
        max_points: int
        min_cosine: float
        def __init__(self, min_cosine: _Optional[float] = ..., max_points: _Optional[int] = ...) -> None: ...
    class SamAgreement(_message.Message):
        __slots__ = ["min_pixels", "min_predicted_iou", "min_stability", "num_proposals"]
        MIN_PIXELS_FIELD_NUMBER: _ClassVar[int]
        MIN_PREDICTED_IOU_FIELD_NUMBER: _ClassVar[int]
        MIN_STABILITY_FIELD_NUMBER: _ClassVar[int]
        NUM_PROPOSALS_FIELD_NUMBER: _ClassVar[int]
        min_pixels: int
        min_predicted_iou: float
        min_stability: float
        num_proposals: int
        def __init__(self, min_predicted_iou: _Optional[float] = ..., min_stability: _Optional[float] = ..., min_pixels: _Optional[int] = ..., num_proposals: _Optional[int] = ...) -> None: ...
    ACCEPT_TRAINED_VIEWS_FIELD_NUMBER: _ClassVar[int]
    CLICKS_FIELD_NUMBER: _ClassVar[int]
    FIXED_THRESHOLD_FIELD_NUMBER: _ClassVar[int]
    LABEL_PROPAGATION_FIELD_NUMBER: _ClassVar[int]
    MIN_PIXELS_FIELD_NUMBER: _ClassVar[int]
    PROMPTABLE_FIELD_NUMBER: _ClassVar[int]
    PROTOCOL_FIELD_NUMBER: _ClassVar[int]
    REFINE_BORDERS_FIELD_NUMBER: _ClassVar[int]
    SAM_AGREEMENT_FIELD_NUMBER: _ClassVar[int]
    SCALES_FIELD_NUMBER: _ClassVar[int]
    SCORE_REFERENCE_FIELD_NUMBER: _ClassVar[int]
    THRESHOLDS_FIELD_NUMBER: _ClassVar[int]
    accept_trained_views: bool
    clicks: EvaluationOptions.Clicks
    fixed_threshold: float
    label_propagation: EvaluationOptions.LabelPropagation
    min_pixels: int
    promptable: EvaluationOptions.Promptable
    protocol: EvaluationProtocol
    refine_borders: bool
    sam_agreement: EvaluationOptions.SamAgreement
    scales: _containers.RepeatedScalarFieldContainer[float]
    score_reference: bool
    thresholds: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, protocol: _Optional[_Union[EvaluationProtocol, str]] = ..., scales: _Optional[_Iterable[float]] = ..., thresholds: _Optional[_Iterable[float]] = ..., fixed_threshold: _Optional[float] = ..., min_pixels: _Optional[int] = ..., score_reference: bool = ..., accept_trained_views: bool = ..., label_propagation: _Optional[_Union[EvaluationOptions.LabelPropagation, _Mapping]] = ..., promptable: _Optional[_Union[EvaluationOptions.Promptable, _Mapping]] = ..., clicks: _Optional[_Union[EvaluationOptions.Clicks, _Mapping]] = ..., sam_agreement: _Optional[_Union[EvaluationOptions.SamAgreement, _Mapping]] = ..., refine_borders: bool = ...) -> None: ...

class SamViewMasks(_message.Message):
    __slots__ = ["ignore_png", "masks", "view"]
    class SamMask(_message.Message):
        __slots__ = ["mask", "predicted_iou", "stability"]
        MASK_FIELD_NUMBER: _ClassVar[int]
        PREDICTED_IOU_FIELD_NUMBER: _ClassVar[int]
        STABILITY_FIELD_NUMBER: _ClassVar[int]
        mask: _prompt_pb2.MaskImage
        predicted_iou: float
        stability: float
        def __init__(self, mask: _Optional[_Union[_prompt_pb2.MaskImage, _Mapping]] = ..., predicted_iou: _Optional[float] = ..., stability: _Optional[float] = ...) -> None: ...
    IGNORE_PNG_FIELD_NUMBER: _ClassVar[int]
    MASKS_FIELD_NUMBER: _ClassVar[int]
    VIEW_FIELD_NUMBER: _ClassVar[int]
    ignore_png: bytes
    masks: _containers.RepeatedCompositeFieldContainer[SamViewMasks.SamMask]
    view: str
    def __init__(self, view: _Optional[str] = ..., masks: _Optional[_Iterable[_Union[SamViewMasks.SamMask, _Mapping]]] = ..., ignore_png: _Optional[bytes] = ...) -> None: ...

class ViewTruth(_message.Message):
    __slots__ = ["ignore_png", "labels_png", "masks", "view"]
    IGNORE_PNG_FIELD_NUMBER: _ClassVar[int]
    LABELS_PNG_FIELD_NUMBER: _ClassVar[int]
    MASKS_FIELD_NUMBER: _ClassVar[int]
    VIEW_FIELD_NUMBER: _ClassVar[int]
    ignore_png: bytes
    labels_png: bytes
    masks: _containers.RepeatedCompositeFieldContainer[EntityMask]
    view: str
    def __init__(self, view: _Optional[str] = ..., labels_png: _Optional[bytes] = ..., masks: _Optional[_Iterable[_Union[EntityMask, _Mapping]]] = ..., ignore_png: _Optional[bytes] = ...) -> None: ...

class EvaluationProtocol(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = []
