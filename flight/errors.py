"""The errors Goshawk raises on purpose; everything else is a bug."""

import difflib
import itertools
from pathlib import Path

_MOST_NAMES = 1000
"""Files of a folder among which a similar name is looked for."""


class FlightError(Exception):
    """Base of all expected failures. The message names the value, the bound and the remedy."""


class InputError(FlightError):
    """An argument or a file's content is invalid: not finite, wrong shape, out of range, missing."""


class FormatError(FlightError):
    """A file cannot be decoded: truncated, of another format, or of a newer version."""


class InfeasibleError(FlightError):
    """The problem is well posed and has no solution within the limits; the message says which limit."""


class MapError(FlightError):
    """These images do not suffice for mapping or localization."""


class LinkError(FlightError):
    """The vehicle did not answer, or refused the request."""


def missing(path: Path | str, holds: str = "") -> InputError:
    """The error for a file that is not there: what it should hold, and a file of a similar name that is there."""
    path = Path(path)
    should = f"; it should hold {holds}" if holds else ""
    if path.is_dir():
        return InputError(f"{path} is a folder, not a file{should}")
    if not path.parent.is_dir():
        return InputError(f"{path} does not exist: there is no folder {path.parent}{should}")
    try:
        names = sorted(file.name for file in itertools.islice(path.parent.iterdir(), _MOST_NAMES))
    except OSError:  # it may not be listed, or is gone
        names = []
    similar = difflib.get_close_matches(path.name, names, n=1)
    there = f"; {path.with_name(similar[0])} does" if similar else f" in {path.parent.resolve()}"
    return InputError(f"{path} does not exist{there}{should}")
