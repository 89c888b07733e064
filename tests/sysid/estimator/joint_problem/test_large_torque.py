"""A large moment that the model lacks bends neither thrust nor, once it is in the model, anything else."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import sysid
import vehicle
from flight import FlightLog
from flight.flight_log import from_vectors
from sysid.diagnosis import diagnose
from sysid.estimator.identification import start
from sysid.estimator.joint_problem import driven_band
from sysid.estimator.joint_problem.unknowns import Unknowns, biases
from sysid.estimator.prepare import prepare

ROLL, PITCH = 1.6e-5, 2.4e-5
"""N m s2/rad per rotor: the moment balances most of the rotors' torque, as on a nano-drone."""
DISC = 2.0 * 1.2 * np.pi * 0.0635**2
INERTIA = tuple(f"inertia_{axis}_kg_m2" for axis in ("xx", "yy", "zz"))
THRUST = "thrust_bem.k1_n_s2"


def skewed_wake(velocity, rate, speed, factor=1.0):
    """n v_ind v / |air through the disc|, from the vehicle's own speed and a quarter of its weight on each rotor."""
    edgewise = np.hypot(velocity[:, 0], velocity[:, 1])
    lift_n = 0.78 * 3.119e-6 * (speed**2).mean(axis=1)  # inflow takes a fifth of k1 n^2
    induced = np.full(len(velocity), 5.0)
    for _ in range(8):
        through = np.hypot(edgewise, velocity[:, 2] + induced)
        induced = 0.5 * (induced + lift_n / (DISC * through))
    share = (speed * (induced / np.hypot(edgewise, velocity[:, 2] + induced))[:, None]).sum(axis=1)
    torque = np.stack([ROLL * share * velocity[:, 1], -PITCH * share * velocity[:, 0], 0.0 * share], axis=1)
    return np.zeros_like(torque), factor * torque


@pytest.fixture(scope="module")
def logs(flying) -> list[FlightLog]:
    """Three flights of the paper's vehicle with a moment of the wakes that nobody told the model of."""
    rng = np.random.default_rng(12)
    return flying.fly(
        replace(flying.Truth(), extra=skewed_wake), flying.paper_flights(rng), 3, duration_s=6.0, rng=rng, rate_hz=50.0
    )


@pytest.mark.slow
def test_a_moment_that_makes_an_impossible_body_of_white_disturbances_is_named_with_lasting_ones(flying, truth):
    """White, yaw inertia comes out 3.1 times as large: above mass times arm squared."""
    rng = np.random.default_rng(12)
    hidden = replace(flying.Truth(), extra=partial(skewed_wake, factor=1.3))
    logs = flying.fly(hidden, flying.paper_flights(rng), 3, duration_s=6.0, rng=rng, rate_hz=50.0)
    found = diagnose(logs, truth)
    assert found.additions == ("wake_skew_moment",)
    assert "lasting disturbances" in found.findings[0]
    assert found.fit_verdict.use == "usable"
    for name in INERTIA:
        assert found.vehicle.value(name) == pytest.approx(truth.value(name), rel=0.02)


@pytest.fixture(scope="module")
def at_start(logs, truth):
    """Flights, unknowns and where a fit starts that lacks the moment."""
    flights = [f for i, log in enumerate(logs) for f in prepare(log, i, sysid.Options())]
    unknowns = Unknowns((THRUST, INERTIA[0]), (), tuple(biases(flights)))
    return flights, unknowns, *start(truth, flights)


def test_the_moment_of_the_wakes_is_recovered(logs, truth):
    fit = sysid.identify(logs, truth.with_effect("wake_skew_moment"))
    assert fit.converged
    for name, planted in (("roll", ROLL), ("pitch", PITCH)):
        assert fit.estimate(f"wake_skew_moment.{name}_kg_m").value == pytest.approx(planted, rel=0.05)
    for name in INERTIA[:2]:
        assert fit.estimate(name).value == pytest.approx(truth.value(name), rel=0.03)


@pytest.fixture(scope="module")
def shaken(truth):
    """Hover in which the rotors shake roll and pitch at 4 to 9 Hz, under a slow moment that the model lacks."""
    time_s = np.arange(0.0, 8.0, 0.01)
    roll, pitch = 6.0 * np.sin(2 * np.pi * 4.0 * time_s), 8.0 * np.sin(2 * np.pi * 9.0 * time_s)
    left, front = np.sign(truth.hub_body_m[:, 1]), np.sign(truth.hub_body_m[:, 0])
    speed = vehicle.invert.hover(truth) + roll[:, None] * left - pitch[:, None] * front
    still = np.zeros((len(time_s), 3))
    turning = vehicle.acceleration(truth, still, still, speed)[1]
    turning[:, 0] += 3.0 * np.sin(2 * np.pi * 0.5 * time_s)
    rate = 0.01 * np.cumsum(turning - turning.mean(axis=0), axis=0)
    level = np.tile([1.0, 0.0, 0.0, 0.0], (len(time_s), 1))
    vectors = {"position_world_m": still, "q_world_body": level, "rate_body_rad_s": rate, "rotor_speed_rad_s": speed}
    flights = prepare(from_vectors(time_s, vectors), 0, sysid.Options())
    return flights, start(truth, flights)[0].states


@pytest.mark.parametrize("factor", [0.1, 8.0])
def test_inertias_start_where_the_rotors_turn_the_body(shaken, truth, factor):
    wrong = truth
    for name in INERTIA:
        wrong = wrong.with_value(name, factor * truth.value(name))
    found = driven_band.started(wrong, *shaken, INERTIA[:1])
    assert found.value(INERTIA[0]) == pytest.approx(truth.value(INERTIA[0]), rel=0.05)
    for name in INERTIA[1:]:  # not asked for
        assert found.value(name) == wrong.value(name)


def test_an_inertia_that_is_nearly_right_stays(shaken, truth):
    assert driven_band.started(truth, *shaken, INERTIA) is truth


def test_where_the_rotors_shake_nothing_the_start_is_the_vehicles(at_start, truth):
    flights, _, point, _ = at_start
    heavy = truth.with_value(INERTIA[0], 3.0 * truth.value(INERTIA[0]))
    assert driven_band.started(heavy, flights, point.states, INERTIA) is heavy
