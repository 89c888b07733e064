"""A texture atlas: a mesh with fewer faces, flattened piece by piece into one square image, and what each texel shows.

Texture coordinates are glTF's: u to the right, v down, both from 0 to 1 over the image, whose first row is at v = 0.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flight import FloatArray, MapError, Progress, silent

GUTTER_TEXELS = 4.0
"""Distance between two pieces of the atlas, so that a viewer's coarser copies of the texture do not mix them."""
_OUTSIDE = np.iinfo(np.uint32).max


@dataclass(frozen=True, slots=True, eq=False)
class FlattenedMesh:
    """A mesh with a place in the atlas for each corner of each face."""

    vertices_world_m: FloatArray
    """(v, 3)."""
    faces: NDArray[np.int32]
    """(f, 3) vertices."""
    corners_uv: FloatArray
    """(f, 3, 2) of each face's corners."""


@dataclass(frozen=True, slots=True, eq=False)
class Texels:
    """The n texels of an atlas that lie on a face."""

    row: NDArray[np.int64]
    """(n,)."""
    column: NDArray[np.int64]
    """(n,)."""
    face: NDArray[np.int64]
    """(n,)."""
    share: NDArray[np.float32]
    """(n, 3) barycentric coordinates of the texel's centre in its face; they sum to one."""


def flatten(
    vertices_world_m: FloatArray, faces: NDArray[np.int32], *, most_faces: int, size: int, progress: Progress = silent
) -> FlattenedMesh:
    """Simplify a mesh (quadric error metric) and flatten it into an atlas (UVAtlas), both by Open3D.

    Args:
        most_faces: the mesh is left as it is if it has no more.
        size: edge of the atlas in texels, for the distance between its pieces.

    Raises:
        MapError: the mesh has no face of any area, or cannot be flattened.
    """
    import open3d

    progress("simplify the mesh", 0.0)
    mesh = open3d.geometry.TriangleMesh(
        open3d.utility.Vector3dVector(vertices_world_m), open3d.utility.Vector3iVector(faces)
    )
    if len(faces) > most_faces:
        mesh = mesh.simplify_quadric_decimation(most_faces)
    # what simplification leaves folded or joined at more than two faces cannot be flattened
    mesh = mesh.remove_degenerate_triangles().remove_duplicated_triangles().remove_non_manifold_edges()
    mesh = mesh.remove_unreferenced_vertices()
    if not len(mesh.triangles):
        raise MapError("the mesh has no face of any area; make the map again")
    progress("flatten the mesh", 0.0)
    flat = open3d.t.geometry.TriangleMesh.from_legacy(mesh)
    try:
        flat.compute_uvatlas(size=size, gutter=GUTTER_TEXELS)
    except RuntimeError as error:
        raise MapError(f"the mesh cannot be flattened into a texture: {error}; try another --faces") from error
    progress("flatten the mesh", 1.0)
    uv = flat.triangle["texture_uvs"].numpy().astype(np.float64)
    return FlattenedMesh(np.asarray(mesh.vertices).copy(), np.asarray(mesh.triangles).astype(np.int32), uv)


def texels(mesh: FlattenedMesh, size: int) -> Texels:
    """Face and barycentric coordinates of every texel of a `size` x `size` atlas that lies on a face.

    Rays straight down onto the flattened faces: the first face hit is the texel's.
    """
    import open3d

    tensor: Any = open3d.core.Tensor  # its stub knows no NumPy arrays
    flat = np.zeros((mesh.corners_uv.size // 2, 3), np.float32)
    flat[:, :2] = size * mesh.corners_uv.reshape(-1, 2)
    scene = open3d.t.geometry.RaycastingScene()
    corners = np.arange(len(flat), dtype=np.uint32).reshape(-1, 3)
    scene.add_triangles(tensor(flat), tensor(corners))
    column, row = np.meshgrid(np.arange(size) + 0.5, np.arange(size) + 0.5)
    rays = np.zeros((size, size, 6), np.float32)
    rays[..., 0], rays[..., 1], rays[..., 2], rays[..., 5] = column, row, 1.0, -1.0
    hit = scene.cast_rays(tensor(rays))
    face = hit["primitive_ids"].numpy()
    row, column = np.nonzero(face != _OUTSIDE)
    second, third = np.moveaxis(hit["primitive_uvs"].numpy()[row, column], -1, 0)
    return Texels(
        row, column, face[row, column].astype(np.int64), np.stack([1 - second - third, second, third], axis=1)
    )


def seams_split(mesh: FlattenedMesh) -> tuple[FloatArray, NDArray[np.int32], FloatArray]:
    """Vertices (w, 3), faces (f, 3) and texture coordinates (w, 2): a vertex on a seam comes once for each piece."""
    corners = np.column_stack([mesh.faces.reshape(-1), mesh.corners_uv.reshape(-1, 2)])
    unique, faces = np.unique(corners, axis=0, return_inverse=True)
    return (
        mesh.vertices_world_m[unique[:, 0].astype(int)],
        faces.reshape(-1, 3).astype(np.int32),
        np.asarray(unique[:, 1:], dtype=np.float64),
    )


def texel_m(mesh: FlattenedMesh, size: int) -> float:
    """Edge of a texel on the surface, metres: the square root of the mean area."""
    a, b, c = np.moveaxis(mesh.vertices_world_m[mesh.faces], 1, 0)
    area_m2 = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
    (u, v), (s, t) = (np.moveaxis(mesh.corners_uv[:, k] - mesh.corners_uv[:, 0], -1, 0) for k in (1, 2))
    texels = 0.5 * np.abs(u * t - v * s).sum() * size**2
    return float(np.sqrt(area_m2 / max(texels, 1e-12)))
