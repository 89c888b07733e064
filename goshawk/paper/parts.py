"""The parts of the paper that are done again, each with its numbers and its pictures, and what is made of them."""

import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flight import FlightError, FormatError, InputError, Progress, file_format
from goshawk.paper import theirs

FORMAT, VERSION = "goshawk-paper", 1
FACTS, PAGE = "paper.json", "paper.html"
RUNS = 4
"""Flights of each rung on each course."""


@dataclass(frozen=True, slots=True)
class Part:
    title: str
    made: str
    """Whether our numbers are rendered or simulated."""
    work: Callable[[Path, Progress], Any]
    """Writes its pictures into a folder of its own; what it returns fits into JSON."""


def identify(folder: Path, progress: Progress) -> Any:
    from goshawk.paper import identified

    trials = identified.found(identified.TRIALS, progress)
    identified.draw(trials, folder)
    return identified.facts(trials)


def track(folder: Path, progress: Progress) -> Any:
    from goshawk.paper import ladder
    from sysid.report import drawing

    rungs = (*ladder.THEIRS, ladder.DELIVERED)
    found = ladder.measured(ladder.courses(), rungs, RUNS, progress)
    drawing.written(ladder.drawn(found, rungs), folder / ladder.PICTURE)
    more = (ladder.THEIRS[-1], ladder.DELIVERED)
    found |= ladder.measured([ladder.general()], more, RUNS, progress)
    return [
        _tracked(course.title, rung.name, course.flown_cm.get(rung.name), found[course.name, rung.name].tolist())
        for course in (*ladder.courses(), ladder.general())
        for rung in rungs
        if (course.name, rung.name) in found
    ]


def _tracked(course: str, rung: str, theirs_cm: float | None, runs_cm: Sequence[float]) -> dict[str, Any]:
    """Mean tracking errors in centimetres: theirs in flight, None where they have no such controller; ours by run."""
    return {
        "course": course, "controller": rung, "theirs_cm": theirs_cm, "ours_cm": float(np.mean(runs_cm)),
        "runs_cm": list(runs_cm),
    }  # fmt: skip


def plan(folder: Path, progress: Progress) -> Any:
    from goshawk.paper import path

    flown = path.flown(folder, path.PAIRS, progress)
    path.draw(flown, folder)
    return path.facts(flown)


PARTS = {
    "vehicle": Part("Their vehicle, identified (Table I, Fig. 8)", "simulated", identify),
    "ladder": Part("Tracking, with ever more of the model", "simulated", track),
    "path": Part("A path planned in a map, and flown", "rendered images, simulated flight", plan),
}


def run(folder: Path, names: Sequence[str], progress: Progress) -> tuple[dict[str, Any], dict[str, str]]:
    """Do the named parts one by one, each in a folder of its name; what each came to, and why others failed. After
    Ctrl-C, those before.

    Raises:
        FlightError: of the first, if all failed.
        KeyboardInterrupt: before the first was done.
    """
    done: dict[str, Any] = {}
    failed: dict[str, FlightError] = {}
    for name in names:
        own = folder / name
        try:
            own.mkdir()
            done[name] = PARTS[name].work(own, progress)
        except FlightError as error:
            failed[name] = error
            shutil.rmtree(own)
        except KeyboardInterrupt:
            if not done:
                raise
            shutil.rmtree(own, ignore_errors=True)
            break
    if failed and not done:
        raise next(iter(failed.values()))
    return done, {name: str(error) for name, error in failed.items()}


def take_over(earlier: Path, folder: Path, names: Sequence[str]) -> dict[str, Any]:
    """Copy the named parts of an earlier result, as far as it has them, into a new one; what each came to."""
    if not names or not is_ours(earlier):
        return {}
    facts = file_format.read_json(earlier / FACTS, format=FORMAT, version=VERSION)
    found = [name for name in names if name in facts and (earlier / name).is_dir()]
    for name in found:
        shutil.copytree(earlier / name, folder / name)
    return {name: facts[name] for name in found}


def write(
    folder: Path,
    done: Mapping[str, Any],
    *,
    missing: Sequence[str] = (),
    failed: Mapping[str, str] | None = None,
    taken_over: Sequence[str] = (),
) -> dict[str, Any]:
    """Write `paper.json` and `paper.html`; returns the document.

    Args:
        missing: parts that were asked for, and cut off.
        failed: parts that failed, with the reason.
        taken_over: parts that an earlier run did.
    """
    from goshawk.paper import page

    done = {name: done[name] for name in PARTS if name in done}
    document = {
        "paper": theirs.TITLE, "figures": theirs.FIGURES, "cut_off": list(missing), "failed": dict(failed or {}),
        "taken_over": list(taken_over),
        "made": {name: PARTS[name].made for name in done}, **done,
    }  # fmt: skip
    file_format.write_json(folder / FACTS, format=FORMAT, version=VERSION, body=document)
    page.write(folder / PAGE, document, {name: PARTS[name].title for name in done})
    return document


def is_ours(folder: Path) -> bool:
    """Whether a folder holds what `write` writes."""
    try:
        file_format.read_json(folder / FACTS, format=FORMAT, version=VERSION)
    except (InputError, FormatError):
        return False
    return True
