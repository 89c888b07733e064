"""Messages about background work."""

from typing import Literal

import msgspec

from gcs_web.protocol.base import Command, State


class Job(msgspec.Struct, frozen=True):
    """Background work of the station."""

    id: int
    kind: str
    title: str
    state: Literal["waiting", "running", "done", "failed", "cancelled"]
    author: str
    """Name of who started it."""
    stage: str = ""
    """What is being done."""
    share: float = 0.0
    """Of the stage, 0 to 1."""
    left_s: float | None = None
    """Until the stage is done; None where it cannot be told yet."""
    elapsed_s: float = 0.0
    words: str = ""
    """What came of it, or why it failed."""


class JobField(msgspec.Struct, frozen=True):
    """One argument of a kind of job."""

    name: str
    title: str
    says: str
    form: Literal["text", "choice", "several", "number", "integer", "flag"]
    """`several`: any of the choices."""
    default: str | float | bool | list[str]
    choices: list[str]
    unit: str = ""


class JobKind(msgspec.Struct, frozen=True):
    name: str
    title: str
    fields: list[JobField]


class Jobs(State, frozen=True, tag="jobs"):
    """Background work, in the order it was asked for, and what kinds of it there are."""

    jobs: list[Job]
    kinds: list[JobKind]


class StartJob(Command, frozen=True, tag="start_job", kw_only=True):
    """Put background work into the station's queue."""

    kind: str
    arguments: dict[str, str | int | float | bool | list[str]]
    """By the names of the kind's fields."""


class ForeseeJob(Command, frozen=True, tag="foresee_job", kw_only=True):
    """Say what a job would do, without starting it; the reply has the words."""

    kind: str
    arguments: dict[str, str | int | float | bool | list[str]]


class CancelJob(Command, frozen=True, tag="cancel_job", kw_only=True):
    job: int


class ForgetJob(Command, frozen=True, tag="forget_job", kw_only=True):
    """Take a job that has ended off the list."""

    job: int


class ListJobs(Command, frozen=True, tag="list_jobs", kw_only=True):
    """Look again at what a job could work on: files may have come since."""
