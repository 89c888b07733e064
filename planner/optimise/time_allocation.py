"""How long each segment takes, where the free knots lie and where the vehicle looks: the fastest path within limits.

The path is always the minimum-snap spline of its knots and times, so the unknowns are few: the logarithms of the times,
the positions of the knots no pilot asked for, and the headings that are open. Gradients are exact (adjoint: one more
back-substitution); the minimiser is compiled, and may be stopped from another thread.
"""

from dataclasses import astuple, dataclass, replace

import numpy as np

from flight import FloatArray
from planner._planner import Problem as Kernel
from planner._planner import StopFlag
from planner.curve import minimum_snap
from planner.optimise import airframe
from planner.optimise.airframe import Airframe
from planner.request import space
from planner.request.options import check_stop

SAMPLES = 11
"""Points per segment where limits and clearance are looked at, both ends among them."""
_BETWEEN = 4
"""Steps from one of them to the next in which their peaks are looked for."""
FRACTIONS = np.linspace(0.0, 1.0, SAMPLES)
"""Where in a segment they are."""
_SHARES = np.where((FRACTIONS == 0.0) | (FRACTIONS == 1.0), 0.5, 1.0) / (SAMPLES - 1)
"""Of a segment's time, for each sample."""
_SLOW_M_S = 0.5
"""Horizontal speed at which looking along the path counts half, and speed at which passing a gate along its normal
does."""
_LEAST_AHEAD = 0.35
"""Cosine of the largest angle between the velocity in a gate and its normal that costs nothing."""


@dataclass(frozen=True, slots=True)
class Weights:
    """Price of each quantity, in seconds of flight."""

    snap: float = 0.0
    """Per m^2/s^7 of squared snap."""
    limits: float = 300.0
    """Per second at one unit of squared relative excess over a limit."""
    clearance: float = 3000.0
    """Per second at 1 m^2 of squared lack of clearance."""
    heading: float = 0.0
    """Per second of looking across the path (twice as much for looking back)."""
    turning: float = 0.0
    """Per second at 1 rad/s of yaw."""


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """What is given: knots, which of them may move, limits, obstacles, and how far to stay from them."""

    knots: FloatArray
    """(k + 1, 4) x, y, z and yaw where each knot is, or starts from."""
    free: np.ndarray
    """(k + 1, 4) bool, what the optimiser may move."""
    airframe: Airframe
    field: space.DistanceField
    clearance_m: float
    weights: Weights
    offsets: FloatArray | None = None
    """(k, SAMPLES, limits) added to each excess: what the vehicle's own model says beyond the reduced one."""
    reference_s: FloatArray | None = None
    """(k,) time over which each segment's excess is charged, whatever its own becomes; None for its own. With the
    multipliers of an augmented Lagrangian among the offsets, which are charged within the limits too, a segment would
    else cost less the shorter it is."""
    speed_m_s: FloatArray | None = None
    """(k,) speed limit of each segment; the airframe's own if None."""
    jerk_m_s3: FloatArray | None = None
    """(k,) the same of jerk."""
    farther_m: FloatArray | None = None
    """(k,) clearance that each segment aims at beyond `clearance_m`."""
    start: FloatArray | None = None
    """(3, 4) velocity, acceleration and jerk at the first knot; at rest if None."""
    end: FloatArray | None = None
    """The same at the last knot."""
    velocity: FloatArray | None = None
    """(k + 1, 4) velocity and yaw rate to be had at inner knots; rows of NaN are open."""
    balls: FloatArray | None = None
    """(k + 1, 4) centre and radius of balls that free knots should not leave; a radius of 0 is none."""
    gates: FloatArray | None = None
    """(k + 1, 3, 3) openings in whose planes free knots move and which they should not leave: centre, and from there to
    the middle of the left and of the upper edge; zero edges are none."""
    target_world_m: FloatArray | None = None
    """(3,) point that the vehicle looks at, instead of along its path."""
    heading_held: bool = False
    """Whether the heading is constant, and not only given at knots."""

    @property
    def aim_m(self) -> FloatArray:
        """(k,) the clearance that each segment aims at."""
        return np.full(len(self.knots) - 1, self.clearance_m) + (0.0 if self.farther_m is None else self.farther_m)

    def spline(self, knots: FloatArray, durations_s: FloatArray) -> minimum_snap.Spline:
        """The spline of least snap through these knots, with the derivatives that are given."""
        return minimum_snap.solve(knots, durations_s, start=self.start, end=self.end, velocity=self.velocity)

    def free_states(self) -> np.ndarray:
        """(k + 1, 4, 4) bool: which numbers of the knots' states may move; all derivatives that are not given."""
        free = np.ones((len(self.knots), minimum_snap.ORDER, 4), dtype=bool)
        free[[0, -1]] = False
        free[:, 0] = self.free
        if self.velocity is not None:
            free[np.isfinite(self.velocity).all(axis=1), 1] = False
        free[:, 1:, 3] &= not self.heading_held
        return free

    def part(self, first: int, last: int, spline: minimum_snap.Spline) -> "Problem":
        """The segments from knot `first` to knot `last` alone; both keep the state they have in the spline."""
        free = self.free[first : last + 1].copy()
        free[[0, -1]] = False
        return replace(
            self,
            knots=spline.states[first : last + 1, 0].copy(),
            free=free,
            offsets=None if self.offsets is None else self.offsets[first:last],
            reference_s=None if self.reference_s is None else self.reference_s[first:last],
            speed_m_s=None if self.speed_m_s is None else self.speed_m_s[first:last],
            jerk_m_s3=None if self.jerk_m_s3 is None else self.jerk_m_s3[first:last],
            farther_m=None if self.farther_m is None else self.farther_m[first:last],
            start=spline.states[first, 1:],
            end=spline.states[last, 1:],
            velocity=None if self.velocity is None else self.velocity[first : last + 1],
            balls=None if self.balls is None else self.balls[first : last + 1],
            gates=None if self.gates is None else self.gates[first : last + 1],
        )


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """Where the optimiser ended."""

    knots: FloatArray
    durations_s: FloatArray
    spline: minimum_snap.Spline
    cost: float
    evaluations: int
    converged: bool
    residual: float = np.nan
    """Share of the cost that the quadratic model still promises."""


