"""Trainings: options, estimate and start."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import difflib
from typing import Any, Union

from google.protobuf import json_format
from google.protobuf.message import Message
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


def option_names() -> list[str]:
    """Returns the names of all options, such as "reconstruct.num_steps" and "preset"."""
    names = []
    for field in training_options_pb2.TrainingOptions.DESCRIPTOR.fields:
        if field.message_type is None:
            names.append(field.name)
        else:
            names += [f"{field.name}.{option.name}" for option in field.message_type.fields]
    return names


def _enum_name(field: Any, value: str) -> str:
    """Returns an enum's value by its name, with or without the prefix of all values: "patch"."""
    wanted = value.upper()
    for known in field.enum_type.values:
        if known.name == wanted or known.name.endswith("_" + wanted):
            name: str = known.name
            return name
    return value


def to_options(options: Options) -> training_options_pb2.TrainingOptions:
    message = training_options_pb2.TrainingOptions()
    for name, value in options.items():
        stage, _, option = name.rpartition(".")
        parent = getattr(message, stage, None) if stage else message
        fields = parent.DESCRIPTOR.fields_by_name if isinstance(parent, Message) else {}
        field = fields.get(option)
        if field is None or field.message_type is not None:
            near = difflib.get_close_matches(name, option_names(), n=3)
            meant = f"; did you mean {' or '.join(near)}?" if near else ""
            raise errors.refused(f'no option "{name}"{meant} option_names() lists all')
        if field.enum_type is not None:
            value = _enum_name(field, str(value))
        if field.label == field.LABEL_REPEATED and isinstance(value, str):
            value = [value]
        try:
            json_format.ParseDict({option: value}, parent)
        except json_format.ParseError as error:
            raise errors.refused(f'option {name}: "{value}" is refused: {error}') from error
    return message


def _merge(
    preset: str | None,
    steps: int | None,
    feature_steps: int | None,
    image_scale: float | None,
    options: Options | None,
) -> training_options_pb2.TrainingOptions:
    if preset is not None and preset not in PRESETS:
        raise errors.refused(f'preset "{preset}": must be one of {", ".join(PRESETS)}')
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
        options: any option by name, such as {"reconstruct.sh_degree": 2}; `option_names()` lists
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
