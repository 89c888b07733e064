"""How long each segment takes, and where the free knots lie: the fastest path within limits, clear of obstacles.

The path is always the minimum-snap spline of its knots and times, so the unknowns are few: the logarithms of the times
and the positions of the knots no pilot asked for. Gradients are exact (adjoint: one more back-substitution).
"""

from dataclasses import astuple, dataclass, replace

import numpy as np

from flight import FloatArray
from planner import hermite, minimum_snap, penalty, space
from planner._planner import running_cost as kernel_cost

_SAMPLES = 16
"""Points per segment where limits and clearance are looked at."""
_U = (np.arange(_SAMPLES) + 0.5) / _SAMPLES
_SAMPLE_FROM_STATES = np.stack([hermite.basis(_U, r) @ hermite.monomials_from_states() for r in range(5)])


@dataclass(frozen=True, slots=True)
class Weights:
    """Price of each quantity, in seconds of flight."""

    snap: float = 0.0
    """Per m^2/s^7 of squared snap."""
    limits: float = 300.0
    """Per second at one unit of squared relative excess over a limit."""
    clearance: float = 3000.0
    """Per second at 1 m^2 of squared lack of clearance."""


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """What is given: knots, which of them may move, limits, obstacles, and how far to stay from them."""

    knots: FloatArray
    """(k + 1, 3) where each knot is, or starts from."""
    free: np.ndarray
    """(k + 1,) bool, whether the optimiser may move it."""
    bounds: penalty.Bounds
    field: space.DistanceField
    clearance_m: float
    weights: Weights


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """Where the optimiser stopped."""

    knots: FloatArray
    durations_s: FloatArray
    spline: minimum_snap.Spline
    cost: float
    evaluations: int
    converged: bool


def cost_and_gradient(
    problem: Problem, knots: FloatArray, durations_s: FloatArray
) -> tuple[float, FloatArray, FloatArray, minimum_snap.Spline]:
    """The cost, its gradient by durations (k,) and by knot positions (k + 1, 3), and the spline.

    With K x = r the conditions for minimum snap, dJ = (dJ/dx) dx, and K dx = dr - dK x: one solve with K of dJ/dx
    gives the multipliers of all parameters at once.
    """
    T = durations_s
    states = np.zeros((len(T) + 1, hermite.ORDER, 3))
    states[:, 0] = knots
    spline = minimum_snap.solve_states(states, T)
    d = hermite.segment_states(spline.states)
    value, by_d, by_T = _running_cost(problem, d, T)
    H = minimum_snap.energy(T)
    Hd = H @ d
    snap = float(np.sum(d * Hd))
    value += float(np.sum(T)) + problem.weights.snap * snap
    by_T += 1.0
    # dH/dT: every entry of H is a constant times T^(powers - 7)
    exponents = hermite.POWERS[:, None] + hermite.POWERS[None, :] - 7
    dHd = (H * (exponents / T[:, None, None])) @ d
    by_T += problem.weights.snap * np.einsum("kax,kax->k", d, dHd)
    by_d += 2.0 * problem.weights.snap * Hd
    by_states = np.zeros_like(spline.states)
    by_states[:-1] += by_d[:, :4]
    by_states[1:] += by_d[:, 4:]
    multipliers = hermite.segment_states(spline.solve_adjoint(by_states))
    by_T -= np.einsum("kax,kax->k", multipliers, dHd)
    pull = H @ multipliers
    by_knots = by_states[:, 0]
    by_knots[:-1] -= pull[:, 0]
    by_knots[1:] -= pull[:, 4]
    return value, by_T, by_knots, spline


def _running_cost(problem: Problem, d: FloatArray, T: FloatArray) -> tuple[float, FloatArray, FloatArray]:
    """Integral of the penalties over the path, with gradients by segment states (k, 8, 3) and durations (k,)."""
    near, by_position = _priced_clearance(problem, d, T)
    by_d, by_T = np.empty_like(d), np.empty_like(T)
    bounds = np.array(astuple(problem.bounds))
    value = kernel_cost(d, T, _SAMPLE_FROM_STATES, bounds, problem.weights.limits, near, by_position, by_d, by_T)
    return value, by_d, by_T


