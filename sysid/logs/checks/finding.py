"""One thing found in a log, and the change that would mend it."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from sysid.logs.events.event import Event
from sysid.logs.events.repair import Repair, Span


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
    repair: Repair | None = None
    """The fix as a change of this log; None where the fix is something else (the vehicle file, another flight)."""
    spans: tuple[Span, ...] = ()
    """Where in the log it is; empty: all over."""
    event: Event | None = None
    """The event of the recording that it is about."""


def turn_in_words(turn_rad: ArrayLike) -> str:
    """A rotation vector (3,) as angle and axis."""
    turn = np.asarray(turn_rad, dtype=np.float64)
    angle = float(np.linalg.norm(turn))
    axis = ", ".join(f"{part:.1f}" for part in np.round(turn / angle, 1) + 0.0)
    return f"{np.rad2deg(angle):.0f} deg about ({axis})"


def error(what: str, sentence: str, fix: str, *, repair: Repair | None = None, spans: tuple[Span, ...] = ()) -> Finding:
    return Finding("error", what, sentence, fix, repair, spans)


def warning(
    what: str, sentence: str, fix: str, *, repair: Repair | None = None, spans: tuple[Span, ...] = ()
) -> Finding:
    return Finding("warning", what, sentence, fix, repair, spans)
