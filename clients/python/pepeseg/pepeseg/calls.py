"""What operations are made of: steps that a client takes, blocking or awaiting.

An operation is written once, as a generator that yields steps and is sent what they came to, or has
the step's exception raised in it. `Client` and `aio.Client` take the steps.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass
from typing import Any, TypeVar, Union
import secrets
import time

import grpc

from pepeseg import errors
from pepeseg.v1 import (
    dataset_service_pb2_grpc,
    job_service_pb2_grpc,
    scene_service_pb2_grpc,
    segmentation_service_pb2_grpc,
)

T = TypeVar("T")

# The first question to a model loads it.
CALL_SECONDS = 120.0
_FIRST_PAUSE = 0.25
_LONGEST_PAUSE = 4.0


@dataclass(frozen=True)
class Place:
    """What a client asks about."""

    scene: str  # "scenes/shelf"
    model: str  # "scenes/shelf/models/live"


@dataclass(frozen=True)
class Unary:
    """A call with one request and one answer.

    `repeatable`: whether doing it twice is as doing it once; else it is only asked again where the
    server said that it did nothing.
    """

    service: str
    method: str
    request: Any
    scene: str = ""
    repeatable: bool = True


@dataclass(frozen=True)
class Send:
    """A call that streams `requests` and has one answer. What `requests` raises ends the call."""

    service: str
    method: str
    requests: Iterator[Any]
    scene: str


@dataclass(frozen=True)
class Receive:
    """A call that streams answers, each given to `take`. What `take` raises ends the call."""

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
    """Something that reads files for a while: off the event loop, where there is one."""

    do: Callable[[], Any]


Step = Union[Unary, Send, Receive, Pause, Work]
Steps = Generator[Step, Any, T]


class Services:
    """The stubs of a channel of either kind."""

    def __init__(self, channel: Any) -> None:
        stubs: dict[str, Any] = {
            "scenes": scene_service_pb2_grpc.SceneServiceStub,
            "datasets": dataset_service_pb2_grpc.DatasetServiceStub,
            "jobs": job_service_pb2_grpc.JobServiceStub,
            "segmentation": segmentation_service_pb2_grpc.SegmentationServiceStub,
        }
        self._stubs = {name: stub(channel) for name, stub in stubs.items()}

    def method(self, step: Unary | Send | Receive) -> Any:
        return getattr(self._stubs[step.service], step.method)


class Patience:
    """How long a refused or lost call is asked again: pauses that double, or as the server says."""

    def __init__(self, seconds: float) -> None:
        self._end = time.monotonic() + seconds
        self._pause = _FIRST_PAUSE

    def pause_after(self, error: errors.PepesegError, repeatable: bool) -> float:
        """Seconds until the next try; raises `error` where there is to be none."""
        pause = error.retry_after
        if pause is None:
            if not (repeatable and isinstance(error, errors.UnavailableError)):
                raise error
            pause, self._pause = self._pause, min(2 * self._pause, _LONGEST_PAUSE)
        if time.monotonic() + pause > self._end:
            raise error
        return pause


def metadata_of(base: tuple[tuple[str, str], ...], scene: str) -> tuple[tuple[str, str], ...]:
    """With the scene as routing key."""
    return (*base, ("x-scene", scene.removeprefix("scenes/"))) if scene else base


class LocalFailure:
    """Runs through `requests` for gRPC and keeps what it raises, which gRPC would not tell."""

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

    def reason_of(self, error: grpc.RpcError) -> Exception:
        return self.error or errors.from_rpc(error)


class Blocking:
    """Takes steps one after the other, waiting for each."""

    def __init__(
        self, channel: grpc.Channel, metadata: tuple[tuple[str, str], ...], patience: float
    ) -> None:
        self._services = Services(channel)
        self._metadata = metadata
        self._patience = patience

    def run(self, steps: Steps[T]) -> T:
        """All of an operation."""
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
        """The messages of a call; it is cancelled when the iterator is closed."""
        call = self._services.method(step)(
            step.request, metadata=metadata_of(self._metadata, step.scene)
        )
        try:
            yield from call
        except grpc.RpcError as error:
            raise errors.from_rpc(error) from None
        finally:
            call.cancel()

    def _take(self, step: Step) -> Any:
        if isinstance(step, Unary):
            return self._ask(step)
        if isinstance(step, Send):
            return self._send(step)
        if isinstance(step, Receive):
            for message in self.stream(step):
                step.take(message)
            return None
        if isinstance(step, Pause):
            return time.sleep(step.seconds)
        return step.do()

    def _ask(self, step: Unary) -> Any:
        patience = Patience(self._patience)
        method = self._services.method(step)
        metadata = metadata_of(self._metadata, step.scene)
        while True:
            try:
                return method(step.request, timeout=CALL_SECONDS, metadata=metadata)
            except grpc.RpcError as error:
                failure = errors.from_rpc(error)
            time.sleep(patience.pause_after(failure, step.repeatable))

    def _send(self, step: Send) -> Any:
        requests = LocalFailure(step.requests)
        metadata = metadata_of(self._metadata, step.scene)
        try:
            return self._services.method(step)(requests, metadata=metadata)
        except grpc.RpcError as error:
            raise requests.reason_of(error) from None


def new_request_id() -> str:
    """Random, so that a call repeated after a lost answer is known for the same one."""
    return secrets.token_hex(16)


def all_pages(
    service: str, method: str, request: Any, items: str, scene: str = ""
) -> Steps[list[Any]]:
    """The items of a list, page after page."""
    found: list[Any] = []
    request.page_size = 1000
    while True:
        page = yield Unary(service, method, request, scene)
        found.extend(getattr(page, items))
        if not page.next_page_token:
            return found
        request.page_token = page.next_page_token
