"""The fastest path along a route that the whole vehicle can fly: optimise, measure, correct, repeat.

The optimiser works with a reduced vehicle (`planner.optimise.airframe`). After each round the vehicle's own model is
asked along the path where a limit is near. What it says beyond the reduced one is added there, what is still exceeded
is asked for more strictly there (the multiplier of an augmented Lagrangian), and so is what only the gate sees; other
segments keep their speed.
"""

from dataclasses import dataclass, replace

import numpy as np

import esdf
from flight import FloatArray, Progress, Trajectory, portable, silent
from flight.trajectory import LONGEST_S
from planner.curve import heading, hermite, minimum_snap
from planner.curve.attitude import Memory
from planner.gate import limits
from planner.gate.gate import AskGate, GateReport
from planner.optimise import airframe, descents, time_allocation, windows
from planner.optimise.corrections import Corrections
from planner.optimise.time_allocation import Problem, Solution, Weights
from planner.request import space
from planner.request.conditions import Conditions
from planner.request.options import PlanInfeasibleError
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
_WHOLE = 3
"""Rounds about all segments; later ones mend what is exceeded here and there."""
_ROUNDS = 40
_RELIEVED, _LONGER, _AGAIN = 0.01, 1.002, 8
"""Where the vehicle's own model asks for so much less than was believed, a path that passes is optimised once more,
and all of it where it takes so many times the optimum; so many rounds are given to that."""
_FEW = 0.4
"""Share of the segments below which only those that exceed a limit, and their neighbours, are optimised again."""
_REACH, _FAR = 4, 6
"""Neighbours on either side that are; so many where a waypoint has moved."""
_YAW_PRICES = {
    "along_path": (0.4, 1e-4),
    "look_at": (5.0, 1e-4),
    "smooth": (0.0, 0.01),
    "steady": (0.0, 0.0),
    "fixed": (0.0, 0.0),
    "free": (0.0, 1e-5),
}
"""Price of not looking where one should, and of turning, for each yaw mode."""


@dataclass(frozen=True, slots=True, eq=False)
class Kept:
    """How an optimised path came about."""

    problem: Problem
    spline: minimum_snap.Spline
    corrections: Corrections


@dataclass(frozen=True, slots=True)
class Optimum:
    """How close a path is to the shortest time that the optimiser knows of."""

    shortest_s: float
    """What it took for the shortest time when it first ended, before the vehicle's own model and the gate spoke."""
    converged: bool = False
    """Whether the last descent ended by itself, and not because its iterations were used up."""
    residual: float = np.nan
    """Share of the flight time that it would still gain by its undamped quadratic model; at kinks, less."""
    active: tuple[str, ...] = ()
    """The limit that holds each segment back most, by its multipliers; "" where none does."""
    spread: float = np.nan
    """How much longer the slowest path from any start of the descent took, as a share; NaN of a single start."""


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """A trajectory as it went through the gate, and how it came about."""

    trajectory: Trajectory
    waypoint: np.ndarray
    """(k + 1,) which waypoint each knot is, -1 for none."""
    method: str
    report: GateReport
    optimum: Optimum
    kept: Kept | None = None
    """From what it can be optimised further; None for a path in a corridor, and for one that was slowed down."""


