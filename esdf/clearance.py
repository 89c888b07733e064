"""How close a whole curve comes to anything: certified, with no gaps between samples.

The distance to a set changes by no more than the distance travelled. So a distance s at time t is a lower bound for
every point that the curve can reach before t + h: s - speed * h. Intervals that this bound does not decide are halved
(branch and bound) until the smallest bound is within a tolerance of the smallest sample.
"""

from dataclasses import dataclass, replace
from itertools import product
from typing import Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike

from esdf.field import OUTSIDE, UNMAPPED, SampledField
from flight import FloatArray, InputError, Trajectory, polynomial

Reason = Literal["clear", "too close", "unknown", "outside the map", "unfinished"]
MAX_INTERVALS = 4_000_000
MARGIN_SHARE = 0.05  # far above the required clearance, the minimum need not be known to the millimetre
PIECES = 4  # each segment starts as this many intervals, each with its own bound on the speed


class Distances(Protocol):
    """A field, or a formula: a signed distance that never changes by more than the distance travelled."""

    def distance(self, points_world_m: ArrayLike, /) -> FloatArray: ...


@dataclass(frozen=True, slots=True)
class Clearance:
    """The verdict on one curve."""

    minimum_m: float
    """Smallest value of `distance` found on the curve; NaN if the curve meets unknown space or leaves the map."""
    proven_m: float
    """No point of the curve is nearer than this to anything solid; -inf if nothing could be proven."""
    time_s: float
    """When on the curve the minimum (or the reason for failure) occurs."""
    point_world_m: FloatArray
    """(3,) where that is."""
    segment: int
    passed: bool
    """Whether `proven_m` reaches what was required."""
    reason: Reason
    """"clear" if it passed; else why it did not."""


@dataclass(frozen=True, slots=True, eq=False)
class _Intervals:
    segment: np.ndarray
    start_s: FloatArray
    """Since the segment's start."""
    length_s: FloatArray
    speed_m_s: FloatArray
    """The curve is nowhere faster in this interval."""

    @property
    def middle_s(self) -> FloatArray:
        return self.start_s + 0.5 * self.length_s

    def chosen(self, mask: np.ndarray) -> "_Intervals":
        return _Intervals(self.segment[mask], self.start_s[mask], self.length_s[mask], self.speed_m_s[mask])

    def split(self, parts: int) -> "_Intervals":
        length = np.repeat(self.length_s / parts, parts)
        start = np.repeat(self.start_s, parts) + np.tile(np.arange(parts), len(self.segment)) * length
        return _Intervals(np.repeat(self.segment, parts), start, length, np.repeat(self.speed_m_s, parts))


def certify(
    field: Distances | SampledField, trajectory: Trajectory, required_m: float, *, tolerance_m: float = 1e-3
) -> Clearance:
    """Whether every point of the curve keeps `required_m` from everything solid, and where it comes closest.

    With a sampled field, the proof is about the exact distance to the solid voxels, not about its interpolation:
    `proven_m` is below `minimum_m` by the tolerance and by what interpolation can hide (`proven_distance`). With a
    formula the difference is the tolerance alone.

    Args:
        tolerance_m: The minimum is found this closely, or to a twentieth of what it exceeds `required_m` by.

    Raises:
        InputError: `required_m` is not finite or `tolerance_m` is not positive.
    """
    if not np.isfinite(required_m):
        raise InputError(f"the required clearance is {required_m:g} m; it must be finite")
    if not tolerance_m > 0.0:
        raise InputError(f"tolerance_m is {tolerance_m:g}; it must be positive")
    verdict = _branch_and_bound(field, trajectory, required_m, tolerance_m)
    if isinstance(field, SampledField) and field.unknown == "nan" and not np.isnan(verdict.minimum_m):
        pieces, parts = _half_voxel_steps(field, trajectory)
        if parts.sum() > MAX_INTERVALS:
            return replace(verdict, passed=False, proven_m=-np.inf, reason="unfinished")
        first_unknown = _first_unknown(field, trajectory, pieces, parts)
        if first_unknown is not None:
            return _unknown(field, trajectory, *first_unknown)
    return verdict


