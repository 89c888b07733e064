"""Does one rotor shake the vehicle? The line that a bent or unbalanced rotor draws at its own speed.

Such a rotor turns a force with itself, so the accelerometer has a line at that rotor's speed as the speed changes
(order tracking; Gade et al., Brüel & Kjær Technical Review 2, 1995). Sound rotors draw one, too: called bent is the one
whose line is several times every other's. Rotors that turn alike are one line; what they do when they differ counts.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from flight import FlightLog
from flight.rotations import FloatArray
from sysid.estimator.motors import rotor_speed
from sysid.estimator.result import Identification

BLOCK_S = 0.25
"""Within which a line keeps its phase."""
BESIDE = np.array([0.86, 0.92, 1.08, 1.14])
"""Shares of a rotor's speed at which nothing turns: the noise there is the noise at the line."""
TIMES = 3.0
"""The line of a bent rotor over every other's."""
SURE = 6.0
"""Its power over the standard error."""
LEAST_M_S2 = 0.5
"""Of a line worth a word, root mean square, as logged; sound rotors of small vehicles draw 0.2."""
LEAST_BLOCKS = 8
MOST_ALIKE = 0.8
"""Coherence of two rotors' phases within a block, above which their lines are one."""
HIGHEST = 0.45
"""Share of the log's rate up to which it shows a line."""
MEDIAN = np.log(2.0)
"""Of the power of noise, over its mean."""
OF_MEDIAN = 1.4826 * 1.2533
"""Standard error of a median over the median deviation, of one sample of a normal distribution."""


@dataclass(frozen=True, slots=True)
class Line:
    """At the speed of one rotor."""

    rotor: int
    rms_m_s2: float
    next_m_s2: float
    """The strongest of the other rotors' lines, its standard error added."""

    @property
    def sentence(self) -> str:
        return (
            f"rotor {self.rotor} shakes the accelerometer with {self.rms_m_s2:.2g} m/s2 at its own speed, every other "
            f"with less than {self.next_m_s2:.2g}: unbalanced, bent or chipped, or the frame resonates"
        )


@dataclass(frozen=True, slots=True, eq=False)
class _Piece:
    """The accelerometer as it was logged, and rotor speeds at its samples."""

    time_s: FloatArray
    force_m_s2: FloatArray
    """(n, 3)"""
    speed_rad_s: FloatArray
    """(n, r)"""


def find(logs: Sequence[FlightLog], fit: Identification) -> tuple[Line | None, str]:
    """The rotor that shakes the vehicle, and why these logs cannot show one; empty where they could.

    Where only commands are known the line's order is not: one of two a turn, which sound blades draw, looks the same.

    Args:
        fit: of these logs.
    """
    if any(flight.driven_by_command for flight in fit.flights):
        return None, "its line is sought at measured rotor speeds: log them (eRPM)"
    pieces = list(_pieces(logs, fit))
    if sum(len(list(_blocks(piece))) for piece in pieces) < LEAST_BLOCKS:
        return None, f"the accelerometer has less than {LEAST_BLOCKS * BLOCK_S:g} s without gaps"
    rate_hz = 1.0 / float(np.median(np.concatenate([np.diff(p.time_s) for p in pieces])))
    usual_hz = float(np.median(np.concatenate([p.speed_rad_s for p in pieces]))) / (2.0 * np.pi)
    if not usual_hz < HIGHEST * rate_hz:
        return None, (
            f"rotors that turn at {usual_hz:.0f} Hz draw no line in samples of {rate_hz:.0f} Hz: log the "
            f"accelerometer at {usual_hz / HIGHEST:.0f} Hz or more"
        )
    powers, std = power(pieces)
    line = strongest(powers, std)
    most = float(np.sqrt((np.maximum(powers, 0.0) + 2.0 * std).max()))
    if line is None and (most > LEAST_M_S2 or _alike(pieces) > MOST_ALIKE):
        return None, "rotors turn too much alike, or all draw lines: fly rolls and yaws, in which they differ"
    return line, ""


def strongest(power: FloatArray, std: FloatArray) -> Line | None:
    """The line that surely is several times every other, of powers (r,) and their standard errors, m²/s⁴."""
    first = int(np.argmax(power))
    others = np.delete(np.maximum(power, 0.0) + std, first)
    least = max(TIMES**2 * float(others.max()), LEAST_M_S2**2, SURE * std[first])
    if not power[first] > least:
        return None
    return Line(first, float(np.sqrt(power[first])), float(np.sqrt(others.max())))


