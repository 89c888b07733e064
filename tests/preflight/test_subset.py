"""Rare events of known probability: estimates, and bounds that hold whatever the event looks like."""

import numpy as np
import pytest
from scipy.stats import chi2, norm
from scipy.stats import t as student

from preflight import statistics, subset
from preflight.luck import Luck
from preflight.subset import Points

RARE = 1e-4


def plane(beta):
    return lambda points: beta - points.normal.sum(axis=1) / np.sqrt(points.normal.shape[1])


def along_one_axis(points: Points):
    """A plane in one number of all."""
    return norm.isf(RARE) - points.normal[:, 0]


def two_planes(points: Points):
    """At right angles, one hit more than twice as often as the other."""
    x = points.normal
    return np.minimum(norm.isf(0.7 * RARE) - x[:, 0], norm.isf(0.3 * RARE) + x[:, 1])


def facing(points: Points):
    return norm.isf(0.5 * RARE) - np.abs(points.normal[:, 0])


def far(points: Points):
    return np.sqrt(chi2.isf(RARE, points.normal.shape[1])) - np.linalg.norm(points.normal, axis=1)


SCENES = {
    "plane": plane(norm.isf(RARE)), "plane along one axis": along_one_axis, "two planes": two_planes,
    "facing planes": facing, "sphere": far,
}  # fmt: skip


def found(score, *, seed=0, columns=10, size=1000, **options) -> subset.Found:
    first = Points.independent(np.random.default_rng(1000 + seed).standard_normal((size, columns)))
    return subset.run(score, first, score(first), seed=seed, **options)


def of_number(numbers: np.ndarray) -> np.ndarray:
    """A standard normal number for each."""
    return np.array([np.random.Generator(np.random.Philox(key=int(n))).standard_normal() for n in numbers.ravel()])


def from_gusts(points: Points):
    """A plane in the numbers that the gusts are a sum of."""
    parts = of_number(points.luck.numbers[:, 2:]).reshape(points.luck.weights.shape)
    return norm.isf(1e-3) - (parts * points.luck.weights).sum(axis=1)


def from_noise(points: Points):
    """A plane that no step leads towards: other noise is all other."""
    return norm.isf(1e-3) - of_number(points.luck.numbers[:, 0])


@pytest.mark.parametrize("name", list(SCENES))
def test_one_in_ten_thousand_is_found_in_a_fortieth_of_the_samples_that_count_it(name):
    runs = [found(SCENES[name], seed=seed) for seed in range(6)]
    assert np.mean([run.estimate for run in runs]) == pytest.approx(RARE, rel=0.3)
    for run in runs:
        assert run.reached
        assert 0.4 < run.estimate / RARE < 2.5
        assert run.samples <= 5000


@pytest.mark.parametrize("probability", [0.3, 1e-2, 1e-3, 1e-6])
def test_a_plane_at_any_distance_has_its_probability(probability):
    run = found(plane(norm.isf(probability)), columns=40)
    assert probability / 2.0 < run.estimate < 2.0 * probability
    assert run.upper > probability


def held(name: str, size: int, seeds: int) -> float:
    """How often."""
    return float(np.mean([found(SCENES[name], seed=i, size=size).upper >= RARE for i in range(seeds)]))


@pytest.mark.parametrize("name", list(SCENES))
def test_the_bound_holds(name):
    assert held(name, 200, 24) >= 0.87


@pytest.mark.slow
@pytest.mark.parametrize("name", list(SCENES))
@pytest.mark.parametrize("size", [200, 1000])
def test_the_bound_holds_in_at_least_93_of_100(name, size):
    assert held(name, size, 100) >= 0.93


def test_the_bound_is_never_below_that_of_as_many_independent_samples():
    shares = [np.full(subset.GROUPS, 0.1)] * 3
    estimate, upper = subset.bound(shares, 1000)
    assert estimate == pytest.approx(1e-3)
    assert upper > 1e-3 * np.exp(1.645 * np.sqrt(3 * 9 / 1000))
    assert subset.bound([np.zeros(subset.GROUPS)], 1000)[1] > 3e-3


