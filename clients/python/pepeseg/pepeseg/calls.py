"""The steps that operations consist of, and how the blocking client runs them.

An operation is written once, as a generator that yields steps. The client runs a step and sends the
result into the generator, or raises the step's exception in it. `Client` blocks for each step,
`aio.Client` awaits it.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass
from typing import Any, TypeVar, Union
import secrets
import time

import grpc

from pepeseg import errors
from pepeseg.channel import Connection
from pepeseg.proxy import Proxy
from pepeseg.v1 import (
    dataset_service_pb2_grpc,
    edit_service_pb2_grpc,
    evaluation_service_pb2_grpc,
    job_service_pb2_grpc,
    label_service_pb2_grpc,
    render_service_pb2_grpc,
    scene_service_pb2_grpc,
    segmentation_service_pb2_grpc,
    selection_service_pb2_grpc,
)

T = TypeVar("T")

# The first query of a model loads it.
CALL_SECONDS = 120.0
_FIRST_PAUSE = 0.25
_LONGEST_PAUSE = 4.0


@dataclass(frozen=True)
class Place:
    """The names of the scene and the model that a client's calls are about."""

    scene: str  # "scenes/shelf"
    model: str  # "scenes/shelf/models/live"


@dataclass(frozen=True)
class Unary:
    """A call with one request and one response.

    `repeatable`: the call may be repeated after a lost response, because doing it twice has the
    effect of doing it once. Otherwise it is repeated only if the server said that it did nothing.
    `seconds`: the deadline.
    """

    service: str
    method: str
    request: Any
    scene: str = ""
    repeatable: bool = True
    seconds: float = CALL_SECONDS


@dataclass(frozen=True)
class Send:
    """A call that streams `requests` and has one response. An exception of `requests` ends it."""

    service: str
    method: str
    requests: Iterator[Any]
    scene: str


@dataclass(frozen=True)
class Receive:
    """A call that streams responses, each passed to `take`. An exception of `take` ends it. It is
    repeated as a `Unary` that is not repeatable, unless a response has come."""

    service: str
    method: str
    request: Any
    scene: str
    take: Callable[[Any], None]


@dataclass(frozen=True)
class Pause:
    seconds: float


@dataclass(frozen=True)
class Work:
    """Work that reads files for a while. The asyncio client runs it in a thread."""

    do: Callable[[], Any]


Step = Union[Unary, Send, Receive, Pause, Work]
Steps = Generator[Step, Any, T]


class Services:
    """The stubs of a channel, blocking or asyncio."""

    def __init__(self, channel: Any) -> None:
        stubs: dict[str, Any] = {
            "scenes": scene_service_pb2_grpc.SceneServiceStub,
            "datasets": dataset_service_pb2_grpc.DatasetServiceStub,
            "jobs": job_service_pb2_grpc.JobServiceStub,
            "segmentation": segmentation_service_pb2_grpc.SegmentationServiceStub,
            "labels": label_service_pb2_grpc.LabelServiceStub,
            "selections": selection_service_pb2_grpc.SelectionServiceStub,
            "editing": edit_service_pb2_grpc.EditServiceStub,
            "rendering": render_service_pb2_grpc.RenderServiceStub,
            "evaluation": evaluation_service_pb2_grpc.EvaluationServiceStub,
        }
        self._stubs = {name: stub(channel) for name, stub in stubs.items()}

    def method(self, step: Unary | Send | Receive) -> Any:
        return getattr(self._stubs[step.service], step.method)


class Patience:
    """Decides how long a refused or lost call is repeated, and after which pauses: doubling ones,
    or the one that the server asks for."""

    def __init__(self, seconds: float) -> None:
        self._end = time.monotonic() + seconds
        self._pause = _FIRST_PAUSE

    def pause_after(self, error: errors.PepesegError, repeatable: bool) -> float:
        """Returns the seconds until the next try, or raises `error` if there is none."""
        pause = error.retry_after
        if pause is None:
            if not (repeatable and isinstance(error, errors.UnavailableError)):
                raise error
            pause, self._pause = self._pause, min(2 * self._pause, _LONGEST_PAUSE)
        if time.monotonic() + pause > self._end:
            raise error
        return pause


