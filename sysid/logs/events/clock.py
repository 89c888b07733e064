"""Several streams of one recording, each examined on its own clock, then against the others; before they are joined.

A step of a stream's clock is told from a pause of the recording by what does not depend on it: the stream's own motion
(over a step of the clock it goes on as within one sample), the ends of the other streams, and a step that another
stream shows to be the clock's.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np

from flight import InputError
from flight.rotations import FloatArray
from sysid.logs.events.event import DETECTABLE_CLOCK_S, Event
from sysid.logs.events.stamps import Stamps, examine

Stream = dict[str, FloatArray]
"""Columns by name, `time_s` among them."""

AROUND = 8
"""Samples on either side, through which straight lines show how the motion goes on."""
KNOWN_S = 0.05
"""The time that passed over a step must be known to this by the motion."""
SIGMAS = 4.0
ENDS_S = 0.25
"""Streams of one recording begin and end together to within this, or a tenth of the step."""
SPLIT_S = 1.0
"""The pause that is left where nothing shows how long it was."""


@dataclass(frozen=True, slots=True)
class _Clocked:
    """A stream whose stamps were examined, not yet its steps."""

    name: str
    stamps: Stamps
    values: FloatArray
    """(m, c)"""


def examined(
    streams: Mapping[str, Stream], *, not_motion: Collection[str] = ()
) -> tuple[dict[str, Stream], tuple[Event, ...]]:
    """The streams with rising times, and what was found and done.

    Args:
        streams: by the name that a reader of the sentences knows; in the order of the file.
        not_motion: columns that move from row to row, whatever the time.

    Raises:
        FormatError: a stream's times are none.
        InputError: a stream's times and those of the others have nothing in common.
    """
    clocked: list[_Clocked] = []
    for name, stream in streams.items():
        stamps = examine(name, stream["time_s"])
        columns = [values[stamps.rows] for key, values in stream.items() if key not in ("time_s", *not_motion)]
        clocked.append(
            _Clocked(name, stamps, np.stack(columns, axis=1) if columns else np.zeros((len(stamps.rows), 0)))
        )
    events = [event for one in clocked for event in one.stamps.events]
    times: dict[str, FloatArray] = {}
    shown: list[tuple[float, float]] = []
    for one in sorted(clocked, key=lambda one: not any(_goes_on(one, int(i)) for i in one.stamps.steps())):
        times[one.name], found = _without_steps(one, [o for o in clocked if o is not one], shown)
        events += found
    _require_one_base(times)
    kept = {one.name: one.stamps.rows for one in clocked}
    return {
        name: {"time_s": times[name]} | {k: v[kept[name]] for k, v in stream.items() if k != "time_s"}
        for name, stream in streams.items()
    }, tuple(_together(events, len(streams)))


def _without_steps(
    one: _Clocked, others: list[_Clocked], shown: list[tuple[float, float]]
) -> tuple[FloatArray, list[Event]]:
    """Times without steps of the clock; `shown` collects where and by how much the motion shows one."""
    time_s, usual_s = one.stamps.time_s.copy(), one.stamps.usual_s
    events: list[Event] = []
    for i in one.stamps.steps():
        at, step_s = float(time_s[i]), float(one.stamps.time_s[i + 1] - one.stamps.time_s[i])
        size_s = usual_s - step_s  # what is to be added from there on
        if -DETECTABLE_CLOCK_S < size_s <= 0.0:
            continue
        why = _why(one, int(i), size_s, others, shown)
        if why:
            if why == _BY_MOTION:
                shown.append((float(one.stamps.time_s[i]), size_s))
            events.append(_step(one.name, at, size_s, why))
        elif size_s > 0.0:
            events.append(_unknown(one.name, at, size_s))
            size_s += SPLIT_S - usual_s
        else:
            continue  # a pause of the recording
        time_s[i + 1 :] += size_s
    return time_s, events


_BY_MOTION = "the motion goes on over it as within one sample"


def _why(one: _Clocked, i: int, size_s: float, others: list[_Clocked], shown: list[tuple[float, float]]) -> str:
    """What shows that a step after row i is the clock's; empty: nothing does."""
    if _goes_on(one, i):
        return _BY_MOTION
    at = float(one.stamps.time_s[i])
    if any(abs(at - when) < 0.1 and abs(size_s - much_s) < 0.1 for when, much_s in shown):
        return "another stream has the same step, over which its motion goes on"
    within_s = max(ENDS_S, 0.1 * abs(size_s))
    alone = [o for o in others if len(o.stamps.time_s) and not _has_step(o, size_s)]
    time_s = one.stamps.time_s
    late = [float(time_s[-1] - o.stamps.time_s[-1]) for o in alone]
    early = [float(time_s[0] - o.stamps.time_s[0]) for o in alone]
    for first_s, last_s in zip(early, late, strict=True):
        if abs(first_s) < within_s and abs(last_s + size_s) < within_s < abs(last_s):
            return "without it the stream ends with the others, which have none"
    return ""


def _has_step(one: _Clocked, size_s: float) -> bool:
    step_s = np.diff(one.stamps.time_s)
    return bool((np.abs(one.stamps.usual_s - step_s - size_s) < 0.1 * abs(size_s)).any())


