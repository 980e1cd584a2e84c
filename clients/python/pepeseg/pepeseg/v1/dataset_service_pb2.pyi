from google.protobuf import empty_pb2 as _empty_pb2
from google.protobuf import timestamp_pb2 as _timestamp_pb2
from pepeseg.v1 import access_pb2 as _access_pb2
from pepeseg.v1 import prompt_pb2 as _prompt_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Iterable as _Iterable, Mapping as _Mapping, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor
FILE_KIND_DEPTH: FileKind
FILE_KIND_DISPARITY: FileKind
FILE_KIND_GAUSSIANS: FileKind
FILE_KIND_IGNORE_MASK: FileKind
FILE_KIND_IMAGE: FileKind
FILE_KIND_MASK: FileKind
FILE_KIND_POINTS: FileKind
FILE_KIND_POSES: FileKind
FILE_KIND_UNSPECIFIED: FileKind
FILE_KIND_VIDEO: FileKind

class CreateUploadRequest(_message.Message):
    __slots__ = ["files", "parent", "request_id"]
    FILES_FIELD_NUMBER: _ClassVar[int]
    PARENT_FIELD_NUMBER: _ClassVar[int]
    REQUEST_ID_FIELD_NUMBER: _ClassVar[int]
    files: _containers.RepeatedCompositeFieldContainer[FileDeclaration]
    parent: str
    request_id: str
    def __init__(self, parent: _Optional[str] = ..., files: _Optional[_Iterable[_Union[FileDeclaration, _Mapping]]] = ..., request_id: _Optional[str] = ...) -> None: ...

class Dataset(_message.Message):
    __slots__ = ["advice", "create_time", "name", "num_bytes", "num_files", "seal_time"]
    ADVICE_FIELD_NUMBER: _ClassVar[int]
    CREATE_TIME_FIELD_NUMBER: _ClassVar[int]
    NAME_FIELD_NUMBER: _ClassVar[int]
    NUM_BYTES_FIELD_NUMBER: _ClassVar[int]
    NUM_FILES_FIELD_NUMBER: _ClassVar[int]
    SEAL_TIME_FIELD_NUMBER: _ClassVar[int]
    advice: _containers.RepeatedScalarFieldContainer[str]
    create_time: _timestamp_pb2.Timestamp
    name: str
    num_bytes: int
    num_files: int
    seal_time: _timestamp_pb2.Timestamp
    def __init__(self, name: _Optional[str] = ..., create_time: _Optional[_Union[_timestamp_pb2.Timestamp, _Mapping]] = ..., seal_time: _Optional[_Union[_timestamp_pb2.Timestamp, _Mapping]] = ..., num_files: _Optional[int] = ..., num_bytes: _Optional[int] = ..., advice: _Optional[_Iterable[str]] = ...) -> None: ...

class DeleteUploadRequest(_message.Message):
    __slots__ = ["name"]
    NAME_FIELD_NUMBER: _ClassVar[int]
    name: str
    def __init__(self, name: _Optional[str] = ...) -> None: ...

class FileDeclaration(_message.Message):
    __slots__ = ["kind", "path", "sha256", "size"]
    KIND_FIELD_NUMBER: _ClassVar[int]
    PATH_FIELD_NUMBER: _ClassVar[int]
    SHA256_FIELD_NUMBER: _ClassVar[int]
    SIZE_FIELD_NUMBER: _ClassVar[int]
    kind: FileKind
    path: str
    sha256: str
    size: int
    def __init__(self, path: _Optional[str] = ..., kind: _Optional[_Union[FileKind, str]] = ..., size: _Optional[int] = ..., sha256: _Optional[str] = ...) -> None: ...

class GetDatasetRequest(_message.Message):
    __slots__ = ["name"]
    NAME_FIELD_NUMBER: _ClassVar[int]
    name: str
    def __init__(self, name: _Optional[str] = ...) -> None: ...

class GetPhotographRequest(_message.Message):
    __slots__ = ["frame", "max_side", "original", "parent", "photograph"]
    FRAME_FIELD_NUMBER: _ClassVar[int]
    MAX_SIDE_FIELD_NUMBER: _ClassVar[int]
    ORIGINAL_FIELD_NUMBER: _ClassVar[int]
    PARENT_FIELD_NUMBER: _ClassVar[int]
    PHOTOGRAPH_FIELD_NUMBER: _ClassVar[int]
    frame: _prompt_pb2.PixelFrame
    max_side: int
    original: bool
    parent: str
    photograph: str
    def __init__(self, parent: _Optional[str] = ..., photograph: _Optional[str] = ..., frame: _Optional[_Union[_prompt_pb2.PixelFrame, str]] = ..., max_side: _Optional[int] = ..., original: bool = ...) -> None: ...

class GetPhotographResponse(_message.Message):
    __slots__ = ["chunk", "header"]
    class Header(_message.Message):
        __slots__ = ["content_type", "height", "num_bytes", "width"]
        CONTENT_TYPE_FIELD_NUMBER: _ClassVar[int]
        HEIGHT_FIELD_NUMBER: _ClassVar[int]
        NUM_BYTES_FIELD_NUMBER: _ClassVar[int]
        WIDTH_FIELD_NUMBER: _ClassVar[int]
        content_type: str
        height: int
        num_bytes: int
        width: int
        def __init__(self, width: _Optional[int] = ..., height: _Optional[int] = ..., content_type: _Optional[str] = ..., num_bytes: _Optional[int] = ...) -> None: ...
    CHUNK_FIELD_NUMBER: _ClassVar[int]
    HEADER_FIELD_NUMBER: _ClassVar[int]
    chunk: bytes
    header: GetPhotographResponse.Header
    def __init__(self, header: _Optional[_Union[GetPhotographResponse.Header, _Mapping]] = ..., chunk: _Optional[bytes] = ...) -> None: ...

