import numpy as np
import pytest
from scipy.optimize import approx_fprime

from esdf import solids
from planner import penalty, time_allocation
from planner.time_allocation import Problem, Weights

BOUNDS = penalty.Bounds(
    speed_m_s=4.0,
    acceleration_m_s2=6.0,
    tilt_rad=0.7,
    rate_rad_s=4.0,
    thrust_min_m_s2=6.0,
    thrust_max_m_s2=14.0,
    turn_rad_s2_per_m_s2=8.0,
)


def problem(seed: int, segments: int = 5, **weights: float) -> tuple[Problem, np.ndarray]:
    rng = np.random.default_rng(seed)
    scene = solids.Scene([solids.Sphere(tuple(rng.uniform(-2, 2, 3)), 0.7) for _ in range(4)])
    knots = np.cumsum(rng.normal(size=(segments + 1, 3)), axis=0)
    free = np.ones(segments + 1, dtype=bool)
    free[[0, -1]] = False
    price = Weights(snap=1e-4, limits=2.0, clearance=30.0)
    price = Weights(**{**{n: getattr(price, n) for n in ("snap", "limits", "clearance")}, **weights})
    return Problem(knots, free, BOUNDS, scene, 1.0, price), rng.uniform(0.4, 0.9, segments)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("only", ["all", "snap", "limits", "clearance"])
def test_the_gradient_is_that_of_finite_differences(seed, only):
    weights = {} if only == "all" else {n: 0.0 for n in ("snap", "limits", "clearance") if n != only}
    p, T = problem(seed, **weights)
    value, by_T, by_knots, _ = time_allocation.cost_and_gradient(p, p.knots, T)
    assert value > T.sum()
    h = 1e-6
    for i in range(len(T)):
        step = h * np.eye(len(T))[i]
        up, down = (time_allocation.cost_and_gradient(p, p.knots, T + s * step)[0] for s in (1, -1))
        assert by_T[i] == pytest.approx((up - down) / (2 * h), rel=2e-5, abs=1e-4 * np.abs(by_T).max())
    for i in np.ndindex(p.knots.shape):
        step = np.zeros_like(p.knots)
        step[i] = h
        up, down = (time_allocation.cost_and_gradient(p, p.knots + s * step, T)[0] for s in (1, -1))
        assert by_knots[i] == pytest.approx((up - down) / (2 * h), rel=2e-5, abs=1e-4 * np.abs(by_knots).max())


@pytest.mark.parametrize("seed", range(6))
def test_the_kernel_agrees_with_the_numpy_reference(seed):
    p, T = problem(seed)
    d = np.random.default_rng(seed).normal(size=(len(T), 8, 3)) * np.tile([1.0, 4.0, 10.0, 60.0], 2)[:, None]
    fast, plain = time_allocation._running_cost(p, d, T), time_allocation.running_cost_numpy(p, d, T)
    for a, b in zip(fast, plain, strict=True):
        assert np.allclose(a, b, rtol=1e-10, atol=1e-10 * np.abs(b).max())


@pytest.mark.parametrize("seed", range(5))
def test_every_penalty_has_its_gradient(seed):
    rng = np.random.default_rng(seed)
    motion = rng.normal(size=(4, 3)) * np.array([6.0, 8.0, 40.0, 600.0])[:, None]

    def value(x: np.ndarray) -> float:
        return float(penalty.dynamics(*x.reshape(4, 1, 3), BOUNDS).value[0])

    found = penalty.dynamics(*motion[:, None], BOUNDS)
    exact = np.stack([found.by_velocity, found.by_acceleration, found.by_jerk, found.by_snap])[:, 0]
    numeric = approx_fprime(motion.ravel(), value, 1e-6).reshape(4, 3)
    assert np.allclose(exact, numeric, rtol=1e-4, atol=1e-4 * np.abs(numeric).max())


def test_within_the_limits_the_penalty_is_zero():
    v, a, j, s = np.array([[1.0, 0, 0], [0.5, 0, 1], [1.0, 1, 0], [1.0, 0, 0]])[:, None]
    assert penalty.dynamics(v, a, j, s, BOUNDS).value[0] == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize(
    ("index", "vector"), [(0, [5.0, 0, 0]), (1, [0, 0, -5.0]), (1, [7.0, 0, 0]), (2, [60.0, 0, 0]), (3, [0, 900.0, 0])]
)
def test_every_limit_that_is_exceeded_has_a_penalty(index, vector):
    motion = np.zeros((4, 1, 3))
    motion[index] = vector
    assert penalty.dynamics(*motion, BOUNDS).value[0] > 0.01


def test_optimising_times_never_costs_more_and_is_a_minimum():
    p, T = problem(5)
    before = time_allocation.cost_and_gradient(p, p.knots, T)[0]
    found = time_allocation.optimise(p, T, iterations=500, precision=1e-12)
    assert found.cost < before
    rng = np.random.default_rng(0)
    for _ in range(20):
        nudged = found.durations_s * np.exp(0.02 * rng.normal(size=len(T)))
        assert time_allocation.cost_and_gradient(p, found.knots, nudged)[0] > found.cost - 1e-6


def test_pinned_knots_stay_where_they_are():
    p, T = problem(6)
    found = time_allocation.optimise(p, T, iterations=50)
    assert np.array_equal(found.knots[[0, -1]], p.knots[[0, -1]])
    assert np.abs(found.knots[1:-1] - p.knots[1:-1]).max() > 1e-3


def test_twice_as_much_room_in_every_limit_flies_no_slower(open_sky):
    knots = np.array([[0.0, 0, 0], [4, 0, 0], [4, 3, 1], [0, 3, 1]])
    times = []
    for factor in (0.5, 1.0, 2.0):
        bounds = penalty.Bounds(4 * factor, 6 * factor, 0.6 * factor, 5 * factor, 2.0, 12.0 + 8 * factor, 10 * factor)
        p = Problem(knots, np.zeros(4, dtype=bool), bounds, open_sky, 0.3, Weights(limits=1000.0))
        times.append(time_allocation.optimise(p, np.full(3, 3.0)).durations_s.sum())
    assert times[0] > times[1] > times[2]
