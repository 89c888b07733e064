"""The final gate: the checks that every plan must pass, repeated before an upload.

It is independent of how the trajectory was made. It does not raise for a failed check: the report names the check, the
value, the bound, the time and the place.
"""

from dataclasses import dataclass, replace
from math import dist

import numpy as np

import esdf
import vehicle as vehicles
from esdf.visibility import CouldHide
from flight import (
    FlightError,
    FloatArray,
    FormatError,
    Progress,
    Trajectory,
    TrajectoryFile,
    Waypoints,
    portable,
    rotations,
    silent,
)
from flight.trajectory import fingerprint
from planner import conditions as conditions_
from planner import inputs, limits, routes
from planner._planner import StopFlag
from planner.conditions import Conditions, Visits
from planner.limits import Check
from planner.options import PlanOptions
from planner.space import DistanceField, Grounded
from vehicle import Vehicle

_ORDER_UNITS = ("m", "m/s", "m/s2", "m/s3")
_NAMES = ("position", "velocity", "acceleration", "jerk")
_BLOCK = 1024
"""Points looked at together for a waypoint: the next one is hardly ever farther away than a second."""
_SAME_RAD = 0.02
"""Largest difference from a heading that was asked for."""
_LOOK_RAD = 0.6
"""Largest angle between the heading and the direction of a point that is looked at."""
_SAME_S = 1e-9
"""How closely the moment is found at which a gate is passed."""
_NEAR_M = 1.0
"""Horizontal distance of that point below which any heading will do."""
_JUMP = 1e-6
"""Largest jump (SI) at a join, relative to the largest value of that derivative where that is above one."""


@dataclass(frozen=True, slots=True)
class GateReport:
    """Every check with its value and bound, and what it was checked against."""

    checks: tuple[Check, ...]
    clearance_m: float
    """Proved lower bound of the distance to obstacles along the curve; minus infinity where there is none."""
    required_clearance_m: float
    body_radius_m: float
    """Radius of the sphere that bounds the vehicle; the rest of the clearance is margin for its tracking error."""
    clearance_point_world_m: tuple[float, float, float]
    """Point of least clearance, or where it meets unknown space."""
    duration_s: float
    map_hash: str
    """Hash of the field, empty for a formula."""
    vehicle_hash: str
    trajectory_hash: str
    """`flight.trajectory.fingerprint` of the trajectory that was checked."""
    conditions: Conditions
    """What was asked of it besides its waypoints."""
    options: PlanOptions
    """Radius, margin, limits, reserve, tolerance and yaw mode that it was checked for."""
    yaw_rad: FloatArray | None = None
    """(n,) heading asked for at each waypoint, NaN where any will do; None if none is."""
    usage: limits.Usage | None = None
    """What each segment uses of each limit; None where that could not be asked."""
    could_hide: CouldHide | None = None
    """How thin an obstacle could hide within the required clearance; None where that is not known (`could_hide`)."""
    thinnest_m: float | None = None
    """The thinnest obstacle that must not; None if that was not asked."""

    @property
    def passed(self) -> bool:
        return all(check.passed for check in self.checks)

    @property
    def failures(self) -> tuple[Check, ...]:
        return tuple(check for check in self.checks if not check.passed)

    @property
    def binding(self) -> tuple[str, ...]:
        """The limit that decides the time of each segment; "" where none is used to the full."""
        return () if self.usage is None else self.usage.binding

    def as_dict(self) -> dict[str, object]:
        """JSON-able, for the trajectory file and for screens."""
        return {
            "passed": self.passed,
            "clearance_m": self.clearance_m if np.isfinite(self.clearance_m) else None,
            "required_clearance_m": self.required_clearance_m,
            "body_radius_m": self.body_radius_m,
            "clearance_point_world_m": list(self.clearance_point_world_m),
            "duration_s": self.duration_s,
            "map_hash": self.map_hash,
            "vehicle_hash": self.vehicle_hash,
            "trajectory_hash": self.trajectory_hash,
            "conditions": self.conditions.as_dict(),
            "yaw_rad": None if self.yaw_rad is None else [float(y) if np.isfinite(y) else None for y in self.yaw_rad],
            "asked": self.options.as_dict(),
            "checks": [check.as_dict() for check in self.checks],
            "could_hide": None if self.could_hide is None else self.could_hide.as_dict(),
            "thinnest_m": self.thinnest_m,
        }


