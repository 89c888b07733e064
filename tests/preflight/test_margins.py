"""More room by segment: what flights miss, and only where room is what is missing."""

from dataclasses import replace

import numpy as np
import pytest

import preflight
from preflight import core, margins, statistics
from tests.preflight.conftest import EXACT, Wall

OPTIONS = preflight.Options(
    flights=60, risk=0.05, uncertainty=replace(EXACT, localization_std_m=0.03), decide_only=True
)
"""No shares: flights again for what comes anew would double the work."""
RADIUS_M = 0.2


@pytest.fixture(scope="module")
def along(drone, curve):
    """A scenario beside a wall so far away."""
    return lambda away_m, **more: preflight.Scenario(drone, curve, Wall(away_m), radius_m=RADIUS_M, **more)


@pytest.fixture(scope="module")
def touching(along):
    return preflight.fly(along(0.25), OPTIONS)


@pytest.fixture(scope="module")
def good(along):
    return preflight.fly(along(1.0), OPTIONS)


@pytest.fixture(scope="module")
def needed(along):
    return lambda result: margins.needed(along(0.25), result, OPTIONS)


def test_a_wall_farther_away_by_what_was_asked_is_a_go_with_other_luck_too(along, touching, needed):
    assert not touching.go
    extra_m = max(each.extra_m for each in needed(touching))
    goes = [preflight.fly(along(0.25 + extra_m), replace(OPTIONS, seed=seed)).go for seed in range(5)]
    assert goes[0]
    assert sum(goes) >= 4
    assert not preflight.fly(along(0.25 - 0.5 * touching.record.clearance_m.min()), OPTIONS).go
    assert extra_m < 3.5 * 0.03  # of the errors' standard deviation
    assert needed(preflight.fly(along(0.25 + extra_m), OPTIONS)) == ()


def test_each_segment_is_asked_for_more_than_its_own_flights_miss(touching, needed, curve):
    found, record = needed(touching), touching.record
    segments = curve.segment_at(np.nan_to_num(record.path_s))[0]
    assert {each.segment for each in found} == set(segments[record.touched].tolist())
    for each in found:
        mine = record.touched & (segments == each.segment)
        assert each.extra_m >= margins.RESERVE_M - record.clearance_m[mine].min()
        assert each.flights == mine.sum()
        assert (each.from_s, each.to_s) == (curve.starts_s[each.segment], curve.starts_s[each.segment + 1])


def test_an_exponential_tail_is_exceeded_as_often_as_asked():
    rng = np.random.default_rng(1)
    drawn, others = rng.exponential(0.02, (2, 2000, 300))

    def beyond(few):
        asked_m = np.array([margins._exceeded_by(row, few) for row in drawn])
        return (others > asked_m[:, None]).sum(axis=1)

    assert 0.8 <= (beyond(0.105) == 0).mean() <= 0.95
    assert beyond(1.0).mean() == pytest.approx(1.3, abs=0.3)
    assert beyond(5.0).mean() == pytest.approx(5.0, abs=0.5)


def of_many(result, clearance_m, path_s, **more):
    """The same flown more often: every flight as the first, but for these."""
    count = len(clearance_m)
    record = replace(result.record[np.zeros(count, int)], clearance_m=clearance_m, path_s=path_s, **more)
    return replace(result, record=record, wanted=count, risk=0.01)


def test_the_losses_that_may_be_are_shared_by_the_segments(good, along, curve):
    """Of 120 that touch, half in each of two segments, 91 may; then the 29 left decide, and never none."""
    count = 10000
    clearance_m, path_s = np.linspace(0.001, 0.3, count), np.where(np.arange(count) % 2, *(curve.starts_s[:2] + 0.5))
    clearance_m[:120] = -np.linspace(0.1, 0.02, 120)
    result = of_many(good, clearance_m, path_s)
    assert not result.go
    spared = int(margins._expected(margins.allowed(count, 0.01), count))
    assert 60 < spared < 118
    found = margins.needed(along(1.0), result, replace(OPTIONS, flights=count))
    assert {each.segment for each in found} == {0, 1}
    for each in found:
        assert -clearance_m[spared + 1] <= each.extra_m - margins.RESERVE_M <= -clearance_m[spared]


