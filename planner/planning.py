"""From waypoints to a checked trajectory: the planner's main function, one step per line."""

from dataclasses import dataclass, replace
from pathlib import Path as FilePath

import numpy as np

import flight.trajectory
from flight import FloatArray, InfeasibleError, InputError, Progress, Trajectory, TrajectoryFile, Waypoints, silent
from planner import gate, heading, hermite, limits, minimum_snap, repair, routes, space, time_allocation
from planner.options import PlanInfeasibleError, PlanOptions
from planner.repair import Path
from planner.time_allocation import Problem, Weights
from vehicle import Vehicle, invert

_AIM_M = 0.02
"""What the optimiser keeps beyond the required clearance, for what lies between the samples it looks at."""
_SLOWER = (1.005, 1.015, 1.04, 1.1, 1.3)
"""Factors on the time that are tried where the gate, with its finer samples, finds a limit exceeded."""
_MOST_KNOTS = 36
"""Beyond this many knots pieces are not split further: planning time grows with them."""


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """A trajectory that has passed the gate."""

    trajectory: Trajectory
    gate: gate.GateReport
    waypoints: Waypoints
    route_world_m: FloatArray
    """(n, 3) the polyline it follows: the waypoints, and what the search put between them."""
    method: str
    """"direct", "bent" (pushed off obstacles after a first attempt), "corridor" or "stop and go"."""


def plan(
    waypoints: Waypoints,
    field: space.DistanceField,
    vehicle: Vehicle,
    options: PlanOptions | None = None,
    *,
    progress: Progress = silent,
) -> Plan:
    """The fastest trajectory found through the waypoints, at rest at both ends, that passes the gate.

    Args:
        field: a map's `Field`, or anything with `distance(points)`; where it is NaN (unknown), space is not free.

    Raises:
        InputError: the waypoints cannot be used; the message names the waypoint, the reason and the nearest free point.
        PlanInfeasibleError: there is no path, or none within the limits; with `segment`, `reason` and `remedy`.
    """
    options = PlanOptions() if options is None else options
    progress("route", 0.0)
    _check_vehicle(vehicle)
    routes.check_waypoints(waypoints, field, options.waypoint_clearance_m)
    route = routes.find(waypoints, field, options)
    progress("optimise", 0.2)
    path = fastest_path(route, field, vehicle, options)
    progress("limits", 0.7)
    trajectory = _with_heading(path, waypoints, vehicle, options)
    progress("gate", 0.9)
    trajectory, report = _at_the_gate(trajectory, waypoints, field, vehicle, options)
    if not report.passed:
        raise _refused(report, trajectory, path)
    progress("gate", 1.0)
    return Plan(trajectory, report, waypoints, route.points, path.method)


def _check_vehicle(vehicle: Vehicle) -> None:
    try:
        invert.hover(vehicle)
    except InfeasibleError as error:
        raise PlanInfeasibleError(str(error), "correct the vehicle's mass, thrust or limits") from error


def fastest_path(route: routes.Route, field: space.DistanceField, vehicle: Vehicle, options: PlanOptions) -> Path:
    """Least time along the route in two rounds: few knots first, then more of them and hardly any price on snap."""
    bounds = limits.point_mass_bounds(vehicle, options.limits_for(vehicle))
    dense = routes.subdivided(route, field)
    problem = Problem(
        knots=dense.points,
        free=dense.waypoint < 0,
        bounds=bounds,
        field=field,
        clearance_m=space.aim(field, options.clearance_m) + _AIM_M,
        weights=Weights(snap=1e-5),
    )
    lengths = np.linalg.norm(np.diff(dense.points, axis=0), axis=1)
    slow = np.maximum(lengths, 0.3) / (0.3 * min(bounds.speed_m_s, bounds.acceleration_m_s2))
    rough = time_allocation.optimise(problem, slow, iterations=150)
    if options.method == "corridor":
        return repair.through_corridor(dense, rough.durations_s, field, options)
    knots, durations, waypoint = _split(rough.spline, dense.waypoint, _pieces(dense, options))
    problem = replace(problem, knots=knots, free=waypoint < 0, weights=Weights(snap=1e-7, limits=1500.0))
    fine = time_allocation.optimise(problem, durations)
    path = repair.bend_until_clear(problem, fine, waypoint, options)
    return repair.through_corridor(dense, rough.durations_s, field, options) if path is None else path


