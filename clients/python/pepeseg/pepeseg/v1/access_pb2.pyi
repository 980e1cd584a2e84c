from google.protobuf import descriptor_pb2 as _descriptor_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Iterable as _Iterable, Optional as _Optional, Union as _Union

ACCESS_FIELD_NUMBER: _ClassVar[int]
DESCRIPTOR: _descriptor.FileDescriptor
SCOPE_OPERATE: Scope
SCOPE_READ: Scope
SCOPE_TRAIN: Scope
SCOPE_UNSPECIFIED: Scope
SCOPE_WRITE: Scope
access: _descriptor.FieldDescriptor

class Access(_message.Message):
    __slots__ = ["resources", "scope"]
    RESOURCES_FIELD_NUMBER: _ClassVar[int]
    SCOPE_FIELD_NUMBER: _ClassVar[int]
    resources: _containers.RepeatedScalarFieldContainer[str]
    scope: Scope
    def __init__(self, scope: _Optional[_Union[Scope, str]] = ..., resources: _Optional[_Iterable[str]] = ...) -> None: ...

class Scope(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = []
