"""The projects beside the open one and those opened before, whether a station could open each, and a new one."""

import fcntl
from collections.abc import Sequence
from pathlib import Path

import msgspec

from flight import FlightError, InputError, project
from flight.project import Project
from gcs_web.protocol import projects as messages

MOST = 200
"""Listed, in the order of their folders' names."""


def offered(opened: Project, before: Sequence[Path] = ()) -> list[messages.ProjectEntry]:
    """The open project and its neighbours, then those of elsewhere that were opened before."""
    near = beside(opened)
    here = opened.folder.resolve().parent
    far = [folder for folder in before if folder.parent != here]
    return [*near, *(_elsewhere(folder) for folder in far)]


def create_beside(opened: Project, name: str) -> Path:
    """A new empty project in the folder that the open one is in.

    Raises:
        InputError: the name cannot be that of a folder, or something has it.
    """
    folder = opened.folder.resolve().parent / project.part_name(name.strip())
    if folder.exists():
        raise InputError(f"there is something named {name.strip()!r} beside this project; take another name")
    return project.create(folder, name.strip()).folder


def _elsewhere(folder: Path) -> messages.ProjectEntry:
    entry = _entry(folder, current=False)
    return msgspec.structs.replace(entry, folder=str(folder), where=folder.parent.name)


def beside(opened: Project) -> list[messages.ProjectEntry]:
    """The open project and its neighbours."""
    here = opened.folder.resolve()
    try:
        folders = sorted(path for path in here.parent.iterdir() if (path / "project.toml").is_file())
    except OSError:
        folders = [here]
    return [_entry(folder, current=folder == here) for folder in folders[:MOST]]


def _entry(folder: Path, *, current: bool) -> messages.ProjectEntry:
    try:
        opened = project.open_project(folder)
    except FlightError as error:
        return messages.ProjectEntry(folder.name, folder.name, current, 0, 0, str(error))
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
