"""The exceptions: one for each gRPC code that the contract uses."""

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
    """A call that failed. The subclass gives the kind, the fields the server's details.

    Attributes:
        message: for people.
        code: the gRPC code.
        reason: for programs and stable, such as "BAD_FIELD" or "NO_MODEL"; empty if the error did
            not come from the server.
        field, resource, limit, value: as in ErrorDetail of the contract; may be empty.
        retry_after: seconds after which a repetition makes sense; None: waiting does not help.
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
    """A value or a file is refused (`field`, `value`, `limit`), by the server or before sending."""


class NotFoundError(PepesegError, LookupError):
    """No such scene, job, view, label, selection (`resource`) or local file."""


class AlreadyExistsError(PepesegError):
    """The name is taken (`resource`)."""


class FailedPreconditionError(PepesegError):
    """The state does not allow it, such as a scene without a model."""


class AbortedError(PepesegError):
    """The scene has a training queued or running: `resource` is the job."""


class OutOfRangeError(PepesegError):
    """An offset or an event's sequence that does not exist."""


class DataLossError(PepesegError):
    """Bytes that fail their checksum, on the way or on the server's disk."""


class ResourceExhaustedError(PepesegError):
    """A limit or quota of the server is reached: `value` is needed, `limit` allowed."""


class UnavailableError(PepesegError):
    """No server answers, or it is stopping or too busy (`retry_after`)."""


class UnauthenticatedError(PepesegError):
    """No key, or one that is unknown, revoked or expired."""


class PermissionDeniedError(PepesegError):
    """The key lacks the scope (`limit`), or the resource is not its project's."""


class CancelledError(PepesegError):
    """The call was cancelled."""


class DeadlineExceededError(PepesegError):
    """The call, or a stage of a job, exceeded its time limit."""


class InternalError(PepesegError):
    """A fault of the server."""


class UnimplementedError(PepesegError):
    """The server does not have the method."""


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

# HTTP statuses of proxies, as gRPC codes.
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
    """Returns how to start a server if gRPC found none on this machine; empty if the address is
    another machine's, or no server program is found.
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
    """Returns the exception for an error of gRPC, of a blocking or an asyncio call."""
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
    """Returns the error for an argument that is refused before sending."""
    return InvalidArgumentError(message, grpc.StatusCode.INVALID_ARGUMENT)


def not_there(message: str) -> NotFoundError:
    """Returns the error for a local file or folder that does not exist."""
    return NotFoundError(message, grpc.StatusCode.NOT_FOUND)


def damaged(message: str) -> DataLossError:
    """Returns the error for bytes from the server that are damaged."""
    return DataLossError(message, grpc.StatusCode.DATA_LOSS)


def outcome(job: job_service_pb2.Job) -> JobFailedError | JobCancelledError | None:
    """Returns why a job that has ended has no model, None if it has one."""
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
