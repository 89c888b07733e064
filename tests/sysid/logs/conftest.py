"""One flight with a gyro for all tests of logs."""

from pathlib import Path

import numpy as np
import pytest

from flight import FlightLog, flight_log


@pytest.fixture(scope="session")
def log(flying, made_once) -> FlightLog:
    """Ten seconds of the paper's rotation flight at 100 Hz."""

    def fly(folder: Path) -> None:
        rng = np.random.default_rng(5)
        reference = flying.paper_flights(rng)
        logs = flying.fly(flying.Truth(), reference, 3, duration_s=10.0, rng=rng, rate_hz=100.0, gyro_noise_rad_s=0.02)
        flight_log.save(folder / "log.parquet", logs[2])

    return flight_log.load(made_once("rotation_flight", fly) / "log.parquet")
