"""The map's mesh as the 3D view shows it: simplified, and with ambient occlusion in its colours to show its shape.

It is made once per map, in a process of its own, since reading and simplifying a million triangles takes more memory
than all the rest of the station; the result is kept in the project's `.session`.
"""

import zipfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from flight import FloatArray, MapError, Progress, file_format, silent
from gcs_web.job_process import Failed, JobProcess

if TYPE_CHECKING:
    import open3d
    import trimesh

DISPLAY_TRIANGLES = 60_000
"""A larger mesh is decimated for display, so that the first picture is 2 MB with the page; the map is not changed."""
TRIANGLES_PER_STEP = 250_000
"""Triangles that one step of the decimation removes, about four seconds; four steps take as long as one large one."""
CACHE = "display_mesh.npz"

_VERSION = 2
"""Of what is made: a cache of another one is made again."""
_DARKENED = 0.95
"""Share of the mesh's brightness that is shown: the path must stand out from it."""
_PLAIN = 0.6
"""Brightness of a mesh that has no colours of its own."""
_RAYS, _REACH_M, _OFF_M = 48, 1.2, 0.02
"""Rays from each vertex into the half space before it; what they meet within this distance takes light; where they
begin, off the surface."""
_DARKEST = 0.3
"""Brightness that is left where all rays meet something."""
_RAYS_AT_ONCE = 500_000


def load(path: Path, triangles: int, folder: Path, *, progress: Progress = silent) -> "trimesh.Trimesh":
    """The mesh to show, from the cache in `folder` or made anew.

    Raises:
        MapError: the file holds no mesh that can be read.
    """
    key = _key(path, triangles)
    mesh = _cached(folder / CACHE, key)
    if mesh is None:
        folder.mkdir(parents=True, exist_ok=True)
        made = JobProcess(_make, folder, (path, triangles, key), folder / "display_mesh.log").outcome(progress)
        if isinstance(made, Failed):
            raise MapError(made.reason)
        mesh = _cached(folder / CACHE, key)
    if mesh is None:
        raise MapError(f"{path.name} could not be prepared for display; see {folder / 'display_mesh.log'}")
    return mesh


def simplified(path: Path, triangles: int, *, progress: Progress = silent) -> "open3d.geometry.TriangleMesh":
    """A mesh file, simplified by quadric decimation if it has more than `triangles`.

    Raises:
        MapError: the file holds no mesh that can be read.
    """
    import open3d

    mesh = open3d.io.read_triangle_mesh(path)
    if not len(mesh.triangles):
        raise MapError(f"{path.name} holds no triangles or cannot be read; build the map again")
    surplus = len(mesh.triangles) - triangles
    steps = max(int(np.ceil(surplus / TRIANGLES_PER_STEP)), 0)
    for left in range(steps - 1, -1, -1):
        progress("simplifying the mesh", 1.0 - (left + 1) / steps)
        mesh = mesh.simplify_quadric_decimation(triangles + left * surplus // steps)
    return mesh


def light(vertices_m: FloatArray, normals: FloatArray, faces: np.ndarray, *, progress: Progress = silent) -> FloatArray:
    """Share of the sky that each vertex sees: ambient occlusion by rays, cosine-weighted, of limited reach.

    Args:
        vertices_m: (n, 3).
        normals: (n, 3), unit length.
        faces: (m, 3) indices.

    Returns:
        (n,) from 0 (all rays meet something near) to 1.
    """
    import open3d

    scene = open3d.t.geometry.RaycastingScene()
    scene.add_triangles(
        open3d.core.Tensor.from_numpy(vertices_m.astype(np.float32)),
        open3d.core.Tensor.from_numpy(faces.astype(np.uint32)),
    )
    sphere = np.random.default_rng(1).normal(size=(_RAYS, 3))
    sphere /= np.linalg.norm(sphere, axis=1, keepdims=True)
    open_share = np.empty(len(vertices_m))
    step = max(_RAYS_AT_ONCE // _RAYS, 1)
    for start in range(0, len(vertices_m), step):
        progress("shading the mesh", start / len(vertices_m))
        part = slice(start, start + step)
        direction = normals[part, None] + 0.98 * sphere  # a unit sphere on the normal's tip: cosine-weighted
        direction /= np.linalg.norm(direction, axis=2, keepdims=True)
        origin = np.broadcast_to((vertices_m + _OFF_M * normals)[part, None], direction.shape)
        rays = np.concatenate([origin, direction], axis=2).astype(np.float32)
        hit = scene.test_occlusions(open3d.core.Tensor.from_numpy(rays), tfar=_REACH_M).numpy()
        open_share[part] = 1.0 - hit.mean(axis=1)
    return open_share


def _make(folder: Path, asked: tuple[Path, int, str], progress: Progress) -> None:
    """In a process of its own: write the cache."""
    path, triangles, key = asked
    mesh = simplified(path, triangles, progress=progress)
    mesh.compute_vertex_normals()
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.triangles)
    colours = np.asarray(mesh.vertex_colors) if mesh.has_vertex_colors() else np.full((len(vertices), 3), _PLAIN)
    seen = light(vertices, np.asarray(mesh.vertex_normals), faces, progress=progress)
    shaded = _DARKENED * colours * (_DARKEST + (1.0 - _DARKEST) * seen[:, None])
    with file_format.atomic_file(folder / CACHE) as temporary, open(temporary, "wb") as file:
        np.savez(
            file,
            key=key,
            vertices=vertices.astype(np.float32),
            faces=faces.astype(np.int32),
            colours=(255 * shaded).astype(np.uint8),
        )


def _key(path: Path, triangles: int) -> str:
    try:
        found = path.stat()
    except OSError as error:
        raise MapError(f"{path.name} cannot be read ({error.strerror}); build the map again") from error
    return f"{_VERSION} {found.st_mtime_ns} {found.st_size} {triangles}"


def _cached(path: Path, key: str) -> "trimesh.Trimesh | None":
    import trimesh

    try:
        with np.load(path, allow_pickle=False) as data:
            if str(data["key"]) != key:
                return None
            return trimesh.Trimesh(data["vertices"], data["faces"], vertex_colors=data["colours"], process=False)
    except (OSError, KeyError, ValueError, EOFError, zipfile.BadZipFile):
        return None  # made again
