from google.protobuf import empty_pb2 as _empty_pb2
from google.protobuf import timestamp_pb2 as _timestamp_pb2
from pepeseg.v1 import access_pb2 as _access_pb2
from pepeseg.v1 import api_key_pb2 as _api_key_pb2
from pepeseg.v1 import quota_pb2 as _quota_pb2
from pepeseg.v1 import server_status_pb2 as _server_status_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Iterable as _Iterable, Mapping as _Mapping, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class ListResidentModelsRequest(_message.Message):
    __slots__ = []
    def __init__(self) -> None: ...

class ListResidentModelsResponse(_message.Message):
    __slots__ = ["device", "device_bytes_in_use", "host", "models", "num_evictions", "num_loads"]
    DEVICE_BYTES_IN_USE_FIELD_NUMBER: _ClassVar[int]
    DEVICE_FIELD_NUMBER: _ClassVar[int]
    HOST_FIELD_NUMBER: _ClassVar[int]
    MODELS_FIELD_NUMBER: _ClassVar[int]
    NUM_EVICTIONS_FIELD_NUMBER: _ClassVar[int]
    NUM_LOADS_FIELD_NUMBER: _ClassVar[int]
    device: MemoryUse
    device_bytes_in_use: int
    host: MemoryUse
    models: _containers.RepeatedCompositeFieldContainer[ResidentModel]
    num_evictions: int
    num_loads: int
    def __init__(self, models: _Optional[_Iterable[_Union[ResidentModel, _Mapping]]] = ..., host: _Optional[_Union[MemoryUse, _Mapping]] = ..., device: _Optional[_Union[MemoryUse, _Mapping]] = ..., device_bytes_in_use: _Optional[int] = ..., num_loads: _Optional[int] = ..., num_evictions: _Optional[int] = ...) -> None: ...

class LoadModelRequest(_message.Message):
    __slots__ = ["name"]
    NAME_FIELD_NUMBER: _ClassVar[int]
    name: str
    def __init__(self, name: _Optional[str] = ...) -> None: ...

class MemoryUse(_message.Message):
    __slots__ = ["limit_bytes", "reserved_bytes"]
    LIMIT_BYTES_FIELD_NUMBER: _ClassVar[int]
    RESERVED_BYTES_FIELD_NUMBER: _ClassVar[int]
    limit_bytes: int
    reserved_bytes: int
    def __init__(self, reserved_bytes: _Optional[int] = ..., limit_bytes: _Optional[int] = ...) -> None: ...

class PinModelRequest(_message.Message):
    __slots__ = ["name"]
    NAME_FIELD_NUMBER: _ClassVar[int]
    name: str
    def __init__(self, name: _Optional[str] = ...) -> None: ...

class ResidentModel(_message.Message):
    __slots__ = ["cached_maps", "device", "device_bytes", "host_bytes", "last_use_time", "name", "num_renders", "pinned", "queries_in_flight"]
    CACHED_MAPS_FIELD_NUMBER: _ClassVar[int]
    DEVICE_BYTES_FIELD_NUMBER: _ClassVar[int]
    DEVICE_FIELD_NUMBER: _ClassVar[int]
    HOST_BYTES_FIELD_NUMBER: _ClassVar[int]
    LAST_USE_TIME_FIELD_NUMBER: _ClassVar[int]
    NAME_FIELD_NUMBER: _ClassVar[int]
    NUM_RENDERS_FIELD_NUMBER: _ClassVar[int]
    PINNED_FIELD_NUMBER: _ClassVar[int]
    QUERIES_IN_FLIGHT_FIELD_NUMBER: _ClassVar[int]
    cached_maps: int
    device: str
    device_bytes: int
    host_bytes: int
    last_use_time: _timestamp_pb2.Timestamp
    name: str
    num_renders: int
    pinned: bool
    queries_in_flight: int
    def __init__(self, name: _Optional[str] = ..., host_bytes: _Optional[int] = ..., device_bytes: _Optional[int] = ..., pinned: bool = ..., last_use_time: _Optional[_Union[_timestamp_pb2.Timestamp, _Mapping]] = ..., queries_in_flight: _Optional[int] = ..., cached_maps: _Optional[int] = ..., num_renders: _Optional[int] = ..., device: _Optional[str] = ...) -> None: ...

class UnloadModelRequest(_message.Message):
    __slots__ = ["name"]
    NAME_FIELD_NUMBER: _ClassVar[int]
    name: str
    def __init__(self, name: _Optional[str] = ...) -> None: ...

class UnpinModelRequest(_message.Message):
    __slots__ = ["name"]
    NAME_FIELD_NUMBER: _ClassVar[int]
    name: str
    def __init__(self, name: _Optional[str] = ...) -> None: ...
