from google.protobuf import empty_pb2 as _empty_pb2
from google.protobuf import timestamp_pb2 as _timestamp_pb2
from pepeseg.v1 import access_pb2 as _access_pb2
from pepeseg.v1 import geometry_pb2 as _geometry_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Iterable as _Iterable, Mapping as _Mapping, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class CreateSceneRequest(_message.Message):
    __slots__ = ["request_id", "scene", "scene_id"]
    REQUEST_ID_FIELD_NUMBER: _ClassVar[int]
    SCENE_FIELD_NUMBER: _ClassVar[int]
    SCENE_ID_FIELD_NUMBER: _ClassVar[int]
    request_id: str
    scene: Scene
    scene_id: str
    def __init__(self, scene_id: _Optional[str] = ..., scene: _Optional[_Union[Scene, _Mapping]] = ..., request_id: _Optional[str] = ...) -> None: ...

class DeleteModelRequest(_message.Message):
    __slots__ = ["name"]
    NAME_FIELD_NUMBER: _ClassVar[int]
    name: str
    def __init__(self, name: _Optional[str] = ...) -> None: ...

class DeleteSceneRequest(_message.Message):
    __slots__ = ["name"]
    NAME_FIELD_NUMBER: _ClassVar[int]
    name: str
    def __init__(self, name: _Optional[str] = ...) -> None: ...

class GetModelRequest(_message.Message):
    __slots__ = ["name"]
    NAME_FIELD_NUMBER: _ClassVar[int]
    name: str
    def __init__(self, name: _Optional[str] = ...) -> None: ...

class GetSceneRequest(_message.Message):
    __slots__ = ["name"]
    NAME_FIELD_NUMBER: _ClassVar[int]
    name: str
    def __init__(self, name: _Optional[str] = ...) -> None: ...

class ImageScores(_message.Message):
    __slots__ = ["lpips", "psnr", "ssim"]
    LPIPS_FIELD_NUMBER: _ClassVar[int]
    PSNR_FIELD_NUMBER: _ClassVar[int]
    SSIM_FIELD_NUMBER: _ClassVar[int]
    lpips: float
    psnr: float
    ssim: float
    def __init__(self, psnr: _Optional[float] = ..., ssim: _Optional[float] = ..., lpips: _Optional[float] = ...) -> None: ...

class InputSources(_message.Message):
    __slots__ = ["depth", "masks", "poses"]
    DEPTH_FIELD_NUMBER: _ClassVar[int]
    MASKS_FIELD_NUMBER: _ClassVar[int]
    POSES_FIELD_NUMBER: _ClassVar[int]
    depth: str
    masks: str
    poses: str
    def __init__(self, poses: _Optional[str] = ..., masks: _Optional[str] = ..., depth: _Optional[str] = ...) -> None: ...

class ListModelsRequest(_message.Message):
    __slots__ = ["page_size", "page_token", "parent"]
    PAGE_SIZE_FIELD_NUMBER: _ClassVar[int]
    PAGE_TOKEN_FIELD_NUMBER: _ClassVar[int]
    PARENT_FIELD_NUMBER: _ClassVar[int]
    page_size: int
    page_token: str
    parent: str
    def __init__(self, parent: _Optional[str] = ..., page_size: _Optional[int] = ..., page_token: _Optional[str] = ...) -> None: ...

class ListModelsResponse(_message.Message):
    __slots__ = ["models", "next_page_token"]
    MODELS_FIELD_NUMBER: _ClassVar[int]
    NEXT_PAGE_TOKEN_FIELD_NUMBER: _ClassVar[int]
    models: _containers.RepeatedCompositeFieldContainer[Model]
    next_page_token: str
    def __init__(self, models: _Optional[_Iterable[_Union[Model, _Mapping]]] = ..., next_page_token: _Optional[str] = ...) -> None: ...

class ListScenesRequest(_message.Message):
    __slots__ = ["page_size", "page_token"]
    PAGE_SIZE_FIELD_NUMBER: _ClassVar[int]
    PAGE_TOKEN_FIELD_NUMBER: _ClassVar[int]
    page_size: int
    page_token: str
    def __init__(self, page_size: _Optional[int] = ..., page_token: _Optional[str] = ...) -> None: ...

class ListScenesResponse(_message.Message):
    __slots__ = ["next_page_token", "scenes"]
    NEXT_PAGE_TOKEN_FIELD_NUMBER: _ClassVar[int]
    SCENES_FIELD_NUMBER: _ClassVar[int]
    next_page_token: str
    scenes: _containers.RepeatedCompositeFieldContainer[Scene]
    def __init__(self, scenes: _Optional[_Iterable[_Union[Scene, _Mapping]]] = ..., next_page_token: _Optional[str] = ...) -> None: ...

class ListViewsRequest(_message.Message):
    __slots__ = ["page_size", "page_token", "parent"]
    PAGE_SIZE_FIELD_NUMBER: _ClassVar[int]
    PAGE_TOKEN_FIELD_NUMBER: _ClassVar[int]
    PARENT_FIELD_NUMBER: _ClassVar[int]
    page_size: int
    page_token: str
    parent: str
    def __init__(self, parent: _Optional[str] = ..., page_size: _Optional[int] = ..., page_token: _Optional[str] = ...) -> None: ...

