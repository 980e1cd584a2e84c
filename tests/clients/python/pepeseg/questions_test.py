"""Tests queries of a model, with NumPy arrays."""

import itertools

import numpy as np
import pytest

import pepeseg

VIEW = "frame-000000.jpg"
POINT = [[440, 280]]  # of the photograph, 640x480; the model was trained on a quarter
POINT_IN_VIEW = [[110, 70]]


def iou(a, b):
    return np.logical_and(a, b).sum() / np.logical_or(a, b).sum()


class TestSegment:
    def test_a_click_is_a_bool_mask_of_the_photographs_size(self, client):
        found = client.segment(VIEW, points=POINT, threshold=0)
        assert found.mask.dtype == np.bool_
        assert found.mask.shape == (480, 640)
        assert found.mask[280, 440]
        only = found.masks[0]
        assert (only.view, only.area) == (VIEW, found.mask.sum())
        rows, columns = np.nonzero(found.mask)
        x, y, width, height = only.box
        assert (x, y) == (columns.min(), rows.min())
        assert (width, height) == (np.ptp(columns) + 1, np.ptp(rows) + 1)
        assert found.model == "scenes/shelf/models/1"
        assert 0 <= found.scale <= 1
        assert found.timing.compute > 0

    def test_the_pixels_of_the_view_are_another_frame(self, client):
        view = next(view for view in client.views() if view.name == VIEW)
        assert view.photograph_size == (640, 480)
        assert (view.camera.width, view.camera.height) == (160, 120)
        photograph = client.segment(VIEW, points=POINT, threshold=0.3, scale=0.3).mask
        small = client.segment(
            VIEW, points=POINT_IN_VIEW, threshold=0.3, scale=0.3, frame="view"
        ).mask
        assert small.shape == (120, 160)
        assert iou(photograph, small.repeat(4, axis=0).repeat(4, axis=1)) > 0.8
        with pytest.raises(pepeseg.InvalidArgumentError, match=r"outside view .*160x120"):
            client.segment(VIEW, points=POINT, frame="view")
        with pytest.raises(pepeseg.InvalidArgumentError, match="photograph, view"):
            client.segment(VIEW, points=POINT, frame="photo")

    def test_targets_are_names_or_a_group(self, client):
        held_out = [view.name for view in client.views() if view.held_out]
        assert len(held_out) >= 2
        in_group = client.segment(VIEW, points=POINT, threshold=0, targets="held-out")
        assert [mask.view for mask in in_group.masks] == held_out
        named = client.segment(VIEW, points=POINT, threshold=0, targets=reversed(held_out))
        assert [mask.view for mask in named.masks] == held_out[::-1]
        assert len(client.segment(VIEW, points=POINT, targets="all").masks) == 15

    def test_a_negative_point_is_not_in_the_mask(self, client):
        every = client.segment(VIEW, points=POINT, scale=1, threshold=-1).mask
        assert every[280, 440] and every[280, 280]
        less = client.segment(VIEW, points=POINT, negative=[280, 280], scale=1, threshold=-1).mask
        assert less[280, 440] and not less[280, 280]

    def test_a_point_corrects_a_previous_mask(self, client):
        every = np.ones((480, 640))
        less = client.segment(VIEW, points=[], negative=[280, 280], previous_mask=every).mask
        wrong = client.segment(VIEW, points=[[280, 280]]).mask
        assert wrong[280, 280] and not less[280, 280]
        assert np.logical_and(less, wrong).sum() < 0.1 * wrong.sum()
        assert less[160, 520]
        one = client.segment(VIEW, points=POINT)
        again = client.segment(VIEW, points=POINT + POINT, previous_mask=one.mask, sam_clicks=False)
        assert iou(again.mask, one.mask) > 0.97

    def test_a_mask_and_a_box_select_what_they_show(self, client):
        click = client.segment(VIEW, points=POINT, threshold=0.3, scale=0.3)
        by_mask = client.segment(VIEW, mask=click.mask)
        assert iou(by_mask.mask, click.mask) > 0.5
        by_box = client.segment(VIEW, box=click.masks[0].box)
        assert by_box.mask.any()

    def test_a_line_over_a_thing_selects_it(self, client):
        line = [[430, 275], [440, 280], [450, 285]]
        by_line = client.segment(VIEW, scribble=line)
        assert by_line.mask[280, 440]
        prompt = pepeseg.Prompt(VIEW, scribble=[line], not_scribble=[[[280, 280]]], stroke_width=2)
        less = client.segment(prompt, scale=1, threshold=-1).mask
        assert less[280, 440] and not less[280, 280]
        drawn = np.zeros((480, 640))
        drawn[275:286, 435:446] = 1
        assert client.segment(VIEW, strokes=drawn).mask[280, 440]
        assert client.select(VIEW, scribble=line).num_gaussians > 0
        with pytest.raises(pepeseg.InvalidArgumentError, match="put it into the Prompt"):
            client.segment(prompt, points=POINT)
        with pytest.raises(TypeError, match="pionts"):
            client.segment(VIEW, pionts=POINT)

    def test_a_similarity_map_above_the_threshold_is_the_mask(self, client):
        found = client.segment(
            VIEW,
            points=POINT_IN_VIEW,
            threshold=0.2,
            similarity=True,
            refine_borders=False,
            frame="view",
        )
        similarity = found.masks[0].similarity
        assert similarity.dtype == np.float32 and similarity.shape == found.mask.shape
        # One step of 16 bits to either side of the threshold.
        step = 2 / 32767
        assert (similarity[found.mask] > 0.2 - step).all()
        assert found.masks[0].score == pytest.approx(similarity[found.mask].mean(), abs=1e-3)

    def test_borders_are_refined_unless_declined(self, client):
        asked = {"points": POINT_IN_VIEW, "threshold": 0.2, "frame": "view"}
        plain = client.segment(VIEW, refine_borders=False, **asked).mask
        refined = client.segment(VIEW, **asked).mask
        assert 0 < (plain != refined).sum() < 0.25 * plain.sum()

    def test_a_camera_gives_the_same_as_its_view(self, client):
        view = next(view for view in client.views() if view.name == VIEW)
        assert np.allclose(view.camera.cam_from_world[3], [0, 0, 0, 1])
        asked = {"points": POINT_IN_VIEW, "scale": 0.3, "threshold": 0.3}
        there = client.segment(view, **asked, frame="view")
        free = client.segment(view.camera, **asked)
        assert free.masks[0].view == ""
        assert iou(there.mask, free.mask) > 0.98

    @pytest.mark.parametrize(
        "prompt",
        [
            {},
            {"points": POINT, "box": [0, 0, 9, 9]},
            {"points": [1, 2, 3]},
            {"box": [1, 2]},
            {"scribble": [[1, 2, 3]]},
            {"points": POINT, "not_scribble": POINT},
            {"mask": np.zeros(4)},
            {"mask": np.ones((4, 4)), "negative": POINT},
            {"mask": np.ones((4, 4)), "previous_mask": np.ones((4, 4))},
            {"label": "cup"},
            {"points": POINT, "scale": 0.1, "scale_units": 2},
        ],
    )
    def test_wrong_arguments_are_refused_before_sending(self, client, prompt):
        with pytest.raises(pepeseg.InvalidArgumentError) as error:
            client.segment(VIEW, **prompt)
        assert error.value.reason == ""

    def test_a_refusal_of_the_server_names_field_and_limit(self, client):
        with pytest.raises(ValueError) as error:
            client.segment(VIEW, points=POINT, threshold=7)
        assert isinstance(error.value, pepeseg.InvalidArgumentError)
        assert error.value.field == "granularity.threshold"
        assert error.value.reason == "BAD_FIELD" and error.value.limit and error.value.value == "7"
        assert error.value.retry_after is None


