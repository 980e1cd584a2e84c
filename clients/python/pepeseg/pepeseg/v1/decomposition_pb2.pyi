from pepeseg.v1 import geometry_pb2 as _geometry_pb2
from pepeseg.v1 import snapshot_pb2 as _snapshot_pb2
from pepeseg.v1 import timing_pb2 as _timing_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Iterable as _Iterable, Mapping as _Mapping, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class DecomposeModelRequest(_message.Message):
    __slots__ = ["model", "scales"]
    MODEL_FIELD_NUMBER: _ClassVar[int]
    SCALES_FIELD_NUMBER: _ClassVar[int]
    model: str
    scales: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, model: _Optional[str] = ..., scales: _Optional[_Iterable[float]] = ...) -> None: ...

class DecomposeModelResponse(_message.Message):
    __slots__ = ["levels", "model", "snapshot", "timing"]
    class Level(_message.Message):
        __slots__ = ["num_unassigned", "scale_quantile", "scale_units", "segments"]
        NUM_UNASSIGNED_FIELD_NUMBER: _ClassVar[int]
        SCALE_QUANTILE_FIELD_NUMBER: _ClassVar[int]
        SCALE_UNITS_FIELD_NUMBER: _ClassVar[int]
        SEGMENTS_FIELD_NUMBER: _ClassVar[int]
        num_unassigned: int
        scale_quantile: float
        scale_units: float
        segments: _containers.RepeatedCompositeFieldContainer[DecomposeModelResponse.Segment]
        def __init__(self, scale_quantile: _Optional[float] = ..., scale_units: _Optional[float] = ..., segments: _Optional[_Iterable[_Union[DecomposeModelResponse.Segment, _Mapping]]] = ..., num_unassigned: _Optional[int] = ...) -> None: ...
    class Segment(_message.Message):
        __slots__ = ["box", "id", "num_gaussians", "parent"]
        BOX_FIELD_NUMBER: _ClassVar[int]
        ID_FIELD_NUMBER: _ClassVar[int]
        NUM_GAUSSIANS_FIELD_NUMBER: _ClassVar[int]
        PARENT_FIELD_NUMBER: _ClassVar[int]
        box: _geometry_pb2.BoundingBox
        id: int
        num_gaussians: int
        parent: int
        def __init__(self, id: _Optional[int] = ..., parent: _Optional[int] = ..., num_gaussians: _Optional[int] = ..., box: _Optional[_Union[_geometry_pb2.BoundingBox, _Mapping]] = ...) -> None: ...
    LEVELS_FIELD_NUMBER: _ClassVar[int]
    MODEL_FIELD_NUMBER: _ClassVar[int]
    SNAPSHOT_FIELD_NUMBER: _ClassVar[int]
    TIMING_FIELD_NUMBER: _ClassVar[int]
    levels: _containers.RepeatedCompositeFieldContainer[DecomposeModelResponse.Level]
    model: str
    snapshot: _snapshot_pb2.Snapshot
    timing: _timing_pb2.QueryTiming
    def __init__(self, levels: _Optional[_Iterable[_Union[DecomposeModelResponse.Level, _Mapping]]] = ..., timing: _Optional[_Union[_timing_pb2.QueryTiming, _Mapping]] = ..., model: _Optional[str] = ..., snapshot: _Optional[_Union[_snapshot_pb2.Snapshot, _Mapping]] = ...) -> None: ...

class SegmentRef(_message.Message):
    __slots__ = ["id", "level", "scales"]
    ID_FIELD_NUMBER: _ClassVar[int]
    LEVEL_FIELD_NUMBER: _ClassVar[int]
    SCALES_FIELD_NUMBER: _ClassVar[int]
    id: int
    level: int
    scales: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, scales: _Optional[_Iterable[float]] = ..., level: _Optional[int] = ..., id: _Optional[int] = ...) -> None: ...
