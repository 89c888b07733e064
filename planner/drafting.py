"""What a plan would look like with one waypoint elsewhere, while it is dragged: quick, and not checked.

The last path is drawn along with the waypoint and optimised for a few iterations near it; how many depends on the
number of segments there, not on the clock, so that the same drag gives the same drafts. No way round obstacles is
searched: the path keeps to the side on which it passed them.
"""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

import esdf
from flight import FloatArray, Waypoints, portable
from planner.curve import minimum_snap
from planner.curve.minimum_snap import Spline
from planner.gate import instants, limits
from planner.optimise import descents, time_allocation
from planner.optimise.fastest import Path
from planner.optimise.time_allocation import Problem, Solution
from planner.request import space
from planner.request.conditions import Conditions
from planner.request.options import PlanOptions
from vehicle import Limits, Vehicle

_REACH = 2
"""Segments on either side of the moved legs that change with them."""
_WORK = 800, 300
"""Segments times iterations of both descents."""
_LONGER = 0.5, 3.0
"""How much shorter or longer a leg's time may become with its length."""
_PER_SEGMENT, _PER_LIMIT = 8, 2
"""Steps per segment from one sample of a draft to the next, and how many of them to the next that limits are asked at:
the vehicle's own model is half of the work."""


@dataclass(frozen=True, slots=True, eq=False)
class Draft:
    """Samples of a path that nothing has checked. There is no trajectory in it, so none can be saved or flown."""

    draft: ClassVar[bool] = True
    """As `Plan.draft`, which is False."""
    waypoints: Waypoints
    time_s: FloatArray
    """(n,) from 0."""
    position_world_m: FloatArray
    """(n, 3)."""
    clearance_m: float
    """No point of the path is nearer to an obstacle; minus infinity where it meets unknown space."""
    clearance_point_world_m: tuple[float, float, float]
    """Where it comes nearest, or meets unknown space."""
    required_clearance_m: float
    shares: dict[str, float]
    """Largest share used of each limit (`Check.name`) at the samples of what changed."""

    @property
    def duration_s(self) -> float:
        return float(self.time_s[-1])

    @property
    def is_clear(self) -> bool:
        """Whether it keeps the required clearance."""
        return self.clearance_m >= self.required_clearance_m


def draft(
    path: Path,
    index: int,
    before: Waypoints,
    after: Waypoints,
    room: space.DistanceField,
    vehicle: Vehicle,
    options: PlanOptions,
    conditions: Conditions,
) -> Draft:
    """The path for waypoints of which the one with this index has moved; far from it, as it was."""
    shift_m = (after.positions_world_m - before.positions_world_m)[index]
    spline, changed = _drawn_along(path, index, shift_m)
    if path.kept is not None:
        problem = _problem(path, spline, after, options.limits_for(vehicle), conditions)
        spline = _optimised(problem, spline, changed)
    return _sampled(spline, changed, after, room, vehicle, options)


def _drawn_along(path: Path, index: int, shift_m: FloatArray) -> tuple[Spline, np.ndarray]:
    """The knots of both legs moved with the waypoint, their times in proportion, and which segments (k,) change."""
    kept, number = _spline(path), path.waypoint
    around = np.clip([index - 1, index, index + 1], 0, number.max())
    before, at, after = (int(np.flatnonzero(number == i)[0]) for i in around)
    states, T = kept.states.copy(), kept.durations_s.copy()
    off = np.arange(len(states)) - at
    reach = np.where(off < 0, max(at - before, 1), max(after - at, 1))
    states[:, 0, :3] += np.maximum(1.0 - np.abs(off) / reach, 0.0)[:, None] * shift_m
    for first, last in ((before, at), (at, after)):
        if last > first:
            was, now = (portable.length(ends[last, 0, :3] - ends[first, 0, :3]) for ends in (kept.states, states))
            T[first:last] *= np.clip(now / max(was, 1e-9), *_LONGER)
    changed = np.zeros(len(T), dtype=bool)
    changed[before:after] = True
    changed = descents.grown(changed, _REACH)
    [(first, last)] = descents.runs(changed)
    velocity = None if path.kept is None else path.kept.problem.velocity
    states[first : last + 1] = minimum_snap.solve(
        states[first : last + 1, 0],
        T[first:last],
        start=kept.states[first, 1:],
        end=kept.states[last, 1:],
        velocity=None if velocity is None else velocity[first : last + 1],
    ).states
    return Spline(T, states), changed


def _spline(path: Path) -> Spline:
    if path.kept is not None:
        return path.kept.spline
    ends = path.trajectory.starts_s
    return Spline(path.trajectory.durations_s, np.stack([path.trajectory.evaluate(ends, r) for r in range(4)], axis=1))


def _problem(path: Path, spline: Spline, waypoints: Waypoints, bounds: Limits, asked: Conditions) -> Problem:
    assert path.kept is not None
    return replace(
        path.kept.problem,
        knots=spline.states[:, 0],
        offsets=path.kept.corrections.total(),
        reference_s=None,
        **asked.at_knots(waypoints.positions_world_m, path.waypoint, bounds),
    )


def _optimised(problem: Problem, spline: Spline, changed: np.ndarray) -> Spline:
    """A few iterations among paths of least snap, which go far, then some through whole states."""
    first, then = (max(work // int(changed.sum()), 4) for work in _WORK)

    def descend(part: Problem, there: Spline) -> Solution:
        smooth = time_allocation.optimise(part, there.durations_s, iterations=first)
        return time_allocation.refine(replace(part, knots=smooth.knots), smooth.spline, iterations=then)

    return descents.in_parts(problem, spline, changed, descend).spline


def _sampled(
    spline: Spline,
    changed: np.ndarray,
    waypoints: Waypoints,
    room: space.DistanceField,
    vehicle: Vehicle,
    options: PlanOptions,
) -> Draft:
    path = minimum_snap.trajectory(spline)
    inner = path.starts_s[:-1, None] + np.arange(_PER_SEGMENT) / _PER_SEGMENT * path.durations_s[:, None]
    times = np.append(inner.ravel(), path.duration_s)
    closest = esdf.certify(room, path, options.clearance_m)
    used = instants.sampled_shares(path, vehicle, options.limits_for(vehicle), inner[changed, ::_PER_LIMIT].ravel())
    x, y, z = closest.point_world_m.tolist()
    return Draft(
        waypoints,
        times,
        path.position(times),
        closest.proven_m,
        (x, y, z),
        options.clearance_m,
        dict(zip(limits.NAMES, used.max(axis=1).tolist(), strict=True)),
    )
