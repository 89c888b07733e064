"""A change of a log that would mend a fault; `sysid.logs.apply` carries it out."""

from dataclasses import dataclass
from typing import Literal

Span = tuple[float, float]
"""First and last instant, seconds of the log's clock."""


@dataclass(frozen=True, slots=True)
class Repair:
    """A change of some columns of a log, as a finding proposes it."""

    action: Literal[
        "scale",
        "flip",
        "turn",
        "turn body",
        "conjugate",
        "quaternion order",
        "rotor order",
        "shift",
        "drift",
        "blank",
        "drop",
        "split",
    ]
    """`flip`: between z up and z down; `turn`: of the world axes of attitudes; `turn body`: of the body axes of
    attitudes and vectors; `shift`: of time stamps; `drift`: they are multiplied
    by `factor`, and shifted; `blank`: not sampled within `spans`; `split`: what is before and
    after each of the `spans` is a flight of its own."""
    columns: tuple[str, ...]
    """The columns it changes; where the log has none of a quantity's, it has nothing to change there."""
    factor: float = 1.0
    """Of `scale` and `drift`."""
    shift_s: float = 0.0
    """Of `shift` and `drift`: added to the time stamps."""
    turn_rad: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Of `turn`, that takes what is logged to what is right in world axes; of `turn body`, in body axes; of `split`, by
    how much the attitude turned there in world axes."""
    order: tuple[int, ...] = ()
    """Of `rotor order`: which column becomes rotor 0, 1, 2 and so on."""
    spans: tuple[Span, ...] = ()
    """Of `blank` and `split`; of `turn`, where it is done: empty for the whole log."""
