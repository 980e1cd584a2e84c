"""The exceptions: one for each gRPC code that the contract uses."""

from __future__ import annotations

from dataclasses import dataclass
import os
from pathlib import Path
import re
import shlex
import shutil
from typing import Any

from google.protobuf import message as protobuf
import grpc

from pepeseg.enum_words import stage_name
from pepeseg.proxy import Proxy
from pepeseg.v1 import errors_pb2, job_service_pb2

_HTTP_STATUS = "Received http2 header with status: "
# Details have the names of google.rpc, so that other tools decode them.
_DETAIL = "type.googleapis.com/google.rpc."
_DOMAIN = "pepeseg"  # of our server's ErrorInfo
# How gRPC names an address of this machine to which it could not connect.
_NOBODY_HERE = re.compile(r"ipv4:(127\.[0-9.]+:[0-9]+)|(unix:[^\s:]+)")


@dataclass(frozen=True)
class Detail:
    """What the server says about an error, next to code and message. `retry_after`: seconds."""

    reason: str = ""
    field: str = ""
    resource: str = ""
    limit: str = ""
    value: str = ""
    retry_after: float | None = None


class PepesegError(Exception):
    """A call that failed. The subclass gives the kind, the fields the server's details.

    Attributes:
        message: for people.
        code: the gRPC code.
        reason: for programs and stable, such as "BAD_FIELD" or "NO_MODEL"; empty if the error did
            not come from the server.
        field: path of the request's field; may be empty.
        resource: name of the resource that is missing or prevents the call; may be empty.
        limit, value: the exceeded limit, and the value that exceeds it; may be empty.
        retry_after: seconds after which a repetition makes sense; None: waiting does not help.
    """

    def __init__(
        self,
        message: str,
        code: grpc.StatusCode = grpc.StatusCode.UNKNOWN,
        detail: Detail | None = None,
    ) -> None:
        super().__init__(message)
        self.message = message
        self.code = code
        known = detail or Detail()
        self.reason = known.reason
        self.field = known.field
        self.resource = known.resource
        self.limit = known.limit
        self.value = known.value
        self.retry_after = known.retry_after


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


def _seconds(message: Any, field: str) -> float | None:
    """Returns a duration of `message` in seconds; None: it is absent."""
    if not message.HasField(field):
        return None
    duration = getattr(message, field)
    seconds: float = duration.seconds + duration.nanos * 1e-9
    return seconds


def _parse_trailer(trailer: bytes) -> Detail | None:
    """Returns the details of a Status; None: they are not our server's."""
    packed = {any.type_url: any.value for any in errors_pb2.Status.FromString(trailer).details}

    def unpack(kind: Any) -> Any:
        return kind.FromString(packed.get(_DETAIL + kind.DESCRIPTOR.name, b""))

    info = unpack(errors_pb2.ErrorInfo)
    if info.domain != _DOMAIN:
        return None
    violations = unpack(errors_pb2.BadRequest).field_violations
    return Detail(
        reason=info.reason,
        field=violations[0].field if violations else "",
        resource=unpack(errors_pb2.ResourceInfo).resource_name,
        limit=info.metadata.get("limit", ""),
        value=info.metadata.get("value", ""),
        retry_after=_seconds(unpack(errors_pb2.RetryInfo), "retry_delay"),
    )


def _read_detail(metadata: object) -> Detail | None:
    for key, value in metadata or ():  # type: ignore[attr-defined]
        if key == "grpc-status-details-bin":
            try:
                return _parse_trailer(value)
            except protobuf.DecodeError:
                return None
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


def from_rpc(error: grpc.RpcError, proxy: Proxy | None = None) -> PepesegError:
    """Returns the exception for an error of gRPC, of a blocking or an asyncio call.

    `proxy`: the one through which the call went, if any.
    """
    code: grpc.StatusCode = error.code()
    message: str = error.details() or code.name
    detail = _read_detail(error.trailing_metadata())
    if detail is None and _HTTP_STATUS in message:
        status = int(message.split(_HTTP_STATUS)[1].split()[0])
        code = _FROM_HTTP.get(status, grpc.StatusCode.UNAVAILABLE)
        message = f"a proxy on the way to the server answered with HTTP {status}"
    elif detail is None and code == grpc.StatusCode.UNAVAILABLE:
        by_proxy = proxy.explain(message) if proxy is not None else ""
        message = by_proxy or message + start_advice(message)
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
    stage = f" in stage {stage_name(job.stage)}" if job.stage else ""
    if job.state == job_service_pb2.JOB_STATE_FAILED:
        failure = job.error
        code = next((c for c in grpc.StatusCode if c.value[0] == failure.code))
        detail = Detail(
            failure.reason,
            failure.field,
            failure.resource,
            failure.limit,
            failure.value,
            _seconds(failure, "retry_after"),
        )
        error = JobFailedError(f"{job.name} failed{stage}: {failure.message}", code, detail)
    elif job.state == job_service_pb2.JOB_STATE_CANCELLED:
        error = JobCancelledError(f"{job.name} was cancelled{stage}", grpc.StatusCode.CANCELLED)
    else:
        return None
    error.job = job
    return error
