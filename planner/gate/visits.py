"""When a trajectory reaches its waypoints: in order, through the openings of gates, turning on the spot where asked."""

from dataclasses import dataclass
from math import dist

import numpy as np

from flight import FloatArray, Trajectory, Waypoints, portable, rotations
from planner.gate import instants
from planner.gate.limits import Check
from planner.request import inputs
from planner.request.conditions import Conditions
from planner.request.options import PlanOptions

BLOCK = 1024
"""Points looked at together for a waypoint: the next one is hardly ever farther away than a second."""
_SAME_S = 1e-9
"""How closely the moment is found at which a gate is passed."""
_SAME_M = 1e-6
"""Difference in distance from a waypoint below which the first of two joins is taken: a stay has one at both ends."""
SAME_RAD = 0.02
"""Largest difference from a heading that was asked for."""
_SAMPLE_S = 1e-3
"""Visits are found among samples so far apart."""


@dataclass(frozen=True, slots=True, eq=False)
class Visits:
    """When the waypoints are passed."""

    time_s: FloatArray
    """(n,) at each, or nearest to it."""
    enter_s: FloatArray
    """(n,) from when on it counts as passed: within its radius, or the tolerance."""
    leave_s: FloatArray
    """(n,) until when."""

    def joins_s(self, trajectory: Trajectory) -> FloatArray:
        """(n,) the nearest join, where a planner sets what is asked at a waypoint, if it belongs to the visit; else the
        visit itself."""
        nearest = trajectory.nearest_join(self.time_s)
        inside = (nearest >= self.enter_s - _SAMPLE_S) & (nearest <= self.leave_s + _SAMPLE_S)
        return np.where(inside, nearest, self.time_s)


def reached(
    trajectory: Trajectory, waypoints_world_m: FloatArray, asked: Conditions, options: PlanOptions
) -> tuple[list[Check], Visits | None]:
    """Waypoints are reached in order, gates passed; the curve must start at the first and end at the last of them.

    Returns:
        The checks, and when each is reached; None if not all are.
    """
    tolerance_m = options.waypoint_tolerance_m
    wanted = np.asarray(waypoints_world_m, dtype=np.float64).reshape(-1, 3)
    if not len(wanted) or not np.isfinite(wanted).all():
        return [Check("waypoints", np.nan, tolerance_m, "m", False, reason="none, or not finite")], None
    edges = np.zeros((len(wanted), 2, 3)) if asked.gate_edges_m is None else asked.gate_edges_m
    in_gate = np.linalg.norm(edges, axis=(1, 2)) > 0.0
    joins = None if in_gate.any() else _at_joins(trajectory, wanted, tolerance_m)
    if joins is not None:
        at_joins, worst = joins
        times_s = trajectory.starts_s[at_joins]
        found = Check("waypoints", worst, tolerance_m, "m", True, reason=f"all {len(wanted)} in order")
        return [found], Visits(times_s, times_s, times_s)
    # Dense samples, joins included: one that is no join is met to within half a step.
    times = np.append(instants.sample_times(trajectory, _SAMPLE_S)[0], trajectory.duration_s)
    points = trajectory.position(times)
    ends_m = portable.length(points[[0, -1]] - wanted[[0, -1]])
    worse = int(ends_m.argmax())
    worst, missed, at = float(ends_m[worse]), worse * (len(wanted) - 1) if ends_m[worse] > tolerance_m else -1, 0
    outside_m: list[float] = []
    visits: list[tuple[float, float, float]] = []
    reached: list[int] = []
    for i, waypoint in enumerate(wanted[:-1]):
        if in_gate[i]:
            passed = first_pass(trajectory, times, points, at, waypoint, edges[i])
            if passed is None:
                return [_gate_missed(i, points[at:], waypoint, tolerance_m)], None
            at, time_s, off_m = passed
            outside_m.append(off_m)
            visits.append((time_s, time_s, time_s))
            reached.append(at)
            continue
        radius = 0.0 if asked.fly_by_m is None else float(asked.fly_by_m[i])
        visit = first_visit(points, at, waypoint, tolerance_m + radius)
        if visit is None:
            worst, missed = float(np.linalg.norm(points[at:] - waypoint, axis=1).min()), i
            break
        at, gap_m = visit
        first = at - _staying(points[at::-1], waypoint, tolerance_m + radius)
        first = max(first, reached[-1] if reached else 0)  # balls may overlap: it is not passed before the one before
        last = at + _staying(points[at:], waypoint, tolerance_m + radius)
        visits.append((float(times[at]), float(times[first]), float(times[last])))
        reached.append(at)
        worst = max(worst, gap_m - radius)
    if missed >= 0:
        return [
            Check(
                "waypoints", worst, tolerance_m, "m", False, reason=f"waypoint {missed + 1} is missed by {worst:.3f} m"
            )
        ], None
    reached.append(len(points))
    for i in np.flatnonzero(in_gate[1:-1]) + 1:
        end = reached[i + 1]  # not with it: the next gate may be this one, turned round
        back = first_pass(trajectory, times[:end], points[:end], reached[i - 1], wanted[i], edges[i, ::-1])
        if back is not None:
            return [_gate_missed(int(i), points, wanted[i], tolerance_m, back[1])], None
    found = [Check("waypoints", worst, tolerance_m, "m", True, reason=f"all {len(wanted)} in order")]
    if outside_m:
        nearest = int(np.argmax(outside_m))
        number = int(np.flatnonzero(in_gate)[nearest]) + 1
        reason = f"all {len(outside_m)} passed; nearest to an edge at waypoint {number}"
        found.append(Check("gates", outside_m[nearest], 0.0, "m", True, reason=reason))
    end_s = trajectory.duration_s
    return found, Visits(*np.array([*visits, (end_s, end_s, end_s)]).T)


