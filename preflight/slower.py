"""How much slower each segment of a plan is to be flown, so that fewer flights overturn or come down: tried by flying.

Room does not help a flight that loses its attitude where the plan is most agile; less speed there does.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from preflight import margins, study
from preflight.result import Result
from preflight.scenario import Scenario
from preflight.study import Options

TRIED = (1.05, 1.1, 1.2, 1.35, 1.5)
"""Durations over the plan's, with which flights that were lost so are flown again."""
_MOST_TRIED = 256


@dataclass(frozen=True, slots=True)
class Slower:
    """How much longer a segment is to take."""

    segment: int
    from_s: float
    to_s: float
    factor: float
    flights: int
    """That overturn or come down there."""

    def as_dict(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in self.__slots__}


def needed(scenario: Scenario, result: Result, options: Options) -> tuple[Slower, ...]:
    """By segment; empty for a go, where no more are lost so than is accepted, and where none of `TRIED` helps.

    Arguments as of `study.fly`. The whole plan is slowed down to try it.
    """
    if result.go or result.rare is not None:
        return ()
    record = result.record
    lost = np.flatnonzero(record.upset | record.left_map)
    if lost.size <= margins.allowed(result.flights, result.risk):
        return ()
    open_, factor = lost[:_MOST_TRIED], np.full(len(record), np.inf)
    for tried in TRIED:
        if not open_.size:
            break
        slowed = replace(scenario, trajectory=scenario.trajectory.scale_time(tried))
        again = study.records(slowed, open_, options)
        factor[open_[~again.lost]] = tried
        open_ = open_[again.lost]
    helped = lost[np.isfinite(factor[lost])]
    segments = result.trajectory.segment_at(margins.last_s(record, result.trajectory.duration_s))[0]
    starts_s = result.trajectory.starts_s
    found: list[Slower] = []
    for i in np.unique(segments[helped]).tolist():
        mine = helped[segments[helped] == i]
        found.append(Slower(i, float(starts_s[i]), float(starts_s[i + 1]), float(factor[mine].max()), len(mine)))
    return tuple(found)