class GetUploadRequest(_message.Message):
    __slots__ = ["name"]
    NAME_FIELD_NUMBER: _ClassVar[int]
    name: str
    def __init__(self, name: _Optional[str] = ...) -> None: ...

class ListDatasetsRequest(_message.Message):
    __slots__ = ["page_size", "page_token", "parent"]
    PAGE_SIZE_FIELD_NUMBER: _ClassVar[int]
    PAGE_TOKEN_FIELD_NUMBER: _ClassVar[int]
    PARENT_FIELD_NUMBER: _ClassVar[int]
    page_size: int
    page_token: str
    parent: str
    def __init__(self, parent: _Optional[str] = ..., page_size: _Optional[int] = ..., page_token: _Optional[str] = ...) -> None: ...

class ListDatasetsResponse(_message.Message):
    __slots__ = ["datasets", "next_page_token"]
    DATASETS_FIELD_NUMBER: _ClassVar[int]
    NEXT_PAGE_TOKEN_FIELD_NUMBER: _ClassVar[int]
    datasets: _containers.RepeatedCompositeFieldContainer[Dataset]
    next_page_token: str
    def __init__(self, datasets: _Optional[_Iterable[_Union[Dataset, _Mapping]]] = ..., next_page_token: _Optional[str] = ...) -> None: ...

class SealUploadRequest(_message.Message):
    __slots__ = ["name"]
    NAME_FIELD_NUMBER: _ClassVar[int]
    name: str
    def __init__(self, name: _Optional[str] = ...) -> None: ...

class Upload(_message.Message):
    __slots__ = ["create_time", "missing_files", "name", "num_bytes", "num_files", "partial_files", "sealed"]
    class PartialFile(_message.Message):
        __slots__ = ["committed_bytes", "path"]
        COMMITTED_BYTES_FIELD_NUMBER: _ClassVar[int]
        PATH_FIELD_NUMBER: _ClassVar[int]
        committed_bytes: int
        path: str
        def __init__(self, path: _Optional[str] = ..., committed_bytes: _Optional[int] = ...) -> None: ...
    CREATE_TIME_FIELD_NUMBER: _ClassVar[int]
    MISSING_FILES_FIELD_NUMBER: _ClassVar[int]
    NAME_FIELD_NUMBER: _ClassVar[int]
    NUM_BYTES_FIELD_NUMBER: _ClassVar[int]
    NUM_FILES_FIELD_NUMBER: _ClassVar[int]
    PARTIAL_FILES_FIELD_NUMBER: _ClassVar[int]
    SEALED_FIELD_NUMBER: _ClassVar[int]
    create_time: _timestamp_pb2.Timestamp
    missing_files: _containers.RepeatedScalarFieldContainer[str]
    name: str
    num_bytes: int
    num_files: int
    partial_files: _containers.RepeatedCompositeFieldContainer[Upload.PartialFile]
    sealed: bool
    def __init__(self, name: _Optional[str] = ..., create_time: _Optional[_Union[_timestamp_pb2.Timestamp, _Mapping]] = ..., num_files: _Optional[int] = ..., num_bytes: _Optional[int] = ..., missing_files: _Optional[_Iterable[str]] = ..., sealed: bool = ..., partial_files: _Optional[_Iterable[_Union[Upload.PartialFile, _Mapping]]] = ...) -> None: ...

class WriteFilesRequest(_message.Message):
    __slots__ = ["chunk", "end", "header"]
    class End(_message.Message):
        __slots__ = []
        def __init__(self) -> None: ...
    class Header(_message.Message):
        __slots__ = ["offset", "path", "upload"]
        OFFSET_FIELD_NUMBER: _ClassVar[int]
        PATH_FIELD_NUMBER: _ClassVar[int]
        UPLOAD_FIELD_NUMBER: _ClassVar[int]
        offset: int
        path: str
        upload: str
        def __init__(self, upload: _Optional[str] = ..., path: _Optional[str] = ..., offset: _Optional[int] = ...) -> None: ...
    CHUNK_FIELD_NUMBER: _ClassVar[int]
    END_FIELD_NUMBER: _ClassVar[int]
    HEADER_FIELD_NUMBER: _ClassVar[int]
    chunk: bytes
    end: WriteFilesRequest.End
    header: WriteFilesRequest.Header
    def __init__(self, header: _Optional[_Union[WriteFilesRequest.Header, _Mapping]] = ..., chunk: _Optional[bytes] = ..., end: _Optional[_Union[WriteFilesRequest.End, _Mapping]] = ...) -> None: ...

class WriteFilesResponse(_message.Message):
    __slots__ = ["num_bytes", "num_files"]
    NUM_BYTES_FIELD_NUMBER: _ClassVar[int]
    NUM_FILES_FIELD_NUMBER: _ClassVar[int]
    num_bytes: int
    num_files: int
    def __init__(self, num_files: _Optional[int] = ..., num_bytes: _Optional[int] = ...) -> None: ...

class FileKind(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = []
