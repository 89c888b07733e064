"""The low-pass of an accelerometer, between means over intervals."""

import numpy as np
import pytest

from flight import FlightLog
from sysid.logs.sensors import low_pass
from sysid.logs.sensors.low_pass import LowPass

STEP_S, FINE = 0.005, 500


@pytest.mark.parametrize("damping", [1.0, np.sqrt(0.5)])
def test_means_are_those_of_a_fine_simulation(damping):
    """Of an input that is constant over each interval, by small steps of the differential equation."""
    passed = LowPass(2.0 * np.pi * 25.0, damping)
    means = np.random.default_rng(1).standard_normal((60, 2)).cumsum(axis=0)
    output, slope, dt = means[0].copy(), np.zeros(2), STEP_S / FINE
    simulated = np.zeros_like(means)
    for k, value in enumerate(means):
        for _ in range(FINE):
            simulated[k] += output / FINE
            bend = passed.natural_rad_s**2 * (value - output) - 2.0 * damping * passed.natural_rad_s * slope
            slope = slope + dt * bend
            output = output + dt * slope
    assert passed.means(means, STEP_S) == pytest.approx(simulated, abs=0.01 * np.abs(means).max())


def test_a_constant_passes_whole():
    assert LowPass(150.0, 1.0).means(np.full((40, 3, 2), 4.2), STEP_S) == pytest.approx(4.2)


def test_it_comes_back_from_a_log():
    passed = LowPass(244.0, 1.0)
    assert low_pass.of(FlightLog({"time_s": np.arange(2.0)}, passed.metadata())) == passed


@pytest.mark.parametrize(
    "said", ["wide", {}, {"natural_rad_s": "wide", "damping": 1.0}, {"natural_rad_s": -1.0, "damping": 1.0}]
)
def test_what_a_foreign_file_says_of_it_is_taken_only_if_it_is_one(said):
    assert low_pass.of(FlightLog({"time_s": np.arange(3.0)}, {low_pass.KEY: said})) is None


def test_whole_numbers_of_a_column_map_are_numbers():
    said = {low_pass.KEY: {"natural_rad_s": 244, "damping": 1}}
    assert low_pass.of(FlightLog({"time_s": np.arange(3.0)}, said)) == LowPass(244.0, 1.0)
