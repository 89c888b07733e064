"""How much more room each segment of a plan needs: what the planner is to keep, so that fewer flights are lost.

It is read off the flights and not tried: plan with it, and fly that plan.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flight import FloatArray
from preflight import core, statistics
from preflight.record import Record
from preflight.result import LEAST_FINISHED, Result

RESERVE_M = 0.01
"""On top of what the flights miss: the next plan is another curve."""
MOST_M = 0.5
"""Where more would be asked for, none is: a flight that is so far off is not cured by room."""
_BEYOND = 0.5
"""Of the error at which a flight is given up: how much farther off it would have been, which is not flown."""


@dataclass(frozen=True, slots=True)
class Needed:
    """More room in one segment."""

    segment: int
    from_s: float
    to_s: float
    touching: bool
    """Whether flights touch there that come to the end; else they are given up for their tracking error."""
    extra_m: float
    """On top of the room that the plan has there; of those given up on top of its margin."""
    flights: int

    def as_dict(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in self.__slots__}


def needed(result: Result) -> tuple[Needed, ...]:
    """More room by segment, for those that need it; empty for a go, and where no room up to `MOST_M` would help.

    As many of the deepest touches are let be as the accepted risk allows, and none of the rarest ones. Room also keeps
    flights from being given up for their tracking error: the controller allows as much as the plan has.
    """
    if result.go:
        return ()
    record = result.record if result.rare is None else result.rare.worst
    given_up = (record.ending == core.FAILSAFE) & ~record.left_map & ~record.upset
    touching = record.touched & (record.ending == core.FINISHED) & ~record.left_map & ~record.upset
    allowed = _allowed(result.flights, result.risk) if result.rare is None else 0
    left = allowed - int((record.lost & ~touching & ~given_up).sum())  # that no room helps
    spared = max(left - int((given_up & record.touched).sum()), 0)
    deepest = np.flatnonzero(touching)[np.argsort(record.clearance_m[touching])][spared:]
    found = _by_segment(result, record.path_s[deepest], RESERVE_M - record.clearance_m[deepest], True)
    if result.finished < LEAST_FINISHED or (given_up & record.touched).sum() > max(left, 0):
        found += _by_segment(result, *_beyond(record, given_up, result.trajectory.duration_s), False)
    return found if all(each.extra_m <= MOST_M for each in found) else ()


def _by_segment(result: Result, times: FloatArray, short_m: FloatArray, touching: bool) -> tuple[Needed, ...]:
    """Of flights (n,): the most that they are short of in each segment."""
    segments, starts_s = result.trajectory.segment_at(np.nan_to_num(times))[0], result.trajectory.starts_s
    found: list[Needed] = []
    for i in np.unique(segments).tolist():
        mine = short_m[segments == i]
        extra_m = float(mine.max())
        found.append(Needed(i, float(starts_s[i]), float(starts_s[i + 1]), touching, extra_m, int(mine.size)))
    return tuple(found)


def _beyond(record: Record, given_up: NDArray[np.bool_], duration_s: float) -> tuple[FloatArray, FloatArray]:
    """Time on the trajectory where flights were given up, and the room that they are short of: the median of all."""
    error_m = record.error_m[given_up & np.isfinite(record.error_m).any(axis=1)]
    flown = np.isfinite(error_m)
    last = flown.shape[1] - 1 - flown[:, ::-1].argmax(axis=1)
    most_m = np.where(flown, error_m, 0.0).max(axis=1, initial=0.0).astype(np.float64)
    middle_m = float(np.median(most_m)) if most_m.size else 0.0
    return (last + 0.5) * duration_s / flown.shape[1], np.full(most_m.size, _BEYOND * middle_m)


def _allowed(flights: int, risk: float) -> int:
    """How many may be lost at most so that the risk is shown to be met; 0 where not even none shows it."""
    count = 0
    while statistics.upper_bound(count + 1, flights) <= risk:
        count += 1
    return count