def check(
    trajectory: Trajectory,
    field: DistanceField,
    vehicle: Vehicle,
    options: PlanOptions | None = None,
    *,
    waypoints_world_m: FloatArray | None = None,
    yaw_rad: FloatArray | None = None,
    conditions: Conditions | None = None,
    known: limits.Known | None = None,
    stop: StopFlag | None = None,
    progress: Progress = silent,
) -> GateReport:
    """Check a trajectory against a field and a vehicle.

    Args:
        waypoints_world_m: (n, 3) points it must reach in this order; None if it need not reach any.
        yaw_rad: (n,) heading to have at each of them, NaN where any will do; None if none is asked for.
        conditions: of motion at its ends, its waypoints and on its legs; at rest at both ends if left out.
        known: what was found of another trajectory with the same vehicle and options; limits are not worked out again
            for segments that both have in common. Everything else is.

    Raises:
        PlanCancelledError: `stop` was set, from another thread.
    """
    options = (PlanOptions() if options is None else options).sized(vehicle)
    asked = Conditions() if conditions is None else conditions
    finite = _finite(trajectory)
    checks = [finite]
    usage = None
    clearance = _no_clearance("not checked: the trajectory is not finite")
    if finite.passed:
        space_ = field if asked.ground_world_m is None else Grounded(field, asked.ground_world_m, options.clearance_m)
        clearance = _clearance(trajectory, space_, options.clearance_m)
        progress("gate", 0.4)
        visits = None
        if waypoints_world_m is not None:
            passed, visits = _waypoints(trajectory, waypoints_world_m, asked, options)
            checks += passed
            if visits is not None and yaw_rad is not None:
                visits = _turned(trajectory, visits, waypoints_world_m, yaw_rad)
        checks += conditions_.checks(trajectory, visits, asked) + _continuity(trajectory)
        checks += _headings(trajectory, None if visits is None else visits.joins_s(trajectory), yaw_rad, options)
        checks += [_clearance_check(clearance, options.clearance_m, vehicle)]
        bounds = options.limits_for(vehicle)
        usage, found = limits.measure(trajectory, vehicle, bounds, step_s=options.sample_step_s, known=known, stop=stop)
        checks += found
    progress("gate", 1.0)
    return GateReport(
        checks=tuple(checks),
        clearance_m=clearance.proven_m,
        required_clearance_m=options.clearance_m,
        body_radius_m=options.body_radius_m,
        clearance_point_world_m=tuple(np.nan_to_num(clearance.point_world_m).tolist()),
        duration_s=trajectory.duration_s if np.isfinite(trajectory.duration_s) else 0.0,
        map_hash=str(getattr(field, "hash", "")),
        vehicle_hash=vehicles.vehicle_hash(vehicle),
        trajectory_hash=fingerprint(trajectory),
        conditions=asked,
        options=options,
        yaw_rad=yaw_rad,
        usage=usage,
    )


def options_of(item: TrajectoryFile) -> PlanOptions:
    """Radius, margin, limits, yaw mode ... that a file was checked for; the defaults where it does not say.

    Raises:
        FormatError: what it says is damaged.
    """
    asked = item.check.get("asked")
    return PlanOptions() if asked is None else PlanOptions.from_dict(asked)


def check_file(
    item: TrajectoryFile,
    field: DistanceField,
    vehicle: Vehicle,
    options: PlanOptions | None = None,
    *,
    progress: Progress = silent,
) -> GateReport:
    """Check a file's trajectory, and that it is the one that was checked, planned for this map and this vehicle.

    Args:
        options: what to check for; if left out, what the file was checked for, and the vehicle's limits where they
            are stricter.
    """
    if options is None:
        options = options_of(item)
        options = replace(options, limits=options.limits and options.limits.stricter(vehicle.limits))
    report = check(
        item.trajectory,
        field,
        vehicle,
        options,
        waypoints_world_m=item.waypoints_world_m,
        yaw_rad=headings_of(item),
        conditions=asked_of(item),
        progress=progress,
    )
    same = [
        _record_check(item),
        _identity("trajectory", str(item.check.get("trajectory_hash") or ""), report.trajectory_hash),
        _identity("map", item.map_hash, report.map_hash),
        _identity("vehicle", item.vehicle_hash, report.vehicle_hash),
    ]
    return replace(report, checks=(*report.checks, *same))


def asked_of(item: TrajectoryFile) -> Conditions:
    """What was asked of a file's trajectory besides its waypoints.

    Raises:
        FormatError: its record of that is damaged.
    """
    return Conditions.from_dict(item.check.get("conditions") or {}, len(item.waypoints_world_m))


def headings_of(item: TrajectoryFile) -> FloatArray | None:
    """(n,) the heading asked for at each of a file's waypoints, NaN where it is open; None where the file has none.

    Raises:
        FormatError: its record of that is damaged.
    """
    given = item.check.get("yaw_rad")
    if given is None:
        return None
    try:
        yaw = np.array([np.nan if y is None else float(y) for y in given])
    except (TypeError, ValueError) as error:
        raise FormatError(f"the headings in a trajectory file are damaged: {error}") from error
    if yaw.shape != (len(item.waypoints_world_m),):
        raise FormatError(f"a trajectory file has {len(yaw)} headings for {len(item.waypoints_world_m)} waypoints")
    return yaw


