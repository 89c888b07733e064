"""How much more room each segment of a plan needs: what the planner is to keep, so that fewer flights are lost.

Flights that are given up for their tracking error are flown again with more room stated. What the next plan then loses
is not tried: plan with it, and fly that plan.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flight import FloatArray
from preflight import core, statistics, study
from preflight.hidden import left_of
from preflight.record import Record
from preflight.result import LEAST_FINISHED, Result
from preflight.scenario import Scenario
from preflight.study import Options

RESERVE_M = 0.005
"""On top of what the flights miss: the next plan is another curve."""
MOST_M = 0.5
"""Where more would be asked for, none is: a flight that is so far off is not cured by room."""
SURE = 0.9
"""Probability with which other flights of the same plan are to be no more often lost than the risk allows."""
TRIED_M = (0.01, 0.02, 0.04, 0.06, 0.09, 0.13, 0.18)
"""More room, with which flights that were given up are flown again: it is asked for everywhere, so not for much."""
_MOST_TRIED = 256
"""Flights that are, those lost before others; the rest are taken to need what these do, in turn."""
_BEYOND = 0.5
"""Of the error at which a flight is given up: how much farther off it would have been, where that is not flown."""
_TAIL = 10
"""Nearest flights in a segment, whose distances are taken to fall off exponentially."""


@dataclass(frozen=True, slots=True)
class Needed:
    """More room in one segment."""

    segment: int
    from_s: float
    to_s: float
    touching: bool
    """Whether flights touch there; else they are given up for their tracking error, for which the controller allows as
    much as the plan has everywhere."""
    extra_m: float
    """On top of the room that the plan has there; of those given up on top of its margin."""
    flights: int

    def as_dict(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in self.__slots__}


def needed(scenario: Scenario, result: Result, options: Options) -> tuple[Needed, ...]:
    """More room by segment, for those that need it; empty for a go, and where no room up to `MOST_M` would help.

    As many of the worst are let be as with other luck the accepted risk allows too. Arguments as of `study.fly`.
    """
    if result.go:
        return ()
    if result.rare is None:
        record, spare = result.record, allowed(result.flights, left_of(result.risk, result.hidden))
        given_up = _given_up(record)
        cured, extra_m = _tried(scenario, options, record, given_up & _matters(result))
    else:
        record = cured = result.rare.worst
        spare, given_up = 0, _given_up(record)
        extra_m = np.where(given_up, _untried(record, given_up), 0.0)
    helpless = record.lost & ~np.isfinite(extra_m) | cured.left_map | cured.upset
    left = max(int(_expected(spare, len(record))) - int(helpless.sum()), 0)
    everywhere_m = _everywhere(result, record, extra_m, left)
    spared = given_up & (extra_m > everywhere_m)
    found = _by_segment(result, last_s(record, result.trajectory.duration_s), np.minimum(extra_m, everywhere_m))
    found += _touching(result, cured, ~helpless & ~spared, spare, left - int((spared & record.lost).sum()))
    return found if all(each.extra_m <= MOST_M for each in found) else ()


def _given_up(record: Record) -> NDArray[np.bool_]:
    """(n,) whether the controller ended a flight that room may have saved; many that overturn brake after that."""
    return (record.ending == core.FAILSAFE) & ~record.left_map


def _matters(result: Result) -> NDArray[np.bool_]:
    """(n,) which flights given up are to be cured: those that are lost, and where too few come to the end all."""
    return result.record.lost | (result.finished < LEAST_FINISHED)


def _tried(scenario: Scenario, options: Options, record: Record, which: NDArray[np.bool_]) -> tuple[Record, FloatArray]:
    """The flights (n,), of `which` those given up are flown again with more room stated until they come to the end.

    Returns:
        Their records, and (n,) the room: 0 where none was tried, infinite where none helped.
    """
    extra_m, cured = np.zeros(len(record)), record
    order = np.flatnonzero(which)
    order = order[np.argsort(~record.lost[order], kind="stable")]
    tried, rest = order[:_MOST_TRIED], order[_MOST_TRIED:]
    extra_m[tried], open_ = np.inf, tried
    for more_m in TRIED_M:
        if not open_.size:
            break
        roomier = replace(scenario, clearance_m=scenario.clearance_m + more_m)
        again = study.records(roomier, open_, options)
        ended = (again.ending == core.FINISHED) & ~again.upset & ~again.left_map
        cured = cured.with_rows(open_[ended], again[ended])
        extra_m[open_[ended]] = more_m
        open_ = open_[~ended]
    if not rest.size:
        return cured, extra_m
    alike = tried if record.lost[rest].any() or record.lost[tried].all() else tried[~record.lost[tried]]
    alike = np.resize(alike, rest.size)
    extra_m[rest] = extra_m[alike]
    return cured.with_rows(rest, cured[alike]), extra_m


def _untried(record: Record, given_up: NDArray[np.bool_]) -> float:
    """The room that flights given up are short of, by how far off half of them were."""
    error_m = record.error_m[given_up & np.isfinite(record.error_m).any(axis=1)]
    most_m = np.where(np.isfinite(error_m), error_m, 0.0).max(axis=1, initial=0.0)
    return _BEYOND * float(np.median(most_m)) if most_m.size else 0.0


def _everywhere(result: Result, record: Record, extra_m: FloatArray, left: int) -> float:
    """The room that all of the plan needs so that no more than `left` flights given up are lost, and enough end."""
    lost_m = np.sort(extra_m[record.lost & np.isfinite(extra_m)])[::-1]
    least_m = float(lost_m[left]) if lost_m.size > left else 0.0
    if result.rare is None and result.finished < LEAST_FINISHED:
        some = int(0.5 * (1.0 - LEAST_FINISHED) * len(record))
        least_m = max(least_m, float(np.sort(extra_m)[::-1][some]))
    return least_m


def last_s(record: Record, duration_s: float) -> FloatArray:
    """(n,) time on the trajectory up to which each was flown."""
    flown = np.isfinite(record.error_m)
    last = flown.shape[1] - 1 - flown[:, ::-1].argmax(axis=1)
    return (last + 0.5) * duration_s / flown.shape[1]


def _by_segment(result: Result, times_s: FloatArray, extra_m: FloatArray) -> tuple[Needed, ...]:
    """Of flights (n,) that were given up: the most that they need in each segment."""
    found: list[Needed] = []
    for i, mine in _in_segments(result, times_s, extra_m > 0.0):
        found.append(_needed(result, i, False, float(extra_m[mine].max()), int(mine.sum())))
    return tuple(found)


def _touching(result: Result, record: Record, which: NDArray[np.bool_], spare: int, left: int) -> tuple[Needed, ...]:
    """By segment, how much farther obstacles must be so that other flights are lost no more often than is accepted.

    Args:
        spare, left: how many may be lost, and how many more than are lost otherwise: the deepest of all segments.
    """
    short_m = -record.clearance_m
    deepest = np.flatnonzero(which & (short_m > 0.0))
    deepest = deepest[np.argsort(-short_m[deepest], kind="stable")]
    cured = np.zeros(len(record), dtype=np.bool_)
    cured[deepest[max(left, 0) :]] = True
    if not cured.any():
        return ()
    parts = _in_segments(result, record.path_s, which)
    touched = [(i, mine) for i, mine in parts if (short_m[mine] > 0.0).any()]
    few = _expected(spare, len(record)) / len(touched) if result.rare is None else 0.0
    found: list[Needed] = []
    for i, mine in touched:
        seen_m = float(short_m[mine & cured].max(initial=0.0))
        extra_m = RESERVE_M + max(seen_m, _exceeded_by(short_m[mine], few))
        found.append(_needed(result, i, True, extra_m, int((short_m[mine] > 0.0).sum())))
    return tuple(found)


def _expected(spare: int, flights: int) -> float:
    """Losses that may be expected if with probability `SURE` no more than `spare` are seen."""
    return statistics.upper_bound(spare, flights, 1.0 - SURE) * flights


def _exceeded_by(short_m: FloatArray, few: float) -> float:
    """What so `few` of as many flights again are short of more than, from the tail of these (n,); 0: too few for it."""
    falling = np.sort(short_m)[::-1]
    tail = min(_TAIL, falling.size // 2)
    if tail < 2 or not 0.0 < few < tail:
        return 0.0
    scale_m = float(falling[: tail - 1].mean() - falling[tail - 1])  # of an exponential, by those beyond the last one
    return float(falling[tail - 1]) + scale_m * math.log(tail / few)


def _in_segments(
    result: Result, times_s: FloatArray, which: NDArray[np.bool_]
) -> Iterator[tuple[int, NDArray[np.bool_]]]:
    segments = result.trajectory.segment_at(np.nan_to_num(times_s))[0]
    for i in np.unique(segments[which]).tolist():
        yield i, which & (segments == i)


def _needed(result: Result, segment: int, touching: bool, extra_m: float, flights: int) -> Needed:
    starts_s = result.trajectory.starts_s
    return Needed(segment, float(starts_s[segment]), float(starts_s[segment + 1]), touching, extra_m, flights)


def allowed(flights: int, risk: float) -> int:
    """How many may be lost at most so that the risk is shown to be met; 0 where not even none shows it."""
    count = 0
    while statistics.upper_bound(count + 1, flights) <= risk:
        count += 1
    return count
