"""Bounds that hold, and variances that are explained by what was planted."""

import numpy as np
import pytest
from scipy import stats

from preflight import statistics
from preflight.statistics import Probability


def shares_of(values, factors):
    return statistics.at_least_nil(statistics.adjusted_shares(values, factors))


def test_nothing_in_n_flights_shows_three_over_n_and_no_less():
    for n in (10, 300, 2995):
        assert statistics.upper_bound(0, n) == pytest.approx(3.0 / n, rel=0.15)
    assert statistics.upper_bound(0, statistics.flights_for(1e-3)) <= 1e-3
    assert statistics.upper_bound(0, statistics.flights_for(1e-3) - 1) > 1e-3


@pytest.mark.parametrize(("count", "flights"), [(0, 5), (1, 40), (7, 100), (99, 100)])
def test_the_bound_is_where_so_few_have_a_chance_of_a_twentieth(count, flights):
    assert stats.binom.cdf(count, flights, statistics.upper_bound(count, flights)) == pytest.approx(0.05, abs=1e-9)


def test_the_fewest_flights_that_show_a_risk_allow_for_those_that_were_lost():
    for count, risk in ((0, 1e-2), (1, 1e-3), (7, 0.05)):
        need = statistics.flights_for(risk, count)
        assert statistics.upper_bound(count, need) <= risk < statistics.upper_bound(count, need - 1)
    assert statistics.flights_for(1e-3, 1) == 4742


def test_all_lost_is_bounded_by_one():
    assert Probability.of(np.ones(4, bool)).upper == 1.0


def test_the_bound_holds_in_at_least_95_of_100():
    rng = np.random.default_rng(5)
    held = [Probability.of(rng.random(200) < p).upper >= p for p in rng.uniform(0.001, 0.2, 2000)]
    assert np.mean(held) >= 0.945


def test_the_shares_of_a_sum_are_those_of_its_terms():
    rng = np.random.default_rng(1)
    a, b, c, idle = rng.standard_normal((4, 4000, 1))
    value = 3.0 * a[:, 0] + 2.0 * (b[:, 0] ** 2 - 1.0) + rng.standard_normal(4000)  # variances 9, 8, 1
    shares = shares_of(value, {"idle": idle, "a": a, "b": b, "c": c})
    assert list(shares)[:2] == ["a", "b"]
    assert shares["a"] == pytest.approx(9 / 18, abs=0.04)
    assert shares["b"] == pytest.approx(8 / 18, abs=0.06)
    assert shares["idle"] < 0.005


def test_a_direction_is_one_factor():
    rng = np.random.default_rng(2)
    wind = rng.standard_normal((2000, 2))
    shares = shares_of(wind[:, 0] * wind[:, 1], {"wind": wind, "idle": rng.standard_normal((2000, 3))})
    assert shares["wind"] > 0.95


def test_what_turns_round_on_both_sides_is_explained_too():
    rng = np.random.default_rng(3)
    a, b = rng.standard_normal((2, 300, 1))
    value = (a**3 - 3.0 * a)[:, 0] + b[:, 0]  # no line and no square has a part in it
    shares = shares_of(value, {"b": b, "a": a})
    assert next(iter(shares)) == "a"
    assert shares["a"] == pytest.approx(6.0 / 7.0, abs=0.1)


def test_too_few_or_equal_values_explain_nothing():
    z = np.random.default_rng(3).standard_normal((40, 1))
    assert shares_of(np.ones(40), {"a": z}) == {}
    assert shares_of(z[:10, 0], {"a": z[:10]}) == {}


def test_a_factor_that_repeats_itself_explains_no_more_than_once():
    """Also where a column is a constant's, or another's double: there is nothing to divide by."""
    rng = np.random.default_rng(6)
    a, b = rng.standard_normal((2, 450, 1))
    sign = np.where(b > 0.0, 1.0, -1.0)
    value = a[:, 0] + sign[:, 0] + 0.5 * rng.standard_normal(450)
    once = shares_of(value, {"a": a, "sign": sign})
    again = shares_of(value, {"a": np.column_stack([a, 2.0 * a]), "sign": sign})
    assert again["a"] == pytest.approx(once["a"], abs=1e-9)
    assert once["sign"] == pytest.approx(1.0 / 2.25, abs=0.06)


def test_a_factor_of_half_as_many_columns_as_values_explains_nothing():
    """Eight draws have 44 columns."""
    rng = np.random.default_rng(7)
    for values, shown in ((88, False), (89, True)):
        draws = rng.standard_normal((values, 8))
        shares = shares_of(draws[:, 0], {"many": draws})
        assert (shares["many"] > 0.99) == shown


@pytest.mark.parametrize("flights", [60, 100])
def test_chance_alone_names_no_factor(flights):
    """Of 25 factors none comes before what they leave, which is nearly all: as many shares are below 0 as above."""
    rng, left, largest = np.random.default_rng(8), [], []
    for _ in range(30):
        factors = {str(i): rng.standard_normal((flights, 1)) for i in range(25)}
        shares = statistics.adjusted_shares(rng.standard_normal(flights), factors)
        left.append(1.0 - sum(shares.values()))
        largest.append(max(shares.values()))
        assert largest[-1] < left[-1]
    assert np.mean(largest) < 7.2 / flights
    assert np.mean(left) == pytest.approx(1.0, abs=0.1)


def test_a_yes_or_no_tells_as_much_as_the_rarer_of_both():
    """Powers of a draw explain no more of ten losses among many flights than its line and square do."""
    rng, shares = np.random.default_rng(9), []
    for _ in range(15):
        lost = (np.arange(600) < 10).astype(np.float64)
        found = statistics.adjusted_shares(lost, {str(i): rng.standard_normal((600, 1)) for i in range(25)})
        shares.append(max(found.values()))
    assert statistics._telling(lost) == 10
    assert statistics._telling(1.0 - lost) == 10
    assert statistics._telling(rng.standard_normal(50)) == 50
    assert max(shares) < 0.03
