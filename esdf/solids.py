"""Solids with a distance in closed form: for exact tests, for rendered worlds, and as the shapes of edits.

Every solid has plain attributes in world metres and `.distance(points)`, the exact signed distance (negative inside),
so a solid can be used in place of a `Field` wherever only `.distance` is called.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from esdf.field import checked_points
from esdf.grid import FREE, OCCUPIED, Grid, Region, StateArray
from flight import FloatArray, InputError, portable, rotations

_SLAB_VOXELS = 1_000_000
"""Voxels that are looked at point by point at once."""
Vector = tuple[float, float, float]
Bounds = tuple[FloatArray, FloatArray]


@runtime_checkable
class Solid(Protocol):
    """A closed body in the world."""

    def distance(self, points_world_m: ArrayLike) -> FloatArray:
        """Signed distance (n,) from points (n, 3) to the surface; negative inside."""
        ...

    @property
    def bounds_world_m(self) -> Bounds:
        """Lower and upper corner of the axis-aligned box round it; infinite where it is unbounded."""
        ...


@dataclass(frozen=True)
class Box:
    """An axis-aligned box."""

    low_world_m: Vector
    high_world_m: Vector

    def __post_init__(self) -> None:
        _store(self, "low_world_m", 3)
        _store(self, "high_world_m", 3)
        if (np.array(self.high_world_m) <= np.array(self.low_world_m)).any():
            corners = f"from {self.low_world_m} to {self.high_world_m}"
            raise InputError(f"the box {corners} is empty; every number of the second corner must be larger")

    def distance(self, points_world_m: ArrayLike) -> FloatArray:
        low, high = self.bounds_world_m
        return _box_distance(checked_points(points_world_m) - 0.5 * (low + high), 0.5 * (high - low))

    @property
    def bounds_world_m(self) -> Bounds:
        return np.array(self.low_world_m), np.array(self.high_world_m)


@dataclass(frozen=True)
class Room:
    """Everything outside an axis-aligned box: floor, ceiling and walls, seen from inside."""

    low_world_m: Vector
    high_world_m: Vector

    def __post_init__(self) -> None:
        Box(self.low_world_m, self.high_world_m)
        _store(self, "low_world_m", 3)
        _store(self, "high_world_m", 3)

    def distance(self, points_world_m: ArrayLike) -> FloatArray:
        return -Box(self.low_world_m, self.high_world_m).distance(points_world_m)

    @property
    def bounds_world_m(self) -> Bounds:
        return np.full(3, -np.inf), np.full(3, np.inf)


@dataclass(frozen=True)
class OrientedBox:
    """A box turned about its centre."""

    centre_world_m: Vector
    half_extents_m: Vector
    q_world_box: tuple[float, float, float, float]
    """Takes the box's axes to the world's."""

    def __post_init__(self) -> None:
        _store(self, "centre_world_m", 3)
        _store(self, "half_extents_m", 3)
        _store(self, "q_world_box", 4)
        _positive(min(self.half_extents_m), "the half extents of a box")
        _positive(float(portable.length(np.array(self.q_world_box))), "the norm of a quaternion")

    @property
    def R_world_box(self) -> FloatArray:
        return rotations.matrix(rotations.normalise(self.q_world_box))

    def distance(self, points_world_m: ArrayLike) -> FloatArray:
        points_box = portable.product(checked_points(points_world_m) - np.array(self.centre_world_m), self.R_world_box)
        return _box_distance(points_box, np.array(self.half_extents_m))

    @property
    def bounds_world_m(self) -> Bounds:
        extent = (np.abs(self.R_world_box) * np.array(self.half_extents_m)).sum(axis=1)
        return np.array(self.centre_world_m) - extent, np.array(self.centre_world_m) + extent


@dataclass(frozen=True)
class Sphere:
    centre_world_m: Vector
    radius_m: float

    def __post_init__(self) -> None:
        _store(self, "centre_world_m", 3)
        _positive(self.radius_m, "the radius of a sphere")

    def distance(self, points_world_m: ArrayLike) -> FloatArray:
        offset = checked_points(points_world_m) - np.array(self.centre_world_m)
        return np.linalg.norm(offset, axis=1) - self.radius_m

    @property
    def bounds_world_m(self) -> Bounds:
        return np.array(self.centre_world_m) - self.radius_m, np.array(self.centre_world_m) + self.radius_m


@dataclass(frozen=True)
class Cylinder:
    """An upright cylinder: a pillar."""

    centre_world_m: Vector
    """The middle of its axis."""
    radius_m: float
    height_m: float

    def __post_init__(self) -> None:
        _store(self, "centre_world_m", 3)
        _positive(self.radius_m, "the radius of a cylinder")
        _positive(self.height_m, "the height of a cylinder")

    def distance(self, points_world_m: ArrayLike) -> FloatArray:
        offset = checked_points(points_world_m) - np.array(self.centre_world_m)
        around = portable.length(offset[:, :2]) - self.radius_m
        return _extruded(around, np.abs(offset[:, 2]) - 0.5 * self.height_m)

    @property
    def bounds_world_m(self) -> Bounds:
        extent = np.array([self.radius_m, self.radius_m, 0.5 * self.height_m])
        return np.array(self.centre_world_m) - extent, np.array(self.centre_world_m) + extent


@dataclass(frozen=True)
class Capsule:
    """All points within a radius of a line segment: a cable, a beam, a brush stroke between two points."""

    start_world_m: Vector
    end_world_m: Vector
    radius_m: float

    def __post_init__(self) -> None:
        _store(self, "start_world_m", 3)
        _store(self, "end_world_m", 3)
        _positive(self.radius_m, "the radius of a capsule")

    def distance(self, points_world_m: ArrayLike) -> FloatArray:
        offset = checked_points(points_world_m) - np.array(self.start_world_m)
        axis = np.array(self.end_world_m) - np.array(self.start_world_m)
        along = _share(offset, axis)
        return np.linalg.norm(offset - along[:, None] * axis, axis=1) - self.radius_m

    @property
    def bounds_world_m(self) -> Bounds:
        ends = np.array([self.start_world_m, self.end_world_m])
        return ends.min(axis=0) - self.radius_m, ends.max(axis=0) + self.radius_m


@dataclass(frozen=True)
class Prism:
    """An upright column over a simple polygon, in either sense of rotation."""

    polygon_world_m: tuple[tuple[float, float], ...]
    """x, y of each corner, in order; the last is joined to the first."""
    z_low_m: float
    z_high_m: float

    def __post_init__(self) -> None:
        corners = np.asarray(self.polygon_world_m, dtype=np.float64)
        if corners.ndim != 2 or corners.shape[1] != 2 or len(corners) < 3:
            raise InputError(f"a prism's polygon: expected shape (n, 2) with n >= 3 corners, got {corners.shape}")
        if not (np.isfinite(corners).all() and np.isfinite([self.z_low_m, self.z_high_m]).all()):
            raise InputError("a prism's corners and heights must be finite")
        _positive(self.z_high_m - self.z_low_m, "the height of a prism")
        following = np.roll(corners, -1, axis=0)
        area = 0.5 * np.sum(corners[:, 0] * following[:, 1] - following[:, 0] * corners[:, 1])
        _positive(abs(float(area)), "the area of a prism's polygon")
        object.__setattr__(self, "polygon_world_m", tuple((float(x), float(y)) for x, y in corners))

    def distance(self, points_world_m: ArrayLike) -> FloatArray:
        points = checked_points(points_world_m)
        across = _polygon_distance(points[:, :2], np.array(self.polygon_world_m))
        middle, half = 0.5 * (self.z_low_m + self.z_high_m), 0.5 * (self.z_high_m - self.z_low_m)
        return _extruded(across, np.abs(points[:, 2] - middle) - half)

    @property
    def bounds_world_m(self) -> Bounds:
        corners = np.array(self.polygon_world_m)
        low, high = corners.min(axis=0), corners.max(axis=0)
        return np.append(low, self.z_low_m), np.append(high, self.z_high_m)


@dataclass(frozen=True)
class Stroke:
    """All points within a radius of a polyline: one stroke of a round brush; one point paints a ball."""

    points_world_m: tuple[Vector, ...]
    radius_m: float

    def __post_init__(self) -> None:
        points = np.asarray(self.points_world_m, dtype=np.float64)
        if points.ndim != 2 or points.shape[1] != 3 or len(points) == 0 or not np.isfinite(points).all():
            raise InputError(f"a stroke's points: expected shape (n, 3), all finite, got {points.shape}")
        _positive(self.radius_m, "the radius of a brush")
        object.__setattr__(self, "points_world_m", tuple((float(x), float(y), float(z)) for x, y, z in points))

    def distance(self, points_world_m: ArrayLike) -> FloatArray:
        path = self.points_world_m
        pieces = [Capsule(a, b, self.radius_m) for a, b in zip(path, path[1:] or path, strict=False)]
        return Scene(pieces).distance(points_world_m)

    @property
    def bounds_world_m(self) -> Bounds:
        points = np.array(self.points_world_m)
        return points.min(axis=0) - self.radius_m, points.max(axis=0) + self.radius_m


@dataclass(frozen=True)
class Scene:
    """The union of solids. Exact outside all of them; inside overlapping ones the depth is a lower bound."""

    solids: Sequence[Solid]

    def __post_init__(self) -> None:
        object.__setattr__(self, "solids", tuple(self.solids))

    def distance(self, points_world_m: ArrayLike) -> FloatArray:
        points = checked_points(points_world_m)
        nearest = np.full(len(points), np.inf)
        for solid in self.solids:
            np.minimum(nearest, solid.distance(points), out=nearest)
        return nearest

    @property
    def bounds_world_m(self) -> Bounds:
        corners = [solid.bounds_world_m for solid in self.solids] or [(np.full(3, np.inf), np.full(3, -np.inf))]
        return np.min([c[0] for c in corners], axis=0), np.max([c[1] for c in corners], axis=0)


def rasterize(solid: Solid, grid: Grid) -> StateArray:
    """A fully observed map of a solid: every voxel it touches OCCUPIED (and few others), the rest FREE.

    So the field built from it never overestimates the distance to the solid.
    """
    state = np.full(grid.shape, FREE, np.uint8)
    for part in solid.solids if isinstance(solid, Scene) else [solid]:
        for slab in slabs(covered_region(part, grid)):
            state[slab.slices][touched(part, grid, slab)] = OCCUPIED
    return state


def covered_region(solid: Solid, grid: Grid) -> Region:
    """A box that holds all voxels the solid touches."""
    reach = np.array(grid.voxel_m)
    low, high = solid.bounds_world_m
    first, last = grid.low_world_m - 2.0 * reach, grid.high_world_m + 2.0 * reach  # far ones would overflow an index
    return grid.region(np.clip(low - reach, first, last), np.clip(high + reach, first, last))


def slabs(region: Region) -> Iterator[Region]:
    """The region in slices along x of at most `_SLAB_VOXELS` voxels, or one layer, to bound memory."""
    step = max(1, _SLAB_VOXELS // max(1, region.shape[1] * region.shape[2]))
    for x in range(region.low[0], region.high[0], step):
        yield Region((x, *region.low[1:]), (min(x + step, region.high[0]), *region.high[1:]))


def touched(solid: Solid, grid: Grid, region: Region) -> NDArray[np.bool_]:
    """Which voxels of the region the solid touches: exact for boxes and rooms, otherwise within half a diagonal."""
    if isinstance(solid, Box | Room):
        sense = 1.0 if isinstance(solid, Box) else -1.0
        low, high, half = np.array(solid.low_world_m), np.array(solid.high_world_m), 0.5 * np.array(grid.voxel_m)
        # A face on the boundary between two voxels touches neither's inside; 1e-9 m is rounding.
        within = [
            np.abs(grid.axis_centres(a, region) - 0.5 * (low + high)[a])
            < 0.5 * (high - low)[a] + sense * (half[a] - 1e-9)
            for a in range(3)
        ]
        inside = within[0][:, None, None] & within[1][:, None] & within[2]
        return inside if isinstance(solid, Box) else ~inside
    return solid.distance(grid.centres(region).reshape(-1, 3)).reshape(region.shape) <= grid.half_diagonal_m


def _box_distance(points: FloatArray, half_extents: FloatArray) -> FloatArray:
    beyond = np.abs(points) - half_extents
    return np.linalg.norm(np.maximum(beyond, 0.0), axis=1) + np.minimum(beyond.max(axis=1), 0.0)


def _extruded(across: FloatArray, along: FloatArray) -> FloatArray:
    """Distance to an upright body, from the distance to its base in the plane and the distance beyond its ends."""
    outside = np.sqrt(np.maximum(across, 0.0) ** 2 + np.maximum(along, 0.0) ** 2)
    return outside + np.minimum(np.maximum(across, along), 0.0)


def _share(offset: FloatArray, edge: FloatArray) -> FloatArray:
    """How far along an edge each point is nearest to it, (n,) from 0 to 1."""
    square = max(float((edge * edge).sum()), np.finfo(float).tiny)
    return np.clip((offset * edge).sum(axis=1) / square, 0.0, 1.0)


def _polygon_distance(points: FloatArray, corners: FloatArray) -> FloatArray:
    nearest_squared = np.full(len(points), np.inf)
    inside = np.zeros(len(points), bool)
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        edge, offset = b - a, points - a
        along = _share(offset, edge)
        foot = offset - along[:, None] * edge
        nearest_squared = np.minimum(nearest_squared, np.einsum("ij,ij->i", foot, foot))
        # Even-odd rule: a ray towards +x crosses this edge.
        crosses = (a[1] > points[:, 1]) != (b[1] > points[:, 1])
        if a[1] != b[1]:
            inside ^= crosses & (points[:, 0] < a[0] + (points[:, 1] - a[1]) * (edge[0] / edge[1]))
    return np.where(inside, -1.0, 1.0) * np.sqrt(nearest_squared)


def _store(solid: object, name: str, length: int) -> None:
    """Replace an attribute by a tuple of finite floats."""
    numbers = np.asarray(getattr(solid, name), dtype=np.float64)
    if numbers.shape != (length,) or not np.isfinite(numbers).all():
        raise InputError(f"{type(solid).__name__}.{name}: expected {length} finite numbers, got {numbers.tolist()}")
    object.__setattr__(solid, name, tuple(float(x) for x in numbers))


def _positive(value: float, what: str) -> None:
    if not (np.isfinite(value) and value > 0.0):
        raise InputError(f"{what} is {value:g}; it must be positive")
