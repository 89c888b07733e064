"""Which of three manoeuvres a log without a pose holds, and whether each is enough for a fit.

Throttle steps decide the curve of thrust by command, and with its slope every inertia; rolls and pitches the inertias
about x and y; yaws the yaw torque over the inertia about z. How well is asked by a regression of what the IMU shows on
what the motors were told, through a lag, with the noise made white: no vehicle file, and no order of the rotors,
is needed.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from flight import FlightLog
from flight.rotations import FloatArray
from sysid.logs.checks import contact
from sysid.logs.motors import full_throttle

STEP_S = 0.05
"""The regression is on means over this long: a controller answers noise of the gyro within less, and on finer means
commands seemed to explain the IMU however calmly a twin was flown."""
LAGS_S = (0.02, 0.03, 0.045, 0.065, 0.09, 0.13)
"""Motor lags that are tried."""
IMU = 4
"""Columns of the IMU behind those of the motors: force along the thrust, and three rates."""
ORDER = 4
"""Of the autoregression that makes what is left white."""
SHORTEST_S = 1.5
"""Stretches that are shorter are left out."""
WANTED = 0.03
"""Standard error as a share that suffices: a 90 % interval within 5 %."""
PRESENT = 0.15
"""An expected error above this: the manoeuvre is not in the log."""
STILL = 1e-3
"""Standard deviation of what commands amount to, as a share of the largest: below, they do not vary."""
SLOWEST_HZ = 90.0
"""Samples of the IMU: below, motor lag, latency and inertia are one number."""
LAGS_FOLLOWED = 6.0
"""A lag's response is followed for so many lags."""


@dataclass(frozen=True, slots=True)
class Manoeuvre:
    """One of the three, as a log holds it."""

    name: str
    decides: str
    """What a fit learns from it."""
    fly: str
    """How to fly it."""
    error: float
    """Standard error that a fit is expected to have of that, as a share; infinite where nothing shows."""

    @property
    def enough(self) -> bool:
        return self.error <= WANTED

    @property
    def sentence(self) -> str:
        if self.enough:
            return f"{self.name}: enough for {self.decides} (error {self.error:.1%} expected, {WANTED:.0%} suffice)"
        if self.error > PRESENT:
            return f"{self.name}: not in this log; {self.decides} will not be found. Fly them: {self.fly}"
        longer = math.ceil(1.0 + (self.error / WANTED) ** 2) if self.error > 1.1 * WANTED else 2
        return (
            f"{self.name}: too little for {self.decides} (error {self.error:.1%} expected, {WANTED:.0%} suffice). Fly "
            f"them {longer} times as long, or harder: {self.fly}"
        )

    def as_dict(self) -> dict[str, Any]:
        return {
            "name": self.name,
            "decides": self.decides,
            "expected_error": self.error if np.isfinite(self.error) else None,
            "enough": self.enough,
            "sentence": self.sentence,
        }


@dataclass(frozen=True, slots=True, eq=False)
class _Piece:
    """A stretch in the air, in means over `STEP_S`."""

    command: FloatArray
    """(k, r) shares of the largest."""
    shown: FloatArray
    """(k - 1, 4) force along the thrust and angular acceleration, m/s2 and rad/s2."""


def found(log: FlightLog) -> tuple[Manoeuvre, ...]:
    """The three manoeuvres; none where the log has a pose, is too slow, or has not all that a fit without one needs."""
    log = full_throttle.by_limit(log, 1.0)
    drive = next((q for q in ("rotor_speed_rad_s", full_throttle.COMMAND) if log.has(q)), "")
    imu = ("rate_body_rad_s", "specific_force_body_m_s2")
    if log.has("position_world_m") or not drive or not all(log.has(q) for q in imu) or rate_hz(log) < SLOWEST_HZ:
        return ()
    pieces = _pieces(log, drive)
    if not pieces:
        return ()
    lags = LAGS_S if drive == full_throttle.COMMAND else (0.0,)
    errors = min((_errors(pieces, lag_s) for lag_s in lags), key=lambda e: float(-(1.0 / e[:4] ** 2).sum()))
    return (
        Manoeuvre(
            "throttle steps",
            "the curve of thrust and, by its slope, the inertias",
            "climb and drop by the throttle in steps for 20 s",
            float(errors[4]),
        ),
        Manoeuvre(
            "rolls and pitches",
            "the inertias about x and y",
            "roll to and fro by quick full sticks for 10 s, then pitch",
            float(errors[1:3].max()),
        ),
        Manoeuvre(
            "yaws",
            "yaw torque over the inertia about z",
            "yaw to and fro by quick full sticks for 15 s",
            float(errors[3]),
        ),
    )


def rate_hz(log: FlightLog) -> float:
    """Of gyro and accelerometer; 0 where there are none."""
    both = (log.vector(q) for q in ("rate_body_rad_s", "specific_force_body_m_s2") if log.has(q))
    rows = np.isfinite(np.concatenate([np.zeros((len(log), 1)), *both], axis=1)).all(axis=1)
    steps_s = np.diff(log.time_s[rows])
    return float(1.0 / np.median(steps_s)) if len(steps_s) else 0.0


def _pieces(log: FlightLog, drive: str) -> list[_Piece]:
    values = np.concatenate(
        [log.vector(drive), log.vector("specific_force_body_m_s2")[:, 2:], log.vector("rate_body_rad_s")], axis=1
    )
    rows = np.isfinite(values).all(axis=1)
    for start_s, end_s in contact.spans(log):
        rows &= (log.time_s < start_s) | (log.time_s > end_s)
    time_s, values = log.time_s[rows], values[rows]
    if len(time_s) < 2:
        return []
    motors = values[:, :-IMU]  # a view
    motors /= max(float(motors.max()), 1e-12)
    step_s = np.diff(time_s)
    cuts = np.flatnonzero(step_s > np.maximum(5.0 * np.median(step_s), STEP_S)) + 1
    stretches = zip(np.split(time_s, cuts), np.split(values, cuts), strict=True)
    return [_piece(t, v) for t, v in stretches if t[-1] - t[0] >= SHORTEST_S]


