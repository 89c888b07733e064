"""A flight log out of the streams of one recorder, each with its own instants."""

from bisect import bisect_left
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flight import FlightError, FlightLog, InputError, rotations
from flight.flight_log import COLUMNS, columns_of
from flight.rotations import FloatArray
from sysid.logs.events import clock
from sysid.logs.events.event import noted
from sysid.logs.readers.read_ulog import LOST
from sysid.logs.readers.streams import Stream, interpolated, joined

POSE, ATTITUDE, RATE, FORCE = "position_world_m", "q_world_body", "rate_body_rad_s", "specific_force_body_m_s2"
OWN_ROWS = ("rotor_speed_rad_s", "rotor_speed_command_rad_s")
"""Streams that keep their own rows; all others are interpolated at those of the motion."""


def columns(quantity: str, values: FloatArray) -> Stream:
    """(n, k) values of a vector of `flight_log.COLUMNS` by column name."""
    return columns_of(quantity, values)


def assembled(
    path: Path, streams: Mapping[str, Stream], notes: Sequence[str] = (), lost: str = "", *, own_clock: bool = False
) -> FlightLog:
    """One log; its rows are the instants of the position, without one of the attitude, the gyro or the accelerometer.

    Each stream's clock is examined first (`clock`). Rotor speeds keep their own rows.

    Args:
        streams: by their first quantity; each has `time_s` and the columns of one or more quantities.
        notes: what the reader took from the file, one sentence each; kept in the metadata under `read`.
        lost: what of the file could not be read, in one sentence.
        own_clock: keep the recorder's times; else the first row is at 0 s.

    Raises:
        FormatError: a stream's times are none.
        InputError: no stream shows motion, or streams share no time.
    """
    try:
        ordered, events = clock.examined({name: s for name, s in streams.items() if len(s["time_s"]) >= 2})
    except FlightError as error:
        raise type(error)(f"{path}: {error}") from None
    ordered = {name: stream for name, stream in ordered.items() if len(stream["time_s"]) >= 2}
    base = next((ordered.pop(name) for name in (POSE, ATTITUDE, RATE, FORCE) if name in ordered), None)
    if base is None:
        had = ", ".join(streams) or "nothing that is known"
        raise InputError(
            f"{path} shows no motion: no position, attitude, gyro or accelerometer of 2 rows; it has {had}"
        )
    if ATTITUDE in ordered:
        base = _with_attitude(path, base, ordered.pop(ATTITUDE))
    rotors = [ordered.pop(name) for name in OWN_ROWS if name in ordered]
    for stream in ordered.values():
        base |= interpolated(base["time_s"], stream)
    for stream in rotors:
        base = joined(base, stream)
    begin_s = 0.0 if own_clock else float(base["time_s"][0])
    base["time_s"] = base["time_s"] - begin_s
    return FlightLog(base, metadata(path, notes, lost) | noted(events, begin_s=begin_s))


def metadata(path: Path, notes: Sequence[str], lost: str) -> dict[str, object]:
    """Name and source, what was read, and what could not be."""
    found: dict[str, object] = {"name": path.name.split(".")[0], "source": path.name}
    return found | ({"read": list(notes)} if notes else {}) | ({LOST: lost} if lost else {})


def in_order(time_s: FloatArray) -> NDArray[np.intp]:
    """Rows of the longest strictly increasing run of stamps: one zero or wild stamp costs one row.

    Stamps that are not finite are left out.
    """
    finite = np.flatnonzero(np.isfinite(time_s))
    stamps = time_s[finite]
    if not len(stamps) or (np.diff(stamps) > 0.0).all():
        return finite
    ends: list[float] = []  # smallest last stamp of a run of each length (Fredman 1975)
    places: list[int] = []
    before = np.full(len(stamps), -1, dtype=np.intp)
    for row, stamp in enumerate(stamps.tolist()):
        length = bisect_left(ends, stamp)
        if length == len(ends):
            ends.append(stamp)
            places.append(row)
        else:
            ends[length], places[length] = stamp, row
        before[row] = places[length - 1] if length else -1
    chain = [places[-1]]
    while before[chain[-1]] >= 0:
        chain.append(int(before[chain[-1]]))
    return finite[np.array(chain[::-1], dtype=np.intp)]


def _with_attitude(path: Path, base: Stream, attitude: Stream) -> Stream:
    """The rows within the time of the attitude, which is interpolated there (slerp)."""
    time_s, own_s = base["time_s"], attitude["time_s"]
    rows = (time_s >= own_s[0]) & (time_s <= own_s[-1])
    if rows.sum() < 2:
        raise InputError(
            f"{path}: position from {time_s[0]:.3f} to {time_s[-1]:.3f} s and attitude from {own_s[0]:.3f} to "
            f"{own_s[-1]:.3f} s share no time; record both for 10 s or more"
        )
    base = {name: values[rows] for name, values in base.items()}
    q = rotations.normalise(np.stack([attitude[name] for name in COLUMNS[ATTITUDE]], axis=1))
    after = np.clip(np.searchsorted(own_s, base["time_s"]), 1, len(own_s) - 1)
    share = (base["time_s"] - own_s[after - 1]) / (own_s[after] - own_s[after - 1])
    others = {name: values for name, values in attitude.items() if name not in COLUMNS[ATTITUDE]}
    at = rotations.slerp(q[after - 1], q[after], share)
    return base | columns(ATTITUDE, at) | interpolated(base["time_s"], others)
