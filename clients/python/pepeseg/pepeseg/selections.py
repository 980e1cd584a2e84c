"""Selections: Gaussians in 3D that a prompt in 2D means, and their unions and differences."""

from __future__ import annotations

from typing import Any

from pepeseg import prompts
from pepeseg.calls import Place, Steps, Unary, all_pages, new_request_id
from pepeseg.cameras import Viewpoint
from pepeseg.errors import refused
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
