from google.protobuf import duration_pb2 as _duration_pb2
from google.protobuf import timestamp_pb2 as _timestamp_pb2
from pepeseg.v1 import job_service_pb2 as _job_service_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Iterable as _Iterable, Mapping as _Mapping, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class DrainServerRequest(_message.Message):
    __slots__ = []
    def __init__(self) -> None: ...

class GetServerStatusRequest(_message.Message):
    __slots__ = []
    def __init__(self) -> None: ...

class ResumeServerRequest(_message.Message):
    __slots__ = []
    def __init__(self) -> None: ...

class ServerStatus(_message.Message):
    __slots__ = ["device", "devices", "disk_free_bytes", "draining", "find_sources", "num_descriptors", "num_queued_jobs", "num_streams", "num_threads", "pools", "queries_per_second", "query_p50", "query_p99", "resident_bytes", "running_jobs", "start_time", "version"]
    class Work(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = []
    class Device(_message.Message):
        __slots__ = ["id", "job", "job_time", "model_bytes", "model_limit_bytes", "name", "num_models"]
        ID_FIELD_NUMBER: _ClassVar[int]
        JOB_FIELD_NUMBER: _ClassVar[int]
        JOB_TIME_FIELD_NUMBER: _ClassVar[int]
        MODEL_BYTES_FIELD_NUMBER: _ClassVar[int]
        MODEL_LIMIT_BYTES_FIELD_NUMBER: _ClassVar[int]
        NAME_FIELD_NUMBER: _ClassVar[int]
        NUM_MODELS_FIELD_NUMBER: _ClassVar[int]
        id: str
        job: str
        job_time: _duration_pb2.Duration
        model_bytes: int
        model_limit_bytes: int
        name: str
        num_models: int
        def __init__(self, id: _Optional[str] = ..., name: _Optional[str] = ..., job: _Optional[str] = ..., num_models: _Optional[int] = ..., model_bytes: _Optional[int] = ..., model_limit_bytes: _Optional[int] = ..., job_time: _Optional[_Union[_duration_pb2.Duration, _Mapping]] = ...) -> None: ...
    class FindSources(_message.Message):
        __slots__ = ["appearance", "num_detector_words", "synonyms", "text_command"]
        APPEARANCE_FIELD_NUMBER: _ClassVar[int]
        NUM_DETECTOR_WORDS_FIELD_NUMBER: _ClassVar[int]
        SYNONYMS_FIELD_NUMBER: _ClassVar[int]
        TEXT_COMMAND_FIELD_NUMBER: _ClassVar[int]
        appearance: bool
        num_detector_words: int
        synonyms: bool
        text_command: bool
        def __init__(self, synonyms: bool = ..., num_detector_words: _Optional[int] = ..., text_command: bool = ..., appearance: bool = ...) -> None: ...
    class Pool(_message.Message):
        __slots__ = ["max_queued", "num_busy", "num_queued", "num_threads", "work"]
        MAX_QUEUED_FIELD_NUMBER: _ClassVar[int]
        NUM_BUSY_FIELD_NUMBER: _ClassVar[int]
        NUM_QUEUED_FIELD_NUMBER: _ClassVar[int]
        NUM_THREADS_FIELD_NUMBER: _ClassVar[int]
        WORK_FIELD_NUMBER: _ClassVar[int]
        max_queued: int
        num_busy: int
        num_queued: int
        num_threads: int
        work: ServerStatus.Work
        def __init__(self, work: _Optional[_Union[ServerStatus.Work, str]] = ..., num_threads: _Optional[int] = ..., num_busy: _Optional[int] = ..., num_queued: _Optional[int] = ..., max_queued: _Optional[int] = ...) -> None: ...
    DEVICES_FIELD_NUMBER: _ClassVar[int]
    DEVICE_FIELD_NUMBER: _ClassVar[int]
    DISK_FREE_BYTES_FIELD_NUMBER: _ClassVar[int]
    DRAINING_FIELD_NUMBER: _ClassVar[int]
    FIND_SOURCES_FIELD_NUMBER: _ClassVar[int]
    NUM_DESCRIPTORS_FIELD_NUMBER: _ClassVar[int]
    NUM_QUEUED_JOBS_FIELD_NUMBER: _ClassVar[int]
    NUM_STREAMS_FIELD_NUMBER: _ClassVar[int]
    NUM_THREADS_FIELD_NUMBER: _ClassVar[int]
    POOLS_FIELD_NUMBER: _ClassVar[int]
    QUERIES_PER_SECOND_FIELD_NUMBER: _ClassVar[int]
    QUERY_P50_FIELD_NUMBER: _ClassVar[int]
    QUERY_P99_FIELD_NUMBER: _ClassVar[int]
    RESIDENT_BYTES_FIELD_NUMBER: _ClassVar[int]
    RUNNING_JOBS_FIELD_NUMBER: _ClassVar[int]
    START_TIME_FIELD_NUMBER: _ClassVar[int]
    VERSION_FIELD_NUMBER: _ClassVar[int]
    WORK_BORDER: ServerStatus.Work
    WORK_CORRECTION: ServerStatus.Work
    WORK_EVALUATION: ServerStatus.Work
    WORK_FIND: ServerStatus.Work
    WORK_IO: ServerStatus.Work
    WORK_QUERY: ServerStatus.Work
    WORK_UNSPECIFIED: ServerStatus.Work
    WORK_UPLOAD: ServerStatus.Work
    device: str
    devices: _containers.RepeatedCompositeFieldContainer[ServerStatus.Device]
    disk_free_bytes: int
    draining: bool
    find_sources: ServerStatus.FindSources
    num_descriptors: int
    num_queued_jobs: int
    num_streams: int
    num_threads: int
    pools: _containers.RepeatedCompositeFieldContainer[ServerStatus.Pool]
    queries_per_second: float
    query_p50: _duration_pb2.Duration
    query_p99: _duration_pb2.Duration
    resident_bytes: int
    running_jobs: _containers.RepeatedCompositeFieldContainer[_job_service_pb2.Job]
    start_time: _timestamp_pb2.Timestamp
    version: str
    def __init__(self, version: _Optional[str] = ..., device: _Optional[str] = ..., start_time: _Optional[_Union[_timestamp_pb2.Timestamp, _Mapping]] = ..., draining: bool = ..., resident_bytes: _Optional[int] = ..., num_descriptors: _Optional[int] = ..., num_threads: _Optional[int] = ..., pools: _Optional[_Iterable[_Union[ServerStatus.Pool, _Mapping]]] = ..., num_streams: _Optional[int] = ..., disk_free_bytes: _Optional[int] = ..., running_jobs: _Optional[_Iterable[_Union[_job_service_pb2.Job, _Mapping]]] = ..., num_queued_jobs: _Optional[int] = ..., queries_per_second: _Optional[float] = ..., query_p50: _Optional[_Union[_duration_pb2.Duration, _Mapping]] = ..., query_p99: _Optional[_Union[_duration_pb2.Duration, _Mapping]] = ..., find_sources: _Optional[_Union[ServerStatus.FindSources, _Mapping]] = ..., devices: _Optional[_Iterable[_Union[ServerStatus.Device, _Mapping]]] = ...) -> None: ...