def _goes_on(one: _Clocked, i: int) -> bool:
    """Whether the motion shows that one sample's time, and no more, passed after row i."""
    passed_s, sigma_s = _passed(one, i)
    usual_s = one.stamps.usual_s
    if not sigma_s < KNOWN_S:
        return False
    return abs(passed_s - usual_s) < max(SIGMAS * sigma_s, 2.0 * usual_s)


def _passed(one: _Clocked, i: int) -> tuple[float, float]:
    """The time from row i to the next by how all values go on, and its standard error; infinite: not known.

    Of straight lines through the samples on either side, the mean slope times that time is the difference.
    """
    before, after = slice(max(0, i - AROUND + 1), i + 1), slice(i + 1, i + 1 + AROUND)
    (left, slope_before, noise_before), (right, slope_after, noise_after) = (
        _line(one.stamps.time_s[part], one.values[part], edge) for part, edge in ((before, -1), (after, 0))
    )
    slope = 0.5 * (slope_before + slope_after)
    by_chance = (noise_before + noise_after) / (one.stamps.usual_s * AROUND**1.5)  # of a line through noise
    slope = np.where(np.abs(slope) > SIGMAS * by_chance, slope, 0.0)
    bend = np.abs(slope_after - slope_before) * one.stamps.usual_s
    scale = 1e-6 * np.nanmax(np.abs(one.values), axis=0, initial=0.0) + 1e-12
    sigma = 1.5 * (noise_before + noise_after) + bend + scale
    known = np.isfinite(slope) & np.isfinite(sigma) & np.isfinite(right - left)
    if not known.any():
        return 0.0, np.inf
    weight = slope[known] / sigma[known] ** 2
    information = float((weight * slope[known]).sum())
    if not information > 0.0:
        return 0.0, np.inf
    passed_s = float((weight * (right - left)[known]).sum() / information)
    left_over = ((right - left)[known] - slope[known] * passed_s) / sigma[known]
    return passed_s, float(np.sqrt(max(1.0, (left_over**2).mean()) / information))


def _line(time_s: FloatArray, values: FloatArray, edge: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Value at the edge, slope and scatter of straight lines through (k, c); NaN where there are too few."""
    nothing = np.full(values.shape[1], np.nan)
    known = np.isfinite(values).all(axis=0) if len(values) >= 4 else np.zeros(values.shape[1], dtype=bool)
    if not known.any() or not (np.diff(time_s) > 0.0).all():
        return nothing, nothing, nothing
    x = np.column_stack([np.ones(len(time_s)), time_s - time_s[edge]])
    found = np.linalg.lstsq(x, values[:, known], rcond=None)[0]
    spread = np.sqrt(((values[:, known] - x @ found) ** 2).sum(axis=0) / (len(time_s) - 2))
    out = [nothing.copy(), nothing.copy(), nothing.copy()]
    for target, part in zip(out, (found[0], found[1], spread), strict=True):
        target[known] = part
    return out[0], out[1], out[2]


def _step(stream: str, at: float, size_s: float, why: str) -> Event:
    back = size_s > 0.0
    sentence = f"the clock of {stream} {'goes back' if back else 'leaps'} by {abs(size_s):.3f} s at {{at}}: {why}"
    done = f"shifted in reading by {size_s:+.3f} s from there on"
    kind = "clock back" if back else "clock ahead"
    return Event(kind, stream, (at, at), abs(size_s), "s", sentence, done, certain=True, done=True)


def _unknown(stream: str, at: float, size_s: float) -> Event:
    sentence = (
        f"the clock of {stream} goes back by {size_s:.3f} s at {{at}}, and nothing shows how long the "
        "pause was: two recordings in one file?"
    )
    done = f"what follows was set {SPLIT_S:g} s later; fit the pieces as separate flights (gaps='split')"
    return Event("clock back", stream, (at, at + SPLIT_S), size_s, "s", sentence, done, False, True)


def _together(events: list[Event], streams: int) -> list[Event]:
    """With what happened to several streams at once as one event."""
    groups: dict[tuple[str, float, float], list[Event]] = {}
    for event in events:
        groups.setdefault((event.kind, round(event.span[0], 1), round(event.size, 2)), []).append(event)
    found: list[Event] = []
    for first, *more in groups.values():
        whose = "all streams" if 1 < streams == len(more) + 1 else f"{first.stream} and {len(more)} more"
        said = first.sentence.replace(first.stream, whose, 1)
        found.append(replace(first, stream=whose, sentence=said) if more else first)
    return found


def _require_one_base(times: Mapping[str, FloatArray]) -> None:
    """
    Raises:
        InputError: a stream has no time in common with the others.
    """
    spans = {name: (float(t[0]), float(t[-1])) for name, t in times.items() if len(t) > 1}
    if len(spans) < 2:
        return
    for name, (first_s, last_s) in spans.items():
        rest = [span for other, span in spans.items() if other != name]
        if all(last_s < begin_s or end_s < first_s for begin_s, end_s in rest):
            begin_s, end_s = max(rest, key=lambda span: span[1] - span[0])
            raise InputError(
                f"{name} runs from {first_s:.3f} to {last_s:.3f} s, the others from {begin_s:.3f} to {end_s:.3f} s. "
                f"Its clock has another zero, {abs(first_s - begin_s):.3f} s "
                f"{'later' if first_s > begin_s else 'earlier'}; record it on the clock of the others, or leave it out"
            )
