"""Labels: names for what masks show, which can be segmented in any view."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from pepeseg import prompts, rle
from pepeseg.calls import Place, Steps, Unary, all_pages, new_request_id
from pepeseg.cameras import View
from pepeseg.segmentation import segment
from pepeseg.v1 import label_service_pb2, prompt_pb2


@dataclass(frozen=True, eq=False)
class Label:
    """A name for what a mask shows.

    Attributes:
        id: for `segment(label=...)`.
        text: its text, for people.
        view: name of its mask's view.
        area: pixels in the mask.
        mask: bool [height, width]; None in lists.
    """

    id: str
    text: str
    view: str
    area: int
    mask: npt.NDArray[np.bool_] | None


def _parse(message: label_service_pb2.Label) -> Label:
    has_mask = message.mask.WhichOneof("image") == "rle"
    return Label(
        id=message.name.rpartition("/")[2],
        text=message.text,
        view=message.view,
        area=message.area,
        mask=rle.decode(message.mask.rle) if has_mask else None,
    )


def label(
    at: Place,
    id: str,
    view: str | View,
    *,
    scale: float | None = None,
    scale_units: float | None = None,
    threshold: float | None = None,
    text: str = "",
    frame: str = "photograph",
    **what: Any,
) -> Steps[Label]:
    """Names what a mask of a view shows.

    Args:
        id: 1 to 63 of a-z, A-Z, 0-9, '_', '.' and '-', beginning with a letter or a digit.
        view: name of a view of the live model.
        what: mask=[height, width] of the frame's size, not 0 inside; or any other prompt, of which
            `Client.segment` makes the mask.
        scale, scale_units, threshold, frame: as in `Client.segment`.
        text: its text, at most 256 bytes of UTF-8; empty: the id.

    Raises:
        AlreadyExistsError: the scene has a label of this id.
        FailedPreconditionError: the scene has no model yet.
        InvalidArgumentError: no such view, or a mask that is empty or not of the frame's size; and
            the cases of `Client.segment`.
    """
    name = view.name if isinstance(view, View) else view
    mask = what.get("mask")
    if mask is None:
        found = yield from segment(
            at,
            name,
            scale=scale,
            scale_units=scale_units,
            threshold=threshold,
            frame=frame,
            **what,
        )
        mask = found.mask
    image = prompt_pb2.MaskImage(rle=rle.encode(mask))
    request = label_service_pb2.CreateLabelRequest(
        parent=at.scene,
        label_id=id,
        label=label_service_pb2.Label(text=text, view=name, mask=image),
        request_id=new_request_id(),
        frame=prompts.pixel_frame(frame),
    )
    answer = yield Unary("labels", "CreateLabel", request, at.scene)
    return _parse(answer)


def get_label(at: Place, id: str, *, frame: str = "photograph") -> Steps[Label]:
    """Returns a label with its mask, as the live model's view has it.

    Args:
        frame: the pixels of the mask, as in `Client.segment`.

    Raises:
        NotFoundError: no such label.
        FailedPreconditionError: the live model does not have the label's view.
    """
    request = label_service_pb2.GetLabelRequest(
        name=f"{at.scene}/labels/{id}", frame=prompts.pixel_frame(frame)
    )
    return _parse((yield Unary("labels", "GetLabel", request, at.scene)))


def list_labels(at: Place) -> Steps[list[Label]]:
    """Lists the labels of the scene, by id, without their masks."""
    request = label_service_pb2.ListLabelsRequest(parent=at.scene)
    found = yield from all_pages("labels", "ListLabels", request, "labels", at.scene)
    return [_parse(message) for message in found]


def delete_label(at: Place, id: str) -> Steps[None]:
    """Deletes a label.

    Raises:
        NotFoundError: no such label.
    """
    request = label_service_pb2.DeleteLabelRequest(name=f"{at.scene}/labels/{id}")
    yield Unary("labels", "DeleteLabel", request, at.scene, repeatable=False)