def cost_and_gradient(
    problem: Problem, knots: FloatArray, durations_s: FloatArray
) -> tuple[float, FloatArray, FloatArray]:
    """The cost, its gradient by durations (k,) and by knots (k + 1, 4)."""
    by_knots, by_durations = np.empty_like(knots), np.empty_like(durations_s)
    cost = _kernel(problem).evaluate(knots, durations_s, by_knots, by_durations)
    return cost, by_durations, by_knots


def slopes(problem: Problem, spline: minimum_snap.Spline) -> tuple[float, FloatArray, FloatArray]:
    """The cost of any spline, its gradient by the knot states (k + 1, 4, 4) and by the log durations (k,)."""
    by_states, by_log_durations = np.empty_like(spline.states), np.empty_like(spline.durations_s)
    states = np.ascontiguousarray(spline.states)
    cost = _kernel(problem).slopes(states, spline.durations_s, by_states, by_log_durations)
    return cost, by_states, by_log_durations


def cost_numpy(problem: Problem, knots: FloatArray, durations_s: FloatArray) -> float:
    """The NumPy reference of the cost."""
    T, weights = durations_s, problem.weights
    spline = problem.spline(knots, T)
    motion = minimum_snap.derivatives(spline, FRACTIONS)
    over = excess_numpy(problem, motion)
    if problem.offsets is not None:
        over = over + problem.offsets
    density = weights.limits * (np.maximum(over, 0.0) ** 2).sum(axis=2)
    if problem.reference_s is not None:
        density *= (problem.reference_s / T)[:, None]
    aim, yaw = motion[:, :, 1, :2], motion[:, :, 0, 3]
    if problem.target_world_m is not None:
        aim = problem.target_world_m[:2] - motion[:, :, 0, :2]
    pace, ahead = np.sqrt((aim**2).sum(axis=2) + 1e-6), aim[..., 0] * np.cos(yaw) + aim[..., 1] * np.sin(yaw)
    density += weights.heading * pace * (pace - ahead) / ((aim**2).sum(axis=2) + _SLOW_M_S**2)
    density += weights.turning * motion[:, :, 1, 3] ** 2
    if weights.clearance > 0.0:
        distances = space.around_path(problem.field, problem.knots[:, :3], problem.aim_m.max())
        there = distances(motion[:, :, 0, :3].reshape(-1, 3))[0].reshape(density.shape)
        density += weights.clearance * np.maximum(problem.aim_m[:, None] - there, 0.0) ** 2
    position = minimum_snap.Spline(T, spline.states[..., :3])
    outside = 0.0
    if problem.balls is not None and (there := problem.balls[:, 3] > 0.0).any():
        off = knots[there, :3] - problem.balls[there, :3]
        outside = (np.maximum((off**2).sum(axis=1) / problem.balls[there, 3] ** 2 - 1.0, 0.0) ** 2).sum()
    if problem.gates is not None and (there := problem.gates[:, 1:].any(axis=(1, 2))).any():
        edges, off = problem.gates[there, 1:], knots[there, :3] - problem.gates[there, 0]
        share = np.einsum("nex,nx->ne", edges, off) / (edges**2).sum(axis=2)
        outside += (np.maximum(share**2 - 1.0, 0.0) ** 2).sum() + _slant(spline.states[there, 1, :3], edges)
    return float(
        weights.limits * outside + T.sum() + (T * (density @ _SHARES)).sum() + weights.snap * position.snap_cost()
    )


