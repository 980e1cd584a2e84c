"""Tests trainings and their jobs."""

import io
import json
import threading

import numpy as np
from PIL import Image
import pytest

import pepeseg
from conftest import SHELF, SMALL, Pepesegd
from pepeseg import importers
from pepeseg.jobs import wait_text
from pepeseg.training import PRESETS, to_options
from pepeseg.v1 import job_service_pb2, training_options_pb2


@pytest.mark.parametrize(
    "reason, jobs_ahead, text",
    [
        ("REASON_UNSPECIFIED", 0, ""),
        ("REASON_DEVICE", 0, "next, when a device is free"),
        ("REASON_DEVICE", 1, "after 1 other, when a device is free"),
        ("REASON_DEVICE", 2, "after 2 others, when a device is free"),
        ("REASON_QUOTA", 0, "until another job of its project ends, by its quota"),
        ("REASON_RETRY", 0, "until the next attempt, after a pause"),
    ],
)
def test_a_queued_job_says_what_it_waits_for(reason, jobs_ahead, text):
    wait = job_service_pb2.Job.Wait(reason=reason, jobs_ahead=jobs_ahead)
    assert wait_text(wait) == text


class TestOptions:
    def test_every_option_is_listed_with_its_default_and_range(self, client):
        options = {option.name: option for option in client.list_options()}
        assert options["features.smooth_until"].default_value == "0.5"
        assert options["features.smooth_until"].range == "[0, 1]"
        assert "smoothed" in options["features.smooth_until"].description
        best = {option.name: option.default_value for option in client.list_options(preset="best")}
        assert best["features.smooth_until"] == "0.65" and len(best) == len(options) > 100

    def test_takes_values_of_every_type(self):
        options = to_options(
            {
                "reconstruct.num_steps": 7,
                "reconstruct.depth_local_form": "patch",
                "features.perception_cross_view": False,
                "import.image_scale": 0.5,
                "import.held_out_views": ["a.jpg", "b.jpg"],
                "preset": "preview",
            }
        )
        assert dict(options.advanced) == {
            "reconstruct.num_steps": "7",
            "reconstruct.depth_local_form": "patch",
            "features.perception_cross_view": "false",
            "import.image_scale": "0.5",
        }
        assert options.preset == training_options_pb2.TRAINING_PRESET_PREVIEW
        assert getattr(options, "import").held_out_views == ["a.jpg", "b.jpg"]

    @pytest.mark.parametrize(
        "name, value, message",
        [
            ("steps", 1, "unknown option"),
            ("reconstruct", 1, "unknown option"),
            ("reconstruct.num_step", 1, "mean reconstruct.num_steps"),
            ("reconstruct.num_steps", "many", r"must be a whole number in \[1, 10000000\]"),
            ("features.smooth_until", 2, r"must be in \[0, 1\]"),
        ],
    )
    def test_unknown_options_and_values_are_refused(self, client, name, value, message):
        with pytest.raises(pepeseg.InvalidArgumentError, match=message):
            client.estimate(options={name: value})

    def test_presets_have_the_names_of_the_contract(self, client):
        names = training_options_pb2.TrainingPreset.keys()
        wanted = [name.removeprefix("TRAINING_PRESET_").lower() for name in names]
        assert list(PRESETS) == wanted[1:]
        with pytest.raises(pepeseg.InvalidArgumentError, match="preview, standard, best, paper"):
            client.start_training(preset="quick")