def test_more_groups_that_disagree_widen_the_bound():
    even = np.full(subset.GROUPS, 0.1)
    uneven = np.where(np.arange(subset.GROUPS) < 2, 0.45, 0.0125)
    assert uneven.mean() == pytest.approx(0.1)
    assert subset.bound([even, uneven], 1000)[1] > 2.0 * subset.bound([even, even], 1000)[1]


def test_what_the_gusts_alone_decide_is_followed():
    estimates = [found(from_gusts, seed=seed, size=200).estimate for seed in range(4)]
    assert np.mean(estimates) == pytest.approx(1e-3, rel=0.5)


def test_what_no_step_leads_towards_has_a_bound_all_the_same():
    for seed in range(3):
        assert found(from_noise, seed=seed, size=200).upper >= 1e-3


def test_what_the_noise_alone_decides_is_found_in_noise_that_no_seed_had():
    def noise(points: Points):
        return norm.isf(2e-2) - of_number(points.luck.numbers[:, 0])

    runs = [found(noise, seed=seed) for seed in range(4)]
    assert np.mean([run.estimate for run in runs]) == pytest.approx(2e-2, rel=0.4)
    assert min(len(set(run.points.luck.numbers[:, 0])) for run in runs) > 1.2 * subset.SHARE * 1000


def test_a_group_without_a_seed_takes_one_of_another_and_is_as_large():
    within = np.zeros(200, bool)
    within[[0, 1, 2, 25, 190]] = True
    seeds, groups, lengths = subset._seeds(within, 20, np.random.default_rng(0))
    assert np.bincount(groups, lengths).tolist() == [20] * subset.GROUPS
    assert within[seeds].all()
    assert sorted(seeds[groups == 0]) == [0, 1, 2]
    assert seeds[groups == 1].tolist() == [25]


def test_an_event_that_is_rarer_than_asked_ends_when_that_is_shown():
    run = found(plane(7.0), enough=1e-3)
    assert not run.reached
    assert run.count == 0
    assert norm.sf(7.0) < run.estimate < run.upper <= 1e-3
    assert run.samples < 4500


def test_an_event_out_of_reach_ends_without_progress():
    run = found(lambda points: np.ones(len(points)))
    assert not run.reached
    assert run.upper == statistics.upper_bound(0, 1000, 0.975)


def test_ctrl_c_keeps_the_levels_that_were_done():
    calls = []

    def score(points):
        calls.append(len(points))
        if sum(calls) > 3000:
            raise KeyboardInterrupt
        return SCENES["plane"](points)

    run = found(score)
    assert run.cut_off
    assert not run.reached
    assert run.levels == 3
    assert RARE < run.estimate == pytest.approx(1e-3, rel=0.05)
    assert run.samples < 3000


def test_a_step_keeps_the_distribution_of_luck():
    luck, rng = Luck.of(np.arange(500)), np.random.default_rng(1)
    for step in (0.3, 1.0, 0.6):
        luck = luck.moved(rng.integers(1 << 50, size=500), step, rng.random((500, 2)) < 0.5)
    assert (luck.weights**2).sum(axis=1) == pytest.approx(1.0)
    parts = of_number(luck.numbers[:, 2:]).reshape(luck.weights.shape)
    values = (parts * luck.weights).sum(axis=1)
    assert values.mean() == pytest.approx(0.0, abs=0.15)
    assert values.std() == pytest.approx(1.0, abs=0.1)
    assert luck.weights.shape[1] == 2  # a whole step leaves nothing of what was before


def test_the_quantile_is_students_of_as_many_groups():
    assert pytest.approx(student.ppf(subset._CONFIDENCE, subset.GROUPS - 1), rel=1e-12) == subset._STUDENT
