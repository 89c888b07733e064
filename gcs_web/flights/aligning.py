"""Recorded flights moved in time to stand beside the first one, and the words for it."""

from collections.abc import Callable, Sequence
from typing import TypeVar

from flight import InputError
from gcs_web.flights import alignment
from gcs_web.flights.recorded import Recorded
from gcs_web.protocol.flights import AlignBy, Aligned

T = TypeVar("T")
FLAT = 0.05
"""Standard deviation of a speed (m/s) or a height (m) below which it is too flat to correlate."""
_STREAMS = {"speed": "speed", "height": "position_z"}


def align(recorded: Recorded, names: Sequence[str], how: AlignBy) -> list[Aligned]:
    """How far each flight but the first is to be moved, on their shifted times; one that cannot be says why.

    Raises:
        FlightError: a flight cannot be read, or there are fewer than two.
    """
    if len(names) < 2:
        raise InputError("open a second flight to align it with the first")
    for name in names:
        recorded.open(name)
    first, *others = names
    return [_aligned(recorded, first, name, how) for name in others]


def _aligned(recorded: Recorded, first: str, name: str, how: AlignBy) -> Aligned:
    try:
        if how in _STREAMS:
            return _correlated(recorded, first, name, how)
        find, words = _EVENTS[how]
        by_s = _of(recorded, first, find, words) - _of(recorded, name, find, words)
    except InputError as error:
        return Aligned(name, None, f"cannot tell: {error}")
    return Aligned(name, by_s, f"{words} at the same time")


def _correlated(recorded: Recorded, first: str, name: str, what: str) -> Aligned:
    signals = (
        _of(recorded, each, lambda log, flight: log.measured(flight, _STREAMS[what]), what) for each in (first, name)
    )
    found = alignment.by_correlation(*signals, least_spread=FLAT)
    words = (
        f"correlation of {what} {found.peak:.2f}, half of it within ±{found.half_width_s:.2f} s, "
        f"elsewhere at most {found.elsewhere:.2f}"
    )
    return Aligned(name, found.shift_s, words)


def _of(recorded: Recorded, name: str, find: Callable[[Recorded, str], T], words: str) -> T:
    """What is found of a flight, or a refusal that names both."""
    try:
        return find(recorded, name)
    except InputError as error:
        raise InputError(f"{words} of {name} {error}") from None


def _trajectory(recorded: Recorded, name: str) -> float:
    if not recorded.states(name).flies_trajectory:
        raise InputError("is not in the log: it has no mission state, or flew none")
    return 0.0  # the shifted time begins there


def _take_off(recorded: Recorded, name: str) -> float:
    if recorded.states(name).begins_in_air:
        raise InputError("is not in the log: it begins in the air")
    return alignment.first_above(alignment.above_beginning(recorded.measured(name, "position_z")), alignment.TAKE_OFF_M)


def _motion(recorded: Recorded, name: str) -> float:
    return alignment.first_above(recorded.measured(name, "speed"), alignment.MOTION_M_S)


_EVENTS: dict[str, tuple[Callable[[Recorded, str], float], str]] = {
    "trajectory": (_trajectory, "begin of the trajectory"),
    "take_off": (_take_off, "take-off (0.1 m over where the log begins)"),
    "motion": (_motion, "first motion"),
}
