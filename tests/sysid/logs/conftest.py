"""One flight with a gyro for all tests of logs."""

import numpy as np
import pytest

from flight import FlightLog


@pytest.fixture(scope="session")
def log(flying) -> FlightLog:
    """Ten seconds of the paper's rotation flight at 100 Hz."""
    rng = np.random.default_rng(5)
    reference = flying.paper_flights(rng)
    return flying.fly(flying.Truth(), reference, 3, duration_s=10.0, rng=rng, rate_hz=100.0, gyro_noise_rad_s=0.02)[2]
