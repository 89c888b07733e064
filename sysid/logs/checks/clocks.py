"""How late rotor speed is against gyro or attitude, read from the log alone (the gyro: `gyro_clock`).

First the lag of the largest correlation, then least squares: the reference is explained by the other stream read some
time later, with what else may turn the body beside it, and the time is stepped until the slope explains nothing more.
The estimator finds the same delays more exactly, with the whole motion; here it has to take no time.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from flight import FlightLog, rotations
from flight.rotations import FloatArray
from sysid.logs.checks.finding import Finding, warning
from sysid.logs.checks.motion import GRID_S, Kinematics, correlation, fitted, on_grid, resampled, sampled
from sysid.logs.events.repair import Repair
from vehicle import Vehicle, acceleration
from vehicle.forces import open_air

LONGEST_S = 0.15
"""Streams further apart are not recognised."""
LEAST_DELAY_S = 1e-3
"""Shorter delays are not worth a word."""
ROTOR_SIGMAS = 5.0
"""Nor are those within so many standard errors: a controller that answers gusts looks like late rotors."""
CONSISTENT_SIGMAS = 3.0
"""Two readings of one delay that are further apart do not agree."""
SYSTEMATIC_S = 2.5e-4
"""Part of every standard error: what smoothing, the grid and forces unknown to the vehicle file leave on clean logs. It
is more where what stands beside the streams explains most of what a delay changes (`clock_offset`)."""
LEAST_LEFT = 0.1
"""Where what stands beside leaves less than this of what a delay changes, the delay is not known."""
ROTOR_QUALITY = 0.35
"""Correlation below which nothing is said; most torque of some rotors balances what the vehicle file does not know."""
BLOCK_S = 1.0
"""Errors are taken as independent between blocks of this length."""
DRIVEN_HZ = (3.0, 20.0)
"""In this band rotors turn the body. Slower, most of their torque may balance a moment of the air, and the controller's
answer to it has a phase of its own (on two of eight flights of a nano-drone worth 11 and 14 ms); faster is noise."""
STEPS = 5
"""Of least squares; each is exact for what moves straight on over the step."""


@dataclass(frozen=True, slots=True)
class Offset:
    """How late a stream is against a reference."""

    delay_s: float
    """Positive: late."""
    sigma_s: float
    """Standard error."""
    quality: float
    """Correlation of the two, the delay taken out."""

    def worth_a_word(self, least_quality: float, sigmas: float) -> bool:
        """Whether it is there, and matters."""
        return self.quality > least_quality and abs(self.delay_s) > max(LEAST_DELAY_S, sigmas * self.sigma_s)

    @property
    def words(self) -> str:
        return f"{1e3 * abs(self.delay_s):.1f} ± {1e3 * self.sigma_s:.2g} ms {'late' if self.delay_s > 0 else 'early'}"


def of_rotors(log: FlightLog, motion: Kinematics, vehicle: Vehicle, *, gyro_is_sure: bool = True) -> list[Finding]:
    """What to say of the clock of rotor speed: against the gyro, where that shows it, else against the attitude.

    Args:
        gyro_is_sure: whether the gyro's own clock is known. If not, it may be the one that is off, and a fix is
            proposed only if the attitude shows the same delay.
    """
    against, offset = "gyro", Offset(0.0, np.inf, 0.0)
    if sampled(log, "rate_body_rad_s"):
        offset = rotors_after_gyro(log, motion, vehicle)
    if offset.quality <= ROTOR_QUALITY:
        against, offset = "motion", rotors_after_attitude(log, motion, vehicle)
    if not offset.worth_a_word(ROTOR_QUALITY, ROTOR_SIGMAS):
        return []
    sentence = f"rotor speed is {offset.words} against the {against}"
    if against == "gyro" and not gyro_is_sure:
        other = rotors_after_attitude(log, motion, vehicle)
        if not _agree(offset, other):
            fix = "the flight does not show which of the two is off: let the fit estimate both clocks"
            return [warning("clock", sentence, fix)]
        if other.sigma_s < offset.sigma_s:
            against, offset = "motion", other
            sentence = f"rotor speed is {offset.words} against the {against}"
    fix = f"shift rotor speed by {-1e3 * offset.delay_s:+.1f} ms against the {against}"
    repair = Repair("shift", log.names("rotor_speed_rad_s"), shift_s=-offset.delay_s)
    return [warning("clock", sentence, fix, repair=repair)]


def _agree(offset: Offset, other: Offset) -> bool:
    """Whether another reference shows that delay, too."""
    apart_s = abs(offset.delay_s - other.delay_s)
    same = apart_s <= CONSISTENT_SIGMAS * np.hypot(offset.sigma_s, other.sigma_s)
    return same and other.worth_a_word(ROTOR_QUALITY, ROTOR_SIGMAS)


def rotors_after_gyro(log: FlightLog, motion: Kinematics, vehicle: Vehicle) -> Offset:
    """By how much rotor speed comes later than the gyro, from roll and pitch.

    In the driven band neither is smoothed, which would leave little above 8 Hz, where a delay shows best.
    """
    from scipy.interpolate import CubicSpline

    rate, speed = _raw(log, "rate_body_rad_s", motion), _raw(log, "rotor_speed_rad_s", motion)
    quick = _streams(rate, CubicSpline(motion.time_s, rate)(motion.time_s, 1), speed, motion, vehicle)
    return _consistent(by_gyro(log, motion, vehicle), quick)


def rotors_after_attitude(log: FlightLog, motion: Kinematics, vehicle: Vehicle) -> Offset:
    """By how much rotor speed comes later than the attitude, from roll and pitch."""
    streams = by_attitude(log, motion, vehicle)
    return _consistent(streams, streams)


Streams = tuple[FloatArray, FloatArray, FloatArray]
"""Turning less the moment of the air, the rotors' part of it, and what else may turn the body, on the grid."""


