"""The compiled loop from command to rotor speed against plain steps and against finite differences."""

import numpy as np
import pytest

import vehicle
from sysid.estimator.flights.flight_data import Flight, LeadIn
from sysid.estimator.motors import motor


@pytest.fixture(scope="module")
def flight() -> Flight:
    """Commands that wander, held for some milliseconds each, by an emptying battery."""
    rng = np.random.default_rng(1)
    n, m = 60, 8
    step_s = rng.uniform(0.003, 0.01, n - 1)
    command = 900.0 + np.cumsum(rng.normal(0.0, 25.0, (n - 1 + m, 4)), axis=0)
    volts = np.linspace(16.5, 15.0, n - 1 + m)
    unmeasured = np.full((n - 1, 4), np.nan)
    return Flight(
        name="commands",
        log_index=0,
        time_s=np.concatenate([[0.0], np.cumsum(step_s)]),
        readings={},
        rotor_speed_rad_s=unmeasured,
        rotor_acceleration_rad_s2=unmeasured,
        rotor_command_rad_s=command[m:],
        battery_v=volts[m:],
        lead_in=LeadIn(np.full(m, 0.01), command[:m], volts[:m]),
    )


def motors(rise_s: float, fall_s: float) -> vehicle.Vehicle:
    truth = vehicle.example().with_effect("battery_sag", sag_per_v=0.03)
    return truth.with_value("motor_lag.rise_s", rise_s).with_value("motor_lag.fall_s", fall_s)


def test_the_compiled_loop_is_that_of_plain_steps(flight):
    model = motors(0.03, 0.05)
    plain = [values[..., 0] for values in motor.simulated(flight, model, {})]
    speed, acceleration, _, _ = motor.lagged(flight, model)
    # Runge-Kutta of fourth order is off by (step / time constant)^5 / 120, some 1e-5 of a change of 25 rad/s
    np.testing.assert_allclose(speed, plain[0], atol=0.01)
    np.testing.assert_allclose(acceleration, plain[1], atol=2.0)


@pytest.mark.parametrize(("rise_s", "fall_s"), [(0.03, 0.05), (1.1e-4, 1.1e-4)])
def test_its_derivatives_are_those_of_finite_differences(flight, rise_s, fall_s):
    model = motors(rise_s, fall_s)
    found = motor.lagged(flight, model)[2:]
    for column, name in enumerate(motor.PARAMETERS):
        step = 1e-4 * model.value(name)
        moved = (model.with_value(name, model.value(name) + sign * step) for sign in (1.0, -1.0))
        high, low = (motor.lagged(flight, one)[:2] for one in moved)
        for by, above, below in zip(found, high, low, strict=True):
            expected = (above - below) / (2.0 * step)
            np.testing.assert_allclose(by[:, :, column], expected, rtol=1e-5, atol=1e-2 + 1e-6 * np.abs(expected).max())


def test_without_lag_the_rotors_follow_at_once(flight):
    model = motors(0.03, 0.05).without_effect("motor_lag").without_effect("battery_sag")
    speed, acceleration, by_speed, _ = motor.lagged(flight, model)
    np.testing.assert_array_equal(speed, flight.rotor_command_rad_s)
    change = np.diff(speed, axis=0) / flight.step_s[1:, None]
    np.testing.assert_allclose(acceleration[1:], change, rtol=1e-9, atol=1e-6)
    assert np.isfinite(by_speed).all()
