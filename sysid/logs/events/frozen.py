"""Does a moving quantity repeat exactly one value for longer than it does elsewhere?

A slow stream is held in the rows of a faster one, and a coarse one repeats itself in calm flight; so a run counts only
if, by how often values repeat around it, chance does not make one that long.
"""

from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from flight import FlightLog
from flight.flight_log import COLUMNS
from flight.rotations import FloatArray
from sysid.logs.events.event import Event
from sysid.logs.events.repair import Repair, Span

LEAST_S = 0.25
"""Shorter runs are no fault."""
LEAST_REPEATS = 4
AROUND_S = 3.0
"""Around a run, on either side, this much shows how often values repeat."""
MOVES = 8.0
"""Before and after a run the quantity moves by this many of its smallest steps in the time of the run."""
BY_CHANCE = 1e-6
"""A run that chance makes once in so many logs is frozen."""
COMMANDED = ("setpoint_", "rotor_speed_command", "wind_world")
"""Columns that may stand still by intent."""
MOST = 200
"""Of the longest runs so many are looked at."""


def find(log: FlightLog, resting: Collection[Span] = ()) -> list[Event]:
    """Stretches over which a quantity is frozen.

    Args:
        resting: where the vehicle stands: there nothing need move.
    """
    found: list[Event] = []
    for quantity, columns in COLUMNS.items():
        if quantity.startswith(COMMANDED) or not log.has(quantity):
            continue
        values = log.vector(quantity)
        moving = np.isfinite(values).all(axis=1)
        if quantity == "rotor_speed_rad_s":
            moving &= values.any(axis=1) | ~within(log.time_s, resting)
        elif quantity in ("position_world_m", "velocity_world_m_s", "q_world_body"):
            moving &= ~within(log.time_s, resting)
        known = np.flatnonzero(moving)
        if len(known) >= 10:
            found += [_event(quantity, columns, span) for span in _runs(log.time_s[known], values[known])]
    return found


def within(time_s: FloatArray, spans: Collection[Span]) -> NDArray[np.bool_]:
    """(n,) which instants lie in one of the spans."""
    inside = np.zeros(len(time_s), dtype=bool)
    for begin_s, end_s in spans:
        inside |= (time_s >= begin_s) & (time_s <= end_s)
    return inside


def _event(quantity: str, columns: tuple[str, ...], span: Span) -> Event:
    length_s = span[1] - span[0]
    sentence = f"{quantity} repeats one value for {length_s:.2f} s from {span[0]:.2f} s on"
    both = ("position_world_m", "q_world_body")
    if quantity in both:  # a sample of the pose is whole or none
        columns = tuple(name for one in both for name in COLUMNS[one])
    repair = Repair("blank", columns, spans=(span,))
    return Event("frozen", quantity, span, length_s, "s", sentence, "write NaN there", certain=True, repair=repair)


def _runs(time_s: FloatArray, values: FloatArray) -> list[Span]:
    """First repeat and last row of each run that chance does not make; all components at once."""
    scale = np.maximum(np.abs(values).max(axis=0), 1e-12)
    again = (np.abs(np.diff(values, axis=0)) <= 1e-12 * scale).all(axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], again.astype(np.int8), [0]])))
    begins, ends = edges[::2], edges[1::2]  # rows: values[begin] is repeated up to values[end]
    long = np.flatnonzero((time_s[ends] - time_s[begins] > LEAST_S) & (ends - begins >= LEAST_REPEATS))
    long = long[np.argsort((begins - ends)[long])][:MOST]
    total = np.concatenate([[0], np.cumsum(again)])
    found: list[Span] = []
    for k in np.sort(long):
        begin, end = int(begins[k]), int(ends[k])
        first, last = np.searchsorted(time_s, [time_s[begin] - AROUND_S, time_s[end] + AROUND_S])
        last = min(int(last), len(again))
        outside = last - first - (end - begin)
        repeated = total[last] - total[first] - (end - begin)
        share = (repeated + 1.0) / (outside + 2.0)
        by_chance = (end - begin) * np.log(share) + np.log(len(time_s)) > np.log(BY_CHANCE)
        if not by_chance and _moves_around(values, begin, end):
            found.append((float(time_s[begin + 1]), float(time_s[end])))
    return found


def _moves_around(values: FloatArray, begin: int, end: int) -> bool:
    """Whether the quantity moves before and after; if not, a coarse one may well stand still."""
    steps = np.abs(np.diff(values, axis=0))
    least = np.min(np.where(steps > 0.0, steps, np.inf), axis=0)
    least = float(np.max(least, where=np.isfinite(least), initial=0.0)) or np.inf  # of the coarsest component
    length = end - begin
    parts = [values[max(0, begin - length) : begin + 1], values[end : end + length + 1]]
    ranges = [float(np.ptp(part, axis=0).max()) / least for part in parts if len(part) > length // 2]
    return not ranges or not np.isfinite(least) or min(ranges) >= MOVES