def running_cost_numpy(problem: Problem, d: FloatArray, T: FloatArray) -> tuple[float, FloatArray, FloatArray]:
    """The plain twin of the kernel."""
    near, by_position = _priced_clearance(problem, d, T)
    S = hermite.time_powers(T)
    scaled = d * S[..., None]
    rates = [1.0 / T**r for r in range(5)]
    motion = [rates[r][:, None, None] * (_SAMPLE_FROM_STATES[r] @ scaled) for r in range(5)]
    step, price = T / _SAMPLES, problem.weights.limits
    limits = penalty.dynamics(motion[1], motion[2], motion[3], motion[4], problem.bounds)
    density = price * limits.value + near
    value = float(np.sum(step * density.sum(axis=1)))
    others = (limits.by_velocity, limits.by_acceleration, limits.by_jerk, limits.by_snap)
    by_T = density.sum(axis=1) / _SAMPLES
    by_scaled = np.zeros_like(scaled)
    for r, gradient in enumerate([by_position, *(price * g for g in others)]):
        by_scaled += (step * rates[r])[:, None, None] * (_SAMPLE_FROM_STATES[r].T @ gradient)
        by_T -= step * r / T * np.einsum("ksx,ksx->k", gradient, motion[r])
    by_T += np.einsum("kax,kax,ka->k", by_scaled, d, hermite.POWERS * S / T[:, None])
    return value, by_scaled * S[..., None], by_T


def _priced_clearance(problem: Problem, d: FloatArray, T: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Price of the positions at the samples (k, s), and its gradient (k, s, 3)."""
    positions = _SAMPLE_FROM_STATES[0] @ (d * hermite.time_powers(T)[..., None])
    near, by_position = _clearance(problem, positions)
    return problem.weights.clearance * near, problem.weights.clearance * by_position


def _clearance(problem: Problem, positions: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Squared lack of clearance (k, s) and its gradient (k, s, 3)."""
    if problem.weights.clearance <= 0.0:
        return np.zeros(positions.shape[:2]), np.zeros_like(positions)
    d, gradient = space.distance_and_gradient(problem.field, positions.reshape(-1, 3))
    unknown = ~(np.isfinite(d) & np.isfinite(gradient).all(axis=1))
    if unknown.any():
        # No field there: draw the path back to the line between its knots, which is known to be free.
        back = (_chords(problem.knots) - positions).reshape(-1, 3)[unknown]
        size = np.linalg.norm(back, axis=1)
        gradient = gradient.copy()
        gradient[unknown] = back / np.maximum(size, 1e-9)[:, None]
        d = np.where(unknown, 0.0, d)
        d[unknown] = -size
    lack = np.maximum(problem.clearance_m - d, 0.0)
    return (lack**2).reshape(positions.shape[:2]), (-2.0 * lack[:, None] * gradient).reshape(positions.shape)


def _chords(knots: FloatArray) -> FloatArray:
    return knots[:-1, None] + _U[None, :, None] * (knots[1:] - knots[:-1])[:, None]


def optimise(problem: Problem, durations_s: FloatArray, *, iterations: int = 300, precision: float = 1e-6) -> Solution:
    """Minimise over log durations and free knots with L-BFGS, from `durations_s`."""
    from scipy.optimize import minimize

    k = len(durations_s)
    free = np.flatnonzero(problem.free)

    def unpack(z: FloatArray) -> tuple[FloatArray, FloatArray]:
        knots = problem.knots.copy()
        knots[free] = z[k:].reshape(-1, 3)
        return knots, np.exp(z[:k])

    def evaluate(z: FloatArray) -> tuple[float, FloatArray]:
        knots, T = unpack(z)
        value, by_T, by_knots, _ = cost_and_gradient(problem, knots, T)
        return value, np.concatenate([by_T * T, by_knots[free].ravel()])

    start = np.concatenate([np.log(durations_s), problem.knots[free].ravel()])
    box = [(-5.0, 6.0)] * k + [(None, None)] * (3 * len(free))
    options = {"maxiter": iterations, "ftol": precision, "gtol": 1e-6, "maxcor": 30}
    found = minimize(evaluate, start, jac=True, method="L-BFGS-B", bounds=box, options=options)
    knots, T = unpack(found.x)
    spline = minimum_snap.solve(knots, T)
    return Solution(knots, T, spline, float(found.fun), int(found.nfev), bool(found.success))


def with_weights(problem: Problem, **changes: float) -> Problem:
    """The same problem with other prices."""
    return replace(problem, weights=replace(problem.weights, **changes))
