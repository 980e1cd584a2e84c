"""Scenes and their models."""

from __future__ import annotations

from dataclasses import dataclass

from pepeseg import errors
from pepeseg.calls import Place, Steps, Unary, all_pages, new_request_id
from pepeseg.v1 import scene_service_pb2


@dataclass(frozen=True)
class Scene:
    """A scene on the server.

    Attributes:
        id: as `Client` takes it.
        display_name: for people.
        live_model: name of the model that "live" stands for; empty: none yet.
        active_job: name of the queued or running job; empty: none.
    """

    id: str
    display_name: str
    live_model: str
    active_job: str


@dataclass(frozen=True)
class Model:
    """A trained model.

    Attributes:
        name: "scenes/{scene}/models/{number}".
        metrics: measurements of the training: "psnr" (dB) and "ssim" over the held-out views,
            "seconds_reconstruct" and others.
        sources: where "poses", "masks" and "depth" came from: "given", "none", or what made them;
            one that is not known is not there.
        device: the device that trained it.
        num_bytes: its size on disk.
        dataset: name of the dataset that it was trained on; empty: not known.
        corrected_from, edited_from: name of the model that was corrected, or edited, to make it;
            both empty: a training made it.
        edit: what the edit did, for people.
        advice: what may make its masks poor and how to get better ones, for people; `train` and
            `wait` warn of it.
    """

    name: str
    job: str
    num_gaussians: int
    num_bytes: int
    metrics: dict[str, float]
    sources: dict[str, str]
    device: str
    dataset: str = ""
    advice: tuple[str, ...] = ()
    corrected_from: str = ""
    edited_from: str = ""
    edit: str = ""


def _parse_model(message: scene_service_pb2.Model) -> Model:
    return Model(
        name=message.name,
        job=message.job,
        num_gaussians=message.num_gaussians,
        num_bytes=message.num_bytes,
        metrics=dict(message.metrics),
        sources={field.name: source for field, source in message.sources.ListFields()},
        device=message.device,
        dataset=message.dataset,
        advice=tuple(message.advice),
        corrected_from=message.corrected_from,
        edited_from=message.edited_from,
        edit=message.edit,
    )


def list_scenes(at: Place) -> Steps[list[Scene]]:
    """Lists the scenes of the key's project, by id."""
    request = scene_service_pb2.ListScenesRequest()
    found = yield from all_pages("scenes", "ListScenes", request, "scenes")
    return [
        Scene(
            scene.name.removeprefix("scenes/"),
            scene.display_name,
            scene.live_model,
            scene.active_job,
        )
        for scene in found
    ]


def create_scene(at: Place, display_name: str = "") -> Steps[None]:
    """Creates the scene unless it exists.

    Raises:
        InvalidArgumentError: the id is not 1 to 63 of a-z, A-Z, 0-9, '_', '.' and '-', beginning
            with a letter or a digit.
    """
    request = scene_service_pb2.CreateSceneRequest(
        scene_id=at.scene.removeprefix("scenes/"),
        scene=scene_service_pb2.Scene(display_name=display_name),
        request_id=new_request_id(),
    )
    try:
        yield Unary("scenes", "CreateScene", request, at.scene)
    except errors.AlreadyExistsError:
        pass


def delete_scene(at: Place) -> Steps[None]:
    """Deletes the scene with its datasets, jobs and models.

    Raises:
        NotFoundError: no such scene.
        FailedPreconditionError: one of its jobs is queued or running.
    """
    request = scene_service_pb2.DeleteSceneRequest(name=at.scene)
    yield Unary("scenes", "DeleteScene", request, at.scene, repeatable=False)


def get_model(at: Place, name: str) -> Steps[Model]:
    """Returns a model by its name."""
    request = scene_service_pb2.GetModelRequest(name=name)
    answer = yield Unary("scenes", "GetModel", request, at.scene)
    return _parse_model(answer)


def model(at: Place) -> Steps[Model]:
    """Returns the model of this client.

    Raises:
        NotFoundError: no such scene or model.
        FailedPreconditionError: the scene has no model yet.
    """
    return (yield from get_model(at, at.model))


def list_models(at: Place) -> Steps[list[Model]]:
    """Lists the models of the scene, newest first."""
    request = scene_service_pb2.ListModelsRequest(parent=at.scene)
    found = yield from all_pages("scenes", "ListModels", request, "models", at.scene)
    return [_parse_model(message) for message in found]


def delete_model(at: Place) -> Steps[None]:
    """Deletes the model of this client ("live": the live one) with its selections.

    Raises:
        NotFoundError: no such model.
    """
    request = scene_service_pb2.DeleteModelRequest(name=at.model)
    yield Unary("scenes", "DeleteModel", request, at.scene, repeatable=False)


def make_live(at: Place) -> Steps[None]:
    """Makes the model of this client the live one of its scene: undoes a correction, if it is the
    model that was corrected.

    Raises:
        NotFoundError: no such model.
    """
    request = scene_service_pb2.SetLiveModelRequest(name=at.model)
    yield Unary("scenes", "SetLiveModel", request, at.scene)
