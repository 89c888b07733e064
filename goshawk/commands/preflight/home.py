"""The way home from each moment of a plan: planned from the motion there, gated, and flown as often as the plan.

Each is one trajectory, the plan up to a join and from there to where it began, so that it is flown with all that
happened before. From the point of no return on, the end is nearer, or no way home is a go.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import planner
import preflight
from flight import FlightError, FloatArray, Progress, Trajectory, Waypoints
from goshawk.commands.preflight.inputs import Subject
from planner.gate import gate

MOMENTS = 4
"""Of the plan, from which a way home is looked for, evenly spread over its time."""
_AWAY_M = 0.1
"""Nearer to where the plan began, the vehicle is home."""
_REST = np.zeros((3, 4))


@dataclass(frozen=True, slots=True)
class WayHome:
    """From one moment."""

    from_s: float
    duration_s: float | None
    """Of the way home alone; None if there is none."""
    energy_j: float | None
    """That 99 % of the flights need for the plan up to here and the way home, with the hover before."""
    go: bool
    reason: str

    def worth(self, plan_s: float) -> bool:
        """Whether it is a go, and takes less than what is left of a plan of this duration."""
        return self.go and self.duration_s is not None and self.duration_s < plan_s - self.from_s

    def as_dict(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in self.__slots__}


def ways_home(subject: Subject, *, progress: Progress) -> tuple[WayHome, ...]:
    """From some joins of the plan on the way, in their order.

    Raises:
        KeyboardInterrupt: Ctrl-C.
    """
    found: list[WayHome] = []
    for join in _joins(subject.item.trajectory):
        found.append(_way_home(subject, join, progress))
    return tuple(found)


def point_of_no_return_s(ways: tuple[WayHome, ...], duration_s: float) -> float | None:
    """The first moment from which on no way home is a go and takes less than what is left; None: there is none."""
    worth = [way.worth(duration_s) for way in ways]
    first = max((number + 1 for number, is_worth in enumerate(worth) if is_worth), default=0)
    return ways[first].from_s if first < len(ways) else None


def sentence(ways: tuple[WayHome, ...], duration_s: float) -> str:
    """In words."""
    if not ways:
        return "home all along"
    from_s = point_of_no_return_s(ways, duration_s)
    before = [way for way in ways if from_s is None or way.from_s < from_s]
    goes, others = (
        [f"{way.from_s:.1f}" for way in before if way.worth(duration_s) is worth] for worth in (True, False)
    )
    said = [f"a go from {', '.join(goes)} s"] if goes else []
    said += [f"not from {', '.join(others)} s"] if others else []
    if from_s is not None:
        last = next(way for way in ways if way.from_s == from_s)
        said.append(f"from {from_s:.1f} s on " + ("the end is nearer" if last.go else f"none is ({last.reason})"))
    return "; ".join(said)


def _joins(path: Trajectory) -> list[int]:
    """Numbers of the joins nearest to the moments where the vehicle is away from home."""
    inner = np.arange(1, len(path.durations_s))
    away_m = np.linalg.norm(path.position(path.starts_s[inner]) - path.position([0.0]), axis=1)
    inner = inner[away_m > _AWAY_M]
    wanted_s = np.arange(1, MOMENTS + 1) / (MOMENTS + 1) * path.duration_s
    nearest = {int(inner[np.abs(path.starts_s[inner] - t).argmin()]) for t in wanted_s} if inner.size else set[int]()
    return sorted(nearest)


def _way_home(subject: Subject, join: int, progress: Progress) -> WayHome:
    from_s = float(subject.item.trajectory.starts_s[join])
    try:
        home = _planned(subject, join)
    except FlightError as error:
        return WayHome(from_s, None, None, False, str(error))
    path = subject.item.trajectory
    begun = Trajectory(path.durations_s[:join], path.coefficients[:join])
    proved_m = home.gate.clearance_m - home.gate.body_radius_m  # which may be less than the plan's
    scenario = replace(
        subject.scenario,
        trajectory=planner.mission.join([begun, home.trajectory]),
        clearance_m=min(subject.margin_m, proved_m),
    )
    flown = preflight.fly(
        scenario,
        replace(subject.options, explain=False),
        progress=lambda stage, fraction: progress(f"the way home from {from_s:.1f} s", fraction),
    )
    if flown.cut_off or flown.unexplained:
        raise KeyboardInterrupt
    energy_j = float(np.quantile(flown.record.energy_j, 0.99))
    return WayHome(from_s, home.trajectory.duration_s, energy_j, flown.go, flown.reason())


def _planned(subject: Subject, join: int) -> planner.Plan:
    """From the motion at a join to rest where the plan begins, for what the plan was checked for."""
    motion = _motion(subject.item.trajectory, join)
    points = np.stack([motion[0, :3], subject.item.trajectory.position([0.0])[0]])
    yaw_rad = np.array([motion[0, 3], np.nan])
    asked = planner.Conditions(start=motion[1:], end=_REST)
    options = gate.options_of(subject.item)
    return planner.plan(Waypoints(points, yaw_rad), subject.area.field, subject.vehicle, options, conditions=asked)


def _motion(path: Trajectory, join: int) -> FloatArray:
    """(4, 4) position and its first three derivatives, each with the heading's."""
    at = np.array([path.starts_s[join]])
    return np.stack([path.evaluate(at, order)[0] for order in range(4)])
