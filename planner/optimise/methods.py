"""From a route to a path: the fastest, first with few knots; least snap inside a corridor of boxes; Bry's method."""

from dataclasses import replace
from functools import partial

import numpy as np

from flight import FloatArray, Progress, Trajectory, portable
from flight.progress import within
from planner.curve import heading, minimum_snap
from planner.gate import instants
from planner.gate.gate import AskGate
from planner.optimise import airframe, bry, repair, time_allocation
from planner.optimise.attempts import Attempts
from planner.optimise.fastest import Optimum, Path
from planner.optimise.time_allocation import Problem, Solution, Weights
from planner.request import conditions, space
from planner.request.conditions import Conditions
from planner.request.inputs import Request
from planner.request.options import PlanInfeasibleError
from planner.route import corridor, routes

AIM_M = 0.02
"""What the optimiser keeps beyond the required clearance, for what lies between the samples it looks at."""
CLEARANCE_PRICE = 1e4
"""Per second at 1 m^2 of squared lack of clearance. At 300 the path gave up several centimetres that the first descent
had kept, at a pace at which the way back was too stiff for the descent: a walk through one narrow place took 24 s, not
6.5 s, and of 80 two fell back on boxes and one was refused. In the open the price does not matter; among trunks it
costs 0.1 %."""
_CLOSE_M, _SPARSE_M = 1.0, 1.6
"""Spacing of the points of a way that touches obstacles: where legs have speeds of their own, and else; it grows with
twice the room there is. At the wider one, 50 flights take a quarter less work and .1 % longer; but of 206 with
slow legs three took 6 to 14 % longer and one 146 %, as they slow down between fewer knots."""
_LIFT_M, _ROOM_M, _MORE_M = 0.8, 0.5, 1e-3
"""How much higher another route is looked at, up to which distance to obstacles room counts, and how much more there
must be: among trunks and walls from floor to ceiling there is none, and nothing is tried."""
_ROUGH = 60
"""Iterations of the first descent, with few knots."""
_START_SLOWER, _SOUND = (2.0, 4.0), 2.0
"""Factors on the times to start from, tried in turn: from too fast a start the descent can end where the vehicle flies
upside down. Then most of the cost is penalties (14 and 32 times the flight time); else it was at most 1.2 times."""
_GRADED = 1.5
"""Most by which the pace to start from rises from one segment to the next beside a leg with a speed of its own. What
disturbs a path of least snap fades by .535 a knot in units of the segments' times, so it grows where these rise by more
than 1.87. Entered at nine times its pace, a leg of 1.5 m swung out 38 m, and no descent led back."""


def flyable(route: routes.Route, request: Request, ask_gate: AskGate, progress: Progress) -> Path:
    """The fastest path; one in a corridor of boxes where that is asked for or the fastest stays too close."""
    field, options, asked = request.field, request.options, request.conditions
    if options.method == "bry":
        spline, corners = bry.solve(route, field, options, request.stop)
        return _timed(spline, corners.waypoint, "bry", request, ask_gate)
    dense = subdivided(route, field, _SPARSE_M if asked.leg_speed_m_s is None else _CLOSE_M)
    attempts = partial(Attempts, dense.waypoint, request, ask_gate)
    if options.method == "fastest":
        report = within(progress, "optimise", 0.2, 1.0)
        few, start = rough(dense, field, request)
        higher = lifted(dense, field)
        above = None if higher is None else rough(higher, field, request)[1]
        path = attempts(few, start, above, CLEARANCE_PRICE, report).best()
        if path is not None:
            # a given velocity allows no other pace
            may_slow = not path.report.passed and not asked.given_motion
            return repair.slowed(path, request, ask_gate) if may_slow else path
    boxes = corridor.boxes(field, dense.points, options.planned_clearance_m)
    tube = corridor.Tube(boxes, options.clearance_m + AIM_M)
    few, start = rough(dense, tube, request)
    path = attempts(few, start, None, corridor.CLEARANCE_PRICE, within(progress, "corridor", 0.0, 1.0)).best()
    if path is not None and (path.report.passed or asked.given_motion):
        return replace(path, method="corridor", kept=None)
    if asked.given_motion:
        raise PlanInfeasibleError(
            "no path with the given velocities keeps clear of the obstacles", "lower them, or give them more room"
        )
    spline = repair.through_corridor(dense, boxes, start.durations_s, request.stop)
    return _timed(spline, dense.waypoint, "corridor", request, ask_gate)


def subdivided(route: routes.Route, field: space.DistanceField, close_m: float = _CLOSE_M) -> routes.Route:
    """The same polyline with more points in narrow places, so that a spline through them stays close to it.

    Args:
        close_m: spacing of points next to obstacles; a line that has two or more at `_CLOSE_M` keeps two.
    """
    points, index = [route.points[:1]], [route.waypoint[:1]]
    for i in range(len(route.points) - 1):
        a, b = route.points[i], route.points[i + 1]
        near = space.distance(field, a + np.linspace(0.0, 1.0, 9)[:, None] * (b - a)).min()
        length_m, room_m = portable.length(b - a), 2.0 * max(near, 0.0)
        pieces = max(int(np.ceil(length_m / (close_m + room_m))), 2 if length_m > _CLOSE_M + room_m else 1)
        points.append(a + np.linspace(0.0, 1.0, pieces + 1)[1:, None] * (b - a))
        index.append(np.append(np.full(pieces - 1, -1), route.waypoint[i + 1]))
    return routes.Route(np.concatenate(points), np.concatenate(index))


def lifted(route: routes.Route, field: space.DistanceField) -> routes.Route | None:
    """The route higher up between its waypoints, if it has more room there: over furniture, say, or through a hatch."""
    higher = route.points + np.where(route.waypoint < 0, _LIFT_M, 0.0)[:, None] * np.array([0.0, 0.0, 1.0])
    rooms = [_room_m(points, field) for points in (route.points, higher)]
    return routes.Route(higher, route.waypoint) if rooms[1] > rooms[0] + _MORE_M else None


def _room_m(points: FloatArray, field: space.DistanceField) -> float:
    """Mean distance from a polyline (n, 3) to obstacles and unknown space, of which no more than `_ROOM_M` counts."""
    shares = np.linspace(0.0, 1.0, 5)[:, None, None]
    distance = space.distance(field, (points[:-1] + shares * np.diff(points, axis=0)).reshape(-1, 3))
    return float(np.clip(distance, -_ROOM_M, _ROOM_M).mean())


def rough(route: routes.Route, obstacles: space.DistanceField, request: Request) -> tuple[Problem, Solution]:
    """Least time with few knots and the heading left alone, at a price on snap that keeps it smooth."""
    asked, options = request.conditions, request.options
    at_knots = asked.at_knots(request.waypoints.positions_world_m, route.waypoint, request.limits)
    may_move = (route.waypoint < 0) | conditions.may_move(at_knots, len(route.points))
    frame = airframe.reduced(request.vehicle, request.limits)
    problem = Problem(
        knots=np.column_stack([route.points, np.zeros(len(route.points))]),
        free=np.outer(may_move, [True, True, True, False]),
        airframe=frame,
        target_world_m=options.target_world_m,
        field=obstacles,
        clearance_m=space.aim(obstacles, options.clearance_m) + AIM_M,
        weights=Weights(snap=1e-5),
        start=asked.start,
        end=asked.end,
        **at_knots,
    )
    lengths = np.linalg.norm(np.diff(route.points, axis=0), axis=1)
    pace = np.full(len(route.points), 0.3 * min(frame.speed_m_s, frame.acceleration_m_s2))
    for knot, given in _given_speeds(asked, at_knots["velocity"]):
        pace[knot] = max(pace[knot], given)
    allowed = np.inf if problem.speed_m_s is None else _graded(0.6 * problem.speed_m_s)
    slow = np.maximum(lengths, 0.3) / np.minimum(np.maximum(pace[:-1], pace[1:]), allowed)
    found = time_allocation.optimise(problem, slow, iterations=_ROUGH, stop=request.stop)
    for slower in _START_SLOWER:
        if found.cost < _SOUND * float(found.durations_s.sum()):
            break
        found = time_allocation.optimise(problem, slower * slow, iterations=_ROUGH, stop=request.stop)
    return problem, found


def _graded(pace_m_s: FloatArray) -> FloatArray:
    """The pace (k,) of segments, lowered where it would rise by more than `_GRADED` from one to the next, or back."""
    graded = pace_m_s.copy()
    for i in range(1, len(graded)):
        graded[i] = min(graded[i], _GRADED * graded[i - 1])
    for i in range(len(graded) - 1, 0, -1):
        graded[i - 1] = min(graded[i - 1], _GRADED * graded[i])
    return graded


def _given_speeds(asked: Conditions, velocity: FloatArray | None) -> list[tuple[int, float]]:
    """Knots whose speed is given, and that speed."""
    inner = [] if velocity is None else [(int(i), velocity[i]) for i in np.flatnonzero(np.isfinite(velocity[:, 0]))]
    ends = [(knot, motion[0]) for knot, motion in ((0, asked.start), (-1, asked.end)) if motion is not None]
    return [(knot, float(portable.length(v[:3]))) for knot, v in inner + ends]


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
        can = instants.yaw_bounds(request.vehicle, request.limits)
        looking, target = options.yaw in ("along_path", "look_at"), options.target_world_m
        yaw = heading.steady_enough(spline, asked, can, along_path=looking, target_world_m=target)
    else:
        yaw = np.tile([held, 0.0, 0.0, 0.0], (len(spline.states), 1))
    states = np.concatenate([spline.states, yaw[..., None]], axis=2)
    return minimum_snap.trajectory(minimum_snap.Spline(spline.durations_s, states))
