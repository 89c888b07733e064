"""The motion of a log from its pose alone, smoothed on a uniform grid: what the other channels are judged by."""

from dataclasses import dataclass

import numpy as np

from flight import FlightLog, rotations
from flight.frames import GRAVITY_M_S2
from flight.rotations import FloatArray

GRID_S = 0.01
WINDOW = 15
"""Samples of the local cubic fits: 0.15 s."""
FARTHEST_M = 1e8
"""Of a position: beyond, it is damage, and squares of it overflow."""
LONGEST_S = 1e4
"""A longer log is in another unit of time; the check of the time base says so."""
LEAST_SAMPLES = 50
"""Fewer samples of a quantity are not judged."""


@dataclass(frozen=True, slots=True)
class Kinematics:
    """Smoothed motion on a uniform grid."""

    time_s: FloatArray
    velocity_world_m_s: FloatArray
    velocity_noise_m_s: FloatArray
    """(3,) standard deviation of what the position's noise makes of the velocity."""
    specific_force_world_m_s2: FloatArray
    """(n, 3) acceleration less gravity: what the rotors and the air do, per mass."""
    q: FloatArray
    rate_body_rad_s: FloatArray
    angular_acceleration_rad_s2: FloatArray


def kinematics(log: FlightLog) -> Kinematics | None:
    """Motion from the pose alone; None without enough of it."""
    if not (log.has("position_world_m") and log.has("q_world_body")):
        return None
    position, q = log.vector("position_world_m"), log.vector("q_world_body")
    rows = np.flatnonzero((np.abs(position) < FARTHEST_M).all(axis=1) & np.isfinite(q).all(axis=1))
    if len(rows) < LEAST_SAMPLES or log.time_s[rows[-1]] - log.time_s[rows[0]] < 100 * GRID_S:
        return None
    first_s, last_s = float(log.time_s[rows[0]]), float(log.time_s[rows[-1]])
    if last_s - first_s > LONGEST_S:
        return None
    time_s = np.arange(first_s, last_s, GRID_S)
    q_grid = resampled(time_s, log.time_s[rows], rotations.continuous(q[rows]))
    norm = np.linalg.norm(q_grid, axis=1, keepdims=True)
    q_grid = q_grid / np.where(norm > 0.0, norm, 1.0)
    rate = 2.0 * rotations.multiply(rotations.conjugate(fitted(q_grid, 0)), fitted(q_grid, 1))[:, 1:]
    grid = resampled(time_s, log.time_s[rows], position[rows])
    return Kinematics(
        time_s=time_s,
        velocity_world_m_s=fitted(grid, 1),
        velocity_noise_m_s=_slope_noise(grid, float(np.median(np.diff(log.time_s[rows])))),
        specific_force_world_m_s2=fitted(grid, 2) + np.array([0.0, 0.0, GRAVITY_M_S2]),
        q=rotations.normalise(fitted(q_grid, 0)),
        rate_body_rad_s=rate,
        angular_acceleration_rad_s2=fitted(rate, 1),
    )


def resampled(at: FloatArray, time_s: FloatArray, values: FloatArray) -> FloatArray:
    return np.stack([np.interp(at, time_s, column) for column in values.T], axis=1)


def fitted(values: FloatArray, derivative: int) -> FloatArray:
    from scipy.signal import savgol_filter

    return np.asarray(savgol_filter(values, WINDOW, 3, deriv=derivative, delta=GRID_S, axis=0))


def _slope_noise(grid: FloatArray, step_s: float) -> FloatArray:
    """Noise of `fitted(grid, 1)` by what the fit leaves of the samples, which were `step_s` apart before resampling."""
    from scipy.signal import savgol_coeffs

    left = grid - fitted(grid, 0)
    kept = savgol_coeffs(WINDOW, 3)
    share = np.sqrt(np.sum((np.eye(WINDOW)[WINDOW // 2] - kept) ** 2))  # of white noise that the fit leaves
    gain = np.linalg.norm(savgol_coeffs(WINDOW, 3, deriv=1, delta=GRID_S))
    fewer = np.sqrt(max(step_s / GRID_S, 1.0))  # interpolated samples are no new ones
    return left.std(axis=0) / share * gain * fewer


def sampled(log: FlightLog, quantity: str) -> bool:
    """Whether a log has a quantity, and enough of it to judge."""
    return log.has(quantity) and int(np.isfinite(log.vector(quantity)).all(axis=1).sum()) >= LEAST_SAMPLES


def on_grid(log: FlightLog, quantity: str, time_s: FloatArray) -> FloatArray:
    values = log.vector(quantity)
    rows = np.isfinite(values).all(axis=1)
    return fitted(resampled(time_s, log.time_s[rows], values[rows]), 0)


def correlation(a: FloatArray, b: FloatArray) -> float:
    a, b = a - a.mean(), b - b.mean()
    size = float(np.sqrt((a @ a) * (b @ b)))
    return float(a @ b) / size if size > 0.0 else 0.0
