"""Background work of the station, one job at a time: a queue, a list of what was done, and the kinds of jobs.

A kind states its name, its arguments (a struct whose fields the page shows as a form), the function that does the work
in a process of its own, and what becomes of the result. The kinds come from whoever starts the station, so that they
can call what the verbs call.
"""

import logging
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Generic, Literal, TypeVar

import msgspec

from flight import FlightError, InputError
from flight.project import Project
from gcs_web.jobs.job_process import BEHIND_THE_PAGE, Done, JobProcess, Work
from gcs_web.protocol import jobs as jobs_messages
from gcs_web.protocol.jobs import Job, JobField, JobKind
from gcs_web.protocol.wording import for_page

logger = logging.getLogger(__name__)

Station = TypeVar("Station")
"""What a kind of job gives its result to: `gcs_web.desk.Desk`."""

MOST_WAITING, MOST_KEPT = 20, 30
"""Jobs that may wait, and finished ones that stay in the list."""
_TOLD_EVERY_S = 0.25
_EARLY = 0.03
"""Share of a stage before which its remaining time is a guess that nobody should see."""

Choices = Mapping[str, Sequence[str]]
"""For fields of a kind's arguments: the values that can be chosen now."""


def _no_choices(_: Project) -> Choices:
    return {}


def _nothing_foreseen(_: Project, __: Any) -> str:
    return ""


def _nothing_written(_: Project, __: Any) -> Path | None:
    return None


def _accept(_: Project, __: Any) -> None:
    """Of a kind whose arguments need no look at the project."""


_WAYS_OUT = "wait for its result, cancel it, or choose another name"


@dataclass(frozen=True, slots=True)
class Kind(Generic[Station]):
    """A kind of job: one small file makes one."""

    name: str
    title: str
    """As people read it: "Plan a folder of missions"."""
    arguments: type[msgspec.Struct]
    """Fields of type str, int, float, bool or list[str], each `Annotated` with a `msgspec.Meta` of title, description,
    bounds, and `extra_json_schema={"unit": ...}`."""
    run: Work
    """In a process of its own; raises `FlightError` where it fails."""
    done: Callable[[Station, Any], str]
    """In the station: use the result, and return what came of it in words."""
    choices: Callable[[Project], Choices] = _no_choices
    check: Callable[[Project, Any], None] = _accept
    """Before the job is taken: raises `InputError` where it could not succeed."""
    foresee: Callable[[Project, Any], str] = _nothing_foreseen
    """What it would do, in words, for a person to read before it is started."""
    writes: Callable[[Project, Any], Path | None] = _nothing_written
    """File or folder of its result, which no other job that waits or runs may write; None where none is claimed."""
    given: Callable[[Station], Mapping[str, str]] | None = None
    """Arguments that the station gives, of which no form asks, when it is started: raises `InputError` where it has
    none. Their fields have the default ""."""
    beside: Callable[[Station, str], Callable[[], None]] | None = None
    """Of work that runs beside the queue until it is cancelled: uses its first stage, the address at which it serves,
    and returns what is to be done when it has ended."""


@dataclass(slots=True)
class _Job:
    id: int
    kind: Kind[Any]
    arguments: msgspec.Struct
    author: str
    state: Literal["waiting", "running", "done", "failed", "cancelled"] = "waiting"
    stage: str = ""
    share: float = 0.0
    words: str = ""
    began_s: float = 0.0
    ended_s: float = 0.0
    stage_began_s: float = 0.0
    process: JobProcess | None = None
    stop: threading.Event = field(default_factory=threading.Event)

    def shown(self) -> Job:
        running = self.state == "running"
        now_s = time.monotonic()
        end_s = now_s if running else self.ended_s
        left_s = (now_s - self.stage_began_s) * (1.0 / self.share - 1.0) if running and self.share > _EARLY else None
        return Job(
            self.id,
            self.kind.name,
            self.kind.title,
            self.state,
            self.author,
            stage=self.stage,
            share=round(self.share, 3),
            left_s=None if left_s is None else round(left_s, 1),
            elapsed_s=round(end_s - self.began_s, 1) if self.began_s else 0.0,
            words=self.words,
        )


