"""Tests how requests with borders by SAM are cut. The test plays the server, which needs no SAM."""

import pytest

from pepeseg.border_requests import VIEWS_AT_ONCE
from pepeseg.calls import Place
from pepeseg.segmentation import segment
from pepeseg.v1 import scene_service_pb2, segmentation_service_pb2

AT = Place("scenes/shelf", "scenes/shelf/models/live")
ALL = [f"{i:03}.jpg" for i in range(250)]
HELD_OUT = ALL[::8]


def answer_to(request):
    """Answers as a server whose live model is replaced after its first answer."""
    response = segmentation_service_pb2.SegmentViewsResponse(
        scale_quantile=0.4, threshold=0.7, model="scenes/shelf/models/3"
    )
    for view in request.targets.views:
        mask = response.masks.add(view=view, area=1)
        mask.rle.width, mask.rle.height, mask.rle.counts = 2, 2, "013"
    if "007.jpg" in request.targets.views:
        response.box_agreement = 0.9
    response.timing.compute.FromMilliseconds(1500 * len(request.targets.views))
    return response


def run(**arguments):
    """Returns the segmentation and the requests for it."""
    steps = segment(AT, "007.jpg", box=(0, 0, 2, 2), **arguments)
    requests = []
    result = None
    try:
        while True:
            step = steps.send(result)
            if step.method == "ListViews":
                result = scene_service_pb2.ListViewsResponse()
                for name in ALL:
                    view = result.views.add(view=name, held_out=name in HELD_OUT)
                    view.cam_from_world.rotation.w = 1
            else:
                requests.append(step.request)
                result = answer_to(step.request)
    except StopIteration as end:
        return end.value, requests


@pytest.mark.parametrize(
    ("targets", "views"),
    [("all", ALL), ("held-out", HELD_OUT), (ALL[::-1], ALL[::-1]), (ALL + ALL, ALL)],
)
def test_many_views_are_requested_a_few_at_a_time(targets, views):
    found, requests = run(targets=targets, sam_borders=True)
    assert [mask.view for mask in found.masks] == views
    assert all(len(request.targets.views) <= VIEWS_AT_ONCE <= 100 for request in requests)
    assert all(request.sam_borders and request.targets.group == 0 for request in requests)
    assert found.timing.compute == pytest.approx(1.5 * len(views))
    assert (found.scale, found.threshold) == (0.4, 0.7)
    assert found.box_agreement == (0.9 if "007.jpg" in views else None)


def test_clicks_by_sam_are_requested_a_few_views_at_a_time():
    found, requests = run(targets="all", sam_clicks=True)
    assert [mask.view for mask in found.masks] == ALL
    assert len(requests) > 1
    assert all(request.sam_clicks and not request.sam_borders for request in requests)


def test_the_model_that_answered_first_answers_for_all_views():
    found, requests = run(targets="all", sam_borders=True)
    later = {request.model for request in requests[1:]}
    assert (requests[0].model, later) == (AT.model, {"scenes/shelf/models/3"})
    assert found.model == "scenes/shelf/models/3"


def test_few_views_and_other_borders_are_one_request():
    _, requests = run(targets=ALL[:VIEWS_AT_ONCE], sam_borders=True)
    assert len(requests) == 1
    _, requests = run(targets="all")
    assert [request.targets.group for request in requests] == [requests[0].targets.GROUP_ALL]
    _, requests = run(sam_borders=True)
    assert len(requests) == 1 and not requests[0].targets.views