def by_attitude(log: FlightLog, motion: Kinematics, vehicle: Vehicle) -> Streams:
    """Of roll and pitch, by the attitude and rotor speed on the grid."""
    speed = on_grid(log, "rotor_speed_rad_s", motion.time_s)
    return _streams(motion.rate_body_rad_s, motion.angular_acceleration_rad_s2, speed, motion, vehicle)


def by_gyro(log: FlightLog, motion: Kinematics, vehicle: Vehicle) -> Streams:
    """Of roll and pitch, by the gyro and rotor speed, both smoothed."""
    rate, speed = _raw(log, "rate_body_rad_s", motion), _raw(log, "rotor_speed_rad_s", motion)
    return _streams(fitted(rate, 0), fitted(rate, 1), fitted(speed, 0), motion, vehicle)


def _streams(rate: FloatArray, turning: FloatArray, speed: FloatArray, motion: Kinematics, vehicle: Vehicle) -> Streams:
    """Of roll and pitch, from body rate and its slope (n, 3) and rotor speed (n, r) on the grid.

    A moment that goes with turning or with speed is part of every flight, and moves the phase of what is left.
    """
    rest = np.zeros((len(speed), 3))
    air = rotations.rotate(rotations.conjugate(motion.q), motion.velocity_world_m_s)
    around = replace(open_air(len(speed), vehicle.rotors), q_world_body=motion.q)
    driven = acceleration(vehicle, rest, rest, speed, around)[1]
    aerodynamic = acceleration(vehicle, air, rate, speed, around)[1] - driven
    beside = np.stack([np.column_stack([rate[:, i], air[:, :2]]) for i in range(2)], axis=1)
    return (turning - aerodynamic)[:, :2], driven[:, :2], beside


def _consistent(all_frequencies: Streams, quick: Streams) -> Offset:
    """Read at all frequencies and in the driven band alone: if the two agree the more exact one, else the latter.

    A controller answers the noise of its gyro. In a calm flight that answer, smoothed, looks like rotors 7 to 12 ms
    early with an error of 1 ms (simulated: white noise of 0.02 to 0.2 rad/s); in the driven band of streams as they
    were logged it hardly does. Where that band does not show the rotors' doing, its error is part of the other's.
    """
    whole, driven = clock_offset(*all_frequencies), clock_offset(*map(_in_driven_band, quick))
    sigma_s = float(np.hypot(whole.sigma_s, driven.sigma_s))
    if not abs(whole.delay_s - driven.delay_s) <= CONSISTENT_SIGMAS * sigma_s < np.inf:
        return driven if quick is not all_frequencies else replace(driven, sigma_s=np.inf)  # smoothed: neither is sure
    if driven.quality <= ROTOR_QUALITY:
        return replace(whole, sigma_s=sigma_s)
    return min(whole, driven, key=lambda offset: offset.sigma_s)


def _raw(log: FlightLog, quantity: str, motion: Kinematics) -> FloatArray:
    """A quantity on the grid, as it was logged."""
    values = log.vector(quantity)
    rows = np.isfinite(values).all(axis=1)
    return resampled(motion.time_s, log.time_s[rows], values[rows])


def _in_driven_band(values: FloatArray) -> FloatArray:
    """(n, ...) on the grid, without delay."""
    from scipy.signal import butter, sosfiltfilt

    return np.asarray(sosfiltfilt(butter(3, DRIVEN_HZ, "band", fs=1.0 / GRID_S, output="sos"), values, axis=0))