def _piece(time_s: FloatArray, values: FloatArray) -> _Piece:
    area = np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(time_s)[:, None], axis=0)
    area = np.concatenate([np.zeros((1, values.shape[1])), area])
    grid_s = np.arange(time_s[0], time_s[-1], STEP_S)
    means = np.stack([np.diff(np.interp(grid_s, time_s, column)) / STEP_S for column in area.T], axis=1)
    motors, force, rate = means[:, :-IMU], means[:, -IMU : 1 - IMU], means[:, 1 - IMU :]
    return _Piece(motors, np.concatenate([_paired(force), np.diff(rate, axis=0) / STEP_S], axis=1))


def _paired(values: FloatArray) -> FloatArray:
    """(k - 1, ...) means of neighbours: over the same time as the difference of two mean rates."""
    return 0.5 * (values[1:] + values[:-1])


def _errors(pieces: Sequence[_Piece], lag_s: float) -> FloatArray:
    """(5,) of what the commands make of force and turning, its standard error as a share; of the slope of thrust."""
    speeds = [_lagged(piece.command, lag_s) for piece in pieces]
    squares = [np.concatenate([_paired(s**2), np.ones((len(s) - 1, 1))], axis=1) for s in speeds]
    found = [_Regression.of(squares, [piece.shown[:, channel] for piece in pieces]) for channel in range(4)]
    sums = [np.stack([(s**2).sum(axis=1), s.sum(axis=1), np.ones(len(s))], axis=1) for s in speeds]
    curve = _Regression.of([_paired(s) for s in sums], [piece.shown[:, 0] for piece in pieces])
    usual = 2.0 * float(np.median(np.concatenate(speeds)))
    return np.array([*(one.share() for one in found), curve.of_slope(np.array([usual, 1.0]))])


def _lagged(command: FloatArray, lag_s: float) -> FloatArray:
    """(k, r) what a first-order lag makes of commands."""
    if lag_s == 0.0:
        return command
    kernel = np.exp(-STEP_S / lag_s * np.arange(max(2, round(LAGS_FOLLOWED * lag_s / STEP_S))))
    kernel /= kernel.sum()
    return np.stack([np.convolve(c - c[0], kernel)[: len(c)] + c[0] for c in command.T], axis=1)


@dataclass(frozen=True, slots=True, eq=False)
class _Regression:
    """By least squares, with noise made white; the last input is a constant."""

    inputs: FloatArray
    coefficients: FloatArray
    variance: float
    """Of the white noise."""

    @staticmethod
    def of(inputs: Sequence[FloatArray], shown: Sequence[FloatArray]) -> "_Regression":
        coefficients = _fitted(inputs, shown)
        left = [y - x @ coefficients for x, y in zip(inputs, shown, strict=True)]
        whitener = np.concatenate([[1.0], -_autoregression(left)])
        white = [np.stack([np.convolve(c, whitener, "valid") for c in x.T], axis=1) for x in inputs]
        white_shown = [np.convolve(y, whitener, "valid") for y in shown]
        coefficients = _fitted(white, white_shown)
        x, y = np.concatenate(white), np.concatenate(white_shown)
        left_over = y - x @ coefficients
        return _Regression(x, coefficients, float(left_over @ left_over) / max(len(y) - x.shape[1], 1))

    def share(self) -> float:
        """Error of the size of all that the inputs explain, but for the constant; infinite where they hardly vary."""
        varied = self._varied
        of_inputs = varied @ self.coefficients[:-1]
        by_chance = (len(self.coefficients) - 1) * self.variance
        explained = float(of_inputs @ of_inputs) - by_chance
        return float(np.sqrt(self.variance / explained)) if explained > 0.0 and not _is_still(varied) else np.inf

    def of_slope(self, combination: FloatArray) -> float:
        """Error of a combination of the coefficients but for the constant; infinite where the inputs hardly vary."""
        varied = self._varied
        size = abs(float(combination @ self.coefficients[:-1]))
        if _is_still(varied) or size == 0.0:
            return np.inf
        covariance = self.variance * np.linalg.pinv(varied.T @ varied, hermitian=True)
        return float(np.sqrt(max(combination @ covariance @ combination, 0.0))) / size

    @property
    def _varied(self) -> FloatArray:
        """The inputs but for the constant, less their means."""
        return self.inputs[:, :-1] - self.inputs[:, :-1].mean(axis=0)


def _is_still(varied: FloatArray) -> bool:
    return float((varied**2).sum()) < len(varied) * STILL**2


def _fitted(inputs: Sequence[FloatArray], shown: Sequence[FloatArray]) -> FloatArray:
    found = np.linalg.lstsq(np.concatenate(list(inputs)), np.concatenate(list(shown)), rcond=None)[0]
    return np.asarray(found, dtype=np.float64)


def _autoregression(left: Sequence[FloatArray]) -> FloatArray:
    past = np.concatenate([np.lib.stride_tricks.sliding_window_view(s[:-1], ORDER)[:, ::-1] for s in left])
    found = np.linalg.lstsq(past, np.concatenate([s[ORDER:] for s in left]), rcond=None)[0]
    return np.asarray(found, dtype=np.float64)
