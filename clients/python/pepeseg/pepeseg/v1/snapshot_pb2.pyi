from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Optional as _Optional

DESCRIPTOR: _descriptor.FileDescriptor

class Snapshot(_message.Message):
    __slots__ = ["job", "num_steps", "step"]
    JOB_FIELD_NUMBER: _ClassVar[int]
    NUM_STEPS_FIELD_NUMBER: _ClassVar[int]
    STEP_FIELD_NUMBER: _ClassVar[int]
    job: str
    num_steps: int
    step: int
    def __init__(self, job: _Optional[str] = ..., step: _Optional[int] = ..., num_steps: _Optional[int] = ...) -> None: ...
