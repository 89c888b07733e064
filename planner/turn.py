"""A turn on the spot: rest in one place while the heading goes the short way from one to another."""

from dataclasses import replace
from functools import partial

import numpy as np

from flight import FloatArray, Waypoints, rotations
from planner import planning
from planner.curve import heading, minimum_snap
from planner.gate import gate, instants
from planner.optimise import repair
from planner.optimise.fastest import Optimum, Path
from planner.request import inputs
from planner.request.inputs import Request
from planner.request.options import check_stop

_PEAK_RATE, _PEAK_ACCELERATION = 2.1875, 7.5132
"""Of the smoothest turn by one radian within one second from rest to rest, a polynomial of degree seven."""


def plan(request: Request) -> planning.Plan:
    """The fastest turn within the limits, checked by the gate, through two waypoints in one place, each with a heading.

    Raises:
        InputError: the yaw mode holds another heading.
        PlanInfeasibleError: it is not within the limits; with `segment`, `reason` and `remedy`.
        PlanCancelledError: the request's `stop` was set.
    """
    check_stop(request.stop)
    inputs.check(request, may_turn=True)
    waypoints = request.waypoints
    spline = _smoothest(waypoints, instants.yaw_bounds(request.vehicle, request.limits))
    heading.constant(spline, waypoints.yaw_rad, request.options)
    trajectory, ask_gate = minimum_snap.trajectory(spline), partial(gate.judge, request)
    first = Path(trajectory, np.arange(2), "turn", ask_gate(trajectory, None), Optimum(trajectory.duration_s))
    slowed = repair.slowed(first, request, ask_gate)
    path = replace(slowed, optimum=Optimum(slowed.trajectory.duration_s, converged=True, residual=0.0))
    if not path.report.passed:
        raise planning.refused(path)
    return planning.of_path(path, waypoints, waypoints.positions_world_m)


def _smoothest(waypoints: Waypoints, can: heading.Bounds) -> minimum_snap.Spline:
    """Of least snap from rest to rest, in about the time that yaw rate and yaw torque ask for."""
    start, end = waypoints.yaw_rad
    by = float(rotations.wrapped(end - start))
    duration_s = max(
        _PEAK_RATE * abs(by) / can.rate_rad_s, np.sqrt(_PEAK_ACCELERATION * abs(by) / can.acceleration_rad_s2)
    )
    place = waypoints.positions_world_m[0]
    knots: FloatArray = np.array([[*place, start], [*place, start + by]])
    return minimum_snap.solve(knots, np.array([duration_s]))
