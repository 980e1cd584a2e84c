from pepeseg.v1 import access_pb2 as _access_pb2
from pepeseg.v1 import decomposition_pb2 as _decomposition_pb2
from pepeseg.v1 import geometry_pb2 as _geometry_pb2
from pepeseg.v1 import prompt_pb2 as _prompt_pb2
from pepeseg.v1 import snapshot_pb2 as _snapshot_pb2
from pepeseg.v1 import timing_pb2 as _timing_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Iterable as _Iterable, Mapping as _Mapping, Optional as _Optional, Union as _Union

COORDINATES_LOCAL: Coordinates
COORDINATES_UNSPECIFIED: Coordinates
COORDINATES_WORLD: Coordinates
DESCRIPTOR: _descriptor.FileDescriptor
GAUSSIAN_FORMAT_GLB: GaussianFormat
GAUSSIAN_FORMAT_HTML: GaussianFormat
GAUSSIAN_FORMAT_PLY: GaussianFormat
GAUSSIAN_FORMAT_SOG: GaussianFormat
GAUSSIAN_FORMAT_SPZ: GaussianFormat
GAUSSIAN_FORMAT_UNSPECIFIED: GaussianFormat
MESH_FORMAT_GLB: MeshFormat
MESH_FORMAT_PLY: MeshFormat
MESH_FORMAT_UNSPECIFIED: MeshFormat

class ExportGaussiansRequest(_message.Message):
    __slots__ = ["coordinates", "format", "model", "segment_ids", "subset"]
    class SegmentIds(_message.Message):
        __slots__ = ["scales"]
        SCALES_FIELD_NUMBER: _ClassVar[int]
        scales: _containers.RepeatedScalarFieldContainer[float]
        def __init__(self, scales: _Optional[_Iterable[float]] = ...) -> None: ...
    COORDINATES_FIELD_NUMBER: _ClassVar[int]
    FORMAT_FIELD_NUMBER: _ClassVar[int]
    MODEL_FIELD_NUMBER: _ClassVar[int]
    SEGMENT_IDS_FIELD_NUMBER: _ClassVar[int]
    SUBSET_FIELD_NUMBER: _ClassVar[int]
    coordinates: Coordinates
    format: GaussianFormat
    model: str
    segment_ids: ExportGaussiansRequest.SegmentIds
    subset: Subset
    def __init__(self, model: _Optional[str] = ..., subset: _Optional[_Union[Subset, _Mapping]] = ..., coordinates: _Optional[_Union[Coordinates, str]] = ..., format: _Optional[_Union[GaussianFormat, str]] = ..., segment_ids: _Optional[_Union[ExportGaussiansRequest.SegmentIds, _Mapping]] = ...) -> None: ...

class ExportGaussiansResponse(_message.Message):
    __slots__ = ["chunk", "header"]
    class Header(_message.Message):
        __slots__ = ["model", "num_bytes", "num_gaussians", "origin", "sha256"]
        MODEL_FIELD_NUMBER: _ClassVar[int]
        NUM_BYTES_FIELD_NUMBER: _ClassVar[int]
        NUM_GAUSSIANS_FIELD_NUMBER: _ClassVar[int]
        ORIGIN_FIELD_NUMBER: _ClassVar[int]
        SHA256_FIELD_NUMBER: _ClassVar[int]
        model: str
        num_bytes: int
        num_gaussians: int
        origin: _geometry_pb2.Vector3
        sha256: str
        def __init__(self, model: _Optional[str] = ..., num_gaussians: _Optional[int] = ..., num_bytes: _Optional[int] = ..., sha256: _Optional[str] = ..., origin: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ...) -> None: ...
    CHUNK_FIELD_NUMBER: _ClassVar[int]
    HEADER_FIELD_NUMBER: _ClassVar[int]
    chunk: bytes
    header: ExportGaussiansResponse.Header
    def __init__(self, header: _Optional[_Union[ExportGaussiansResponse.Header, _Mapping]] = ..., chunk: _Optional[bytes] = ...) -> None: ...

class ExportMeshRequest(_message.Message):
    __slots__ = ["coordinates", "format", "max_triangles", "model", "subset", "voxels", "watertight"]
    COORDINATES_FIELD_NUMBER: _ClassVar[int]
    FORMAT_FIELD_NUMBER: _ClassVar[int]
    MAX_TRIANGLES_FIELD_NUMBER: _ClassVar[int]
    MODEL_FIELD_NUMBER: _ClassVar[int]
    SUBSET_FIELD_NUMBER: _ClassVar[int]
    VOXELS_FIELD_NUMBER: _ClassVar[int]
    WATERTIGHT_FIELD_NUMBER: _ClassVar[int]
    coordinates: Coordinates
    format: MeshFormat
    max_triangles: int
    model: str
    subset: Subset
    voxels: int
    watertight: bool
    def __init__(self, model: _Optional[str] = ..., subset: _Optional[_Union[Subset, _Mapping]] = ..., coordinates: _Optional[_Union[Coordinates, str]] = ..., format: _Optional[_Union[MeshFormat, str]] = ..., voxels: _Optional[int] = ..., watertight: bool = ..., max_triangles: _Optional[int] = ...) -> None: ...

