"""What can go wrong, as exceptions: one for each gRPC code that the contract uses."""

from __future__ import annotations

import os
from pathlib import Path
import re
import shlex
import shutil

from google.protobuf import message as protobuf
import grpc

from pepeseg.v1 import errors_pb2, job_service_pb2

_HTTP_STATUS = "Received http2 header with status: "
# How gRPC names an address of this machine to which it could not connect.
_NOBODY_HERE = re.compile(r"ipv4:(127\.[0-9.]+:[0-9]+)|(unix:[^\s:]+)")


class PepesegError(Exception):
    """A call that failed. Subclasses tell the kind; the fields what the server says of it.

    Attributes:
        message: for people.
        code: the gRPC code.
        reason: stable and for programs, as "BAD_FIELD" or "NO_MODEL"; empty where the answer did
            not come from the server.
        field, resource, limit, value: as in ErrorDetail of the contract; may be empty.
        retry_after: seconds after which asking again makes sense; None: not by waiting.
    """

    def __init__(
        self,
        message: str,
        code: grpc.StatusCode = grpc.StatusCode.UNKNOWN,
        detail: errors_pb2.ErrorDetail | None = None,
    ) -> None:
        super().__init__(message)
        self.message = message
        self.code = code
        self.reason: str = detail.reason if detail else ""
        self.field: str = detail.field if detail else ""
        self.resource: str = detail.resource if detail else ""
        self.limit: str = detail.limit if detail else ""
        self.value: str = detail.value if detail else ""
        self.retry_after: float | None = None
        if detail is not None and detail.HasField("retry_after"):
            self.retry_after = detail.retry_after.seconds + detail.retry_after.nanos * 1e-9


class InvalidArgumentError(PepesegError, ValueError):
    """A value or a file is refused: `field`, `value`, `limit`. Also what is refused unsent."""


class NotFoundError(PepesegError, LookupError):
    """No such scene, job, view, label, selection (`resource`) or local file."""


class AlreadyExistsError(PepesegError):
    """The name is taken (`resource`)."""


class FailedPreconditionError(PepesegError):
    """Not in a state that allows it, as a scene without a model."""


class AbortedError(PepesegError):
    """The scene has a training queued or running: `resource` is the job."""


class OutOfRangeError(PepesegError):
    """An offset, or a number of an event, that does not exist."""


class DataLossError(PepesegError):
    """Bytes that fail their checksum, on the way or on the server's disk."""


class ResourceExhaustedError(PepesegError):
    """A limit or quota of the server: `value` needed, `limit` had."""


class UnavailableError(PepesegError):
    """No server answers, or it is stopping or too busy (`retry_after`)."""


class UnauthenticatedError(PepesegError):
    """No key, or none that opens anything."""


class PermissionDeniedError(PepesegError):
    """The key lacks the scope (`limit`), or what is named is not its project's."""


class CancelledError(PepesegError):
    """The call was cancelled."""


class DeadlineExceededError(PepesegError):
    """The call, or a stage of a job, took longer than it may."""


class InternalError(PepesegError):
    """A fault of the server."""


class UnimplementedError(PepesegError):
    """The server does not know the call."""


class JobFailedError(PepesegError):
    """A training failed. `job`: the job, with its error."""

    job: job_service_pb2.Job


class JobCancelledError(PepesegError):
    """A training was cancelled. `job`: the job."""

    job: job_service_pb2.Job


_CLASSES: dict[grpc.StatusCode, type[PepesegError]] = {
    grpc.StatusCode.INVALID_ARGUMENT: InvalidArgumentError,
    grpc.StatusCode.NOT_FOUND: NotFoundError,
    grpc.StatusCode.ALREADY_EXISTS: AlreadyExistsError,
    grpc.StatusCode.FAILED_PRECONDITION: FailedPreconditionError,
    grpc.StatusCode.ABORTED: AbortedError,
    grpc.StatusCode.OUT_OF_RANGE: OutOfRangeError,
    grpc.StatusCode.DATA_LOSS: DataLossError,
    grpc.StatusCode.RESOURCE_EXHAUSTED: ResourceExhaustedError,
    grpc.StatusCode.UNAVAILABLE: UnavailableError,
    grpc.StatusCode.UNAUTHENTICATED: UnauthenticatedError,
    grpc.StatusCode.PERMISSION_DENIED: PermissionDeniedError,
    grpc.StatusCode.CANCELLED: CancelledError,
    grpc.StatusCode.DEADLINE_EXCEEDED: DeadlineExceededError,
    grpc.StatusCode.INTERNAL: InternalError,
    grpc.StatusCode.UNIMPLEMENTED: UnimplementedError,
}

