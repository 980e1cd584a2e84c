from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Iterable as _Iterable, Mapping as _Mapping, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor
PRIOR_MAKER_COMMAND: PriorMaker
PRIOR_MAKER_EMBEDDED: PriorMaker
PRIOR_MAKER_NONE: PriorMaker
PRIOR_MAKER_SAM: PriorMaker
PRIOR_MAKER_SAM_AND_EMBEDDED: PriorMaker
PRIOR_MAKER_UNSPECIFIED: PriorMaker
SFM_ENGINE_COLMAP: SfmEngine
SFM_ENGINE_OWN: SfmEngine
SFM_ENGINE_UNSPECIFIED: SfmEngine
SFM_MATCHING_EXHAUSTIVE: SfmMatching
SFM_MATCHING_SEQUENTIAL: SfmMatching
SFM_MATCHING_UNSPECIFIED: SfmMatching
TRAINING_PRESET_BEST: TrainingPreset
TRAINING_PRESET_PAPER: TrainingPreset
TRAINING_PRESET_PREVIEW: TrainingPreset
TRAINING_PRESET_STANDARD: TrainingPreset
TRAINING_PRESET_UNSPECIFIED: TrainingPreset

class FeatureOptions(_message.Message):
    __slots__ = ["num_steps", "seed"]
    NUM_STEPS_FIELD_NUMBER: _ClassVar[int]
    SEED_FIELD_NUMBER: _ClassVar[int]
    num_steps: int
    seed: int
    def __init__(self, num_steps: _Optional[int] = ..., seed: _Optional[int] = ...) -> None: ...

class ImportOptions(_message.Message):
    __slots__ = ["held_out_every", "held_out_views", "image_scale", "use_depth", "use_masks"]
    HELD_OUT_EVERY_FIELD_NUMBER: _ClassVar[int]
    HELD_OUT_VIEWS_FIELD_NUMBER: _ClassVar[int]
    IMAGE_SCALE_FIELD_NUMBER: _ClassVar[int]
    USE_DEPTH_FIELD_NUMBER: _ClassVar[int]
    USE_MASKS_FIELD_NUMBER: _ClassVar[int]
    held_out_every: int
    held_out_views: _containers.RepeatedScalarFieldContainer[str]
    image_scale: float
    use_depth: bool
    use_masks: bool
    def __init__(self, image_scale: _Optional[float] = ..., held_out_every: _Optional[int] = ..., held_out_views: _Optional[_Iterable[str]] = ..., use_masks: bool = ..., use_depth: bool = ...) -> None: ...

class PriorOptions(_message.Message):
    __slots__ = ["depth", "masks"]
    DEPTH_FIELD_NUMBER: _ClassVar[int]
    MASKS_FIELD_NUMBER: _ClassVar[int]
    depth: PriorMaker
    masks: PriorMaker
    def __init__(self, masks: _Optional[_Union[PriorMaker, str]] = ..., depth: _Optional[_Union[PriorMaker, str]] = ...) -> None: ...

class ReconstructOptions(_message.Message):
    __slots__ = ["max_gaussians", "megapixels_per_step", "num_steps", "seed"]
    MAX_GAUSSIANS_FIELD_NUMBER: _ClassVar[int]
    MEGAPIXELS_PER_STEP_FIELD_NUMBER: _ClassVar[int]
    NUM_STEPS_FIELD_NUMBER: _ClassVar[int]
    SEED_FIELD_NUMBER: _ClassVar[int]
    max_gaussians: int
    megapixels_per_step: float
    num_steps: int
    seed: int
    def __init__(self, num_steps: _Optional[int] = ..., max_gaussians: _Optional[int] = ..., megapixels_per_step: _Optional[float] = ..., seed: _Optional[int] = ...) -> None: ...

class SfmOptions(_message.Message):
    __slots__ = ["features", "front", "mapper", "matching", "max_features", "max_seconds", "max_video_frames", "min_registered_share", "sequential_overlap"]
    FEATURES_FIELD_NUMBER: _ClassVar[int]
    FRONT_FIELD_NUMBER: _ClassVar[int]
    MAPPER_FIELD_NUMBER: _ClassVar[int]
    MATCHING_FIELD_NUMBER: _ClassVar[int]
    MAX_FEATURES_FIELD_NUMBER: _ClassVar[int]
    MAX_SECONDS_FIELD_NUMBER: _ClassVar[int]
    MAX_VIDEO_FRAMES_FIELD_NUMBER: _ClassVar[int]
    MIN_REGISTERED_SHARE_FIELD_NUMBER: _ClassVar[int]
    SEQUENTIAL_OVERLAP_FIELD_NUMBER: _ClassVar[int]
    features: SfmEngine
    front: SfmEngine
    mapper: SfmEngine
    matching: SfmMatching
    max_features: int
    max_seconds: int
    max_video_frames: int
    min_registered_share: float
    sequential_overlap: int
    def __init__(self, matching: _Optional[_Union[SfmMatching, str]] = ..., max_features: _Optional[int] = ..., sequential_overlap: _Optional[int] = ..., min_registered_share: _Optional[float] = ..., max_seconds: _Optional[int] = ..., max_video_frames: _Optional[int] = ..., front: _Optional[_Union[SfmEngine, str]] = ..., features: _Optional[_Union[SfmEngine, str]] = ..., mapper: _Optional[_Union[SfmEngine, str]] = ...) -> None: ...

class TrainingOptions(_message.Message):
    __slots__ = ["advanced", "features", "preset", "priors", "reconstruct", "sfm"]
    class AdvancedEntry(_message.Message):
        __slots__ = ["key", "value"]
        KEY_FIELD_NUMBER: _ClassVar[int]
        VALUE_FIELD_NUMBER: _ClassVar[int]
        key: str
        value: str
        def __init__(self, key: _Optional[str] = ..., value: _Optional[str] = ...) -> None: ...
    ADVANCED_FIELD_NUMBER: _ClassVar[int]
    FEATURES_FIELD_NUMBER: _ClassVar[int]
    IMPORT_FIELD_NUMBER: _ClassVar[int]
    PRESET_FIELD_NUMBER: _ClassVar[int]
    PRIORS_FIELD_NUMBER: _ClassVar[int]
    RECONSTRUCT_FIELD_NUMBER: _ClassVar[int]
    SFM_FIELD_NUMBER: _ClassVar[int]
    advanced: _containers.ScalarMap[str, str]
    features: FeatureOptions
    preset: TrainingPreset
    priors: PriorOptions
    reconstruct: ReconstructOptions
    sfm: SfmOptions
    def __init__(self, reconstruct: _Optional[_Union[ReconstructOptions, _Mapping]] = ..., features: _Optional[_Union[FeatureOptions, _Mapping]] = ..., sfm: _Optional[_Union[SfmOptions, _Mapping]] = ..., priors: _Optional[_Union[PriorOptions, _Mapping]] = ..., preset: _Optional[_Union[TrainingPreset, str]] = ..., advanced: _Optional[_Mapping[str, str]] = ..., **kwargs) -> None: ...

class TrainingPreset(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = []

class SfmEngine(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = []

class SfmMatching(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = []

class PriorMaker(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = []
