"""Tests what edits and given Gaussians ask for. The first tests play the server."""

import asyncio
from concurrent import futures

import grpc
import numpy as np
import pytest

import pepeseg
from pepeseg import aio, edits, selections
from pepeseg.calls import Place, Receive
from pepeseg.v1 import (
    edit_service_pb2,
    edit_service_pb2_grpc,
    errors_pb2,
    scene_service_pb2,
    selection_service_pb2,
)

AT = Place("scenes/shelf", "scenes/shelf/models/live")
VIEW = "frame-000000.jpg"
POINT = [[440, 280]]


def play(steps, num_selected=7):
    """Runs an operation as a server with a model of 20 Gaussians. Returns its result and the
    requests."""
    requests = []
    result = None
    try:
        while True:
            step = steps.send(result)
            result = None
            requests.append(step.request)
            if step.method == "GetModel":
                result = scene_service_pb2.Model(name="scenes/shelf/models/3", num_gaussians=20)
            elif step.method == "CreateSelection":
                result = selection_service_pb2.Selection(
                    name="scenes/shelf/selections/5",
                    model="scenes/shelf/models/3",
                    num_gaussians=num_selected,
                    display_name=step.request.display_name,
                )
            elif step.method == "GetSelection":
                result = selection_service_pb2.Selection(name=step.request.name, model=AT.model)
                result.gaussians.bits = b"\x05\x00\x08"
            else:
                assert isinstance(step, Receive) and step.method == "EditModel"
                part = edit_service_pb2.EditModelResponse
                progress = part.Progress(activity="training", num_done=1, num_all=2)
                step.take(part(progress=progress))
                done = part.Result(model="m2", edited_from="m1", num_removed=9, num_added=3)
                step.take(part(result=done))
    except StopIteration as end:
        return end.value, requests


def request_of(steps):
    """Returns the only request."""
    _, (request,) = play(steps)
    return request


class TestEdits:
    def test_a_removal_fills_the_hole_and_reports(self):
        told = []
        edit, (request,) = play(edits.remove(AT, 4, on_progress=lambda *what: told.append(what)))
        assert request.model == AT.model and request.remove.fill
        assert request.subset.selection == "scenes/shelf/selections/4"
        assert not request.subset.complement
        assert told == [("training", 1, 2)]
        assert edit == pepeseg.Edit("m2", "m1", 9, 3, 0, "")
        assert not request_of(edits.remove(AT, 4, fill=False)).remove.fill

    def test_what_is_kept_is_not_removed(self):
        segment = pepeseg.Segment(3, 1, 0, 9, (), (), (0.1, 0.9))
        request = request_of(edits.keep(AT, segment))
        assert request.WhichOneof("edit") == "remove" and not request.remove.fill
        assert request.subset.complement
        assert (request.subset.segment.level, request.subset.segment.id) == (1, 3)

    def test_a_prompt_is_selected_first(self):
        prompt = pepeseg.Prompt(VIEW, points=POINT)
        _, (wanted, request) = play(edits.remove(AT, prompt))
        assert wanted.prompt.view.view == VIEW
        assert request.subset.selection == "scenes/shelf/selections/5"
        assert request.model == "scenes/shelf/models/3"  # another model may be live by now
        with pytest.raises(pepeseg.InvalidArgumentError, match="no Gaussians"):
            play(edits.remove(AT, prompt), num_selected=0)

    def test_a_move_has_its_parts(self):
        move = request_of(edits.move(AT, 1, by=[1, 2.5, -3])).move
        assert (move.translation.x, move.translation.y, move.translation.z) == (1, 2.5, -3)
        assert not move.HasField("rotation") and not move.HasField("pivot")
        assert move.scale == 0 and not move.copy
        move = request_of(edits.copy(AT, 1, scale=2, about=(0, 0, 1))).move
        assert move.copy and move.scale == 2 and move.pivot.z == 1
        assert not move.HasField("translation")

    def test_forms_of_a_rotation_agree(self):
        half = np.sqrt(0.5)
        quarter = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]  # x becomes y
        for rotate in (("z", 90), ["z", 90], (2 * half, 0, 0, 2 * half), quarter):
            q = request_of(edits.move(AT, 1, rotate=rotate)).move.rotation
            sign = np.sign(q.w)
            assert np.allclose([sign * q.w, q.x, q.y, sign * q.z], [half, 0, 0, half]), rotate

    def test_colors_are_hexadecimal_or_numbers(self):
        for color in ("#ff0080", "FF0080", (1, 0, 128 / 255)):
            recolor = request_of(edits.recolor(AT, 1, color, strength=0.5, without=True)).recolor
            assert (recolor.red, recolor.green, recolor.blue) == (1, 0, 128 / 255)
            assert recolor.strength == 0.5
        assert request_of(edits.recolor(AT, 1, "#000000", without=True)).subset.complement

    @pytest.mark.parametrize(
        ("steps", "why"),
        [
            (edits.remove(AT, None), "edit what"),
            (edits.move(AT, 1), "by, rotate or scale"),
            (edits.move(AT, 1, by=[1, 2]), "by: x, y, z"),
            (edits.move(AT, 1, by="right"), "by: x, y, z"),
            (edits.move(AT, 1, by=[1, 2, np.nan]), "by: x, y, z"),
            (edits.move(AT, 1, scale=0), "between 0.001 and 1000"),
            (edits.copy(AT, 1, scale=1, about=1), "about: x, y, z"),
            (edits.move(AT, 1, rotate=("up", 90)), "rotate: an axis"),
            (edits.move(AT, 1, rotate=(0, 0, 0, 0)), "rotate: an axis"),
            (edits.move(AT, 1, rotate=90), "rotate: an axis"),
            (edits.move(AT, 1, rotate=2 * np.eye(3)), "not a rotation"),
            (edits.recolor(AT, 1, "red"), "color: "),
            (edits.recolor(AT, 1, (255, 0, 0)), "color: "),
            (edits.recolor(AT, 1, (0, 0, 0), strength=0), "strength: "),
        ],
    )
    def test_wrong_arguments_are_refused_before_sending(self, steps, why):
        with pytest.raises(pepeseg.InvalidArgumentError, match=why):
            next(steps)


