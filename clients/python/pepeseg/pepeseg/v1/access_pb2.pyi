from google.protobuf import descriptor_pb2 as _descriptor_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Iterable as _Iterable, Optional as _Optional, Union as _Union

ACCESS_FIELD_NUMBER: _ClassVar[int]
DESCRIPTOR: _descriptor.FileDescriptor
POOL_ADMIN: Pool
POOL_CORRECTION: Pool
POOL_EVALUATION: Pool
POOL_FIND: Pool
POOL_IO: Pool
POOL_QUERY: Pool
POOL_UNSPECIFIED: Pool
POOL_UPLOAD: Pool
SCOPE_OPERATE: Scope
SCOPE_READ: Scope
SCOPE_TRAIN: Scope
SCOPE_UNSPECIFIED: Scope
SCOPE_WRITE: Scope
access: _descriptor.FieldDescriptor

class Access(_message.Message):
    __slots__ = ["pool", "resources", "scope"]
    POOL_FIELD_NUMBER: _ClassVar[int]
    RESOURCES_FIELD_NUMBER: _ClassVar[int]
    SCOPE_FIELD_NUMBER: _ClassVar[int]
    pool: Pool
    resources: _containers.RepeatedScalarFieldContainer[str]
    scope: Scope
    def __init__(self, scope: _Optional[_Union[Scope, str]] = ..., resources: _Optional[_Iterable[str]] = ..., pool: _Optional[_Union[Pool, str]] = ...) -> None: ...

class Scope(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = []

class Pool(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = []
