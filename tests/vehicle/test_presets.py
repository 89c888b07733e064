"""Limits that fit a vehicle: they rise with its thrust and with the preset, and its rotors can keep them."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import vehicle
from flight import InputError
from tests.vehicle.test_draft import sheet
from vehicle import draft, presets

NAMES = list(presets.PRESETS)
FITTED = ("speed_m_s", "acceleration_m_s2", "tilt_rad", "rate_rad_s", "yaw_rate_rad_s")


def with_ratio(ratio: float) -> vehicle.Vehicle:
    """Five inches whose rotors lift so many times its weight."""
    plain = draft.draft(sheet(0.72, 0.125, 0.127))
    most = plain.limits.rotor_speed_max_rad_s * np.sqrt(ratio / presets.thrust_to_weight(plain))
    return plain.with_limits(rotor_speed_max_rad_s=float(most))


def test_a_fast_data_sheet_gets_limits_of_its_own_and_a_guess_stays_careful():
    guessed = draft.draft(sheet(0.72, 0.125, 0.127)).limits
    most, hover = 28_000 * np.pi / 30, 11_500 * np.pi / 30
    half_known = draft.draft(sheet(0.72, 0.125, 0.127, rotor_speed_max_rad_s=most)).limits  # thrust known to a third
    fast = draft.draft(sheet(0.72, 0.125, 0.127, rotor_speed_max_rad_s=most, hover_rad_s=hover)).limits
    assert (guessed.speed_m_s, guessed.acceleration_m_s2, guessed.tilt_rad) == (2.9, 3.9, 0.5)
    assert half_known.tilt_rad == 0.5
    assert half_known.rate_rad_s == guessed.rate_rad_s
    assert fast.speed_m_s >= 8.0
    assert fast.tilt_rad >= 0.75


@given(ratio=st.floats(1.05, 12.0), name=st.sampled_from(NAMES))
def test_the_rotors_give_what_is_asked_for(ratio, name):
    model = with_ratio(ratio)
    asked = presets.limits(model, name)
    g = model.gravity_m_s2
    most = 1.0 + presets.PRESETS[name].thrust_share * (ratio - 1.0) + 1e-6
    assert 1.0 / np.cos(asked.tilt_rad) <= most
    assert np.hypot(g, asked.acceleration_m_s2) <= most * g  # level
    assert g + asked.acceleration_m_s2 <= most * g  # upwards
    assert asked.speed_m_s <= presets.PRESETS[name].braking_s * asked.acceleration_m_s2 + 1e-9
    assert presets.beyond_thrust(replace(model, limits=asked)) == []
    assert asked.rotor_speed_max_rad_s == model.limits.rotor_speed_max_rad_s


@given(ratio=st.floats(1.05, 6.0), more=st.floats(1.0, 2.0))
def test_more_thrust_and_a_bolder_preset_never_ask_for_less(ratio, more):
    asked = [presets.limits(with_ratio(ratio), name) for name in NAMES]
    stronger = [presets.limits(with_ratio(more * ratio), name) for name in NAMES]
    for field in FITTED:
        values = [getattr(limits, field) for limits in asked]
        assert values == sorted(values)
        assert all(getattr(b, field) >= v for b, v in zip(stronger, values, strict=True))


def test_what_does_not_lift_and_what_is_no_preset_are_refused():
    with pytest.raises(InputError, match=r"lifts 0\.80 of its weight"):
        presets.limits(with_ratio(0.8), "usual")
    with pytest.raises(InputError, match="careful, usual, race"):
        presets.limits(with_ratio(2.0), "fast")


def test_limits_beyond_the_thrust_are_told_with_the_figure():
    model = with_ratio(1.5)
    weak = model.with_limits(acceleration_m_s2=6.0, tilt_rad=1.0)
    acceleration, tilt = presets.beyond_thrust(weak)
    assert "acceleration_m_s2 is 6; the rotors lift 1.50 times the weight: 4.9 upwards" in acceleration
    assert "tilt_rad is 1" in tilt
    assert "0.84" in tilt


def test_the_ratios_std_is_that_of_thrust_and_mass():
    model = draft.draft(sheet(0.72, 0.125, 0.127))
    k = model.parameter("thrust_quadratic.k_n_s2")
    share = presets.thrust_to_weight_std(model) / presets.thrust_to_weight(model)
    assert share == pytest.approx(k.std / k.value, rel=0.01)
    heavier = model.with_value("mass_kg", 0.72, std=0.072)
    share = presets.thrust_to_weight_std(heavier) / presets.thrust_to_weight(heavier)
    assert share == pytest.approx(np.hypot(k.std / k.value, 0.1), rel=0.01)


@pytest.mark.parametrize("full", [[1.0, 2.0], [1.0, 2.0, float("nan")], [1.0, -2.0, 3.0], ["1", "2", "3"], 4.0])
def test_a_full_stick_that_is_none_is_refused_by_its_name(full):
    model = with_ratio(2.0)
    wrong = replace(model, provenance={**model.provenance, presets.FULL_STICK: full})
    with pytest.raises(InputError, match=r"provenance\.full_stick_rad_s is .* three positive numbers"):
        presets.limits(wrong, "usual")


def test_the_firmwares_full_stick_bounds_the_turn_rates():
    known = replace(sheet(0.72, 0.125, 0.127), full_stick_rad_s=(7.0, 5.0, 2.0))
    asked = draft.draft(known, limits="race").limits
    assert asked.rate_rad_s == pytest.approx(4.0)
    assert asked.yaw_rate_rad_s == pytest.approx(1.6)
