from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Mapping as _Mapping, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class GetProjectUsageRequest(_message.Message):
    __slots__ = ["project"]
    PROJECT_FIELD_NUMBER: _ClassVar[int]
    project: str
    def __init__(self, project: _Optional[str] = ...) -> None: ...

class ProjectUsage(_message.Message):
    __slots__ = ["project", "quota", "used"]
    PROJECT_FIELD_NUMBER: _ClassVar[int]
    QUOTA_FIELD_NUMBER: _ClassVar[int]
    USED_FIELD_NUMBER: _ClassVar[int]
    project: str
    quota: Quota
    used: Quota
    def __init__(self, project: _Optional[str] = ..., quota: _Optional[_Union[Quota, _Mapping]] = ..., used: _Optional[_Union[Quota, _Mapping]] = ...) -> None: ...

class Quota(_message.Message):
    __slots__ = ["open_uploads", "queries_per_second", "queued_jobs", "resident_bytes", "running_jobs", "stored_bytes"]
    OPEN_UPLOADS_FIELD_NUMBER: _ClassVar[int]
    QUERIES_PER_SECOND_FIELD_NUMBER: _ClassVar[int]
    QUEUED_JOBS_FIELD_NUMBER: _ClassVar[int]
    RESIDENT_BYTES_FIELD_NUMBER: _ClassVar[int]
    RUNNING_JOBS_FIELD_NUMBER: _ClassVar[int]
    STORED_BYTES_FIELD_NUMBER: _ClassVar[int]
    open_uploads: int
    queries_per_second: int
    queued_jobs: int
    resident_bytes: int
    running_jobs: int
    stored_bytes: int
    def __init__(self, stored_bytes: _Optional[int] = ..., open_uploads: _Optional[int] = ..., queued_jobs: _Optional[int] = ..., running_jobs: _Optional[int] = ..., queries_per_second: _Optional[int] = ..., resident_bytes: _Optional[int] = ...) -> None: ...

class UpdateQuotaRequest(_message.Message):
    __slots__ = ["project", "quota"]
    PROJECT_FIELD_NUMBER: _ClassVar[int]
    QUOTA_FIELD_NUMBER: _ClassVar[int]
    project: str
    quota: Quota
    def __init__(self, project: _Optional[str] = ..., quota: _Optional[_Union[Quota, _Mapping]] = ...) -> None: ...