def reader(values: FloatArray) -> Callable[[float | FloatArray], FloatArray]:
    """Reads (n, c) on the grid as they are by a delay later, in s, or each by its own, (n,); held at the ends."""
    from scipy.interpolate import CubicSpline

    time_s = GRID_S * np.arange(len(values))
    spline = CubicSpline(time_s, values)
    return lambda delay_s: spline(np.clip(time_s + delay_s, 0.0, time_s[-1]))


def clock_offset(reference: FloatArray, other: FloatArray, beside: FloatArray | None = None) -> Offset:
    """By how much `other` comes later than `reference`, both (n, c) on the grid.

    A small misfit turns into a delay the more, the less of what a delay changes is left by what stands beside. On a
    clean flight of slow circles, half of it, rotor speed looked 1.2 ms later than it was.

    Args:
        beside: (n, c, b) what else the reference may be proportional to, channel by channel.
    """
    n, edge = len(reference), int(LONGEST_S / GRID_S)
    inner = slice(edge, n - edge)
    more = np.zeros((n, reference.shape[1], 0)) if beside is None else beside
    delay_s, quality = largest_correlation(freed(reference, more), freed(other, more))
    if abs(delay_s) >= LONGEST_S or n <= 4 * edge:
        return Offset(0.0, np.inf, quality)
    sigma_s, read = np.inf, reader(other)
    for _ in range(STEPS):
        pull, weight, quality = terms(reference, read(delay_s), more, inner)
        information = float(weight.sum())
        if information <= 0.0:
            return Offset(0.0, np.inf, quality)
        delay_s = float(np.clip(delay_s + pull.sum() / information, -LONGEST_S, LONGEST_S))
        blocks = np.add.reduceat(pull, np.arange(0, len(pull), round(BLOCK_S / GRID_S)))
        sigma_s = float(np.sqrt((blocks**2).sum())) / information
    left = _left(read(delay_s), more, inner)
    return Offset(delay_s, float(np.hypot(sigma_s, SYSTEMATIC_S / left)) if left > LEAST_LEFT else np.inf, quality)


def _left(later: FloatArray, beside: FloatArray, inner: slice) -> float:
    """The share, from 0 to 1, of what a delay changes that what stands beside does not explain."""
    moving = np.gradient(later, GRID_S, axis=0)

    def changed(beside: FloatArray) -> float:
        given, slope = (freed(x[inner], beside[inner]) for x in (later, moving))
        square = np.maximum((given**2).sum(axis=0), np.finfo(float).tiny)
        return float(np.linalg.norm(slope - given * ((given * slope).sum(axis=0) / square)))

    return min(1.0, changed(beside) / max(changed(beside[:, :, :0]), np.finfo(float).tiny))


def terms(
    reference: FloatArray, later: FloatArray, beside: FloatArray, inner: slice = slice(None)
) -> tuple[FloatArray, FloatArray, float]:
    """What is left of a delay: its pull over its weight, at each of these instants; and the correlation there.

    Args:
        later: (n, c) the other stream, already read as late as it is taken to be.
    """
    moving = np.gradient(later, GRID_S, axis=0)
    own, given, moving = (freed(x[inner], beside[inner]) for x in (reference, later, moving))
    square = np.maximum((given**2).sum(axis=0), np.finfo(float).tiny)
    gain = (own * given).sum(axis=0) / square
    slope = gain * (moving - given * (given * moving).sum(axis=0) / square)
    quality = correlation(own.ravel(), (gain * given).ravel())
    return (slope * (own - gain * given)).sum(axis=1), (slope**2).sum(axis=1), quality


def freed(values: FloatArray, beside: FloatArray) -> FloatArray:
    """(n, c) less what means and `beside` (n, c, b) explain, channel by channel."""
    left = values - values.mean(axis=0)
    for i in range(values.shape[1] if beside.shape[2] else 0):
        given = beside[:, i] - beside[:, i].mean(axis=0)
        left[:, i] -= given @ np.linalg.lstsq(given, left[:, i])[0]
    return left


def largest_correlation(reference: FloatArray, other: FloatArray) -> tuple[float, float]:
    """Lag to the grid's step, and the correlation there."""
    edge = int(LONGEST_S / GRID_S)
    lags = np.arange(-edge, edge + 1)
    base = reference[edge : len(reference) - edge]
    values = [correlation(base.ravel(), other[edge + k : len(other) - edge + k].ravel()) for k in lags]
    best = int(np.argmax(values))
    return float(lags[best]) * GRID_S, values[best]
