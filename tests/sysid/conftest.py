"""One simulated campaign for all tests: vertical, fast level and rotation flights of the paper's vehicle."""

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest

import vehicle
from flight import FlightLog, flight_log


def _load_flying():
    spec = importlib.util.spec_from_file_location("sysid_test_flying", Path(__file__).with_name("flying.py"))
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def flying():
    """The independent simulator."""
    return _load_flying()


@pytest.fixture(scope="session")
def campaign(flying, made_once) -> list[FlightLog]:
    def fly(folder: Path) -> None:
        rng = np.random.default_rng(7)
        logs = flying.fly(flying.Truth(), flying.paper_flights(rng), 3, duration_s=11.0, rng=rng, rate_hz=100.0)
        for i, log in enumerate(logs):
            flight_log.save(folder / f"{i}.parquet", log)

    return [flight_log.load(path) for path in sorted(made_once("campaign", fly).glob("*.parquet"))]


@pytest.fixture(scope="session")
def truth() -> vehicle.Vehicle:
    return vehicle.example("rigter2019")


@pytest.fixture(scope="session")
def wrong_start(truth) -> vehicle.Vehicle:
    """The same vehicle with every estimated number 40 to 80 % wrong."""
    factors = {
        "inertia_xx_kg_m2": 1.6,
        "inertia_yy_kg_m2": 0.5,
        "inertia_zz_kg_m2": 1.7,
        "thrust_bem.k1_n_s2": 0.6,
        "thrust_bem.k2_n_s2_m": 0.4,
        "rotor_drag_thrust.drag_s_m": 0.3,
        "parasitic_drag.drag_xy_kg_m": 1.8,
        "parasitic_drag.drag_z_kg_m": 0.4,
        "rotor_yaw_torque.torque_n_m_s2": 1.6,
        "centre_of_mass.x_m": 0.2,
        "centre_of_mass.y_m": 0.2,
        "pose_sensor_x_m": 0.4,
        "pose_sensor_y_m": 0.2,
        "pose_sensor_z_m": 0.2,
    }
    wrong = truth
    for name, factor in factors.items():
        wrong = wrong.with_value(name, truth.value(name) * factor)
    return wrong
