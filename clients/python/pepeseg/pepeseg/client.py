"""The blocking client."""

from __future__ import annotations

from collections.abc import Callable, Iterator
import dataclasses
import time
from types import TracebackType
from typing import Concatenate, ParamSpec, TypeVar

import numpy as np
import numpy.typing as npt

from pepeseg import (
    annotation_files,
    cameras,
    corrections,
    edits,
    errors,
    evaluation,
    exports,
    finding,
    segmentation,
    subsets,
    training,
)
from pepeseg import jobs as of_jobs
from pepeseg import labels as of_labels
from pepeseg import photographs as of_photographs
from pepeseg import scenes as of_scenes
from pepeseg import selections as of_selections
from pepeseg import upload as of_uploads
from pepeseg.binding import SceneClient, blocking, of_itself
from pepeseg.calls import Blocking, Place, Steps
from pepeseg.channel import Connection
from pepeseg.v1 import job_service_pb2

P = ParamSpec("P")
T = TypeVar("T")


class Selection(subsets.SelectionInfo):
    """Selected Gaussians of a model; `a | b`, `a - b` and `a & b` make new selections. Attributes
    as in `subsets.SelectionInfo`."""

    def __init__(self, client: Client, info: subsets.SelectionInfo) -> None:
        super().__init__(**dataclasses.asdict(info))
        self._client = client

    export = of_itself(blocking(exports.export))
    export_mesh = of_itself(blocking(exports.export_mesh))

    def combine(self, operation: str, other: Selection) -> Selection:
        """Combines this selection, the base of the new one, with `other`.

        Args:
            operation: "union", "subtract" (this one without `other`) or "intersect".

        Raises:
            FailedPreconditionError: they are of different models.
        """
        return self._client.combine(self, operation, other)

    def __or__(self, other: Selection) -> Selection:
        return self.combine("union", other)

    def __sub__(self, other: Selection) -> Selection:
        return self.combine("subtract", other)

    def __and__(self, other: Selection) -> Selection:
        return self.combine("intersect", other)

    def undo(self) -> Selection:
        """Returns the selection that this one was made from.

        Raises:
            FailedPreconditionError: it was not made from another selection.
        """
        return self._client.undo(self)

    def gaussians(self) -> npt.NDArray[np.bool_]:
        """Returns which Gaussians of its model it has: a bool mask [num_gaussians], in the order of
        an exported PLY.

        Raises:
            ResourceExhaustedError: the model has more than 30,000,000 Gaussians.
        """
        return self._client.gaussians(self)

    def delete(self) -> None:
        """Deletes the selection on the server."""
        self._client.delete_selection(self)


def _selecting(
    operation: Callable[Concatenate[Place, P], Steps[subsets.SelectionInfo]]
) -> Callable[Concatenate[Client, P], Selection]:
    """Makes a method as `blocking` does, whose result is a Selection of this client."""
    ask = blocking(operation)

    def method(self: Client, /, *args: P.args, **kwargs: P.kwargs) -> Selection:
        return Selection(self, ask(self, *args, **kwargs))

    method.__doc__, method.__name__ = ask.__doc__, ask.__name__
    method.__signature__ = ask.__signature__  # type: ignore[attr-defined]
    return method


class Client(SceneClient):
    """A scene on a pepeseg server, by calls that block. Threads may share it.

        with pepeseg.Client("shelf") as client:
            client.upload("photos/")
            client.train(progress=True)
            mask = client.segment("0001.jpg", points=[[320, 240]]).mask

    A call that fails raises a subclass of `PepesegError`. Calls that a busy or stopping server
    refuses (UNAVAILABLE) are repeated for `patience` seconds, after the pause that the server asks
    for or after growing pauses; uploads and watched jobs are repeated for longer.
    """

    def _open(self, connection: Connection, patience: float) -> None:
        self._channel = connection.open()
        self._calls = Blocking(self._channel, connection, patience)

    def run(self, steps: Steps[T]) -> T:
        """Runs the steps of an operation."""
        return self._calls.run(steps)

    def close(self) -> None:
        """Closes the connection. Calls in progress and clients made by `of` end with it."""
        self._channel.close()

    def __enter__(self) -> Client:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    scenes = blocking(of_scenes.list_scenes)
    create_scene = blocking(of_scenes.create_scene)
    delete_scene = blocking(of_scenes.delete_scene)
    model = blocking(of_scenes.model)
    models = blocking(of_scenes.list_models)
    delete_model = blocking(of_scenes.delete_model)
    make_live = blocking(of_scenes.make_live)
    views = blocking(cameras.views)

    upload = blocking(of_uploads.upload)
    datasets = blocking(of_uploads.list_datasets)
    dataset = blocking(of_uploads.get_dataset)
    delete_upload = blocking(of_uploads.delete_upload)
    photograph = blocking(of_photographs.photograph)
    train = blocking(training.train)
    start_training = blocking(training.start_training)
    wait = blocking(of_jobs.wait)
    estimate = blocking(training.estimate)
    list_options = blocking(training.list_options)
    cancel = blocking(of_jobs.cancel)
    jobs = blocking(of_jobs.list_jobs)

    segment = blocking(segmentation.segment)
    propose = blocking(segmentation.propose)
    find = blocking(finding.find)
    correct = blocking(corrections.correct)
    remove = blocking(edits.remove)
    keep = blocking(edits.keep)
    move = blocking(edits.move)
    copy = blocking(edits.copy)
    recolor = blocking(edits.recolor)
    evaluate = blocking(evaluation.evaluate)
    sam_agreement = blocking(evaluation.sam_agreement)
    decompose = blocking(subsets.decompose)
    render = blocking(subsets.render)
    export = blocking(exports.export)
    export_mesh = blocking(exports.export_mesh)

    label = blocking(of_labels.label)
    get_label = blocking(of_labels.get_label)
    labels = blocking(of_labels.list_labels)
    delete_label = blocking(of_labels.delete_label)
    export_annotations = blocking(annotation_files.export_annotations)

    select = _selecting(of_selections.select)
    select_gaussians = _selecting(of_selections.select_gaussians)
    combine = _selecting(of_selections.combine)
    undo = _selecting(of_selections.undo)
    selection = _selecting(of_selections.get_selection)
    gaussians = blocking(of_selections.gaussians)
    delete_selection = blocking(of_selections.delete_selection)

    def selections(self) -> list[Selection]:
        """Lists the selections of the scene, newest first."""
        found = self.run(of_selections.list_selections(self.place))
        return [Selection(self, info) for info in found]

    def watch(
        self, job: job_service_pb2.Job | str, after: int | None = None
    ) -> Iterator[job_service_pb2.JobEvent]:
        """Yields a job's events as they come, to its end, first a snapshot. Heartbeats are left
        out, and a lost server is called again.

        Args:
            after: sequence of the last event that was seen, to resume a watch; 0: all events.

        Raises:
            NotFoundError: no such job.
            OutOfRangeError: `after` is beyond the job's newest event.
            UnavailableError: the server did not come back for half a minute.
        """
        watch = of_jobs.Watch(job, after)
        while not watch.ended:
            try:
                for event in self._calls.stream(watch.stream(lambda event: None)):
                    if watch.see(event):
                        yield event
                return
            except errors.PepesegError as error:
                if watch.ended:
                    return
                pause = watch.pause_after(error)
            time.sleep(pause)
