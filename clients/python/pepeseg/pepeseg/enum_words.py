"""Stages of a training and its skipped parts, as people read them."""

from __future__ import annotations

from typing import Any

from pepeseg.v1 import job_service_pb2


def _word(values: Any, value: int, prefix: str) -> str:
    """Returns the name of a value in lower case without `prefix`; empty for UNSPECIFIED, and the
    number of a value that this package does not know, which a newer server sends."""
    known = values.DESCRIPTOR.values_by_number.get(value)
    if value == 0:
        return ""
    name: str = known.name if known else str(value)
    return name.removeprefix(prefix).lower()


def stage_name(stage: int) -> str:
    """Returns a stage's name: "reconstruct" for JOB_STAGE_RECONSTRUCT; empty before the first."""
    return _word(job_service_pb2.JobStage, stage, "JOB_STAGE_")


def term_name(term: int) -> str:
    """Returns the name of a skipped part of a stage: "depth" for TERM_DEPTH."""
    return _word(job_service_pb2.JobEvent.TermSkipped.Term, term, "TERM_")
