"""Does the position move between two samples by what neither the velocity nor the motion around shows?"""

from collections.abc import Sequence

import numpy as np

from flight import FlightLog
from flight.flight_log import COLUMNS
from flight.rotations import FloatArray
from sysid.logs.events.event import DETECTABLE_JUMP_M, WAY_OUT_BLANK, WAY_OUT_SPLIT, Event
from sysid.logs.events.leaps import (
    EXPLAINED,
    Leap,
    around,
    integrated,
    leaps,
    outside,
    parted,
    steps_of,
    witness_counts,
)
from sysid.logs.events.repair import Repair, Span
from sysid.logs.events.stamps import longest_pause_s

QUANTITY = "position_world_m"
LEAST_M = 0.9 * DETECTABLE_JUMP_M
FARTHEST_M = 1e8
"""Beyond, it is damage."""


def find(log: FlightLog, over: Sequence[Span] = ()) -> list[Event]:
    """Jumps and excursions of the position.

    Args:
        over: steps over these spans are not looked at.
    """
    if not log.has(QUANTITY):
        return []
    values = log.vector(QUANTITY)
    values[~(np.abs(values) < FARTHEST_M).all(axis=1)] = np.nan
    rows = steps_of(log.time_s, values)
    if len(rows) < 50:
        return []
    time_s, position = log.time_s[rows], values[rows]
    step_s, moved = np.diff(time_s), np.diff(position, axis=0)
    expected = around(moved, step_s)
    left, by_velocity = moved - expected, _by_velocity(log, time_s)
    seen_by = "the motion before and after"
    if by_velocity is not None and witness_counts(moved - by_velocity, moved, left):
        # a velocity that was differentiated from the position jumps by half as much with it
        explained = np.linalg.norm(moved - by_velocity, axis=1) < EXPLAINED * np.linalg.norm(left, axis=1)
        left, seen_by = np.where(explained[:, None], moved - by_velocity, left), "the velocity"
        expected = np.where(explained[:, None], by_velocity, expected)
    free = outside(log.time_s, rows[:-1], rows[1:], over)
    left = np.where(free[:, None], left, 0.0)
    found = leaps(left, step_s, least=2.0 * LEAST_M, longest_s=longest_pause_s(step_s))

    def leap_of(leap: Leap) -> FloatArray:
        return (moved - expected)[leap.before : leap.after].sum(axis=0)

    def size(leap: Leap) -> float:
        return float(np.linalg.norm(leap_of(leap)))

    def together(there: Leap, back: Leap) -> float:
        return float(np.linalg.norm(leap_of(there) + leap_of(back)))

    jumps, excursions = parted(found, time_s, together, size)
    events = [_jump(time_s, leap, size(leap), seen_by, expected) for leap in jumps if size(leap) >= LEAST_M]
    return events + [
        _excursion(time_s, there, back, size(there)) for there, back in excursions if size(there) >= LEAST_M
    ]


def _by_velocity(log: FlightLog, time_s: FloatArray) -> FloatArray | None:
    """(m, 3) motion over each step by the logged velocity; None without one."""
    if not log.has("velocity_world_m_s"):
        return None
    velocity = log.vector("velocity_world_m_s")
    known = np.isfinite(velocity).all(axis=1)
    return integrated(log.time_s[known], velocity[known], time_s) if known.sum() > 50 else None


def _jump(time_s: FloatArray, leap: Leap, size: float, seen_by: str, expected: FloatArray) -> Event:
    span = (float(time_s[leap.before]), float(time_s[leap.after]))
    shown = float(np.linalg.norm(expected[leap.before : leap.after].sum(axis=0)))
    sentence = f"the position jumps by {size:.3f} m at {span[1]:.3f} s, where {seen_by} shows {shown:.3f} m"
    repair = Repair("split", COLUMNS[QUANTITY], spans=(span,))
    return Event("position jump", QUANTITY, span, size, "m", sentence, WAY_OUT_SPLIT, certain=True, repair=repair)


def _excursion(time_s: FloatArray, there: Leap, back: Leap, size: float) -> Event:
    span = (float(time_s[there.before + 1]), float(time_s[back.after - 1]))
    sentence = f"the position jumps by {size:.3f} m at {span[0]:.3f} s, and back after {span[1]:.3f} s"
    repair = Repair("blank", (*COLUMNS[QUANTITY], *COLUMNS["q_world_body"]), spans=(span,))
    return Event("position excursion", QUANTITY, span, size, "m", sentence, WAY_OUT_BLANK, certain=True, repair=repair)
