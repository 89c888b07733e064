"""Free space for the planner: anything with `distance(points)`; where it is NaN (unknown), space is not free."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from flight import FloatArray, InputError, portable

Distances = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
"""From points (n, 3) to distances (n,) and their gradients (n, 3)."""
GROUND_TOLERANCE_M = 0.02
"""How much less the clearance may be than the height above the ground says: sampled fields are uneven."""
COLUMN_M = 1e-3
"""Radius of the column above a ground point."""
_MOST_PAIRS = 1_000_000
"""Points times lines of a tube that are looked at together."""
_PIECE_M = 0.5
"""Length of the pieces of a line that are looked at first."""
_TOLERANCE_M = 1e-3
"""Half the length of the shortest piece of a line that is looked at; it counts as not free if it is not proved."""
_REACH_M = 5.0
"""How far from a point a free one is looked for."""
_STEP_M = 1e-4
"""Step of the central difference for fields that cannot give a gradient."""


class DistanceField(Protocol):
    """Signed distance to the nearest obstacle, 1-Lipschitz; NaN where unknown."""

    def distance(self, points_world_m: ArrayLike, /) -> FloatArray: ...


@dataclass(frozen=True, slots=True)
class LineCheck:
    """How close a straight line comes to obstacles."""

    free: bool
    """Whether the distance is at least the required one everywhere on the line."""
    distance_m: float
    """Smallest distance found."""


def distance(field: DistanceField, points_world_m: FloatArray) -> FloatArray:
    """Lower bound of the distance (n,); minus infinity where unknown.

    For a sampled field it is a little below the interpolated value (`proven_distance`), for a formula the value itself.
    """
    ask = getattr(field, "proven_distance", field.distance)
    values = np.asarray(ask(np.ascontiguousarray(points_world_m)), dtype=np.float64)
    return np.fmax(values, -np.inf)  # of a NaN and a number, the number


def certain(field: DistanceField, distance_m: np.ndarray) -> np.ndarray:
    """What interpolated distances prove (`SampledField.proven_distance`), minus infinity where they are NaN."""
    grid = getattr(field, "grid", None)
    slack = 0.0 if grid is None else grid.half_diagonal_m
    concave = np.sqrt(np.maximum(distance_m * distance_m - slack * slack, 0.0))
    return np.fmax(np.where(distance_m > slack, concave, distance_m - slack), -np.inf)


def aim(field: DistanceField, required_m: float) -> float:
    """The interpolated distance at which `required_m` is certain."""
    grid = getattr(field, "grid", None)
    if grid is None:
        return required_m
    return float(np.sqrt(required_m * required_m + grid.half_diagonal_m * grid.half_diagonal_m))


def around_path(field: DistanceField, polyline: FloatArray, near_m: float) -> Distances:
    """Distances (n,) and gradients (n, 3) for an optimiser that starts from a free polyline (m, 3).

    Gradients are worked out where the distance is below `near_m` only. Where the field does not know, the value is
    minus the distance to the polyline, so that a path is drawn back to it.
    """

    def ask(points: FloatArray) -> tuple[FloatArray, FloatArray]:
        d, gradient = _value_and_gradient(field, points, near_m)
        if np.isfinite(d.sum() + gradient.sum()):  # nearly always, and much sooner known
            return d, gradient
        d, gradient = d.copy(), gradient.copy()
        unknown = np.flatnonzero(~(np.isfinite(d) & np.isfinite(gradient).all(axis=1)))
        if unknown.size:
            back = _nearest_on(polyline, points[unknown]) - points[unknown]
            size = np.linalg.norm(back, axis=1)
            d[unknown], gradient[unknown] = -size, back / np.maximum(size, 1e-9)[:, None]
        return d, gradient

    return ask


def _value_and_gradient(field: DistanceField, points: FloatArray, near_m: float) -> tuple[FloatArray, FloatArray]:
    exact = getattr(field, "distance_and_gradient", None)
    if exact is not None:
        value, gradient = exact(points)
        return np.asarray(value, dtype=np.float64), np.asarray(gradient, dtype=np.float64)
    value, gradient = np.array(field.distance(points), dtype=np.float64), np.zeros_like(points)
    near = np.flatnonzero(~(value >= near_m))
    if near.size:
        steps = _STEP_M * np.concatenate([np.eye(3), -np.eye(3)])
        sides = np.asarray(field.distance((steps[:, None] + points[near]).reshape(-1, 3))).reshape(6, -1)
        gradient[near] = ((sides[:3] - sides[3:]) / (2.0 * _STEP_M)).T
    return value, gradient


def _nearest_on(polyline: FloatArray, points: FloatArray) -> FloatArray:
    """The nearest point (n, 3) of the polyline to each of the points."""
    start, along = polyline[:-1], np.diff(polyline, axis=0)
    square = np.maximum(np.einsum("ij,ij->i", along, along), 1e-12)
    share = np.clip(np.einsum("nij,ij->ni", points[:, None] - start, along) / square, 0.0, 1.0)
    candidates = start + share[..., None] * along
    best = np.linalg.norm(candidates - points[:, None], axis=2).argmin(axis=1)
    return candidates[np.arange(len(points)), best]


def far_from(polyline: FloatArray, points: FloatArray) -> FloatArray:
    """Distance (n,) of points (n, 3) to a polyline (m, 3); of one point, to that."""
    line = polyline if len(polyline) > 1 else np.repeat(polyline, 2, axis=0)
    found, step = np.empty(len(points)), max(_MOST_PAIRS // len(line), 1)
    for first in range(0, len(points), step):
        part = points[first : first + step]
        found[first : first + step] = np.linalg.norm(_nearest_on(line, part) - part, axis=1)
    return found


class KeepIn:
    """How far inside a tube round a polyline points are: its radius less their distance to the line, 1-Lipschitz.

    Points outside, which are most in a search, are measured from points along the line, and so a little farther away.
    """

    def __init__(self, polyline_world_m: FloatArray, radius_m: float) -> None:
        from scipy.spatial import KDTree

        self.polyline_world_m, self.radius_m = polyline_world_m, radius_m
        self._along_m = 0.25 * radius_m
        lengths = np.linalg.norm(np.diff(polyline_world_m, axis=0), axis=1)
        counts = np.ceil(lengths / self._along_m).astype(int) + 1
        lines = zip(polyline_world_m[:-1], polyline_world_m[1:], counts, strict=True)
        self._samples = np.concatenate([np.linspace(a, b, n) for a, b, n in lines])
        self._tree = KDTree(self._samples)

    @property
    def bounds_world_m(self) -> tuple[FloatArray, FloatArray]:
        """Lower and upper corner (3,) of a box that holds the tube."""
        return self._samples.min(axis=0) - self.radius_m, self._samples.max(axis=0) + self.radius_m

    def distance(self, points_world_m: ArrayLike, /) -> FloatArray:
        """(n,) metres, negative outside."""
        return self.distance_and_gradient(np.asarray(points_world_m, dtype=np.float64))[0]

    def distance_and_gradient(self, points_world_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(n,), and its gradient (n, 3): towards the line; zero on it."""
        far_m, index = self._tree.query(points_world_m)
        nearest = self._samples[index]
        inside = np.flatnonzero(far_m <= self.radius_m + self._along_m)
        step = max(_MOST_PAIRS // len(self.polyline_world_m), 1)
        for part in np.split(inside, range(step, len(inside), step)):
            nearest[part] = _nearest_on(self.polyline_world_m, points_world_m[part])
        away = points_world_m - nearest
        size = np.linalg.norm(away, axis=1)
        return self.radius_m - size, -away / np.maximum(size, 1e-9)[:, None]


class Within:
    """A field inside a tube: what lies inside by d keeps at least the required clearance plus d from the outside.

    The planner then need not know that the outside is not an obstacle, but for `free_within_world_m`, the corners of a
    box outside of which nothing is free. Distances of a sampled field are those that it
    proves (`certain`).
    """

    def __init__(self, field: DistanceField, tube: KeepIn, required_m: float) -> None:
        self.field, self.tube, self.required_m = field, tube, required_m
        self.free_within_world_m = tube.bounds_world_m

    def distance(self, points_world_m: ArrayLike, /) -> FloatArray:
        """(n,) metres; minus infinity where the field does not know."""
        points = np.asarray(points_world_m, dtype=np.float64).reshape(-1, 3)
        return np.minimum(distance(self.field, points), self.required_m + self.tube.distance(points))

    def distance_and_gradient(self, points_world_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(n,), and the gradient (n, 3) of the nearer one of field and tube."""
        inside, inwards = self.tube.distance_and_gradient(points_world_m)
        value, gradient = _value_and_gradient(self.field, points_world_m, self.required_m + self.tube.radius_m)
        value, inside = certain(self.field, value), self.required_m + inside
        return np.minimum(value, inside), np.where((inside < value)[:, None], inwards, gradient)


class Grounded:
    """A field in which the vehicle may stand on the ground: vertically above, required clearance grows with height.

    Above a ground point g with distance d(g), a height h asks for d(g) + h until that is `required_m`. What is returned
    is such that "at least `required_m`" says just this, and that it changes no faster than the way flown: half of what
    is left over.
    """

    def __init__(self, field: DistanceField, ground_world_m: FloatArray, required_m: float) -> None:
        self.field, self.required_m = field, required_m
        self.ground_world_m = np.asarray(ground_world_m, dtype=np.float64).reshape(-1, 3)
        self.ground_distance_m = distance(field, self.ground_world_m)

    def distance(self, points_world_m: ArrayLike, /) -> FloatArray:
        """(n,) metres; as the field's own but above ground points, and minus infinity where it is unknown."""
        points = np.asarray(points_world_m, dtype=np.float64).reshape(-1, 3)
        value = distance(self.field, points)
        for ground, near_m in zip(self.ground_world_m, self.ground_distance_m, strict=True):
            if not near_m >= -GROUND_TOLERANCE_M:  # inside something, or unknown: nothing to stand on
                continue
            height = points[:, 2] - ground[2]
            least = near_m + np.maximum(height, 0.0) - GROUND_TOLERANCE_M
            above = (np.linalg.norm(points[:, :2] - ground[:2], axis=1) < COLUMN_M) & (height > -COLUMN_M)
            eased = self.required_m + 0.5 * (value - least)
            value = np.where(above & (least < self.required_m), np.maximum(eased, value), value)
        return value


def check_lines(
    field: DistanceField, starts: FloatArray, ends: FloatArray, required_m: float | FloatArray
) -> list[LineCheck]:
    """Check straight lines (n, 3) to (n, 3), exact within `_TOLERANCE_M`, never too optimistic.

    A distance d at the middle of a piece of half-length h proves a distance of d - h all along it; pieces that are not
    proved are halved until they are, or until their middle is too close, or they are shorter than the tolerance.

    Args:
        required_m: of all lines, or of each (n,).
    """
    starts, ends = np.atleast_2d(starts).astype(np.float64), np.atleast_2d(ends).astype(np.float64)
    n, along = len(starts), ends - starts
    lengths, required = np.linalg.norm(along, axis=1), np.broadcast_to(required_m, (n,))
    least, free = np.full(n, np.inf), np.ones(n, dtype=bool)
    pieces = np.maximum(np.ceil(lengths / _PIECE_M), 1.0).astype(int)
    line = np.repeat(np.arange(n), pieces)
    share = 0.5 / pieces[line]
    middle = (2.0 * (np.arange(len(line)) - np.repeat(np.cumsum(pieces) - pieces, pieces)) + 1.0) * share
    while line.size:
        d = distance(field, starts[line] + middle[:, None] * along[line])
        np.minimum.at(least, line, d)
        h, need = share * lengths[line], required[line]
        unproved = d - h < need
        free[line[unproved & ((d < need) | (h < _TOLERANCE_M))]] = False
        keep = unproved & free[line]
        line, half = np.repeat(line[keep], 2), 0.5 * share[keep]
        share, middle = np.repeat(half, 2), np.repeat(middle[keep], 2)
        middle[0::2] -= half
        middle[1::2] += half
    return [LineCheck(bool(f), float(d)) for f, d in zip(free, least, strict=True)]


def nearest_free(field: DistanceField, point: FloatArray, required_m: float) -> FloatArray:
    """A point near `point` whose distance is at least `required_m`: the nearest found on growing shells.

    Raises:
        InputError: there is none within `_REACH_M`.
    """
    count = 200
    i = np.arange(count) + 0.5
    up, (sine, cosine) = 1.0 - 2.0 * i / count, portable.sine_cosine(np.pi * (1.0 + np.sqrt(5.0)) * i)
    horizontal = np.sqrt(1.0 - up * up)
    ball = np.stack([horizontal * cosine, horizontal * sine, up], axis=1)
    directions = np.concatenate([np.eye(3), -np.eye(3), ball])
    for radius in np.arange(0.05, _REACH_M, 0.05):
        d = distance(field, point + radius * directions)
        best = int(np.argmax(d))
        if d[best] >= required_m:
            return point + radius * directions[best]
    raise InputError(f"no point within {_REACH_M:g} m of it is {required_m:.2f} m clear; move it, or lower margin_m")