# What a proxy on the way means by an HTTP status.
_FROM_HTTP = {
    401: grpc.StatusCode.UNAUTHENTICATED,
    403: grpc.StatusCode.PERMISSION_DENIED,
    407: grpc.StatusCode.PERMISSION_DENIED,
    413: grpc.StatusCode.RESOURCE_EXHAUSTED,
    429: grpc.StatusCode.RESOURCE_EXHAUSTED,
    431: grpc.StatusCode.RESOURCE_EXHAUSTED,
}


def _read_detail(metadata: object) -> errors_pb2.ErrorDetail | None:
    for key, value in metadata or ():  # type: ignore[attr-defined]
        if key != "grpc-status-details-bin":
            continue
        try:
            status = errors_pb2.Status.FromString(value)
        except protobuf.DecodeError:
            return None
        for packed in status.details:
            detail = errors_pb2.ErrorDetail()
            if packed.Unpack(detail):
                return detail
    return None


def start_advice(message: str) -> str:
    """How to get a server where gRPC found none on this machine; empty: it is elsewhere, or no
    server program is found.
    """
    place = _NOBODY_HERE.search(message)
    built = Path(__file__).parents[4] / "build" / "bin" / "pepesegd"
    program = str(built) if os.access(built, os.X_OK) else shutil.which("pepesegd")
    if place is None or program is None:
        return ""
    address = place[1] or place[2]
    listen = "" if address == "127.0.0.1:50051" else f" --listen {shlex.quote(address)}"
    return f"; is a server listening there? Start one with `{shlex.quote(program)}{listen}`"


def from_rpc(error: grpc.RpcError) -> PepesegError:
    """The exception for what gRPC raised, of a call of either kind."""
    code: grpc.StatusCode = error.code()
    message: str = error.details() or code.name
    detail = _read_detail(error.trailing_metadata())
    if detail is None and _HTTP_STATUS in message:
        status = int(message.split(_HTTP_STATUS)[1].split()[0])
        code = _FROM_HTTP.get(status, grpc.StatusCode.UNAVAILABLE)
        message = f"a proxy on the way to the server answered with HTTP {status}"
    elif detail is None and code == grpc.StatusCode.UNAVAILABLE:
        message += start_advice(message)
    return _CLASSES.get(code, PepesegError)(message, code, detail)


def refused(message: str) -> InvalidArgumentError:
    """What is refused without asking the server."""
    return InvalidArgumentError(message, grpc.StatusCode.INVALID_ARGUMENT)


def not_there(message: str) -> NotFoundError:
    """Something that is looked for here and not found."""
    return NotFoundError(message, grpc.StatusCode.NOT_FOUND)


def damaged(message: str) -> DataLossError:
    """Bytes from the server that are not what they say."""
    return DataLossError(message, grpc.StatusCode.DATA_LOSS)


def outcome(job: job_service_pb2.Job) -> JobFailedError | JobCancelledError | None:
    """Why a job that has ended has no model; None: it has one."""
    error: JobFailedError | JobCancelledError
    stage = f" in stage {job.stage}" if job.stage else ""
    if job.state == job_service_pb2.JOB_STATE_FAILED:
        detail = errors_pb2.ErrorDetail()
        unpacked = any(packed.Unpack(detail) for packed in job.error.details)
        code = next((c for c in grpc.StatusCode if c.value[0] == job.error.code))
        error = JobFailedError(
            f"{job.name} failed{stage}: {job.error.message}", code, detail if unpacked else None
        )
    elif job.state == job_service_pb2.JOB_STATE_CANCELLED:
        error = JobCancelledError(f"{job.name} was cancelled{stage}", grpc.StatusCode.CANCELLED)
    else:
        return None
    error.job = job
    return error
