"""Looking at a field: slices in any direction, iso-surfaces as meshes, a histogram. `goshawk.plot` draws them."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from esdf.field import Field, SampledField
from flight import FloatArray, InputError

Axis = Literal["x", "y", "z"]


@dataclass(frozen=True, slots=True, eq=False)
class Slice:
    """A plane through a field, sampled like a picture."""

    distance_m: FloatArray
    """(rows, columns); NaN where the map has no distance."""
    status: NDArray[np.uint8]
    """(rows, columns) KNOWN, UNMAPPED or OUTSIDE."""
    corner_world_m: FloatArray
    """(3,) of the first sample."""
    right_world_m: FloatArray
    """(3,) step from column to column."""
    up_world_m: FloatArray
    """(3,) step from row to row."""

    @property
    def extent_m(self) -> tuple[float, float, float, float]:
        """Left, right, bottom, top in metres along the picture's directions; of an axis slice, in the world."""
        edges: list[float] = []
        for step, count in (
            (self.right_world_m, self.distance_m.shape[1]),
            (self.up_world_m, self.distance_m.shape[0]),
        ):
            length = float(np.linalg.norm(step))
            first = float(self.corner_world_m @ step) / length - 0.5 * length
            edges += [first, first + count * length]
        return (edges[0], edges[1], edges[2], edges[3])


def axis_slice(field: SampledField, axis: Axis, at_m: float) -> Slice:
    """The plane where one world coordinate is `at_m`, a pixel a voxel: x or y horizontal, the later one upwards.

    Raises:
        InputError: the plane misses the map.
    """
    a = "xyz".index(axis)
    low, high = field.grid.low_world_m, field.grid.high_world_m
    if not low[a] <= at_m <= high[a]:
        raise InputError(f"the map goes from {axis} = {low[a]:g} to {high[a]:g} m; {at_m:g} m is outside of it")
    u, v = [b for b in range(3) if b != a]
    centre = 0.5 * (low + high)
    centre[a] = at_m
    size = (float(high[u] - low[u]), float(high[v] - low[v]))
    return oblique_slice(field, centre, np.eye(3)[u], np.eye(3)[v], size_m=size, step_m=min(field.grid.voxel_m))


def oblique_slice(
    field: SampledField,
    centre_world_m: ArrayLike,
    right_world: ArrayLike,
    up_world: ArrayLike,
    *,
    size_m: tuple[float, float],
    step_m: float,
) -> Slice:
    """Any plane: `right` and `up` span it (`up` is made perpendicular), `size_m` is its width and height."""
    right = np.asarray(right_world, dtype=np.float64)
    up = np.asarray(up_world, dtype=np.float64)
    if np.linalg.norm(np.cross(right, up)) < 1e-9:
        raise InputError("the directions of a slice must not be parallel")
    if not (step_m > 0.0 and min(size_m) > 0.0):
        raise InputError(f"a slice of {size_m} m in steps of {step_m:g} m is empty")
    right = right / np.linalg.norm(right)
    up = up - right * (up @ right)
    up = up / np.linalg.norm(up)
    columns, rows = (max(1, round(s / step_m)) for s in size_m)
    across = (np.arange(columns) - 0.5 * (columns - 1)) * step_m
    along = (np.arange(rows) - 0.5 * (rows - 1)) * step_m
    centre = np.asarray(centre_world_m, dtype=np.float64)
    points = centre + along[:, None, None] * up + across[None, :, None] * right
    flat = points.reshape(-1, 3)
    distance, status = field.distance(flat).reshape(rows, columns), field.status(flat).reshape(rows, columns)
    return Slice(distance, status, points[0, 0], right * step_m, up * step_m)


def plane_through(field: SampledField, a_world_m: ArrayLike, b_world_m: ArrayLike, c_world_m: ArrayLike) -> Slice:
    """The plane through three points as far as the map goes: from a to b is right, and c lies above that line.

    Raises:
        InputError: the points lie on one line, or the plane misses the map.
    """
    a, b, c = (np.asarray(p, dtype=np.float64) for p in (a_world_m, b_world_m, c_world_m))
    right, up = b - a, c - a
    if np.linalg.norm(np.cross(right, up)) < 1e-9 * max(float(right @ right), float(up @ up), 1e-9):
        raise InputError("the three points of a plane must not lie on one line")
    right = right / np.linalg.norm(right)
    up = up - right * (up @ right)
    up = up / np.linalg.norm(up)
    outline = _cut_box(a, np.cross(right, up), field.grid.low_world_m, field.grid.high_world_m)
    if len(outline) < 3:
        raise InputError("the plane through these points misses the map")
    across, along = (outline - a) @ right, (outline - a) @ up
    centre = a + 0.5 * (across.min() + across.max()) * right + 0.5 * (along.min() + along.max()) * up
    size = (float(np.ptp(across)), float(np.ptp(along)))
    return oblique_slice(field, centre, right, up, size_m=size, step_m=min(field.grid.voxel_m))


