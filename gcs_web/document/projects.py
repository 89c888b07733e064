"""The projects beside the open one and those opened before, whether a station could open each, and a new one."""

import fcntl
import hashlib
import os
from collections.abc import Sequence
from pathlib import Path

import msgspec

from flight import FlightError, InputError, project
from flight.project import Project
from gcs_web.document import recent
from gcs_web.protocol import projects as messages
from gcs_web.protocol.wording import for_page

MOST = 200
"""Listed, in the order of their folders' names."""


def offered(opened: Project, before: Sequence[Path] = ()) -> list[messages.ProjectEntry]:
    """The open project and its neighbours, then those of elsewhere that were opened before."""
    return [entry for entry, _ in _placed(opened, before)]


def found(opened: Project, before: Sequence[Path], key: str) -> tuple[messages.ProjectEntry, Path]:
    """The one that is offered by this key and can be opened, and its folder.

    Raises:
        InputError: there is none.
    """
    for entry, folder in _placed(opened, before):
        if entry.folder == key and not entry.current:
            if entry.problem:
                raise InputError(f"{entry.name} cannot be opened: {entry.problem}")
            return entry, folder
    raise InputError(f"there is no other project {key!r} to open (any more)")


def _placed(opened: Project, before: Sequence[Path]) -> list[tuple[messages.ProjectEntry, Path]]:
    here = opened.folder.resolve().parent
    near = [(entry, here / entry.folder) for entry in beside(opened)]
    return [*near, *((_elsewhere(folder), folder) for folder in before if folder.parent != here)]


def create_beside(opened: Project, name: str) -> Path:
    """A new empty project in the folder that the open one is in.

    Raises:
        InputError: the name cannot be that of a folder, something has it, or nothing can be written there.
    """
    name = name.strip()
    folder = opened.folder.resolve().parent / project.part_name(name)
    if os.path.lexists(folder):
        raise InputError(f"there is something named {name!r} beside this project; take another name")
    try:
        return project.create(folder, name).folder
    except OSError as error:
        raise InputError(f"{name!r} cannot be made beside this project: {error.strerror}") from None


def _elsewhere(folder: Path) -> messages.ProjectEntry:
    """By a key that does not tell where it is."""
    key = "before-" + hashlib.sha256(os.fsencode(folder)).hexdigest()[:16]
    return msgspec.structs.replace(_entry(folder, current=False), folder=key, where=folder.parent.name)


def beside(opened: Project) -> list[messages.ProjectEntry]:
    """The open project and its neighbours."""
    here = opened.folder.resolve()
    try:
        folders = sorted(path for path in here.parent.iterdir() if recent.is_there(path))
    except OSError:
        folders = [here]
    return [_entry(folder, current=folder == here) for folder in folders[:MOST]]


def _entry(folder: Path, *, current: bool) -> messages.ProjectEntry:
    try:
        opened = project.open_project(folder)
    except (FlightError, OSError) as error:
        return messages.ProjectEntry(folder.name, folder.name, current, 0, 0, for_page(str(error), folder))
    problem = "" if current else _problem(opened)
    return messages.ProjectEntry(
        folder.name, opened.name, current, len(opened.trajectories()), len(opened.flights()), problem
    )


def _problem(opened: Project) -> str:
    return "another ground station has it open" if _is_locked(opened.folder / ".session" / "lock") else ""


def _is_locked(path: Path) -> bool:
    try:
        with open(path, "rb") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)  # given back as the file closes
    except FileNotFoundError:
        return False
    except OSError:
        return True
    return False
