"""The asyncio client: the same operations as `pepeseg.Client`, awaited."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
import dataclasses
from types import TracebackType
from typing import Any, Concatenate, ParamSpec, TypeVar

import grpc
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
from pepeseg.binding import SceneClient, awaited, of_itself
from pepeseg.calls import (
    Patience,
    Pause,
    Place,
    Receive,
    Send,
    Services,
    Step,
    Steps,
    Unary,
    metadata_of,
)
from pepeseg.channel import Connection
from pepeseg.proxy import Proxy
from pepeseg.v1 import job_service_pb2

P = ParamSpec("P")
T = TypeVar("T")


class _Awaiting:
    """Runs the steps of an operation one after the other, awaiting each."""

    def __init__(self, channel: Any, connection: Connection, patience: float) -> None:
        self._services = Services(channel)
        self._metadata = connection.metadata
        self._proxy = connection.proxy
        self._patience = patience

    async def run(self, steps: Steps[T]) -> T:
        """Runs an operation to its end and returns its result."""
        try:
            step = next(steps)
            while True:
                try:
                    result = await self._take(step)
                except (Exception, asyncio.CancelledError) as error:
                    step = steps.throw(error)
                else:
                    step = steps.send(result)
        except StopIteration as end:
            answer: T = end.value
            return answer
        finally:
            steps.close()

    async def stream(self, step: Receive) -> AsyncIterator[Any]:
        """Yields the messages of a call, which is cancelled when the iterator is closed."""
        call = self._services.method(step)(
            step.request, metadata=metadata_of(self._metadata, step.scene)
        )
        try:
            async for message in call:
                yield message
        except grpc.RpcError as error:
            raise errors.from_rpc(error, self._proxy) from None
        finally:
            call.cancel()

    async def _take(self, step: Step) -> Any:
        if isinstance(step, Unary):
            return await self._ask(step)
        if isinstance(step, Send):
            return await self._send(step)
        if isinstance(step, Receive):
            return await self._receive(step)
        if isinstance(step, Pause):
            return await asyncio.sleep(step.seconds)
        return await asyncio.to_thread(step.do)

    async def _ask(self, step: Unary) -> Any:
        patience = Patience(self._patience)
        method = self._services.method(step)
        metadata = metadata_of(self._metadata, step.scene)
        while True:
            try:
                return await method(step.request, timeout=step.seconds, metadata=metadata)
            except grpc.RpcError as error:
                failure = errors.from_rpc(error, self._proxy)
            await asyncio.sleep(patience.pause_after(failure, step.repeatable))

    async def _receive(self, step: Receive) -> None:
        patience = Patience(self._patience)
        while True:
            has_begun = False
            try:
                async for message in self.stream(step):
                    has_begun = True
                    step.take(message)
                return
            except errors.PepesegError as error:
                if has_begun:
                    raise
                failure = error
            await asyncio.sleep(patience.pause_after(failure, repeatable=False))

    async def _send(self, step: Send) -> Any:
        call = self._services.method(step)(metadata=metadata_of(self._metadata, step.scene))
        try:
            # Files are read and checked in a thread, not in the event loop.
            while (request := await asyncio.to_thread(_next, step.requests)) is not None:
                await call.write(request)
            await call.done_writing()
            return await call
        except (grpc.RpcError, asyncio.InvalidStateError) as error:
            raise await _why(call, error, self._proxy) from None
        finally:
            call.cancel()


def _next(requests: Iterator[Any]) -> Any:
    """Returns the next request, or None after the last one."""
    return next(requests, None)


async def _why(call: Any, error: Exception, proxy: Proxy | None) -> Exception:
    """Returns why a stream ended: the error of a write after its end does not say."""
    try:
        await call
    except grpc.RpcError as cause:
        return errors.from_rpc(cause, proxy)
    return error


class Selection(subsets.SelectionInfo):
    """Selected Gaussians of a model. Attributes as in `subsets.SelectionInfo`."""

    def __init__(self, client: Client, info: subsets.SelectionInfo) -> None:
        super().__init__(**dataclasses.asdict(info))
        self._client = client

    export = of_itself(awaited(exports.export))
    export_mesh = of_itself(awaited(exports.export_mesh))

    async def combine(self, operation: str, other: Selection) -> Selection:
        """Combines this selection, the base of the new one, with `other`.

        Args:
            operation: "union", "subtract" (this one without `other`) or "intersect".

        Raises:
            FailedPreconditionError: they are of different models.
        """
        return await self._client.combine(self, operation, other)

    async def undo(self) -> Selection:
        """Returns the selection that this one was made from.

        Raises:
            FailedPreconditionError: it was not made from another selection.
        """
        return await self._client.undo(self)

    async def gaussians(self) -> npt.NDArray[np.bool_]:
        """Returns which Gaussians of its model it has: see `pepeseg.Selection.gaussians`."""
        return await self._client.gaussians(self)

    async def delete(self) -> None:
        """Deletes the selection on the server."""
        await self._client.delete_selection(self)


def _selecting(
    operation: Callable[Concatenate[Place, P], Steps[subsets.SelectionInfo]]
) -> Callable[Concatenate[Client, P], Awaitable[Selection]]:
    """Makes a method as `awaited` does, whose result is a Selection of this client."""
    ask = awaited(operation)

    async def method(self: Client, /, *args: P.args, **kwargs: P.kwargs) -> Selection:
        return Selection(self, await ask(self, *args, **kwargs))

    method.__doc__, method.__name__ = ask.__doc__, ask.__name__
    method.__signature__ = ask.__signature__  # type: ignore[attr-defined]
    return method


class Client(SceneClient):
    """A scene on a pepeseg server, by calls that are awaited. Create it in a running event loop.

        async with pepeseg.aio.Client("shelf") as client:
            found = await client.segment("0001.jpg", points=[[320, 240]])

    Errors and `patience` are those of `pepeseg.Client`.
    """

    def _open(self, connection: Connection, patience: float) -> None:
        self._channel = connection.open_aio()
        self._calls = _Awaiting(self._channel, connection, patience)

    async def run(self, steps: Steps[T]) -> T:
        """Runs the steps of an operation."""
        return await self._calls.run(steps)

    async def close(self) -> None:
        """Closes the connection. Calls in progress and clients made by `of` end with it."""
        await self._channel.close()

    async def __aenter__(self) -> Client:
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        await self.close()

    scenes = awaited(of_scenes.list_scenes)
    create_scene = awaited(of_scenes.create_scene)
    delete_scene = awaited(of_scenes.delete_scene)
    model = awaited(of_scenes.model)
    models = awaited(of_scenes.list_models)
    delete_model = awaited(of_scenes.delete_model)
    make_live = awaited(of_scenes.make_live)
    views = awaited(cameras.views)

    upload = awaited(of_uploads.upload)
    datasets = awaited(of_uploads.list_datasets)
    dataset = awaited(of_uploads.get_dataset)
    delete_upload = awaited(of_uploads.delete_upload)
    photograph = awaited(of_photographs.photograph)
    train = awaited(training.train)
    start_training = awaited(training.start_training)
    wait = awaited(of_jobs.wait)
    estimate = awaited(training.estimate)
    list_options = awaited(training.list_options)
    cancel = awaited(of_jobs.cancel)
    jobs = awaited(of_jobs.list_jobs)

    segment = awaited(segmentation.segment)
    propose = awaited(segmentation.propose)
    find = awaited(finding.find)
    correct = awaited(corrections.correct)
    remove = awaited(edits.remove)
    keep = awaited(edits.keep)
    move = awaited(edits.move)
    copy = awaited(edits.copy)
    recolor = awaited(edits.recolor)
    evaluate = awaited(evaluation.evaluate)
    sam_agreement = awaited(evaluation.sam_agreement)
    decompose = awaited(subsets.decompose)
    render = awaited(subsets.render)
    export = awaited(exports.export)
    export_mesh = awaited(exports.export_mesh)

    label = awaited(of_labels.label)
    get_label = awaited(of_labels.get_label)
    labels = awaited(of_labels.list_labels)
    delete_label = awaited(of_labels.delete_label)
    export_annotations = awaited(annotation_files.export_annotations)

    select = _selecting(of_selections.select)
    select_gaussians = _selecting(of_selections.select_gaussians)
    combine = _selecting(of_selections.combine)
    undo = _selecting(of_selections.undo)
    selection = _selecting(of_selections.get_selection)
    gaussians = awaited(of_selections.gaussians)
    delete_selection = awaited(of_selections.delete_selection)

    async def selections(self) -> list[Selection]:
        """Lists the selections of the scene, newest first."""
        found = await self.run(of_selections.list_selections(self.place))
        return [Selection(self, info) for info in found]

    async def watch(
        self, job: job_service_pb2.Job | str, after: int | None = None
    ) -> AsyncIterator[job_service_pb2.JobEvent]:
        """Yields a job's events as they come, to its end: see `pepeseg.Client.watch`."""
        watch = of_jobs.Watch(job, after)
        while not watch.ended:
            try:
                async for event in self._calls.stream(watch.stream(lambda event: None)):
                    if watch.see(event):
                        yield event
                return
            except errors.PepesegError as error:
                if watch.ended:
                    return
                pause = watch.pause_after(error)
            await asyncio.sleep(pause)
