"""How far a map of the rendered room is from the truth: poses, surface, and free space that is not free."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import mapping
from esdf import FREE
from flight import FloatArray, frames, rotations

_NEAR_M = 0.05


@dataclass(frozen=True, slots=True)
class MapAccuracy:
    """A map after the best rigid alignment (no scale) of its poses with the true ones."""

    poses: int
    position_rms_m: float
    attitude_rms_rad: float
    scale: float
    """Length of the mapped path over the true one."""
    surface_median_m: float
    """Median distance of the mesh's vertices to the nearest true surface."""
    surface_within_5_cm: float
    """Share of the vertices that are nearer than 5 cm to a true surface."""
    free_but_solid: float
    """Share of the voxels called free whose centre is more than a voxel deep in something solid."""

    def as_dict(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in self.__slots__}


def measure(area: mapping.Map, truth_csv: Path, scene: Any) -> MapAccuracy:
    """Compare a map with the poses and the scene it was rendered from.

    Args:
        truth_csv: `truth/poses.csv` of the rendered sequence; images are matched by name.
        scene: with `distance(points) -> (n,)`, the true distance to the nearest surface, negative inside.
    """
    names, _, T_all = mapping.read_poses(truth_csv)
    index = {name: i for i, name in enumerate(names)}
    T_true = T_all[[index[name] for name in area.images]]
    T_truth_map = rigid_alignment(area.T_world_body[:, :3, 3], T_true[:, :3, 3])
    T_aligned = T_truth_map @ area.T_world_body
    true_m, aligned = T_true[:, :3, 3], T_aligned[:, :3, 3]
    turned = rotations.from_matrix(frames.invert(T_true)[:, :3, :3] @ T_aligned[:, :3, :3])
    surface = np.abs(scene.distance(frames.apply(T_truth_map, mesh_vertices(area.mesh))))
    return MapAccuracy(
        poses=len(area.images),
        position_rms_m=_rms(np.linalg.norm(aligned - true_m, axis=1)),
        attitude_rms_rad=_rms(np.linalg.norm(rotations.log(turned), axis=1)),
        scale=_length(aligned) / _length(true_m),
        surface_median_m=float(np.median(surface)),
        surface_within_5_cm=float((surface < _NEAR_M).mean()),
        free_but_solid=_free_but_solid(area, T_truth_map, scene),
    )


def rigid_alignment(points_a: FloatArray, points_b: FloatArray) -> FloatArray:
    """The rigid transform T_b_a (4, 4) that takes (n, 3) points closest to their partners (Kabsch 1976)."""
    centre_a, centre_b = points_a.mean(axis=0), points_b.mean(axis=0)
    u, _, vt = np.linalg.svd((points_b - centre_b).T @ (points_a - centre_a))
    handed = np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
    T = np.eye(4)
    T[:3, :3] = u @ handed @ vt
    T[:3, 3] = centre_b - T[:3, :3] @ centre_a
    return T


def mesh_vertices(path: Path) -> FloatArray:
    import open3d

    return np.asarray(open3d.io.read_triangle_mesh(str(path)).vertices)


def _free_but_solid(area: mapping.Map, T_truth_map: FloatArray, scene: Any) -> float:
    grid = area.field.grid
    free = np.argwhere(area.field.state == FREE)
    voxel_m = np.asarray(grid.voxel_m)
    centres = np.asarray(grid.origin_world_m) + (free + 0.5) * voxel_m
    return float((scene.distance(frames.apply(T_truth_map, centres)) < -voxel_m.max()).mean())


def _length(path: FloatArray) -> float:
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))