def power(pieces: Sequence[_Piece]) -> tuple[FloatArray, FloatArray]:
    """Mean square of each rotor's line (r,) and standard errors, m²/s⁴, by the blocks' median: the surest count most.

    In a mean, blocks in which rotors turn almost alike would give one rotor's line to the others.
    """
    blocks = [_lines(block) for piece in pieces for block in _blocks(piece)]
    found, noise = np.array([p for p, _ in blocks]), np.array([v for _, v in blocks])
    weight = 1.0 / (noise + np.median(noise, axis=0)) ** 2  # no block counts more than four usual ones
    middle = _median(found, weight)
    count = weight.sum(axis=0) ** 2 / (weight**2).sum(axis=0)
    return middle, OF_MEDIAN * _median(np.abs(found - middle), weight) / np.sqrt(count)


def _median(values: FloatArray, weight: FloatArray) -> FloatArray:
    """(r,) weighted medians of columns (n, r)."""
    order = np.argsort(values, axis=0)
    below = np.cumsum(np.take_along_axis(weight, order, axis=0), axis=0)
    at = (below < 0.5 * below[-1]).sum(axis=0)
    return np.take_along_axis(values, order, axis=0)[at, np.arange(values.shape[1])]


def _pieces(logs: Sequence[FlightLog], fit: Identification) -> Iterator[_Piece]:
    """Of each flight that was fitted."""
    sensors = fit.solution.point.sensors
    for flight in fit.flights:
        log = logs[flight.log_index]
        force = log.vector("specific_force_body_m_s2")
        inside = (log.time_s >= flight.time_s[0]) & (log.time_s <= flight.time_s[-1]) & np.isfinite(force).all(axis=1)
        time_s, middle_s = log.time_s[inside], 0.5 * (flight.time_s[:-1] + flight.time_s[1:])
        if len(time_s) < 2 or time_s[-1] - time_s[0] < BLOCK_S:
            continue
        aligned = rotor_speed.aligned(flight, sensors)
        speed = np.stack([np.interp(time_s, middle_s, one) for one in aligned.rotor_speed_rad_s.T], axis=1)
        yield _Piece(time_s, force[inside], speed)


def _blocks(piece: _Piece) -> Iterator[_Piece]:
    count = max(8, round(BLOCK_S / float(np.median(np.diff(piece.time_s)))))
    for a in range(0, len(piece.time_s) - count + 1, count):
        cut = slice(a, a + count)
        yield _Piece(piece.time_s[cut], piece.force_m_s2[cut], piece.speed_rad_s[cut])


def _turning(block: _Piece) -> FloatArray:
    """(n, r) phase of each rotor."""
    between = 0.5 * (block.speed_rad_s[1:] + block.speed_rad_s[:-1]) * np.diff(block.time_s)[:, None]
    return np.concatenate([np.zeros((1, between.shape[1])), np.cumsum(between, axis=0)])


def _alike(pieces: Sequence[_Piece]) -> float:
    """Of the two rotors that turn most alike, the blocks' median coherence of phases: 1 where they never differ."""
    waves = [np.exp(1j * _turning(block)) for piece in pieces for block in _blocks(piece)]
    coherence = np.median([np.abs(wave.conj().T @ wave) / len(wave) for wave in waves], axis=0)
    return float((coherence - np.eye(len(coherence))).max())


def _lines(block: _Piece) -> tuple[FloatArray, FloatArray]:
    """Mean square of the lines (r,) of one block by joint least squares, and by how much of it noise would make.

    The noise that the lines beside show is taken off.
    """
    window = np.hanning(len(block.time_s))
    force = block.force_m_s2 - block.force_m_s2.mean(axis=0)
    turning = _turning(block)
    grown = (block.speed_rad_s / np.maximum(block.speed_rad_s.mean(axis=0), 1e-9)) ** 2  # as centrifugal forces do
    wave = grown * np.exp(1j * turning)
    seen, square = wave.conj().T @ (window[:, None] * force), wave.conj().T @ (window[:, None] * wave)
    noise = wave.conj().T @ (window[:, None] ** 2 * wave)
    inverse = np.linalg.pinv(square, rcond=1e-6, hermitian=True)
    beside = np.exp(-1j * turning[:, :, None] * BESIDE)
    density = np.abs(np.einsum("nrb,na->rba", beside, window[:, None] * force)) ** 2 / (window**2).sum()
    share = 2.0 * np.real(np.einsum("ij,jk,ki->i", inverse, noise, inverse))
    made = share * density.shape[2] * np.median(density, axis=(1, 2)) / MEDIAN
    return 2.0 * (np.abs(inverse @ seen) ** 2).sum(axis=1) - made, made
