"""What cannot be right is said in a sentence: a wrong mass, two vehicles in one fit, an inertia held far off."""

from dataclasses import replace

import numpy as np
import pytest

import sysid
from flight import FlightLog, InputError


def _fly(flying, **changed: float) -> list[FlightLog]:
    rng = np.random.default_rng(9)
    truth = replace(flying.Truth(), **changed)
    return flying.fly(truth, flying.paper_flights(rng), 3, duration_s=8.0, rng=rng, rate_hz=100.0)


@pytest.fixture(scope="module")
def same(flying) -> list[FlightLog]:
    return _fly(flying)


def test_a_wrong_mass_is_pointed_at_by_the_thrust(same, truth):
    heavy = truth.with_value("mass_kg", 1.3 * truth.mass_kg)
    findings = sysid.identify(same, heavy).findings
    assert any("1.30 times the vehicle file's" in s and "weigh the vehicle" in s for s in findings)


def test_flights_of_one_vehicle_with_its_right_mass_raise_no_doubt(same, truth):
    findings = sysid.identify(same, truth).findings
    assert not any("weigh the vehicle" in s or "does not fit" in s for s in findings)


def test_a_flight_of_another_vehicle_is_named(flying, same, truth):
    loaded = _fly(flying, mass=0.84)
    findings = sysid.identify([same[0], loaded[1], same[2]], truth).findings
    doubts = [s for s in findings if "does not fit the other flights" in s]
    assert doubts
    assert doubts[0].startswith("flight 2 ")
    assert "standard errors" in doubts[0]


def test_a_flight_that_excites_what_the_model_lacks_is_named_with_the_way_to_find_it(same, truth):
    """All are of one vehicle: the fast one alone shows the drag of its rotors."""
    findings = sysid.identify(same, truth.without_effect("rotor_drag_thrust")).findings
    doubts = [s for s in findings if "does not fit the other flights" in s]
    assert doubts
    assert "else an effect may be missing" in doubts[0]
    assert "`goshawk diagnose`" in doubts[0]


def test_an_inertia_held_far_off_is_pointed_at(same, truth):
    """Six times too small, it leaves thrust and torque no common answer."""
    wrong = truth.with_value("inertia_xx_kg_m2", 5e-4).with_value("inertia_yy_kg_m2", 7e-4)
    options = sysid.Options(held=("inertia_xx_kg_m2", "inertia_yy_kg_m2"))
    findings = sysid.identify(same[2:], wrong, options).findings
    assert any("unexplained" in s and "held" in s for s in findings)


def test_repeated_time_stamps_are_refused(same, truth):
    time_s = same[0].time_s.copy()
    time_s[40] = time_s[39]
    with pytest.raises(InputError, match="40"):
        sysid.identify([FlightLog({**same[0].columns, "time_s": time_s}, {})], truth)


def test_effects_that_read_their_surroundings_can_be_fitted(campaign, truth):
    """Wind needs the attitude, ground effect the height: the sentences about thrust must not trip over them."""
    for effect in ("constant_wind", "ground_effect"):
        found = sysid.identify(campaign, truth.with_effect(effect), sysid.Options(node_rate_hz=50.0, gusts="white"))
        assert found.converged
