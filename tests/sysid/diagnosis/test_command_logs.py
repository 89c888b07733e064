"""Logs of commands without rotor speed: what lies between command and rotor speed is a candidate like all others."""

import numpy as np
import pytest

import vehicle
from flight import FlightLog
from flight.flight_log import COLUMNS
from sysid import Options, identify
from sysid.diagnosis import diagnose
from sysid.diagnosis.evidence import free_form
from sysid.diagnosis.evidence.candidates import candidate_set
from sysid.diagnosis.examined import best_curve, examine
from sysid.diagnosis.thresholds import THRESHOLDS
from sysid.estimator.flights.flight_data import Flight
from sysid.estimator.prepare import prepare
from sysid.estimator.trajectory.states import States, first_guess
from tests.sysid import flying

LAG_S = 0.03
"""Of the simulated motors."""
SAG_PER_V = 0.04
SPEEDS = tuple(f"rotor_speed_{i}_rad_s" for i in range(4))


def commanded(log: FlightLog, rng: np.random.Generator, *, sag_per_v: float = 0.0, volts: bool = True) -> FlightLog:
    """The flight as commands logged it, by an emptying battery: commands rise so that the rotors turn as before."""
    battery_v = np.linspace(16.6, 15.2, len(log))
    rise = 1.0 / (1.0 - sag_per_v * (16.8 - battery_v))
    columns = {n: v * rise if "command" in n else v for n, v in log.columns.items() if n not in SPEEDS}
    if volts:
        columns["battery_v"] = battery_v + 0.02 * rng.standard_normal(len(log))
    return FlightLog(columns, log.metadata)


def guessed(flights: list[Flight]) -> list[States]:
    return [first_guess(flight, np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])) for flight in flights]


@pytest.fixture(scope="module")
def without_lag(truth) -> vehicle.Vehicle:
    return truth.without_effect("motor_lag")


def test_lag_and_sag_are_candidates_of_commands_alone(campaign, without_lag):
    rng = np.random.default_rng(0)
    flights = prepare(commanded(campaign[2], rng), 0, Options())
    lined = candidate_set(without_lag, flights)
    assert {"motor_lag", "battery_sag"} <= {s.name for s in lined.candidates}
    assert lined.all_heard
    assert lined.candidate("motor_lag").one_sided == (True, True)
    measured = candidate_set(without_lag, prepare(campaign[2], 0, Options()))
    assert {"motor_lag", "battery_sag", "pose_delay"} <= {name for name, _ in measured.invisible}


def test_a_late_pose_is_not_said_to_be_estimated_where_commands_are_the_only_other_stream(campaign, without_lag):
    log = commanded(campaign[2], np.random.default_rng(0))
    turning = FlightLog({**log.columns, **dict.fromkeys(COLUMNS["rate_body_rad_s"], log.time_s)}, log.metadata)
    for flown, why in ((turning, "estimated already"), (log, "without gyro or rotor speed")):
        lined = candidate_set(without_lag, prepare(flown, 0, Options()))
        assert why in dict(lined.invisible)["pose_delay"]


def test_without_voltage_no_curve_is_sure_for_sag_could_not_be_asked(campaign, without_lag):
    log = commanded(campaign[2].slice(0.0, 8.0), np.random.default_rng(0), volts=False)
    model = examine(identify([log], without_lag, Options(gusts="white")))
    assert "battery_sag" in {name for name, _ in model.candidate_set.invisible}
    assert not model.all_heard
    curve = best_curve(model, ("M_x", "M_y"))  # the lag's, which the model lacks
    assert curve is not None
    assert curve.confidence <= THRESHOLDS.even_confidence


def test_curves_of_commands_may_depend_on_voltage_and_on_the_rate_of_the_command(campaign, without_lag):
    by_command = prepare(commanded(campaign[2], np.random.default_rng(0)), 0, Options())
    names = {c.variable for c in free_form.curves(by_command, guessed(by_command), without_lag)}
    assert {"voltage", "dc_0/dt", "dc_3/dt"} <= names
    measured = prepare(campaign[2], 0, Options())
    names = {c.variable for c in free_form.curves(measured, guessed(measured), without_lag)}
    assert not {"voltage", "dc_0/dt"} & names


@pytest.mark.slow
@pytest.mark.parametrize("hidden", [("motor_lag",), ("battery_sag",), ("motor_lag", "battery_sag")])
@pytest.mark.parametrize("seed", [0, 1])
def test_hidden_lag_and_sag_are_named_with_their_size(truth, hidden, seed):
    rng = np.random.default_rng(seed)
    flown = flying.Truth(gust=0.1, gust_torque=0.3, lag=LAG_S)
    logs = flying.fly(flown, flying.paper_flights(rng, 1, 0.1), 3, duration_s=16.0, rng=rng, rate_hz=100.0)
    sag = SAG_PER_V if "battery_sag" in hidden else 0.0
    given = truth.without_effect("motor_lag") if "motor_lag" in hidden else truth
    found = diagnose([commanded(log, rng, sag_per_v=sag) for log in logs], given, auto=True)
    assert set(found.additions) == set(hidden)
    assert found.outside is None
    if "motor_lag" in hidden:
        assert found.vehicle.value("motor_lag.rise_s") == pytest.approx(LAG_S, rel=0.05)
    if sag:
        assert found.vehicle.value("battery_sag.sag_per_v") == pytest.approx(sag, rel=0.1)