class TestTraining:
    def test_the_model_names_what_it_was_trained_on(self, client):
        model = client.model()
        assert model.name == "scenes/shelf/models/1"
        assert model.sources == {"poses": "given", "masks": "given", "depth": "given"}
        assert model.dataset == "scenes/shelf/datasets/1" and model.advice == ()
        assert model.num_gaussians > 100 and model.metrics["psnr"] > 10
        assert client.models() == [model]
        views = client.views()
        assert len(views) == 15
        assert all((view.psnr is not None) == view.held_out for view in views)
        assert "shelf" in [scene.id for scene in client.scenes()]

    def test_a_watch_sees_all_events_again(self, client):
        made_by = client.model().job
        job = next(job for job in client.jobs() if job.name == made_by)
        events = list(client.watch(job, after=0))
        assert events[0].WhichOneof("event") == "snapshot"
        numbers = [event.sequence for event in events[1:]]
        assert numbers == sorted(set(numbers))
        assert events[-1].state_changed.state == job_service_pb2.JOB_STATE_SUCCEEDED
        ended = [e.stage_ended.stage for e in events if e.HasField("stage_ended")]
        stages = [pepeseg.stage_name(stage) for stage in ended]
        assert stages.index("reconstruct") < stages.index("features")
        later = list(client.watch(job.name, after=numbers[-3]))
        assert [event.sequence for event in later[1:]] == numbers[-2:]
        assert client.wait(job) == client.model()

    def test_pictures_of_the_training_come_to_who_watches_late(self, client):
        job = next(job for job in client.jobs() if job.model == "scenes/shelf/models/1")
        events = client.watch(job, after=0)
        pictures = [event.preview for event in events if event.HasField("preview")]
        assert len(pictures) >= 2
        steps = [picture.step for picture in pictures]
        assert steps == sorted(steps) and steps[-1] == pictures[-1].num_steps == SMALL["steps"]
        for picture in pictures:
            assert picture.stage == job_service_pb2.JOB_STAGE_RECONSTRUCT
            assert picture.view == pictures[0].view
            assert len(picture.jpeg) <= 30_000
            with Image.open(io.BytesIO(picture.jpeg)) as image:
                assert (image.format, image.size) == ("JPEG", (picture.width, picture.height))

    def test_a_job_answers_clicks_while_it_trains(self, client, server):
        options = {"features.num_pixels": 300, "features.min_loss_fall": 0}
        job = client.start_training(
            steps=60, feature_steps=10**6, image_scale=0.25, options=options
        )
        try:
            training = pepeseg.Client("shelf", server=server.address, model=job.name, patience=60)
            found = training.segment("frame-000000.jpg", points=[[440, 280]])
            assert found.model == found.snapshot.job == job.name
            assert 1 <= found.snapshot.step < found.snapshot.num_steps == 10**6
            assert found.snapshot.stage == "features"
            assert found.mask.any()
            assert len(training.views()) == 15
        finally:
            client.cancel(job)
            with pytest.raises(pepeseg.JobCancelledError):
                client.wait(job)
        with pytest.raises(pepeseg.FailedPreconditionError, match="was cancelled") as gone:
            training.segment("frame-000000.jpg", points=[[440, 280]])
        assert gone.value.resource == job.name
        done = pepeseg.Client("shelf", server=server.address, model="jobs/j1")
        answered = done.segment("frame-000000.jpg", points=[[440, 280]])
        assert answered.model == "scenes/shelf/models/1" and answered.snapshot is None

    def test_a_training_is_estimated(self, client):
        answer = client.estimate(**SMALL)
        assert answer.num_views == 15 and answer.need_bytes > 0

    def test_a_value_out_of_range_is_refused(self, client):
        with pytest.raises(pepeseg.InvalidArgumentError, match="num_steps"):
            client.train(steps=0)

    def test_a_second_training_names_the_first_which_can_be_cancelled(self, client, capfd):
        job = client.start_training(steps=30000, image_scale=0.25)
        with pytest.raises(pepeseg.AbortedError) as refused:
            client.train()
        assert refused.value.resource == job.name
        seen = []

        def cancel_once(event):
            seen.append(event.WhichOneof("event"))
            if seen.count("progress") == 1 and seen[-1] == "progress":
                client.cancel(job)

        with pytest.raises(pepeseg.JobCancelledError) as ended:
            client.wait(job, progress=True, on_event=cancel_once)
        assert ended.value.job.state == job_service_pb2.JOB_STATE_CANCELLED
        assert "reconstruct" in capfd.readouterr().err

    def test_a_failed_job_is_an_exception(self, server, tmp_path):
        (tmp_path / "images").mkdir()
        (tmp_path / "images" / "a.jpg").write_bytes(b"\xff\xd8\xff no photograph")
        (tmp_path / "transforms.json").write_text('{"frames": []}')
        with pepeseg.Client("broken", server=server.address) as client:
            client.create_scene("A broken photograph")
            client.create_scene()
            with pytest.raises(pepeseg.FailedPreconditionError, match="no dataset"):
                client.train()
            client.upload(tmp_path)
            with pytest.raises(pepeseg.FailedPreconditionError):
                client.segment("a.jpg", points=[1, 1])
            with pytest.raises(pepeseg.JobFailedError) as failed:
                client.train()
            assert failed.value.job.error.message in failed.value.message
            client.delete_scene()
            assert not [scene for scene in client.scenes() if scene.id == "broken"]

    def test_a_watch_outlives_the_server(self, tmp_path):
        running = Pepesegd(tmp_path)
        try:
            with pepeseg.Client("shelf", server=running.address, patience=60) as client:
                client.upload(SHELF)
                job = client.start_training(steps=30000, image_scale=0.25)
                kinds = []
                for event in client.watch(job):
                    kinds.append(event.WhichOneof("event"))
                    if kinds.count("progress") == 1 and kinds[-1] == "progress":
                        running.kill()
                        threading.Timer(0.2, running.start).start()
                    if kinds.count("progress") == 2:
                        client.cancel(job)
                assert kinds[-1] == "state_changed"
        finally:
            running.stop()

    def test_a_folder_of_nerfstudio_is_trained_in_its_own_frame(self, server, client, tmp_path):
        (tmp_path / "train").mkdir()
        (tmp_path / "masks" / "train").mkdir(parents=True)
        frames = []
        for view in client.views():
            # The file has the photograph's whole size, and names it without its suffix.
            (tmp_path / "train" / view.name).symlink_to(SHELF / "images" / view.name)
            mask = f"{view.name.removesuffix('.jpg')}.json"
            (tmp_path / "masks" / "train" / mask).symlink_to(SHELF / "masks" / mask)
            world_from_cam = np.linalg.inv(view.camera.cam_from_world) @ np.diag([1, -1, -1, 1])
            frames.append(
                {
                    "file_path": f"train/{view.name.removesuffix('.jpg')}",
                    "transform_matrix": world_from_cam.tolist(),
                    "fl_x": view.camera.fx * 4,
                    "fl_y": view.camera.fy * 4,
                    "cx": view.camera.cx * 4,
                    "cy": view.camera.cy * 4,
                }
            )
        (tmp_path / "transforms.json").write_text(json.dumps({"frames": frames}))
        with pepeseg.Client("nerfstudio", server=server.address) as other:
            other.upload(importers.nerfstudio(tmp_path))
            few = {"priors.depth": "none", "features.num_pixels": 50}
            model = other.train(steps=20, feature_steps=10, image_scale=0.25, options=few)
            assert model.sources == {"poses": "given", "masks": "given", "depth": "none"}
            for ours, theirs in zip(client.views(), other.views()):
                assert theirs.name == f"train/{ours.name}"
                assert np.allclose(theirs.camera.cam_from_world, ours.camera.cam_from_world)
                assert theirs.camera.fx == pytest.approx(ours.camera.fx)
            other.delete_scene()
