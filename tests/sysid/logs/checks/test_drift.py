"""Clocks that run at another pace than the attitude's: named with their size, mended, and none seen where none is."""

import numpy as np
import pytest

import vehicle
from flight import FlightLog
from flight.flight_log import COLUMNS
from sysid.logs.check import check_log
from sysid.logs.fix import fix
from tests.sysid import flying

GYRO, ROTORS = COLUMNS["rate_body_rad_s"], COLUMNS["rotor_speed_rad_s"]


@pytest.fixture(scope="module")
def flown() -> list[FlightLog]:
    rng = np.random.default_rng(3)
    truth = flying.Truth(gust=0.5, gust_torque=1.0)
    paths = flying.paper_flights(rng)
    return flying.fly(truth, paths, 3, duration_s=20.0, rng=rng, rate_hz=100.0, gyro_noise_rad_s=0.02)


def _drifting(log: FlightLog, pace: float, names: tuple[str, ...]) -> FlightLog:
    """Stamps that run ahead: what they hold at t was measured at t (1 + pace)."""
    measured_s = log.time_s + pace * (log.time_s - log.time_s[0])
    drifted = {name: np.interp(measured_s, log.time_s, log.columns[name]) for name in names}
    return FlightLog({**log.columns, **drifted}, {})


def _drifts(log: FlightLog) -> list:
    return [f for f in check_log(log, vehicle.example()).findings if f.what == "clock drift"]


def test_no_drift_is_seen_in_good_flights(flown):
    assert not [f.sentence for log in flown for f in _drifts(log)]


@pytest.mark.parametrize("pace", [-5e-3, 2e-3])
def test_a_drifting_gyro_is_named_with_its_pace_and_mended(flown, pace):
    for log in (flown[0], flown[2]):
        wrong = _drifting(log, pace, GYRO)
        (found,) = _drifts(wrong)
        assert found.level == "error"
        assert found.sentence.startswith("the gyro comes ever")
        assert found.repair is not None
        assert found.repair.factor == pytest.approx(1.0 + pace, abs=0.2 * abs(pace))
        mended = fix(wrong, vehicle.example())
        assert any("multiplied the time stamps" in sentence for sentence in mended.done)
        assert not _drifts(mended.log)
        gyro, truth = (
            np.stack([np.interp(log.time_s, one.time_s, one.columns[name]) for name in GYRO])
            for one in (mended.log, log)
        )
        inner = slice(100, -100)
        assert np.std((gyro - truth)[:, inner]) < 0.05 * np.std(truth[:, inner])


def test_gyro_and_rotors_that_share_a_drifting_clock_are_mended_together(flown):
    (found,) = _drifts(_drifting(flown[2], 4e-3, (*GYRO, *ROTORS)))
    assert found.sentence.startswith("the gyro, as rotor speed, comes ever")
    assert found.repair is not None
    assert set(ROTORS) < set(found.repair.columns)


def test_where_nothing_shows_which_clock_rotor_speed_is_on_nothing_is_stretched(flown):
    (found,) = _drifts(_drifting(flown[1], 5e-3, GYRO))
    assert found.repair is None