def _record_check(item: TrajectoryFile) -> Check:
    """Whether the file's record of what it was checked for is the one that was written."""
    kept = item.record_kept
    if kept is None:
        reason = (
            "file version 1 has no hash of conditions and limits: whether they were changed after the check is not "
            "known; renew its check, or plan it again"
        )
    else:
        reason = "conditions, limits, waypoints and results as written" if kept else "the file's record was changed"
    return Check("record", float(kept is False), 0.0, "", kept is not False, reason=reason)


def _identity(name: str, planned: str, here: str) -> Check:
    """Whether a file is about what is here; hashes that differ are shown by their beginnings."""
    reason = f"the file names {planned[:12] or 'none'}, here is {here[:12] or 'none'}"
    return Check(name, float(planned != here), 0.0, "", planned == here, reason=reason)


def _finite(trajectory: Trajectory) -> Check:
    T = np.asarray(trajectory.durations_s)
    good = bool(np.isfinite(T).all() and (T > 0.0).all() and np.isfinite(trajectory.coefficients).all())
    starts = np.concatenate([[0.0], np.cumsum(T)])
    good = good and np.allclose(starts, trajectory.starts_s, rtol=1e-12, atol=1e-12)
    broken = int((~np.isfinite(trajectory.coefficients)).sum())
    return Check(
        "finite", float(broken), 0.0, "", good, reason="durations positive; start times and coefficients finite"
    )


