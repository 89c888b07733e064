"""What an air speed that nobody measured may have moved, and the speed that the accelerometer shows."""

from dataclasses import replace

import numpy as np
import pytest

import sysid
from flight import rotations
from flight.frames import GRAVITY_M_S2
from sysid.estimator import from_imu
from sysid.estimator.trajectory.states import States
from sysid.estimator.uncertainty.errors import standard_errors
from sysid.estimator.without_pose import airspeed, left_out, told


@pytest.fixture(scope="module")
def fitted():
    import without_pose_flights as flights

    rng = np.random.default_rng(21)
    (log,) = flights.flown(flights.body(), flights.drawn(1, rng), rng, duration_s=8.0)
    return sysid.identify([log], flights.start())


def test_speed_is_the_specific_force_integrated_in_the_worlds_axes(fitted):
    """Half a turn of yaw and a lasting tilt of the accelerometer change nothing."""
    step_s, n = 0.004, 3000
    time_s = step_s * np.arange(n)
    truth = np.stack([np.sin(6.0 * time_s), np.cos(5.0 * time_s), 0.5 * np.sin(4.0 * time_s)], axis=1)
    force = np.gradient(truth, step_s, axis=0) + np.array([0.2, 0.0, GRAVITY_M_S2])
    half_turn = np.tile([0.0, 0.0, 0.0, 1.0], (n, 1))
    body = rotations.rotate(rotations.conjugate(half_turn), force)[:-1]
    flight = replace(fitted.flights[0], time_s=time_s)
    flight = replace(flight, readings={**flight.readings, "specific_force_body_m_s2": body})
    states = States(np.zeros((n, 3)), np.zeros((n, 3)), half_turn, np.zeros((n, 3)))
    found = rotations.rotate(half_turn[:-1], airspeed.velocity_body_m_s(flight, states))
    inside = slice(750, -750)
    np.testing.assert_allclose(found[inside], truth[:-1][inside], atol=0.08)


def test_a_fit_moves_as_far_as_is_stated_when_the_force_of_the_air_speed_is_added(fitted, monkeypatch):
    """Of its usual size in full, as the added force is of that size."""
    monkeypatch.setattr(left_out, "possible", lambda *_: np.eye(len(airspeed.CAUSES)))
    flight = fitted.flights[0]
    solution = from_imu.identify(
        [flight], fitted.vehicle, sysid.Options(), fitted.given, lambda *_: None, effects=(), near=fitted
    ).solution
    lift = airspeed.CAUSES.index("translational_lift")
    added = airspeed.felt(flight, solution.point, solution.point.states[0])[lift]
    rate = flight.rate_body_rad_s.copy()
    rate[1:] += np.cumsum(added[:, 3:] * flight.step_s[:, None], axis=0)
    force = flight.specific_force_body_m_s2 + added[:, :3]
    moved = from_imu.identify(
        [replace(flight, readings={**flight.readings, "rate_body_rad_s": rate, "specific_force_body_m_s2": force})],
        fitted.vehicle, sysid.Options(), fitted.given, lambda *_: None, effects=(), near=fitted,
    )  # fmt: skip
    i = fitted.unknowns.names.index("inertia_zz_kg_m2")
    stated = solution.shifts[i, lift]
    gone = moved.vehicle.value("inertia_zz_kg_m2") - fitted.vehicle.value("inertia_zz_kg_m2")
    assert abs(stated) > 1e-3 * fitted.vehicle.value("inertia_zz_kg_m2")
    assert gone == pytest.approx(stated, rel=0.5)


def test_the_stated_errors_hold_what_an_air_speed_may_have_moved(fitted):
    flights, unknowns, solution = fitted.flights, fitted.unknowns, fitted.solution
    without = replace(solution, shifts=np.zeros_like(solution.shifts))
    errors, less = (standard_errors(flights, unknowns, one, ()) for one in (solution, without))
    np.testing.assert_allclose(errors.robust**2 - less.robust**2, (solution.shifts**2).sum(axis=1), rtol=1e-6)
    at = np.array([0.48])
    half, smaller = (told.thrust_by_command(flights, one, unknowns, at)[1][0] for one in (solution, without))
    assert half > smaller > 0.0
