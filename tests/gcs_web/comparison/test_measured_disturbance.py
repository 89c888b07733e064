"""Compare shows the measured disturbance beside the residual, with the words of `goshawk compare`."""

import numpy as np
import pytest

import vehicle
from flight import FlightLog, silent
from gcs_web.comparison import residuals
from sysid.estimator.options import Options
from sysid.estimator.result import CHANNELS
from vehicle import manoeuvres

MODEL = vehicle.example("rigter2019")
OPTIONS = Options(max_iterations=20)


@pytest.fixture(scope="module")
def plain() -> FlightLog:
    path, rng = manoeuvres.scaled(manoeuvres.make("vertical"), 0.5), np.random.default_rng(2)
    log = vehicle.flights.measure(vehicle.flights.fly_trajectory(MODEL, path, rng=rng), rng=rng)
    return FlightLog(log.columns, {"name": "up"})


@pytest.fixture(scope="module")
def found(plain) -> FlightLog:
    """An observer that runs from the third second on, and finds 0.4 N downward and 5 mN m about y."""
    n = len(plain)
    runs = plain.time_s > plain.time_s[0] + 3.0
    still = {f"disturbance_force_world_{axis}_n": np.zeros(n) for axis in "xyz"}
    still |= {f"disturbance_torque_body_{axis}_n_m": np.zeros(n) for axis in "xyz"}
    still["disturbance_force_world_z_n"], still["disturbance_torque_body_y_n_m"] = -0.4 * runs, 0.005 * runs
    columns = {**plain.columns, **still, "observer_state": np.where(runs, 2.0, 1.0)}
    return FlightLog(columns, plain.metadata)


def compared(log: FlightLog, folder) -> residuals.FlightResidual:
    shown, _ = residuals.made([log], [], MODEL, "hash", "contents", OPTIONS, silent)
    residuals.save(folder / "comparison.msgpack", shown)
    again = residuals.load(folder / "comparison.msgpack")
    assert again is not None
    return again.flights[0]


def test_it_stands_in_the_plot_of_the_residual_where_the_observer_ran(found, tmp_path):
    flight = compared(found, tmp_path)
    plots = residuals.forces(flight)
    assert all(len(plots[f"residual_{channel}"][1]) == 2 for channel in CHANNELS)
    for channel, size in (("F_z", -0.4), ("M_y", 5.0)):
        _, (_, shown), _ = plots[f"residual_{channel}"]
        assert shown.label == "measured disturbance"
        values = np.array(shown.values, dtype=np.float64)
        ran = np.array(flight.time_s) > found.time_s[0] + 3.1
        assert values[ran] == pytest.approx(np.full(ran.sum(), size), rel=0.02)
        assert np.isnan(values[np.array(flight.time_s) < found.time_s[0] + 2.9]).all()


def test_a_flight_without_an_observer_has_the_residual_alone(plain, tmp_path):
    flight = compared(plain, tmp_path)
    assert flight.disturbance == []
    assert all(len(residuals.forces(flight)[f"residual_{channel}"][1]) == 1 for channel in CHANNELS)