def _slant(velocity_m_s: FloatArray, edges_m: FloatArray) -> float:
    """The squared lack (n,) of velocity along the normals of gates, as a share of the speed, summed."""
    normal = np.cross(edges_m[:, 0], edges_m[:, 1])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    share = (velocity_m_s * normal).sum(axis=1) / np.sqrt((velocity_m_s**2).sum(axis=1) + _SLOW_M_S**2)
    return float((np.maximum(_LEAST_AHEAD - share, 0.0) ** 2).sum())


def excess_numpy(problem: Problem, motion: FloatArray) -> FloatArray:
    """The NumPy reference of the relative excess (k, SAMPLES, limits), from the derivatives there."""
    over = airframe.excess_numpy(problem.airframe, motion.reshape(-1, 5, 4)).reshape(*motion.shape[:2], -1)
    for order, name, most in ((1, "speed", problem.speed_m_s), (3, "jerk", problem.jerk_m_s3)):
        if most is not None:
            square = (motion[:, :, order, :3] ** 2).sum(axis=2)
            over[:, :, problem.airframe.names.index(name)] = square / most[:, None] ** 2 - 1.0
    return over


def excess(problem: Problem, spline: minimum_snap.Spline) -> tuple[FloatArray, FloatArray]:
    """Relative excess over each limit as the optimiser sees it, without the offsets: two arrays (k, SAMPLES, limits).

    Returns:
        At each sample, and the largest up to half-way to the next ones.
    """
    segments, half = len(spline.durations_s), _BETWEEN // 2
    fine = np.empty((segments, (SAMPLES - 1) * _BETWEEN + 1, len(problem.airframe.names)))
    _kernel(problem, fine.shape[1]).excess(spline.states, spline.durations_s, fine)
    around = np.pad(fine, ((0, 0), (half, half), (0, 0)), mode="edge")
    peaks = np.max([around[:, i : i + fine.shape[1] : _BETWEEN] for i in range(2 * half + 1)], axis=0)
    return fine[:, ::_BETWEEN], peaks


