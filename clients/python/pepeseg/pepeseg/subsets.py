"""Subsets of a model's Gaussians: segments and selections, and their pictures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Union

import numpy as np
import numpy.typing as npt

from pepeseg import png, prompts, rle
from pepeseg.calls import Place, Steps, Unary
from pepeseg.cameras import Viewpoint, to_viewpoint
from pepeseg.errors import refused
from pepeseg.v1 import (
    decomposition_pb2,
    geometry_pb2,
    prompt_pb2,
    render_service_pb2,
    selection_service_pb2,
)


@dataclass(frozen=True)
class Segment:
    """A segment of a decomposition.

    Attributes:
        id: 1, 2, ... within its level, the one with the most Gaussians first.
        level: index of its scale, ascending.
        parent: id of the segment of the next level that contains it; 0 on the last level.
        min, max: bounds of the Gaussians' means, x, y, z in scene units.
        scales: the scales that the decomposition was requested with.
    """

    id: int
    level: int
    parent: int
    num_gaussians: int
    min: tuple[float, ...]
    max: tuple[float, ...]
    scales: tuple[float, ...]


@dataclass(frozen=True)
class Level:
    """The segments of one scale. `num_unassigned`: number of Gaussians in none of them."""

    scale: float
    scale_units: float
    segments: tuple[Segment, ...]
    num_unassigned: int


@dataclass(frozen=True)
class Decomposition:
    """A decomposed model: each segment is completely in one segment of the next level."""

    levels: tuple[Level, ...]
    model: str


@dataclass
class SelectionInfo:
    """Selected Gaussians of a model. A selection never changes.

    Attributes:
        name: "scenes/{scene}/selections/{number}".
        model: name of its model.
        min, max: bounds of the Gaussians' means, x, y, z in scene units; empty: none is selected.
        base: name of the selection that it was made from, which undo returns; empty: none.
        display_name: for people; may be empty.
    """

    name: str
    model: str
    num_gaussians: int
    min: tuple[float, ...]
    max: tuple[float, ...]
    base: str
    display_name: str = ""


# A selection, its number or its name; or a segment. None: the whole model.
Subset = Union[None, SelectionInfo, int, str, Segment]

_CONTENTS = {
    "color": render_service_pb2.RenderViewRequest.CONTENT_COLOR,
    "depth": render_service_pb2.RenderViewRequest.CONTENT_DEPTH,
    "segments": render_service_pb2.RenderViewRequest.CONTENT_SEGMENTS,
    "features": render_service_pb2.RenderViewRequest.CONTENT_FEATURES,
}


def selection_name(at: Place, selection: SelectionInfo | int | str) -> str:
    if isinstance(selection, SelectionInfo):
        return selection.name
    text = str(selection)
    return text if "/" in text else f"{at.scene}/selections/{text}"


def to_segment_ref(segment: Segment) -> decomposition_pb2.SegmentRef:
    return decomposition_pb2.SegmentRef(scales=segment.scales, level=segment.level, id=segment.id)


def to_subset(at: Place, subset: Subset, without: bool) -> render_service_pb2.Subset:
    if subset is None and without:
        raise refused("without what? A selection or a segment is wanted")
    message = render_service_pb2.Subset(complement=without)
    if isinstance(subset, Segment):
        message.segment.CopyFrom(to_segment_ref(subset))
    elif subset is not None:
        message.selection = selection_name(at, subset)
    return message


def _to_tuple(point: geometry_pb2.Vector3) -> tuple[float, ...]:
    return (point.x, point.y, point.z)


def parse_selection(message: selection_service_pb2.Selection) -> SelectionInfo:
    return SelectionInfo(
        name=message.name,
        model=message.model,
        num_gaussians=message.num_gaussians,
        min=_to_tuple(message.box.min) if message.HasField("box") else (),
        max=_to_tuple(message.box.max) if message.HasField("box") else (),
        base=message.base,
        display_name=message.display_name,
    )


def _parse_level(index: int, message: Any, scales: tuple[float, ...]) -> Level:
    segments = tuple(
        Segment(
            id=segment.id,
            level=index,
            parent=segment.parent,
            num_gaussians=segment.num_gaussians,
            min=_to_tuple(segment.box.min),
            max=_to_tuple(segment.box.max),
            scales=scales,
        )
        for segment in message.segments
    )
    return Level(message.scale_quantile, message.scale_units, segments, message.num_unassigned)


def decompose(at: Place, scales: Sequence[float] = ()) -> Steps[Decomposition]:
    """Decomposes the model into segments at several scales.

    Args:
        scales: quantiles, [0, 1], ascending, at most 8; empty: 0.01, 0.5 and 1, which are parts,
            objects and groups.

    Raises:
        InvalidArgumentError: scales out of range or not ascending.
        FailedPreconditionError: the scene has no model yet.
        UnavailableError: too many decompositions are waiting.
    """
    asked = tuple(float(scale) for scale in scales)
    request = decomposition_pb2.DecomposeModelRequest(model=at.model, scales=asked)
    answer = yield Unary("segmentation", "DecomposeModel", request, at.scene)
    levels = tuple(_parse_level(i, level, asked) for i, level in enumerate(answer.levels))
    return Decomposition(levels, answer.model)


def render(
    at: Place,
    view: Viewpoint,
    *,
    content: str = "color",
    of: Subset = None,
    without: bool = False,
    overlay: npt.ArrayLike | None = None,
    level: int = 0,
    scales: Sequence[float] = (),
    feature_scale: float = 0.0,
    frame: str = "photograph",
    max_side: int = 0,
) -> Steps[npt.NDArray[Any]]:
    """Renders the model, or a subset of it.

    Args:
        view: a view's name or a Camera.
        content: "color", "depth", "segments" or "features".
        of: what to render: a selection, its number or name, or a segment; None: all.
        without: render all other Gaussians in its place.
        overlay: mask [height, width] of the frame's size or the picture's, which "color" shows
            tinted and outlined.
        level, scales: for "segments", as in `decompose`.
        feature_scale: for "features", a quantile, [0, 1].
        frame: as in `segment`.
        max_side: maximum of the picture's longer side, pixels; a larger picture is shrunk. 0: the
            frame's size, but at most 2 megapixels.

    Returns:
        "color" and "features": uint8 [height, width, 3], RGB. "depth": float32 [height, width],
        scene units along the optical axis, 0 where hardly anything is rendered. "segments": uint16
        [height, width], the id of the segment, 0 where there is none.

    Raises:
        InvalidArgumentError: an unknown view or content, or a value out of range.
        NotFoundError: no such selection.
        FailedPreconditionError: the scene has no model yet.
    """
    if content not in _CONTENTS:
        raise refused(f'content "{content}": one of {", ".join(_CONTENTS)} is wanted')
    request = render_service_pb2.RenderViewRequest(
        model=at.model,
        viewpoint=to_viewpoint(view),
        content=_CONTENTS[content],
        subset=to_subset(at, of, without),
        decomposition_scales=scales,
        level=level,
        feature_scale=feature_scale,
        frame=prompts.pixel_frame(frame),
        max_side=max_side,
    )
    if overlay is not None:
        request.overlay_mask.CopyFrom(prompt_pb2.MaskImage(rle=rle.encode(overlay)))
    answer = yield Unary("rendering", "RenderView", request, at.scene)
    pixels = png.decode(answer.png)
    return (pixels * np.float32(answer.depth_unit)) if content == "depth" else pixels
