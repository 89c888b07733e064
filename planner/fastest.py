"""The fastest path along a route that the whole vehicle can fly: optimise, measure, correct, repeat.

The optimiser works with a reduced vehicle (`planner.airframe`). After each round the vehicle's own model is asked along
the path where a limit is near. What it says beyond the reduced one is added there, what is still exceeded is asked for
more strictly there (the multiplier of an augmented Lagrangian), and so is what only the gate sees; other segments keep
their speed.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

import esdf
from flight import FloatArray, Trajectory
from planner import airframe, heading, hermite, limits, minimum_snap, routes, space, time_allocation
from planner._planner import StopFlag
from planner.conditions import Conditions
from planner.gate import GateReport
from planner.options import PlanOptions
from planner.time_allocation import Problem, Solution, Weights
from vehicle import Limits, Vehicle

AIM_M = 0.02
"""What the optimiser keeps beyond the required clearance, for what lies between the samples it looks at."""
_SHORTEST_S = 0.2
"""Segments are not cut into shorter pieces: the vehicle could make nothing of them."""
_SMOOTHING_S = 0.5
"""Turns of the heading are smoothed out over this time to begin with."""
_ITERATIONS = (250, 70, *[25] * 8)
"""Of each round: the later ones only mend what is exceeded here and there."""
_SPARE = 0.006
"""Relative excess that is kept from every limit, for what is not measured."""
_STRICTER = 0.01
"""The same where the gate, with its finer samples, found a limit exceeded; more each time it does."""
_NEAR = 0.3
"""The vehicle's own model is expensive: it is asked at every second sample, where a limit is nearer than this."""
_MOST = 0.5
"""Largest correction of the reduced model in one round."""
_YAW_PRICES = {
    "along_path": (0.4, 1e-4),
    "look_at": (5.0, 1e-4),
    "smooth": (0.0, 0.01),
    "steady": (0.0, 0.0),
    "fixed": (0.0, 0.0),
    "free": (0.0, 1e-5),
}
"""Price of not looking where one should, and of turning, for each yaw mode."""
_IMPOSSIBLE = 0.2
"""Excess of every rotor where no rotor speeds give the motion."""


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """A trajectory as it went through the gate, and how it came about."""

    trajectory: Trajectory
    waypoint: np.ndarray
    """(k + 1,) which waypoint each knot is, -1 for none."""
    method: str
    report: GateReport
    optimum_s: float
    """What the optimiser took for the shortest time when it first ended."""


def rough(
    route: routes.Route,
    field: space.DistanceField,
    vehicle: Vehicle,
    options: PlanOptions,
    asked: Conditions,
    stop: StopFlag | None,
) -> tuple[Problem, Solution]:
    """Least time with few knots and the heading left alone, at a price on snap that keeps it smooth."""
    frame = airframe.reduced(vehicle, options.limits_for(vehicle))
    velocity, balls = asked.at_knots(route.waypoint), asked.balls(route.points, route.waypoint)
    problem = Problem(
        knots=np.column_stack([route.points, np.zeros(len(route.points))]),
        free=np.outer((route.waypoint < 0) | _may_move(balls), [True, True, True, False]),
        airframe=frame,
        field=field,
        clearance_m=space.aim(field, options.clearance_m) + AIM_M,
        weights=Weights(snap=1e-5),
        offsets=_leg_offsets(asked, route.waypoint, options.limits_for(vehicle)),
        start=asked.start,
        end=asked.end,
        velocity=velocity,
        balls=balls,
        target_world_m=options.target_world_m,
    )
    lengths = np.linalg.norm(np.diff(route.points, axis=0), axis=1)
    pace = np.full(len(route.points), 0.3 * min(frame.speed_m_s, frame.acceleration_m_s2))
    for knot, given in _given_speeds(asked, velocity):
        pace[knot] = max(pace[knot], given)
    slow = np.maximum(lengths, 0.3) / np.maximum(pace[:-1], pace[1:])
    return problem, time_allocation.optimise(problem, slow, iterations=150, stop=stop)