def first_pass(
    trajectory: Trajectory, times_s: FloatArray, points: FloatArray, start: int, centre: FloatArray, edges: FloatArray
) -> tuple[int, float, float] | None:
    """Where the path first passes a gate forwards, from a sample on: the sample after it, when, and how far outside.

    A crossing of the gate's plane is between two samples on either side of it, and is found there by bisection. How far
    outside of the opening it lies is negative, the distance to the nearest edge. None if no crossing lies inside.
    """
    sizes = np.linalg.norm(edges, axis=1)
    normal = np.cross(*edges) / (sizes[0] * sizes[1])
    for first in range(start, len(points) - 1, BLOCK):
        side = ((points[first : first + BLOCK + 1] - centre) * normal).sum(axis=1)
        for k in first + np.flatnonzero((side[:-1] < 0.0) & (side[1:] >= 0.0)):
            before, after = times_s[k], times_s[k + 1]
            while after - before > _SAME_S:
                middle = 0.5 * (before + after)
                if float(((trajectory.position(np.array([middle]))[0] - centre) * normal).sum()) < 0.0:
                    before = middle
                else:
                    after = middle
            off = np.abs((edges * (trajectory.position(np.array([after]))[0] - centre)).sum(axis=1)) / sizes - sizes
            if off.max() <= 0.0:
                return int(k) + 1, float(after), float(off.max())
    return None


def _gate_missed(
    waypoint: int, points: FloatArray, centre: FloatArray, tolerance_m: float, back_s: float | None = None
) -> Check:
    nearest = float(np.linalg.norm(points - centre, axis=1).min())
    if back_s is None:
        fault = f"is not passed forwards within its opening; the path comes within {nearest:.2f} m of its middle"
        remedy = "enlarge it"
    else:
        fault = f"is passed backwards too, at {back_s:.2f} s"
        remedy = "make it smaller"
    reason = f"the gate at waypoint {waypoint + 1} {fault}: turn the gate or {remedy}"
    return Check("waypoints", nearest, tolerance_m, "m", False, reason=reason)


def turned(trajectory: Trajectory, visits: Visits, waypoints_world_m: FloatArray, yaw_rad: FloatArray) -> Visits:
    """With turns on the spot: another heading in the same place is met at the first join there that has it, if any."""
    times = np.stack([visits.time_s, visits.enter_s, visits.leave_s])
    joins_s = trajectory.starts_s
    motion = trajectory.evaluate(joins_s)
    for i in inputs.turns(Waypoints(waypoints_world_m, yaw_rad)):
        here = np.linalg.norm(motion[:, :3] - trajectory.position(times[:1, i])[0], axis=1) <= inputs.SAME_M
        facing = np.abs(rotations.wrapped(motion[:, 3] - yaw_rad[i + 1])) <= SAME_RAD
        later = np.flatnonzero(here & facing & (joins_s >= times[0, i]))
        if later.size:
            times[:, i + 1] = joins_s[later[0]]
    return Visits(*times)


def _at_joins(trajectory: Trajectory, wanted: FloatArray, tolerance_m: float) -> tuple[list[int], float] | None:
    """Joins that reach the waypoints in order, the two ends included, and the largest gap; None if they do not.

    Of joins in a row within the tolerance of a waypoint it is the nearest that reaches it: a slow leg has some.
    """
    end = trajectory.position(np.array([trajectory.duration_s]))
    joins = np.vstack([trajectory.coefficients[:, :3, 0], end]).tolist()
    visits, at, worst = [], 0, 0.0
    for waypoint in wanted.tolist():
        while (gap_m := dist(joins[at], waypoint)) > tolerance_m:
            at += 1
            if not visits or at == len(joins):
                return None
        for later in range(at + 1, len(joins) if visits else 0):  # the path begins where it begins
            later_m = dist(joins[later], waypoint)
            if later_m > tolerance_m:
                break
            if later_m < gap_m - _SAME_M:
                at, gap_m = later, later_m
        visits.append(at)
        worst = max(worst, gap_m)
    return (visits, worst) if visits[-1] == len(joins) - 1 else None


def first_visit(points: FloatArray, start: int, waypoint: FloatArray, tolerance_m: float) -> tuple[int, float] | None:
    """Index and distance of the nearest point of the first run from `start` on within the tolerance; None if never."""
    best, gap_m = -1, np.inf
    for first in range(start, len(points), BLOCK):
        gaps = np.linalg.norm(points[first : first + BLOCK] - waypoint, axis=1)
        near = gaps <= tolerance_m
        begin = 0 if best >= 0 else int(np.argmax(near))
        if not near[begin]:
            if best >= 0:
                break
            continue
        end = begin + int(np.argmin(np.append(near[begin:], False)))
        closest = begin + int(np.argmin(gaps[begin:end]))
        if gaps[closest] < gap_m:
            best, gap_m = first + closest, float(gaps[closest])
        if end < len(gaps):
            break
    return None if best < 0 else (best, gap_m)


def _staying(points: FloatArray, waypoint: FloatArray, tolerance_m: float) -> int:
    """Index of the last of the points (n, 3) before the first one that is farther away; the first one is not."""
    for first in range(0, len(points), BLOCK):
        far = np.linalg.norm(points[first : first + BLOCK] - waypoint, axis=1) > tolerance_m
        if far.any():
            return first + int(np.argmax(far)) - 1
    return len(points) - 1
