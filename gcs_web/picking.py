"""What a click in the 3D view means: a ray against the map's mesh and against the path. Arrays in, numbers out."""

from typing import TYPE_CHECKING

import numpy as np

from flight import FloatArray

if TYPE_CHECKING:
    import trimesh

NEAR_PATH_M = 0.15
"""A click whose ray passes the path closer than this is a click on the path."""
LEVEL = 0.7
"""A surface whose normal points up by more than this is a floor: a waypoint is put above it, not in front of it."""


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


class Surface:
    """A map's triangles, for rays."""

    def __init__(self, mesh: "trimesh.Trimesh") -> None:
        import open3d

        self._normals = np.asarray(mesh.face_normals)
        self._scene = open3d.t.geometry.RaycastingScene()
        vertices = open3d.core.Tensor.from_numpy(np.asarray(mesh.vertices, dtype=np.float32))
        self._scene.add_triangles(vertices, open3d.core.Tensor.from_numpy(np.asarray(mesh.faces, dtype=np.uint32)))

    def first_hit(self, origin_m: FloatArray, direction: FloatArray) -> tuple[FloatArray, FloatArray] | None:
        """Where a ray first meets the front of a triangle, and its unit normal; None where it meets none.

        Backs are passed through, as the view does not draw them.

        Args:
            origin_m: (3,) world.
            direction: (3,) world, unit length.
        """
        import open3d

        ray = open3d.core.Tensor.from_numpy(np.concatenate([origin_m, direction]).astype(np.float32)[None])
        hits = self._scene.list_intersections(ray)
        distance_m, triangle = hits["t_hit"].numpy(), hits["primitive_ids"].numpy()
        front = self._normals[triangle] @ direction < 0.0
        if not front.any():
            return None
        k = int(np.argmin(np.where(front, distance_m, np.inf)))
        return origin_m + float(distance_m[k]) * direction, self._normals[triangle[k]]


def waypoint_over(hit_m: FloatArray, normal: FloatArray, *, height_m: float, clearance_m: float) -> FloatArray:
    """Where a waypoint goes for a click on a surface: above a floor at `height_m` (world z), else in front of it.

    Over a floor it is at least `clearance_m` high.
    """
    if normal[2] > LEVEL:
        return np.array([hit_m[0], hit_m[1], max(height_m, hit_m[2] + clearance_m)])
    return hit_m + clearance_m * normal
