import numpy as np
import osqp
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import sparse
from scipy.linalg import solveh_banded

from flight import InputError
from planner.curve import minimum_snap


def random_problem(seed: int, segments: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return rng.normal(size=(segments + 1, 4)) * 3.0, rng.uniform(0.4, 2.0, segments)


def banded(T: np.ndarray) -> np.ndarray:
    """The conditions for interior (v, a, j) in LAPACK's lower banded storage: a knot couples with the next one."""
    H = minimum_snap.energy(T)
    diagonal, below = H[:-1, 5:, 5:] + H[1:, 1:4, 1:4], H[1:-1, 5:, 1:4]
    band = np.zeros((6, 3 * len(diagonal)))
    for row in range(3):
        for column in range(3):
            if row >= column:
                band[row - column, column::3] = diagonal[:, row, column]
            band[3 + row - column, column:-3:3] = below[:, row, column]
    return band


def solved_by_lapack(states: np.ndarray, T: np.ndarray) -> np.ndarray:
    """The states with the interior velocities, accelerations and jerks of least snap."""
    solved = states.copy()
    solved[1:-1, 1:] = 0.0
    force = minimum_snap.energy(T) @ minimum_snap.segment_states(solved)
    right = -(force[:-1, 5:] + force[1:, 1:4])
    if len(T) > 1:
        interior = solveh_banded(banded(T), right.reshape(-1, states.shape[2]), lower=True)
        solved[1:-1, 1:] = interior.reshape(right.shape)
    return solved


PROBLEMS = st.tuples(st.integers(0, 10_000), st.integers(1, 9))


@settings(max_examples=40)
@given(PROBLEMS)
def test_waypoints_are_hit_and_both_ends_are_at_rest(problem):
    positions, T = random_problem(*problem)
    path = minimum_snap.trajectory(minimum_snap.solve(positions, T))
    assert np.abs(path.evaluate(path.starts_s) - positions).max() < 1e-9
    ends = np.array([0.0, path.duration_s])
    for derivative in (1, 2, 3):
        assert np.abs(path.evaluate(ends, derivative)).max() < 1e-6 * max(1.0, np.abs(path.coefficients).max())


@settings(max_examples=40)
@given(PROBLEMS)
def test_joins_are_smooth_through_the_sixth_derivative(problem):
    # Continuity through jerk is built in; the next three are what optimality demands where only a position is pinned.
    path = minimum_snap.trajectory(minimum_snap.solve(*random_problem(*problem)))
    for derivative in range(7):
        scale = 1.0 + np.abs(path.evaluate(path.starts_s, derivative)).max()
        assert np.abs(path.join_jumps(derivative)).max(initial=0.0) < 1e-7 * scale


@settings(max_examples=40)
@given(PROBLEMS, st.integers(1, 4))
def test_the_kernel_agrees_with_lapack(problem, axes):
    positions, T = random_problem(*problem)
    start, end = np.random.default_rng(0).normal(size=(2, 3, axes))
    spline = minimum_snap.solve(positions[:, :axes], T, start=start, end=end)
    plain = solved_by_lapack(spline.states, T)
    assert np.allclose(spline.states, plain, rtol=1e-9, atol=1e-9 * np.abs(plain).max())
    scaled = minimum_snap.segment_states(plain) * minimum_snap.time_powers(T)[..., None]
    c = np.einsum("ab,kbx->kxa", minimum_snap.monomials_from_states(), scaled) / T[:, None, None] ** np.arange(8)
    assert np.allclose(minimum_snap.coefficients(spline.states, T), c, rtol=1e-8, atol=1e-9 * np.abs(c).max())


@settings(max_examples=30)
@given(st.integers(0, 10_000), st.integers(2, 9))
def test_a_held_velocity_is_had_and_the_rest_is_the_least_snap(seed, segments):
    positions, T = random_problem(seed, segments)
    rng = np.random.default_rng(seed)
    velocity = np.full((segments + 1, 4), np.nan)
    chosen = rng.permutation(np.arange(1, segments))[: rng.integers(1, segments)]
    velocity[chosen] = rng.normal(size=(len(chosen), 4))
    spline = minimum_snap.solve(positions, T, velocity=velocity)
    assert np.array_equal(spline.states[chosen, 1], velocity[chosen])
    least = spline.snap_cost()
    for _ in range(5):  # moving what is free never helps
        moved = spline.states.copy()
        moved[1:-1, 1:] += 1e-3 * rng.normal(size=moved[1:-1, 1:].shape)
        moved[chosen, 1] = velocity[chosen]
        assert minimum_snap.Spline(T, moved).snap_cost() >= least * (1.0 - 1e-12)


def test_a_thousand_waypoints_cost_what_the_exact_optimum_does():
    """The reference solves the same conditions in twice the digits."""
    rng = np.random.default_rng(5)
    positions, T = np.cumsum(rng.normal(size=(1001, 3)), axis=0), rng.uniform(0.5, 2.0, 1000)
    spline = minimum_snap.solve(positions, T)
    exact = spline.states.astype(np.longdouble)
    for _ in range(3):  # iterative refinement with the residual in long double
        H = minimum_snap.energy(T).astype(np.longdouble)
        force = H @ minimum_snap.segment_states(exact)
        residual = (force[:-1, 5:] + force[1:, 1:4]).astype(np.float64)
        exact[1:-1, 1:] -= correction(T, residual)
    d = minimum_snap.segment_states(exact)
    best = float(np.sum(d * (minimum_snap.energy(T).astype(np.longdouble) @ d)))
    assert spline.snap_cost() == pytest.approx(best, rel=1e-9)


def correction(T: np.ndarray, residual: np.ndarray) -> np.ndarray:
    return solveh_banded(banded(T), residual.reshape(-1, 3), lower=True).reshape(residual.shape)


def test_no_other_path_has_less_snap():
    positions, T = random_problem(1, 5)
    best = minimum_snap.solve(positions, T)
    rng = np.random.default_rng(2)
    for _ in range(50):
        other = best.states.copy()
        other[1:-1, 1:] += rng.normal(size=other[1:-1, 1:].shape) * 10.0 ** rng.uniform(-3, 1)
        assert minimum_snap.Spline(T, other).snap_cost() > best.snap_cost()


def test_the_cost_is_the_integral_of_squared_snap():
    spline = minimum_snap.solve(*random_problem(4, 6))
    path = minimum_snap.trajectory(spline)
    t = np.linspace(0.0, path.duration_s, 200_001)
    assert spline.snap_cost() == pytest.approx(np.trapezoid((path.evaluate(t, 4) ** 2).sum(axis=1), t), rel=1e-6)


@settings(max_examples=20)
@given(PROBLEMS, st.floats(0.3, 3.0))
def test_slower_by_a_factor_costs_its_seventh_power_less_and_keeps_the_way(problem, factor):
    positions, T = random_problem(*problem)
    one, other = minimum_snap.solve(positions, T), minimum_snap.solve(positions, T * factor)
    assert other.snap_cost() == pytest.approx(one.snap_cost() * factor**-7, rel=1e-6)
    a, b = minimum_snap.trajectory(one), minimum_snap.trajectory(other)
    t = np.linspace(0.0, a.duration_s, 50)
    assert np.abs(a.evaluate(t) - b.evaluate(t * factor)).max() < 1e-7 * (1.0 + np.abs(a.evaluate(t)).max())


def test_backwards_is_the_same_path_flown_backwards():
    positions, T = random_problem(7, 5)
    forward = minimum_snap.trajectory(minimum_snap.solve(positions, T))
    backward = minimum_snap.trajectory(minimum_snap.solve(positions[::-1], T[::-1]))
    t = np.linspace(0.0, forward.duration_s, 100)
    assert np.allclose(forward.evaluate(t), backward.evaluate(backward.duration_s - t), atol=1e-8)


def test_a_dense_quadratic_program_over_coefficients_finds_the_same_path():
    """The reference does not use Hermite states: monomials in u, every condition an equality row, OSQP."""
    positions, T = random_problem(11, 4)
    k = len(T)
    u, w = np.polynomial.legendre.leggauss(8)
    snap = minimum_snap.basis((u + 1) / 2, 4)
    energy = (snap.T * (w / 2)) @ snap
    P = sparse.block_diag([2 * energy * t**-7 for t in T], format="csc")
    rows, right = [], []

    def condition(parts: dict[int, np.ndarray], value: float) -> None:
        row = np.zeros(8 * k)
        for i, entries in parts.items():
            row[8 * i : 8 * i + 8] = entries
        rows.append(row)
        right.append(value)

    def at(u: float, r: int, i: int) -> np.ndarray:
        return minimum_snap.basis(np.array([u]), r)[0] / T[i] ** r

    x = positions[:, 0]
    for i in range(k):
        condition({i: at(0.0, 0, i)}, x[i])
        condition({i: at(1.0, 0, i)}, x[i + 1])
    for r in (1, 2, 3):
        condition({0: at(0.0, r, 0)}, 0.0)
        condition({k - 1: at(1.0, r, k - 1)}, 0.0)
        for i in range(k - 1):
            condition({i: at(1.0, r, i), i + 1: -at(0.0, r, i + 1)}, 0.0)
    solver = osqp.OSQP()
    A = sparse.csc_matrix(np.array(rows))
    solver.setup(
        P=P, q=np.zeros(8 * k), A=A, l=np.array(right), u=np.array(right),
        verbose=False, eps_abs=1e-9, eps_rel=1e-9, max_iter=200_000, polishing=True,
    )  # fmt: skip
    c = solver.solve(raise_error=True).x.reshape(k, 8)
    ours = minimum_snap.solve(positions[:, :1], T)
    mine = minimum_snap.coefficients(ours.states, T)[:, 0] * T[:, None] ** np.arange(8)
    assert np.abs(c - mine).max() < 1e-4 * np.abs(mine).max()
    reference = sum(t**-7 * c[i] @ energy @ c[i] for i, t in enumerate(T))
    assert ours.snap_cost() <= reference * (1 + 1e-6)
    assert ours.snap_cost() == pytest.approx(reference, rel=1e-4)


@pytest.mark.parametrize(
    ("positions", "durations"),
    [
        (np.zeros((3, 4)), np.array([1.0, 0.0])),
        (np.zeros((3, 4)), np.array([1.0, np.nan])),
        (np.full((3, 4), np.nan), np.ones(2)),
        (np.zeros((3, 4)), np.ones(3)),
    ],
)
def test_problems_that_make_no_sense_are_refused(positions, durations):
    with pytest.raises(InputError):
        minimum_snap.solve(positions, durations)
