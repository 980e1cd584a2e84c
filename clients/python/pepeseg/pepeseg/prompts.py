"""Prompts (points, a box, a mask or a label), and the size of the thing that is meant."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Union

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


def points_prompt(points: npt.ArrayLike, negative: npt.ArrayLike | None) -> prompt_pb2.PointsPrompt:
    prompt = prompt_pb2.PointsPrompt()
    for x, y in _to_points(points, "points"):
        prompt.points.add(x=x, y=y)
    for x, y in _to_points([] if negative is None else negative, "negative"):
        prompt.points.add(x=x, y=y, negative=True)
    return prompt


def box_prompt(box: Sequence[float]) -> prompt_pb2.BoxPrompt:
    values = np.asarray(box, np.float64)
    if values.shape != (4,):
        raise refused(f"box: x, y, width, height is wanted, this is {list(values.shape)}")
    x, y, width, height = values
    return prompt_pb2.BoxPrompt(x=x, y=y, width=width, height=height)


def prompt(
    view: Viewpoint | None,
    points: npt.ArrayLike | None,
    negative: npt.ArrayLike | None,
    box: Sequence[float] | None,
    mask: npt.ArrayLike | None,
    label: str | None,
) -> prompt_pb2.Prompt:
    """Returns the prompt of exactly one of points, box, mask and label; refuses anything else."""
    given = [
        name
        for name, value in (("points", points), ("box", box), ("mask", mask), ("label", label))
        if value is not None
    ]
    if len(given) != 1:
        found = " and ".join(given) or "none of them"
        raise refused(f"exactly one of points, box, mask and label is wanted, not {found}")
    if negative is not None and points is None:
        raise refused("negative points need points")
    if (view is None) != (label is not None):
        raise refused("a label has its own view; points, a box and a mask need one")
    message = prompt_pb2.Prompt()
    if view is not None:
        message.view.CopyFrom(to_viewpoint(view))
    if points is not None:
        message.points.CopyFrom(points_prompt(points, negative))
    elif box is not None:
        message.box.CopyFrom(box_prompt(box))
    elif mask is not None:
        message.mask.rle.CopyFrom(rle.encode(mask))
    elif label is not None:
        message.label = label
    return message


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