def rough(route: routes.Route, obstacles: space.DistanceField, request: Request) -> tuple[Problem, Solution]:
    """Least time with few knots and the heading left alone, at a price on snap that keeps it smooth."""
    asked, options = request.conditions, request.options
    frame = airframe.reduced(request.vehicle, request.limits)
    velocity, balls = asked.at_knots(route.waypoint), asked.balls(route.points, route.waypoint)
    gates = asked.gates(route.points, route.waypoint)
    on_legs = asked.planned_on_legs(route.waypoint, request.limits)
    problem = Problem(
        knots=np.column_stack([route.points, np.zeros(len(route.points))]),
        free=np.outer((route.waypoint < 0) | may_move(balls, gates, len(route.points)), [True, True, True, False]),
        airframe=frame,
        field=obstacles,
        clearance_m=space.aim(obstacles, options.clearance_m) + AIM_M,
        weights=Weights(snap=1e-5),
        speed_m_s=on_legs["speed_m_s"],
        jerk_m_s3=on_legs["jerk_m_s3"],
        start=asked.start,
        end=asked.end,
        velocity=velocity,
        balls=balls,
        gates=gates,
        target_world_m=options.target_world_m,
    )
    lengths = np.linalg.norm(np.diff(route.points, axis=0), axis=1)
    pace = np.full(len(route.points), 0.3 * min(frame.speed_m_s, frame.acceleration_m_s2))
    for knot, given in _given_speeds(asked, velocity):
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
) -> tuple[Problem, FloatArray, np.ndarray]:
    """The problem with more knots, the heading and hardly any price on snap; durations; which waypoint each knot is.

    Args:
        clearance_price: as `Weights.clearance`.
    """
    before, options, asked_rad = waypoint, request.options, request.waypoints.yaw_rad
    knots, durations, waypoint = _split(start.spline, waypoint, options.pieces)
    balls, gates = (_at_waypoints(kept, before, waypoint) for kept in (problem.balls, problem.gates))
    asked = np.where(waypoint >= 0, asked_rad[waypoint], np.nan)
    velocity = request.conditions.at_knots(waypoint)
    problem = replace(problem, velocity=velocity, speed_m_s=None, jerk_m_s3=None, balls=balls, gates=gates)
    first = minimum_snap.Spline(durations, problem.spline(knots, durations).states[..., :3])
    held = heading.constant(first, asked, options)
    if held is None:
        looking = options.yaw in ("along_path", "look_at")
        target = options.target_world_m
        turned = heading.solve(first, asked, smoothing_s=_SMOOTHING_S, along_path=looking, target_world_m=target)
        knots[:, 3] = turned[:, 0]
    else:
        knots[:, 3] = held
    free = np.repeat(((waypoint < 0) | may_move(balls, gates, len(knots)))[:, None], 4, axis=1)
    free[:, 3] = np.isnan(asked) & (held is None)
    price, turning = _YAW_PRICES[options.yaw]
    weights = Weights(snap=2e-7, limits=400.0, clearance=clearance_price, heading=price, turning=turning)
    on_legs = request.conditions.planned_on_legs(waypoint, request.limits)
    problem = replace(problem, knots=knots, free=free, weights=weights, heading_held=held is not None, **on_legs)
    return problem, durations, waypoint


def with_free_heading(problem: Problem, waypoint: np.ndarray, asked_rad: FloatArray) -> Problem:
    """The same problem with the heading free, but at waypoints that ask for one (NaN: they do not)."""
    free = problem.free.copy()
    free[:, 3] = (waypoint < 0) | np.isnan(asked_rad[waypoint])
    price, turning = _YAW_PRICES["free"]
    weights = replace(problem.weights, heading=price, turning=turning)
    return replace(problem, free=free, weights=weights, heading_held=False)


def _at_waypoints(kept: FloatArray | None, before: np.ndarray, waypoint: np.ndarray) -> FloatArray | None:
    """What was kept of knots that are waypoints, for the same waypoints among other knots; zeros elsewhere."""
    if kept is None:
        return None
    found = np.zeros((len(waypoint), *kept.shape[1:]))
    found[waypoint >= 0] = kept[before >= 0]
    return found


def may_move(balls: FloatArray | None, gates: FloatArray | None, knots: int) -> np.ndarray:
    """(k + 1,) bool: whether a knot has a ball, or the opening of a gate, to move in."""
    free = np.zeros(knots, dtype=bool)
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
    scaled = hermite.segment_states(spline.states) * hermite.time_powers(T)[..., None]
    rows = portable.product(hermite.basis(number / pieces[of], 0), hermite.monomials_from_states())
    knots = np.concatenate([np.einsum("na,nax->nx", rows, scaled[of]), spline.states[-1:, 0]])
    index = np.append(np.where(number == 0, waypoint[of], -1), waypoint[-1])
    knots[np.append(number == 0, True)] = spline.states[:, 0]
    return knots, (T / pieces)[of], index