class Jobs(Generic[Station]):
    """Thread-safe. `on_change` is called from any thread whenever the list has changed."""

    def __init__(
        self,
        opened: Project,
        kinds: Sequence[Kind[Station]],
        on_change: Callable[[], None],
        on_done: Callable[[Kind[Station], Any], str],
        on_end: Callable[[Job], None],
        on_serving: Callable[[Kind[Station], str], Callable[[], None]] = lambda _kind, _stage: lambda: None,
        on_start: Callable[[Kind[Station]], Mapping[str, str]] = lambda _: {},
    ) -> None:
        """
        Args:
            on_start: arguments of a kind that the station gives; may raise `InputError`.
            on_serving: uses the address at which a job beside the queue serves; may raise `FlightError`.
            on_done: uses a result and says what came of it; may raise `FlightError`.
            on_end: called with every job that ended.
        """
        self._project = opened
        self._kinds = {kind.name: kind for kind in kinds}
        self._on_change, self._on_done, self._on_end, self._on_serving = on_change, on_done, on_end, on_serving
        self._on_start = on_start
        self._jobs: list[_Job] = []
        self._last_id = 0
        self._closed = False
        self._changed = threading.Condition()
        self._offers: list[JobKind] = []
        self.look()
        self._told_s = 0.0
        self._thread = threading.Thread(target=self._serve, name="jobs", daemon=True)
        self._thread.start()

    def state(self) -> jobs_messages.Jobs:
        with self._changed:
            return jobs_messages.Jobs([job.shown() for job in self._jobs], self._offers)

    def look(self) -> None:
        """Find anew what can be chosen: not with each progress, as it searches the project's folders."""
        self._offers = [self._offered(kind) for kind in self._kinds.values()]

    def start(self, name: str, arguments: Mapping[str, Any], author: str) -> int:
        """Put a job into the queue; its id.

        Raises:
            InputError: no such kind, the arguments are not valid, another job writes the same result, too many jobs
                wait, or no more are taken.
        """
        if (named := self._kinds.get(name)) is not None and named.given is not None:
            arguments = {**arguments, **self._on_start(named)}  # not under our lock: it takes the station's
        kind, wanted = self._decoded(name, arguments)
        with self._changed:
            if self._closed:
                raise InputError("this project is being closed; start the job when it is open again")
            self._require_unclaimed(kind, wanted)
            kind.check(self._project, wanted)  # now: a result that is not claimed any more is on disk
            if sum(job.state == "waiting" for job in self._jobs) >= MOST_WAITING:
                raise InputError(f"{MOST_WAITING} jobs wait already; cancel one, or wait for them")
            if kind.beside is not None and any(job.kind is kind and not job.ended_s for job in self._jobs):
                raise InputError(f"{kind.title}: it runs already; cancel that one first")
            self._last_id += 1
            new = _Job(self._last_id, kind, wanted, author)
            self._jobs.append(new)
            ended = [job for job in self._jobs if job.ended_s]
            for old in ended[: max(len(ended) - MOST_KEPT, 0)]:
                self._jobs.remove(old)
            self._changed.notify_all()
            if kind.beside is not None:
                self._begin(new)
        if new.process is not None:
            args = (new, new.process)
            threading.Thread(target=self._finish, args=args, name=kind.name, daemon=True).start()
        self._on_change()
        return new.id

    def foresee(self, name: str, arguments: Mapping[str, Any]) -> str:
        """What a job would do; empty where the kind does not say. Raises as `start`."""
        kind, wanted = self._decoded(name, arguments)
        kind.check(self._project, wanted)
        return for_page(kind.foresee(self._project, wanted), self._project.folder)

    def end_if_idle(self) -> bool:
        """Take no more jobs, if none runs or waits, but for those beside the queue; whether that is so."""
        with self._changed:
            self._closed = self.is_idle
            return self._closed

    @property
    def is_idle(self) -> bool:
        """Whether no job runs or waits, but for those beside the queue."""
        with self._changed:
            return all(job.ended_s for job in self._jobs if job.kind.beside is None)

    def _decoded(self, name: str, arguments: Mapping[str, Any]) -> tuple[Kind[Station], msgspec.Struct]:
        if name not in self._kinds:
            raise InputError(f"there is no job {name!r}; there are {', '.join(self._kinds) or 'none'}")
        kind = self._kinds[name]
        try:
            wanted = msgspec.convert(arguments, kind.arguments)
        except msgspec.ValidationError as error:
            raise InputError(f"{kind.title}: {error}") from error
        return kind, wanted

    def _require_unclaimed(self, kind: Kind, wanted: msgspec.Struct) -> None:
        """Refuse a job whose result another one is about to write, or it would fail after its whole work."""
        place = kind.writes(self._project, wanted)
        for job in self._jobs:
            if place is not None and not job.ended_s and job.kind.writes(self._project, job.arguments) == place:
                started = f"{job.author} started {job.kind.title!r} already, which writes {place.name}"
                way_out = "wait for its result, or cancel it" if kind.given else _WAYS_OUT
                raise InputError(f"{started}: {way_out}")

    def cancel(self, number: int) -> None:
        """End a job that waits or runs.

        Raises:
            InputError: it is not there, or has ended.
        """
        with self._changed:
            job = self._job(number)
            if job.ended_s:
                raise InputError("that job has ended already")
            job.stop.set()
            if job.process is not None:
                job.process.cancel()
            elif job.state == "waiting":
                self._ended(job, "cancelled", "cancelled")
        self._on_change()

    def forget(self, number: int) -> None:
        """Take a job that has ended off the list.

        Raises:
            InputError: it is not there, or has not ended.
        """
        with self._changed:
            job = self._job(number)
            if not job.ended_s:
                raise InputError("that job has not ended; cancel it first")
            self._jobs.remove(job)
        self._on_change()

    def close(self) -> None:
        """End the running job with all that it started."""
        with self._changed:
            self._closed = True
            for job in self._jobs:
                if job.process is not None:
                    job.process.kill()
            self._changed.notify_all()
        self._thread.join(timeout=5.0)

    def _job(self, number: int) -> _Job:
        for job in self._jobs:
            if job.id == number:
                return job
        raise InputError("that job is not in the list (any more)")

    def _serve(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._closed or self._next() is not None)
                job = self._next()
                if self._closed or job is None:
                    return
                self._begin(job)
            self._on_change()
            if job.process is not None:
                self._finish(job, job.process)

    def _next(self) -> _Job | None:
        return next((job for job in self._jobs if job.state == "waiting" and job.kind.beside is None), None)

    def _begin(self, job: _Job) -> None:
        job.state, job.began_s = "running", time.monotonic()
        job.stage, job.stage_began_s = "starting", job.began_s
        log = self._project.folder / ".session" / f"job-{job.id}.log"
        niceness = BEHIND_THE_PAGE if job.kind.beside is None else 0
        try:
            job.process = JobProcess(job.kind.run, self._project.folder, job.arguments, log, niceness=niceness)
        except OSError as error:
            self._ended(job, "failed", f"no process could be started for it: {error.strerror}")

    def _finish(self, job: _Job, process: JobProcess) -> None:
        stopped: list[Callable[[], None]] = []
        refused = ""

        def progress(stage: str, fraction: float) -> None:
            nonlocal refused
            self._progressed(job, stage, fraction)
            if job.kind.beside is None or stopped:
                return
            try:
                stopped.append(self._on_serving(job.kind, stage))
            except FlightError as error:
                refused = str(error)
                process.cancel()

        outcome = process.outcome(progress)
        for act in stopped:
            act()
        state: Literal["done", "failed", "cancelled"] = "failed"
        if refused:
            words = refused
        elif job.stop.is_set():
            state, words = "cancelled", "cancelled"
        elif isinstance(outcome, Done):
            try:
                words, state = self._on_done(job.kind, outcome.result), "done"
            except FlightError as error:
                words = str(error)
            except Exception as error:  # the next job must still run
                logger.exception("the result of %s could not be used", job.kind.name)
                words = f"internal error: {error}; the station's log has more"
        else:
            words = outcome.reason
        with self._changed:
            job.process = None
            self._ended(job, state, words)
            shown, closed = job.shown(), self._closed
        if not closed:
            self.look()
            self._on_change()
            self._on_end(shown)

    def _ended(self, job: _Job, state: Literal["done", "failed", "cancelled"], words: str) -> None:
        job.state, job.words, job.ended_s = state, for_page(words, self._project.folder), time.monotonic()
        if state == "done":
            job.share = 1.0

    def _progressed(self, job: _Job, stage: str, fraction: float) -> None:
        now_s = time.monotonic()
        with self._changed:
            is_new = stage != job.stage
            if is_new:
                job.stage, job.stage_began_s = stage, now_s
            job.share = min(max(fraction, 0.0), 1.0)
            if not is_new and now_s - self._told_s < _TOLD_EVERY_S:
                return
            self._told_s = now_s
        self._on_change()

    def _offered(self, kind: Kind[Any]) -> JobKind:
        try:
            choices = kind.choices(self._project)
        except OSError:  # a folder that cannot be read, or went away just now
            logger.exception("what %s can be started with could not be found", kind.name)
            choices = {}
        schema = msgspec.json.schema_components([kind.arguments])[1][kind.arguments.__name__]
        asked = {name: told for name, told in schema["properties"].items() if not told.get("given")}
        fields = [_field(name, told, choices.get(name)) for name, told in asked.items()]
        return JobKind(kind.name, kind.title, fields)


_FORMS: dict[str, Literal["text", "number", "integer", "flag", "several"]] = {
    "string": "text", "number": "number", "integer": "integer", "boolean": "flag", "array": "several",
}  # fmt: skip


def _field(name: str, told: Mapping[str, Any], choices: Sequence[str] | None) -> JobField:
    """A field of a form, from its JSON schema."""
    form = _FORMS[told["type"]]
    first = "" if choices is None else next(iter(choices), "")
    empty: dict[str, Any] = {"several": [], "flag": False, "number": 0.0, "integer": 0}
    return JobField(
        name,
        told.get("title", name),
        told.get("description", ""),
        "choice" if form == "text" and choices is not None else form,
        told["default"] if "default" in told else empty.get(form, first),
        list(choices or ()),
        told.get("unit", ""),
    )
