"""The projects beside the open one: those in the folder that it is in, and whether a station could open each."""

import fcntl
from pathlib import Path

from flight import FlightError, project
from flight.project import Project
from gcs_web.protocol import projects as messages

MOST = 200
"""Listed, in the order of their folders' names."""


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
