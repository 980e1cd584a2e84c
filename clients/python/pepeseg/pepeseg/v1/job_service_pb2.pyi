from google.protobuf import duration_pb2 as _duration_pb2
from google.protobuf import timestamp_pb2 as _timestamp_pb2
from pepeseg.v1 import access_pb2 as _access_pb2
from pepeseg.v1 import errors_pb2 as _errors_pb2
from pepeseg.v1 import scene_service_pb2 as _scene_service_pb2
from pepeseg.v1 import training_options_pb2 as _training_options_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Iterable as _Iterable, Mapping as _Mapping, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor
JOB_STAGE_EVALUATE: JobStage
JOB_STAGE_FEATURES: JobStage
JOB_STAGE_INDEX: JobStage
JOB_STAGE_PREPARE: JobStage
JOB_STAGE_PRIORS: JobStage
JOB_STAGE_RECONSTRUCT: JobStage
JOB_STAGE_SFM: JobStage
JOB_STAGE_UNSPECIFIED: JobStage
JOB_STATE_CANCELLED: JobState
JOB_STATE_FAILED: JobState
JOB_STATE_QUEUED: JobState
JOB_STATE_RUNNING: JobState
JOB_STATE_SUCCEEDED: JobState
JOB_STATE_UNSPECIFIED: JobState

class CancelJobRequest(_message.Message):
    __slots__ = ["name"]
    NAME_FIELD_NUMBER: _ClassVar[int]
    name: str
    def __init__(self, name: _Optional[str] = ...) -> None: ...

class EstimateTrainingRequest(_message.Message):
    __slots__ = ["dataset", "options", "scene"]
    DATASET_FIELD_NUMBER: _ClassVar[int]
    OPTIONS_FIELD_NUMBER: _ClassVar[int]
    SCENE_FIELD_NUMBER: _ClassVar[int]
    dataset: str
    options: _training_options_pb2.TrainingOptions
    scene: str
    def __init__(self, scene: _Optional[str] = ..., dataset: _Optional[str] = ..., options: _Optional[_Union[_training_options_pb2.TrainingOptions, _Mapping]] = ...) -> None: ...

class EstimateTrainingResponse(_message.Message):
    __slots__ = ["device", "duration", "have_bytes", "max_pixels", "need_bytes", "num_mask_files", "num_points", "num_views", "stages"]
    class Stage(_message.Message):
        __slots__ = ["device_bytes", "duration", "host_bytes", "stage"]
        DEVICE_BYTES_FIELD_NUMBER: _ClassVar[int]
        DURATION_FIELD_NUMBER: _ClassVar[int]
        HOST_BYTES_FIELD_NUMBER: _ClassVar[int]
        STAGE_FIELD_NUMBER: _ClassVar[int]
        device_bytes: int
        duration: _duration_pb2.Duration
        host_bytes: int
        stage: JobStage
        def __init__(self, stage: _Optional[_Union[JobStage, str]] = ..., device_bytes: _Optional[int] = ..., host_bytes: _Optional[int] = ..., duration: _Optional[_Union[_duration_pb2.Duration, _Mapping]] = ...) -> None: ...
    DEVICE_FIELD_NUMBER: _ClassVar[int]
    DURATION_FIELD_NUMBER: _ClassVar[int]
    HAVE_BYTES_FIELD_NUMBER: _ClassVar[int]
    MAX_PIXELS_FIELD_NUMBER: _ClassVar[int]
    NEED_BYTES_FIELD_NUMBER: _ClassVar[int]
    NUM_MASK_FILES_FIELD_NUMBER: _ClassVar[int]
    NUM_POINTS_FIELD_NUMBER: _ClassVar[int]
    NUM_VIEWS_FIELD_NUMBER: _ClassVar[int]
    STAGES_FIELD_NUMBER: _ClassVar[int]
    device: str
    duration: _duration_pb2.Duration
    have_bytes: int
    max_pixels: int
    need_bytes: int
    num_mask_files: int
    num_points: int
    num_views: int
    stages: _containers.RepeatedCompositeFieldContainer[EstimateTrainingResponse.Stage]
    def __init__(self, stages: _Optional[_Iterable[_Union[EstimateTrainingResponse.Stage, _Mapping]]] = ..., device: _Optional[str] = ..., need_bytes: _Optional[int] = ..., have_bytes: _Optional[int] = ..., num_views: _Optional[int] = ..., max_pixels: _Optional[int] = ..., num_points: _Optional[int] = ..., num_mask_files: _Optional[int] = ..., duration: _Optional[_Union[_duration_pb2.Duration, _Mapping]] = ...) -> None: ...

