from pepeseg.v1 import decomposition_pb2 as _decomposition_pb2
from pepeseg.v1 import geometry_pb2 as _geometry_pb2
from pepeseg.v1 import prompt_pb2 as _prompt_pb2
from pepeseg.v1 import timing_pb2 as _timing_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Iterable as _Iterable, Mapping as _Mapping, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class FindSegmentsRequest(_message.Message):
    __slots__ = ["frame", "granularity", "like", "like_segment", "max_results", "min_score", "model", "text"]
    FRAME_FIELD_NUMBER: _ClassVar[int]
    GRANULARITY_FIELD_NUMBER: _ClassVar[int]
    LIKE_FIELD_NUMBER: _ClassVar[int]
    LIKE_SEGMENT_FIELD_NUMBER: _ClassVar[int]
    MAX_RESULTS_FIELD_NUMBER: _ClassVar[int]
    MIN_SCORE_FIELD_NUMBER: _ClassVar[int]
    MODEL_FIELD_NUMBER: _ClassVar[int]
    TEXT_FIELD_NUMBER: _ClassVar[int]
    frame: _prompt_pb2.PixelFrame
    granularity: _prompt_pb2.Granularity
    like: _prompt_pb2.Prompt
    like_segment: _decomposition_pb2.SegmentRef
    max_results: int
    min_score: float
    model: str
    text: str
    def __init__(self, model: _Optional[str] = ..., like: _Optional[_Union[_prompt_pb2.Prompt, _Mapping]] = ..., like_segment: _Optional[_Union[_decomposition_pb2.SegmentRef, _Mapping]] = ..., text: _Optional[str] = ..., granularity: _Optional[_Union[_prompt_pb2.Granularity, _Mapping]] = ..., max_results: _Optional[int] = ..., min_score: _Optional[float] = ..., frame: _Optional[_Union[_prompt_pb2.PixelFrame, str]] = ...) -> None: ...

class FindSegmentsResponse(_message.Message):
    __slots__ = ["best_score", "best_word", "did_you_mean", "found", "known_words", "model", "source", "timing"]
    class Source(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = []
    class Appearance(_message.Message):
        __slots__ = ["area", "height", "view", "width", "x", "y"]
        AREA_FIELD_NUMBER: _ClassVar[int]
        HEIGHT_FIELD_NUMBER: _ClassVar[int]
        VIEW_FIELD_NUMBER: _ClassVar[int]
        WIDTH_FIELD_NUMBER: _ClassVar[int]
        X_FIELD_NUMBER: _ClassVar[int]
        Y_FIELD_NUMBER: _ClassVar[int]
        area: int
        height: int
        view: str
        width: int
        x: int
        y: int
        def __init__(self, view: _Optional[str] = ..., x: _Optional[int] = ..., y: _Optional[int] = ..., width: _Optional[int] = ..., height: _Optional[int] = ..., area: _Optional[int] = ...) -> None: ...
    class Found(_message.Message):
        __slots__ = ["appearances", "box", "granularity", "label", "num_gaussians", "prompt", "score", "segment", "word"]
        APPEARANCES_FIELD_NUMBER: _ClassVar[int]
        BOX_FIELD_NUMBER: _ClassVar[int]
        GRANULARITY_FIELD_NUMBER: _ClassVar[int]
        LABEL_FIELD_NUMBER: _ClassVar[int]
        NUM_GAUSSIANS_FIELD_NUMBER: _ClassVar[int]
        PROMPT_FIELD_NUMBER: _ClassVar[int]
        SCORE_FIELD_NUMBER: _ClassVar[int]
        SEGMENT_FIELD_NUMBER: _ClassVar[int]
        WORD_FIELD_NUMBER: _ClassVar[int]
        appearances: _containers.RepeatedCompositeFieldContainer[FindSegmentsResponse.Appearance]
        box: _geometry_pb2.BoundingBox
        granularity: _prompt_pb2.Granularity
        label: str
        num_gaussians: int
        prompt: _prompt_pb2.Prompt
        score: float
        segment: _decomposition_pb2.SegmentRef
        word: str
        def __init__(self, score: _Optional[float] = ..., label: _Optional[str] = ..., word: _Optional[str] = ..., segment: _Optional[_Union[_decomposition_pb2.SegmentRef, _Mapping]] = ..., prompt: _Optional[_Union[_prompt_pb2.Prompt, _Mapping]] = ..., granularity: _Optional[_Union[_prompt_pb2.Granularity, _Mapping]] = ..., box: _Optional[_Union[_geometry_pb2.BoundingBox, _Mapping]] = ..., num_gaussians: _Optional[int] = ..., appearances: _Optional[_Iterable[_Union[FindSegmentsResponse.Appearance, _Mapping]]] = ...) -> None: ...
    BEST_SCORE_FIELD_NUMBER: _ClassVar[int]
    BEST_WORD_FIELD_NUMBER: _ClassVar[int]
    DID_YOU_MEAN_FIELD_NUMBER: _ClassVar[int]
    FOUND_FIELD_NUMBER: _ClassVar[int]
    KNOWN_WORDS_FIELD_NUMBER: _ClassVar[int]
    MODEL_FIELD_NUMBER: _ClassVar[int]
    SOURCE_APPEARANCE: FindSegmentsResponse.Source
    SOURCE_DETECTOR: FindSegmentsResponse.Source
    SOURCE_FIELD_NUMBER: _ClassVar[int]
    SOURCE_LABELS: FindSegmentsResponse.Source
    SOURCE_TEXT_COMMAND: FindSegmentsResponse.Source
    SOURCE_UNSPECIFIED: FindSegmentsResponse.Source
    TIMING_FIELD_NUMBER: _ClassVar[int]
    best_score: float
    best_word: str
    did_you_mean: _containers.RepeatedScalarFieldContainer[str]
    found: _containers.RepeatedCompositeFieldContainer[FindSegmentsResponse.Found]
    known_words: _containers.RepeatedScalarFieldContainer[str]
    model: str
    source: FindSegmentsResponse.Source
    timing: _timing_pb2.QueryTiming
    def __init__(self, found: _Optional[_Iterable[_Union[FindSegmentsResponse.Found, _Mapping]]] = ..., source: _Optional[_Union[FindSegmentsResponse.Source, str]] = ..., best_score: _Optional[float] = ..., best_word: _Optional[str] = ..., did_you_mean: _Optional[_Iterable[str]] = ..., known_words: _Optional[_Iterable[str]] = ..., timing: _Optional[_Union[_timing_pb2.QueryTiming, _Mapping]] = ..., model: _Optional[str] = ...) -> None: ...