def _waypoints(
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
    times = np.append(limits.sample_times(trajectory, 1e-3)[0], trajectory.duration_s)
    points = trajectory.position(times)
    ends = max(float(portable.length(points[0] - wanted[0])), float(portable.length(points[-1] - wanted[-1])))
    worst, missed, at = ends, 0 if ends > tolerance_m else -1, 0
    outside_m: list[float] = []
    visits: list[tuple[float, float, float]] = []
    reached: list[int] = []
    for i, waypoint in enumerate(wanted[:-1]):
        if in_gate[i]:
            passed = _first_pass(trajectory, times, points, at, waypoint, edges[i])
            if passed is None:
                return [_gate_missed(i, points[at:], waypoint, tolerance_m)], None
            at, time_s, off_m = passed
            outside_m.append(off_m)
            visits.append((time_s, time_s, time_s))
            reached.append(at)
            continue
        radius = 0.0 if asked.fly_by_m is None else float(asked.fly_by_m[i])
        visit = _first_visit(points, at, waypoint, tolerance_m + radius)
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
        back = _first_pass(trajectory, times[:end], points[:end], reached[i - 1], wanted[i], edges[i, ::-1])
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


def _first_pass(
    trajectory: Trajectory, times_s: FloatArray, points: FloatArray, start: int, centre: FloatArray, edges: FloatArray
) -> tuple[int, float, float] | None:
    """Where the path first passes a gate forwards, from a sample on: the sample after it, when, and how far outside.

    A crossing of the gate's plane is between two samples on either side of it, and is found there by bisection. How far
    outside of the opening it lies is negative, the distance to the nearest edge. None if no crossing lies inside.
    """
    sizes = np.linalg.norm(edges, axis=1)
    normal = np.cross(*edges) / (sizes[0] * sizes[1])
    for first in range(start, len(points) - 1, _BLOCK):
        side = ((points[first : first + _BLOCK + 1] - centre) * normal).sum(axis=1)
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
    else:
        fault = f"is passed backwards too, at {back_s:.2f} s"
    reason = (
        f"the gate at waypoint {waypoint + 1} {fault}: turn the gate, enlarge it, or add a waypoint before or behind it"
    )
    return Check("waypoints", nearest, tolerance_m, "m", False, reason=reason)


def _turned(trajectory: Trajectory, visits: Visits, waypoints_world_m: FloatArray, yaw_rad: FloatArray) -> Visits:
    """With turns on the spot: another heading in the same place is met at the first join there that has it, if any."""
    times = np.stack([visits.time_s, visits.enter_s, visits.leave_s])
    joins_s = trajectory.starts_s
    motion = trajectory.evaluate(joins_s)
    for i in routes.turns(Waypoints(waypoints_world_m, yaw_rad)):
        here = np.linalg.norm(motion[:, :3] - trajectory.position(times[:1, i])[0], axis=1) <= routes.SAME_M
        facing = np.abs(rotations.wrapped(motion[:, 3] - yaw_rad[i + 1])) <= _SAME_RAD
        later = np.flatnonzero(here & facing & (joins_s >= times[0, i]))
        if later.size:
            times[:, i + 1] = joins_s[later[0]]
    return Visits(*times)


def _headings(
    trajectory: Trajectory, visits_s: FloatArray | None, yaw_rad: FloatArray | None, options: PlanOptions
) -> list[Check]:
    """Headings asked for at waypoints, held all along, or towards a point."""
    checks = []
    times = trajectory.sample(options.sample_step_s)
    motion = trajectory.evaluate(times)
    if visits_s is not None and yaw_rad is not None and np.isfinite(yaw_rad).any():
        off = np.abs(rotations.wrapped(trajectory.evaluate(visits_s)[:, 3] - yaw_rad))
        off = np.where(np.isfinite(off), off, 0.0)
        checks.append(_heading_check("heading at waypoints", off, visits_s, _SAME_RAD))
    if options.yaw in ("fixed", "steady"):
        held = options.heading_rad if options.yaw == "fixed" else motion[0, 3]
        off = np.abs(rotations.wrapped(motion[:, 3] - held))
        checks.append(_heading_check("heading held", off, times, _SAME_RAD))
    if options.target_world_m is not None:
        aim = options.target_world_m[:2] - motion[:, :2]
        off = np.abs(rotations.wrapped(motion[:, 3] - portable.arctangent2(aim[:, 1], aim[:, 0])))
        off = np.where(portable.length(aim) > _NEAR_M, off, 0.0)
        checks.append(_heading_check("look at the point", off, times, _LOOK_RAD))
    return checks


def _heading_check(name: str, off_rad: FloatArray, times_s: FloatArray, bound_rad: float) -> Check:
    worst = int(off_rad.argmax())
    value, time_s = float(off_rad[worst]), float(times_s[worst])
    reason = f"{np.degrees(value):.1f} deg off at {time_s:.1f} s, at most {np.degrees(bound_rad):.1f} are allowed"
    return Check(name, value, bound_rad, "rad", value <= bound_rad, time_s, reason=reason)


def _at_joins(trajectory: Trajectory, wanted: FloatArray, tolerance_m: float) -> tuple[list[int], float] | None:
    """Joins that reach the waypoints in order, the two ends included, and the largest gap; None if they do not."""
    end = trajectory.position(np.array([trajectory.duration_s]))
    joins = np.vstack([trajectory.coefficients[:, :3, 0], end]).tolist()
    visits, at, worst = [], 0, 0.0
    for waypoint in wanted.tolist():
        while (gap_m := dist(joins[at], waypoint)) > tolerance_m:
            at += 1
            if not visits or at == len(joins):
                return None
        visits.append(at)
        worst = max(worst, gap_m)
    return (visits, worst) if visits[-1] == len(joins) - 1 else None


def _first_visit(points: FloatArray, start: int, waypoint: FloatArray, tolerance_m: float) -> tuple[int, float] | None:
    """Index and distance of the nearest point of the first run from `start` on within the tolerance; None if never."""
    best, gap_m = -1, np.inf
    for first in range(start, len(points), _BLOCK):
        gaps = np.linalg.norm(points[first : first + _BLOCK] - waypoint, axis=1)
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
    for first in range(0, len(points), _BLOCK):
        far = np.linalg.norm(points[first : first + _BLOCK] - waypoint, axis=1) > tolerance_m
        if far.any():
            return first + int(np.argmax(far)) - 1
    return len(points) - 1


def _continuity(trajectory: Trajectory) -> list[Check]:
    checks = []
    for r, (name, unit) in enumerate(zip(_NAMES, _ORDER_UNITS, strict=True)):
        jumps = np.abs(trajectory.join_jumps(r))
        size = np.abs(trajectory.evaluate(trajectory.starts_s, r)).max()
        tolerance = _JUMP * max(1.0, float(size))
        worst = float(jumps.max(initial=0.0))
        where = int(jumps.max(axis=1).argmax()) if len(jumps) else None
        checks.append(Check(f"{name} at joins", worst, tolerance, unit, worst <= tolerance, segment=where))
    return checks


def _no_clearance(why: str) -> esdf.Clearance:
    return esdf.Clearance(np.nan, -np.inf, 0.0, np.full(3, np.nan), 0, False, why)  # pyright: ignore[reportArgumentType]


def _clearance(trajectory: Trajectory, field: DistanceField, required_m: float) -> esdf.Clearance:
    try:
        return esdf.certify(field, trajectory, required_m)
    except FlightError as error:
        return _no_clearance(str(error))


def _clearance_check(found: esdf.Clearance, required_m: float, vehicle: Vehicle) -> Check:
    point = " at ({:.2f}, {:.2f}, {:.2f}) m".format(*found.point_world_m) if np.isfinite(found.time_s) else ""
    reason = f"proved along the whole curve; closest{point}" if found.passed else f"{found.reason}{point}"
    value, fits = found.proven_m, vehicle.reach_m <= required_m
    reason = reason if fits else inputs.beyond_clearance(vehicle, required_m)
    return Check("clearance", value, required_m, "m", found.passed and fits, found.time_s, found.segment, reason)
