"""Calibration: a truth flown by another loop than a preflight's, its frequencies beside the predicted ones.

The truth is the loop in Python round `vehicle.simulate.Plant`: from a take-off, at 400 Hz, in steps of 1 ms, gusts of
another form (first-order Gauss-Markov on world axes), drawn by other streams of numbers. Controller and equations of
motion are shared; the latter in NumPy's form fly beside a preflight in tests/preflight/test_core.py.
"""

import functools
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

import preflight
import vehicle
from firmware_bridge import Sensors, closed_loop
from firmware_bridge.controller import parameters_of
from preflight.result import BINS
from tests.preflight.conftest import EXACT, Wall, exact_vehicle, there_and_back
from vehicle import simulate

UNKNOWN = {"motor_lag.rise_s": 0.15, "parasitic_drag.drag_xy_kg_m": 0.3, "thrust_bem.k1_n_s2": 0.03}
"""Relative standard deviations of what the model does not know well."""
GUST_M_S = 0.5
FROM_M = 1.0
"""The wall begins here, so that hovers before and after, which the truth does not record, do not count."""
CURVE = there_and_back(5.0, 2.0)
AIR = replace(EXACT, wind_m_s=2.0, gust_std_m_s=GUST_M_S)


class AlongTheWay(Wall):
    def distance(self, points_world_m):
        return np.where(np.asarray(points_world_m)[:, 0] > FROM_M, super().distance(points_world_m), 9.0)


def believed() -> vehicle.Vehicle:
    drone = exact_vehicle()
    for name, ratio in UNKNOWN.items():
        drone = drone.with_value(name, drone.value(name), std=ratio * drone.value(name))
    return drone


@functools.cache
def true_flights(count: int) -> tuple[np.ndarray, np.ndarray]:
    """(count, BINS) largest errors along the trajectory, and (count,) how far to the right it came."""
    rng, drone = np.random.default_rng(77), believed()
    errors, sideways = np.full((count, BINS), np.nan), np.full(count, np.nan)
    for i in range(count):
        truth = drone
        for name, ratio in UNKNOWN.items():
            truth = truth.with_value(name, drone.value(name) * (1.0 + ratio * rng.standard_normal()))
        angle = rng.uniform(0.0, 2.0 * np.pi)
        plant = simulate.Plant(
            truth, simulate.State(CURVE.position([0.0])[0] * [1.0, 1.0, 0.0]), rng=rng, ground_m=0.0,
            wind=simulate.Wind((2.0 * np.cos(angle), 2.0 * np.sin(angle), 0.0), GUST_M_S, 1.4),
        )  # fmt: skip
        flown = closed_loop.fly(
            plant, parameters_of(drone), CURVE, sensors=Sensors.typical(), seed=int(rng.integers(1 << 30)), imu=True
        )
        errors[i], sideways[i] = kept(flown)
    return errors, sideways


def kept(flown: closed_loop.Flown) -> tuple[np.ndarray, float]:
    """(BINS,) largest errors along the trajectory, and how far to the right it came."""
    n = len(flown.error_m)
    share = np.minimum(np.arange(n) * BINS // n, BINS - 1)
    away = CURVE.position(np.arange(n) * closed_loop.TICK_US * 1e-6)[:, 0] > FROM_M
    return np.array([flown.error_m[share == j].max() for j in range(BINS)]), float(flown.error_world_m[away, 1].min())


@functools.cache
def predicted(flights: int) -> preflight.Result:
    options = preflight.Options(
        flights=flights, uncertainty=AIR, risk=0.4, explain=False, rate_hz=400, rotor_speed_measured=True
    )  # as the truth's controller is run and told
    return preflight.fly(
        preflight.Scenario(believed(), CURVE, AlongTheWay(0.0), radius_m=0.0, clearance_m=1.0), options
    )


def held(count: int, flights: int) -> tuple[float, float]:
    """Shares of the true flights inside the predicted tubes of 90 and 99 %, at each time of the trajectory."""
    errors, _ = true_flights(count)
    _, ninety, ninety_nine = predicted(flights).tube_m()
    return float(np.mean(errors <= ninety)), float(np.mean(errors <= ninety_nine))


def frequencies(count: int, flights: int) -> list[tuple[float, float]]:
    """Predicted and seen probability of touching walls at several distances on the right side."""
    _, sideways = true_flights(count)
    near = predicted(flights).record.clearance_m
    walls_m = -np.quantile(near, (0.05, 0.1, 0.3))
    return [(float(np.mean(near < -wall)), float(np.mean(sideways < -wall))) for wall in walls_m]


def test_the_tube_holds_fresh_flights_of_other_code():
    ninety, ninety_nine = held(6, 100)
    assert 0.7 < ninety < 0.99
    assert ninety_nine > 0.95


@pytest.mark.slow
def test_the_tube_and_the_contacts_of_many_fresh_flights_are_as_predicted():
    ninety, ninety_nine = held(300, 2000)
    assert 0.86 < ninety < 0.94
    assert ninety_nine > 0.975
    for expected, seen in frequencies(300, 2000):
        assert agree(expected, round(300 * seen), 300)


def agree(expected: float, count: int, truths: int) -> bool:
    """Whether the exact interval (99.8 %) round what was seen reaches what was predicted, to a quarter of it."""
    low, high = stats.binomtest(count, truths).proportion_ci(0.998)
    return bool(low <= 1.25 * expected and high >= expected / 1.25)


def test_a_contact_that_was_predicted_and_never_seen_does_not_agree():
    assert not agree(0.05, 0, 300)
    assert not agree(0.05, 35, 300)
    assert not agree(0.3, 40, 300)
    assert agree(0.05, 12, 300)
