"""The way home from each moment of a plan: planned from the motion there, gated, and flown as often as the plan.

Each is one trajectory, the plan up to a join and from there to where it began, so that it is flown with all that
happened before.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import planner
import preflight
from flight import FlightError, FloatArray, Progress, Trajectory, Waypoints
from goshawk.commands.preflight.inputs import Subject, hidden
from planner.gate import gate
from preflight import core
from preflight.result import LEAST_FINISHED

MOMENTS = 4
"""Of the plan, from which a way home is looked for unless told otherwise, evenly spread over its time."""
_AWAY_M = 0.1
"""Nearer to where the plan began, the vehicle is home."""
_REST = np.zeros((3, 4))
_SAME_M = 1e-6
GROUNDED = "not looked for: the plan begins on the ground"


@dataclass(frozen=True, slots=True)
class WayHome:
    """From one moment."""

    from_s: float
    left_s: float
    """Of the plan, from there on."""
    duration_s: float | None
    """Of the way home alone; None if there is none."""
    energy_j: float | None
    """That 99 % of the flights need for the plan up to here and the way home, with the hover before; None: too few come
    home to tell."""
    go: bool
    reason: str

    @property
    def end_is_nearer(self) -> bool:
        """Whether the way home takes no less than what is left of the plan."""
        return self.duration_s is not None and self.duration_s >= self.left_s

    def as_dict(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in self.__slots__}


def looked_for(subject: Subject) -> bool:
    """Whether ways home are: not of a plan that begins on the ground, where nothing is clear."""
    ground = gate.asked_of(subject.item).ground_world_m
    began = subject.item.trajectory.position([0.0])[0]
    return ground is None or not any(np.linalg.norm(point - began) < _SAME_M for point in ground)


def ways_home(subject: Subject, moments: int = MOMENTS, *, progress: Progress) -> Iterator[WayHome]:
    """From the joins of the plan nearest to so many moments, in their order.

    Raises:
        KeyboardInterrupt: Ctrl-C.
    """
    for join in _joins(subject.item.trajectory, moments):
        yield _way_home(subject, join, progress)


def last_s(ways: tuple[WayHome, ...]) -> float | None:
    """The last of these moments from which a way home is a go; None: from none is."""
    return max((way.from_s for way in ways if way.go), default=None)


def no_return_s(ways: tuple[WayHome, ...], usable_j: float) -> float | None:
    """When the plan so far and the way home take 99 % of the flights all of an energy, for the first time; None: at no
    moment looked at, or from none is a way home a go. Linear between moments; that of the first, where it is too late
    already. A moment from which no way home is a go takes more than any energy: the one before it is the last."""
    needed = [way.energy_j if way.go and way.energy_j is not None else np.inf for way in ways]
    if not np.isfinite(needed).any():
        return None
    over = next((i for i, needed_j in enumerate(needed) if needed_j > usable_j), None)
    if over is None:
        return None
    if over == 0:
        return ways[0].from_s
    before_s, before_j, after_j = ways[over - 1].from_s, needed[over - 1], needed[over]
    return before_s + (ways[over].from_s - before_s) * (usable_j - before_j) / (after_j - before_j)


def no_return(ways: tuple[WayHome, ...], usable_j: float, end_j: float | None) -> str:
    """The point of no return by a battery, in words.

    Args:
        end_j: that 99 % of the flights need for the whole plan; None: not known.
    """
    if not any(way.go and way.energy_j is not None for way in ways):
        return "not known: from no moment is a way home a go"
    last_s = no_return_s(ways, usable_j)
    ends = end_j is not None and end_j <= usable_j
    if last_s is None:
        return f"none: it brings home from every moment looked at{', and to the end' if ends else ', not to the end'}"
    if last_s <= ways[0].from_s:
        why = "it is too small for any way home" if ways[0].go else "from there no way home is a go"
        return f"before {last_s:.1f} s: {why}"
    return f"{last_s:.1f} s: later it brings nobody home{', only to the end' if ends else ', nor to the end'}"


def sentence(ways: tuple[WayHome, ...]) -> str:
    """In words."""
    if not ways:
        return "home all along"
    goes, others = [way for way in ways if way.go], [way for way in ways if not way.go]
    nearer = [way for way in ways if way.end_is_nearer]
    said = [f"a go from {_moments(goes)}" if goes else "from no moment a go"]
    if others:
        said.append(f"not from {_moments(others)} ({others[-1].reason})")
    if goes and goes[-1] is not ways[-1]:
        said.append(f"the last that is a go is from {goes[-1].from_s:.1f} s")
    if nearer:
        said.append(f"the end is nearer from {_moments(nearer)}")
    return "; ".join(said)


def _moments(ways: list[WayHome]) -> str:
    return f"{', '.join(f'{way.from_s:.1f}' for way in ways)} s"


def energy_j(result: preflight.Result) -> float | None:
    """That 99 % of the flights need, by those that come to the end; None: fewer do than a go asks for."""
    finished = result.record.ending == core.FINISHED
    if result.finished < LEAST_FINISHED:
        return None
    return float(np.quantile(result.record.energy_j[finished], 0.99))


def _joins(path: Trajectory, moments: int = MOMENTS) -> list[int]:
    """Numbers of the joins nearest to the moments where the vehicle is away from home."""
    inner = np.arange(1, len(path.durations_s))
    away_m = np.linalg.norm(path.position(path.starts_s[inner]) - path.position([0.0]), axis=1)
    inner = inner[away_m > _AWAY_M]
    wanted_s = np.arange(1, moments + 1) / (moments + 1) * path.duration_s
    nearest = {int(inner[np.abs(path.starts_s[inner] - t).argmin()]) for t in wanted_s} if inner.size else set[int]()
    return sorted(nearest)


def _way_home(subject: Subject, join: int, progress: Progress) -> WayHome:
    from_s = float(subject.item.trajectory.starts_s[join])
    left_s = subject.item.trajectory.duration_s - from_s
    try:
        home = _planned(subject, join)
    except FlightError as error:
        return WayHome(from_s, left_s, None, None, False, str(error))
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
        replace(subject.options, explain=False, hidden=hidden(subject, scenario.trajectory)),
        progress=lambda stage, fraction: progress(f"the way home from {from_s:.1f} s", fraction),
    )
    if flown.cut_off or flown.unexplained:
        raise KeyboardInterrupt
    return WayHome(from_s, left_s, home.trajectory.duration_s, energy_j(flown), flown.go, flown.reason())


def _planned(subject: Subject, join: int) -> planner.Plan:
    """From the motion at a join to rest where the plan begins, for what the plan was checked for."""
    motion = _motion(subject.item.trajectory, join)
    points = np.stack([motion[0, :3], subject.item.trajectory.position([0.0])[0]])
    yaw_rad = np.array([motion[0, 3], np.nan])
    plan = gate.asked_of(subject.item)
    tube = {"keep_in_world_m": plan.keep_in_world_m, "keep_in_radius_m": plan.keep_in_radius_m}
    asked = planner.Conditions(start=motion[1:], end=_REST, **tube)
    options = gate.options_of(subject.item)
    return planner.plan(Waypoints(points, yaw_rad), subject.area.field, subject.vehicle, options, conditions=asked)


def _motion(path: Trajectory, join: int) -> FloatArray:
    """(4, 4) position and its first three derivatives, each with the heading's."""
    at = np.array([path.starts_s[join]])
    return np.stack([path.evaluate(at, order)[0] for order in range(4)])
