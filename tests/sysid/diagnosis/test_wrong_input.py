"""A log or a vehicle file that is wrong makes a diagnosis unsure, never confidently wrong."""

from dataclasses import replace

import pytest

from flight import FlightLog
from sysid import Options
from sysid.diagnosis import Diagnosis, Verdict, diagnose
from sysid.estimator.verdict import Use


@pytest.fixture(scope="module")
def reversed_spins(campaign, truth):
    return diagnose(campaign[1:], replace(truth, spin=-truth.spin))


@pytest.mark.slow
def test_a_log_that_contradicts_the_vehicle_file_leaves_nothing_sure(reversed_spins):
    assert reversed_spins.fit_verdict.use is Use.REJECTED
    assert "spin" in reversed_spins.verdict
    assert reversed_spins.confidence <= 0.5
    assert all(s.verdict is not Verdict.EXCLUDED and s.confidence <= 0.5 for s in reversed_spins.candidates)


def leaves_nothing_sure(found: Diagnosis) -> None:
    assert found.fit_verdict.against  # it may still predict better, and be written for that alone
    assert found.fit_verdict.use in (Use.REJECTED, Use.PREDICTION)
    assert found.attempts
    assert not [s.name for s in found.candidates if s.verdict is Verdict.EXCLUDED]
    said = (found, *found.candidates, *found.attempts, *((found.outside,) if found.outside else ()))
    assert max(one.confidence for one in said) <= 0.5


@pytest.mark.slow
def test_one_flight_in_another_rotor_order_leaves_nothing_sure_though_nothing_is_against_the_fit(campaign, truth):
    """It was held out, so that no fit has seen it."""
    log = campaign[2]
    swapped = {f"rotor_speed_{i}_rad_s": log.columns[f"rotor_speed_{1 - i}_rad_s"] for i in range(2)}
    without = truth.without_effect("rotor_drag_thrust")
    flown = [log.slice(0.0, 8.0) for log in campaign[:2]]
    found = diagnose(flown, without, held_out=[FlightLog({**log.columns, **swapped}, log.metadata)])
    assert not found.search.models[-1].fit.verdict.against
    assert "do not follow the rotors in this order" in found.input_verdict.against[0]
    assert found.input_verdict.against[0] in found.verdict
    leaves_nothing_sure(found)


@pytest.mark.slow
def test_a_fit_that_does_not_converge_leaves_nothing_sure_though_the_logs_are_good(campaign, truth):
    without = truth.without_effect("rotor_drag_thrust")
    flown = [log.slice(0.0, 8.0) for log in campaign[:2]]
    found = diagnose(flown, without, options=Options(gusts="white", max_iterations=1))
    assert found.input_verdict.use is Use.USABLE
    leaves_nothing_sure(found)


@pytest.mark.slow
def test_logs_that_agree_with_the_vehicle_file_cast_no_doubt(campaign, truth):
    found = diagnose(campaign[1:], truth)
    assert found.input_verdict.use is Use.USABLE
    assert found.additions == ()
    assert found.confidence > 0.5


def cut(log: FlightLog) -> FlightLog:
    """With two gaps of 0.3 s."""
    kept = ~((log.time_s > 5.0) & (log.time_s < 5.3) | (log.time_s > 10.0) & (log.time_s < 10.3))
    return FlightLog({name: values[kept] for name, values in log.columns.items()}, log.metadata)


@pytest.mark.slow
def test_gaps_change_no_name(campaign, truth):
    without = truth.without_effect("rotor_drag_thrust")
    found = diagnose([cut(log) for log in campaign], without, options=Options(gusts="white", gaps="split"))
    assert found.additions == ("rotor_drag_thrust",)
