"""Tilt, rates and rotor speeds over whole pieces of a path, with an allowance for what a few instants cannot show.

The vehicle's own forces give the attitude at the Chebyshev nodes of each piece; body rates and torque follow from the
derivatives of the polynomial through them (Trefethen, Spectral Methods in MATLAB, 2000), and the rotor speeds from
those. So an instant costs one attitude, and everything is known between the nodes too, as far as it is smooth: what the
highest coefficients carry is the measure for how far that is.
"""

from dataclasses import dataclass, field
from functools import cache

import numpy as np
from numpy.polynomial import chebyshev

from flight import FloatArray, Trajectory, polynomial, portable
from vehicle import Vehicle, flatness

NODES = 12
"""Instants in a piece."""
UP, RATE, ROTOR = 0, slice(1, 4), slice(4, None)
"""Columns of the values: cosine of the tilt, body rates, rotor speeds."""
REACH = 1.1
"""The nodes reach beyond a piece by this factor, as derivatives are poor at the outermost ones."""
_LONGEST_S, _SHORT_S = 0.5, 0.05
"""Of a piece, where only samples are asked for; once more where they are impossible."""


@dataclass(frozen=True, slots=True, eq=False)
class Pieces:
    """Parts of a trajectory's segments."""

    segment: np.ndarray
    """(p,)."""
    start_s: FloatArray
    """(p,) since the segment's start."""
    length_s: FloatArray


def pieces_in(durations_s: FloatArray, longest_s: float) -> np.ndarray:
    """(s,) into how many equal pieces of at most `longest_s` each duration is cut."""
    return np.maximum(np.ceil(durations_s / longest_s), 1.0).astype(int)


def pieces_of(durations_s: FloatArray, segments: np.ndarray, longest_s: float) -> Pieces:
    """The given segments, in equal pieces of at most `longest_s`."""
    count = pieces_in(durations_s[segments], longest_s)
    of = np.repeat(np.arange(len(segments)), count)
    number = np.arange(len(of)) - np.repeat(np.cumsum(count) - count, count)
    length = (durations_s[segments] / count)[of]
    return Pieces(segments[of], number * length, length)


def coefficients(vehicle: Vehicle, trajectory: Trajectory, pieces: Pieces) -> FloatArray:
    """(p, NODES, values) Chebyshev coefficients over each piece; NaN where the vehicle cannot fly the motion."""
    nodes, derivatives, from_values = _operators()
    local = pieces.start_s[:, None] + 0.5 * pieces.length_s[:, None] * (1.0 + nodes)
    c = trajectory.coefficients[pieces.segment]
    yaw = polynomial.evaluate(c[:, None, 3], local)
    velocity, acceleration = (
        polynomial.evaluate(polynomial.differentiate(c[:, None, :3], r), local[..., None]) for r in (1, 2)
    )
    values = flatness.at_nodes(vehicle, velocity, acceleration, yaw, derivatives, 2.0 / pieces.length_s)
    return portable.product(from_values, values)


@dataclass(frozen=True, slots=True, eq=False)
class Memory:
    """Coefficients of segments, for who asks about a segment again that is equal, bit by bit; all of one vehicle."""

    _found: dict[bytes, FloatArray] = field(default_factory=dict[bytes, FloatArray])

    def coefficients(
        self, vehicle: Vehicle, trajectory: Trajectory, segments: np.ndarray, longest_s: float
    ) -> tuple[Pieces, FloatArray]:
        """The given segments, in equal pieces of at most `longest_s`, and the coefficients over each."""
        prefix = np.float64(longest_s).tobytes()
        keys = [prefix + key for key in segment_keys(trajectory, segments)]
        new = np.array([key not in self._found for key in keys], dtype=bool)
        if new.any():
            pieces = pieces_of(trajectory.durations_s, segments[new], longest_s)
            found = coefficients(vehicle, trajectory, pieces)
            ends = np.cumsum(pieces_in(trajectory.durations_s[segments[new]], longest_s))
            self._found.update(zip((keys[i] for i in np.flatnonzero(new)), np.split(found, ends[:-1]), strict=True))
        known = [self._found[key] for key in keys]
        return pieces_of(trajectory.durations_s, segments, longest_s), np.concatenate(known)


def segment_keys(trajectory: Trajectory, segments: np.ndarray) -> list[bytes]:
    """What two segments have in common that are equal, bit by bit."""
    coefficients = trajectory.coefficients[segments].reshape(len(segments), -1)
    rows = np.column_stack([trajectory.durations_s[segments], coefficients])
    size, together = rows.itemsize * rows.shape[1], rows.tobytes()
    return [together[i : i + size] for i in range(0, len(together), size)]


def sampled(
    vehicle: Vehicle,
    trajectory: Trajectory,
    segments: np.ndarray,
    fractions: FloatArray,
    memory: Memory | None = None,
) -> FloatArray:
    """(s, f, values) in the given segments (s,) at fractions (f,) of each; NaN where the motion is impossible."""
    memory = memory or Memory()
    values = _sampled(vehicle, trajectory, segments, fractions, memory, _LONGEST_S)
    # An impossible instant leaves its whole piece unknown, even one beyond the piece's end.
    unknown = np.isnan(values).any(axis=(1, 2))
    if unknown.any():
        values[unknown] = _sampled(vehicle, trajectory, segments[unknown], fractions, memory, _SHORT_S)
    return values


def _sampled(
    vehicle: Vehicle,
    trajectory: Trajectory,
    segments: np.ndarray,
    fractions: FloatArray,
    memory: Memory,
    longest_s: float,
) -> FloatArray:
    _, found = memory.coefficients(vehicle, trajectory, segments, longest_s)
    count = pieces_in(trajectory.durations_s[segments], longest_s)
    first = (np.cumsum(count) - count)[:, None]
    place = fractions * count[:, None]
    number = np.minimum(place.astype(int), count[:, None] - 1)
    values = at_fractions(found[(first + number).ravel()], (place - number).ravel())
    return values.reshape(len(segments), len(fractions), -1)


def at_fractions(coefficients: FloatArray, fractions: FloatArray) -> FloatArray:
    """(n, values) at one fraction (n,) of each of as many pieces, from 0 at its start to 1 at its end."""
    rows = chebyshev.chebvander((2.0 * np.asarray(fractions) - 1.0) / REACH, NODES - 1)
    return np.einsum("nk,nkv->nv", rows, coefficients)


@cache
def _operators() -> tuple[FloatArray, tuple[FloatArray, FloatArray], FloatArray]:
    """Nodes in units of half a piece from its middle; first and second derivative; coefficients from values."""
    x = -portable.sine_cosine(np.pi * (np.arange(NODES) + 0.5) / NODES)[1]
    values = np.asarray(chebyshev.chebvander(x, NODES - 1), dtype=np.float64)
    back = portable.solve(values, np.eye(NODES))
    slope = np.zeros((NODES, NODES))
    slope[:-1] = chebyshev.chebder(np.eye(NODES))
    slope /= REACH
    once = portable.product(slope, back)
    twice = portable.product(slope, once)
    return REACH * x, (portable.product(values, once), portable.product(values, twice)), back
