"""Are one stream's time stamps those of a clock? What is certain is put right, row by row; steps are left to judge.

In turn: rows without a time, stray rows (zeros and wild ones), counters that wrap, rows in a wrong order, repeats. What
is left rises, but for steps back; a step of either sense may be the clock's or a pause of the recording, which the
stamps alone do not show (`clock`).
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from flight import FormatError
from flight.rotations import FloatArray
from sysid.logs.events.event import Event

IndexArray = NDArray[np.intp]

GAP_FACTOR = 4.0
"""A pause is a gap when it lasts this many usual sample intervals ..."""
GAP_LEAST_S = 0.04
"""... and at least this long: single lost frames are harmless."""
PERIODS_S = {
    "32 bits of us": 2**32 * 1e-6,
    "32 bits of ms": 2**32 * 1e-3,
    "31 bits of us": 2**31 * 1e-6,
    "31 bits of ms": 2**31 * 1e-3,
    "32 bits of ns": 2**32 * 1e-9,
    "16 bits of ms": 2**16 * 1e-3,
}
"""After which counters begin anew."""
LONGEST_PAUSE = 50.0
"""Usual steps that a stream may pause without being cut into runs; and at least `LEAST_RUN_S`."""
LEAST_RUN_S = 1.0
STRAY_ROWS = 3
"""So many rows amid others may be wild; of rows with one and the same stamp any number."""
FAR_S = 10.0
"""At the ends of a stream only what is this far away, and farther than the stream is long, is wild."""
REORDERED_ROWS = 10
"""Rows this close may have changed places."""
NO_CLOCK = 0.4
"""Share of steps that go back, from which on the column is no time at all."""


@dataclass(frozen=True, slots=True)
class Stamps:
    """The rows of a stream that are left, in the order of their time."""

    rows: IndexArray
    """(m,) which rows of the file."""
    time_s: FloatArray
    """(m,) their times; rising but for the steps back."""
    events: tuple[Event, ...]
    usual_s: float
    """Median step."""

    def steps(self) -> IndexArray:
        """Rows after which the time goes back or pauses for long."""
        step_s = np.diff(self.time_s)
        return np.flatnonzero((step_s <= 0.0) | (step_s > pause_s(self.usual_s)))


def longest_pause_s(step_s: FloatArray) -> float:
    """Between samples so far apart as these (n,), what is longer is a gap."""
    return max(GAP_FACTOR * float(np.median(step_s)), GAP_LEAST_S)


def pause_s(usual_s: float) -> float:
    """The longest step that is no step of the clock."""
    return max(4.0 * usual_s, 0.1)


def examine(stream: str, stamps: FloatArray) -> Stamps:
    """Put right what the stamps alone show.

    Args:
        stamps: (n,) s, in the order of the file; any value.

    Raises:
        FormatError: most stamps are alike, or they go back as often as on: no times of samples.
    """
    rows = np.flatnonzero(np.isfinite(stamps))
    time_s = np.asarray(stamps[rows], dtype=np.float64)
    events: list[Event] = []
    if len(rows) < len(stamps):
        bad = np.flatnonzero(~np.isfinite(stamps))
        at = float(time_s[np.clip(np.searchsorted(rows, bad[0]) - 1, 0, None)]) if len(time_s) else 0.0
        events.append(_left_out("missing stamp", stream, len(stamps) - len(rows), (at, at), "have no time"))
    if len(time_s) < 3:
        return Stamps(rows, time_s, tuple(events), 0.0)
    usual_s = _usual_s(stream, time_s)
    for step in (_strays, _wraps, _sorted, _repeats):
        rows, time_s, found = step(stream, rows, time_s, usual_s)
        events += found
    return Stamps(rows, time_s, tuple(events), usual_s)


def _usual_s(stream: str, time_s: FloatArray) -> float:
    step_s = np.diff(time_s)
    forward = step_s[step_s > 0.0]
    alike = int((step_s == 0.0).sum())
    if not len(forward) or alike > 0.95 * len(step_s):
        raise FormatError(
            f"{stream}: {alike} of {len(step_s)} time stamps are that of the row before: they were written with too "
            "few digits, or never set; export them with microseconds"
        )
    if (step_s < 0.0).mean() > NO_CLOCK:
        raise FormatError(
            f"{stream}: {int((step_s < 0.0).sum())} of {len(step_s)} time stamps are before that of the row above: "
            "this column is no time, or the rows were shuffled"
        )
    return float(np.median(forward))


Step = tuple[IndexArray, FloatArray, list[Event]]


def _strays(stream: str, rows: IndexArray, time_s: FloatArray, usual_s: float) -> Step:
    """Zeros, and stamps that the rows before and after show to be wild."""
    longest_s = max(LONGEST_PAUSE * usual_s, LEAST_RUN_S)
    step_s = np.diff(time_s)
    over_s = np.concatenate([time_s[2:] - time_s[:-2], [np.nan]])  # without the row after each step
    away_s = np.minimum(np.abs(step_s), np.abs(np.append(step_s[1:], np.nan)))
    alone = np.flatnonzero((over_s > 0.0) & (over_s <= 4.0 * usual_s) & (away_s > REORDERED_ROWS * usual_s)) + 1
    cuts = np.unique([*(np.flatnonzero((step_s < 0.0) | (step_s > longest_s)) + 1), *alone, *(alone + 1)]).astype(int)
    if not len(cuts):
        return rows, time_s, []
    edges = np.concatenate([[0], cuts, [len(time_s)]])
    runs = [(int(a), int(b)) for a, b in pairwise(edges)]
    kept, strays = _parted(time_s, runs, usual_s, longest_s)
    if not strays:
        return rows, time_s, []
    events: list[Event] = []
    where = np.concatenate([np.arange(a, b) for a, b in strays])
    zeros = time_s[where] == 0.0
    for kind, group in (("zero stamp", where[zeros]), ("wild stamp", where[~zeros])):
        if len(group):
            span = (_near(time_s, kept, int(group[0])), _near(time_s, kept, int(group[-1])))
            said = "a time of 0" if kind == "zero stamp" else f"a time ({time_s[group[0]]:.6g} s) far from their row's"
            events.append(_left_out(kind, stream, len(group), span, f"have {said}"))
    good = np.ones(len(rows), dtype=bool)
    good[where] = False
    return rows[good], time_s[good], events


def _parted(
    time_s: FloatArray, runs: list[tuple[int, int]], usual_s: float, longest_s: float
) -> tuple[list[tuple[int, int]], list[tuple[int, int]]]:
    """Runs of rows that are kept, and strays."""
    kept: list[tuple[int, int]] = []
    strays: list[tuple[int, int]] = []
    most_rows = max(b - a for a, b in runs)
    for k, (a, b) in enumerate(runs):
        alike = bool(np.ptp(time_s[a:b]) == 0.0)
        if b - a == most_rows or not (b - a <= STRAY_ROWS or alike):
            kept.append((a, b))
            continue
        after = next((r for r in runs[k + 1 :] if r[1] - r[0] > STRAY_ROWS), None)
        before = kept[-1] if kept else None
        if before and after:
            over_s = float(time_s[after[0]] - time_s[before[1] - 1])
            stray = 0.0 < over_s <= longest_s + 3.0 * usual_s * (b - a)
        elif after or before:
            far_s = abs(float(time_s[after[0]] - time_s[b - 1] if after else time_s[a] - time_s[kept[-1][1] - 1]))
            rest = time_s[after[0] : after[1]] if after else time_s[kept[0][0] : kept[-1][1]]
            stray = far_s > longest_s and (bool((time_s[a:b] == 0.0).all()) or far_s > max(FAR_S, float(np.ptp(rest))))
            stray = stray or (alike and b - a > STRAY_ROWS and far_s > longest_s)
        else:
            stray = False
        (strays if stray else kept).append((a, b))
    return kept, strays


def _near(time_s: FloatArray, kept: list[tuple[int, int]], row: int) -> float:
    """Time of the last row before one that is left out (of the first one after, where there is none)."""
    before = [b - 1 for _, b in kept if b <= row]
    return float(time_s[before[-1] if before else kept[0][0]])


def _left_out(kind: str, stream: str, count: int, span: tuple[float, float], said: str) -> Event:
    rows = f"1 row of {stream}" if count == 1 else f"{count} rows of {stream}"
    said = said.replace("have ", "has ", 1).replace("their row's", "its row's") if count == 1 else said
    sentence = f"{rows} at {{at}} {said}"
    return Event(kind, stream, span, float(count), "rows", sentence, "left out in reading", certain=True, done=True)


def _wraps(stream: str, rows: IndexArray, time_s: FloatArray, usual_s: float) -> Step:
    """Counters that began anew: unwrapped."""
    events: list[Event] = []
    step_s = np.diff(time_s)
    added_s = np.zeros(len(time_s))
    for i in np.flatnonzero(step_s < 0.0):
        for what, period_s in PERIODS_S.items():
            if 0.0 < step_s[i] + period_s <= pause_s(usual_s):
                added_s[i + 1 :] += period_s
                at = float(time_s[i] + added_s[i])
                sentence = f"the clock of {stream} begins anew at {{at}}: a counter of {what} went round"
                done = f"unwrapped in reading: {period_s:.6f} s added from there on"
                events.append(Event("clock wrap", stream, (at, at), period_s, "s", sentence, done, True, True))
                break
    return rows, time_s + added_s, events


def _sorted(stream: str, rows: IndexArray, time_s: FloatArray, usual_s: float) -> Step:
    """Rows that changed places with near ones: sorted, if the times are then those of a clock."""
    moved: list[int] = []
    for i in np.flatnonzero((np.diff(time_s) < 0.0) & (np.diff(time_s) > -REORDERED_ROWS * usual_s)):
        part = slice(max(0, i - REORDERED_ROWS), i + REORDERED_ROWS + 2)
        if not (np.diff(time_s[part]) < 0.0).any():
            continue  # an earlier sort has mended it
        order = np.argsort(time_s[part], kind="stable")
        step_s = np.diff(time_s[part][order])
        if step_s.min() > 0.3 * usual_s and step_s.max() < 3.0 * usual_s:
            time_s, rows = time_s.copy(), rows.copy()
            time_s[part], rows[part] = time_s[part][order], rows[part][order]
            moved.append(int(i))
    if not moved:
        return rows, time_s, []
    span = (float(time_s[moved[0]]), float(time_s[moved[-1]]))
    places = "1 place" if len(moved) == 1 else f"{len(moved)} places"
    sentence = f"rows of {stream} are in another order than their times in {places}, the first at {{at}}"
    event = Event("order", stream, span, float(len(moved)), "rows", sentence, "sorted in reading", True, True)
    return rows, time_s, [event]


def _repeats(stream: str, rows: IndexArray, time_s: FloatArray, usual_s: float) -> Step:
    """Of rows with one time, the first."""
    again = np.concatenate([[False], np.diff(time_s) == 0.0])
    if not again.any():
        return rows, time_s, []
    where = time_s[again]
    count = int(again.sum())
    many = "1 row of" if count == 1 else f"{count} rows of"
    sentence = f"{many} {stream} at {{at}} {'has' if count == 1 else 'have'} the time of the row before"
    if count > 0.2 * len(rows):
        sentence += f": stamps are rounded to {1e3 * usual_s:.3g} ms"
    done = "the first of each was kept in reading"
    event = Event(
        "repeated stamp", stream, (float(where[0]), float(where[-1])), float(count), "rows", sentence, done, True, True
    )
    return rows[~again], time_s[~again], [event]
