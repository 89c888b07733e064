"""What is done about a path that comes too close or asks too much: bend it, box it in, slow it down."""

from dataclasses import dataclass, replace

import numpy as np

import esdf
from flight import FloatArray, InfeasibleError, Trajectory
from planner import corridor, hermite, limits, minimum_snap, quadratic, space, time_allocation
from planner.options import PlanOptions
from planner.routes import Route
from planner.time_allocation import Problem, Solution
from vehicle import Limits, Vehicle

_COARSE_S = 0.03
"""Sampling of the limits while a time scale is looked for; the gate samples finer."""
_CRITICAL = 12
"""Instants per limit that are watched while the time is scaled: those that came nearest to it."""
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
        aim += float(np.clip(lack, 0.002, 0.01))
        problem = time_allocation.with_weights(
            replace(problem, knots=solution.knots, clearance_m=aim), clearance=problem.weights.clearance * 4.0
        )
        solution = time_allocation.optimise(problem, solution.durations_s, iterations=80)
    return None


def through_corridor(route: Route, durations_s: FloatArray, field: space.DistanceField, options: PlanOptions) -> Path:
    """The smoothest path inside proved boxes round the route; straight lines with stops if even that fails.

    The route itself is free, so there always is an answer; it is slower than a bent path.

    Args:
        durations_s: one for each line of the route; only their proportions matter.
    """
    T = durations_s
    pinned = route.waypoint >= 0
    wanted = np.where(pinned[:, None], route.points, np.nan)
    boxes = corridor.boxes(field, route.points, options.planned_clearance_m)
    try:
        spline = quadratic.SnapProgram(quadratic.Constraints(wanted, corridor=boxes)).solve(T)
        if esdf.certify(field, position_trajectory(spline), options.clearance_m).passed:
            return Path(spline, route.waypoint, "corridor")
    except InfeasibleError:
        pass
    states = np.zeros((len(route.points), hermite.ORDER, 3))
    states[:, 0] = route.points
    return Path(minimum_snap.Spline(T, states, np.empty(0)), route.waypoint, "stop and go")


def time_scale(trajectory: Trajectory, vehicle: Vehicle, bounds: Limits) -> float:
    """The factor on all times at which the first limit is just used: above 1 slows down, below 1 speeds up.

    The way through space stays the same, and every limit eases with more time. How fast each one does is known well
    enough (speed with the time, acceleration with its square...) for a few steps to find the factor; and it is the
    same instants that matter all along, so only the first look is at the whole trajectory.

    Raises:
        InfeasibleError: no factor up to fifty keeps the limits.
    """
    times, _ = limits.sample_times(trajectory, _COARSE_S)
    shares = limits.time_shares(trajectory, vehicle, bounds, times)
    critical = times[np.unique(np.argsort(shares, axis=1)[:, -_CRITICAL:])]
    factor, safe, worst = 1.0, np.inf, float(shares.max())
    for _ in range(15):
        if worst <= 1.0:
            safe = min(safe, factor)
        if 1.0 - 2.0 * _SPARE < worst <= 1.0 or factor > 50.0:
            break
        # A hair more than predicted, or the factor would creep up on the bound from the wrong side for ever.
        aimed = factor * float(np.clip(worst * (1.0 + _SPARE), 0.5, 2.0))
        factor = min(aimed, 0.5 * (factor + safe)) if worst > 1.0 else aimed
        worst = float(limits.time_shares(trajectory.scale_time(factor), vehicle, bounds, critical * factor).max())
    if not np.isfinite(safe):
        raise InfeasibleError("a limit is exceeded even at a small fraction of the speed; can the vehicle hover?")
    return safe
