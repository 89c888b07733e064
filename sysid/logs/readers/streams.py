"""One table out of several streams, each with its own instants (`time_s` among its columns)."""

import numpy as np

from flight import rotations
from flight.rotations import FloatArray
from sysid.logs.events.stamps import longest_pause_s

Stream = dict[str, FloatArray]

SAME_DIGITS = 6
"""Times that are alike to a microsecond are one row."""


def interpolated(time_s: FloatArray, stream: Stream) -> Stream:
    """Columns of another stream at these instants; NaN beyond its ends and where it pauses."""
    own_s = stream.get("time_s")
    if own_s is None:
        return {}
    unknown = np.zeros(len(time_s), dtype=bool)
    if len(own_s) > 1:
        step_s = np.diff(own_s)
        after = np.clip(np.searchsorted(own_s, time_s), 1, len(own_s) - 1)
        between = (time_s > own_s[after - 1]) & (time_s < own_s[after])
        unknown = between & (step_s[after - 1] > longest_pause_s(step_s))
    return {
        name: np.where(unknown, np.nan, np.interp(time_s, own_s, values, left=np.nan, right=np.nan))
        for name, values in stream.items()
        if name != "time_s"
    }


def joined(first: Stream, second: Stream) -> Stream:
    """One table with the rows of both while the first lasts, NaN where a stream was not sampled."""
    if not second:
        return first
    own_s, other_s = (np.round(part["time_s"], SAME_DIGITS) for part in (first, second))
    time_s = np.unique(np.concatenate([own_s, other_s[(other_s >= own_s[0]) & (other_s <= own_s[-1])]]))
    table = {"time_s": time_s}
    for part, part_s in ((first, own_s), (second, other_s)):
        place = np.searchsorted(time_s, part_s)
        rows = (part_s >= time_s[0]) & (part_s <= time_s[-1])
        for name, values in part.items():
            if name != "time_s":
                table[name] = np.full(len(time_s), np.nan)
                table[name][place[rows]] = values[rows]
    return table


def shifted(
    time_s: FloatArray, values: FloatArray, shift_s: float, *, factor: float = 1.0, quaternion: bool = False
) -> FloatArray:
    """Columns (n, c) at the same instants, whose time stamps are multiplied by `factor`, then moved by `shift_s`.

    NaN where nothing was recorded.

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
    columns = [np.interp(at, factor * at + shift_s, column, left=np.nan, right=np.nan) for column in known.T]
    moved[sampled] = np.stack(columns, axis=1)
    if quaternion:
        moved = rotations.normalise(moved)
    return moved
