"""From waypoints to a checked trajectory: the planner's main function, one step per line."""

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path as FilePath
from typing import ClassVar

import numpy as np

import flight.trajectory
from flight import FloatArray, InputError, Progress, Trajectory, TrajectoryFile, Waypoints, silent
from planner import one_way
from planner._planner import StopFlag
from planner.drafting import Draft
from planner.gate import gate, limits
from planner.gate.gate import GateReport
from planner.optimise import methods
from planner.optimise.fastest import Optimum, Path
from planner.request import inputs, space
from planner.request.conditions import Conditions
from planner.request.options import PlanInfeasibleError, PlanOptions, check_stop
from planner.route import routes
from vehicle import Vehicle

_OF_ROOM = ("clearance", "local margins")
"""Checks that ask for room."""


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """A trajectory that has passed the gate."""

    draft: ClassVar[bool] = False
    """As `Draft.draft`, which is True."""
    trajectory: Trajectory
    gate: gate.GateReport
    waypoints: Waypoints
    route_world_m: FloatArray
    """(n, 3) the polyline it follows: the waypoints, and what the search put between them."""
    method: str
    """"direct", "bent" (pushed off obstacles after a first attempt), "corridor" or "bry"."""
    optima: tuple[Optimum, ...]
    """How close to the shortest time each of its paths is: one, or those between the stays of a mission."""

    @property
    def optimum_s(self) -> float:
        """What the optimiser took for the shortest time before the vehicle's own model and the gate had their say."""
        return sum(optimum.shortest_s for optimum in self.optima)

    @property
    def converged(self) -> bool:
        """Whether every last descent ended by itself, and not because its iterations were used up."""
        return all(optimum.converged for optimum in self.optima)

    @property
    def residual(self) -> float:
        """The largest share of the flight time that a descent would still gain, by its model; NaN without a descent."""
        return float(np.max([optimum.residual for optimum in self.optima]))

    @property
    def spread(self) -> float:
        """How much longer the slowest path from any start of a descent took, at most; NaN where each had one start."""
        return float(np.fmax.reduce([optimum.spread for optimum in self.optima]))

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
    conditions: Conditions | None = None,
    progress: Progress = silent,
    stop: StopFlag | None = None,
) -> Plan:
    """The fastest trajectory found through the waypoints, at rest at both ends or as asked, that passes the gate.

    Args:
        field: a map's `Field`, or anything with `distance(points)`; where it is NaN (unknown), space is not free.
        conditions: motion at the ends, velocities at waypoints, speeds of legs.

    Raises:
        InputError: the waypoints cannot be used; the message names the waypoint, the reason and the nearest free point.
        PlanInfeasibleError: there is no path, or none within the limits; with `segment`, `reason` and `remedy`.
        PlanCancelledError: `stop` was set, from another thread.
    """
    path, route = from_scratch(waypoints, field, vehicle, options, conditions, stop, progress)
    return of_path(path, waypoints, route.points)


def of_path(path: Path, waypoints: Waypoints, route_world_m: FloatArray) -> Plan:
    """The plan that is this path, which has passed the gate."""
    return Plan(path.trajectory, path.report, waypoints, route_world_m, path.method, (path.optimum,))


def from_scratch(
    waypoints: Waypoints,
    field: space.DistanceField,
    vehicle: Vehicle,
    options: PlanOptions | None,
    conditions: Conditions | None,
    stop: StopFlag | None,
    progress: Progress = silent,
) -> tuple[Path, routes.Route]:
    """As `plan`, with what a later plan can start from."""
    progress("route", 0.0)
    request = inputs.admitted(waypoints, field, vehicle, options, conditions, stop)
    asked = request.conditions
    inside = replace(request, field=asked.room(request.options.roomier(field), request.options))
    route = routes.of(inside)
    progress("optimise", 0.2)

    flyable = partial(methods.flyable, ask_gate=partial(gate.judge, request), progress=progress)
    path = flyable(route, inside)
    if not path.report.passed and asked.gate_edges_m is not None:
        path, route = one_way.planned(path, route, inside, flyable)
    check_stop(stop)
    progress("gate", 1.0)
    if not path.report.passed:
        raise refused(path)
    return path, route


def refused(path: Path) -> PlanInfeasibleError:
    first = path.report.failures[0]
    segment = None if first.segment is None else int(path.waypoint[: first.segment + 1].max())
    if first.name in limits.NAMES:
        return PlanInfeasibleError(first.reason, "or relax the limit", segment)
    value, bound = f"{first.value:.4g} {first.unit}", f"{first.bound:.4g}"
    remedy = "move the waypoints apart or lower margin_m" if first.name in _OF_ROOM else "move the waypoints"
    return PlanInfeasibleError(
        f"the gate refused it: {first.name} is {value}, bound {bound} ({first.reason})", remedy, segment
    )


def save_plan(path: FilePath, plan: Plan | Draft, *, name: str) -> None:
    """Write the trajectory file. Raises as `trajectory_file`."""
    flight.trajectory.save(path, trajectory_file(plan, name=name))


def trajectory_file(plan: Plan | Draft, *, name: str) -> TrajectoryFile:
    """The plan as a trajectory file, with the hashes of the map and vehicle it was checked against.

    Raises:
        InputError: this trajectory has not passed the gate, or it is a draft.
    """
    if isinstance(plan, Draft):
        raise InputError(f"trajectory {name} is not saved: it is a draft, which nothing checked; move the waypoint")
    return checked_file(plan.trajectory, plan.gate, plan.waypoints.positions_world_m, name=name)


def checked_file(
    trajectory: Trajectory, checked: GateReport, waypoints_world_m: FloatArray, *, name: str
) -> TrajectoryFile:
    """Any trajectory that passed the gate as a file. Raises as `trajectory_file`."""
    if not checked.passed:
        failed = ", ".join(check.name for check in checked.failures)
        raise InputError(f"trajectory {name} is not saved: it did not pass the gate ({failed})")
    if flight.trajectory.fingerprint(trajectory) != checked.trajectory_hash:
        raise InputError(f"trajectory {name} is not saved: it was changed after it was checked; plan or check it again")
    item = TrajectoryFile(
        trajectory=trajectory,
        name=name,
        map_hash=checked.map_hash,
        vehicle_hash=checked.vehicle_hash,
        waypoints_world_m=waypoints_world_m,
        check=checked.as_dict(),
    )
    return flight.trajectory.sealed(item)
