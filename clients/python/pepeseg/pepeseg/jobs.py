"""Jobs: watching, waiting for and cancelling them."""

from __future__ import annotations

from collections.abc import Callable
import warnings

from pepeseg import errors
from pepeseg.calls import Pause, Place, Receive, Steps, Unary, all_pages
from pepeseg.enum_words import stage_name, term_name
from pepeseg.progress import Bar
from pepeseg.scenes import Model, get_model
from pepeseg.v1 import job_service_pb2

_RETRIES = 10
_RETRY_SECONDS = 3.0
_ENDED = (
    job_service_pb2.JOB_STATE_SUCCEEDED,
    job_service_pb2.JOB_STATE_FAILED,
    job_service_pb2.JOB_STATE_CANCELLED,
)

OnEvent = Callable[[job_service_pb2.JobEvent], None]


def job_name(job: job_service_pb2.Job | str) -> str:
    name: str = job.name if isinstance(job, job_service_pb2.Job) else job
    return name if name.startswith("jobs/") else f"jobs/{name}"


class Watch:
    """A watch of a job that continues over new streams after lost connections."""

    def __init__(self, job: job_service_pb2.Job | str, after: int | None = None) -> None:
        self._request = job_service_pb2.WatchJobRequest(name=job_name(job), after_sequence=after)
        self._sequence = after
        self._sequence_at_break = after
        self._failures = 0
        self.ended = False

    def stream(self, take: OnEvent) -> Receive:
        """Returns the next stream, which begins after the last event seen."""
        if self._sequence is not None:
            self._request.after_sequence = self._sequence
        return Receive("jobs", "WatchJob", self._request, "", take)

    def see(self, event: job_service_pb2.JobEvent) -> bool:
        """Records an event's sequence. Returns whether the caller should see it (no heartbeat)."""
        self._sequence = event.sequence
        kind = event.WhichOneof("event")
        if kind == "state_changed":
            self.ended = event.state_changed.state in _ENDED
        elif kind == "snapshot":
            self.ended = event.snapshot.state in _ENDED
        return kind not in ("heartbeat", None)

    def pause_after(self, error: errors.PepesegError) -> float:
        """Returns the seconds until the next stream, or raises `error` if there is none."""
        lost = isinstance(error, (errors.UnavailableError, errors.DeadlineExceededError))
        if self._sequence != self._sequence_at_break:
            self._failures = 0
        self._sequence_at_break = self._sequence
        self._failures += 1
        if not lost or self._sequence is None or self._failures > _RETRIES:
            raise error
        return _RETRY_SECONDS


def _time_left(progress: job_service_pb2.JobProgress) -> str:
    """ "about 5 min left, stage 3 of 5"."""
    seconds = progress.job_eta.ToTimedelta().total_seconds()
    about = f"{seconds:.0f} s" if seconds < 60 else f"{seconds / 60:.0f} min"
    if not progress.num_stages:
        return f"about {about} left"
    return f"about {about} left, stage {progress.stage_number} of {progress.num_stages}"


def wait_text(wait: job_service_pb2.Job.Wait) -> str:
    """What a queued job waits for: "after 2 others, when a device is free". Empty: not known."""
    if wait.reason == job_service_pb2.Job.Wait.REASON_DEVICE:
        others = f"{wait.jobs_ahead} other{'s' if wait.jobs_ahead > 1 else ''}"
        place = f"after {others}" if wait.jobs_ahead else "next"
        return f"{place}, when a device is free"
    if wait.reason == job_service_pb2.Job.Wait.REASON_QUOTA:
        return "until another job of its project ends, by its quota"
    if wait.reason == job_service_pb2.Job.Wait.REASON_RETRY:
        return "until the next attempt, after a pause"
    return ""


def _show(event: job_service_pb2.JobEvent, bar: Bar) -> None:
    kind = event.WhichOneof("event")
    if kind == "snapshot" and event.snapshot.HasField("wait"):
        bar.say(f"queued: {wait_text(event.snapshot.wait)}")
    elif kind == "progress":
        progress = event.progress
        notes = [_time_left(progress)] if progress.HasField("job_eta") else []
        if progress.HasField("loss"):
            notes.append(f"loss {progress.loss:.4f}")
        if progress.HasField("psnr"):
            notes.append(f"{progress.psnr:.2f} dB")
        if progress.num_gaussians:
            notes.append(f"{progress.num_gaussians} Gaussians")
        title = f"{stage_name(progress.stage)} {progress.activity}".rstrip()
        bar.show(title, progress.step, progress.num_steps, ", ".join(notes))
    elif kind == "warning":
        bar.say(f"warning: {event.warning.message}")
    elif kind == "term_skipped":
        skipped = event.term_skipped
        term = term_name(skipped.term)
        bar.say(f"{stage_name(skipped.stage)}: {term} skipped: {skipped.reason}")
    elif kind == "stage_ended":
        bar.close()
        ended = event.stage_ended
        if ended.skipped:
            bar.say(f"{stage_name(ended.stage)}: skipped: {ended.skipped}")


def wait(
    at: Place,
    job: job_service_pb2.Job | str,
    *,
    progress: bool = False,
    on_event: OnEvent | None = None,
) -> Steps[Model]:
    """Waits for the end of a job. A lost server is called again.

    Args:
        job: as `start_training` returns it, or its name.
        progress: whether a bar is shown on standard error.
        on_event: called with each event of the contract except heartbeats.

    Raises:
        JobFailedError, JobCancelledError: the job failed or was cancelled.
        NotFoundError: no such job.
        UnavailableError: the server did not come back for half a minute.
    """
    watch = Watch(job)
    bar = Bar("step") if progress else None
    shown: set[str] = set()  # warnings that the bar has shown

    def take(event: job_service_pb2.JobEvent) -> None:
        if not watch.see(event):
            return
        if bar is not None and event.WhichOneof("event") == "warning":
            shown.add(event.warning.message)
        if bar is not None:
            _show(event, bar)
        if on_event is not None:
            on_event(event)

    try:
        while not watch.ended:
            try:
                yield watch.stream(take)
                break
            except errors.PepesegError as error:
                if watch.ended:
                    break
                pause = watch.pause_after(error)
            yield Pause(pause)
    finally:
        if bar is not None:
            bar.close()
    ended = yield Unary("jobs", "GetJob", job_service_pb2.GetJobRequest(name=job_name(job)))
    failure = errors.outcome(ended)
    if failure is not None:
        raise failure
    made = yield from get_model(at, ended.model)
    for advice in made.advice:
        if advice not in shown:
            warnings.warn(advice, stacklevel=2)
    return made


def cancel(at: Place, job: job_service_pb2.Job | str) -> Steps[job_service_pb2.Job]:
    """Cancels a job, which ends soon after. A job that has ended stays as it is.

    Raises:
        NotFoundError: no such job.
    """
    request = job_service_pb2.CancelJobRequest(name=job_name(job))
    answer: job_service_pb2.Job = yield Unary("jobs", "CancelJob", request)
    return answer


def list_jobs(at: Place) -> Steps[list[job_service_pb2.Job]]:
    """Lists the scene's jobs, newest first."""
    request = job_service_pb2.ListJobsRequest(scene=at.scene)
    return (yield from all_pages("jobs", "ListJobs", request, "jobs", at.scene))
