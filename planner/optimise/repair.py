"""What is done about a path that the optimiser could not make fast: box it in, slow it down."""

from dataclasses import replace

import numpy as np

from flight import FloatArray, InfeasibleError, Trajectory, portable
from planner.curve import minimum_snap
from planner.gate import instants, limits
from planner.gate.gate import AskGate, GateReport
from planner.optimise import quadratic
from planner.optimise.fastest import Path
from planner.request.inputs import Request
from planner.request.options import PlanInfeasibleError, StopFlag
from planner.route import corridor
from planner.route.routes import Route
from vehicle import Limits, Vehicle

_COARSE_S = 0.03
"""Sampling of the limits while a time scale is looked for; the gate samples finer."""
_CRITICAL = 12
"""Instants per limit that are watched while the time is scaled: those that came nearest to it."""
_SPARE = 0.003
"""Share of the time that is given away, for what the coarse sampling does not see."""
_SLOWER = (1.005, 1.015, 1.04, 1.1, 1.3)
"""Factors on the time that are tried where the gate, with its finer samples, finds a limit exceeded."""

_OF_LEGS = "speed of legs", "jerk of legs"
"""Checks of the gate about what is asked for on legs, which more time passes as it does those of limits."""


def through_corridor(
    route: Route, boxes: list[corridor.Box], durations_s: FloatArray, stop: StopFlag | None
) -> minimum_snap.Spline:
    """The smoothest path (x, y, z) inside proved boxes round the route, one knot for each point of the route.

    Straight lines with stops would keep the boxes, so there is such a path at any times; only their proportions matter.

    Args:
        durations_s: one for each line of the route.

    Raises:
        PlanInfeasibleError: the quadratic program found no answer.
        PlanCancelledError: `stop` was set.
    """
    wanted = np.where((route.waypoint >= 0)[:, None], route.points, np.nan)
    # The boxes keep 2 mm more than is required; half of that is left to the solver, which is slow to the last digits.
    constraints = quadratic.Constraints(wanted, corridor=boxes, residual=1e-3)
    try:
        return quadratic.SnapProgram(constraints).solve(durations_s, stop)
    except InfeasibleError as error:
        raise PlanInfeasibleError(str(error), "lower margin_m, or add waypoints where it is narrow") from error


def slowed(path: Path, request: Request, ask_gate: AskGate) -> Path:
    """The same way through space in the time that just keeps every limit: the last resort, as all segments pay."""
    factor = max(time_scale(path.trajectory, request.vehicle, request.limits), _leg_scale(path.report))
    for more in (1.0, *_SLOWER):
        trajectory = path.trajectory.scale_time(factor * more)
        optimum = replace(path.optimum, converged=False)
        slower = replace(path, trajectory=trajectory, report=ask_gate(trajectory, None), optimum=optimum, kept=None)
        if slower.report.passed or not all(
            check.name in (*limits.NAMES, *_OF_LEGS) for check in slower.report.failures
        ):
            break
    return slower


def _leg_scale(report: GateReport) -> float:
    """The factor on all times at which what is asked for on legs is just kept; 0 where nothing is."""
    shares = {check.name: check.ratio for check in report.checks if check.name in _OF_LEGS}
    jerk = shares.get("jerk of legs", 0.0)
    by_jerk = float(portable.exponential(portable.logarithm(jerk) / 3.0)) if jerk > 0.0 else 0.0
    return max(shares.get("speed of legs", 0.0), by_jerk)


def time_scale(trajectory: Trajectory, vehicle: Vehicle, bounds: Limits) -> float:
    """The factor on all times at which the first limit is just used: above 1 slows down, below 1 speeds up.

    The way through space stays the same, and every limit eases with more time. How fast each one does is known well
    enough (speed with the time, acceleration with its square...) for a few steps to find the factor; and it is the
    same instants that matter all along, so only the first look is at the whole trajectory.

    Raises:
        PlanInfeasibleError: no factor up to fifty keeps the limits.
    """
    times, _ = instants.sample_times(trajectory, _COARSE_S)
    shares = instants.time_shares(trajectory, vehicle, bounds, times)
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
        worst = float(instants.time_shares(trajectory.scale_time(factor), vehicle, bounds, critical * factor).max())
    if not np.isfinite(safe):
        used = limits.usage(trajectory.scale_time(factor), vehicle, bounds, step_s=_COARSE_S * factor)
        limit, segment = np.unravel_index(int(np.argmax(np.nan_to_num(used.share, nan=np.inf))), used.share.shape)
        text = limits.excess_text(used, int(limit), int(segment), trajectory.scale_time(factor))
        raise PlanInfeasibleError(f"even {factor:.0f} times as slow, {text}", "check the vehicle's limits")
    return safe
