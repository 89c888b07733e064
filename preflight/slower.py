"""How much slower each segment of a plan is to be flown, so that fewer flights overturn or come down: tried by flying.

Room does not help a flight that loses its attitude where the plan is most agile; less speed there does.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from preflight import margins, study
from preflight.hidden import left_of
from preflight.result import Result
from preflight.scenario import Scenario
from preflight.study import Options

TRIED = (1.05, 1.1, 1.2, 1.35, 1.5)
"""Durations over the plan's, with which the flights are flown again."""
_AT_ONCE = 500
"""Flights, after which it is looked whether too many are lost already."""


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
    """By segment where flights are lost so; empty for a go, where no more are than is accepted, and where none helps.

    The whole plan is slowed down to try it, with the same luck: the least of `TRIED` with which of all flights, not
    only of those lost, no more are lost than is accepted. Arguments as of `study.fly`.
    """
    if result.go or result.rare is not None:
        return ()
    record, most = result.record, margins.allowed(result.flights, left_of(result.risk, result.hidden))
    lost = np.flatnonzero(record.upset | record.left_map)
    if lost.size <= most:
        return ()
    others = np.setdiff1d(np.arange(len(record)), lost)
    parts = [lost, *np.split(others, range(_AT_ONCE, others.size, _AT_ONCE))]
    factor = next((tried for tried in TRIED if not _loses_more(scenario, parts, tried, most, options)), None)
    if factor is None:
        return ()
    segments = result.trajectory.segment_at(margins.last_s(record, result.trajectory.duration_s))[0][lost]
    starts_s = result.trajectory.starts_s
    return tuple(
        Slower(i, float(starts_s[i]), float(starts_s[i + 1]), factor, int((segments == i).sum()))
        for i in np.unique(segments).tolist()
    )


def _loses_more(scenario: Scenario, parts: list[NDArray[np.int_]], factor: float, most: int, options: Options) -> bool:
    """Whether more than so many of the flights in these parts are lost so much slower."""
    slowed, lost = replace(scenario, trajectory=scenario.trajectory.scale_time(factor)), 0
    for numbers in parts:
        lost += int(study.records(slowed, numbers, options).lost.sum())
        if lost > most:
            return True
    return False
