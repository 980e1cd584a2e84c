from pepeseg.v1 import job_service_pb2 as _job_service_pb2
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class Snapshot(_message.Message):
    __slots__ = ["job", "num_steps", "stage", "step"]
    JOB_FIELD_NUMBER: _ClassVar[int]
    NUM_STEPS_FIELD_NUMBER: _ClassVar[int]
    STAGE_FIELD_NUMBER: _ClassVar[int]
    STEP_FIELD_NUMBER: _ClassVar[int]
    job: str
    num_steps: int
    stage: _job_service_pb2.JobStage
    step: int
    def __init__(self, job: _Optional[str] = ..., stage: _Optional[_Union[_job_service_pb2.JobStage, str]] = ..., step: _Optional[int] = ..., num_steps: _Optional[int] = ...) -> None: ...
