"""Bry's planner as published: minimum-snap polynomials through the fewest waypoints of a sampled way round obstacles.

Bry, Richter, Bachrach and Roy (2015), "Aggressive flight of fixed-wing and quadrotor aircraft in dense indoor
environments", IJRR 34(7), section 5: a straight-line way from RRT*, pruned to its corners; a quadratic program for the
polynomials; times by gradient descent on snap plus k_T times the total time; where a polynomial collides, one more
waypoint half-way along the straight line there, and again; at last all times scaled until the vehicle can fly it.
It stands beside our own method as a comparison; it sees no obstacle while it chooses times.
"""

import numpy as np

from flight import FloatArray, portable
from planner._planner import StopFlag
from planner.curve import minimum_snap
from planner.optimise import quadratic
from planner.request import space
from planner.request.options import PlanInfeasibleError, PlanOptions, check_stop
from planner.route.routes import Route

TIME_PRICE = 500.0
"""k_T, the price of a second, m^2/s^7. Snap goes with T^-7, so another price scales all times by the same factor; what
is flown is scaled to the vehicle's limits in the end."""
_ROUNDS = 12
"""How often colliding polynomials are cut in two: the last ones are then short enough to be straight."""
_STEPS = 200
_PRECISION = 1e-5
"""Descent ends where a step lowers the cost by less than this share."""
_SPACING_M = 0.02
"""Distance between the points at which a polynomial is looked at for collisions, before the gate does so exactly."""


def solve(
    route: Route, field: space.DistanceField, options: PlanOptions, stop: StopFlag | None
) -> tuple[minimum_snap.Spline, Route]:
    """The free polynomials through the route's corners, and the route with the waypoints that were put in.

    Raises:
        PlanInfeasibleError: polynomials still collide when the waypoints are very close together.
        PlanCancelledError: `stop` was set.
    """
    T = np.linalg.norm(np.diff(route.points, axis=0), axis=1)
    for _ in range(_ROUNDS):
        spline = allocate(route.points, T, stop)
        colliding = _colliding(spline, field, options.planned_clearance_m)
        if not colliding.any():
            return spline, route
        route, T = _with_middles(route, spline.durations_s, colliding)
    raise PlanInfeasibleError(
        f"Bry's method still collides after {_ROUNDS} rounds of added waypoints",
        "use method fastest, or lower margin_m",
        route.leg(int(np.argmax(colliding))),
    )


def allocate(points: FloatArray, durations_s: FloatArray, stop: StopFlag | None = None) -> minimum_snap.Spline:
    """Least snap plus k_T times the total time through `points` (k + 1, 3), by gradient descent with backtracking."""
    program = quadratic.SnapProgram(quadratic.Constraints(points))
    spline = program.solve(durations_s)
    # The best common factor on all times is known: 7 snap = k_T sum(T).
    longer = np.sqrt(np.sqrt(np.sqrt(7.0 * spline.snap_cost() / (TIME_PRICE * durations_s.sum()))))
    spline = program.solve(durations_s * longer)
    size = 0.1
    for _ in range(_STEPS):
        check_stop(stop)
        cost, slope = cost_and_gradient(spline)
        downhill = -slope * spline.durations_s  # by log T, so that times stay positive
        downhill /= np.abs(downhill).max(initial=1e-12)
        while size > 1e-4:
            shorter = program.solve(spline.durations_s * portable.exponential(size * downhill))
            if cost_and_gradient(shorter)[0] < cost:
                break
            size *= 0.5
        else:
            return spline
        gain, spline, size = cost - cost_and_gradient(shorter)[0], shorter, 1.5 * size
        if gain < _PRECISION * cost:
            return spline
    return spline


def cost_and_gradient(spline: minimum_snap.Spline) -> tuple[float, FloatArray]:
    """Snap plus k_T times the total time, and its derivative by each duration (k,).

    The polynomials are optimal for these times, so what they change by adds nothing to first order (envelope theorem).
    """
    T, d = spline.durations_s, minimum_snap.segment_states(spline.states)
    exponents = minimum_snap.POWERS[:, None] + minimum_snap.POWERS[None, :] - 7
    by_T = exponents * minimum_snap.energy(T) / T[:, None, None]
    slope = np.einsum("kax,kab,kbx->k", d, by_T, d) + TIME_PRICE
    return spline.snap_cost() + TIME_PRICE * float(T.sum()), slope


def _colliding(spline: minimum_snap.Spline, field: space.DistanceField, required_m: float) -> np.ndarray:
    """(k,) bool: which polynomials come closer to obstacles than allowed."""
    scaled = minimum_snap.segment_states(spline.states) * minimum_snap.time_powers(spline.durations_s)[..., None]
    # the control points' polygon is at least as long as the curve
    polygon = np.diff(portable.product(quadratic.control_points(0), scaled), axis=1)
    counts = np.ceil(np.linalg.norm(polygon, axis=2).sum(axis=1) / _SPACING_M).astype(int) + 1
    M = minimum_snap.monomials_from_states()
    rows = [portable.product(minimum_snap.basis(np.linspace(0.0, 1.0, n), 0), M) for n in counts]
    points = np.concatenate([portable.product(row, ends) for row, ends in zip(rows, scaled, strict=True)])
    first = np.concatenate([[0], np.cumsum(counts)[:-1]])
    return np.minimum.reduceat(space.distance(field, points), first) < required_m


def _with_middles(route: Route, durations_s: FloatArray, colliding: np.ndarray) -> tuple[Route, FloatArray]:
    """The route with a point half-way along each colliding line, and half the time for each half."""
    at = np.flatnonzero(colliding) + 1
    middles = 0.5 * (route.points[at - 1] + route.points[at])
    T = np.repeat(np.where(colliding, 0.5, 1.0) * durations_s, np.where(colliding, 2, 1))
    return Route(np.insert(route.points, at, middles, axis=0), np.insert(route.waypoint, at, -1)), T
