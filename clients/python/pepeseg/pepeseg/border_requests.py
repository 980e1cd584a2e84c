"""Requests with borders by SAM: many views are requested a few at a time.

SAM takes one to two seconds for a new view. The server takes at most 100 views per request, and a
call ends after CALL_SECONDS.
"""

from __future__ import annotations

from pepeseg import cameras
from pepeseg.calls import Place, Steps, Unary
from pepeseg.v1 import segmentation_service_pb2, timing_pb2

VIEWS_AT_ONCE = 8

_Request = segmentation_service_pb2.SegmentViewsRequest
_Response = segmentation_service_pb2.SegmentViewsResponse


def _target_views(at: Place, targets: _Request.Targets) -> Steps[list[str]]:
    """Returns the names of the views, each once; none for the prompt's view."""
    if targets.group == targets.GROUP_UNSPECIFIED:
        return list(dict.fromkeys(targets.views))
    views = yield from cameras.views(at)
    return [view.name for view in views if targets.group == targets.GROUP_ALL or view.held_out]


def _add_timing(total: timing_pb2.QueryTiming, more: timing_pb2.QueryTiming) -> None:
    for step in ("queue", "load", "compute", "encode"):
        duration = getattr(total, step)
        duration.FromTimedelta(duration.ToTimedelta() + getattr(more, step).ToTimedelta())


def segment_with_sam(at: Place, request: _Request) -> Steps[_Response]:
    """Calls SegmentViews for VIEWS_AT_ONCE views at a time, and returns one response for all.

    The model that answered first answers for all views: a new training does not mix its masks with
    those of the old one.
    """
    views = yield from _target_views(at, request.targets)
    if len(views) <= VIEWS_AT_ONCE:
        response: _Response = yield Unary("segmentation", "SegmentViews", request, at.scene)
        return response
    whole = _Response()
    for first in range(0, len(views), VIEWS_AT_ONCE):
        piece = _Request()
        piece.CopyFrom(request)
        piece.model = whole.model or request.model
        piece.targets.Clear()
        piece.targets.views.extend(views[first : first + VIEWS_AT_ONCE])
        answer = yield Unary("segmentation", "SegmentViews", piece, at.scene)
        if first == 0:
            whole.CopyFrom(answer)
            continue
        whole.masks.extend(answer.masks)
        _add_timing(whole.timing, answer.timing)
        if answer.HasField("box_agreement"):
            whole.box_agreement = answer.box_agreement
    return whole
