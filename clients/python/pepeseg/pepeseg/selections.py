"""Selections: Gaussians in 3D that a prompt in 2D means, and their unions and differences."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from pepeseg import prompts
from pepeseg.calls import Place, Steps, Unary, all_pages, new_request_id
from pepeseg.cameras import Viewpoint
from pepeseg.errors import damaged, refused
from pepeseg.scenes import get_model
from pepeseg.subsets import (
    Segment,
    SelectionInfo,
    parse_selection,
    selection_name,
    to_segment_ref,
)
from pepeseg.v1 import selection_service_pb2

_OPERATIONS = {
    "union": selection_service_pb2.SET_OPERATION_UNION,
    "subtract": selection_service_pb2.SET_OPERATION_SUBTRACT,
    "intersect": selection_service_pb2.SET_OPERATION_INTERSECT,
}


def _to_operation(operation: str) -> Any:
    if operation not in _OPERATIONS:
        raise refused(f'operation "{operation}": one of {", ".join(_OPERATIONS)} is wanted')
    return _OPERATIONS[operation]


def select(
    at: Place,
    view: Viewpoint | prompts.Prompt | None = None,
    *,
    segment: Segment | None = None,
    scale: float | None = None,
    scale_units: float | None = None,
    threshold: float | None = None,
    num_views: int = 0,
    keep_disconnected: bool = False,
    base: SelectionInfo | int | str | None = None,
    operation: str = "union",
    sam_clicks: bool | None = None,
    name: str = "",
    frame: str = "photograph",
    **what: Any,
) -> Steps[SelectionInfo]:
    """Selects the Gaussians that a prompt means, by a vote of views, or those of a segment.

    Args:
        view, what, scale, scale_units, threshold, sam_clicks, frame: as in `Client.segment`.
        segment: a segment of `Client.decompose`, in place of a prompt.
        num_views: number of views that vote, 1 to 100; 0: the server chooses.
        keep_disconnected: keep Gaussians that are not connected with what the prompt shows.
        base: a selection of the same model to combine the new one with.
        operation: "union", "subtract" (the base without the new one) or "intersect".
        name: for people, at most 256 bytes of UTF-8.

    Returns:
        The selection, which is empty if nothing was found.

    Raises:
        InvalidArgumentError, NotFoundError, FailedPreconditionError, ResourceExhaustedError: as in
            `Client.segment`.
    """
    request = selection_service_pb2.CreateSelectionRequest(
        model=at.model,
        granularity=prompts.granularity(scale, scale_units, threshold),
        num_views=num_views,
        keep_disconnected=keep_disconnected,
        sam_clicks=sam_clicks,
        frame=prompts.pixel_frame(frame),
        display_name=name,
        request_id=new_request_id(),
    )
    if segment is None:
        request.prompt.CopyFrom(prompts.to_prompt(view, what).to_message())
    elif view is not None or what:
        raise refused("a segment takes the place of a view and a prompt")
    else:
        request.segment.CopyFrom(to_segment_ref(segment))
    if base is not None:
        request.base = selection_name(at, base)
        request.operation = _to_operation(operation)
    answer = yield Unary("selections", "CreateSelection", request, at.scene)
    return parse_selection(answer)


def _to_bits(chosen: npt.NDArray[Any], num_gaussians: int) -> bytes:
    """Returns the bits of GaussianBits for a mask [num_gaussians], or for indices [n]."""
    if chosen.ndim != 1:
        raise refused(f"gaussians: one dimension is wanted, this has {list(chosen.shape)}")
    if chosen.dtype == np.bool_:
        if chosen.size != num_gaussians:
            raise refused(
                f"gaussians: the mask has {chosen.size} values, the model {num_gaussians} Gaussians"
            )
        return np.packbits(chosen, bitorder="little").tobytes()
    if chosen.size and not np.issubdtype(chosen.dtype, np.integer):
        raise refused(f"gaussians: a bool mask or whole indices are wanted, these are {chosen.dtype}")
    if chosen.size and (chosen.min() < 0 or chosen.max() >= num_gaussians):
        raise refused(
            f"gaussians: indices from {chosen.min()} to {chosen.max()}; the model has those from 0 "
            f"to {num_gaussians - 1}"
        )
    member = np.zeros(num_gaussians, np.bool_)
    member[chosen.astype(np.int64)] = True
    return np.packbits(member, bitorder="little").tobytes()


def select_gaussians(
    at: Place,
    gaussians: npt.ArrayLike,
    *,
    base: SelectionInfo | int | str | None = None,
    operation: str = "union",
    name: str = "",
) -> Steps[SelectionInfo]:
    """Selects given Gaussians, which needs no masks in the training.

    Args:
        gaussians: a bool mask [num_gaussians], or indices [n] from 0, in the order of an exported
            PLY.
        base, operation, name: as in `select`.

    Raises:
        InvalidArgumentError: the mask is of another size, or the model has no such Gaussian.
        NotFoundError: no such selection.
        FailedPreconditionError: the scene has no model yet, or the base is of another model.
    """
    model = yield from get_model(at, at.model)
    request = selection_service_pb2.CreateSelectionRequest(
        model=model.name,
        gaussians=selection_service_pb2.GaussianBits(
            bits=_to_bits(np.asarray(gaussians), model.num_gaussians)
        ),
        display_name=name,
        request_id=new_request_id(),
    )
    if base is not None:
        request.base = selection_name(at, base)
        request.operation = _to_operation(operation)
    answer = yield Unary("selections", "CreateSelection", request, at.scene)
    return parse_selection(answer)


def gaussians(at: Place, selection: SelectionInfo | int | str) -> Steps[npt.NDArray[np.bool_]]:
    """Returns which Gaussians of its model a selection has: a bool mask [num_gaussians], in the
    order of an exported PLY.

    Raises:
        NotFoundError: no such selection.
        ResourceExhaustedError: the model has more than 30,000,000 Gaussians.
    """
    request = selection_service_pb2.GetSelectionRequest(
        name=selection_name(at, selection), want_gaussians=True
    )
    answer = yield Unary("selections", "GetSelection", request, at.scene)
    model = yield from get_model(at, answer.model)
    packed = np.frombuffer(answer.gaussians.bits, np.uint8)
    if packed.size != (model.num_gaussians + 7) // 8:
        raise damaged(f"{answer.name}: {packed.size} bytes for {model.num_gaussians} Gaussians")
    return np.unpackbits(packed, count=model.num_gaussians, bitorder="little").astype(np.bool_)


def combine(
    at: Place,
    first: SelectionInfo | int | str,
    operation: str,
    second: SelectionInfo | int | str,
) -> Steps[SelectionInfo]:
    """Makes a new selection of two; `first` is its base.

    Args:
        first, second: selections, their numbers or names.
        operation: "union", "subtract" (the first without the second) or "intersect".

    Raises:
        NotFoundError: no such selection.
        FailedPreconditionError: they are of different models.
    """
    request = selection_service_pb2.CombineSelectionsRequest(
        first=selection_name(at, first),
        second=selection_name(at, second),
        operation=_to_operation(operation),
        request_id=new_request_id(),
    )
    answer = yield Unary("selections", "CombineSelections", request, at.scene)
    return parse_selection(answer)


def undo(at: Place, selection: SelectionInfo | int | str) -> Steps[SelectionInfo]:
    """Returns the selection that this one was made from; this one stays until it is deleted.

    Raises:
        NotFoundError: no such selection.
        FailedPreconditionError: it was not made from another selection.
    """
    request = selection_service_pb2.UndoSelectionRequest(name=selection_name(at, selection))
    answer = yield Unary("selections", "UndoSelection", request, at.scene)
    return parse_selection(answer)


def get_selection(at: Place, selection: int | str) -> Steps[SelectionInfo]:
    """Returns a selection by its number or name.

    Raises:
        NotFoundError: no such selection.
    """
    request = selection_service_pb2.GetSelectionRequest(name=selection_name(at, selection))
    answer = yield Unary("selections", "GetSelection", request, at.scene)
    return parse_selection(answer)


def list_selections(at: Place) -> Steps[list[SelectionInfo]]:
    """Lists the selections of the scene, newest first."""
    request = selection_service_pb2.ListSelectionsRequest(parent=at.scene)
    found = yield from all_pages("selections", "ListSelections", request, "selections", at.scene)
    return [parse_selection(selection) for selection in found]


def delete_selection(at: Place, selection: SelectionInfo | int | str) -> Steps[None]:
    """Deletes a selection.

    Raises:
        NotFoundError: no such selection.
    """
    request = selection_service_pb2.DeleteSelectionRequest(name=selection_name(at, selection))
    yield Unary("selections", "DeleteSelection", request, at.scene, repeatable=False)
