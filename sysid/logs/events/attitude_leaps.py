"""Does the attitude turn between two samples by what neither the gyro nor the turning around shows?"""

from collections.abc import Sequence

import numpy as np

from flight import FlightLog, rotations
from flight.flight_log import COLUMNS
from flight.rotations import FloatArray
from sysid.logs.events.event import DETECTABLE_TURN_DEG, UPRIGHT, WAY_OUT_BLANK, WAY_OUT_SPLIT, Event
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

QUANTITY = "q_world_body"
LEAST_RAD = np.deg2rad(0.9 * DETECTABLE_TURN_DEG)


def find(log: FlightLog, over: Sequence[Span] = ()) -> list[Event]:
    """Jumps and excursions of the attitude.

    Args:
        over: steps over these spans are not looked at.
    """
    if not log.has(QUANTITY):
        return []
    values = log.vector(QUANTITY)
    values = np.where((np.linalg.norm(values, axis=1) > 0.5)[:, None], values, np.nan)
    rows = steps_of(log.time_s, values)
    if len(rows) < 50:
        return []
    time_s, q = log.time_s[rows], rotations.continuous(rotations.normalise(values[rows]))
    step_s = np.diff(time_s)
    turned = rotations.log(rotations.multiply(rotations.conjugate(q[:-1]), q[1:]))
    expected = around(turned, step_s)
    left, gyro = turned - expected, _by_gyro(log, time_s)
    seen_by = "the turning before and after"
    if gyro is not None and witness_counts(turned - gyro, turned, left):
        explained = np.linalg.norm(turned - gyro, axis=1) < EXPLAINED * np.linalg.norm(left, axis=1)
        left, seen_by = np.where(explained[:, None], turned - gyro, left), "the gyro"
        expected = np.where(np.isfinite(gyro), gyro, expected)
    free = outside(log.time_s, rows[:-1], rows[1:], over)
    found = leaps(np.where(free[:, None], left, 0.0), step_s, least=2.0 * LEAST_RAD, longest_s=longest_pause_s(step_s))

    def leap_of(leap: Leap) -> FloatArray:
        """(4,) in world axes: attitude after, from where the turning expected it."""
        before = q[leap.before]
        for k in range(leap.before, leap.after):
            before = rotations.multiply(before, rotations.exp(expected[k]))
        return rotations.multiply(q[leap.after], rotations.conjugate(before))

    def in_body_axes(leap: Leap) -> FloatArray:
        after = q[leap.after]
        return rotations.multiply(rotations.conjugate(after), rotations.multiply(leap_of(leap), after))

    def together(there: Leap, back: Leap) -> float:
        world = rotations.multiply(leap_of(back), leap_of(there))
        in_body = rotations.multiply(in_body_axes(there), in_body_axes(back))
        return min(_angle(world), _angle(in_body))

    def size(leap: Leap) -> float:
        return _angle(leap_of(leap))

    jumps, excursions = parted(found, time_s, together, size)
    events = [_jump(time_s, leap, leap_of(leap), expected, seen_by) for leap in jumps if size(leap) >= LEAST_RAD]
    for there, back in excursions:
        if size(there) >= LEAST_RAD:
            events.append(_excursion(time_s, there, back, leap_of(there)))
    return events


def _by_gyro(log: FlightLog, time_s: FloatArray) -> FloatArray | None:
    """(m, 3) turn over each step by the gyro; None without one."""
    if not log.has("rate_body_rad_s"):
        return None
    rate = log.vector("rate_body_rad_s")
    known = np.isfinite(rate).all(axis=1)
    if known.sum() < 50:
        return None
    return integrated(log.time_s[known], rate[known], time_s)


def _angle(q: FloatArray) -> float:
    return float(np.linalg.norm(rotations.log(q)))


def _words(q: FloatArray) -> str:
    turn = rotations.log(q)
    size = float(np.linalg.norm(turn))
    if abs(turn[2]) > UPRIGHT * size:
        return f"{np.rad2deg(turn[2]):+.1f} deg about the vertical"
    return f"{np.rad2deg(size):.1f} deg"


def _jump(time_s: FloatArray, leap: Leap, turn: FloatArray, expected: FloatArray, seen_by: str) -> Event:
    span = (float(time_s[leap.before]), float(time_s[leap.after]))
    shown = np.rad2deg(float(np.linalg.norm(expected[leap.before : leap.after].sum(axis=0))))
    sentence = f"the attitude jumps by {_words(turn)} at {span[1]:.3f} s, where {seen_by} shows {shown:.1f} deg"
    size = float(np.rad2deg(_angle(turn)))
    x, y, z = map(float, rotations.log(turn))
    repair = Repair("split", COLUMNS[QUANTITY], spans=(span,), turn_rad=(x, y, z))
    return Event("attitude jump", QUANTITY, span, size, "deg", sentence, WAY_OUT_SPLIT, True, repair=repair)


def _excursion(time_s: FloatArray, there: Leap, back: Leap, turn: FloatArray) -> Event:
    span = (float(time_s[there.before + 1]), float(time_s[back.after - 1]))
    sentence = (
        f"the attitude jumps by {_words(turn)} at {span[0]:.3f} s, and back after {span[1]:.3f} s: swapped or hidden "
        "markers?"
    )
    size = float(np.rad2deg(_angle(turn)))
    columns = (*COLUMNS[QUANTITY], *COLUMNS["position_world_m"])
    repair = Repair("blank", columns, spans=(span,))
    return Event("attitude excursion", QUANTITY, span, size, "deg", sentence, WAY_OUT_BLANK, True, repair=repair)
