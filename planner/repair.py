"""What is done about a path that comes too close or asks too much: bend it, box it in, slow it down."""

from dataclasses import dataclass, replace

import numpy as np

import esdf
from flight import FloatArray, InfeasibleError, Trajectory
from planner import corridor, hermite, limits, minimum_snap, quadratic, space, time_allocation
from planner.options import PlanOptions
from planner.routes import Route
from planner.time_allocation import Problem, Solution
from vehicle import Limits, Vehicle, flatness

_COARSE_S = 0.02
"""Sampling of the limits while a time scale is looked for; the gate samples finer."""
_SPARE = 0.003
"""Share of the time that is given away, for what the coarse sampling does not see."""


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """A position spline that keeps the clearance, and which waypoint each knot is (-1: none)."""

    spline: minimum_snap.Spline
    waypoint: np.ndarray
    method: str


def position_trajectory(spline: minimum_snap.Spline) -> Trajectory:
    """The spline with yaw 0, to measure its way through space."""
    c = hermite.coefficients(spline.states, spline.durations_s)
    return Trajectory(spline.durations_s, np.concatenate([c, np.zeros((len(c), 1, hermite.SIZE))], axis=1))


def bend_until_clear(problem: Problem, start: Solution, waypoint: np.ndarray, options: PlanOptions) -> Path | None:
    """Raise the price and the aim of the clearance until the whole curve keeps it; None if that does not succeed."""
    required, solution = options.clearance_m, start
    aim = problem.clearance_m
    for attempt in range(options.repairs + 1):
        found = esdf.certify(problem.field, position_trajectory(solution.spline), required)
        if found.passed:
            return Path(solution.spline, waypoint, "bent" if attempt else "direct")
        if attempt == options.repairs:
            break
        lack = required - found.proven_m if np.isfinite(found.proven_m) else 0.1
        aim += float(np.clip(1.2 * lack, 0.005, 0.1))
        problem = time_allocation.with_weights(
            replace(problem, knots=solution.knots, clearance_m=aim), clearance=problem.weights.clearance * 4.0
        )
        solution = time_allocation.optimise(problem, solution.durations_s, iterations=80)
    return None


def through_corridor(route: Route, field: space.DistanceField, options: PlanOptions) -> Path:
    """The smoothest path inside proved boxes round the route; straight lines with stops if even that fails.

    The route itself is free, so there always is an answer; it is slower than a bent path.
    """
    lengths = np.linalg.norm(np.diff(route.points, axis=0), axis=1)
    T = 0.3 + lengths / 1.5
    pinned = route.waypoint >= 0
    wanted = np.where(pinned[:, None], route.points, np.nan)
    boxes = corridor.boxes(field, route.points, options.clearance_m)
    try:
        spline = quadratic.SnapProgram(quadratic.Constraints(wanted, corridor=boxes)).solve(T)
        if esdf.certify(field, position_trajectory(spline), options.clearance_m).passed:
            return Path(spline, route.waypoint, "corridor")
    except InfeasibleError:
        pass
    states = np.zeros((len(route.points), hermite.ORDER, 3))
    states[:, 0] = route.points
    return Path(minimum_snap.Spline(T, states, np.empty(0)), route.waypoint, "stop and go")


def time_scale(trajectory: Trajectory, vehicle: Vehicle, bounds: Limits, *, step_s: float = _COARSE_S) -> float:
    """The factor on all times at which the first limit is just used: above 1 slows down, below 1 speeds up.

    The way through space stays the same, and every limit eases with more time. How fast each one does is known well
    enough (speed with the time, acceleration with its square...) for a few steps to find the factor.

    Raises:
        InfeasibleError: no factor up to fifty keeps the limits.
    """
    hover = float(flatness.state(vehicle, trajectory, np.zeros(1)).rotor_speed_rad_s.mean())
    factor, safe = 1.0, np.inf
    for _ in range(12):
        checks = limits.check(trajectory.scale_time(factor), vehicle, bounds, step_s=step_s * factor)
        step = max(_time_share(c, hover) for c in checks)
        if step <= 1.0:
            safe = min(safe, factor)
        if 1.0 - 2.0 * _SPARE < step <= 1.0 or factor > 50.0:
            break
        # A hair more than predicted, or the factor would creep up on the bound from the wrong side for ever.
        aimed = factor * float(np.clip(step * (1.0 + _SPARE), 0.5, 2.0))
        factor = min(aimed, 0.5 * (factor + safe)) if step > 1.0 else aimed
    if not np.isfinite(safe):
        raise InfeasibleError("a limit is exceeded even at a small fraction of the speed; can the vehicle hover?")
    return safe


_EASING = {"acceleration": 2.0, "tilt": 2.0, "roll and pitch rate": 3.0, "rotor speed": 2.0, "slowest rotor": 2.0}
"""Power of the time with which each limit eases; 1 for the others."""


def _time_share(check: limits.Check, hover_rad_s: float) -> float:
    """By what factor times must grow (or may shrink, below 1) for this check alone to be met exactly."""
    if not np.isfinite(check.value):
        return 1.5
    share = check.value / check.bound
    if check.name in ("rotor speed", "slowest rotor"):  # what counts is the way from hover to the bound
        share = max((check.value - hover_rad_s) / (check.bound - hover_rad_s), 0.0)
    return float(share ** (1.0 / _EASING.get(check.name, 1.0)))


def slower(spline: minimum_snap.Spline, factor: float) -> minimum_snap.Spline:
    """The same way with all times multiplied."""
    states: FloatArray = spline.states / (factor ** np.arange(hermite.ORDER))[:, None]
    return minimum_snap.Spline(spline.durations_s * factor, states, np.empty(0))
