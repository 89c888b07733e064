"""Messages of the library as the page says them: without options, folders of the station and numbers of errors."""

import re
from pathlib import Path

_OPTION = re.compile(r"(?<![\w`-])--([a-z][a-z-]*)")
_IN_BRACKETS = re.compile(r"\s\(--[a-z-]+\)")
_ERRNO = re.compile(r"\[Errno -?\d+\] ")
_BOXES = {
    "overwrite": '"Overwrite"',
    "radius": "the vehicle's radius",
    "margin": "the margin",
    "observed": 'the box "A place that is free"',
    "sensor": 'the box "Measured from"',
    "unit": 'the box "Unit"',
    "up": 'the box "Up"',
    "wind": 'the box "Wind, from anywhere"',
    "like": 'the box "Wind and noise of a flight"',
    "columns": "the column map",
}
"""What the page has in the place of an option: a button, a box."""


def for_page(text: str, folder: Path | None = None) -> str:
    """The sentence; paths are relative to the project's `folder`, a command between backticks stays as it is typed."""
    if folder is not None:
        for root in {str(folder), str(folder.resolve())}:
            text = text.replace(f"{root}/.session/incoming/", "").replace(f"{root}/", "").replace(root, "the project")
    text = _IN_BRACKETS.sub("", _ERRNO.sub("", text))
    parts = text.split("`")  # commands are every second one
    return "`".join(part if at % 2 else _OPTION.sub(_box, part) for at, part in enumerate(parts))


def _box(option: re.Match[str]) -> str:
    return _BOXES.get(option[1], f'the option "{option[1].replace("-", " ")}"')