def _cut_box(point: FloatArray, normal: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """Where a plane meets the edges of a box: (n, 3)."""
    corners = np.array([[(low, high)[i >> a & 1][a] for a in range(3)] for i in range(8)])
    beside = (corners - point) @ normal
    hits = [
        corners[i] + (corners[j] - corners[i]) * (beside[i] / (beside[i] - beside[j]))
        for i in range(8)
        for j in (i | 1, i | 2, i | 4)
        if i != j and beside[i] * beside[j] <= 0.0 and beside[i] != beside[j]
    ]
    return np.array(hits).reshape(-1, 3)


def colours(distance_m: FloatArray, *, full_m: float = 2.0) -> NDArray[np.uint8]:
    """RGB (..., 3): red and dark inside obstacles, from orange over white to blue outside, grey for NaN."""
    d = np.nan_to_num(np.clip(distance_m / full_m, -1.0, 1.0), nan=0.0)[..., None]
    anchors = np.array([-1.0, -1e-6, 0.0, 0.15, 0.5, 1.0])
    palette = np.array([[60, 0, 0], [170, 20, 20], [240, 110, 30], [250, 220, 160], [170, 205, 235], [30, 80, 160]])
    rgb = np.concatenate([np.interp(d, anchors, palette[:, channel]) for channel in range(3)], axis=-1)
    rgb[np.isnan(distance_m)] = 128
    return np.rint(rgb).astype(np.uint8)


def histogram(field: Field, *, bins: int = 60) -> tuple[FloatArray, FloatArray]:
    """Bin edges (bins + 1,) in metres and the known volume in each bin (bins,), in cubic metres."""
    values = field.values_m[np.isfinite(field.values_m)]
    if values.size == 0:
        raise InputError("nothing in this map is known, so there is no distance to count")
    counts, edges = np.histogram(values, bins=bins)
    return edges.astype(np.float64), counts * float(np.prod(field.grid.voxel_m))


def iso_surface(field: Field, level_m: float = 0.0) -> tuple[FloatArray, NDArray[np.int32]]:
    """The surface where the distance is `level_m`: vertices (n, 3) and triangles (m, 3), normals towards free space.

    Each cell of eight voxel centres is cut into six tetrahedra (so no case is ambiguous, and the surface has no holes);
    cells with an unknown corner are left out.
    """
    values = field.values_m - np.float32(level_m)
    base = np.argwhere(_crossed(values))
    corners = np.array([[c >> 2 & 1, c >> 1 & 1, c & 1] for c in range(8)])
    value = np.stack([values[tuple((base + c).T)] for c in corners], axis=1)
    points = field.grid.centre((base[:, None] + corners).reshape(-1, 3)).reshape(-1, 8, 3)
    triangles = [_cut(value[:, t], points[:, t]) for t in TETRAHEDRA]
    soup = np.concatenate(triangles) if triangles else np.empty((0, 3, 3))
    vertices, number = np.unique(np.round(soup.reshape(-1, 3), 9), axis=0, return_inverse=True)
    faces = number.reshape(-1, 3).astype(np.int32)
    whole = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    return vertices, faces[whole]


TETRAHEDRA = np.array([[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]])
"""A cube's corners 4 x + 2 y + z in six tetrahedra round the diagonal 0-7."""


def _crossed(values: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Cells whose corners are on both sides (a NaN corner makes neither comparison true)."""
    low, high = values, values
    for axis in range(3):
        front = tuple(slice(None, -1) if a == axis else slice(None) for a in range(3))
        back = tuple(slice(1, None) if a == axis else slice(None) for a in range(3))
        low, high = np.minimum(low[front], low[back]), np.maximum(high[front], high[back])
    return (low < 0) & (high >= 0)


def _cut(value: NDArray[np.float32], points: FloatArray) -> FloatArray:
    """Triangles (m, 3, 3) where the linear function on tetrahedra (n, 4), (n, 4, 3) is zero."""
    inside = value < 0
    order = np.argsort(~inside, axis=1, kind="stable")  # corners inside come first
    v = np.take_along_axis(value, order, axis=1).astype(np.float64)
    p = np.take_along_axis(points, order[..., None], axis=1)
    count = inside.sum(axis=1)

    def crossing(rows: NDArray[np.bool_], a: int, b: int) -> FloatArray:
        t = v[rows, a] / (v[rows, a] - v[rows, b])
        return p[rows, a] + t[:, None] * (p[rows, b] - p[rows, a])

    one, two, three = count == 1, count == 2, count == 3
    pieces = [
        np.stack([crossing(one, 0, b) for b in (1, 2, 3)], axis=1),
        np.stack([crossing(three, a, 3) for a in (0, 1, 2)], axis=1),
    ]
    quad = [crossing(two, a, b) for a, b in ((0, 2), (0, 3), (1, 3), (1, 2))]
    pieces += [np.stack([quad[0], quad[1], quad[2]], axis=1), np.stack([quad[0], quad[2], quad[3]], axis=1)]
    out = np.concatenate(pieces)
    deep = np.concatenate([p[rows, 0] for rows in (one, three, two, two)])
    normal = np.cross(out[:, 1] - out[:, 0], out[:, 2] - out[:, 0])
    inward = np.einsum("ij,ij->i", normal, out[:, 0] - deep) < 0
    out[inward] = out[inward][:, ::-1]
    return out