def whole_vehicle(
    problem: Problem,
    start: Solution,
    waypoint: np.ndarray,
    asked_rad: FloatArray,
    options: PlanOptions,
    conditions: Conditions,
) -> tuple[Problem, FloatArray, np.ndarray]:
    """The problem with more knots, the heading and hardly any price on snap; durations; which waypoint each knot is.

    Args:
        asked_rad: heading asked for at each waypoint, NaN where it is open.
    """
    balls = problem.balls
    before = waypoint
    knots, durations, waypoint = _split(start.spline, waypoint, options.pieces)
    if problem.balls is not None:
        balls = np.zeros((len(knots), 4))
        balls[waypoint >= 0] = problem.balls[before >= 0]
    asked = np.where(waypoint >= 0, asked_rad[waypoint], np.nan)
    problem = replace(problem, velocity=conditions.at_knots(waypoint), offsets=None, balls=balls)
    first = minimum_snap.Spline(durations, problem.spline(knots, durations).states[..., :3])
    held = heading.constant(first, asked, options)
    if held is None:
        looking = options.yaw in ("along_path", "look_at")
        target = options.target_world_m
        turned = heading.solve(first, asked, smoothing_s=_SMOOTHING_S, along_path=looking, target_world_m=target)
        knots[:, 3] = turned[:, 0]
    else:
        knots[:, 3] = held
    free = np.repeat(((waypoint < 0) | _may_move(balls))[:, None], 4, axis=1)
    free[:, 3] = np.isnan(asked) & (held is None)
    price, turning = _YAW_PRICES[options.yaw]
    weights = Weights(snap=1e-7, limits=1500.0, heading=price, turning=turning)
    return replace(problem, knots=knots, free=free, weights=weights), durations, waypoint


def _may_move(balls: FloatArray | None) -> np.ndarray | bool:
    """(k + 1,) bool: whether a knot has a ball to move in."""
    return False if balls is None else balls[:, 3] > 0.0


def _leg_offsets(asked: Conditions, waypoint: np.ndarray, limits: Limits) -> FloatArray:
    """(k, samples, limits) what the speeds asked for on legs add to the excess over the vehicle's own speed."""
    offsets = np.zeros((len(waypoint) - 1, time_allocation.SAMPLES, airframe.COLUMNS))
    offsets[:, :, airframe.NAMES.index("speed")] = asked.speed_offsets(waypoint, limits)[:, None]
    return offsets


def _given_speeds(asked: Conditions, velocity: FloatArray | None) -> list[tuple[int, float]]:
    """Knots whose speed is given, and that speed."""
    inner = [] if velocity is None else [(int(i), velocity[i]) for i in np.flatnonzero(np.isfinite(velocity[:, 0]))]
    ends = [(knot, motion[0]) for knot, motion in ((0, asked.start), (-1, asked.end)) if motion is not None]
    return [(knot, float(np.linalg.norm(v[:3]))) for knot, v in inner + ends]


