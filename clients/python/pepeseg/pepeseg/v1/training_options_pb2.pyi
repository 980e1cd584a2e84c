from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Iterable as _Iterable, Mapping as _Mapping, Optional as _Optional, Union as _Union

CAPTURE_KIND_FORWARD_FACING: CaptureKind
CAPTURE_KIND_ORBIT: CaptureKind
CAPTURE_KIND_UNSPECIFIED: CaptureKind
DEPTH_LOCAL_FORM_PATCH: DepthLocalForm
DEPTH_LOCAL_FORM_UNSPECIFIED: DepthLocalForm
DEPTH_LOCAL_FORM_WINDOWS: DepthLocalForm
DESCRIPTOR: _descriptor.FileDescriptor
PERCEPTION_THRESHOLD_DIFFERENCES: PerceptionThreshold
PERCEPTION_THRESHOLD_GRADIENTS: PerceptionThreshold
PERCEPTION_THRESHOLD_UNSPECIFIED: PerceptionThreshold
PERCEPTION_THRESHOLD_WINDOWS: PerceptionThreshold
PRIOR_MAKER_COMMAND: PriorMaker
PRIOR_MAKER_EMBEDDED: PriorMaker
PRIOR_MAKER_NONE: PriorMaker
PRIOR_MAKER_SAM: PriorMaker
PRIOR_MAKER_SAM_AND_EMBEDDED: PriorMaker
PRIOR_MAKER_UNSPECIFIED: PriorMaker
REFINE_KEEP_NONE: RefineKeep
REFINE_KEEP_SHRINK: RefineKeep
REFINE_KEEP_SPLIT: RefineKeep
REFINE_KEEP_UNSPECIFIED: RefineKeep
SCALE_MAPPING_EVEN: ScaleMapping
SCALE_MAPPING_MIN_MAX: ScaleMapping
SCALE_MAPPING_QUANTILES: ScaleMapping
SCALE_MAPPING_UNSPECIFIED: ScaleMapping
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
    __slots__ = ["centroid_check_masks", "centroid_cosine_lower", "centroid_cosine_upper", "centroid_every", "centroid_from", "centroid_masked_only", "centroid_merge_lower", "centroid_merge_upper", "centroid_pixels", "centroid_views", "centroid_weight_lower", "centroid_weight_upper", "closing_share", "complete_masks", "fine_first", "gate_layers", "joint_pair_mean", "learning_rate", "learning_rate_final", "mask_share", "max_negative_cosine", "min_loss_fall", "min_mask_agreement", "min_norm_alpha", "min_positive_cosine", "negative_margin", "num_background_pixels", "num_drawn_neighbors", "num_neighbors", "num_perception_pixels", "num_pixels", "num_scales", "num_steps", "perception_color_floor", "perception_cross_view", "perception_depth_floor", "perception_fit_window", "perception_threshold", "perception_unlabelled_only", "perception_weight", "scale_mapping", "seed", "share_scales", "smooth_until", "steps_per_chunk", "sure_views"]
    CENTROID_CHECK_MASKS_FIELD_NUMBER: _ClassVar[int]
    CENTROID_COSINE_LOWER_FIELD_NUMBER: _ClassVar[int]
    CENTROID_COSINE_UPPER_FIELD_NUMBER: _ClassVar[int]
    CENTROID_EVERY_FIELD_NUMBER: _ClassVar[int]
    CENTROID_FROM_FIELD_NUMBER: _ClassVar[int]
    CENTROID_MASKED_ONLY_FIELD_NUMBER: _ClassVar[int]
    CENTROID_MERGE_LOWER_FIELD_NUMBER: _ClassVar[int]
    CENTROID_MERGE_UPPER_FIELD_NUMBER: _ClassVar[int]
    CENTROID_PIXELS_FIELD_NUMBER: _ClassVar[int]
    CENTROID_VIEWS_FIELD_NUMBER: _ClassVar[int]
    CENTROID_WEIGHT_LOWER_FIELD_NUMBER: _ClassVar[int]
    CENTROID_WEIGHT_UPPER_FIELD_NUMBER: _ClassVar[int]
    CLOSING_SHARE_FIELD_NUMBER: _ClassVar[int]
    COMPLETE_MASKS_FIELD_NUMBER: _ClassVar[int]
    FINE_FIRST_FIELD_NUMBER: _ClassVar[int]
    GATE_LAYERS_FIELD_NUMBER: _ClassVar[int]
    JOINT_PAIR_MEAN_FIELD_NUMBER: _ClassVar[int]
    LEARNING_RATE_FIELD_NUMBER: _ClassVar[int]
    LEARNING_RATE_FINAL_FIELD_NUMBER: _ClassVar[int]
    MASK_SHARE_FIELD_NUMBER: _ClassVar[int]
    MAX_NEGATIVE_COSINE_FIELD_NUMBER: _ClassVar[int]
    MIN_LOSS_FALL_FIELD_NUMBER: _ClassVar[int]
    MIN_MASK_AGREEMENT_FIELD_NUMBER: _ClassVar[int]
    MIN_NORM_ALPHA_FIELD_NUMBER: _ClassVar[int]
    MIN_POSITIVE_COSINE_FIELD_NUMBER: _ClassVar[int]
    NEGATIVE_MARGIN_FIELD_NUMBER: _ClassVar[int]
    NUM_BACKGROUND_PIXELS_FIELD_NUMBER: _ClassVar[int]
    NUM_DRAWN_NEIGHBORS_FIELD_NUMBER: _ClassVar[int]
    NUM_NEIGHBORS_FIELD_NUMBER: _ClassVar[int]
    NUM_PERCEPTION_PIXELS_FIELD_NUMBER: _ClassVar[int]
    NUM_PIXELS_FIELD_NUMBER: _ClassVar[int]
    NUM_SCALES_FIELD_NUMBER: _ClassVar[int]
    NUM_STEPS_FIELD_NUMBER: _ClassVar[int]
    PERCEPTION_COLOR_FLOOR_FIELD_NUMBER: _ClassVar[int]
    PERCEPTION_CROSS_VIEW_FIELD_NUMBER: _ClassVar[int]
    PERCEPTION_DEPTH_FLOOR_FIELD_NUMBER: _ClassVar[int]
    PERCEPTION_FIT_WINDOW_FIELD_NUMBER: _ClassVar[int]
    PERCEPTION_THRESHOLD_FIELD_NUMBER: _ClassVar[int]
    PERCEPTION_UNLABELLED_ONLY_FIELD_NUMBER: _ClassVar[int]
    PERCEPTION_WEIGHT_FIELD_NUMBER: _ClassVar[int]
    SCALE_MAPPING_FIELD_NUMBER: _ClassVar[int]
    SEED_FIELD_NUMBER: _ClassVar[int]
    SHARE_SCALES_FIELD_NUMBER: _ClassVar[int]
    SMOOTH_UNTIL_FIELD_NUMBER: _ClassVar[int]
    STEPS_PER_CHUNK_FIELD_NUMBER: _ClassVar[int]
    SURE_VIEWS_FIELD_NUMBER: _ClassVar[int]
    centroid_check_masks: bool
    centroid_cosine_lower: float
    centroid_cosine_upper: float
    centroid_every: int
    centroid_from: float
    centroid_masked_only: bool
    centroid_merge_lower: float
    centroid_merge_upper: float
    centroid_pixels: int
    centroid_views: int
    centroid_weight_lower: float
    centroid_weight_upper: float
    closing_share: float
    complete_masks: bool
    fine_first: float
    gate_layers: int
    joint_pair_mean: bool
    learning_rate: float
    learning_rate_final: float
    mask_share: float
    max_negative_cosine: float
    min_loss_fall: float
    min_mask_agreement: float
    min_norm_alpha: float
    min_positive_cosine: float
    negative_margin: float
    num_background_pixels: int
    num_drawn_neighbors: int
    num_neighbors: int
    num_perception_pixels: int
    num_pixels: int
    num_scales: int
    num_steps: int
    perception_color_floor: float
    perception_cross_view: bool
    perception_depth_floor: float
    perception_fit_window: bool
    perception_threshold: PerceptionThreshold
    perception_unlabelled_only: bool
    perception_weight: float
    scale_mapping: ScaleMapping
    seed: int
    share_scales: bool
    smooth_until: float
    steps_per_chunk: int
    sure_views: int
    def __init__(self, num_steps: _Optional[int] = ..., num_pixels: _Optional[int] = ..., num_scales: _Optional[int] = ..., learning_rate: _Optional[float] = ..., steps_per_chunk: _Optional[int] = ..., seed: _Optional[int] = ..., num_neighbors: _Optional[int] = ..., num_drawn_neighbors: _Optional[int] = ..., learning_rate_final: _Optional[float] = ..., centroid_from: _Optional[float] = ..., centroid_every: _Optional[int] = ..., centroid_pixels: _Optional[int] = ..., centroid_weight_upper: _Optional[float] = ..., centroid_weight_lower: _Optional[float] = ..., num_background_pixels: _Optional[int] = ..., perception_weight: _Optional[float] = ..., num_perception_pixels: _Optional[int] = ..., perception_threshold: _Optional[_Union[PerceptionThreshold, str]] = ..., perception_cross_view: bool = ..., scale_mapping: _Optional[_Union[ScaleMapping, str]] = ..., min_loss_fall: _Optional[float] = ..., closing_share: _Optional[float] = ..., mask_share: _Optional[float] = ..., sure_views: _Optional[int] = ..., min_mask_agreement: _Optional[float] = ..., complete_masks: bool = ..., fine_first: _Optional[float] = ..., gate_layers: _Optional[int] = ..., centroid_cosine_upper: _Optional[float] = ..., centroid_cosine_lower: _Optional[float] = ..., centroid_check_masks: bool = ..., perception_fit_window: bool = ..., perception_unlabelled_only: bool = ..., perception_depth_floor: _Optional[float] = ..., perception_color_floor: _Optional[float] = ..., share_scales: bool = ..., negative_margin: _Optional[float] = ..., min_positive_cosine: _Optional[float] = ..., smooth_until: _Optional[float] = ..., max_negative_cosine: _Optional[float] = ..., joint_pair_mean: bool = ..., min_norm_alpha: _Optional[float] = ..., centroid_views: _Optional[int] = ..., centroid_masked_only: bool = ..., centroid_merge_upper: _Optional[float] = ..., centroid_merge_lower: _Optional[float] = ...) -> None: ...

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
    __slots__ = ["blurred_share", "camera_clearance", "capture_kind", "closing_share", "coarse_until", "densify_every", "densify_from", "densify_gradient", "densify_size", "densify_until", "depth_local_form", "depth_local_weight", "depth_over_alpha", "depth_weight", "depth_weight_final", "depth_window", "disparity_as_inverse_depth", "dropout", "dropout_until", "log_scale_learning_rate", "max_gaussians", "max_megapixels", "mean_learning_rate", "mean_learning_rate_cap", "mean_learning_rate_final", "mean_rate_pixels", "min_band_gain", "min_depth_agreement", "min_loss_fall", "num_random_points", "num_steps", "opacity_decay", "opacity_learning_rate", "opacity_reset_every", "pixels_per_gaussian", "prune_opacity", "prune_size", "rates_fall_from", "refine_candidates", "refine_from", "refine_keep", "refine_length", "rotation_learning_rate", "seed", "sh_degree", "sh_learning_rate", "ssim_weight", "views_at_once"]
    BLURRED_SHARE_FIELD_NUMBER: _ClassVar[int]
    CAMERA_CLEARANCE_FIELD_NUMBER: _ClassVar[int]
    CAPTURE_KIND_FIELD_NUMBER: _ClassVar[int]
    CLOSING_SHARE_FIELD_NUMBER: _ClassVar[int]
    COARSE_UNTIL_FIELD_NUMBER: _ClassVar[int]
    DENSIFY_EVERY_FIELD_NUMBER: _ClassVar[int]
    DENSIFY_FROM_FIELD_NUMBER: _ClassVar[int]
    DENSIFY_GRADIENT_FIELD_NUMBER: _ClassVar[int]
    DENSIFY_SIZE_FIELD_NUMBER: _ClassVar[int]
    DENSIFY_UNTIL_FIELD_NUMBER: _ClassVar[int]
    DEPTH_LOCAL_FORM_FIELD_NUMBER: _ClassVar[int]
    DEPTH_LOCAL_WEIGHT_FIELD_NUMBER: _ClassVar[int]
    DEPTH_OVER_ALPHA_FIELD_NUMBER: _ClassVar[int]
    DEPTH_WEIGHT_FIELD_NUMBER: _ClassVar[int]
    DEPTH_WEIGHT_FINAL_FIELD_NUMBER: _ClassVar[int]
    DEPTH_WINDOW_FIELD_NUMBER: _ClassVar[int]
    DISPARITY_AS_INVERSE_DEPTH_FIELD_NUMBER: _ClassVar[int]
    DROPOUT_FIELD_NUMBER: _ClassVar[int]
    DROPOUT_UNTIL_FIELD_NUMBER: _ClassVar[int]
    LOG_SCALE_LEARNING_RATE_FIELD_NUMBER: _ClassVar[int]
    MAX_GAUSSIANS_FIELD_NUMBER: _ClassVar[int]
    MAX_MEGAPIXELS_FIELD_NUMBER: _ClassVar[int]
    MEAN_LEARNING_RATE_CAP_FIELD_NUMBER: _ClassVar[int]
    MEAN_LEARNING_RATE_FIELD_NUMBER: _ClassVar[int]
    MEAN_LEARNING_RATE_FINAL_FIELD_NUMBER: _ClassVar[int]
    MEAN_RATE_PIXELS_FIELD_NUMBER: _ClassVar[int]
    MIN_BAND_GAIN_FIELD_NUMBER: _ClassVar[int]
    MIN_DEPTH_AGREEMENT_FIELD_NUMBER: _ClassVar[int]
    MIN_LOSS_FALL_FIELD_NUMBER: _ClassVar[int]
    NUM_RANDOM_POINTS_FIELD_NUMBER: _ClassVar[int]
    NUM_STEPS_FIELD_NUMBER: _ClassVar[int]
    OPACITY_DECAY_FIELD_NUMBER: _ClassVar[int]
    OPACITY_LEARNING_RATE_FIELD_NUMBER: _ClassVar[int]
    OPACITY_RESET_EVERY_FIELD_NUMBER: _ClassVar[int]
    PIXELS_PER_GAUSSIAN_FIELD_NUMBER: _ClassVar[int]
    PRUNE_OPACITY_FIELD_NUMBER: _ClassVar[int]
    PRUNE_SIZE_FIELD_NUMBER: _ClassVar[int]
    RATES_FALL_FROM_FIELD_NUMBER: _ClassVar[int]
    REFINE_CANDIDATES_FIELD_NUMBER: _ClassVar[int]
    REFINE_FROM_FIELD_NUMBER: _ClassVar[int]
    REFINE_KEEP_FIELD_NUMBER: _ClassVar[int]
    REFINE_LENGTH_FIELD_NUMBER: _ClassVar[int]
    ROTATION_LEARNING_RATE_FIELD_NUMBER: _ClassVar[int]
    SEED_FIELD_NUMBER: _ClassVar[int]
    SH_DEGREE_FIELD_NUMBER: _ClassVar[int]
    SH_LEARNING_RATE_FIELD_NUMBER: _ClassVar[int]
    SSIM_WEIGHT_FIELD_NUMBER: _ClassVar[int]
    VIEWS_AT_ONCE_FIELD_NUMBER: _ClassVar[int]
    blurred_share: float
    camera_clearance: float
    capture_kind: CaptureKind
    closing_share: float
    coarse_until: float
    densify_every: int
    densify_from: float
    densify_gradient: float
    densify_size: float
    densify_until: float
    depth_local_form: DepthLocalForm
    depth_local_weight: float
    depth_over_alpha: bool
    depth_weight: float
    depth_weight_final: float
    depth_window: float
    disparity_as_inverse_depth: bool
    dropout: float
    dropout_until: float
    log_scale_learning_rate: float
    max_gaussians: int
    max_megapixels: float
    mean_learning_rate: float
    mean_learning_rate_cap: float
    mean_learning_rate_final: float
    mean_rate_pixels: float
    min_band_gain: float
    min_depth_agreement: float
    min_loss_fall: float
    num_random_points: int
    num_steps: int
    opacity_decay: float
    opacity_learning_rate: float
    opacity_reset_every: int
    pixels_per_gaussian: float
    prune_opacity: float
    prune_size: float
    rates_fall_from: float
    refine_candidates: float
    refine_from: float
    refine_keep: RefineKeep
    refine_length: float
    rotation_learning_rate: float
    seed: int
    sh_degree: int
    sh_learning_rate: float
    ssim_weight: float
    views_at_once: int
    def __init__(self, num_steps: _Optional[int] = ..., sh_degree: _Optional[int] = ..., ssim_weight: _Optional[float] = ..., mean_learning_rate: _Optional[float] = ..., mean_learning_rate_final: _Optional[float] = ..., log_scale_learning_rate: _Optional[float] = ..., rotation_learning_rate: _Optional[float] = ..., opacity_learning_rate: _Optional[float] = ..., sh_learning_rate: _Optional[float] = ..., densify_from: _Optional[float] = ..., densify_until: _Optional[float] = ..., densify_every: _Optional[int] = ..., densify_gradient: _Optional[float] = ..., densify_size: _Optional[float] = ..., prune_opacity: _Optional[float] = ..., opacity_reset_every: _Optional[int] = ..., max_gaussians: _Optional[int] = ..., num_random_points: _Optional[int] = ..., seed: _Optional[int] = ..., coarse_until: _Optional[float] = ..., max_megapixels: _Optional[float] = ..., pixels_per_gaussian: _Optional[float] = ..., opacity_decay: _Optional[float] = ..., depth_weight: _Optional[float] = ..., depth_weight_final: _Optional[float] = ..., depth_local_weight: _Optional[float] = ..., depth_local_form: _Optional[_Union[DepthLocalForm, str]] = ..., depth_window: _Optional[float] = ..., capture_kind: _Optional[_Union[CaptureKind, str]] = ..., refine_keep: _Optional[_Union[RefineKeep, str]] = ..., refine_from: _Optional[float] = ..., refine_length: _Optional[float] = ..., refine_candidates: _Optional[float] = ..., min_loss_fall: _Optional[float] = ..., closing_share: _Optional[float] = ..., min_band_gain: _Optional[float] = ..., min_depth_agreement: _Optional[float] = ..., mean_learning_rate_cap: _Optional[float] = ..., prune_size: _Optional[float] = ..., disparity_as_inverse_depth: bool = ..., mean_rate_pixels: _Optional[float] = ..., rates_fall_from: _Optional[float] = ..., camera_clearance: _Optional[float] = ..., dropout: _Optional[float] = ..., dropout_until: _Optional[float] = ..., blurred_share: _Optional[float] = ..., views_at_once: _Optional[int] = ..., depth_over_alpha: bool = ...) -> None: ...

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
    __slots__ = ["features", "preset", "priors", "reconstruct", "sfm"]
    FEATURES_FIELD_NUMBER: _ClassVar[int]
    IMPORT_FIELD_NUMBER: _ClassVar[int]
    PRESET_FIELD_NUMBER: _ClassVar[int]
    PRIORS_FIELD_NUMBER: _ClassVar[int]
    RECONSTRUCT_FIELD_NUMBER: _ClassVar[int]
    SFM_FIELD_NUMBER: _ClassVar[int]
    features: FeatureOptions
    preset: TrainingPreset
    priors: PriorOptions
    reconstruct: ReconstructOptions
    sfm: SfmOptions
    def __init__(self, reconstruct: _Optional[_Union[ReconstructOptions, _Mapping]] = ..., features: _Optional[_Union[FeatureOptions, _Mapping]] = ..., sfm: _Optional[_Union[SfmOptions, _Mapping]] = ..., priors: _Optional[_Union[PriorOptions, _Mapping]] = ..., preset: _Optional[_Union[TrainingPreset, str]] = ..., **kwargs) -> None: ...

class TrainingPreset(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = []

class SfmEngine(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = []

class SfmMatching(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = []

class PriorMaker(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = []

class DepthLocalForm(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = []

class CaptureKind(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = []

class RefineKeep(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = []

class ScaleMapping(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = []

class PerceptionThreshold(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = []
