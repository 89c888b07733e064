"""How much slower: the least that was tried with which of all flights no more are lost than is accepted."""

from dataclasses import replace

import numpy as np
import pytest

import preflight
from preflight import slower, statistics
from tests.preflight.conftest import EXACT, Wall

OPTIONS = preflight.Options(flights=60, risk=0.05, uncertainty=EXACT, explain=False)


@pytest.fixture(scope="module")
def scenario(drone, curve):
    return preflight.Scenario(drone, curve, Wall(1.0), radius_m=0.2)


@pytest.fixture(scope="module")
def good(scenario):
    return preflight.fly(scenario, OPTIONS)


def overturned(result, count):
    """The same, its first flights lost on their way, in turns in either segment."""
    error_m = result.record.error_m.copy()
    error_m[:count:2, 20:] = np.nan
    upset = np.arange(60) < count
    return replace(result, record=replace(result.record, fell=upset, error_m=error_m))


def test_segments_are_asked_for_the_least_slowing_with_which_of_all_flights_few_enough_are_lost(
    scenario, good, monkeypatch
):
    result, tried = overturned(good, 4), []

    def records(slowed, numbers, options):
        """Flights 0 and 2 are cured by 1.1, flights 1 and 3 by 1.2; 50, which was not lost before, is until 1.35."""
        factor = slowed.trajectory.duration_s / scenario.trajectory.duration_s
        tried.append((round(factor, 3), len(numbers)))
        least = np.where(numbers == 50, 1.35, np.where(numbers < 4, np.where(numbers % 2, 1.2, 1.1), 1.0))
        return replace(good.record[numbers], fell=factor < least - 1e-9)

    monkeypatch.setattr(slower.study, "records", records)
    found = slower.needed(scenario, result, OPTIONS)
    assert [(each.segment, each.factor, each.flights) for each in found] == [(0, 1.35, 2), (1, 1.35, 2)]
    assert tried == [(1.05, 4), (1.1, 4), (1.2, 4), (1.2, 56), (1.35, 4), (1.35, 56)]


def test_flights_that_are_lost_by_luck_whatever_the_speed_ask_for_none(scenario, good, monkeypatch):
    """Those lost the first time then come through, as most would, and as many others are lost."""

    def records(slowed, numbers, options):
        return replace(good.record[numbers], fell=(numbers >= 10) & (numbers < 14))

    monkeypatch.setattr(slower.study, "records", records)
    assert slower.needed(scenario, overturned(good, 4), OPTIONS) == ()


def test_what_slowing_does_not_cure_and_a_go_and_what_is_accepted_ask_for_nothing(scenario, good, monkeypatch):
    always = overturned(good, 4).record
    monkeypatch.setattr(slower.study, "records", lambda slowed, numbers, options: always[numbers])
    assert slower.needed(scenario, overturned(good, 4), OPTIONS) == ()
    monkeypatch.setattr(slower.study, "records", lambda slowed, numbers, options: good.record[numbers])
    assert slower.needed(scenario, good, OPTIONS) == ()
    assert slower.needed(scenario, overturned(good, 4), OPTIONS) != ()
    accepted = replace(overturned(good, 4), risk=statistics.upper_bound(4, 60) + 1e-9, wanted=61)
    assert slower.needed(scenario, accepted, OPTIONS) == ()
