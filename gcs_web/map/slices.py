"""Pictures of planes through a map: distance, unknown space, what could hide, confidence. Arrays in, images out."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import esdf
from esdf.grid import Grid
from esdf.visibility import Visibility
from flight import FloatArray, rotations
from gcs_web.protocol.map import Slice
from gcs_web.scene import drawing
from mapping import Map
from mapping.dense.confidence import MeasuredSurface

MOST_PIXELS, MOST_PER_VOXEL = 900, 6
"""Of a picture's longer side, and of a voxel's."""

_AXES = {"x": 0, "y": 1, "z": 2}
_ALPHA, _HATCH_ALPHA, _FAINT_ALPHA = 205, 120, 28
_LIMIT, _UNKNOWN, _OCCUPIED = (231, 214, 60), (139, 151, 162), (233, 237, 240)
_INFERRED = (196, 140, 255)
_STRIPE_PX = 9
_NEAR_SURFACE_VOXELS = 2.0
"""What is occupied and farther from measured surface is so by an edit, a line, or what was too small for the mesh."""

Colours = np.ndarray
"""(h, w, 4) uint8."""
Marked = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """An image that stands in the world."""

    rgba: Colours
    """Rows from the top."""
    centre_world_m: FloatArray
    """(3,)."""
    size_m: tuple[float, float]
    """Width and height."""
    q_world_image: FloatArray
    """(4,) of an image whose x is to the right and whose y is down."""


@dataclass(frozen=True, slots=True, eq=False)
class _Plane:
    points_world_m: FloatArray
    """(h * w, 3), rows from the top."""
    shape: tuple[int, int]
    centre_world_m: FloatArray
    size_m: tuple[float, float]
    q_world_image: FloatArray


def draw(
    area: Map,
    field: esdf.Field,
    wanted: Slice,
    required_m: float,
    hidden: Visibility | None = None,
    inferred: Marked | None = None,
    surface: MeasuredSurface | None = None,
) -> Picture:
    """A slice through a map.

    Args:
        field: the map's, or one with other edits.
        required_m: clearance at which the colours of a distance begin; below it is hatched.
        hidden: of the map's images, for a slice of `could_hide`.
        inferred: (nx, ny, nz) voxels of plain walls that nothing measured, for a slice of `unknown`.
        surface: of the map, for a slice of `surface_std`.
    """
    plane = _oblique(field.grid, wanted) if wanted.axis == "oblique" else _plane(field.grid, wanted)
    if wanted.of == "unknown":
        rgba = _unknown(field, plane, inferred)
    elif wanted.of == "could_hide":
        rgba = _could_hide(hidden or area.visibility(), field, plane)
    elif wanted.of == "surface_std":
        rgba = _surface_std(surface, field, plane)
    else:
        rgba = _distance(field, plane, required_m)
    rgba[~field.grid.contains(plane.points_world_m).reshape(plane.shape), 3] = 0
    return Picture(rgba, plane.centre_world_m, plane.size_m, plane.q_world_image)


def normal(wanted: Slice) -> FloatArray:
    """Of a slice: (3,) of unit length, world. Its points p are those with normal . p = at_m."""
    if wanted.axis != "oblique":
        return np.eye(3)[_AXES[wanted.axis]]
    heading, tilt = np.radians([wanted.heading_deg, wanted.tilt_deg])
    return np.array([np.cos(tilt) * np.cos(heading), np.cos(tilt) * np.sin(heading), np.sin(tilt)])


def _oblique(grid: Grid, wanted: Slice) -> _Plane:
    """Points of a picture that just holds the mapped box; its right is horizontal, its top as high as can be."""
    across = normal(wanted)
    heading = np.radians(wanted.heading_deg)
    right = np.array([-np.sin(heading), np.cos(heading), 0.0])
    up = np.cross(across, right)
    low, voxel = np.array(grid.low_world_m), np.array(grid.voxel_m)
    size = np.array(grid.shape) * voxel
    corners = low + size * np.array(np.meshgrid([0, 1], [0, 1], [0, 1])).reshape(3, -1).T
    ends = np.array([[(corners @ side).min(), (corners @ side).max()] for side in (right, up)])
    span = ends[:, 1] - ends[:, 0]
    pixel_m = max(float(voxel.min()) / MOST_PER_VOXEL, float(span.max()) / MOST_PIXELS)
    width, height = np.maximum(np.ceil(span / pixel_m).astype(int), 1).tolist()
    place = [ends[i, 0] + (np.arange(n) + 0.5) * span[i] / n for i, n in enumerate((width, height))]
    points = place[0][None, :, None] * right + place[1][::-1, None, None] * up + wanted.at_m * across
    centre = ends.mean(axis=1) @ np.array([right, up]) + wanted.at_m * across
    q = rotations.from_matrix(np.column_stack([right, -up, np.cross(right, -up)]))
    return _Plane(points.reshape(-1, 3), (height, width), centre, (float(span[0]), float(span[1])), q)


def _plane(grid: Grid, wanted: Slice) -> _Plane:
    """Points of a picture: its right is +x (+y for a slice at an x), its top +z (+y for a slice at a z)."""
    axis = _AXES[wanted.axis]
    right, up = [i for i in range(3) if i != axis]
    low, voxel = np.array(grid.low_world_m), np.array(grid.voxel_m)
    cells = np.array(grid.shape)[[right, up]]
    per_voxel = int(np.clip(MOST_PIXELS // max(cells), 1, MOST_PER_VOXEL))
    width, height = (cells * per_voxel).tolist()
    size = cells * voxel[[right, up]]
    across = low[right] + (np.arange(width) + 0.5) * size[0] / width
    down = low[up] + (np.arange(height)[::-1] + 0.5) * size[1] / height
    points = np.empty((height, width, 3))
    points[..., right], points[..., up], points[..., axis] = across[None], down[:, None], wanted.at_m
    centre = low + 0.5 * np.array(grid.shape) * voxel
    centre[axis] = wanted.at_m
    columns = np.zeros((3, 3))
    columns[right, 0], columns[up, 1] = 1.0, -1.0
    columns[:, 2] = np.cross(columns[:, 0], columns[:, 1])
    q = rotations.from_matrix(columns)
    return _Plane(points.reshape(-1, 3), (height, width), centre, (float(size[0]), float(size[1])), q)


def _distance(field: esdf.Field, plane: _Plane, required_m: float) -> Colours:
    """Coloured where there is room, hatched where there is not, with a white line between."""
    distance = np.nan_to_num(field.distance(plane.points_world_m), nan=-1.0).reshape(plane.shape)
    near = distance < required_m
    rgba = _hatched(plane.shape, _LIMIT)
    rgba[field.status(plane.points_world_m).reshape(plane.shape) != esdf.KNOWN, 3] //= 3  # behind the walls
    rgba[~near, :3], rgba[~near, 3] = drawing.clearance_colours(distance[~near], required_m), _ALPHA
    return _outlined(rgba, near)


def _unknown(field: esdf.Field, plane: _Plane, inferred: Marked | None) -> Colours:
    """Hatched where nothing is known, filled where an obstacle is or a wall is inferred, clear where it is free."""
    status = field.status(plane.points_world_m).reshape(plane.shape)
    solid = np.nan_to_num(field.distance(plane.points_world_m), nan=-1.0).reshape(plane.shape) < 0.0
    rgba = _hatched(plane.shape, _UNKNOWN)
    known = status == esdf.KNOWN
    rgba[known] = 0
    rgba[known & solid] = (*_OCCUPIED, _ALPHA)
    if inferred is not None:
        inside = field.grid.contains(plane.points_world_m)
        wall = np.zeros(len(inside), bool)
        wall[inside] = inferred[tuple(field.grid.index(plane.points_world_m[inside]).T)]
        rgba[wall.reshape(plane.shape) & ~known] = (*_INFERRED, _ALPHA)
    return _outlined(rgba, ~known)


def _could_hide(hidden: Visibility, field: esdf.Field, plane: _Plane) -> Colours:
    """The thinnest object that was seen at each point, dark: thin; hatched where no image looked."""
    finest = hidden.finest(plane.points_world_m).reshape(plane.shape)
    seen = np.isfinite(finest)
    rgba = _hatched(plane.shape, _UNKNOWN)
    share = finest[seen] / drawing.COULD_HIDE_SPAN_M
    rgba[seen, :3], rgba[seen, 3] = drawing.colours(share, "cividis"), _ALPHA
    solid = np.nan_to_num(field.distance(plane.points_world_m), nan=-1.0).reshape(plane.shape) < 0.0
    rgba[solid & seen, 3] = _FAINT_ALPHA
    return rgba


def _surface_std(surface: MeasuredSurface | None, field: esdf.Field, plane: _Plane) -> Colours:
    """Obstacles by the standard deviation of the surface nearest to each, dark: small; pale where it is not known."""
    solid = np.nan_to_num(field.distance(plane.points_world_m), nan=1.0) < 0.0
    solid &= field.status(plane.points_world_m) == esdf.KNOWN
    rgba = np.zeros((len(solid), 4), dtype=np.uint8)
    rgba[solid] = (*_OCCUPIED, _FAINT_ALPHA)
    if surface is not None:
        near_m = _NEAR_SURFACE_VOXELS * max(field.grid.voxel_m)
        deviation_m = surface.deviations_m(plane.points_world_m[solid], near_m)
        at, known = np.flatnonzero(solid), np.isfinite(deviation_m)
        rgba[at[known], :3] = drawing.colours(deviation_m[known] / drawing.SURFACE_STD_SPAN_M, "cividis")
        rgba[at[known], 3] = _ALPHA
    return rgba.reshape(*plane.shape, 4)


def _hatched(shape: tuple[int, int], colour: tuple[int, int, int]) -> Colours:
    row, column = np.indices(shape)
    stripe = (row + column) % _STRIPE_PX < _STRIPE_PX // 4
    rgba = np.empty((*shape, 4), dtype=np.uint8)
    rgba[..., :3] = colour
    rgba[..., 3] = np.where(stripe, _HATCH_ALPHA, _FAINT_ALPHA)
    return rgba


def _outlined(rgba: Colours, inside: np.ndarray) -> Colours:
    """A white line along the edge of a region."""
    edge = np.zeros_like(inside)
    edge[:-1] |= inside[:-1] != inside[1:]
    edge[:, :-1] |= inside[:, :-1] != inside[:, 1:]
    rgba[edge] = (255, 255, 255, 255)
    return rgba