def _pieces(route: routes.Route, options: PlanOptions) -> int:
    return max(1, min(options.pieces, _MOST_KNOTS // (len(route.points) - 1)))


def _split(spline: minimum_snap.Spline, waypoint: np.ndarray, pieces: int) -> tuple[FloatArray, FloatArray, np.ndarray]:
    """Every segment cut into equal times: knots, durations, and which waypoint each knot is."""
    T = spline.durations_s
    scaled = hermite.segment_states(spline.states) * hermite.time_powers(T)[..., None]
    inner = hermite.basis(np.arange(pieces) / pieces, 0) @ hermite.monomials_from_states() @ scaled
    knots = np.concatenate([inner.reshape(-1, 3), spline.states[-1:, 0]])
    index = np.full(len(knots), -1)
    index[::pieces] = waypoint
    knots[::pieces] = spline.states[:, 0]
    return knots, np.repeat(T / pieces, pieces), index


def _with_heading(path: Path, waypoints: Waypoints, vehicle: Vehicle, options: PlanOptions) -> Trajectory:
    """Turn the vehicle along the path as fast as it may turn, and scale the time to use the limits to the full."""
    asked = np.where(path.waypoint >= 0, waypoints.yaw_rad[path.waypoint], np.nan)
    bounds = options.limits_for(vehicle)
    spline, can = path.spline, limits.yaw_bounds(vehicle, bounds)
    yaw = heading.steady_enough(spline, asked, can, along_path=options.yaw == "along_path")
    states = np.concatenate([spline.states, yaw[..., None]], axis=2)
    trajectory = Trajectory(spline.durations_s, hermite.coefficients(states, spline.durations_s))
    try:
        return trajectory.scale_time(repair.time_scale(trajectory, vehicle, bounds))
    except InfeasibleError as error:
        raise PlanInfeasibleError(str(error), "check the vehicle's limits") from error


def _at_the_gate(
    trajectory: Trajectory, waypoints: Waypoints, field: space.DistanceField, vehicle: Vehicle, options: PlanOptions
) -> tuple[Trajectory, gate.GateReport]:
    """Ask the gate; where only limits are missed, which were sampled more coarsely before, slow down and ask again."""
    slower, points = trajectory, waypoints.positions_world_m
    report = gate.check(slower, field, vehicle, options, waypoints_world_m=points)
    for factor in _SLOWER:
        if report.passed or not all(check.name in limits.NAMES for check in report.failures):
            break
        slower = trajectory.scale_time(factor)
        report = gate.check(slower, field, vehicle, options, waypoints_world_m=points)
    return slower, report


def _refused(report: gate.GateReport, trajectory: Trajectory, path: Path) -> PlanInfeasibleError:
    first = report.failures[0]
    segment = None if first.segment is None else int(path.waypoint[: first.segment + 1].max())
    reason = (
        f"the gate refused it: {first.name} is {first.value:.4g} {first.unit}, bound {first.bound:.4g} ({first.reason})"
    )
    remedy = (
        "move the waypoints apart or lower margin_m" if first.name == "clearance" else "relax the limit or waypoints"
    )
    return PlanInfeasibleError(reason, remedy, segment)


def save_plan(path: FilePath, plan: Plan, *, name: str) -> None:
    """Write the trajectory file. Raises as `trajectory_file`."""
    flight.trajectory.save(path, trajectory_file(plan, name=name))


def trajectory_file(plan: Plan, *, name: str) -> TrajectoryFile:
    """The plan as a trajectory file, with the hashes of the map and vehicle it was checked against.

    Raises:
        InputError: this trajectory has not passed the gate.
    """
    if not plan.gate.passed:
        failed = ", ".join(check.name for check in plan.gate.failures)
        raise InputError(f"trajectory {name} is not saved: it did not pass the gate ({failed})")
    if gate.fingerprint(plan.trajectory) != plan.gate.trajectory_hash:
        raise InputError(f"trajectory {name} is not saved: it was changed after it was checked; plan or check it again")
    return TrajectoryFile(
        trajectory=plan.trajectory,
        name=name,
        map_hash=plan.gate.map_hash,
        vehicle_hash=plan.gate.vehicle_hash,
        waypoints_world_m=plan.waypoints.positions_world_m,
        check=plan.gate.as_dict(),
    )
