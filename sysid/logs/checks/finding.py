"""One thing found in a log, and the change that would mend it."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

Span = tuple[float, float]
"""First and last instant, seconds of the log's clock."""


@dataclass(frozen=True, slots=True)
class Repair:
    """A change of some columns of a log, as a fix proposes it; `sysid.logs.fix` carries it out."""

    action: Literal[
        "scale", "flip", "turn", "turn body", "conjugate", "quaternion order", "rotor order", "shift", "blank", "drop"
    ]
    """`flip`: between z up and z down; `turn`: of the world axes of attitudes; `turn body`: of the body axes of
    attitudes and vectors; `shift`: of time stamps; `blank`: not sampled within `spans`."""
    columns: tuple[str, ...]
    """The columns it changes; where the log has none of a quantity's, it has nothing to change there."""
    factor: float = 1.0
    """Of `scale`."""
    shift_s: float = 0.0
    """Of `shift`: added to the time stamps."""
    turn_rad: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Of `turn`, that takes what is logged to what is right in world axes; of `turn body`, in body axes."""
    order: tuple[int, ...] = ()
    """Of `rotor order`: which column becomes rotor 0, 1, 2, 3."""
    spans: tuple[Span, ...] = ()
    """Of `blank`."""


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
