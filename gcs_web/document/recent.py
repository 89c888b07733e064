"""The projects that were opened on this machine before, the newest first: a small file of the user's own."""

import contextlib
import json
import os
from pathlib import Path

from flight import file_format

MOST = 12


def default_file() -> Path:
    """In `XDG_STATE_HOME`, else `~/.local/state`."""
    state = os.environ.get("XDG_STATE_HOME")
    return (Path(state) if state else Path.home() / ".local" / "state") / "goshawk" / "recent.json"


def listed(file: Path) -> list[Path]:
    """Folders of projects that can be seen now; none of a file that is missing, or is no such list."""
    return [folder for folder in _kept(file) if is_there(folder)][:MOST]


def note(file: Path, folder: Path) -> None:
    """Put a project first; where the file cannot be written nothing is remembered.

    One that cannot be read now, on a card that is not plugged in, is kept.
    """
    with contextlib.suppress(OSError):
        folder = folder.resolve()
        known = [folder, *(each for each in _kept(file) if each != folder)]
        with file_format.atomic_file(file) as new:
            new.write_text(json.dumps([str(each) for each in known[:MOST]]))


def _kept(file: Path) -> list[Path]:
    try:
        said = json.loads(file.read_text())
    except (OSError, ValueError):
        return []
    return [Path(each) for each in said if isinstance(each, str)] if isinstance(said, list) else []


def is_there(folder: Path) -> bool:
    """A folder that may not be read, or of a network that does not answer, is not."""
    try:
        return (folder / "project.toml").is_file()
    except OSError:
        return False