def metadata_of(base: tuple[tuple[str, str], ...], scene: str) -> tuple[tuple[str, str], ...]:
    """Returns `metadata` with the scene as the gateway's routing key."""
    return (*base, ("x-scene", scene.removeprefix("scenes/"))) if scene else base


class LocalFailure:
    """Iterates over `requests` for gRPC and keeps their exception, which gRPC would hide."""

    def __init__(self, requests: Iterator[Any]) -> None:
        self._requests = requests
        self.error: Exception | None = None

    def __iter__(self) -> Iterator[Any]:
        return self

    def __next__(self) -> Any:
        try:
            return next(self._requests)
        except StopIteration:
            raise
        except Exception as error:
            self.error = error
            raise

    def reason_of(self, error: grpc.RpcError, proxy: Proxy | None) -> Exception:
        return self.error or errors.from_rpc(error, proxy)


class Blocking:
    """Runs the steps of an operation one after the other, blocking for each."""

    def __init__(self, channel: grpc.Channel, connection: Connection, patience: float) -> None:
        self._services = Services(channel)
        self._metadata = connection.metadata
        self._proxy = connection.proxy
        self._patience = patience

    def run(self, steps: Steps[T]) -> T:
        """Runs an operation to its end and returns its result."""
        try:
            step = next(steps)
            while True:
                try:
                    result = self._take(step)
                except Exception as error:
                    step = steps.throw(error)
                else:
                    step = steps.send(result)
        except StopIteration as end:
            answer: T = end.value
            return answer
        finally:
            steps.close()

    def stream(self, step: Receive) -> Iterator[Any]:
        """Yields the messages of a call, which is cancelled when the iterator is closed."""
        call = self._services.method(step)(
            step.request, metadata=metadata_of(self._metadata, step.scene)
        )
        try:
            yield from call
        except grpc.RpcError as error:
            raise errors.from_rpc(error, self._proxy) from None
        finally:
            call.cancel()

    def _take(self, step: Step) -> Any:
        if isinstance(step, Unary):
            return self._ask(step)
        if isinstance(step, Send):
            return self._send(step)
        if isinstance(step, Receive):
            return self._receive(step)
        if isinstance(step, Pause):
            return time.sleep(step.seconds)
        return step.do()

    def _ask(self, step: Unary) -> Any:
        patience = Patience(self._patience)
        method = self._services.method(step)
        metadata = metadata_of(self._metadata, step.scene)
        while True:
            try:
                return method(step.request, timeout=step.seconds, metadata=metadata)
            except grpc.RpcError as error:
                failure = errors.from_rpc(error, self._proxy)
            time.sleep(patience.pause_after(failure, step.repeatable))

    def _receive(self, step: Receive) -> None:
        patience = Patience(self._patience)
        while True:
            has_begun = False
            try:
                for message in self.stream(step):
                    has_begun = True
                    step.take(message)
                return
            except errors.PepesegError as error:
                if has_begun:
                    raise
                failure = error
            time.sleep(patience.pause_after(failure, repeatable=False))

    def _send(self, step: Send) -> Any:
        requests = LocalFailure(step.requests)
        metadata = metadata_of(self._metadata, step.scene)
        try:
            return self._services.method(step)(requests, metadata=metadata)
        except grpc.RpcError as error:
            raise requests.reason_of(error, self._proxy) from None


def new_request_id() -> str:
    """Returns a random request_id, by which the server recognises a repeated call."""
    return secrets.token_hex(16)


def all_pages(
    service: str, method: str, request: Any, items: str, scene: str = ""
) -> Steps[list[Any]]:
    """Returns the items of all pages of a list."""
    found: list[Any] = []
    request.page_size = 1000
    while True:
        page = yield Unary(service, method, request, scene)
        found.extend(getattr(page, items))
        if not page.next_page_token:
            return found
        request.page_token = page.next_page_token