class ListViewsResponse(_message.Message):
    __slots__ = ["next_page_token", "views"]
    NEXT_PAGE_TOKEN_FIELD_NUMBER: _ClassVar[int]
    VIEWS_FIELD_NUMBER: _ClassVar[int]
    next_page_token: str
    views: _containers.RepeatedCompositeFieldContainer[View]
    def __init__(self, views: _Optional[_Iterable[_Union[View, _Mapping]]] = ..., next_page_token: _Optional[str] = ...) -> None: ...

class Model(_message.Message):
    __slots__ = ["advice", "corrected_from", "create_time", "dataset", "device", "edit", "edited_from", "job", "metrics", "name", "num_bytes", "num_gaussians", "sources"]
    class MetricsEntry(_message.Message):
        __slots__ = ["key", "value"]
        KEY_FIELD_NUMBER: _ClassVar[int]
        VALUE_FIELD_NUMBER: _ClassVar[int]
        key: str
        value: float
        def __init__(self, key: _Optional[str] = ..., value: _Optional[float] = ...) -> None: ...
    ADVICE_FIELD_NUMBER: _ClassVar[int]
    CORRECTED_FROM_FIELD_NUMBER: _ClassVar[int]
    CREATE_TIME_FIELD_NUMBER: _ClassVar[int]
    DATASET_FIELD_NUMBER: _ClassVar[int]
    DEVICE_FIELD_NUMBER: _ClassVar[int]
    EDITED_FROM_FIELD_NUMBER: _ClassVar[int]
    EDIT_FIELD_NUMBER: _ClassVar[int]
    JOB_FIELD_NUMBER: _ClassVar[int]
    METRICS_FIELD_NUMBER: _ClassVar[int]
    NAME_FIELD_NUMBER: _ClassVar[int]
    NUM_BYTES_FIELD_NUMBER: _ClassVar[int]
    NUM_GAUSSIANS_FIELD_NUMBER: _ClassVar[int]
    SOURCES_FIELD_NUMBER: _ClassVar[int]
    advice: _containers.RepeatedScalarFieldContainer[str]
    corrected_from: str
    create_time: _timestamp_pb2.Timestamp
    dataset: str
    device: str
    edit: str
    edited_from: str
    job: str
    metrics: _containers.ScalarMap[str, float]
    name: str
    num_bytes: int
    num_gaussians: int
    sources: InputSources
    def __init__(self, name: _Optional[str] = ..., job: _Optional[str] = ..., create_time: _Optional[_Union[_timestamp_pb2.Timestamp, _Mapping]] = ..., num_gaussians: _Optional[int] = ..., num_bytes: _Optional[int] = ..., metrics: _Optional[_Mapping[str, float]] = ..., device: _Optional[str] = ..., sources: _Optional[_Union[InputSources, _Mapping]] = ..., advice: _Optional[_Iterable[str]] = ..., dataset: _Optional[str] = ..., corrected_from: _Optional[str] = ..., edited_from: _Optional[str] = ..., edit: _Optional[str] = ...) -> None: ...

class Scene(_message.Message):
    __slots__ = ["active_job", "create_time", "display_name", "live_model", "name"]
    ACTIVE_JOB_FIELD_NUMBER: _ClassVar[int]
    CREATE_TIME_FIELD_NUMBER: _ClassVar[int]
    DISPLAY_NAME_FIELD_NUMBER: _ClassVar[int]
    LIVE_MODEL_FIELD_NUMBER: _ClassVar[int]
    NAME_FIELD_NUMBER: _ClassVar[int]
    active_job: str
    create_time: _timestamp_pb2.Timestamp
    display_name: str
    live_model: str
    name: str
    def __init__(self, name: _Optional[str] = ..., display_name: _Optional[str] = ..., create_time: _Optional[_Union[_timestamp_pb2.Timestamp, _Mapping]] = ..., live_model: _Optional[str] = ..., active_job: _Optional[str] = ...) -> None: ...

class SetLiveModelRequest(_message.Message):
    __slots__ = ["name"]
    NAME_FIELD_NUMBER: _ClassVar[int]
    name: str
    def __init__(self, name: _Optional[str] = ...) -> None: ...

class View(_message.Message):
    __slots__ = ["cam_from_world", "camera", "held_out", "photograph_height", "photograph_width", "scores", "view"]
    CAMERA_FIELD_NUMBER: _ClassVar[int]
    CAM_FROM_WORLD_FIELD_NUMBER: _ClassVar[int]
    HELD_OUT_FIELD_NUMBER: _ClassVar[int]
    PHOTOGRAPH_HEIGHT_FIELD_NUMBER: _ClassVar[int]
    PHOTOGRAPH_WIDTH_FIELD_NUMBER: _ClassVar[int]
    SCORES_FIELD_NUMBER: _ClassVar[int]
    VIEW_FIELD_NUMBER: _ClassVar[int]
    cam_from_world: _geometry_pb2.RigidTransform
    camera: _geometry_pb2.PinholeCamera
    held_out: bool
    photograph_height: int
    photograph_width: int
    scores: ImageScores
    view: str
    def __init__(self, view: _Optional[str] = ..., camera: _Optional[_Union[_geometry_pb2.PinholeCamera, _Mapping]] = ..., cam_from_world: _Optional[_Union[_geometry_pb2.RigidTransform, _Mapping]] = ..., held_out: bool = ..., scores: _Optional[_Union[ImageScores, _Mapping]] = ..., photograph_width: _Optional[int] = ..., photograph_height: _Optional[int] = ...) -> None: ...
