"""What the jobs about flights share: which flights they take, read as the verbs read them."""

import functools
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import msgspec

from flight import FlightError, FlightLog, InputError, Progress
from flight.project import Project
from gcs_web.flights import reading
from gcs_web.jobs.job_process import Work
from gcs_web.jobs.jobs import Choices
from goshawk.commands.learn import fit_options
from goshawk.commands.learn.flights import refuse_repeated
from sysid.estimator.options import Options

BOXES = {"gaps='split'": 'the box "Take the pieces between them as flights of their own"'}
"""Arguments that the library's messages name, and what the page has in their place, in the list of flights."""


class Chosen(msgspec.Struct, forbid_unknown_fields=True):
    """Flights to learn from and flights that only judge."""

    learn: Annotated[list[str], msgspec.Meta(title="Learn from")]
    held_out: Annotated[list[str], msgspec.Meta(title="Hold out", description="Flights that only judge")] = []
    split_gaps: Annotated[bool, msgspec.Meta(title="Take the pieces between gaps as flights of their own")] = False


def choices(project: Project) -> Choices:
    names = [path.stem for path in project.flights()]
    return {"learn": names, "held_out": names}


def check(project: Project, asked: Chosen) -> None:
    """
    Raises:
        InputError: no flight, one that is not there, or the same one for both.
    """
    if not asked.learn:
        raise InputError("no flight to learn from is chosen; mark one with Learn in the list of flights")
    refuse_repeated([project.flight(name) for name in (*asked.learn, *asked.held_out)], "to learn from or held out")


def in_words_of(boxes: Mapping[str, str]) -> Callable[[Work], Work]:
    """A decorator of a job's work: its errors name the page's boxes instead of the library's arguments."""

    def decorated(run: Work) -> Work:
        @functools.wraps(run)
        def work(folder: Path, asked: Any, progress: Progress) -> Any:
            try:
                return run(folder, asked, progress)
            except FlightError as error:
                raise type(error)(fit_options.worded(str(error), boxes)) from error

        return work

    return decorated


def options(asked: Chosen) -> Options:
    """Of a comparison of the chosen flights."""
    return Options(unseen="hold", gaps="split" if asked.split_gaps else "refuse")


def diagnosis_options(asked: Chosen) -> Options:
    """As `goshawk diagnose` has them by default."""
    return replace(options(asked), gusts="white")


def contents(folder: Path, asked: Chosen) -> str:
    """Of the chosen logs; taken before they are read, so that a change in between shows."""
    return reading.contents(Project(folder, ""), [*asked.learn, *asked.held_out])


def logs(folder: Path, asked: Chosen, progress: Progress) -> tuple[list[FlightLog], list[FlightLog]]:
    """Those to learn from, and those held out, each with its name."""
    project = Project(folder, "")
    every = [*asked.learn, *asked.held_out]
    read = []
    for k, name in enumerate(every):
        progress("reading flights", k / len(every))
        read.append(reading.load(project, name))
    return read[: len(asked.learn)], read[len(asked.learn) :]
