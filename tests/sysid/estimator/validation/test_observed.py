"""The measured disturbance beside the residual: the same force, on the same clock, in the same axes."""

from dataclasses import replace

import numpy as np
import pytest

import sysid
import vehicle
from firmware_bridge import Sensors, closed_loop
from firmware_bridge.controller import parameters_of
from flight import FlightLog
from sysid.estimator.validation import observed as observer
from vehicle import manoeuvres, simulate

FILE = vehicle.example("rigter2019")


@pytest.fixture(scope="module")
def log() -> FlightLog:
    """A vehicle 5 % heavier than its file, with its centre of mass 4 mm beside the file's, in a wind of 2 m/s."""
    path = manoeuvres.scaled(manoeuvres.make("fast_level"), 0.6)
    heavy = FILE.with_value("mass_kg", 1.05 * FILE.mass_kg)
    heavy = heavy.with_value("centre_of_mass.y_m", FILE.value("centre_of_mass.y_m") + 0.004)
    start = simulate.State(path.position([0.0])[0] * [1.0, 1.0, 0.0])
    plant = simulate.Plant(
        heavy, start, rng=np.random.default_rng(1), wind=simulate.Wind((2.0, 0.0, 0.0), 0.2), ground_m=0.0
    )
    return closed_loop.fly(plant, parameters_of(FILE), path, sensors=Sensors.typical(), imu=True).log


def without(log: FlightLog, *beginnings: str) -> FlightLog:
    return FlightLog({n: v for n, v in log.columns.items() if not n.startswith(beginnings)}, log.metadata)


def test_it_is_what_the_vehicles_own_model_leaves_unexplained(log):
    compared = sysid.compare([log], {"file": FILE})
    (one,) = compared.residuals["file"]
    found, left = one.disturbance_means(), one.means()
    assert found is not None
    assert found[:, :3].mean(axis=0) == pytest.approx(left[:, :3].mean(axis=0), abs=0.02)
    assert found[:, 3:].mean(axis=0) == pytest.approx(left[:, 3:].mean(axis=0), abs=0.001)
    assert abs(found[:, 3].mean()) > 0.02  # the bent torque
    assert np.corrcoef(found[:, 2], left[:, 2])[0, 1] > 0.6  # it is a little late, and both have their noise
    rms = compared.disturbance_rms()
    assert rms is not None
    assert rms[2:4] == pytest.approx(compared.wrench_rms("file")[2:4], rel=0.1)
    assert list(compared.as_dict()["measured_disturbance_rms"].values()) == rms.tolist()


def test_where_the_observer_did_not_run_nothing_is_said(log):
    state = log.columns["observer_state"].copy()
    state[(log.time_s > log.time_s[0] + 2.0) & (log.time_s < log.time_s[0] + 3.0)] = 3.0  # holds
    found = observer.observed(FlightLog({**log.columns, "observer_state": state}, log.metadata))
    assert found is not None
    inside = observer.wrench_at(found, log.time_s[0] + np.array([-1.0, 1.0, 2.5, 3.5, 1e3]))
    assert np.isfinite(inside).all(axis=1).tolist() == [False, True, False, True, False]


@pytest.mark.parametrize("gone", ["disturbance", "observer_state", "q_world_body"])
def test_a_log_without_it_has_none(log, gone):
    assert observer.observed(without(log, gone)) is None


@pytest.mark.parametrize("state", [0.0, 1.0, 3.0, 4.0, np.nan])
def test_an_observer_that_never_ran_has_measured_nothing(log, state):
    columns = {**log.columns, "observer_state": np.full(len(log), state)}
    assert observer.observed(replace(log, columns=columns)) is None


def test_a_log_without_its_noise_still_opens(log):
    found = observer.observed(without(log, "disturbance_torque_std", "disturbance_force_std"))
    assert found is not None
    assert np.isnan(found.force_std_n).all()