class BusyServer(edit_service_pb2_grpc.EditServiceServicer):
    """Puts off the first edit, before or after it has reported progress."""

    def __init__(self, late):
        self.calls = 0
        self._late = late
        self._server = grpc.server(futures.ThreadPoolExecutor(2))
        edit_service_pb2_grpc.add_EditServiceServicer_to_server(self, self._server)
        self.address = f"127.0.0.1:{self._server.add_insecure_port('127.0.0.1:0')}"
        self._server.start()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._server.stop(None)

    def EditModel(self, request, context):
        self.calls += 1
        part = edit_service_pb2.EditModelResponse
        if self._late:
            yield part(progress=part.Progress(activity="training", num_all=2))
        if self.calls == 1:
            info = errors_pb2.ErrorInfo(reason="BUSY", domain="pepeseg")
            retry = errors_pb2.RetryInfo()
            retry.retry_delay.FromMilliseconds(20)
            detail = errors_pb2.Status()
            for kind, message in (("ErrorInfo", info), ("RetryInfo", retry)):
                detail.details.add(
                    type_url=f"type.googleapis.com/google.rpc.{kind}",
                    value=message.SerializeToString(),
                )
            trailer = ("grpc-status-details-bin", detail.SerializeToString())
            context.set_trailing_metadata((trailer,))
            context.abort(grpc.StatusCode.UNAVAILABLE, "not now")
        yield part(result=part.Result(model="m2", num_removed=request.remove.fill))


class TestBusyServer:
    def remove(self, server, awaited):
        if not awaited:
            with pepeseg.Client("shelf", server=server.address) as client:
                return client.remove(1)

        async def body():
            async with aio.Client("shelf", server=server.address) as client:
                return await client.remove(1)

        return asyncio.run(body())

    @pytest.mark.parametrize("awaited", [False, True])
    def test_an_edit_that_was_put_off_is_repeated(self, awaited):
        with BusyServer(late=False) as server:
            assert self.remove(server, awaited).num_removed == 1
            assert server.calls == 2

    @pytest.mark.parametrize("awaited", [False, True])
    def test_an_edit_that_has_begun_is_not_repeated(self, awaited):
        with BusyServer(late=True) as server:
            with pytest.raises(pepeseg.UnavailableError):
                self.remove(server, awaited)
            assert server.calls == 1


@pytest.fixture
def edited(client):
    """Deletes the models that a test makes, and so makes the first one live again."""
    before = client.model().name
    yield
    for model in client.models():
        if model.edited_from:
            client.of("shelf", model=model.name).delete_model()
    assert client.model().name == before


