"""Robust variances are those of the delete-one jackknife: the scatter of the estimates without one block each."""

from types import SimpleNamespace

import numpy as np
import pytest

from sysid.diagnosis.evidence.evidence import Blocks
from sysid.diagnosis.evidence.score import score
from sysid.estimator.joint_problem import solver


def blocks(seed: int, count: int = 7, size: int = 3) -> Blocks:
    rng = np.random.default_rng(seed)
    columns = rng.normal(size=(count, 12, size))
    residual = rng.normal(size=(count, 12)) + rng.normal(size=(count, 1))
    return Blocks(np.einsum("bri,br->bi", columns, residual), np.einsum("bri,brj->bij", columns, columns))


def jackknife(of: Blocks) -> np.ndarray:
    """(b - 1) / b times the scatter of the estimates without one block about the estimate with all."""

    def estimate(kept: np.ndarray) -> np.ndarray:
        return -np.linalg.solve(of.information[kept].sum(axis=0), of.score[kept].sum(axis=0))

    everything = np.arange(len(of.score))
    off = np.array([estimate(np.delete(everything, b)) - estimate(everything) for b in everything])
    return (len(off) - 1) / len(off) * off.T @ off


@pytest.mark.parametrize("seed", range(3))
def test_the_covariance_of_a_score_is_the_delete_one_jackknife(seed: int):
    given = blocks(seed)
    found = score(given, np.arange(0), np.arange(3))
    np.testing.assert_allclose(found.covariance, jackknife(given), rtol=1e-6)


@pytest.mark.parametrize("units", [(1.0, 1.0, 1.0), (1.0, 1e-8, 1e-12)])  # N s2, kg m2 and s stand side by side
@pytest.mark.parametrize("seed", range(3))
def test_the_covariance_of_a_fit_is_the_delete_one_jackknife_in_any_units(seed: int, units):
    given = blocks(seed)
    expected = jackknife(given) * np.outer(units, units)
    given = Blocks(given.score / units, given.information / np.outer(units, units))
    information = given.information.sum(axis=0)
    at_the_best = given.score - given.information @ np.linalg.solve(information, given.score.sum(axis=0))
    scores = list(zip(given.information, at_the_best, strict=True))
    solution = SimpleNamespace(covariance=lambda: np.linalg.inv(information), scores=(tuple(scores),))
    found, freedom = solver.robust_covariance(solution)  # pyright: ignore[reportArgumentType]
    np.testing.assert_allclose(found, expected, rtol=1e-6)
    assert np.all((freedom > 1.0) & (freedom <= len(scores)))


def flight(rng: np.random.Generator, weak: float) -> tuple[tuple[np.ndarray, np.ndarray], ...]:
    """Five blocks of a flight and four parameters: one that shows by `weak` alone, and two that it hardly separates."""
    found = []
    for _ in range(5):
        columns, residual = rng.normal(size=(12, 4)), rng.normal(size=12)
        columns[:, 2] *= weak
        columns[:, 3] = columns[:, 0] * (1.0 + 1e-9 * rng.normal(size=12))
        found.append((columns.T @ columns, columns.T @ residual))
    return tuple(found)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("seed", range(8))
def test_variances_are_numbers_not_below_zero_where_flights_hardly_show_a_parameter(seed: int):
    rng = np.random.default_rng(seed)
    scores = (flight(rng, 1e-9), *(flight(rng, 0.0) for _ in range(3)))
    information = np.sum([block[0] for one in scores for block in one], axis=0)
    solution = SimpleNamespace(
        covariance=lambda: solver.covariance_of(information), scores=scores, prior_information=np.zeros((4, 4))
    )
    found, _ = solver.robust_covariance(solution)  # pyright: ignore[reportArgumentType]
    assert np.all(np.isfinite(found))
    assert np.all(np.diag(found) >= 0.0)


@pytest.mark.filterwarnings("error")
def test_what_nothing_shows_has_a_huge_variance_that_is_finite():
    assert 1e100 < solver.covariance_of(np.diag([1.0, 0.0]))[1, 1] < np.inf


def test_what_a_held_out_block_says_rests_on_the_other_blocks_alone():
    """Blocks of one fold each: the step that judges a block is the estimate without it."""
    given = blocks(5, count=8)
    found = score(given, np.arange(0), np.arange(3))
    for b in range(8):
        others = np.delete(np.arange(8), b)
        step = -np.linalg.solve(given.information[others].sum(axis=0), given.score[others].sum(axis=0))
        fall = -(given.score[b] @ step) - 0.5 * step @ given.information[b] @ step
        assert found.unseen_by_block[b] == pytest.approx(fall, rel=1e-9)


def test_a_size_that_cannot_be_negative_is_none_where_it_comes_out_so():
    given = blocks(6)
    free = score(given, np.arange(0), np.arange(3))
    negative = free.size < 0.0
    assert negative.any()
    held = score(given, np.arange(0), np.arange(3), one_sided=np.ones(3, dtype=bool))
    assert np.all(held.size >= 0.0)
    assert np.all(held.size[negative] == 0.0)
