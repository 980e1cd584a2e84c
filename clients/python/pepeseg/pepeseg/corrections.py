"""Corrections: masks of a thing teach the model what it is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy.typing as npt

from pepeseg import prompts, rle
from pepeseg.calls import Place, Steps, Unary
from pepeseg.cameras import Viewpoint, to_viewpoint
from pepeseg.v1 import prompt_pb2, segmentation_service_pb2


@dataclass(frozen=True)
class CorrectedMask:
    """How well a mask is found by the query that fits all masks best.

    Attributes:
        view: name of the view; empty: a camera.
        iou_before, iou_after: of the model that was corrected, and of the new one.
    """

    view: str
    iou_before: float
    iou_after: float


@dataclass(frozen=True)
class Correction:
    """A corrected model.

    Attributes:
        model: name of the new model, which is live; that of `corrected_from` if no change finds the
            masks better: then no model is made.
        corrected_from: name of the model that was corrected. `client.of(scene,
            model=corrected_from).make_live()` undoes the correction.
        scores: one for each mask, in the order of the request.
        scale, scale_units, threshold: at which the thing is found.
        num_changed: Gaussians whose feature has changed.
    """

    model: str
    corrected_from: str
    scores: tuple[CorrectedMask, ...]
    scale: float
    scale_units: float
    threshold: float
    num_changed: int


def correct(
    at: Place,
    masks: Mapping[Viewpoint, npt.ArrayLike],
    *,
    scale: float | None = None,
    frame: str = "photograph",
) -> Steps[Correction]:
    """Teaches the model what one thing is, so that it is found as the masks show it in other views
    and by clicks, too. Makes a new model, which becomes the live one; the former stays.

    Args:
        masks: the thing's mask [height, width] of the frame's size in each of 1 to 16 views: all
            that the view shows of it.
        scale: size of the thing, [0, 1]; None: where the model fits the masks best.
        frame: as in `segment`.

    Raises:
        InvalidArgumentError: a view is unknown, a mask is empty, covers all or shows nothing with a
            feature, or two masks contradict each other.
        FailedPreconditionError: the scene has no model yet, or the model has no features.
        ResourceExhaustedError: the project has no space for the model.
    """
    request = segmentation_service_pb2.CorrectSegmentRequest(
        model=at.model, frame=prompts.pixel_frame(frame)
    )
    if scale is not None:
        request.granularity.CopyFrom(prompts.granularity(scale, None, None))
    for view, mask in masks.items():
        request.corrections.add(
            view=to_viewpoint(view), mask=prompt_pb2.MaskImage(rle=rle.encode(mask))
        )
    answer = yield Unary(
        "segmentation", "CorrectSegment", request, at.scene, repeatable=False
    )
    return Correction(
        model=answer.model,
        corrected_from=answer.corrected_from,
        scores=tuple(
            CorrectedMask(score.view, score.iou_before, score.iou_after)
            for score in answer.scores
        ),
        scale=answer.scale_quantile,
        scale_units=answer.scale_units,
        threshold=answer.threshold,
        num_changed=answer.num_changed,
    )
