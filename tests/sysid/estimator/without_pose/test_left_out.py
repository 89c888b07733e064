"""What is stated of effects that are not in the model: by their usual size, and by what the flights tell of them."""

import numpy as np
import pytest

from sysid.estimator.joint_problem.solver import Solution
from sysid.estimator.without_pose import left_out

BLOCKS, ROWS, NOISE = 12, 50, 1.0


def solved(rng, size, seen):
    """A straight line fitted to noise and `size` of a cause that goes with its slope; the line's truth is zero.

    Returns:
        The solution, scores and prior beside which the cause stands, and the line's estimate (2,).
    """
    by = np.stack([np.ones(BLOCKS * ROWS), np.linspace(-1.0, 1.0, BLOCKS * ROWS)], axis=1)
    cause = 0.5 * by[:, 1] + seen * rng.standard_normal(len(by))
    measured = size * cause + NOISE * rng.standard_normal(len(by))
    line = np.linalg.lstsq(by, measured)[0]
    left, both = measured - by @ line, np.column_stack([cause, by])
    parts = zip(np.split(left, BLOCKS), np.split(both, BLOCKS), strict=True)
    scores = [[(x.T @ x / NOISE**2, -x.T @ e / NOISE**2) for e, x in parts]]
    own = tuple(tuple((i[1:, 1:], g[1:]) for i, g in flight) for flight in scores)
    information = (sum(i for i, _ in own[0]),)
    solution = Solution(None, None, (), own, information, np.zeros((2, 2)), (), True)
    return solution, scores, np.zeros((3, 3)), line


def moments(solution, scores, prior):
    return float(left_out.possible(solution, scores, prior, 0)[0, 0])


def test_flights_that_show_nothing_of_a_cause_leave_its_usual_size():
    solution, scores, prior, _ = solved(np.random.default_rng(1), 0.0, 0.0)
    assert moments(solution, scores, prior) == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("size", [0.0, 1.0, -2.0])
def test_flights_that_show_a_cause_leave_the_size_that_they_show(size):
    solution, scores, prior, _ = solved(np.random.default_rng(2), size, 10.0)
    assert moments(solution, scores, prior) == pytest.approx(size**2, abs=0.03)


@pytest.mark.parametrize("seen", [0.0, 0.05, 0.3])
def test_errors_are_as_large_as_stated_over_causes_of_usual_sizes(seen, monkeypatch):
    """Whether flights show the cause, hardly show it or not; with forms that are right."""
    monkeypatch.setattr(left_out, "WRONG_FORM", 1.0)
    rng, over = np.random.default_rng(77), []
    for _ in range(400):
        solution, scores, prior, line = solved(rng, rng.standard_normal(), seen)
        moved = left_out.moves(solution, prior + sum(i for i, _ in scores[0]))[1, 0]
        variance = solution.covariance()[1, 1] + moved**2 * moments(solution, scores, prior)
        over.append(line[1] ** 2 / variance)
    assert np.mean(over) == pytest.approx(1.0, abs=0.2)


def test_the_root_of_moments_is_real_whatever_rounding_made_of_them():
    moments = np.array([[1.0, 0.5], [0.5, 0.25 - 1e-12]])
    found = left_out.root(moments)
    np.testing.assert_allclose(found @ found, moments, atol=1e-9)
    np.testing.assert_array_equal(left_out.root(np.eye(3)), np.eye(3))


def test_leaving_a_cause_out_moves_what_goes_with_it_alone():
    solution, scores, prior, line = solved(np.random.default_rng(4), 3.0, 0.0)
    moved = left_out.moves(solution, prior + sum(i for i, _ in scores[0]))[:, 0]
    np.testing.assert_allclose(moved, [0.0, 0.5], atol=1e-9)
    assert line[1] == pytest.approx(3.0 * moved[1], abs=0.3)