def profile(field: SampledField, trajectory: Trajectory, times_s: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Distance in metres and its rate of change in m/s along a curve, at times (n,) from its start: two (n,)."""
    times = np.asarray(times_s, dtype=np.float64)
    distance, gradient = field.distance_and_gradient(trajectory.position(times))
    return distance, np.einsum("ij,ij->i", gradient, trajectory.position(times, 1))


def _branch_and_bound(
    field: Distances | SampledField, trajectory: Trajectory, required_m: float, tolerance_m: float
) -> Clearance:
    todo = _first_intervals(trajectory)
    best, proven = np.inf, np.inf
    minimum, where = np.inf, (0, 0.0)
    finished = True
    while len(todo.segment):
        points = _positions(trajectory, todo.segment, todo.middle_s)
        value = field.distance(points)
        sample = field.proven_from_value(points, value) if isinstance(field, SampledField) else value
        unknown = np.flatnonzero(np.isnan(value))
        if unknown.size:
            return _unknown(field, trajectory, int(todo.segment[unknown[0]]), float(todo.middle_s[unknown[0]]))
        nearest = int(sample.argmin())
        if sample[nearest] < best:
            best, minimum = float(sample[nearest]), float(value[nearest])
            where = int(todo.segment[nearest]), float(todo.middle_s[nearest])
        bound = sample - 0.5 * todo.speed_m_s * todo.length_s
        accepted_m = max(tolerance_m, MARGIN_SHARE * (best - required_m))
        unsettled = bound < best - accepted_m
        finished = 2 * np.count_nonzero(unsettled) <= MAX_INTERVALS
        settled = bound[~unsettled] if finished else bound
        proven = min(proven, float(settled.min(initial=np.inf)))
        if not finished:
            break
        todo = todo.chosen(unsettled).split(2)
    passed = proven >= required_m
    reason: Reason = "clear" if passed else "too close" if finished or best < required_m else "unfinished"
    return _verdict(trajectory, *where, minimum, proven, passed, reason)


def _first_intervals(trajectory: Trajectory) -> _Intervals:
    """Every segment in a few pieces of equal duration, with the hull's bound on the speed in each."""
    k = len(trajectory.durations_s)
    whole = _Intervals(np.arange(k), np.zeros(k), trajectory.durations_s, np.zeros(k))
    pieces = whole.split(PIECES)
    velocity = polynomial.differentiate(trajectory.coefficients[:, :3])[pieces.segment]
    shifted = polynomial.shift_argument(velocity, np.broadcast_to(pieces.start_s[:, None], velocity.shape[:2]))
    # The velocity stays in the hull of its control points, and the norm is convex: its maximum is at one of them.
    control = polynomial.bernstein_from_seconds(shifted, np.broadcast_to(pieces.length_s[:, None], velocity.shape[:2]))
    speed = np.linalg.norm(control, axis=1).max(axis=1) * (1.0 + 1e-9)
    return _Intervals(pieces.segment, pieces.start_s, pieces.length_s, speed)


def _positions(trajectory: Trajectory, segment: np.ndarray, local_s: FloatArray) -> FloatArray:
    return polynomial.evaluate(trajectory.coefficients[segment, :3], local_s[:, None])


def _half_voxel_steps(field: SampledField, trajectory: Trajectory) -> tuple[_Intervals, np.ndarray]:
    """Pieces of the curve, and how many parts of each keep the curve within half a voxel of their middles."""
    pieces = _first_intervals(trajectory)
    parts = np.ceil(pieces.speed_m_s * pieces.length_s / min(field.grid.voxel_m))
    return pieces, np.maximum(parts, 1.0).astype(np.int64)


def _first_unknown(
    field: SampledField, trajectory: Trajectory, pieces: _Intervals, parts: np.ndarray
) -> tuple[int, float] | None:
    """Segment and time of a sample next to which the curve may touch a cell with an unknown corner, or leave the grid.

    The curve stays within r, half a voxel, of the nearest sample; a cube of half edge r meets only cells that hold one
    of its corners.
    """
    r = 0.5 * min(field.grid.voxel_m)
    of = np.repeat(np.arange(len(parts)), parts)
    number = np.arange(len(of)) - np.repeat(np.cumsum(parts) - parts, parts)
    local_s = pieces.start_s[of] + (number + 0.5) * (pieces.length_s / parts)[of]
    points = _positions(trajectory, pieces.segment[of], local_s)
    values = field.distance((points[:, None] + _cube_corners(r)).reshape(-1, 3)).reshape(-1, 8)
    bad = np.flatnonzero(np.isnan(values).any(axis=1))
    return (int(pieces.segment[of[bad[0]]]), float(local_s[bad[0]])) if bad.size else None


def _unknown(field: Distances | SampledField, trajectory: Trajectory, segment: int, local_s: float) -> Clearance:
    reason: Reason = "unknown"
    if isinstance(field, SampledField):
        point = _positions(trajectory, np.array([segment]), np.array([local_s]))
        status = field.status(np.concatenate([point, point + _cube_corners(0.5 * min(field.grid.voxel_m))]))
        if status[0] == OUTSIDE or (OUTSIDE in status and UNMAPPED not in status):
            reason = "outside the map"
    return _verdict(trajectory, segment, local_s, np.nan, -np.inf, False, reason)


def _cube_corners(half_edge_m: float) -> FloatArray:
    signs = np.array(list(product((-1.0, 1.0), repeat=3)), dtype=np.float64)
    return half_edge_m * signs


def _verdict(
    trajectory: Trajectory,
    segment: int,
    local_s: float,
    minimum_m: float,
    proven_m: float,
    passed: bool,
    reason: Reason,
) -> Clearance:
    point = _positions(trajectory, np.array([segment]), np.array([local_s]))[0]
    time_s = float(trajectory.starts_s[segment]) + local_s
    return Clearance(minimum_m, proven_m, time_s, point, segment, passed, reason)
