"""Trainings: options, estimate and start."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Union

import grpc

from pepeseg import errors
from pepeseg.calls import Place, Steps, Unary, all_pages, new_request_id
from pepeseg.jobs import OnEvent, wait
from pepeseg.scenes import Model
from pepeseg.v1 import dataset_service_pb2, job_service_pb2, training_options_pb2

# Options by name, such as {"reconstruct.num_steps": 3000}.
Options = Mapping[str, Union[bool, int, float, str, Sequence[str]]]
# Something to click on as soon as possible; the defaults; the best model, however long it takes.
PRESETS = ("preview", "standard", "best", "paper")


def _text(value: object) -> str:
    """Returns a value as the server reads it: True is "true"."""
    return str(value).lower() if isinstance(value, bool) else str(value)


def to_options(options: Options) -> training_options_pb2.TrainingOptions:
    """Returns the message for options by name. The server, which lists them, reads the values."""
    message = training_options_pb2.TrainingOptions()
    for name, value in options.items():
        if name == "preset":
            message.preset = _preset(str(value))
        elif name == "import.held_out_views":
            views = [value] if isinstance(value, str) else value
            getattr(message, "import").held_out_views.extend(views)
        else:
            message.advanced[name] = _text(value)
    return message


def _preset(name: str) -> training_options_pb2.TrainingPreset:
    if name not in PRESETS:
        raise errors.refused(f'preset "{name}": must be one of {", ".join(PRESETS)}')
    return training_options_pb2.TrainingPreset.Value(f"TRAINING_PRESET_{name.upper()}")


def _merge(
    preset: str | None,
    steps: int | None,
    feature_steps: int | None,
    image_scale: float | None,
    options: Options | None,
) -> training_options_pb2.TrainingOptions:
    short = {
        "preset": preset,
        "reconstruct.num_steps": steps,
        "features.num_steps": feature_steps,
        "import.image_scale": image_scale,
    }
    given = {name: value for name, value in short.items() if value is not None}
    return to_options({**given, **(options or {})})


def _dataset_name(at: Place, dataset: int | str | None) -> Steps[str]:
    """Returns the name of a dataset by its number or name. None: the scene's newest."""
    if dataset is not None:
        text = str(dataset)
        return text if "/" in text else f"{at.scene}/datasets/{text}"
    request = dataset_service_pb2.ListDatasetsRequest(parent=at.scene)
    found = yield from all_pages("datasets", "ListDatasets", request, "datasets", at.scene)
    if not found:
        raise errors.FailedPreconditionError(
            f"{at.scene} has no dataset yet: upload() brings one",
            grpc.StatusCode.FAILED_PRECONDITION,
        )
    newest: str = found[-1].name
    return newest


def start_training(
    at: Place,
    *,
    preset: str | None = None,
    steps: int | None = None,
    feature_steps: int | None = None,
    image_scale: float | None = None,
    options: Options | None = None,
    dataset: int | str | None = None,
) -> Steps[job_service_pb2.Job]:
    """Queues a training and returns its job; `watch` or `wait` follow it.

    Args:
        preset: "preview", "standard", "best" or "paper", from which options that are not given are taken.
            None: "standard".
        steps, feature_steps: number of steps of the reconstruction and of the feature training.
        image_scale: factor by which the photographs are shrunk, (0, 1].
        options: any option by name, such as {"reconstruct.sh_degree": 2}; `list_options()` lists
            all.
        dataset: number or name; None: the newest.

    Raises:
        InvalidArgumentError: no such option, or a value out of range.
        FailedPreconditionError: the scene has no dataset.
        AbortedError: a training of the scene is queued or running (`resource` is the job).
        ResourceExhaustedError: it does not fit in the device's memory (`value` and `limit`, bytes).
    """
    message = _merge(preset, steps, feature_steps, image_scale, options)
    name = yield from _dataset_name(at, dataset)
    request = job_service_pb2.TrainSceneRequest(
        scene=at.scene, dataset=name, options=message, request_id=new_request_id()
    )
    job: job_service_pb2.Job = yield Unary("jobs", "TrainScene", request, at.scene)
    return job


def train(
    at: Place,
    *,
    preset: str | None = None,
    steps: int | None = None,
    feature_steps: int | None = None,
    image_scale: float | None = None,
    options: Options | None = None,
    dataset: int | str | None = None,
    progress: bool = False,
    on_event: OnEvent | None = None,
) -> Steps[Model]:
    """Trains a model of the scene and waits for it.

    An interruption leaves the job running: `jobs` finds it, `wait` follows it, `cancel` ends it.

    Args:
        preset, steps, feature_steps, image_scale, options, dataset: as in `start_training`.
        progress: whether a bar is shown on standard error (by tqdm if it is installed).
        on_event: called with each event of the contract except heartbeats.

    Raises:
        InvalidArgumentError, FailedPreconditionError, AbortedError, ResourceExhaustedError: as in
            `start_training`.
        JobFailedError, JobCancelledError: the job failed or was cancelled.
    """
    job = yield from start_training(
        at,
        preset=preset,
        steps=steps,
        feature_steps=feature_steps,
        image_scale=image_scale,
        options=options,
        dataset=dataset,
    )
    return (yield from wait(at, job, progress=progress, on_event=on_event))


def estimate(
    at: Place,
    *,
    preset: str | None = None,
    steps: int | None = None,
    feature_steps: int | None = None,
    image_scale: float | None = None,
    options: Options | None = None,
    dataset: int | str | None = None,
) -> Steps[job_service_pb2.EstimateTrainingResponse]:
    """Estimates a training: memory of each stage, and time where it is known.

    Arguments and exceptions are those of `start_training`.
    """
    message = _merge(preset, steps, feature_steps, image_scale, options)
    name = yield from _dataset_name(at, dataset)
    request = job_service_pb2.EstimateTrainingRequest(scene=at.scene, dataset=name, options=message)
    answer: job_service_pb2.EstimateTrainingResponse = yield Unary(
        "jobs", "EstimateTraining", request, at.scene
    )
    return answer


def list_options(
    at: Place, *, preset: str | None = None
) -> Steps[list[job_service_pb2.TrainingOption]]:
    """Lists every option of a training: name, default_value, range and description.

    Args:
        preset: whose values are the defaults; None: "standard".
    """
    request = job_service_pb2.ListTrainingOptionsRequest()
    if preset is not None:
        request.preset = _preset(preset)
    answer: job_service_pb2.ListTrainingOptionsResponse = yield Unary(
        "jobs", "ListTrainingOptions", request, at.scene
    )
    return list(answer.options)
