"""Did gyro or accelerometer reach the end of their range? There they repeat their extreme, and leave it in leaps."""

import numpy as np

from flight import FlightLog
from flight.flight_log import COLUMNS
from flight.rotations import FloatArray
from sysid.logs.events.event import WAY_OUT_BLANK, Event
from sysid.logs.events.repair import Repair, Span

UNITS = {"rate_body_rad_s": "rad/s", "specific_force_body_m_s2": "m/s2"}
LEAST_REPEATS = 3
"""Samples in a row at the extreme."""
LEAP = 20.0
"""Into the extreme and out of it the channel moves by this many of its usual steps; a peak is round."""
NEAR_S = 0.05
"""Runs so close are one event."""


def find(log: FlightLog) -> list[Event]:
    """Stretches over which a sensor was at the end of its range."""
    found: list[Event] = []
    for quantity, unit in UNITS.items():
        if not log.has(quantity):
            continue
        values = log.vector(quantity)
        known = np.isfinite(values).all(axis=1)
        if known.sum() < 50:
            continue
        spans = [
            (span, extreme)
            for column in values[known].T
            for extreme in (float(column.max()), float(column.min()))
            for span in _runs(log.time_s[known], column, extreme)
        ]
        for span, extreme in _merged(spans):
            sentence = (
                f"{quantity} stays at {extreme:.4g} {unit}, its extreme, from {span[0]:.3f} to {span[1]:.3f} s: the "
                "end of the sensor's range"
            )
            repair = Repair("blank", COLUMNS[quantity], spans=(span,))
            found.append(
                Event("clipped", quantity, span, abs(extreme), unit, sentence, WAY_OUT_BLANK, True, repair=repair)
            )
    return found


def _runs(time_s: FloatArray, column: FloatArray, extreme: float) -> list[Span]:
    at = np.concatenate([[0], (column == extreme).astype(np.int8), [0]])
    edges = np.flatnonzero(np.diff(at))
    steps = np.abs(np.diff(column))
    usual = max(float(np.median(steps)), float(np.min(steps[steps > 0.0], initial=np.inf)))
    found: list[Span] = []
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        if end - begin < LEAST_REPEATS or begin == 0 or end == len(column):
            continue
        if min(steps[begin - 1], steps[end - 1]) > LEAP * usual:
            found.append((float(time_s[begin]), float(time_s[end - 1])))
    return found


def _merged(spans: list[tuple[Span, float]]) -> list[tuple[Span, float]]:
    merged: list[tuple[Span, float]] = []
    for span, extreme in sorted(spans):
        if merged and span[0] <= merged[-1][0][1] + NEAR_S:
            last, largest = merged[-1]
            merged[-1] = (last[0], max(last[1], span[1])), max(largest, extreme, key=abs)
        else:
            merged.append((span, extreme))
    return merged
