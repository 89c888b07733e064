"""Error of a map of the rendered room: its poses, and by `mapping.map_accuracy` its surface and free space."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

import mapping
from flight import FloatArray, frames, rotations
from goshawk.rendered import accuracy as map_accuracy
from goshawk.rendered.accuracy import MapAccuracy
from goshawk.rendered.scene import RenderedScene
from mapping.dense import mesh_file


@dataclass(frozen=True, slots=True)
class Accuracy:
    """A map after the best rigid alignment (no scale) of its poses with the true ones."""

    position_rms_m: float
    attitude_rms_rad: float
    scale: float
    """Length of the mapped path over the true one."""
    surface: MapAccuracy

    def as_dict(self) -> dict[str, Any]:
        return asdict(self)


def measure(area: mapping.Map, truth_csv: Path, scene: RenderedScene) -> Accuracy:
    """Compare a map with the poses and the scene it was rendered from.

    Args:
        truth_csv: `truth/poses.csv` of the rendered sequence; images are matched by name.
    """
    names, _, T_all = mapping.read_poses(truth_csv)
    index = {name: i for i, name in enumerate(names)}
    T_true = T_all[[index[name] for name in area.images]]
    T_truth_map = rigid_alignment(area.T_world_body[:, :3, 3], T_true[:, :3, 3])
    T_aligned = T_truth_map @ area.T_world_body
    true_m, aligned_m = T_true[:, :3, 3], T_aligned[:, :3, 3]
    turned = rotations.from_matrix(frames.invert(T_true)[:, :3, :3] @ T_aligned[:, :3, :3])
    shots = [(camera, T @ camera.T_body_camera) for T in T_true for camera in area.rig.cameras]
    seen = map_accuracy.seen_surface(scene, shots, rng=np.random.default_rng(1))
    return Accuracy(
        position_rms_m=_rms(np.linalg.norm(aligned_m - true_m, axis=1)),
        attitude_rms_rad=_rms(np.linalg.norm(rotations.log(turned), axis=1)),
        scale=_length(aligned_m) / _length(true_m),
        surface=map_accuracy.compare(
            scene, seen, mesh_vertices(area), area.field.state, area.field.grid, T_world_map=T_truth_map
        ),
    )


def rigid_alignment(points_a: FloatArray, points_b: FloatArray) -> FloatArray:
    """The rigid transform T_b_a (4, 4) that takes (n, 3) points closest to the corresponding ones (Kabsch 1976)."""
    centre_a, centre_b = points_a.mean(axis=0), points_b.mean(axis=0)
    u, _, vt = np.linalg.svd((points_b - centre_b).T @ (points_a - centre_a))
    handed = np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
    T = np.eye(4)
    T[:3, :3] = u @ handed @ vt
    T[:3, 3] = centre_b - T[:3, :3] @ centre_a
    return T


def mesh_vertices(area: mapping.Map) -> FloatArray:
    """(v, 3) world.

    Raises:
        InputError: the map has no mesh.
    """
    vertices, _, _ = mesh_file.load(area.folder / "mesh.ply")
    return vertices


def _length(path: FloatArray) -> float:
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))
