"""Does the velocity change between two samples by what neither the accelerometer nor the position shows?

A blow changes a velocity as quickly; accelerometer and position then show it. So a leap counts only if one of them was
recorded and has no part in it.
"""

from collections.abc import Sequence

import numpy as np

from flight import FlightLog, rotations
from flight.flight_log import COLUMNS
from flight.frames import GRAVITY_M_S2
from flight.rotations import FloatArray
from sysid.logs.events.event import DETECTABLE_JUMP_M_S, WAY_OUT_BLANK, WAY_OUT_SPLIT, Event
from sysid.logs.events.leaps import EXPLAINED, Leap, around, integrated, leaps, outside, parted, steps_of
from sysid.logs.events.repair import Repair, Span
from sysid.logs.events.stamps import longest_pause_s

QUANTITY = "velocity_world_m_s"
LEAST_M_S = 0.9 * DETECTABLE_JUMP_M_S
STRONGEST_M_S2 = 60.0
"""No rotors accelerate a vehicle more: a slow stream moves by so much in a step."""
BESIDE_S = 0.1
"""On either side of a leap the position shows the mean velocity over this long."""


def find(log: FlightLog, over: Sequence[Span] = ()) -> list[Event]:
    """Jumps and excursions of the velocity.

    Args:
        over: steps over these spans are not looked at.
    """
    if not log.has(QUANTITY):
        return []
    values = log.vector(QUANTITY)
    rows = steps_of(log.time_s, values)
    if len(rows) < 50:
        return []
    time_s, velocity = log.time_s[rows], values[rows]
    step_s, moved = np.diff(time_s), np.diff(velocity, axis=0)
    left = moved - around(moved, step_s)
    left = np.where(outside(log.time_s, rows[:-1], rows[1:], over)[:, None], left, 0.0)
    least = max(LEAST_M_S, STRONGEST_M_S2 * float(np.median(step_s)))
    found = leaps(left, step_s, least=2.0 * least, longest_s=longest_pause_s(step_s))

    def leap_of(leap: Leap) -> FloatArray:
        return left[leap.before : leap.after].sum(axis=0)

    def size(leap: Leap) -> float:
        return float(np.linalg.norm(leap_of(leap)))

    def together(there: Leap, back: Leap) -> float:
        return float(np.linalg.norm(leap_of(there) + leap_of(back)))

    jumps, excursions = parted(found, time_s, together, size)
    by_force, position = _by_accelerometer(log, time_s), _known(log, "position_world_m")
    events: list[Event] = []
    for leap in (leap for leap in jumps if size(leap) >= least):
        shown = _shown(leap, time_s, leap_of(leap), by_force, position)
        if shown is not None:
            events.append(_jump(time_s, leap, size(leap), shown))
    return events + [
        _excursion(time_s, there, back, size(there))
        for there, back in excursions
        if size(there) >= least and _shown(there, time_s, leap_of(there), by_force, None) is not None
    ]


def _shown(
    leap: Leap,
    time_s: FloatArray,
    by: FloatArray,
    by_force: FloatArray | None,
    position: tuple[FloatArray, FloatArray] | None,
) -> str | None:
    """What shows no such change of velocity `by`, in words; None where something does, or nothing was recorded."""
    size, found = float(np.linalg.norm(by)), list[str]()
    if by_force is not None:
        change = by_force[leap.before : leap.after].sum(axis=0)
        if np.isfinite(change).all():
            if float(np.linalg.norm(by - change)) < (1.0 - EXPLAINED) * size:
                return None
            found.append(f"the accelerometer shows {np.linalg.norm(change):.2f} m/s")
    if position is not None:
        change = _by_position(*position, float(time_s[leap.before]), float(time_s[leap.after]))
        if change is not None:
            if float(change @ by) > (1.0 - EXPLAINED) * size * size:
                return None
            found.append(f"the position shows {np.linalg.norm(change):.2f} m/s")
    return " and ".join(found) or None


def _by_accelerometer(log: FlightLog, time_s: FloatArray) -> FloatArray | None:
    """(m, 3) change of velocity over each step by accelerometer, attitude and gravity; None without them."""
    force, q = _known(log, "specific_force_body_m_s2"), _known(log, "q_world_body")
    if force is None or q is None:
        return None
    nearest = np.clip(np.searchsorted(q[0], force[0]), 0, len(q[0]) - 1)
    acceleration = rotations.rotate(rotations.normalise(q[1][nearest]), force[1])
    return integrated(force[0], acceleration - np.array([0.0, 0.0, GRAVITY_M_S2]), time_s)


def _by_position(own_s: FloatArray, position: FloatArray, begin_s: float, end_s: float) -> FloatArray | None:
    """(3,) change of the mean velocity from before a leap to after it; None where too little was sampled."""
    before = slice(*np.searchsorted(own_s, [begin_s - BESIDE_S, np.nextafter(begin_s, np.inf)]))
    after = slice(*np.searchsorted(own_s, [end_s, end_s + BESIDE_S]))
    means: list[FloatArray] = []
    for part in (before, after):
        t, x = own_s[part], position[part]
        if len(t) < 3:
            return None
        means.append((x[-1] - x[0]) / (t[-1] - t[0]))
    return means[1] - means[0]


def _known(log: FlightLog, quantity: str) -> tuple[FloatArray, FloatArray] | None:
    """Instants and values of all samples; None of too few."""
    if not log.has(quantity):
        return None
    values = log.vector(quantity)
    rows = np.isfinite(values).all(axis=1)
    return (log.time_s[rows], values[rows]) if rows.sum() >= 50 else None


def _jump(time_s: FloatArray, leap: Leap, size: float, shown: str) -> Event:
    span = (float(time_s[leap.before]), float(time_s[leap.after]))
    sentence = f"the velocity jumps by {size:.2f} m/s at {span[1]:.3f} s, where {shown}"
    repair = Repair("split", COLUMNS[QUANTITY], spans=(span,))
    return Event("velocity jump", QUANTITY, span, size, "m/s", sentence, WAY_OUT_SPLIT, certain=True, repair=repair)


def _excursion(time_s: FloatArray, there: Leap, back: Leap, size: float) -> Event:
    span = (float(time_s[there.before + 1]), float(time_s[back.after - 1]))
    sentence = f"the velocity jumps by {size:.2f} m/s at {span[0]:.3f} s, and back after {span[1]:.3f} s"
    repair = Repair("blank", COLUMNS[QUANTITY], spans=(span,))
    return Event(
        "velocity excursion", QUANTITY, span, size, "m/s", sentence, WAY_OUT_BLANK, certain=True, repair=repair
    )
