"""Segmentation: masks of what a prompt means, and proposals of what a click may mean."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from pepeseg import prompts, rle
from pepeseg.border_requests import segment_with_sam
from pepeseg.calls import Place, Steps, Unary
from pepeseg.cameras import Viewpoint
from pepeseg.enum_words import stage_name
from pepeseg.errors import damaged
from pepeseg.v1 import label_service_pb2, prompt_pb2, segmentation_service_pb2


@dataclass(frozen=True, eq=False)
class ViewMask:
    """The mask of what is meant, in one view.

    Attributes:
        view: name of the view; empty: the request's camera.
        mask: bool [height, width], in the requested frame.
        score: mean similarity (cosine) inside the mask; 0 when it is empty.
        box: x, y, width, height of the mask, pixels; all 0 when it is empty.
        area: pixels in the mask.
        similarity: float32 [height, width], cosine, if it was requested; else None.
    """

    view: str
    mask: npt.NDArray[np.bool_]
    score: float
    box: tuple[int, int, int, int]
    area: int
    similarity: npt.NDArray[np.float32] | None = None


@dataclass(frozen=True)
class Timing:
    """How long the server took, by step, seconds."""

    queue: float
    load: float
    compute: float
    encode: float


@dataclass(frozen=True)
class Snapshot:
    """The state of a model in training.

    Attributes:
        job: name of the job.
        stage: stage that trained the state: "features", or "reconstruct" before that, where finer
            things may be missing.
        step: number of steps of that stage that were done.
        num_steps: number of steps of that stage.
    """

    job: str
    stage: str
    step: int
    num_steps: int


@dataclass(frozen=True, eq=False)
class Segmentation:
    """Masks, and the scale and threshold that were used.

    Attributes:
        masks: one for each view, in the order of the request; for "all" and "held-out" in the order
            of `views()`.
        scale: the quantile used, [0, 1]: 0 is a small part, 1 the largest.
        scale_units: the same as a length in scene units.
        threshold: cosine above which a pixel is in the mask.
        model: name of the model that answered.
        box_agreement: for a box whose own view was asked for, the IoU of the box and the bounding
            box of what fits it best, which is then cut to the box; under 0.5 the model shows
            nothing that fills the box. Else None.
        snapshot: the state that has answered, where the client's model is a job in training
            ("jobs/j3"). Else None.
    """

    masks: tuple[ViewMask, ...]
    scale: float
    scale_units: float
    threshold: float
    timing: Timing
    model: str
    box_agreement: float | None = None
    snapshot: Snapshot | None = None

    @property
    def mask(self) -> npt.NDArray[np.bool_]:
        """The mask of the first requested view: bool [height, width]."""
        return self.masks[0].mask


@dataclass(frozen=True, eq=False)
class Proposal:
    """Something that a click may mean. `segment` with `scale` and `threshold` returns its mask.

    Attributes:
        support: share of all scales and thresholds that give this mask, (0, 1].
        stability: mean IoU of the masks of neighbouring scales and thresholds, [0, 1].
        mask: bool [height, width], in the prompt's view.
        score, box, area: as in ViewMask.
        kind: "part", "object" or "group" by its position among the proposals; "" if it is the only
            one.
        best: whether it has the most support: `segment` without a scale returns it.
    """

    scale: float
    scale_units: float
    threshold: float
    support: float
    stability: float
    mask: npt.NDArray[np.bool_]
    score: float
    box: tuple[int, int, int, int]
    area: int
    kind: str = ""
    best: bool = False


_KINDS = {
    segmentation_service_pb2.ProposeScalesResponse.KIND_PART: "part",
    segmentation_service_pb2.ProposeScalesResponse.KIND_OBJECT: "object",
    segmentation_service_pb2.ProposeScalesResponse.KIND_GROUP: "group",
}


def _seconds(duration: Any) -> float:
    seconds: float = duration.seconds + duration.nanos * 1e-9
    return seconds


def _parse_similarity(message: Any) -> npt.NDArray[np.float32]:
    values = np.frombuffer(message.values, "<i2")
    if values.size != message.width * message.height:
        raise damaged(f"similarity of {message.width}x{message.height} has {values.size} values")
    return (values.reshape(message.height, message.width) / np.float32(32767)).astype(np.float32)


def parse_view_mask(message: segmentation_service_pb2.SegmentViewsResponse.ViewMask) -> ViewMask:
    box = message.box
    has_similarity = message.HasField("similarity")
    return ViewMask(
        view=message.view,
        mask=rle.decode(message.rle),
        score=message.score,
        box=(box.x, box.y, box.width, box.height),
        area=message.area,
        similarity=_parse_similarity(message.similarity) if has_similarity else None,
    )


def parse_segmentation(answer: segmentation_service_pb2.SegmentViewsResponse) -> Segmentation:
    timing = answer.timing
    state = answer.snapshot
    return Segmentation(
        masks=tuple(parse_view_mask(mask) for mask in answer.masks),
        scale=answer.scale_quantile,
        scale_units=answer.scale_units,
        threshold=answer.threshold,
        timing=Timing(
            _seconds(timing.queue),
            _seconds(timing.load),
            _seconds(timing.compute),
            _seconds(timing.encode),
        ),
        model=answer.model,
        box_agreement=answer.box_agreement if answer.HasField("box_agreement") else None,
        snapshot=(
            Snapshot(state.job, stage_name(state.stage), state.step, state.num_steps)
            if answer.HasField("snapshot")
            else None
        ),
    )


def segment(
    at: Place,
    view: Viewpoint | prompts.Prompt | None = None,
    *,
    scale: float | None = None,
    scale_units: float | None = None,
    threshold: float | None = None,
    targets: prompts.Targets = None,
    similarity: bool = False,
    refine_borders: bool = True,
    sam_borders: bool | None = None,
    sam_clicks: bool | None = None,
    frame: str = "photograph",
    **what: Any,
) -> Steps[Segmentation]:
    """Returns masks of what a prompt means.

    A scale or threshold that is not given is chosen: for the first point, that of a stable mask with
    the point in its middle, which each further point corrects; for a scribble in the same way;
    for a box or a mask the one that fits best.

    Args:
        view: the prompt; or its view, which is None for a label, next to the prompt's fields:
        what: points, negative, scribble, not_scribble, stroke_width, box, mask, label, ..., see
            Prompt.
        scale: size of the thing: 0 is a small part, 1 the largest.
        scale_units: the same as a length in scene units.
        threshold: cosine above which a pixel is in the mask, [-1, 1].
        targets: the views to segment: None for the prompt's view, "all", "held-out", or names.
        similarity: return similarity maps, too.
        refine_borders: decide the pixels along the borders of the masks by what is rendered there.
            False: a mask is exactly the pixels above the threshold.
        sam_borders: let the server's SAM place the borders of the masks, in the photographs where
            the server has them, else in the renderings. For real photographs; takes one to two
            seconds for a new view that the training has not kept. Many views are requested a few
            at a time if it is True. None: if the model was trained with SAM's masks and the server
            has SAM.
        sam_clicks: let the server's SAM and the model answer points or a box together: SAM sees
            them in the photograph of their view, and the other views follow. For points or a box
            without scale and threshold. Cost and None: as `sam_borders`.
        frame: the pixels of prompt and masks: "photograph", as it was uploaded, or "view", as it
            was trained on (undistorted, cropped, shrunk). A Camera has its own.

    Raises:
        InvalidArgumentError: a point is outside the frame or on nothing, a view is unknown, or a
            value is out of range.
        NotFoundError: no such scene, model or label.
        FailedPreconditionError: the scene has no model yet, or the server has no SAM for
            `sam_borders` or `sam_clicks`.
        ResourceExhaustedError: the model does not fit into memory, or the response exceeds 4 MiB:
            request fewer views.
    """
    prompt = prompts.to_prompt(view, what)
    request = segmentation_service_pb2.SegmentViewsRequest(
        model=at.model,
        prompt=prompt.to_message(),
        granularity=prompts.granularity(scale, scale_units, threshold),
        targets=prompts.targets(targets),
        mask_encoding=prompt_pb2.MASK_ENCODING_COCO_RLE,
        want_similarity=similarity,
        frame=prompts.pixel_frame(frame),
        refine_borders=refine_borders,
        sam_borders=sam_borders,
        sam_clicks=sam_clicks,
    )
    if sam_borders or sam_clicks:
        answer = yield from segment_with_sam(at, request)
    else:
        answer = yield Unary("segmentation", "SegmentViews", request, at.scene)
    found = parse_segmentation(answer)
    if prompt.label is None or (scale, scale_units, threshold) != (None, None, None):
        return found
    return (yield from _with_accepted_mask(at, prompt.label, found, request.frame))


def _with_accepted_mask(
    at: Place, label: str, found: Segmentation, frame: prompt_pb2.PixelFrame
) -> Steps[Segmentation]:
    """Returns the answer with the label's own mask in the label's own view."""
    request = label_service_pb2.GetLabelRequest(
        name=f"{at.scene}/labels/{label.rpartition('/')[2]}", frame=frame
    )
    accepted = yield Unary("labels", "GetLabel", request, at.scene)
    mask = rle.decode(accepted.mask.rle)
    masks = tuple(
        replace(each, mask=mask, area=int(mask.sum()), box=_box_of(mask))
        if each.view == accepted.view
        else each
        for each in found.masks
    )
    return replace(found, masks=masks)


def _box_of(mask: npt.NDArray[np.bool_]) -> tuple[int, int, int, int]:
    """Returns left, top, width and height of the mask; all 0 if it is empty."""
    columns, rows = np.flatnonzero(mask.any(axis=0)), np.flatnonzero(mask.any(axis=1))
    if rows.size == 0:
        return 0, 0, 0, 0
    return (
        int(columns[0]),
        int(rows[0]),
        int(columns[-1] - columns[0]) + 1,
        int(rows[-1] - rows[0]) + 1,
    )


def _parse_proposal(
    message: segmentation_service_pb2.ProposeScalesResponse.Proposal, best: bool
) -> Proposal:
    found = parse_view_mask(message.mask)
    return Proposal(
        scale=message.scale_quantile,
        scale_units=message.scale_units,
        threshold=message.threshold,
        support=message.support,
        stability=message.stability,
        mask=found.mask,
        score=found.score,
        box=found.box,
        area=found.area,
        kind=_KINDS.get(message.kind, ""),
        best=best,
    )


def propose(
    at: Place,
    view: Viewpoint | prompts.Prompt,
    *,
    max_proposals: int = 0,
    refine_borders: bool = True,
    frame: str = "photograph",
    **what: Any,
) -> Steps[list[Proposal]]:
    """Returns what a click may mean, smallest first: a part, the object that has it, a group.

    Each mask contains at least 95 % of the one before it and has at least 1.5 times its area; the
    scales do not decrease.

    Args:
        view, what: points, and `negative`; see Prompt.
        refine_borders, frame: as in `segment`.
        max_proposals: maximum number of proposals, 1 to 16; 0: the server's default.

    Returns:
        The proposals; none if nothing of at least 16 pixels is under the points.

    Raises:
        InvalidArgumentError, NotFoundError, FailedPreconditionError, ResourceExhaustedError: as in
            `segment`.
    """
    request = segmentation_service_pb2.ProposeScalesRequest(
        model=at.model,
        prompt=prompts.to_prompt(view, what).to_message(),
        max_proposals=max_proposals,
        mask_encoding=prompt_pb2.MASK_ENCODING_COCO_RLE,
        frame=prompts.pixel_frame(frame),
        refine_borders=refine_borders,
    )
    answer = yield Unary("segmentation", "ProposeScales", request, at.scene)
    return [
        _parse_proposal(proposal, i == answer.best) for i, proposal in enumerate(answer.proposals)
    ]