def optimise(
    problem: Problem,
    durations_s: FloatArray,
    *,
    iterations: int = 300,
    precision: float = 1e-6,
    samples: int = SAMPLES,
    stop: StopFlag | None = None,
) -> Solution:
    """Minimise over log durations and free knots with L-BFGS, from `durations_s`.

    Args:
        samples: of each segment, both ends among them; offsets hold for `SAMPLES` only.

    Raises:
        PlanCancelledError: `stop` was set.
    """
    knots, T = problem.knots.copy(), np.array(durations_s, dtype=np.float64)
    free = np.ascontiguousarray(problem.free, dtype=np.uint8)
    cost, evaluations, converged, stopped = _kernel(problem, samples).minimise(
        knots, T, free, iterations, precision, stop
    )
    if stopped:
        check_stop(stop)
    return Solution(knots, T, problem.spline(knots, T), cost, evaluations, converged)


def refine(
    problem: Problem,
    spline: minimum_snap.Spline,
    *,
    iterations: int = 100,
    precision: float = 1e-5,
    hold: float = 0.0,
    stop: StopFlag | None = None,
) -> Solution:
    """Minimise over log durations, free knots and the derivatives at inner knots, from `spline`.

    Gauss and Newton's method with the damping of Levenberg and Marquardt: unlike `optimise`, the path need not be the
    one of least snap through its knots. It has converged where its quadratic model, hardly damped, promises to lower
    the cost by less than `precision` of it, or four steps in a row together lowered it by less.

    Args:
        hold: price, in s/m^2, of squared distance from `spline`.

    Raises:
        PlanCancelledError: `stop` was set.
    """
    states, T = spline.states.copy(), spline.durations_s.copy()
    free = problem.free_states().astype(np.uint8)
    cost, evaluations, converged, stopped, residual = _kernel(problem).refine(
        states, T, free, iterations, precision, hold, stop
    )
    if stopped:
        check_stop(stop)
    return Solution(states[:, 0].copy(), T, minimum_snap.Spline(T, states), cost, evaluations, converged, residual)


def _kernel(problem: Problem, samples: int = SAMPLES) -> Kernel:
    packed, prices = _packed(problem.airframe), np.array(astuple(problem.weights))
    given = minimum_snap.given(problem.knots, problem.start, problem.end, problem.velocity)
    aim_m = problem.aim_m
    distances = space.around_path(problem.field, problem.knots[:, :3], float(aim_m.max()))
    kernel = Kernel(len(problem.knots) - 1, samples, packed, prices, aim_m, distances)
    kernel.set_given(*given)
    if problem.speed_m_s is not None:
        kernel.set_speeds(np.ascontiguousarray(problem.speed_m_s))
    if problem.jerk_m_s3 is not None:
        kernel.set_jerks(np.ascontiguousarray(problem.jerk_m_s3))
    if problem.balls is not None:
        kernel.set_balls(np.ascontiguousarray(problem.balls))
    if problem.gates is not None:
        kernel.set_gates(np.ascontiguousarray(problem.gates))
    if problem.target_world_m is not None:
        kernel.look_at(*problem.target_world_m[:2].tolist())
    if problem.offsets is not None and samples == SAMPLES:
        kernel.set_offsets(np.ascontiguousarray(problem.offsets))
    if problem.reference_s is not None:
        kernel.set_reference(np.ascontiguousarray(problem.reference_s))
    return kernel


def _packed(w: Airframe) -> FloatArray:
    """(14 + 7 r,) in the order of the kernel's struct (planner/src/airframe.hpp)."""
    first = [w.speed_m_s, w.acceleration_m_s2, w.jerk_m_s3, w.cos_tilt, w.rate_rad_s, w.yaw_rate_rad_s]
    first += [w.gravity_m_s2, w.drag_per_thrust_1_s, w.drag_per_speed_1_m, w.lift_axial_1_s, w.lift_lateral_1_m]
    rest = (w.inertia_kg_m2, w.effort_least, w.effort_most, w.effort_hover, w.mix.ravel())
    return np.concatenate([first, *rest])
