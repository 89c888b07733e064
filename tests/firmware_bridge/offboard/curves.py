"""Courses for flights off board, from hover to hover."""

import numpy as np

from flight import FloatArray, Trajectory
from tests.firmware_bridge.conftest import fitted

RAMP_S = 3.0


def circle(*, speed_m_s: float = 2.25, radius_m: float = 1.5, height_m: float = 1.5, laps: int = 1) -> Trajectory:
    """Round the origin, heading kept."""

    def place(angle: FloatArray) -> FloatArray:
        return np.stack(
            [radius_m * np.cos(angle), radius_m * np.sin(angle), np.full_like(angle, height_m), 0.0 * angle], axis=-1
        )

    return _ridden(place, speed_m_s / radius_m, laps)


def eight(*, speed_m_s: float = 5.0, length_m: float = 4.0, height_m: float = 2.0, laps: int = 1) -> Trajectory:
    """A figure of eight along x; `speed_m_s` is its largest, where it crosses itself."""
    width_m = length_m / 2.0

    def place(angle: FloatArray) -> FloatArray:
        xy = [length_m * np.sin(angle), width_m * np.sin(2.0 * angle)]
        return np.stack([*xy, height_m + 0.3 * np.sin(angle), 0.0 * angle], axis=-1)

    return _ridden(place, speed_m_s / float(np.hypot(length_m, 2.0 * width_m)), laps)


def hover(*, height_m: float = 1.5, seconds: float = 5.0) -> Trajectory:
    """In one place."""
    return fitted(lambda t: np.stack([0.0 * t, 0.0 * t, height_m + 0.0 * t, 0.0 * t], axis=-1), np.ones(int(seconds)))


def _ridden(place, rate_rad_s: float, laps: int) -> Trajectory:
    """`laps` turns at a rate that rises and falls smoothly over twice `RAMP_S`."""
    full_s = 2.0 * np.pi * laps / rate_rad_s

    def risen(t: FloatArray) -> FloatArray:
        s = np.clip(t / (2.0 * RAMP_S), 0.0, 1.0)
        return 2.0 * RAMP_S * (s**6 - 3.0 * s**5 + 2.5 * s**4) + np.maximum(t - 2.0 * RAMP_S, 0.0)

    def curve(t: FloatArray) -> FloatArray:
        t = np.asarray(t)
        return place(rate_rad_s * (risen(t) - risen(t - full_s)))

    end_s = full_s + 2.0 * RAMP_S
    pieces = int(np.ceil(end_s / 0.5))
    return fitted(curve, np.full(pieces, end_s / pieces))