def until_flyable(
    problem: Problem,
    spline: minimum_snap.Spline,
    waypoint: np.ndarray,
    request: Request,
    ask_gate: AskGate,
    *,
    wrong: np.ndarray | None = None,
    drawn: bool = True,
    corrections: Corrections | None = None,
    used: tuple[Trajectory, limits.Usage] | None = None,
    progress: Progress = silent,
) -> Path | None:
    """Optimise until a trajectory passes the gate; None if it stays too close to obstacles.

    The first rounds are about all segments, unless `wrong` (k,) says which ones to begin with; then only those that
    exceed a limit are optimised again, with their neighbours, and the first path that passes will do. Where limits stay
    exceeded in spite of it, the last trajectory is returned with its report.

    Args:
        spline: the path to go on from.
        drawn: False where only places of the knots about `wrong` are known.
        corrections, used: those of an earlier answer, and what the gate found of it.
    """
    corrections = Corrections(len(spline.durations_s)) if corrections is None else corrections
    problem = replace(problem, **request.conditions.planned_on_legs(waypoint, request.limits))
    asked, clearance_m, stop = request.conditions.most_on_legs(waypoint), request.options.clearance_m, request.stop
    memory = Memory()  # the last path that is measured is the one that the gate looks at
    optimum_s, bends, begun = np.nan, 0, _WHOLE if wrong is not None else 0
    found, rounds = None, _ROUNDS
    for round_ in range(begun, _ROUNDS):
        if round_ == rounds:
            return found
        progress("optimise", 1.0 - 0.7 ** (round_ - begun + 1))  # how many rounds it takes is not known before
        believed = corrections.model.copy()
        charged_s = spline.durations_s if round_ > 0 else None
        problem = replace(problem, offsets=corrections.total(), reference_s=charged_s)
        touched = _touched(spline, wrong, _FAR if round_ == begun else _REACH)
        if round_ == begun and not drawn:
            spline = descents.redrawn(problem, spline, touched, stop)
        descended = descents.refined(problem, spline, touched, stop, near=round_ > _WHOLE)
        spline = descended.spline
        _check_lasting(spline.durations_s)
        problem = replace(problem, knots=spline.states[:, 0])
        optimum_s = float(spline.durations_s.sum()) if round_ == begun else optimum_s
        path = minimum_snap.trajectory(spline)
        excess = corrections.measure(problem, spline, path, request.vehicle, touched, memory, stop)
        exceeded = excess.max(axis=(1, 2)) > 0.0
        clearance = esdf.certify(request.field, path, clearance_m)
        last = round_ == _ROUNDS - 1
        if clearance.passed and (last or not exceeded.any()):
            report = ask_gate(path, limits.Known(used, memory))
            used = report.usage and (path, report.usage)
            slower, on_legs = _refused(report, asked)
            if report.passed or last or not slower.any():  # nothing else gets better by more rounds
                kept = Kept(problem, spline, corrections.spliced(0, 0, 0))
                how = "bent" if bends else "direct"
                active = corrections.active(touched)
                optimum = Optimum(optimum_s, descended.converged, descended.residual, active)
                here = Path(path, waypoint, how, report, optimum, kept)
                relieved = (believed - corrections.model).max(axis=(1, 2)) > _RELIEVED
                longer = path.duration_s > _LONGER * optimum_s
                once = report.passed and found is None and begun == 0
                if not (once and (longer or relieved.any())):
                    return faster(found, here)
                found, wrong, rounds = here, None if longer else relieved, round_ + _AGAIN
                corrections.press(touched)
                continue
            assert report.usage is not None
            corrections.stricter(report.usage, on_legs)
            exceeded |= slower
        corrections.press(touched)
        if not clearance.passed:
            if bends == request.options.repairs:
                return found
            bends += 1
            problem = _farther_away(problem, clearance_m - clearance.proven_m)
            exceeded[clearance.segment] = True
        few = windows.grown(exceeded, _REACH).mean() < _FEW
        wrong = exceeded if wrong is not None or few or round_ + 1 >= _WHOLE else None
    return found


def _touched(spline: minimum_snap.Spline, wrong: np.ndarray | None, reach: int) -> np.ndarray:
    return np.ones(len(spline.durations_s), dtype=bool) if wrong is None else windows.grown(wrong, reach)


def _refused(report: GateReport, asked: dict[str, FloatArray]) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """(k,) bool: the segments that the gate found too fast for a limit or for what is asked of their leg, and by name
    of the limit those for their leg."""
    used = report.usage
    if used is None:
        return np.zeros(len(asked["speed"]), dtype=bool), {}
    beyond = {name: used.value[limits.NAMES.index(name)] > most for name, most in asked.items()}
    return ~used.passed.all(axis=0) | np.any(list(beyond.values()), axis=0), beyond


def faster(found: Path | None, here: Path) -> Path:
    """The path that was found before, unless the one that is here passes and takes less time."""
    if found is None or (here.report.passed and here.trajectory.duration_s < found.trajectory.duration_s):
        return here
    return found


def _check_lasting(durations_s: FloatArray) -> None:
    if float(durations_s.sum()) > LONGEST_S:
        raise PlanInfeasibleError(
            f"the shortest time found is {durations_s.sum():.3g} s, and a trajectory lasts at most {LONGEST_S:g} s",
            "raise the speeds asked for on legs, or plan the flight in parts",
        )


def _farther_away(problem: Problem, lack_m: float) -> Problem:
    """Raise the price of clearance and what the optimiser aims at."""
    more_m = float(np.clip(lack_m, 0.002, 0.01)) if np.isfinite(lack_m) else 0.01
    weights = replace(problem.weights, clearance=problem.weights.clearance * 4.0)
    return replace(problem, clearance_m=problem.clearance_m + more_m, weights=weights)
