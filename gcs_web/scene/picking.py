"""What a click in the 3D view means: a ray against the map's mesh and against the path. Arrays in, numbers out."""

import math
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from flight import FloatArray, rotations

NEAR_PATH_M = 0.15
"""A click whose ray passes the path closer than this is a click on the path."""
LEVEL = 0.7
"""A surface whose normal points up by more than this is a floor: a waypoint is put above it, not in front of it."""

_EDGE = 1e-9
"""A ray along the edge of two triangles meets one of them."""


def nearest_on_path(origin_m: FloatArray, direction: FloatArray, path_m: FloatArray) -> int | None:
    """Index of the path's point (m, 3) that a ray passes the closest, None where none is within NEAR_PATH_M.

    Args:
        origin_m: (3,) world.
        direction: (3,) world, unit length.
    """
    offset = path_m - origin_m
    along_m = np.maximum(offset @ direction, 0.0)
    distance_m = np.linalg.norm(offset - along_m[:, None] * direction, axis=1)
    k = int(np.argmin(distance_m))
    return k if distance_m[k] <= NEAR_PATH_M else None


def on_screen(
    points_world_m: FloatArray, camera_world_m: FloatArray, q_world_camera: FloatArray, fov_rad: float, aspect: float
) -> FloatArray:
    """Where a pinhole camera sees points (n, 3): (n, 2) from 0 to 1, right and down; NaN behind it.

    Args:
        camera_world_m: (3,).
        q_world_camera: (4,) x right, y down, z forward.
        fov_rad: vertical field of view.
        aspect: width by height.
    """
    x, y, z = rotations.rotate(rotations.conjugate(q_world_camera), points_world_m - camera_world_m).T
    half = np.tan(0.5 * fov_rad)
    with np.errstate(divide="ignore", invalid="ignore"):
        places = 0.5 + 0.5 * np.stack([x / (z * half * aspect), y / (z * half)], axis=1)
    places[z <= 0.0] = np.nan
    return places


def in_rectangle(places: FloatArray, low: tuple[float, float], high: tuple[float, float]) -> NDArray[np.bool_]:
    """Which places (n, 2) are inside; NaN is not."""
    return np.all((places >= np.array(low)) & (places <= np.array(high)), axis=1)


class Surface:
    """A map's triangles, for rays."""

    def __init__(self, vertices_m: FloatArray, faces: np.ndarray) -> None:
        """
        Args:
            vertices_m: (n, 3) world.
            faces: (m, 3) indices, counter-clockwise seen from the front.
        """
        corners = np.asarray(vertices_m, dtype=np.float64)[faces]
        self._corner, self._along, self._up = (
            corners[:, 0],
            corners[:, 1] - corners[:, 0],
            corners[:, 2] - corners[:, 0],
        )

    def first_hit(self, origin_m: FloatArray, direction: FloatArray) -> tuple[FloatArray, FloatArray] | None:
        """Where a ray first meets the front of a triangle, and its unit normal; None where it meets none.

        Backs are passed through, as the view does not draw them. Moeller and Trumbore (1997), over all triangles at
        once: one click is too rare for a search tree, and for a library that holds one.

        Args:
            origin_m: (3,) world.
            direction: (3,) world, unit length.
        """
        across = np.cross(direction, self._up)
        facing = np.einsum("ij,ij->i", self._along, across)
        with np.errstate(divide="ignore", invalid="ignore"):
            offset = origin_m - self._corner
            u = np.einsum("ij,ij->i", offset, across) / facing
            turned = np.cross(offset, self._along)
            v = turned @ direction / facing
            distance_m = np.einsum("ij,ij->i", self._up, turned) / facing
            hit = (facing > 0.0) & (u >= -_EDGE) & (v >= -_EDGE) & (u + v <= 1.0 + _EDGE) & (distance_m > 0.0)
        if not hit.any():
            return None
        k = int(np.argmin(np.where(hit, distance_m, np.inf)))
        normal = np.cross(self._along[k], self._up[k])
        return origin_m + float(distance_m[k]) * direction, normal / np.linalg.norm(normal)


def waypoint_over(hit_m: FloatArray, normal: FloatArray, *, height_m: float, clearance_m: float) -> FloatArray:
    """Where a waypoint goes for a click on a surface: above a floor at `height_m` (world z), else in front of it.

    Over a floor it is at least `clearance_m` high.
    """
    if normal[2] > LEVEL:
        return np.array([hit_m[0], hit_m[1], max(height_m, hit_m[2] + clearance_m)])
    return hit_m + clearance_m * normal


class Camera(Protocol):
    """A browser's, as viser has it."""

    @property
    def position(self) -> FloatArray: ...
    @property
    def look_at(self) -> FloatArray: ...
    @property
    def fov(self) -> float: ...


def height_seen(camera: Camera) -> float:
    """Of the world in the picture from below to above, at the distance of the point looked at, m."""
    distance_m = float(np.linalg.norm(np.asarray(camera.look_at) - np.asarray(camera.position)))
    return 2.0 * distance_m * math.tan(0.5 * camera.fov)
