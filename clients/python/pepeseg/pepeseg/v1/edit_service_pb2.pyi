from pepeseg.v1 import access_pb2 as _access_pb2
from pepeseg.v1 import geometry_pb2 as _geometry_pb2
from pepeseg.v1 import render_service_pb2 as _render_service_pb2
from pepeseg.v1 import timing_pb2 as _timing_pb2
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Mapping as _Mapping, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class EditModelRequest(_message.Message):
    __slots__ = ["model", "move", "recolor", "remove", "subset"]
    class Move(_message.Message):
        __slots__ = ["copy", "pivot", "rotation", "scale", "translation"]
        COPY_FIELD_NUMBER: _ClassVar[int]
        PIVOT_FIELD_NUMBER: _ClassVar[int]
        ROTATION_FIELD_NUMBER: _ClassVar[int]
        SCALE_FIELD_NUMBER: _ClassVar[int]
        TRANSLATION_FIELD_NUMBER: _ClassVar[int]
        copy: bool
        pivot: _geometry_pb2.Vector3
        rotation: _geometry_pb2.Quaternion
        scale: float
        translation: _geometry_pb2.Vector3
        def __init__(self, translation: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., rotation: _Optional[_Union[_geometry_pb2.Quaternion, _Mapping]] = ..., scale: _Optional[float] = ..., pivot: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., copy: bool = ...) -> None: ...
    class Recolor(_message.Message):
        __slots__ = ["blue", "green", "red", "strength"]
        BLUE_FIELD_NUMBER: _ClassVar[int]
        GREEN_FIELD_NUMBER: _ClassVar[int]
        RED_FIELD_NUMBER: _ClassVar[int]
        STRENGTH_FIELD_NUMBER: _ClassVar[int]
        blue: float
        green: float
        red: float
        strength: float
        def __init__(self, red: _Optional[float] = ..., green: _Optional[float] = ..., blue: _Optional[float] = ..., strength: _Optional[float] = ...) -> None: ...
    class Remove(_message.Message):
        __slots__ = ["fill"]
        FILL_FIELD_NUMBER: _ClassVar[int]
        fill: bool
        def __init__(self, fill: bool = ...) -> None: ...
    MODEL_FIELD_NUMBER: _ClassVar[int]
    MOVE_FIELD_NUMBER: _ClassVar[int]
    RECOLOR_FIELD_NUMBER: _ClassVar[int]
    REMOVE_FIELD_NUMBER: _ClassVar[int]
    SUBSET_FIELD_NUMBER: _ClassVar[int]
    model: str
    move: EditModelRequest.Move
    recolor: EditModelRequest.Recolor
    remove: EditModelRequest.Remove
    subset: _render_service_pb2.Subset
    def __init__(self, model: _Optional[str] = ..., subset: _Optional[_Union[_render_service_pb2.Subset, _Mapping]] = ..., remove: _Optional[_Union[EditModelRequest.Remove, _Mapping]] = ..., move: _Optional[_Union[EditModelRequest.Move, _Mapping]] = ..., recolor: _Optional[_Union[EditModelRequest.Recolor, _Mapping]] = ...) -> None: ...

class EditModelResponse(_message.Message):
    __slots__ = ["progress", "result"]
    class Progress(_message.Message):
        __slots__ = ["activity", "num_all", "num_done"]
        ACTIVITY_FIELD_NUMBER: _ClassVar[int]
        NUM_ALL_FIELD_NUMBER: _ClassVar[int]
        NUM_DONE_FIELD_NUMBER: _ClassVar[int]
        activity: str
        num_all: int
        num_done: int
        def __init__(self, activity: _Optional[str] = ..., num_done: _Optional[int] = ..., num_all: _Optional[int] = ...) -> None: ...
    class Result(_message.Message):
        __slots__ = ["edited_from", "model", "num_added", "num_changed", "num_removed", "selection", "timing"]
        EDITED_FROM_FIELD_NUMBER: _ClassVar[int]
        MODEL_FIELD_NUMBER: _ClassVar[int]
        NUM_ADDED_FIELD_NUMBER: _ClassVar[int]
        NUM_CHANGED_FIELD_NUMBER: _ClassVar[int]
        NUM_REMOVED_FIELD_NUMBER: _ClassVar[int]
        SELECTION_FIELD_NUMBER: _ClassVar[int]
        TIMING_FIELD_NUMBER: _ClassVar[int]
        edited_from: str
        model: str
        num_added: int
        num_changed: int
        num_removed: int
        selection: str
        timing: _timing_pb2.QueryTiming
        def __init__(self, model: _Optional[str] = ..., edited_from: _Optional[str] = ..., num_removed: _Optional[int] = ..., num_added: _Optional[int] = ..., num_changed: _Optional[int] = ..., selection: _Optional[str] = ..., timing: _Optional[_Union[_timing_pb2.QueryTiming, _Mapping]] = ...) -> None: ...
    PROGRESS_FIELD_NUMBER: _ClassVar[int]
    RESULT_FIELD_NUMBER: _ClassVar[int]
    progress: EditModelResponse.Progress
    result: EditModelResponse.Result
    def __init__(self, progress: _Optional[_Union[EditModelResponse.Progress, _Mapping]] = ..., result: _Optional[_Union[EditModelResponse.Result, _Mapping]] = ...) -> None: ...
