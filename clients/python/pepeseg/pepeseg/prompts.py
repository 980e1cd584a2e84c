"""Prompts (points, scribbles, a box, a mask, a label), and the size of the thing that is meant."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Union

import numpy as np
import numpy.typing as npt

from pepeseg import rle
from pepeseg.cameras import View, Viewpoint, to_viewpoint
from pepeseg.errors import refused
from pepeseg.v1 import prompt_pb2, segmentation_service_pb2

# The views that masks are wanted for. None: the prompt's view; "all", "held-out", or views' names.
Targets = Union[None, str, View, Iterable[Union[str, View]]]


def _to_points(points: npt.ArrayLike, name: str) -> npt.NDArray[np.float64]:
    """Returns points as [n, 2]; a single point may be [2]."""
    array = np.asarray(points, np.float64)
    if array.size == 0:
        return np.zeros((0, 2))
    if array.ndim == 1:
        array = array[None]
    if array.ndim != 2 or array.shape[1] != 2:
        raise refused(f"{name}: [n, 2] pixels (x, y) is wanted, this is {list(array.shape)}")
    return array


def _points_prompt(
    points: npt.ArrayLike, name: str, negative: npt.ArrayLike | None = None
) -> prompt_pb2.PointsPrompt:
    prompt = prompt_pb2.PointsPrompt()
    for x, y in _to_points(points, name):
        prompt.points.add(x=x, y=y)
    for x, y in _to_points([] if negative is None else negative, "negative"):
        prompt.points.add(x=x, y=y, negative=True)
    return prompt


def _box_prompt(box: Sequence[float]) -> prompt_pb2.BoxPrompt:
    values = np.asarray(box, np.float64)
    if values.shape != (4,):
        raise refused(f"box: x, y, width, height is wanted, this is {list(values.shape)}")
    x, y, width, height = values
    return prompt_pb2.BoxPrompt(x=x, y=y, width=width, height=height)


# Lines: each [n, 2]; or one line.
Lines = Union[None, Sequence[npt.ArrayLike], npt.NDArray[np.floating[Any]]]


def _to_lines(lines: Lines) -> list[Any]:
    if lines is None or len(lines) == 0:
        return []
    return [lines] if np.ndim(lines[0]) == 1 else list(lines)


# The fields of a Prompt of which exactly one is given.
_KINDS = ("points", "scribble", "box", "mask", "label", "point_mean", "strokes")


@dataclass(frozen=True, eq=False)
class Prompt:
    """What is meant: in a view, exactly one of points, scribble, box, mask, label, point_mean and
    strokes. Operations take its fields as keywords, too.

    Attributes:
        view: the prompt's view: its name or a Camera. None with a label, which has its own.
        points: [n, 2], x and y in pixels of the frame, a pixel's centre at + 0.5; or one point [2].
        negative: [n, 2], points of what is not meant, next to `points`.
        previous_mask: [height, width] of the frame's size, not 0 inside: the answer to all points
            but the last, or any other mask, which then only the last point corrects; points of
            `negative` come last. Next to `points`, which may be empty.
        scribble: lines over what is meant: each [n, 2], its vertices in pixels; or one line.
        not_scribble: lines over what is not meant, next to `scribble`.
        stroke_width: width of these lines, pixels; 0: thin.
        box: x, y, width, height in pixels, around what is meant.
        mask: [height, width] of the frame's size, not 0 inside.
        label: id of a label of the scene. In its own view the answer of `segment` is its mask,
            unless a scale or a threshold is given.
        point_mean: [n, 2]: means what is similar to the mean feature of these points.
        strokes: [height, width] of the frame's size, not 0 on strokes over what is meant.
        not_strokes: the same for what is not meant, next to `strokes`.
    """

    view: Viewpoint | None = None
    points: npt.ArrayLike | None = None
    negative: npt.ArrayLike | None = None
    previous_mask: npt.ArrayLike | None = None
    scribble: Lines = None
    not_scribble: Lines = None
    stroke_width: float = 0
    box: Sequence[float] | None = None
    mask: npt.ArrayLike | None = None
    label: str | None = None
    point_mean: npt.ArrayLike | None = None
    strokes: npt.ArrayLike | None = None
    not_strokes: npt.ArrayLike | None = None

    def _check(self) -> None:
        given = [name for name in _KINDS if getattr(self, name) is not None]
        if len(given) != 1:
            found = " and ".join(given) or "none of them"
            raise refused(f"exactly one of {', '.join(_KINDS)} is wanted, not {found}")
        for name, of in (
            ("previous_mask", "points"),
            ("negative", "points"),
            ("not_scribble", "scribble"),
            ("not_strokes", "strokes"),
        ):
            if getattr(self, name) is not None and getattr(self, of) is None:
                raise refused(f"{name} needs {of}")
        if (self.view is None) != (self.label is not None):
            raise refused("a label has its own view; all other prompts need one")

    def _scribbles(self) -> prompt_pb2.ScribblesPrompt:
        message = prompt_pb2.ScribblesPrompt()
        for lines, negative in ((self.scribble, False), (self.not_scribble, True)):
            for line in _to_lines(lines):
                stroke = message.strokes.add(negative=negative, width=self.stroke_width)
                for x, y in _to_points(line, "scribble"):
                    stroke.path.add(x=x, y=y)
        for mask, strokes in ((self.strokes, "positive"), (self.not_strokes, "negative")):
            if mask is not None:
                getattr(message, strokes).rle.CopyFrom(rle.encode(mask))
        return message

    def to_message(self) -> prompt_pb2.Prompt:
        """Returns the prompt as the contract has it; refuses one that has not exactly one kind."""
        self._check()
        message = prompt_pb2.Prompt()
        if self.view is not None:
            message.view.CopyFrom(to_viewpoint(self.view))
        if self.points is not None:
            message.points.CopyFrom(_points_prompt(self.points, "points", self.negative))
            if self.previous_mask is not None:
                message.points.previous_mask.rle.CopyFrom(rle.encode(self.previous_mask))
        elif self.point_mean is not None:
            message.point_mean.CopyFrom(_points_prompt(self.point_mean, "point_mean"))
        elif self.scribble is not None or self.strokes is not None:
            message.scribbles.CopyFrom(self._scribbles())
        elif self.box is not None:
            message.box.CopyFrom(_box_prompt(self.box))
        elif self.mask is not None:
            message.mask.rle.CopyFrom(rle.encode(self.mask))
        elif self.label is not None:
            message.label = self.label
        return message


def to_prompt(view: Viewpoint | Prompt | None, what: Mapping[str, Any]) -> Prompt:
    """Returns the prompt of an operation's first argument and its keywords `what`."""
    if not isinstance(view, Prompt):
        return Prompt(view, **what)
    if what:
        raise refused(f"{', '.join(what)}: put it into the Prompt")
    return view


