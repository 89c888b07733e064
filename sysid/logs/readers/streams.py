"""One table out of several streams, each with its own instants (`time_s` among its columns)."""

import numpy as np

from flight import rotations
from flight.rotations import FloatArray

Stream = dict[str, FloatArray]

GAP_FACTOR = 4.0
"""A pause is a gap when it lasts this many usual sample intervals ..."""
GAP_LEAST_S = 0.04
"""... and at least this long: single lost frames are harmless."""


def longest_pause_s(step_s: FloatArray) -> float:
    """Between samples so far apart as these (n,), what is longer is a gap."""
    return max(GAP_FACTOR * float(np.median(step_s)), GAP_LEAST_S)


def interpolated(time_s: FloatArray, stream: Stream) -> Stream:
    """Columns of another stream at these instants; NaN beyond its ends."""
    own_s = stream.get("time_s")
    if own_s is None:
        return {}
    return {
        name: np.interp(time_s, own_s, values, left=np.nan, right=np.nan)
        for name, values in stream.items()
        if name != "time_s"
    }


def joined(first: Stream, second: Stream) -> Stream:
    """One table with the rows of both while the first lasts, NaN where a stream was not sampled."""
    if not second:
        return first
    inside = (second["time_s"] >= first["time_s"][0]) & (second["time_s"] <= first["time_s"][-1])
    time_s = np.unique(np.concatenate([first["time_s"], second["time_s"][inside]]))
    table = {"time_s": time_s}
    for part in (first, second):
        place = np.searchsorted(time_s, part["time_s"])
        rows = (part["time_s"] >= time_s[0]) & (part["time_s"] <= time_s[-1])
        for name, values in part.items():
            if name != "time_s":
                table[name] = np.full(len(time_s), np.nan)
                table[name][place[rows]] = values[rows]
    return table


def shifted(time_s: FloatArray, values: FloatArray, shift_s: float, *, quaternion: bool = False) -> FloatArray:
    """Columns (n, c) whose time stamps move by `shift_s`, at the same instants; NaN where nothing was recorded.

    Rows that were not sampled stay NaN; between samples the values go straight.
    """
    sampled = np.isfinite(values).all(axis=1)
    moved = np.full(values.shape, np.nan)
    if not sampled.any():
        return moved
    known = values[sampled]
    if quaternion:
        known = rotations.continuous(known)
    at = time_s[sampled]
    columns = [np.interp(at, at + shift_s, column, left=np.nan, right=np.nan) for column in known.T]
    moved[sampled] = np.stack(columns, axis=1)
    if quaternion:
        moved = rotations.normalise(moved)
    return moved
