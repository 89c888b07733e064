"""One thing found in a log."""

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True, slots=True)
class Finding:
    """A fault, in words, with the way out."""

    level: Literal["warning", "error"]
    """`error`: results from this log would be wrong."""
    what: str
    """One or two words, the same for the same fault."""
    sentence: str
    """What is wrong, with the figure."""
    fix: str
    """What to do about it; nothing is done by itself."""


def error(what: str, sentence: str, fix: str) -> Finding:
    return Finding("error", what, sentence, fix)


def warning(what: str, sentence: str, fix: str) -> Finding:
    return Finding("warning", what, sentence, fix)