class TestPropose:
    def test_segment_with_its_scale_and_threshold_returns_each_proposal(self, client):
        proposals = client.propose(VIEW, points=POINT, max_proposals=3)
        assert 1 <= len(proposals) <= 3
        assert [p.best for p in proposals].count(True) == 1
        best = next(p for p in proposals if p.best)
        assert best.support == max(p.support for p in proposals)
        for small, large in itertools.pairwise(proposals):
            assert large.area >= 1.5 * small.area and large.scale >= small.scale
            assert (small.mask & large.mask).sum() >= 0.95 * small.area
            assert small.kind != large.kind or small.kind in ("part", "group")
        assert best.mask.shape == (480, 640) and best.area == best.mask.sum()
        shown = client.segment(VIEW, points=POINT, scale=best.scale, threshold=best.threshold)
        assert iou(shown.mask, best.mask) > 0.9


class TestCorrect:
    def test_a_mask_teaches_a_new_model_and_is_undone(self, client):
        before = client.model().name
        mask = client.segment(VIEW, points=POINT, threshold=0.6).mask
        mask[: mask.shape[0] // 2] = False
        mask[300:330, 300:340] = True
        taught = client.correct({VIEW: mask})
        try:
            assert taught.corrected_from == before != taught.model
            assert client.model().name == taught.model
            assert client.model().corrected_from == before
            (score,) = taught.scores
            assert score.view == VIEW and score.iou_after >= score.iou_before
            again = client.segment(
                VIEW, mask=mask, scale=taught.scale, threshold=taught.threshold, targets="held-out"
            )
            assert again.model == taught.model
            client.of("shelf", model=taught.corrected_from).make_live()
            assert client.model().name == before
        finally:
            if taught.model != before:
                client.of("shelf", model=taught.model).delete_model()
        assert client.model().name == before

    def test_a_mask_of_another_size_or_view_is_refused(self, client):
        with pytest.raises(pepeseg.InvalidArgumentError):
            client.correct({VIEW: np.ones((3, 4), bool)})
        with pytest.raises(pepeseg.InvalidArgumentError):
            client.correct({"nothing.jpg": np.ones((480, 640), bool)})


class TestRender:
    def test_color_depth_and_ids_have_their_types(self, client):
        color = client.render(VIEW)
        assert (color.dtype, color.shape) == (np.uint8, (480, 640, 3))
        assert color.std() > 5
        depth = client.render(VIEW, content="depth")
        assert (depth.dtype, depth.shape) == (np.float32, (480, 640))
        assert 0.1 < np.median(depth[depth > 0]) < 3  # metres, of a shelf
        features = client.render(VIEW, content="features", feature_scale=0.5)
        assert features.shape == (480, 640, 3)
        assert client.render(VIEW, frame="view").shape == (120, 160, 3)
        assert client.render(VIEW, max_side=200).shape == (150, 200, 3)

    def test_an_overlay_shows_the_mask(self, client):
        mask = client.segment(VIEW, points=POINT, threshold=0).mask
        plain = client.render(VIEW)
        tinted = client.render(VIEW, overlay=mask)
        changed = (plain != tinted).any(axis=2)
        assert changed[mask].mean() > 0.9
        assert changed.sum() < 2 * mask.sum() + 8000

    def test_an_unknown_content_is_refused(self, client):
        with pytest.raises(pepeseg.InvalidArgumentError, match="color"):
            client.render(VIEW, content="colour")


class TestDecompose:
    def test_segments_nest_and_are_exported(self, client, tmp_path):
        taken_apart = client.decompose([0.1, 0.9])
        assert [level.scale for level in taken_apart.levels] == [0.1, 0.9]
        small, large = taken_apart.levels
        ids = {segment.id for segment in large.segments}
        assert small.segments and all(s.parent in ids | {0} for s in small.segments)
        first = large.segments[0]
        assert first.parent == 0 and len(first.min) == 3
        written = client.export(tmp_path / "first.ply", first)
        assert written.num_gaussians == first.num_gaussians
        starts = {"glb": b"glTF", "spz": b"\x1f\x8b", "sog": b"PK\3\4", "html": b"<!doctype html>"}
        for ending, start in starts.items():
            name = f"first.{ending}"
            assert client.export(tmp_path / name, first).num_gaussians == first.num_gaussians
            assert (tmp_path / name).read_bytes().startswith(start)
        assert client.export(tmp_path / "odd.glb", first, format="ply").sha256 == written.sha256
        few = {"voxels": 32, "watertight": True, "triangles": 500}
        mesh = client.export_mesh(tmp_path / "first.glb", first, **few)
        assert 100 < mesh.num_triangles <= 500 and mesh.num_bytes == mesh.path.stat().st_size
        assert mesh.path.read_bytes().startswith(b"glTF")
        with pytest.raises(pepeseg.InvalidArgumentError):
            client.export_mesh(tmp_path / "none.ply", first, voxels=31)
        with pytest.raises(pepeseg.InvalidArgumentError):
            client.export_mesh(tmp_path / "none.ply", first, format="spz")
        assert not (tmp_path / "none.ply").exists()
        client.export(tmp_path / "ids.ply", first, segment_ids=first.scales)
        assert b"property int segment_1\n" in (tmp_path / "ids.ply").read_bytes()[:2000]
        ids_image = client.render(VIEW, content="segments", level=1, scales=first.scales)
        assert ids_image.dtype == np.uint16
        assert set(np.unique(ids_image)) <= ids | {0}
        selected = client.select(segment=first)
        assert selected.num_gaussians == first.num_gaussians


class TestLabel:
    def test_the_answer_in_a_labels_own_view_is_its_mask(self, client):
        painted = np.zeros((480, 640), bool)
        painted[200:300, 300:500] = True  # cuts through everything
        other = next(view.name for view in client.views() if view.name != VIEW)
        client.label("painted", VIEW, mask=painted)
        try:
            accepted = client.get_label("painted").mask
            found = client.segment(label="painted", targets=[VIEW, other])
            assert np.array_equal(found.masks[0].mask, accepted)
            assert found.masks[0].area == accepted.sum()
            rows, columns = np.nonzero(accepted)
            assert found.masks[0].box[:2] == (columns.min(), rows.min())
            chosen = client.segment(label="painted", scale=0.5, threshold=0.5)
            assert not np.array_equal(chosen.mask, accepted)
        finally:
            client.delete_label("painted")

    def test_errors_about_names_say_which_are_similar(self, client):
        with pytest.raises(pepeseg.InvalidArgumentError, match=f"did you mean .*{VIEW}"):
            client.segment("frame-00000.jpg", points=POINT)
        with pytest.raises(pepeseg.NotFoundError, match="did you mean shelf"):
            client.of("shelv").views()
        with pytest.raises(pepeseg.NotFoundError) as unlike:
            client.of("nothing-like-it").views()
        assert "did you mean" not in str(unlike.value)

    def test_a_label_is_segmented_by_its_id(self, client):
        made = client.label("cup", VIEW, points=POINT, threshold=0.2, text="A cup")
        try:
            assert (made.id, made.text, made.view) == ("cup", "A cup", VIEW)
            assert made.mask.sum() == made.area
            assert [label.id for label in client.labels()] == ["cup"]
            found = client.get_label("cup")
            assert (found.text, found.area) == ("A cup", made.area)
            assert iou(found.mask, made.mask) > 0.8  # stored at a quarter of the size
            assert client.get_label("cup", frame="view").mask.shape == (120, 160)
            with pytest.raises(pepeseg.NotFoundError):
                client.get_label("plate")
            assert client.segment(label="cup").mask.any()
            again = client.label("mug", VIEW, mask=made.mask)
            assert np.array_equal(again.mask, made.mask)
            client.delete_label("mug")
            with pytest.raises(pepeseg.AlreadyExistsError):
                client.label("cup", VIEW, mask=~made.mask)
        finally:
            client.delete_label("cup")
        with pytest.raises(pepeseg.NotFoundError):
            client.delete_label("cup")


class TestSelect:
    def test_a_selection_is_exported_and_combined(self, client, tmp_path):
        first = client.select(VIEW, points=POINT, threshold=0)
        assert isinstance(first, pepeseg.Selection)
        assert first.num_gaussians > 0 and first.base == ""
        written = first.export(tmp_path / "cup.ply")
        assert written.num_gaussians == first.num_gaussians
        assert (tmp_path / "cup.ply").stat().st_size == written.num_bytes
        rest = first.export(tmp_path / "rest.ply", without=True)
        whole = client.export(tmp_path / "all.ply")
        assert rest.num_gaussians + written.num_gaussians == whole.num_gaussians
        assert whole.origin == (0, 0, 0)  # not map coordinates: no file with an origin
        with pytest.raises(pepeseg.InvalidArgumentError, match="local, world"):
            client.export(tmp_path / "all.ply", origin="here")
        wanted = 'format "obj": one of ply, spz, glb, sog, html is wanted'
        with pytest.raises(pepeseg.InvalidArgumentError, match=wanted):
            first.export(tmp_path / "all.obj", format="obj")
        assert sorted(p.name for p in tmp_path.iterdir()) == ["all.ply", "cup.ply", "rest.ply"]

        other = client.select(
            "frame-000003.jpg", points=POINT, threshold=0, base=first, keep_disconnected=True
        )
        assert other.base == first.name and other.num_gaussians >= first.num_gaussians
        assert (other - first).num_gaussians == other.num_gaussians - first.num_gaussians
        assert (other & first).num_gaussians == first.num_gaussians
        both = first | other
        assert both.num_gaussians == other.num_gaussians
        assert both.undo().name == first.name
        number = first.name.rpartition("/")[2]
        assert client.selection(number).num_gaussians == first.num_gaussians
        assert both.name in [selection.name for selection in client.selections()]
        both.delete()
        with pytest.raises(pepeseg.NotFoundError):
            client.export(tmp_path / "gone.ply", both)
        assert not (tmp_path / "gone.ply").exists()
        with pytest.raises(pepeseg.FailedPreconditionError):
            first.undo()


class TestFind:
    def test_a_label_is_found_by_its_words(self, client):
        client.label("tissues", VIEW, points=POINT, text="the blue Tissues")
        found = client.find("tissue")
        assert found and found.source == "labels" and len(found) == 1
        thing = found[0]
        assert (thing.score, thing.word) == (1.0, "the blue Tissues")  # its id
        assert thing.label == f"scenes/{client.place.scene.split('/')[-1]}/labels/tissues"
        assert client.segment(thing.prompt).mask.any()
        client.delete_label("tissues")

    def test_nothing_is_found_when_unsure(self, client):
        found = client.find("zebra")
        assert not found and list(found) == [] and found.source == ""
        assert isinstance(found.known_words, tuple)

    def test_likeness_takes_sam(self, client):
        with pytest.raises(pepeseg.FailedPreconditionError, match="deploy/sam.sh"):
            client.find(view=VIEW, points=POINT)
        segment = client.decompose().levels[0].segments[0]
        with pytest.raises(pepeseg.FailedPreconditionError, match="deploy/sam.sh"):
            client.find(like=segment)

    @pytest.mark.parametrize("what", [{}, {"text": "a", "view": VIEW}, {"text": "a", "label": "b"}])
    def test_one_thing_is_asked_for(self, client, what):
        with pytest.raises(pepeseg.InvalidArgumentError) as error:
            client.find(**what)
        assert error.value.reason == ""