class GetJobRequest(_message.Message):
    __slots__ = ["name"]
    NAME_FIELD_NUMBER: _ClassVar[int]
    name: str
    def __init__(self, name: _Optional[str] = ...) -> None: ...

class Job(_message.Message):
    __slots__ = ["cancel_requested", "create_time", "dataset", "device", "effective_options", "end_time", "error", "model", "name", "progress", "scene", "stage", "start_time", "state", "wait"]
    class Wait(_message.Message):
        __slots__ = ["jobs_ahead", "reason", "retry_time"]
        class Reason(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
            __slots__ = []
        JOBS_AHEAD_FIELD_NUMBER: _ClassVar[int]
        REASON_DEVICE: Job.Wait.Reason
        REASON_FIELD_NUMBER: _ClassVar[int]
        REASON_QUOTA: Job.Wait.Reason
        REASON_RETRY: Job.Wait.Reason
        REASON_UNSPECIFIED: Job.Wait.Reason
        RETRY_TIME_FIELD_NUMBER: _ClassVar[int]
        jobs_ahead: int
        reason: Job.Wait.Reason
        retry_time: _timestamp_pb2.Timestamp
        def __init__(self, reason: _Optional[_Union[Job.Wait.Reason, str]] = ..., jobs_ahead: _Optional[int] = ..., retry_time: _Optional[_Union[_timestamp_pb2.Timestamp, _Mapping]] = ...) -> None: ...
    CANCEL_REQUESTED_FIELD_NUMBER: _ClassVar[int]
    CREATE_TIME_FIELD_NUMBER: _ClassVar[int]
    DATASET_FIELD_NUMBER: _ClassVar[int]
    DEVICE_FIELD_NUMBER: _ClassVar[int]
    EFFECTIVE_OPTIONS_FIELD_NUMBER: _ClassVar[int]
    END_TIME_FIELD_NUMBER: _ClassVar[int]
    ERROR_FIELD_NUMBER: _ClassVar[int]
    MODEL_FIELD_NUMBER: _ClassVar[int]
    NAME_FIELD_NUMBER: _ClassVar[int]
    PROGRESS_FIELD_NUMBER: _ClassVar[int]
    SCENE_FIELD_NUMBER: _ClassVar[int]
    STAGE_FIELD_NUMBER: _ClassVar[int]
    START_TIME_FIELD_NUMBER: _ClassVar[int]
    STATE_FIELD_NUMBER: _ClassVar[int]
    WAIT_FIELD_NUMBER: _ClassVar[int]
    cancel_requested: bool
    create_time: _timestamp_pb2.Timestamp
    dataset: str
    device: str
    effective_options: _training_options_pb2.TrainingOptions
    end_time: _timestamp_pb2.Timestamp
    error: _errors_pb2.Error
    model: str
    name: str
    progress: JobProgress
    scene: str
    stage: JobStage
    start_time: _timestamp_pb2.Timestamp
    state: JobState
    wait: Job.Wait
    def __init__(self, name: _Optional[str] = ..., scene: _Optional[str] = ..., dataset: _Optional[str] = ..., state: _Optional[_Union[JobState, str]] = ..., stage: _Optional[_Union[JobStage, str]] = ..., effective_options: _Optional[_Union[_training_options_pb2.TrainingOptions, _Mapping]] = ..., progress: _Optional[_Union[JobProgress, _Mapping]] = ..., error: _Optional[_Union[_errors_pb2.Error, _Mapping]] = ..., model: _Optional[str] = ..., create_time: _Optional[_Union[_timestamp_pb2.Timestamp, _Mapping]] = ..., start_time: _Optional[_Union[_timestamp_pb2.Timestamp, _Mapping]] = ..., end_time: _Optional[_Union[_timestamp_pb2.Timestamp, _Mapping]] = ..., cancel_requested: bool = ..., device: _Optional[str] = ..., wait: _Optional[_Union[Job.Wait, _Mapping]] = ...) -> None: ...

class JobEvent(_message.Message):
    __slots__ = ["heartbeat", "preview", "progress", "sequence", "snapshot", "stage_ended", "stage_started", "state_changed", "term_skipped", "time", "warning"]
    class Heartbeat(_message.Message):
        __slots__ = []
        def __init__(self) -> None: ...
    class Preview(_message.Message):
        __slots__ = ["height", "jpeg", "num_steps", "stage", "step", "view", "width"]
        HEIGHT_FIELD_NUMBER: _ClassVar[int]
        JPEG_FIELD_NUMBER: _ClassVar[int]
        NUM_STEPS_FIELD_NUMBER: _ClassVar[int]
        STAGE_FIELD_NUMBER: _ClassVar[int]
        STEP_FIELD_NUMBER: _ClassVar[int]
        VIEW_FIELD_NUMBER: _ClassVar[int]
        WIDTH_FIELD_NUMBER: _ClassVar[int]
        height: int
        jpeg: bytes
        num_steps: int
        stage: JobStage
        step: int
        view: str
        width: int
        def __init__(self, stage: _Optional[_Union[JobStage, str]] = ..., step: _Optional[int] = ..., num_steps: _Optional[int] = ..., view: _Optional[str] = ..., width: _Optional[int] = ..., height: _Optional[int] = ..., jpeg: _Optional[bytes] = ...) -> None: ...
    class StageEnded(_message.Message):
        __slots__ = ["elapsed", "metrics", "skipped", "stage", "views"]
        class MetricsEntry(_message.Message):
            __slots__ = ["key", "value"]
            KEY_FIELD_NUMBER: _ClassVar[int]
            VALUE_FIELD_NUMBER: _ClassVar[int]
            key: str
            value: float
            def __init__(self, key: _Optional[str] = ..., value: _Optional[float] = ...) -> None: ...
        ELAPSED_FIELD_NUMBER: _ClassVar[int]
        METRICS_FIELD_NUMBER: _ClassVar[int]
        SKIPPED_FIELD_NUMBER: _ClassVar[int]
        STAGE_FIELD_NUMBER: _ClassVar[int]
        VIEWS_FIELD_NUMBER: _ClassVar[int]
        elapsed: _duration_pb2.Duration
        metrics: _containers.ScalarMap[str, float]
        skipped: str
        stage: JobStage
        views: _containers.RepeatedCompositeFieldContainer[JobEvent.ViewScores]
        def __init__(self, stage: _Optional[_Union[JobStage, str]] = ..., elapsed: _Optional[_Union[_duration_pb2.Duration, _Mapping]] = ..., metrics: _Optional[_Mapping[str, float]] = ..., views: _Optional[_Iterable[_Union[JobEvent.ViewScores, _Mapping]]] = ..., skipped: _Optional[str] = ...) -> None: ...
    class StageStarted(_message.Message):
        __slots__ = ["stage"]
        STAGE_FIELD_NUMBER: _ClassVar[int]
        stage: JobStage
        def __init__(self, stage: _Optional[_Union[JobStage, str]] = ...) -> None: ...
    class StateChanged(_message.Message):
        __slots__ = ["error", "model", "state"]
        ERROR_FIELD_NUMBER: _ClassVar[int]
        MODEL_FIELD_NUMBER: _ClassVar[int]
        STATE_FIELD_NUMBER: _ClassVar[int]
        error: _errors_pb2.Error
        model: str
        state: JobState
        def __init__(self, state: _Optional[_Union[JobState, str]] = ..., error: _Optional[_Union[_errors_pb2.Error, _Mapping]] = ..., model: _Optional[str] = ...) -> None: ...
    class TermSkipped(_message.Message):
        __slots__ = ["reason", "saved", "saved_steps", "stage", "step", "term"]
        class Term(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
            __slots__ = []
        REASON_FIELD_NUMBER: _ClassVar[int]
        SAVED_FIELD_NUMBER: _ClassVar[int]
        SAVED_STEPS_FIELD_NUMBER: _ClassVar[int]
        STAGE_FIELD_NUMBER: _ClassVar[int]
        STEP_FIELD_NUMBER: _ClassVar[int]
        TERM_BACKGROUND: JobEvent.TermSkipped.Term
        TERM_BANDS: JobEvent.TermSkipped.Term
        TERM_CENTROIDS: JobEvent.TermSkipped.Term
        TERM_DEPTH: JobEvent.TermSkipped.Term
        TERM_FIELD_NUMBER: _ClassVar[int]
        TERM_PERCEPTION: JobEvent.TermSkipped.Term
        TERM_REFINEMENT: JobEvent.TermSkipped.Term
        TERM_STEPS: JobEvent.TermSkipped.Term
        TERM_UNSPECIFIED: JobEvent.TermSkipped.Term
        reason: str
        saved: _duration_pb2.Duration
        saved_steps: int
        stage: JobStage
        step: int
        term: JobEvent.TermSkipped.Term
        def __init__(self, stage: _Optional[_Union[JobStage, str]] = ..., term: _Optional[_Union[JobEvent.TermSkipped.Term, str]] = ..., reason: _Optional[str] = ..., step: _Optional[int] = ..., saved_steps: _Optional[int] = ..., saved: _Optional[_Union[_duration_pb2.Duration, _Mapping]] = ...) -> None: ...
    class ViewScores(_message.Message):
        __slots__ = ["scores", "view"]
        SCORES_FIELD_NUMBER: _ClassVar[int]
        VIEW_FIELD_NUMBER: _ClassVar[int]
        scores: _scene_service_pb2.ImageScores
        view: str
        def __init__(self, view: _Optional[str] = ..., scores: _Optional[_Union[_scene_service_pb2.ImageScores, _Mapping]] = ...) -> None: ...
    class Warning(_message.Message):
        __slots__ = ["message"]
        MESSAGE_FIELD_NUMBER: _ClassVar[int]
        message: str
        def __init__(self, message: _Optional[str] = ...) -> None: ...
    HEARTBEAT_FIELD_NUMBER: _ClassVar[int]
    PREVIEW_FIELD_NUMBER: _ClassVar[int]
    PROGRESS_FIELD_NUMBER: _ClassVar[int]
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    SNAPSHOT_FIELD_NUMBER: _ClassVar[int]
    STAGE_ENDED_FIELD_NUMBER: _ClassVar[int]
    STAGE_STARTED_FIELD_NUMBER: _ClassVar[int]
    STATE_CHANGED_FIELD_NUMBER: _ClassVar[int]
    TERM_SKIPPED_FIELD_NUMBER: _ClassVar[int]
    TIME_FIELD_NUMBER: _ClassVar[int]
    WARNING_FIELD_NUMBER: _ClassVar[int]
    heartbeat: JobEvent.Heartbeat
    preview: JobEvent.Preview
    progress: JobProgress
    sequence: int
    snapshot: Job
    stage_ended: JobEvent.StageEnded
    stage_started: JobEvent.StageStarted
    state_changed: JobEvent.StateChanged
    term_skipped: JobEvent.TermSkipped
    time: _timestamp_pb2.Timestamp
    warning: JobEvent.Warning
    def __init__(self, sequence: _Optional[int] = ..., time: _Optional[_Union[_timestamp_pb2.Timestamp, _Mapping]] = ..., snapshot: _Optional[_Union[Job, _Mapping]] = ..., stage_started: _Optional[_Union[JobEvent.StageStarted, _Mapping]] = ..., progress: _Optional[_Union[JobProgress, _Mapping]] = ..., warning: _Optional[_Union[JobEvent.Warning, _Mapping]] = ..., state_changed: _Optional[_Union[JobEvent.StateChanged, _Mapping]] = ..., heartbeat: _Optional[_Union[JobEvent.Heartbeat, _Mapping]] = ..., stage_ended: _Optional[_Union[JobEvent.StageEnded, _Mapping]] = ..., term_skipped: _Optional[_Union[JobEvent.TermSkipped, _Mapping]] = ..., preview: _Optional[_Union[JobEvent.Preview, _Mapping]] = ...) -> None: ...

class JobProgress(_message.Message):
    __slots__ = ["activity", "diagnostics", "elapsed", "eta", "job_eta", "loss", "memory_bytes", "num_gaussians", "num_stages", "num_steps", "psnr", "stage", "stage_number", "step", "steps_per_second", "unit"]
    class Diagnostics(_message.Message):
        __slots__ = ["depth_loss", "num_culled_degenerate", "num_overflowed_renders", "num_refine_split", "num_refined", "num_skipped_depths", "num_skipped_gradients"]
        DEPTH_LOSS_FIELD_NUMBER: _ClassVar[int]
        NUM_CULLED_DEGENERATE_FIELD_NUMBER: _ClassVar[int]
        NUM_OVERFLOWED_RENDERS_FIELD_NUMBER: _ClassVar[int]
        NUM_REFINED_FIELD_NUMBER: _ClassVar[int]
        NUM_REFINE_SPLIT_FIELD_NUMBER: _ClassVar[int]
        NUM_SKIPPED_DEPTHS_FIELD_NUMBER: _ClassVar[int]
        NUM_SKIPPED_GRADIENTS_FIELD_NUMBER: _ClassVar[int]
        depth_loss: float
        num_culled_degenerate: int
        num_overflowed_renders: int
        num_refine_split: int
        num_refined: int
        num_skipped_depths: int
        num_skipped_gradients: int
        def __init__(self, num_culled_degenerate: _Optional[int] = ..., num_skipped_gradients: _Optional[int] = ..., num_overflowed_renders: _Optional[int] = ..., num_refined: _Optional[int] = ..., num_refine_split: _Optional[int] = ..., depth_loss: _Optional[float] = ..., num_skipped_depths: _Optional[int] = ...) -> None: ...
    ACTIVITY_FIELD_NUMBER: _ClassVar[int]
    DIAGNOSTICS_FIELD_NUMBER: _ClassVar[int]
    ELAPSED_FIELD_NUMBER: _ClassVar[int]
    ETA_FIELD_NUMBER: _ClassVar[int]
    JOB_ETA_FIELD_NUMBER: _ClassVar[int]
    LOSS_FIELD_NUMBER: _ClassVar[int]
    MEMORY_BYTES_FIELD_NUMBER: _ClassVar[int]
    NUM_GAUSSIANS_FIELD_NUMBER: _ClassVar[int]
    NUM_STAGES_FIELD_NUMBER: _ClassVar[int]
    NUM_STEPS_FIELD_NUMBER: _ClassVar[int]
    PSNR_FIELD_NUMBER: _ClassVar[int]
    STAGE_FIELD_NUMBER: _ClassVar[int]
    STAGE_NUMBER_FIELD_NUMBER: _ClassVar[int]
    STEPS_PER_SECOND_FIELD_NUMBER: _ClassVar[int]
    STEP_FIELD_NUMBER: _ClassVar[int]
    UNIT_FIELD_NUMBER: _ClassVar[int]
    activity: str
    diagnostics: JobProgress.Diagnostics
    elapsed: _duration_pb2.Duration
    eta: _duration_pb2.Duration
    job_eta: _duration_pb2.Duration
    loss: float
    memory_bytes: int
    num_gaussians: int
    num_stages: int
    num_steps: int
    psnr: float
    stage: JobStage
    stage_number: int
    step: int
    steps_per_second: float
    unit: str
    def __init__(self, stage: _Optional[_Union[JobStage, str]] = ..., step: _Optional[int] = ..., num_steps: _Optional[int] = ..., loss: _Optional[float] = ..., psnr: _Optional[float] = ..., num_gaussians: _Optional[int] = ..., elapsed: _Optional[_Union[_duration_pb2.Duration, _Mapping]] = ..., eta: _Optional[_Union[_duration_pb2.Duration, _Mapping]] = ..., steps_per_second: _Optional[float] = ..., memory_bytes: _Optional[int] = ..., activity: _Optional[str] = ..., unit: _Optional[str] = ..., job_eta: _Optional[_Union[_duration_pb2.Duration, _Mapping]] = ..., stage_number: _Optional[int] = ..., num_stages: _Optional[int] = ..., diagnostics: _Optional[_Union[JobProgress.Diagnostics, _Mapping]] = ...) -> None: ...

class ListJobsRequest(_message.Message):
    __slots__ = ["page_size", "page_token", "scene", "state"]
    PAGE_SIZE_FIELD_NUMBER: _ClassVar[int]
    PAGE_TOKEN_FIELD_NUMBER: _ClassVar[int]
    SCENE_FIELD_NUMBER: _ClassVar[int]
    STATE_FIELD_NUMBER: _ClassVar[int]
    page_size: int
    page_token: str
    scene: str
    state: JobState
    def __init__(self, scene: _Optional[str] = ..., state: _Optional[_Union[JobState, str]] = ..., page_size: _Optional[int] = ..., page_token: _Optional[str] = ...) -> None: ...

class ListJobsResponse(_message.Message):
    __slots__ = ["jobs", "next_page_token"]
    JOBS_FIELD_NUMBER: _ClassVar[int]
    NEXT_PAGE_TOKEN_FIELD_NUMBER: _ClassVar[int]
    jobs: _containers.RepeatedCompositeFieldContainer[Job]
    next_page_token: str
    def __init__(self, jobs: _Optional[_Iterable[_Union[Job, _Mapping]]] = ..., next_page_token: _Optional[str] = ...) -> None: ...

class ListTrainingOptionsRequest(_message.Message):
    __slots__ = ["preset"]
    PRESET_FIELD_NUMBER: _ClassVar[int]
    preset: _training_options_pb2.TrainingPreset
    def __init__(self, preset: _Optional[_Union[_training_options_pb2.TrainingPreset, str]] = ...) -> None: ...

class ListTrainingOptionsResponse(_message.Message):
    __slots__ = ["options"]
    OPTIONS_FIELD_NUMBER: _ClassVar[int]
    options: _containers.RepeatedCompositeFieldContainer[TrainingOption]
    def __init__(self, options: _Optional[_Iterable[_Union[TrainingOption, _Mapping]]] = ...) -> None: ...

class TrainSceneRequest(_message.Message):
    __slots__ = ["dataset", "options", "request_id", "scene", "validate_only"]
    DATASET_FIELD_NUMBER: _ClassVar[int]
    OPTIONS_FIELD_NUMBER: _ClassVar[int]
    REQUEST_ID_FIELD_NUMBER: _ClassVar[int]
    SCENE_FIELD_NUMBER: _ClassVar[int]
    VALIDATE_ONLY_FIELD_NUMBER: _ClassVar[int]
    dataset: str
    options: _training_options_pb2.TrainingOptions
    request_id: str
    scene: str
    validate_only: bool
    def __init__(self, scene: _Optional[str] = ..., dataset: _Optional[str] = ..., options: _Optional[_Union[_training_options_pb2.TrainingOptions, _Mapping]] = ..., request_id: _Optional[str] = ..., validate_only: bool = ...) -> None: ...

class TrainingOption(_message.Message):
    __slots__ = ["default_value", "description", "name", "range"]
    DEFAULT_VALUE_FIELD_NUMBER: _ClassVar[int]
    DESCRIPTION_FIELD_NUMBER: _ClassVar[int]
    NAME_FIELD_NUMBER: _ClassVar[int]
    RANGE_FIELD_NUMBER: _ClassVar[int]
    default_value: str
    description: str
    name: str
    range: str
    def __init__(self, name: _Optional[str] = ..., default_value: _Optional[str] = ..., range: _Optional[str] = ..., description: _Optional[str] = ...) -> None: ...

class WatchJobRequest(_message.Message):
    __slots__ = ["after_sequence", "name"]
    AFTER_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    NAME_FIELD_NUMBER: _ClassVar[int]
    after_sequence: int
    name: str
    def __init__(self, name: _Optional[str] = ..., after_sequence: _Optional[int] = ...) -> None: ...

class JobState(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = []

class JobStage(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = []
