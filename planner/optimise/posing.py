"""The problem that the optimiser is given: first with few knots along the route, then of the whole vehicle."""

from dataclasses import replace

import numpy as np

from flight import FloatArray, portable
from planner.curve import heading, minimum_snap
from planner.optimise import airframe, time_allocation
from planner.optimise.time_allocation import Problem, Solution, Weights
from planner.request import space
from planner.request.conditions import AtKnots, Conditions
from planner.request.request import Request
from planner.route import routes

AIM_M = 0.02
"""What the optimiser keeps beyond the required clearance, for what lies between the samples it looks at."""
CLEARANCE_PRICE = 1e4
"""Per second at 1 m^2 of squared lack of clearance. At 300 the path gave up several centimetres that the first descent
had kept, at a pace at which the way back was too stiff for the descent: a walk through one narrow place took 24 s, not
6.5 s, and of 80 two fell back on boxes and one was refused. In the open the price does not matter; among trunks it
costs 0.1 %."""
_ROUGH = 60
"""Iterations of the first descent, with few knots."""
_START_SLOWER, _SOUND = (2.0, 4.0), 2.0
"""Factors on the times to start from, tried in turn: from too fast a start the descent can end where the vehicle flies
upside down. Then most of the cost is penalties (14 and 32 times the flight time); else it was at most 1.2 times."""
_SHORTEST_S = 0.2
"""Segments are not cut into shorter pieces: the vehicle could make nothing of them."""
_SMOOTHING_S = 0.5
"""Turns of the heading are smoothed out over this time to begin with."""
_YAW_PRICES = {
    "along_path": (0.4, 1e-4),
    "look_at": (5.0, 1e-4),
    "smooth": (0.0, 0.01),
    "steady": (0.0, 0.0),
    "fixed": (0.0, 0.0),
    "free": (0.0, 1e-5),
}
"""Price of not looking where one should, and of turning, for each yaw mode."""


def rough(route: routes.Route, obstacles: space.DistanceField, request: Request) -> tuple[Problem, Solution]:
    """Least time with few knots and the heading left alone, at a price on snap that keeps it smooth."""
    asked, options = request.conditions, request.options
    frame = airframe.reduced(request.vehicle, request.limits)
    at_knots = asked.at_knots(request.waypoints.positions_world_m, route.waypoint, request.limits)
    problem = Problem(
        knots=np.column_stack([route.points, np.zeros(len(route.points))]),
        free=np.outer((route.waypoint < 0) | may_move(at_knots, len(route.points)), [True, True, True, False]),
        airframe=frame,
        field=obstacles,
        clearance_m=space.aim(obstacles, options.clearance_m) + AIM_M,
        weights=Weights(snap=1e-5),
        start=asked.start,
        end=asked.end,
        target_world_m=options.target_world_m,
        **at_knots,
    )
    lengths = np.linalg.norm(np.diff(route.points, axis=0), axis=1)
    pace = np.full(len(route.points), 0.3 * min(frame.speed_m_s, frame.acceleration_m_s2))
    for knot, given in _given_speeds(asked, at_knots["velocity"]):
        pace[knot] = max(pace[knot], given)
    allowed = np.inf if problem.speed_m_s is None else 0.6 * problem.speed_m_s
    slow = np.maximum(lengths, 0.3) / np.minimum(np.maximum(pace[:-1], pace[1:]), allowed)
    found = time_allocation.optimise(problem, slow, iterations=_ROUGH, stop=request.stop)
    for slower in _START_SLOWER:
        if found.cost < _SOUND * float(found.durations_s.sum()):
            break
        found = time_allocation.optimise(problem, slower * slow, iterations=_ROUGH, stop=request.stop)
    return problem, found


def whole_vehicle(
    problem: Problem, start: Solution, waypoint: np.ndarray, request: Request, clearance_price: float
) -> tuple[Problem, minimum_snap.Spline, np.ndarray]:
    """The problem with more knots, the heading and hardly any price on snap; a path to begin with; which waypoint each
    knot is.

    Args:
        clearance_price: as `Weights.clearance`.
    """
    options, waypoints = request.options, request.waypoints
    knots, durations, waypoint = _split(start.spline, waypoint, options.pieces)
    asked = np.where(waypoint >= 0, waypoints.yaw_rad[waypoint], np.nan)
    at_knots = request.conditions.at_knots(waypoints.positions_world_m, waypoint, request.limits)
    problem = replace(problem, **at_knots)
    first = minimum_snap.Spline(durations, problem.spline(knots, durations).states[..., :3])
    held = heading.constant(first, asked, options)
    if held is None:
        looking = options.yaw in ("along_path", "look_at")
        target = options.target_world_m
        turned = heading.solve(first, asked, smoothing_s=_SMOOTHING_S, along_path=looking, target_world_m=target)
        knots[:, 3] = turned[:, 0]
    else:
        knots[:, 3] = held
    free = np.repeat(((waypoint < 0) | may_move(at_knots, len(knots)))[:, None], 4, axis=1)
    free[:, 3] = np.isnan(asked) & (held is None)
    price, turning = _YAW_PRICES[options.yaw]
    weights = Weights(snap=2e-7, limits=400.0, clearance=clearance_price, heading=price, turning=turning)
    problem = replace(problem, knots=knots, free=free, weights=weights, heading_held=held is not None)
    return problem, problem.spline(knots, durations), waypoint


def with_free_heading(problem: Problem, waypoint: np.ndarray, asked_rad: FloatArray) -> Problem:
    """The same problem with the heading free, but at waypoints that ask for one (NaN: they do not)."""
    free = problem.free.copy()
    free[:, 3] = (waypoint < 0) | np.isnan(asked_rad[waypoint])
    price, turning = _YAW_PRICES["free"]
    weights = replace(problem.weights, heading=price, turning=turning)
    return replace(problem, free=free, weights=weights, heading_held=False)


def may_move(at: AtKnots, knots: int) -> np.ndarray:
    """(k + 1,) bool: whether a knot has a ball, or the opening of a gate, to move in."""
    free, balls, gates = np.zeros(knots, dtype=bool), at["balls"], at["gates"]
    if balls is not None:
        free |= balls[:, 3] > 0.0
    if gates is not None:
        free |= np.linalg.norm(gates[:, 1:], axis=(1, 2)) > 0.0
    return free


def _given_speeds(asked: Conditions, velocity: FloatArray | None) -> list[tuple[int, float]]:
    """Knots whose speed is given, and that speed."""
    inner = [] if velocity is None else [(int(i), velocity[i]) for i in np.flatnonzero(np.isfinite(velocity[:, 0]))]
    ends = [(knot, motion[0]) for knot, motion in ((0, asked.start), (-1, asked.end)) if motion is not None]
    return [(knot, float(portable.length(v[:3]))) for knot, v in inner + ends]


def _split(spline: minimum_snap.Spline, waypoint: np.ndarray, most: int) -> tuple[FloatArray, FloatArray, np.ndarray]:
    """Segments cut into equal times, `most` pieces at most: knots, durations, and which waypoint each knot is."""
    T = spline.durations_s
    pieces = np.clip(np.floor(T / _SHORTEST_S), 1, most).astype(int)
    of = np.repeat(np.arange(len(T)), pieces)
    number = np.arange(len(of)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    scaled = minimum_snap.segment_states(spline.states) * minimum_snap.time_powers(T)[..., None]
    rows = portable.product(minimum_snap.basis(number / pieces[of], 0), minimum_snap.monomials_from_states())
    knots = np.concatenate([np.einsum("na,nax->nx", rows, scaled[of]), spline.states[-1:, 0]])
    index = np.append(np.where(number == 0, waypoint[of], -1), waypoint[-1])
    knots[np.append(number == 0, True)] = spline.states[:, 0]
    return knots, (T / pieces)[of], index