def _split(spline: minimum_snap.Spline, waypoint: np.ndarray, most: int) -> tuple[FloatArray, FloatArray, np.ndarray]:
    """Segments cut into equal times, `most` pieces at most: knots, durations, and which waypoint each knot is."""
    T = spline.durations_s
    pieces = np.clip(np.floor(T / _SHORTEST_S), 1, most).astype(int)
    of = np.repeat(np.arange(len(T)), pieces)
    number = np.arange(len(of)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    scaled = hermite.segment_states(spline.states) * hermite.time_powers(T)[..., None]
    rows = hermite.basis(number / pieces[of], 0) @ hermite.monomials_from_states()
    knots = np.concatenate([np.einsum("na,nax->nx", rows, scaled[of]), spline.states[-1:, 0]])
    index = np.append(np.where(number == 0, waypoint[of], -1), waypoint[-1])
    knots[np.append(number == 0, True)] = spline.states[:, 0]
    return knots, (T / pieces)[of], index


class _Corrections:
    """What is added to the reduced model's excess at each sample, (k, samples, limits)."""

    def __init__(self, legs: FloatArray) -> None:
        self.legs, shape, segments = legs, legs.shape, len(legs)
        self.model, self.between, self.multiplier = np.zeros(shape), np.zeros(shape), np.zeros(shape)
        self.gate = np.full((segments, 1, airframe.COLUMNS), _SPARE)

    def total(self) -> FloatArray:
        return self.legs + self.model + self.between + self.multiplier + self.gate

    def measure(self, problem: Problem, found: Solution, path: Trajectory, vehicle: Vehicle) -> FloatArray:
        """Ask the vehicle's own model; returns what it says each excess is, (k, samples, limits)."""
        reduced, peaks = time_allocation.excess(problem, found)
        near = (peaks + self.legs + self.model).max(axis=2) > -_NEAR
        asked = np.zeros_like(near)
        asked[:, ::2] = near[:, ::2] | np.pad(near[:, 1::2], ((0, 0), (1, 0))) | np.pad(near[:, 1::2], ((0, 0), (0, 1)))
        if asked.any():
            times = time_allocation.sample_times(found.durations_s)[asked]
            full = airframe.measured_excess(problem.airframe, vehicle, path, times)
            full = np.where(np.isfinite(full), full, np.maximum(reduced[asked], 0.0) + _IMPOSSIBLE)
            self.model[asked] = np.clip(full - reduced[asked], -_MOST, _MOST)
            self.model[:, 1::2] = 0.5 * (self.model[:, :-1:2] + self.model[:, 2::2])
        self.between = peaks - reduced
        return peaks + self.legs + self.model

    def press(self, excess: FloatArray) -> None:
        """Raise the multipliers of what is exceeded, lower those of what is not."""
        self.multiplier = np.maximum(0.0, excess + self.gate + self.multiplier)

    def stricter(self, used: limits.Usage) -> None:
        """Keep more from the limits that the gate found exceeded, in those segments only."""
        columns = np.array([limits.NAMES.index(name) for name in airframe.NAMES])
        self.gate[:, 0] += _STRICTER * ~used.passed[columns].T


def until_flyable(
    problem: Problem,
    durations_s: FloatArray,
    waypoint: np.ndarray,
    vehicle: Vehicle,
    options: PlanOptions,
    field: space.DistanceField,
    conditions: Conditions,
    ask_gate: Callable[[Trajectory], GateReport],
    stop: StopFlag | None,
) -> Path | None:
    """Optimise until a trajectory passes the gate; None if it stays too close to obstacles.

    Where limits stay exceeded in spite of it, the last trajectory is returned with its report.
    """
    corrections = _Corrections(_leg_offsets(conditions, waypoint, options.limits_for(vehicle)))
    T, optimum_s, bends = durations_s, np.nan, 0
    for round_, iterations in enumerate(_ITERATIONS):
        problem = replace(problem, offsets=corrections.total())
        found = time_allocation.optimise(problem, T, iterations=iterations, stop=stop)
        problem, T = replace(problem, knots=found.knots), found.durations_s
        optimum_s = optimum_s if round_ else float(T.sum())
        path = minimum_snap.trajectory(found.spline)
        excess = corrections.measure(problem, found, path, vehicle)
        clearance = esdf.certify(field, path, options.clearance_m)
        last = round_ == len(_ITERATIONS) - 1
        if clearance.passed and (excess.max() <= 0.0 or last):
            report = ask_gate(path)
            if report.passed or last or report.usage is None:
                return Path(path, waypoint, "bent" if bends else "direct", report, optimum_s)
            corrections.stricter(report.usage)
        corrections.press(excess)
        if not clearance.passed:
            if bends == options.repairs:
                return None
            bends += 1
            problem = _farther_away(problem, options.clearance_m - clearance.proven_m)
    return None


def _farther_away(problem: Problem, lack_m: float) -> Problem:
    """Raise the price of clearance and what the optimiser aims at."""
    more_m = float(np.clip(lack_m, 0.002, 0.01)) if np.isfinite(lack_m) else 0.01
    weights = replace(problem.weights, clearance=problem.weights.clearance * 4.0)
    return replace(problem, clearance_m=problem.clearance_m + more_m, weights=weights)
