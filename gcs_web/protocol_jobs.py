"""Messages about background work; see `gcs_web.protocol`."""

import msgspec

from gcs_web.protocol_base import Command
from gcs_web.protocol_parts import Job, JobKind


class Jobs(msgspec.Struct, frozen=True, tag="jobs"):
    """Background work, in the order it was asked for, and what kinds of it there are."""

    jobs: list[Job]
    kinds: list[JobKind]


class StartJob(Command, frozen=True, tag="start_job", kw_only=True):
    """Put background work into the station's queue."""

    kind: str
    arguments: dict[str, str | float | bool | list[str]]
    """By the names of the kind's fields."""


class ForeseeJob(Command, frozen=True, tag="foresee_job", kw_only=True):
    """Say what a job would do, without starting it; the reply has the words."""

    kind: str
    arguments: dict[str, str | float | bool | list[str]]


class CancelJob(Command, frozen=True, tag="cancel_job", kw_only=True):
    job: int


class ForgetJob(Command, frozen=True, tag="forget_job", kw_only=True):
    """Take a job that has ended off the list."""

    job: int


class ListJobs(Command, frozen=True, tag="list_jobs", kw_only=True):
    """Look again at what a job could work on: files may have come since."""
