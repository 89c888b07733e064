"""More room by segment: what flights miss, and only where room is what is missing."""

from dataclasses import replace

import numpy as np
import pytest

import preflight
from preflight import core, margins, statistics
from tests.preflight.conftest import EXACT, Wall

OPTIONS = preflight.Options(
    flights=60, risk=0.05, uncertainty=replace(EXACT, localization_std_m=0.03), explain=False
)  # fmt: skip


@pytest.fixture(scope="module")
def touching(drone, curve):
    return preflight.fly(preflight.Scenario(drone, curve, Wall(0.25), radius_m=0.2), OPTIONS)


def test_a_wall_farther_away_by_what_was_asked_is_a_go(drone, curve, touching):
    assert not touching.go
    extra_m = max(each.extra_m for each in margins.needed(touching))
    farther = preflight.fly(preflight.Scenario(drone, curve, Wall(0.25 + extra_m), radius_m=0.2), OPTIONS)
    assert farther.go
    nearer = preflight.fly(preflight.Scenario(drone, curve, Wall(0.25 + 0.5 * extra_m), radius_m=0.2), OPTIONS)
    assert not nearer.go
    assert margins.needed(farther) == ()


def test_each_segment_is_asked_for_what_its_own_flights_miss(touching, curve):
    found = margins.needed(touching)
    record = touching.record
    segments = curve.segment_at(np.nan_to_num(record.path_s))[0]
    for each in found:
        mine = record.touched & (segments == each.segment)
        assert each.extra_m == pytest.approx(margins.RESERVE_M - record.clearance_m[mine].min())
        assert each.flights == mine.sum()
        assert (each.from_s, each.to_s) == (curve.starts_s[each.segment], curve.starts_s[each.segment + 1])


def test_as_many_of_the_deepest_are_let_be_as_the_risk_allows(touching):
    lost = int(touching.record.lost.sum())
    spared = lost // 2
    accepted = replace(touching, risk=statistics.upper_bound(spared, 60) + 1e-9)
    assert 1 <= spared < lost
    assert not accepted.go
    deepest = np.sort(touching.record.clearance_m)[spared]
    assert max(each.extra_m for each in margins.needed(accepted)) == pytest.approx(margins.RESERVE_M - deepest)
    strict = replace(touching, risk=1e-5)
    assert max(each.extra_m for each in margins.needed(strict)) == pytest.approx(
        margins.RESERVE_M - touching.record.clearance_m.min()
    )


def test_flights_that_fall_are_not_cured_by_room(touching):
    fallen = replace(touching, record=replace(touching.record, fell=np.ones(60, bool)))
    assert margins.needed(fallen) == ()


def test_flights_that_are_given_up_ask_for_more_than_the_room_they_were_given(touching):
    record = replace(
        touching.record,
        ending=np.full(60, core.FAILSAFE),
        clearance_m=np.full(60, 0.1),
        error_m=np.full(touching.record.error_m.shape, 0.08, np.float32),
    )
    record.error_m[:20] = 0.4  # a few wild ones do not decide
    (found,) = margins.needed(replace(touching, record=record))
    assert not found.touching
    assert found.segment == 1
    assert found.extra_m == pytest.approx(0.04)


def given_up(result, count):
    """The same, its first flights given up where they touched."""
    ending = np.where(np.arange(60) < count, core.FAILSAFE, core.FINISHED)
    clearance_m = np.where(np.arange(60) < count + 1, -0.02, 0.3)
    return replace(result, record=replace(result.record, ending=ending, clearance_m=clearance_m))


def test_flights_given_up_that_touch_are_let_be_as_often_as_the_risk_allows_and_counted_once(touching):
    accepted = replace(touching, risk=statistics.upper_bound(2, 60) + 1e-9)
    found = margins.needed(given_up(accepted, 2))  # and one more touches that comes to its end
    assert [(each.touching, each.flights) for each in found] == [(True, 1)]
    found = margins.needed(given_up(accepted, 3))
    assert {each.touching for each in found} == {True, False}
    assert margins.needed(given_up(accepted, 1)) == ()  # two are lost: a go


def test_flights_that_are_farther_off_than_room_cures_ask_for_none(touching):
    deepest = int(touching.record.clearance_m.argmin())

    def with_deepest(clearance_m):
        values = touching.record.clearance_m.copy()
        values[deepest] = clearance_m
        return margins.needed(replace(touching, record=replace(touching.record, clearance_m=values), risk=1e-5))

    least_m = margins.RESERVE_M - margins.MOST_M
    assert max(each.extra_m for each in with_deepest(least_m + 1e-6)) == pytest.approx(margins.MOST_M, abs=1e-5)
    assert with_deepest(least_m - 1e-6) == ()
