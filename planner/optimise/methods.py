"""The methods: the fastest path, least snap inside a corridor of boxes, and Bry's as published."""

from dataclasses import replace
from functools import partial

import numpy as np

from flight import Progress, Trajectory
from flight.progress import within
from planner.curve import heading, minimum_snap
from planner.gate import limits
from planner.gate.gate import AskGate
from planner.optimise import bry, posing, repair
from planner.optimise.attempts import Attempts
from planner.optimise.fastest import Optimum, Path
from planner.request.inputs import Request
from planner.request.options import PlanInfeasibleError
from planner.route import corridor, routes


def flyable(route: routes.Route, request: Request, ask_gate: AskGate, progress: Progress) -> Path:
    """The fastest path; one in a corridor of boxes where that is asked for or the fastest stays too close."""
    field, options, asked = request.field, request.options, request.conditions
    if options.method == "bry":
        spline, corners = bry.solve(route, field, options, request.stop)
        return _timed(spline, corners.waypoint, "bry", request, ask_gate)
    dense = posing.subdivided(route, field)
    attempts = partial(Attempts, dense.waypoint, request, ask_gate)
    if options.method == "fastest":
        report = within(progress, "optimise", 0.2, 1.0)
        path = attempts(*posing.rough(dense, field, request), posing.CLEARANCE_PRICE, report).best()
        if path is not None:
            # a given velocity allows no other pace
            may_slow = not path.report.passed and not asked.given_motion
            return repair.slowed(path, request, ask_gate) if may_slow else path
    boxes = corridor.boxes(field, dense.points, options.planned_clearance_m)
    tube = corridor.Tube(boxes, options.clearance_m + posing.AIM_M)
    rough, start = posing.rough(dense, tube, request)
    path = attempts(rough, start, corridor.CLEARANCE_PRICE, within(progress, "corridor", 0.0, 1.0)).best()
    if path is not None and (path.report.passed or asked.given_motion):
        return replace(path, method="corridor", kept=None)
    if asked.given_motion:
        raise PlanInfeasibleError(
            "no path with the given velocities keeps clear of the obstacles", "lower them, or give them more room"
        )
    spline = repair.through_corridor(dense, boxes, start.durations_s, request.stop)
    return _timed(spline, dense.waypoint, "corridor", request, ask_gate)


def _timed(spline: minimum_snap.Spline, waypoint: np.ndarray, method: str, request: Request, ask_gate: AskGate) -> Path:
    """A path whose times matter only in proportion, with headings, as fast as the vehicle can fly it."""
    level = minimum_snap.trajectory(spline)
    spline = spline.scale_time(repair.time_scale(level, request.vehicle, request.limits))
    trajectory = _with_heading(spline, waypoint, request)
    path = Path(trajectory, waypoint, method, ask_gate(trajectory, None), Optimum(float(spline.durations_s.sum())))
    return repair.slowed(path, request, ask_gate)


def _with_heading(spline: minimum_snap.Spline, waypoint: np.ndarray, request: Request) -> Trajectory:
    """Turn the vehicle along the path as fast as it may turn."""
    asked, options = np.where(waypoint >= 0, request.waypoints.yaw_rad[waypoint], np.nan), request.options
    held = heading.constant(spline, asked, options)
    if held is None:
        can = limits.yaw_bounds(request.vehicle, request.limits)
        looking, target = options.yaw in ("along_path", "look_at"), options.target_world_m
        yaw = heading.steady_enough(spline, asked, can, along_path=looking, target_world_m=target)
    else:
        yaw = np.tile([held, 0.0, 0.0, 0.0], (len(spline.states), 1))
    states = np.concatenate([spline.states, yaw[..., None]], axis=2)
    return minimum_snap.trajectory(minimum_snap.Spline(spline.durations_s, states))
