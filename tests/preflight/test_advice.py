"""Advice that was tried: the largest wind and the least slowing down that are a go."""

from dataclasses import replace

import pytest

import preflight
from preflight import advice
from tests.preflight.conftest import EXACT, Wall


@pytest.mark.parametrize("ends_m_s", [0.4, 2.0, 3.7, 7.5, 11.0])
@pytest.mark.parametrize("asked_m_s", [0.0, 3.0, 9.0])
def test_the_largest_wind_is_found_to_half_a_metre_a_second(ends_m_s, asked_m_s):
    found = advice.advise(asked_m_s, 12.0, asked_m_s < ends_m_s, lambda wind, slower: wind < ends_m_s)
    assert found.wind_m_s is not None
    assert found.wind_m_s < ends_m_s <= found.wind_m_s + 0.5 + 1e-9


def test_where_not_even_calm_air_is_a_go_it_says_so():
    found = advice.advise(2.0, 12.0, False, lambda wind, slower: slower >= 1.3)
    assert found.wind_m_s is None
    assert found.slower == 1.35
    assert found.sentence() == "1.35 times slower is a go; no wind at all is a go"


def test_slower_is_tried_from_the_fastest_and_only_where_the_plan_is_none():
    assert advice.advise(1.0, 12.0, True, lambda wind, slower: True).slower == 1.0
    tried = []

    def is_go(wind, slower):
        tried.append(slower)
        return slower > 1.15

    assert advice.advise(0.0, 12.0, False, is_go).slower == 1.2
    assert tried == [1.05, 1.1, 1.2]


def test_a_decision_stops_at_the_flight_that_makes_it_and_is_the_same(drone, curve):
    options = preflight.Options(
        risk=0.03, uncertainty=replace(EXACT, localization_std_m=0.05), threads=1, explain=False
    )
    results = [
        preflight.fly(preflight.Scenario(drone, curve, Wall(0.25), radius_m=0.2), replace(options, decide_only=only))
        for only in (False, True)
    ]
    assert not results[0].go
    assert not results[1].go
    assert results[1].flights < results[0].flights == 99


@pytest.mark.parametrize("at", [0.0, 0.5])
def test_advice_that_is_cut_off_says_nothing(drone, curve, at):
    """Flights that were cut off are too few to be a go, which is no verdict on the wind."""
    options = preflight.Options(flights=99, risk=0.03, uncertainty=EXACT, threads=1, explain=False)
    flown = (drone, curve, Wall(1.0))
    result = preflight.fly(preflight.Scenario(*flown, radius_m=0.2), options)

    def cut_off(stage: str, fraction: float) -> None:
        if stage.startswith("trying") and fraction >= at:
            raise KeyboardInterrupt

    assert result.go
    assert preflight.advised(preflight.Scenario(*flown, radius_m=0.2), result, options, progress=cut_off) is None


@pytest.mark.slow
def test_a_wall_near_a_fast_way_is_a_go_in_less_wind(drone, curve):
    options = preflight.Options(flights=60, risk=0.05, uncertainty=replace(EXACT, wind_m_s=9.0, gust_std_m_s=0.3))
    flown = (drone, curve, Wall(0.216))
    result = preflight.fly(preflight.Scenario(*flown, radius_m=0.2), options)
    found = preflight.advised(preflight.Scenario(*flown, radius_m=0.2), result, options)
    assert not result.go
    assert found.wind_m_s is not None
    assert found.wind_m_s < 9.0
