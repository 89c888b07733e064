"""What is put in place of measured rotor speed: as much of it as is the rotors', and errors no fit can see."""

import numpy as np
import pytest
from scipy import signal

from sysid.estimator.flights.smoothing import most_likely

RATE_HZ = 200.0
MIX = 0.5 * np.array([[1, 1, 1, 1], [1, 1, -1, -1], [1, -1, -1, 1], [1, -1, 1, -1]], dtype=float)
"""Thrust, roll, pitch and yaw of four rotors."""


def true_speed(rng: np.random.Generator, seconds: float = 36.0) -> np.ndarray:
    """(n, 4) rad/s: much thrust, less yaw, little roll and pitch, through motors and a controller that reach 3 Hz."""
    n = round(seconds * RATE_HZ)
    slow = signal.butter(3, 3.0, fs=RATE_HZ, output="sos")
    moves = signal.sosfiltfilt(slow, rng.standard_normal((n + 400, 4)), axis=0)[200:-200]
    return 600.0 + (moves / moves.std(axis=0) * [80.0, 15.0, 10.0, 40.0]) @ MIX


def slopes(true: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """Slope of true thrust, roll, pitch and yaw over those seen: less than 1 is what makes inertia too large."""
    true, seen = (x @ MIX - (x @ MIX).mean(axis=0) for x in (true, seen))
    return (true * seen).sum(axis=0) / (seen * seen).sum(axis=0)


def test_the_error_that_remains_is_uncorrelated_with_what_the_fit_sees() -> None:
    rng = np.random.default_rng(1)
    found = []
    for _ in range(6):
        true = true_speed(rng)
        measured = true + 4.0 * rng.standard_normal(true.shape)
        time_s = np.arange(len(true)) / RATE_HZ
        found.append((slopes(true, measured), slopes(true, most_likely(time_s, measured))))
    raw, calm = np.mean(found, axis=0)
    assert raw[2] < 0.9
    assert calm == pytest.approx(np.ones(4), abs=0.01)


def test_most_of_the_noise_is_gone() -> None:
    rng = np.random.default_rng(2)
    true = true_speed(rng)
    measured = true + 4.0 * rng.standard_normal(true.shape)
    calm = most_likely(np.arange(len(true)) / RATE_HZ, measured)
    assert np.std(calm - true) < 0.3 * np.std(measured - true)


def test_a_signal_without_noise_passes_whole() -> None:
    true = true_speed(np.random.default_rng(3))
    calm = most_likely(np.arange(len(true)) / RATE_HZ, true)
    assert np.abs(calm - true).max() < 0.05


@pytest.mark.parametrize("speed", [np.full((4000, 4), 500.0), np.zeros((4000, 4))], ids=["steady", "at rest"])
def test_a_constant_stays_what_it_is(speed: np.ndarray) -> None:
    np.testing.assert_allclose(most_likely(np.arange(4000) / RATE_HZ, speed), speed, atol=1e-9)


def test_a_signal_too_short_for_a_spectrum_comes_back_as_it_is() -> None:
    speed = true_speed(np.random.default_rng(4), seconds=0.5)
    assert most_likely(np.arange(len(speed)) / RATE_HZ, speed) is speed


def test_the_order_of_the_rotors_does_not_matter() -> None:
    rng = np.random.default_rng(5)
    measured = true_speed(rng) + 4.0 * rng.standard_normal((7200, 4))
    time_s = np.arange(7200) / RATE_HZ
    turned = most_likely(time_s, measured[:, [2, 0, 3, 1]])
    np.testing.assert_allclose(turned, most_likely(time_s, measured)[:, [2, 0, 3, 1]], atol=1e-9)
