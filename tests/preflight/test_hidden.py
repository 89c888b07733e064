"""What a map may have missed: a probability beside the flights', that takes its part of the accepted risk."""

from dataclasses import replace

import numpy as np
import pytest

import preflight
from esdf.visibility import CouldHide, Stretch
from preflight import core, hidden, statistics
from preflight.hidden import Hidden
from preflight.rare import Rare, Risk
from tests.preflight.conftest import EXACT, Wall

PLACE = (1.0, 2.0, 3.0)


def stated(probability: float) -> Hidden:
    return Hidden(probability, PLACE, "left/7.png")


@pytest.mark.parametrize("told", [None, 0.0, 0.2, 1.0])
def test_either_happens_no_less_often_than_each_and_no_more_than_both(told):
    found = None if told is None else stated(told)
    for flown in (0.0, 0.1, 1.0):
        both = hidden.together(flown, found)
        assert max(flown, told or 0.0) <= both <= min(flown + (told or 0.0), 1.0)


@pytest.mark.parametrize("share", [0.0, 0.3, 0.8])
def test_what_is_left_to_the_flights_and_what_is_hidden_make_the_accepted_risk(share):
    risk = 0.01
    left = hidden.left_of(risk, stated(share * risk))
    assert left + share * risk == pytest.approx(risk)
    assert hidden.together(left, stated(share * risk)) <= risk
    assert preflight.Options(risk=risk, hidden=stated(share * risk)).count == statistics.flights_for(left)


def test_a_place_that_stands_out_is_told_with_its_image_and_of_an_unknown_map_nothing():
    stretch = Stretch(1.0, 2.0, 0.03, 0.05, PLACE, "left/7.png")
    found = CouldHide(0.2, 0.05, 0.5, (0.0, 0.0, 0.0), 0.03, 0.1, 0.04, (stretch,))
    assert Hidden.of(found) == Hidden(0.04, PLACE, "left/7.png")
    assert "left/7.png" in stated(0.04).remedy()
    assert Hidden.of(replace(found, stretches=())) == Hidden(0.04, (0.0, 0.0, 0.0))
    assert Hidden.of(replace(found, probability=None)) is None
    assert Hidden.of(None) is None


def flown(drone, curve, of: Hidden | None) -> preflight.Result:
    options = preflight.Options(flights=60, risk=0.08, uncertainty=EXACT, explain=False, hidden=of)
    return preflight.fly(preflight.Scenario(drone, curve, Wall(2.0), radius_m=0.2, clearance_m=1.0), options)


def test_flights_that_are_all_good_are_a_go_only_with_room_for_what_is_hidden(drone, curve):
    without, little, much = (flown(drone, curve, of) for of in (None, stated(0.01), stated(0.2)))
    assert without.lost.count == little.lost.count == much.lost.count == 0
    assert without.go
    assert little.go
    assert not much.go
    assert "1.0e-02 of it hidden" in little.reason()
    assert "hidden in the map" in much.reason()
    assert little.as_dict()["risk"] == without.as_dict()["risk"]
    assert little.as_dict()["risk_with_hidden"]["upper95"] > without.as_dict()["risk"]["upper95"]
    assert without.as_dict()["risk_with_hidden"] is None
    assert without.as_dict()["hidden"] is None


def test_no_refusal_states_a_risk_that_is_accepted(drone, curve):
    """What is hidden alone nearly takes the accepted risk, or together with the flights' bound passes it."""
    nearly, beside = (flown(drone, curve, stated(chance)) for chance in (0.078, 0.06))
    assert not nearly.go
    assert "7.8e-02, which leaves the flights too little to show; 0.08 is accepted" in nearly.reason()
    assert not beside.go
    few_lost = replace(beside.record, clearance_m=np.where(np.arange(60) < 4, -0.1, beside.record.clearance_m))
    lossy = replace(beside, record=few_lost, hidden=stated(0.03))
    assert not lossy.go
    assert f"at most {lossy.upper:.1e} (3.0e-02 of it hidden things); 0.08 is accepted" in lossy.reason()
    assert lossy.upper > 0.08


def test_a_refusal_by_levels_states_the_whole_bound(drone, curve):
    """Of the levels alone the bound may be what is accepted."""
    beside = flown(drone, curve, stated(0.03))
    for reached in (True, False):
        risk = Risk(20, 1000, 0.06, chance=0.055, reached=reached, levels=2)
        rare = replace(beside, rare=Rare(risk, beside.record, {}, False))
        assert not rare.go
        assert f"at most {rare.upper:.1e} (3.0e-02 of it hidden things)" in rare.reason()


def test_the_method_goes_by_the_accepted_risk_and_counts_what_is_left_of_it():
    for chance in (2e-6, 1.5e-4, 6e-4):
        options = preflight.Options(risk=1e-3, hidden=stated(chance))
        assert not options.by_levels
        assert options.count == statistics.flights_for(1e-3 - chance)
    assert preflight.Options(risk=1e-3, hidden=stated(8.5e-4)).by_levels


def test_what_is_hidden_moves_no_flight(drone, curve):
    one, other = flown(drone, curve, None).record, flown(drone, curve, stated(0.01)).record
    assert (one.clearance_m == other.clearance_m).all()


def test_a_plan_that_more_than_a_tenth_of_the_flights_give_up_is_no_go_though_none_is_lost(drone, curve):
    safe = flown(drone, curve, None)
    for given_up, go in ((6, True), (7, False)):
        endings = np.where(np.arange(60) < given_up, core.TIMED_OUT, core.FINISHED)
        found = replace(safe, record=replace(safe.record, ending=endings))
        assert found.lost.count == 0
        assert found.go is go
    assert found.reason() == "only 88 % of the flights come to the end"
