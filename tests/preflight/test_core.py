"""The batched closed loop: the same bits however it is run, and the same flight as the loop in Python."""

from dataclasses import replace

import numpy as np
import pytest

import preflight
from firmware_bridge import Sensors, closed_loop
from firmware_bridge.controller import RefusedError, parameters_of
from flight import InputError, Trajectory
from preflight import core, draws
from tests.preflight.conftest import EXACT
from vehicle import simulate

WINDY = replace(preflight.Uncertainty(), wind_m_s=2.0, gust_std_m_s=1.0, drop_outs_per_s=0.5)


def loop_of(form, curve, drone, **options) -> core.Loop:
    return core.Loop(form, curve, parameters_of(drone), clearance_m=1.0, **options)


def same(one: core.Flown, other: core.Flown) -> bool:
    names = core.Flown.__slots__
    return all(np.array_equal(getattr(one, n), getattr(other, n), equal_nan=True) for n in names if n != "steps")


def test_one_and_three_threads_give_the_same_bits(form, curve, drone):
    loop = loop_of(form, curve, drone)
    drawn = draws.draw(form, loop.names, WINDY, 7, seed=3)
    alone, shared = (loop.fly(drawn.values, drawn.rows, seed=3, threads=n) for n in (1, 3))
    assert same(alone, shared)
    assert alone.steps == shared.steps


def test_a_flight_does_not_depend_on_those_beside_it(form, curve, drone):
    loop = loop_of(form, curve, drone)
    drawn = draws.draw(form, loop.names, WINDY, 5, seed=3)
    whole = loop.fly(drawn.values, drawn.rows, seed=3)
    last = loop.fly(drawn.values[4:], drawn.rows[4:], seed=3, numbers=np.array([4]))
    assert np.array_equal(whole.position_world_m[4:], last.position_world_m, equal_nan=True)
    assert not np.array_equal(whole.error_m[3], whole.error_m[4], equal_nan=True)


def test_without_noise_it_flies_as_the_loop_in_python(form, curve, drone):
    perfect = Sensors()
    start = simulate.State(curve.position([0.0])[0] * [1.0, 1.0, 0.0])
    plant = simulate.Plant(drone, start, ground_m=0.0)
    own = closed_loop.fly(plant, parameters_of(drone), curve, sensors=perfect, imu=True)
    loop = loop_of(form, curve, drone, sensors=perfect, rate_hz=400)
    drawn = draws.draw(form, loop.names, replace(EXACT, pose_delay_s=0.0), 1, seed=1)
    flown = loop.fly(drawn.values, drawn.rows, seed=1)
    on = np.isfinite(flown.path_s[0]) & (flown.state[0] == closed_loop.State.TRAJECTORY)
    at = np.rint(flown.path_s[0][on] / (closed_loop.TICK_US * 1e-6)).astype(int)
    inside = at < len(own.error_m)
    assert inside.sum() > 400
    assert np.abs(flown.error_m[0][on][inside] - own.error_m[at[inside]]).max() < 2e-3


def test_a_steady_wind_is_cancelled_and_gusts_are_felt(form, curve, drone):
    loop = loop_of(form, curve, drone, sensors=replace(Sensors(), delay_s=EXACT.pose_delay_s))
    error_m = []
    for air in (EXACT, replace(EXACT, wind_m_s=3.0), replace(EXACT, wind_m_s=3.0, gust_std_m_s=2.0)):
        drawn = draws.draw(form, loop.names, air, 6, seed=1)
        flown = loop.fly(drawn.values, drawn.rows, seed=1)
        error_m.append(float(np.mean(flown.error_m[np.isfinite(flown.path_s)])))
    calm, windy, gusty = error_m
    assert windy < calm + 0.02
    assert gusty > 1.25 * windy


def test_a_lost_pose_ends_in_a_failsafe(form, curve, drone):
    loop = loop_of(form, curve, drone)
    drawn = draws.draw(form, loop.names, replace(EXACT, drop_outs_per_s=10.0, drop_out_s=5.0), 4, seed=1)
    assert (loop.fly(drawn.values, drawn.rows, seed=1).ending == core.FAILSAFE).all()


def test_a_trajectory_that_the_vehicle_refuses_is_refused_here(form, curve, drone):
    with pytest.raises(RefusedError, match="segment"):
        loop_of(form, Trajectory(curve.durations_s / 8.0, curve.coefficients * 8.0 ** np.arange(6)), drone)


def test_a_control_rate_that_the_observer_does_not_bear_is_refused(form, curve, drone):
    with pytest.raises(InputError, match="400 to 1000"):
        loop_of(form, curve, drone, rate_hz=200)
