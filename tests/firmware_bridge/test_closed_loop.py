"""The loop without link and clock: repeatable, and the same controller as anywhere."""

import numpy as np
import pytest

import vehicle
from firmware_bridge import Sensors, closed_loop
from firmware_bridge.controller import RefusedError, State, parameters_of
from flight import Trajectory
from vehicle import simulate

TRUTH = vehicle.example()


def flown(trajectory, seed=1, gusts=0.0, sensors=None, **believed):
    start = simulate.State(trajectory.position([0.0])[0] * [1.0, 1.0, 0.0])
    wind = simulate.Wind(gust_std_m_s=gusts)
    plant = simulate.Plant(TRUTH, start, rng=np.random.default_rng(seed), wind=wind, ground_m=0.0)
    return closed_loop.fly(plant, parameters_of(TRUTH, **believed), trajectory, sensors=sensors, seed=seed)


def test_the_same_seed_gives_the_same_flight(curves):
    noisy = {"gusts": 0.3, "sensors": Sensors.typical()}
    first, same, other = (flown(curves.straight(), seed, **noisy) for seed in (1, 1, 2))
    assert np.array_equal(first.error_world_m, same.error_world_m)
    assert not np.array_equal(first.error_world_m, other.error_world_m)


def test_without_noise_it_flies_as_the_controllers_own_tests_do(curves, flight_of):
    own = flight_of(step_us=closed_loop.TICK_US).fly(curves.straight())
    one_tick_m = 1.0 * closed_loop.TICK_US * 1e-6  # at 1 m/s: there the position is taken one step later
    assert flown(curves.straight()).error_m.mean() == pytest.approx(own.mean(), abs=one_tick_m)


def test_the_log_spans_from_hover_to_hover_at_200_hz(curves):
    log = flown(curves.straight(duration_s=2.0), sensors=Sensors.typical()).log
    states = log.columns["mission_state"]
    assert states[0] == State.HOLD
    assert states[-1] == State.HOLD
    assert (states == State.TRAJECTORY).sum() == pytest.approx(400, abs=2)
    assert np.allclose(np.diff(log.time_s), 0.005)
    assert np.isfinite(log.vector("rotor_speed_rad_s")).all()


def test_a_trajectory_that_the_vehicle_refuses_is_refused_here(curves):
    trajectory = curves.straight()
    broken = Trajectory(trajectory.durations_s / 10.0, trajectory.coefficients)
    with pytest.raises(RefusedError):
        flown(broken)