def test_more_flights_given_up_than_are_tried_again_need_what_those_do(good, along, monkeypatch):
    count, lost = 3000, 1200
    given_up = np.arange(count) < lost
    ending = np.where(given_up, core.FAILSAFE, core.FINISHED)
    result = of_many(good, np.where(given_up, -0.05, 0.3), np.ones(count), ending=ending)

    def records(scenario, numbers, options):
        """6 cm cure them."""
        if scenario.clearance_m < 0.06:
            return result.record[numbers]
        return replace(
            result.record[numbers], ending=np.full(len(numbers), core.FINISHED), clearance_m=np.full(len(numbers), 0.2)
        )

    monkeypatch.setattr(margins.study, "records", records)
    found = margins.needed(along(1.0), result, replace(OPTIONS, flights=count))
    assert [(each.touching, each.extra_m, each.flights) for each in found] == [(False, 0.06, lost)]


def test_as_many_of_the_deepest_are_let_be_as_the_risk_allows(touching, needed):
    lost = int(touching.record.lost.sum())
    spared = lost // 2
    accepted = replace(touching, risk=statistics.upper_bound(spared, 60) + 1e-9)
    assert 1 <= spared < lost
    assert not accepted.go
    least_m = max(each.extra_m for each in needed(accepted))
    assert least_m < max(each.extra_m for each in needed(replace(touching, risk=1e-5)))
    assert least_m >= margins.RESERVE_M - np.sort(touching.record.clearance_m)[spared]


def test_flights_that_fall_are_not_cured_by_room(touching, needed):
    fallen = replace(touching, record=replace(touching.record, fell=np.ones(60, bool)))
    assert needed(fallen) == ()


def gusty(drone, curve, clearance_m):
    scenario = preflight.Scenario(drone, curve, Wall(1.0), radius_m=RADIUS_M, clearance_m=clearance_m)
    options = preflight.Options(60, 0.05, uncertainty=replace(EXACT, gust_std_m_s=1.5), explain=False)
    return scenario, options, preflight.fly(scenario, options)


def test_flights_that_are_given_up_ask_for_the_room_with_which_they_come_to_the_end(drone, curve):
    scenario, options, result = gusty(drone, curve, 0.03)
    assert result.finished < 0.9
    found = margins.needed(scenario, result, options)
    assert {each.touching for each in found} == {False}
    extra_m = max(each.extra_m for each in found)
    assert gusty(drone, curve, 0.03 + extra_m)[2].finished >= 0.9
    less_m = margins.TRIED_M[margins.TRIED_M.index(extra_m) - 1]
    assert gusty(drone, curve, 0.03 + less_m)[2].finished < 0.95  # half of the tenth that may be given up


def test_flights_farther_off_than_room_cures_ask_for_none(touching, needed):
    deepest = int(touching.record.clearance_m.argmin())

    def with_deepest(clearance_m):
        values = touching.record.clearance_m.copy()
        values[deepest] = clearance_m
        return needed(replace(touching, record=replace(touching.record, clearance_m=values), risk=1e-5))

    assert with_deepest(-0.15) != ()
    assert with_deepest(-margins.MOST_M) == ()


def test_a_flight_given_up_that_no_room_saves_counts_among_the_lost(touching, needed, monkeypatch):
    """And what is left of those that may be lost is less by it."""
    record = touching.record
    deepest = np.argsort(record.clearance_m)
    ending = np.where(np.arange(60) == deepest[0], core.FAILSAFE, core.FINISHED)
    given_up = replace(touching, record=replace(record, ending=ending), risk=statistics.upper_bound(1, 60) + 1e-9)
    monkeypatch.setattr(margins.study, "records", lambda scenario, numbers, options: given_up.record[numbers])
    assert max(each.extra_m for each in needed(given_up)) >= margins.RESERVE_M - record.clearance_m[deepest[1]]
    assert {each.touching for each in needed(given_up)} == {True}