@pytest.mark.usefixtures("edited")
class TestEditedModels:
    def test_a_thing_is_moved_on_and_the_edit_undone(self, client):
        cup = client.select(VIEW, points=POINT, threshold=0.5)
        edit = client.move(cup, by=[0.25, 0, 0])
        assert edit.edited_from == cup.model and edit.num_changed == cup.num_gaussians
        assert client.model().name == edit.model and client.model().edited_from == cup.model
        assert client.model().edit == f"moved {cup.num_gaussians} Gaussians"
        there = client.selection(edit.selection)
        assert there.num_gaussians == cup.num_gaussians
        assert np.allclose(there.min, np.add(cup.min, (0.25, 0, 0)), atol=1e-5)
        with pytest.raises(pepeseg.FailedPreconditionError):
            client.move(cup, by=[1, 0, 0])  # it is of the former model
        back = client.move(there, by=[-0.25, 0, 0])
        assert np.allclose(client.selection(back.selection).min, cup.min, atol=1e-5)
        client.of("shelf", model=cup.model).make_live()
        assert client.model().name == cup.model

    def test_a_removal_is_filled(self, client):
        count = client.model().num_gaussians
        told = []
        edit = client.remove(
            pepeseg.Prompt(VIEW, points=POINT), on_progress=lambda *what: told.append(what)
        )
        assert edit.num_removed > 0 and edit.num_added > 0
        assert client.model().num_gaussians == count - edit.num_removed + edit.num_added
        assert client.selection(edit.selection).num_gaussians == edit.num_added
        assert all(activity and 0 <= done <= every for activity, done, every in told) and told

    def test_all_else_is_removed(self, client):
        cup = client.select(VIEW, points=POINT, threshold=0.5)
        count = client.model().num_gaussians
        edit = client.keep(cup)
        assert edit.num_removed == count - cup.num_gaussians and edit.selection == ""
        assert client.model().num_gaussians == cup.num_gaussians

    def test_a_copy_is_added_and_recoloured(self, client):
        cup = client.select(VIEW, points=POINT, threshold=0.5)
        copied = client.copy(cup, by=[0, 0.2, 0], scale=0.5)
        assert (copied.num_added, copied.num_changed) == (cup.num_gaussians, 0)
        half = client.selection(copied.selection)
        size = np.subtract(cup.max, cup.min)
        assert np.allclose(np.subtract(half.max, half.min), size / 2, atol=1e-4)
        before = client.render(VIEW, of=half).astype(float)
        red = client.recolor(half, "#ff0000")
        after = client.render(VIEW, of=red.selection).astype(float)
        shown = before.sum(axis=2) > 60
        assert shown.any()
        assert after[shown][:, 0].mean() > 2 * after[shown][:, 1:].mean()

    def test_errors_name_the_field(self, client):
        nothing = client.select_gaussians([])
        with pytest.raises(pepeseg.InvalidArgumentError) as error:
            client.remove(nothing)
        assert error.value.field == "subset"
        everything = client.select_gaussians(np.ones(client.model().num_gaussians, bool))
        with pytest.raises(pepeseg.InvalidArgumentError):
            client.remove(everything)
        with pytest.raises(pepeseg.NotFoundError):
            client.remove(999)


class TestGivenGaussians:
    def test_a_mask_and_indices_are_the_same_bits(self):
        mask = np.zeros(20, bool)
        mask[[0, 2, 19]] = True
        for given in (mask, mask.tolist(), [19, 2, 0, 2], np.array([0, 2, 19], np.uint8)):
            made, (_, request) = play(selections.select_gaussians(AT, given, name="three"))
            assert request.gaussians.bits == b"\x05\x00\x08"
            assert request.model == "scenes/shelf/models/3"
            assert made.display_name == "three"
        _, (_, request) = play(selections.select_gaussians(AT, []))
        assert request.gaussians.bits == bytes(3)
        _, (_, request) = play(selections.select_gaussians(AT, [1], base=4, operation="subtract"))
        assert request.base == "scenes/shelf/selections/4"
        assert request.operation == selection_service_pb2.SET_OPERATION_SUBTRACT

    def test_bits_become_a_mask_of_the_models_size(self):
        mask, (request, _) = play(selections.gaussians(AT, 2))
        assert request.want_gaussians
        assert mask.dtype == np.bool_ and mask.shape == (20,)
        assert np.flatnonzero(mask).tolist() == [0, 2, 19]

    @pytest.mark.parametrize(
        ("given", "why"),
        [
            (np.ones(19, bool), "19 values, the model 20"),
            ([0, 20], "from 0 to 20; .* from 0 to 19"),
            ([-1], "from -1"),
            ([0.5], "whole indices"),
            ([[1]], "one dimension"),
        ],
    )
    def test_others_are_refused_before_sending(self, given, why):
        with pytest.raises(pepeseg.InvalidArgumentError, match=why):
            play(selections.select_gaussians(AT, given))

    def test_the_server_keeps_them(self, client, tmp_path):
        count = client.model().num_gaussians
        mask = np.zeros(count, bool)
        mask[::3] = True
        made = client.select_gaussians(mask, name="every third")
        assert (made.num_gaussians, made.display_name) == (mask.sum(), "every third")
        assert np.array_equal(made.gaussians(), mask)
        assert client.selection(made.name).display_name == "every third"
        assert "every third" in [each.display_name for each in client.selections()]
        less = client.select_gaussians([0, 3], base=made, operation="subtract")
        assert less.num_gaussians == mask.sum() - 2
        clicked = client.select(VIEW, points=POINT, threshold=0, name="cup")
        assert clicked.display_name == "cup"
        assert clicked.gaussians().sum() == clicked.num_gaussians
        # The order is that of the exported PLY.
        rows = []
        for path, of, num_rows in (
            (tmp_path / "all.ply", None, count),
            (tmp_path / "third.ply", made, made.num_gaussians),
        ):
            client.export(path, of)
            body = path.read_bytes().partition(b"end_header\n")[2]
            rows.append(np.frombuffer(body, np.uint8).reshape(num_rows, -1))
        assert np.array_equal(rows[0][mask], rows[1])
        for selection in (less, made, clicked):
            selection.delete()
