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
    fast = draft.draft(sheet(0.72, 0.125, 0.127, rotor_speed_max_rad_s=28_000 * np.pi / 30)).limits
    assert (guessed.speed_m_s, guessed.acceleration_m_s2, guessed.tilt_rad) == (3.0, 4.0, 0.5)
    assert fast.speed_m_s >= 8.0
    assert fast.tilt_rad >= 0.75


@given(ratio=st.floats(1.05, 12.0), name=st.sampled_from(NAMES))
def test_the_rotors_give_what_is_asked_for(ratio, name):
    model = with_ratio(ratio)
    asked = presets.limits(model, name)
    g = model.gravity_m_s2
    rounded = 1.06  # two digits
    assert 1.0 / np.cos(asked.tilt_rad) <= rounded * ratio
    assert np.hypot(g, asked.acceleration_m_s2) <= rounded * ratio * g  # level
    assert g + asked.acceleration_m_s2 <= rounded * ratio * g  # upwards
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


def test_the_firmwares_full_stick_bounds_the_turn_rates():
    known = replace(sheet(0.72, 0.125, 0.127), full_stick_rad_s=(7.0, 5.0, 2.0))
    asked = draft.draft(known, limits="race").limits
    assert asked.rate_rad_s == pytest.approx(4.0)
    assert asked.yaw_rate_rad_s == pytest.approx(1.6)
