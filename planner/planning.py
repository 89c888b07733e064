"""From waypoints to a checked trajectory: the planner's main function, one step per line."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import nan
from pathlib import Path as FilePath

import numpy as np

import flight.trajectory
from flight import FloatArray, InfeasibleError, InputError, Progress, Trajectory, TrajectoryFile, Waypoints, silent
from planner import fastest, gate, heading, limits, minimum_snap, repair, routes, space
from planner._planner import StopFlag
from planner.fastest import Path
from planner.gate import GateReport
from planner.options import PlanInfeasibleError, PlanOptions
from vehicle import Vehicle, invert

_SLOWER = (1.005, 1.015, 1.04, 1.1, 1.3)
"""Factors on the time that are tried where the gate, with its finer samples, finds a limit exceeded."""


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
    optimum_s: float = nan
    """What the optimiser took for the shortest time before the vehicle's own model and the gate had their say."""

    @property
    def binding(self) -> tuple[str, ...]:
        """The limit that decides each segment's time; "" where none is used to the full."""
        return self.gate.binding


def plan(
    waypoints: Waypoints,
    field: space.DistanceField,
    vehicle: Vehicle,
    options: PlanOptions | None = None,
    *,
    progress: Progress = silent,
    stop: StopFlag | None = None,
) -> Plan:
    """The fastest trajectory found through the waypoints, at rest at both ends, that passes the gate.

    Args:
        field: a map's `Field`, or anything with `distance(points)`; where it is NaN (unknown), space is not free.

    Raises:
        InputError: the waypoints cannot be used; the message names the waypoint, the reason and the nearest free point.
        PlanInfeasibleError: there is no path, or none within the limits; with `segment`, `reason` and `remedy`.
        PlanCancelledError: `stop` was set, from another thread.
    """
    options = PlanOptions() if options is None else options
    path, route = from_scratch(waypoints, field, vehicle, options, progress=progress, stop=stop)
    return Plan(path.trajectory, path.report, waypoints, route.points, path.method, path.optimum_s)


def from_scratch(
    waypoints: Waypoints,
    field: space.DistanceField,
    vehicle: Vehicle,
    options: PlanOptions,
    *,
    progress: Progress = silent,
    stop: StopFlag | None = None,
) -> tuple[Path, routes.Route]:
    """As `plan`, with what a later plan can start from."""
    progress("route", 0.0)
    _check_vehicle(vehicle)
    routes.check_waypoints(waypoints, field, options.waypoint_clearance_m)
    route = routes.find(waypoints, field, options)
    progress("optimise", 0.2)
    path = _flyable(route, waypoints, field, vehicle, options, stop)
    progress("gate", 1.0)
    if not path.report.passed:
        raise _refused(path)
    return path, route


def _check_vehicle(vehicle: Vehicle) -> None:
    try:
        invert.hover(vehicle)
    except InfeasibleError as error:
        raise PlanInfeasibleError(str(error), "correct the vehicle's mass, thrust or limits") from error


def _flyable(
    route: routes.Route,
    waypoints: Waypoints,
    field: space.DistanceField,
    vehicle: Vehicle,
    options: PlanOptions,
    stop: StopFlag | None,
) -> Path:
    """The fastest path; one in a corridor of boxes where that is asked for or the fastest stays too close."""

    def ask_gate(trajectory: Trajectory, known: limits.Known | None = None) -> GateReport:
        reached = waypoints.positions_world_m
        return gate.check(trajectory, field, vehicle, options, waypoints_world_m=reached, known=known)

    dense = routes.subdivided(route, field)
    problem, start = fastest.rough(dense, field, vehicle, options, stop)
    if options.method == "fastest":
        problem, durations, index = fastest.whole_vehicle(problem, start, dense.waypoint, waypoints.yaw_rad, options)
        begin = minimum_snap.solve(problem.knots, durations)
        path = fastest.until_flyable(problem, begin, index, vehicle, options, ask_gate, stop)
        if path is not None:
            return path if path.report.passed else _slowed(path, vehicle, options, ask_gate)
    spline, method = repair.through_corridor(dense, start.durations_s, field, options)
    trajectory = _with_heading(spline, dense.waypoint, waypoints, vehicle, options)
    path = Path(trajectory, dense.waypoint, method, ask_gate(trajectory), start.durations_s.sum())
    return _slowed(path, vehicle, options, ask_gate)


def _with_heading(
    spline: minimum_snap.Spline, waypoint: np.ndarray, waypoints: Waypoints, vehicle: Vehicle, options: PlanOptions
) -> Trajectory:
    """Turn the vehicle along the path as fast as it may turn."""
    asked = np.where(waypoint >= 0, waypoints.yaw_rad[waypoint], np.nan)
    can = limits.yaw_bounds(vehicle, options.limits_for(vehicle))
    yaw = heading.steady_enough(spline, asked, can, along_path=options.yaw == "along_path")
    states = np.concatenate([spline.states, yaw[..., None]], axis=2)
    return minimum_snap.trajectory(minimum_snap.Spline(spline.durations_s, states))


def _slowed(path: Path, vehicle: Vehicle, options: PlanOptions, ask_gate: Callable[[Trajectory], GateReport]) -> Path:
    """The same way through space in the time that just keeps every limit: the last resort, as all segments pay."""
    try:
        factor = repair.time_scale(path.trajectory, vehicle, options.limits_for(vehicle))
    except InfeasibleError as error:
        raise PlanInfeasibleError(str(error), "check the vehicle's limits") from error
    for more in (1.0, *_SLOWER):
        trajectory = path.trajectory.scale_time(factor * more)
        slowed = replace(path, trajectory=trajectory, report=ask_gate(trajectory), kept=None)
        if slowed.report.passed or not all(check.name in limits.NAMES for check in slowed.report.failures):
            break
    return slowed


def _refused(path: Path) -> PlanInfeasibleError:
    first = path.report.failures[0]
    segment = None if first.segment is None else int(path.waypoint[: first.segment + 1].max())
    if first.name in limits.NAMES:
        return PlanInfeasibleError(first.reason, "or relax the limit", segment)
    value, bound = f"{first.value:.4g} {first.unit}", f"{first.bound:.4g}"
    remedy = "move the waypoints apart or lower margin_m" if first.name == "clearance" else "move the waypoints"
    return PlanInfeasibleError(
        f"the gate refused it: {first.name} is {value}, bound {bound} ({first.reason})", remedy, segment
    )


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
