"""Evaluation: scores of a model against the truth, by the protocols of the field's benchmarks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Union

import numpy as np
import numpy.typing as npt

from pepeseg import png, prompts, rle
from pepeseg.calls import Place, Steps, Unary
from pepeseg.errors import refused
from pepeseg.prompts import Prompt
from pepeseg.v1 import evaluation_service_pb2 as v1

# The truth of a view: ids [height, width], 0 for none, or a mask [height, width] for each entity.
Truth = Union[npt.NDArray[np.integer[Any]], Mapping[str, npt.ArrayLike]]

# A hundred entities take long on a CPU.
_EVALUATE_SECONDS = 3600.0

_PROTOCOLS = {
    "prompt": v1.EVALUATION_PROTOCOL_PROMPT,
    "label-propagation": v1.EVALUATION_PROTOCOL_LABEL_PROPAGATION,
    "label-propagation-pixels": v1.EVALUATION_PROTOCOL_LABEL_PROPAGATION_PIXELS,
    "promptable": v1.EVALUATION_PROTOCOL_PROMPTABLE,
    "clicks": v1.EVALUATION_PROTOCOL_CLICKS,
}


@dataclass(frozen=True)
class Scores:
    """Scores of a mask in one view, or their means, each in [0, 1].

    Attributes:
        accuracy: share of the view's pixels that are right, inside and outside.
        boundary_iou: IoU of the boundaries, 2 % of the image's diagonal wide.
    """

    iou: float
    accuracy: float
    boundary_iou: float


@dataclass(frozen=True)
class Choice:
    """A scale (quantile) and a threshold (cosine), with their scores in each scored view."""

    scale: float
    threshold: float
    mean: Scores
    views: dict[str, Scores]


@dataclass(frozen=True)
class SimulatedClick:
    """A click of the protocol, in pixels of the frame. `reference_iou` and `iou`, its mean over the
    scored views, are those of the answer to this click and all before it (protocol "clicks")."""

    x: float
    y: float
    negative: bool
    reference_iou: float
    iou: float


@dataclass(frozen=True)
class EntityScores:
    """The scores of an entity.

    Attributes:
        category: its name without its number.
        reference_view: the view with the prompt.
        num_pixels: pixels that show it in each scored view.
        missing: nothing is under the prompt; all scores are 0.
        paper: the choice with the best IoU in the scored views themselves: it used the truth that
            it is scored with, as published numbers do. Without refined borders it bounds the
            others.
        reference: chosen by the IoU in the reference view: of the protocol "prompt" the centre of
            what scores about best there, of the others the best; None if nothing is known there.
        automatic: the choice without any truth, as `segment` makes it.
        iou_by_scale: mean IoU at each of `Evaluation.scales` and the fixed threshold, without
            refined borders.
        reached, num_clicks: of the protocol "clicks", which makes no choices.
    """

    name: str
    category: str
    reference_view: str
    num_pixels: dict[str, int]
    clicks: tuple[SimulatedClick, ...]
    missing: bool
    paper: Choice | None
    reference: Choice | None
    automatic: Choice | None
    iou_by_scale: tuple[float, ...]
    reached: bool
    num_clicks: int


@dataclass(frozen=True)
class GroupScores:
    """Means over entities, each of which counts once. Attributes as in EntityScores.

    Attributes:
        name: the category; "" for all entities.
        reached: share of the entities.
        iou_after: mean IoU after 1, 2 and 3 clicks.
    """

    name: str
    num_entities: int
    paper: Scores | None
    reference: Scores | None
    automatic: Scores | None
    iou_by_scale: tuple[float, ...]
    num_clicks: float
    reached: float
    iou_after: tuple[float, ...]


@dataclass(frozen=True)
class Evaluation:
    """The scores of a model.

    Attributes:
        entities: those with a scored view, by name; `left_out` has the names of the others.
        categories: by name; `scene` is the mean over all entities.
        scales: those chosen from.
        options: all options used, a message of the contract.
        seconds: time of the evaluation on the server.
        num_void_pixels: pixels of the views that the ids of the truth mark as void; they were left
            out of all scores.
        notes: sentences on how the truth was read: which images were turned upright.
    """

    entities: dict[str, EntityScores]
    left_out: tuple[str, ...]
    categories: dict[str, GroupScores]
    scene: GroupScores
    scales: tuple[float, ...]
    options: v1.EvaluationOptions
    seconds: float
    model: str
    num_void_pixels: int
    notes: tuple[str, ...]


@dataclass(frozen=True)
class SamAgreement:
    """Agreement with SAM's masks.

    Attributes:
        num_masks: masks that count.
        first_iou: mean IoU of the proposal with the most support.
        best_iou: mean IoU of the best proposal, which is chosen by the mask it is scored with.
        views: the same of each view; empty in the views themselves.
    """

    num_masks: int
    first_iou: float
    best_iou: float
    views: dict[str, SamAgreement]


@dataclass(frozen=True, eq=False)
class SamMask:
    """A mask of SAM's, [height, width], not 0 inside, with SAM's own scores if they are known."""

    mask: npt.ArrayLike
    predicted_iou: float | None = None
    stability: float | None = None


def _ignore_png(ignore: Mapping[str, npt.ArrayLike] | npt.ArrayLike | None, view: str) -> bytes:
    mask = ignore.get(view) if isinstance(ignore, Mapping) else ignore
    return b"" if mask is None else png.encode(np.asarray(mask) != 0)


def _labels_png(view: str, labels: npt.NDArray[np.integer[Any]]) -> bytes:
    is_whole = labels.ndim == 2 and labels.dtype.kind in "iu"
    if not is_whole or labels.min() < 0 or labels.max() > 65535:
        raise refused(f"truth of {view}: ids [height, width] in 0..65535, or masks by entity")
    return png.encode(labels.astype(np.uint16))


def _fill_truth(view: str, truth: Truth, message: v1.ViewTruth) -> None:
    message.view = view
    if not isinstance(truth, Mapping):
        message.labels_png = _labels_png(view, np.asarray(truth))
        return
    for entity, mask in truth.items():
        message.masks.add(entity=entity).mask.rle.CopyFrom(rle.encode(mask))


def _scores(message: v1.EvaluateModelResponse.Scores) -> Scores:
    return Scores(message.iou, message.accuracy, message.boundary_iou)


def _choice(entity: v1.EvaluateModelResponse.Entity, name: str) -> Choice | None:
    if not entity.HasField(name):
        return None
    message = getattr(entity, name)
    views = {scored.view: _scores(s) for scored, s in zip(entity.views, message.views)}
    return Choice(message.scale_quantile, message.threshold, _scores(message.mean), views)


def _entity(message: v1.EvaluateModelResponse.Entity) -> EntityScores:
    return EntityScores(
        name=message.name,
        category=message.category,
        reference_view=message.reference_view,
        num_pixels={view.view: view.num_pixels for view in message.views},
        clicks=tuple(
            SimulatedClick(click.x, click.y, click.negative, click.reference_iou, click.iou)
            for click in message.clicks
        ),
        missing=message.missing,
        paper=_choice(message, "paper"),
        reference=_choice(message, "reference"),
        automatic=_choice(message, "automatic"),
        iou_by_scale=tuple(message.iou_by_scale),
        reached=message.reached,
        num_clicks=message.num_clicks,
    )


def _group(message: v1.EvaluateModelResponse.GroupScores) -> GroupScores:
    return GroupScores(
        name=message.name,
        num_entities=message.num_entities,
        paper=_scores(message.paper) if message.HasField("paper") else None,
        reference=_scores(message.reference) if message.HasField("reference") else None,
        automatic=_scores(message.automatic) if message.HasField("automatic") else None,
        iou_by_scale=tuple(message.iou_by_scale),
        num_clicks=message.num_clicks,
        reached=message.reached,
        iou_after=tuple(message.iou_after),
    )


def _parse_evaluation(answer: v1.EvaluateModelResponse) -> Evaluation:
    return Evaluation(
        entities={message.name: _entity(message) for message in answer.entities},
        left_out=tuple(answer.left_out),
        categories={message.name: _group(message) for message in answer.categories},
        scene=_group(answer.scene),
        scales=tuple(answer.options.scales),
        options=answer.options,
        seconds=answer.compute.seconds + answer.compute.nanos * 1e-9,
        model=answer.model,
        num_void_pixels=answer.num_void_pixels,
        notes=tuple(answer.notes),
    )


def _fill_options(given: Mapping[str, Any], message: v1.EvaluationOptions) -> None:
    """Sets options by their names in the contract: "min_pixels", "clicks.min_iou"."""
    for name, value in given.items():
        *path, last = name.split(".")
        target: Any = message
        for part in path:
            target = getattr(target, part, None)
        try:
            if isinstance(value, (list, tuple, np.ndarray)):
                getattr(target, last).extend(float(number) for number in value)
            else:
                setattr(target, last, value)
        except (AttributeError, TypeError, ValueError) as error:
            raise refused(f'option "{name}": {error}') from error


def evaluate(
    at: Place,
    truth: Mapping[str, Truth],
    *,
    protocol: str = "prompt",
    names: Mapping[int, str] | None = None,
    entity_prompts: Mapping[str, Prompt] | None = None,
    own_masks: Mapping[str, str] | None = None,
    ignore: Mapping[str, npt.ArrayLike] | npt.ArrayLike | None = None,
    ignore_label: int | None = None,
    trained_views: bool = False,
    score_reference: bool = False,
    options: Mapping[str, Any] | None = None,
    frame: str = "photograph",
) -> Steps[Evaluation]:
    """Scores the model against the truth of views.

    An entity is a part, an object or a group with one name in all views. Its prompt is in one view,
    its reference; it is scored in the others. Three scales and thresholds are scored next to each
    other: `automatic` (chosen without truth), `reference` (by the reference view) and `paper` (by
    the scored truth itself, as published numbers are).

    Args:
        truth: by view: ids [height, width], 0 for none, or a mask [height, width] by entity. Masks
            may overlap.
        protocol: "prompt" (one click for an entity without a prompt), "label-propagation",
            "label-propagation-pixels", "promptable" or "clicks".
        names: names of the ids; an id without one is named by its digits.
        entity_prompts: by entity; a reference view that the truth lacks is added.
        own_masks: reference views of the entities whose prompt is their mask in the truth.
        ignore: [height, width], for all views or by view: pixels that are not 0 are neither clicked
            nor scored.
        ignore_label: the id of void pixels in the truth, which are in no entity and not scored;
            None: 255 where it is the largest id of an array that has others as well, unless `names`
            has it.
        trained_views: accept views that the model was trained on.
        score_reference: score the reference view, too.
        options: further EvaluationOptions by name: {"scales": [0.1, 0.5], "clicks.min_iou": 0.85}.
        frame: the pixels of truth, prompts and clicks, as in `segment`.

    Raises:
        InvalidArgumentError: a view is unknown or was trained on, an image is not of the frame's
            size, a prompt does not fit its view, or an option is out of range.
        NotFoundError: no such scene, model or label.
        ResourceExhaustedError: the images exceed 8 MiB: evaluate fewer views at a time.
    """
    if protocol not in _PROTOCOLS:
        raise refused(f'protocol "{protocol}": one of {", ".join(_PROTOCOLS)} is wanted')
    request = v1.EvaluateModelRequest(model=at.model, frame=prompts.pixel_frame(frame))
    _fill_options(options or {}, request.options)
    request.options.protocol = _PROTOCOLS[protocol]
    request.options.accept_trained_views = trained_views
    request.options.score_reference = score_reference
    request.entity_names.update(names or {})
    if ignore_label is not None:
        request.ignore_label = ignore_label
    given = entity_prompts or {}
    for entity, prompt in given.items():
        request.prompts[entity].CopyFrom(prompt.to_message())
    request.own_masks.update(own_masks or {})
    references = [request.prompts[entity].view.view for entity in given]
    for view in dict.fromkeys([*truth, *filter(None, references)]):
        message = request.views.add()
        _fill_truth(view, truth.get(view, {}), message)
        message.ignore_png = _ignore_png(ignore, view)
    answer = yield Unary(
        "evaluation", "EvaluateModel", request, at.scene, seconds=_EVALUATE_SECONDS
    )
    return _parse_evaluation(answer)


def sam_agreement(
    at: Place,
    masks: Mapping[str, Sequence[SamMask]],
    *,
    ignore: Mapping[str, npt.ArrayLike] | npt.ArrayLike | None = None,
    trained_views: bool = False,
    options: Mapping[str, Any] | None = None,
    frame: str = "photograph",
) -> Steps[SamAgreement]:
    """Compares the answers to one click on each of SAM's masks with the masks, for scenes without
    labels.

    Args:
        masks: SAM's masks of held-out photographs, by view.
        options: {"min_stability": 0.95, ...}: fields of EvaluationOptions.SamAgreement by name.
        ignore, trained_views, frame: as in `evaluate`.

    Raises:
        InvalidArgumentError: as in `evaluate`, or no mask counts.
        NotFoundError: no such scene or model.
    """
    request = v1.EvaluateModelRequest(model=at.model, frame=prompts.pixel_frame(frame))
    _fill_options(
        {f"sam_agreement.{name}": value for name, value in (options or {}).items()},
        request.options,
    )
    request.options.protocol = v1.EVALUATION_PROTOCOL_SAM_AGREEMENT
    request.options.accept_trained_views = trained_views
    for view, of_view in masks.items():
        message = request.sam_views.add(view=view, ignore_png=_ignore_png(ignore, view))
        for given in of_view:
            mask = message.masks.add(predicted_iou=given.predicted_iou, stability=given.stability)
            mask.mask.rle.CopyFrom(rle.encode(given.mask))
    answer = yield Unary(
        "evaluation", "EvaluateModel", request, at.scene, seconds=_EVALUATE_SECONDS
    )
    found = answer.sam_agreement
    views = {
        view.view: SamAgreement(view.num_masks, view.first_iou, view.best_iou, {})
        for view in found.views
    }
    return SamAgreement(found.num_masks, found.first_iou, found.best_iou, views)
