"""The final gate: the checks that every plan must pass, repeated before an upload.

It is independent of how the trajectory was made. It does not raise for a failed check: the report names the check, the
value, the bound, the time and the place.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

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
    silent,
)
from flight.trajectory import fingerprint
from planner._planner import StopFlag
from planner.gate import conditions_met, limits, visits
from planner.gate.limits import Check
from planner.request import inputs
from planner.request.conditions import Conditions
from planner.request.hidden import Paid
from planner.request.inputs import Request
from planner.request.options import PlanOptions
from planner.request.space import DistanceField, Grounded
from vehicle import Vehicle

_ORDER_UNITS = ("m", "m/s", "m/s2", "m/s3")
_NAMES = ("position", "velocity", "acceleration", "jerk")
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
    hidden: Paid | None = None
    """What it pays for space where an obstacle could hide; None where that had no price."""

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
            **({} if self.hidden is None else self.hidden.as_dict()),
        }


AskGate = Callable[[Trajectory, limits.Known | None], GateReport]
"""From a trajectory, and what is known of another one, to the gate's report: `judge` of one request."""


def judge(request: Request, trajectory: Trajectory, known: limits.Known | None) -> GateReport:
    """An answer to a request. Raises as `check`."""
    return check(
        trajectory,
        request.field,
        request.vehicle,
        request.options,
        waypoints_world_m=request.waypoints.positions_world_m,
        yaw_rad=request.waypoints.yaw_rad,
        conditions=request.conditions,
        known=known,
        stop=request.stop,
    )


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
        InputError: rotors that lean as `inputs.require_thrust_apart` refuses.
        PlanCancelledError: `stop` was set, from another thread.
    """
    inputs.require_thrust_apart(vehicle)
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
        smooth, clear = _continuity(trajectory), _clearance_check(clearance, options.clearance_m, vehicle)
        met: visits.Visits | None = None
        if waypoints_world_m is not None:
            passed, met = visits.reached(trajectory, waypoints_world_m, asked, options)
            checks += passed
            if met is not None and yaw_rad is not None:
                met = visits.turned(trajectory, met, waypoints_world_m, yaw_rad)
        joins_s = None if met is None else met.joins_s(trajectory)
        checks += [*conditions_met.checks(trajectory, met, asked), *smooth]
        checks += [*conditions_met.headings(trajectory, joins_s, yaw_rad, options), clear]
        checks += _local_clearance(trajectory, space_, options)
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


def _local_clearance(trajectory: Trajectory, field: DistanceField, options: PlanOptions) -> list[Check]:
    """Where more margin is asked for, how much is there: as the clearance would be with so much less room there."""
    if not options.local_margins:
        return []
    found, required_m = _clearance(trajectory, options.roomier(field), options.clearance_m), options.clearance_m
    reason = f"{len(options.local_margins)} local margins; " + ("proved" if found.passed else f"{found.reason}")
    return [
        Check("local margins", found.proven_m, required_m, "m", found.passed, found.time_s, found.segment, reason)
    ]  # fmt: skip


def _clearance_check(found: esdf.Clearance, required_m: float, vehicle: Vehicle) -> Check:
    point = " at ({:.2f}, {:.2f}, {:.2f}) m".format(*found.point_world_m) if np.isfinite(found.time_s) else ""
    reason = f"proved along the whole curve; closest{point}" if found.passed else f"{found.reason}{point}"
    value, fits = found.proven_m, vehicle.reach_m <= required_m
    reason = reason if fits else inputs.beyond_clearance(vehicle, required_m)
    return Check("clearance", value, required_m, "m", found.passed and fits, found.time_s, found.segment, reason)