def granularity(
    scale: float | None, scale_units: float | None, threshold: float | None
) -> prompt_pb2.Granularity:
    if scale is not None and scale_units is not None:
        raise refused("scale and scale_units exclude each other: give one of them")
    message = prompt_pb2.Granularity()
    if scale is not None:
        message.scale_quantile = scale
    if scale_units is not None:
        message.scale_units = scale_units
    if threshold is not None:
        message.threshold = threshold
    return message


_FRAMES = {
    "photograph": prompt_pb2.PIXEL_FRAME_PHOTOGRAPH,
    "view": prompt_pb2.PIXEL_FRAME_VIEW,
}


def pixel_frame(frame: str) -> prompt_pb2.PixelFrame:
    if frame not in _FRAMES:
        raise refused(f'frame "{frame}": one of {", ".join(_FRAMES)} is wanted')
    return _FRAMES[frame]


def targets(views: Targets) -> segmentation_service_pb2.SegmentViewsRequest.Targets | None:
    message = segmentation_service_pb2.SegmentViewsRequest.Targets()
    if views is None:
        return None
    if views == "all":
        message.group = message.GROUP_ALL
    elif views == "held-out":
        message.group = message.GROUP_HELD_OUT
    else:
        names = [views] if isinstance(views, (str, View)) else list(views)
        message.views.extend(view.name if isinstance(view, View) else view for view in names)
    return message