class ExportMeshResponse(_message.Message):
    __slots__ = ["chunk", "header"]
    class Header(_message.Message):
        __slots__ = ["model", "num_bytes", "num_triangles", "num_vertices", "origin", "sha256"]
        MODEL_FIELD_NUMBER: _ClassVar[int]
        NUM_BYTES_FIELD_NUMBER: _ClassVar[int]
        NUM_TRIANGLES_FIELD_NUMBER: _ClassVar[int]
        NUM_VERTICES_FIELD_NUMBER: _ClassVar[int]
        ORIGIN_FIELD_NUMBER: _ClassVar[int]
        SHA256_FIELD_NUMBER: _ClassVar[int]
        model: str
        num_bytes: int
        num_triangles: int
        num_vertices: int
        origin: _geometry_pb2.Vector3
        sha256: str
        def __init__(self, model: _Optional[str] = ..., num_vertices: _Optional[int] = ..., num_triangles: _Optional[int] = ..., num_bytes: _Optional[int] = ..., sha256: _Optional[str] = ..., origin: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ...) -> None: ...
    CHUNK_FIELD_NUMBER: _ClassVar[int]
    HEADER_FIELD_NUMBER: _ClassVar[int]
    chunk: bytes
    header: ExportMeshResponse.Header
    def __init__(self, header: _Optional[_Union[ExportMeshResponse.Header, _Mapping]] = ..., chunk: _Optional[bytes] = ...) -> None: ...

class RenderViewRequest(_message.Message):
    __slots__ = ["content", "decomposition_scales", "feature_scale", "frame", "level", "max_side", "model", "overlay_mask", "overlay_subset", "subset", "viewpoint"]
    class Content(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = []
    CONTENT_COLOR: RenderViewRequest.Content
    CONTENT_DEPTH: RenderViewRequest.Content
    CONTENT_FEATURES: RenderViewRequest.Content
    CONTENT_FIELD_NUMBER: _ClassVar[int]
    CONTENT_SEGMENTS: RenderViewRequest.Content
    CONTENT_UNSPECIFIED: RenderViewRequest.Content
    DECOMPOSITION_SCALES_FIELD_NUMBER: _ClassVar[int]
    FEATURE_SCALE_FIELD_NUMBER: _ClassVar[int]
    FRAME_FIELD_NUMBER: _ClassVar[int]
    LEVEL_FIELD_NUMBER: _ClassVar[int]
    MAX_SIDE_FIELD_NUMBER: _ClassVar[int]
    MODEL_FIELD_NUMBER: _ClassVar[int]
    OVERLAY_MASK_FIELD_NUMBER: _ClassVar[int]
    OVERLAY_SUBSET_FIELD_NUMBER: _ClassVar[int]
    SUBSET_FIELD_NUMBER: _ClassVar[int]
    VIEWPOINT_FIELD_NUMBER: _ClassVar[int]
    content: RenderViewRequest.Content
    decomposition_scales: _containers.RepeatedScalarFieldContainer[float]
    feature_scale: float
    frame: _prompt_pb2.PixelFrame
    level: int
    max_side: int
    model: str
    overlay_mask: _prompt_pb2.MaskImage
    overlay_subset: Subset
    subset: Subset
    viewpoint: _prompt_pb2.Viewpoint
    def __init__(self, model: _Optional[str] = ..., viewpoint: _Optional[_Union[_prompt_pb2.Viewpoint, _Mapping]] = ..., content: _Optional[_Union[RenderViewRequest.Content, str]] = ..., subset: _Optional[_Union[Subset, _Mapping]] = ..., decomposition_scales: _Optional[_Iterable[float]] = ..., level: _Optional[int] = ..., feature_scale: _Optional[float] = ..., overlay_mask: _Optional[_Union[_prompt_pb2.MaskImage, _Mapping]] = ..., overlay_subset: _Optional[_Union[Subset, _Mapping]] = ..., frame: _Optional[_Union[_prompt_pb2.PixelFrame, str]] = ..., max_side: _Optional[int] = ...) -> None: ...

class RenderViewResponse(_message.Message):
    __slots__ = ["depth_unit", "height", "model", "png", "snapshot", "timing", "width"]
    DEPTH_UNIT_FIELD_NUMBER: _ClassVar[int]
    HEIGHT_FIELD_NUMBER: _ClassVar[int]
    MODEL_FIELD_NUMBER: _ClassVar[int]
    PNG_FIELD_NUMBER: _ClassVar[int]
    SNAPSHOT_FIELD_NUMBER: _ClassVar[int]
    TIMING_FIELD_NUMBER: _ClassVar[int]
    WIDTH_FIELD_NUMBER: _ClassVar[int]
    depth_unit: float
    height: int
    model: str
    png: bytes
    snapshot: _snapshot_pb2.Snapshot
    timing: _timing_pb2.QueryTiming
    width: int
    def __init__(self, width: _Optional[int] = ..., height: _Optional[int] = ..., png: _Optional[bytes] = ..., timing: _Optional[_Union[_timing_pb2.QueryTiming, _Mapping]] = ..., model: _Optional[str] = ..., depth_unit: _Optional[float] = ..., snapshot: _Optional[_Union[_snapshot_pb2.Snapshot, _Mapping]] = ...) -> None: ...

class Subset(_message.Message):
    __slots__ = ["complement", "segment", "selection"]
    COMPLEMENT_FIELD_NUMBER: _ClassVar[int]
    SEGMENT_FIELD_NUMBER: _ClassVar[int]
    SELECTION_FIELD_NUMBER: _ClassVar[int]
    complement: bool
    segment: _decomposition_pb2.SegmentRef
    selection: str
    def __init__(self, selection: _Optional[str] = ..., segment: _Optional[_Union[_decomposition_pb2.SegmentRef, _Mapping]] = ..., complement: bool = ...) -> None: ...

class GaussianFormat(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = []

class Coordinates(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = []

class MeshFormat(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = []
