"""The projects that were opened on this machine before, the newest first: a small file of the user's own."""

import contextlib
import json
import os
from pathlib import Path

MOST = 12


def default_file() -> Path:
    """In `XDG_STATE_HOME`, else `~/.local/state`."""
    state = os.environ.get("XDG_STATE_HOME")
    return (Path(state) if state else Path.home() / ".local" / "state") / "goshawk" / "recent.json"


def listed(file: Path) -> list[Path]:
    """Folders of projects that are still there; none of a file that is missing, or is no such list."""
    try:
        said = json.loads(file.read_text())
    except (OSError, ValueError):
        return []
    folders = [Path(each) for each in said if isinstance(each, str)] if isinstance(said, list) else []
    return [folder for folder in folders if (folder / "project.toml").is_file()][:MOST]


def note(file: Path, folder: Path) -> None:
    """Put a project first; where the file cannot be written nothing is remembered."""
    folder = folder.resolve()
    known = [folder, *(each for each in listed(file) if each != folder)]
    with contextlib.suppress(OSError):
        file.parent.mkdir(parents=True, exist_ok=True)
        new = file.with_name(f".{file.name}.{os.getpid()}")
        new.write_text(json.dumps([str(each) for each in known[:MOST]]))
        new.replace(file)
