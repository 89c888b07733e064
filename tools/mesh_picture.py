"""A view of a map's mesh with vertex colours and, beside it, with its texture: for tools/pictures.py.

Both are drawn by rays from where one image of the map was taken, without a window or graphics card.
"""

import shutil
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

import mapping
from flight import FloatArray, project
from mapping import texturing
from mapping.camera import rig
from mapping.dense import mesh_file

WIDTH, HEIGHT, GAP = 498, 320, 4
"""Of each view and between them, pixels."""
FOCAL_PX = 420.0
FINER = 2
"""Rays along a pixel's edge."""
IMAGE = 33
"""Number of the map's image whose place and heading the view has."""
HOLE = 255
"""Grey level where there is no surface."""


@dataclass(frozen=True, slots=True, eq=False)
class Hits:
    """What the n rays of a view meet."""

    face: NDArray[np.int64]
    """(n,), -1 where there is nothing."""
    share: FloatArray
    """(n, 3) barycentric coordinates."""


def before_and_after(demo: Path) -> Image.Image:
    """Vertex colours on the left, the texture on the right; the demo's map is copied, nothing is written in it."""
    known = mapping.open_map(project.open_project(demo).map)
    with tempfile.TemporaryDirectory() as folder:
        copy = mapping.open_map(Path(shutil.copytree(known.folder, Path(folder) / "map")))
        texturing.add_texture(copy, demo / "rendered")
        T_world_view = known.T_world_body[IMAGE].copy()
        T_world_view[:3, :3] = T_world_view[:3, :3] @ rig.R_BODY_CAMERA_FORWARD
        both = Image.new("RGB", (2 * WIDTH + GAP, HEIGHT), "white")
        both.paste(_image(_vertex_colours(copy.folder / "mesh.ply", T_world_view)), (0, 0))
        both.paste(_image(_texture_colours(copy.folder / texturing.FILE, T_world_view)), (WIDTH + GAP, 0))
    return both


def _vertex_colours(path: Path, T_world_view: FloatArray) -> FloatArray:
    vertices, faces, colours = mesh_file.load(path)
    hits = _cast(vertices, faces, T_world_view)
    return _with_holes(np.einsum("nk,nkc->nc", hits.share, colours[faces[hits.face]].astype(float)), hits)


def _texture_colours(path: Path, T_world_view: FloatArray) -> FloatArray:
    import trimesh

    mesh: Any = trimesh.load(path, force="mesh", process=False)
    faces = np.asarray(mesh.faces)
    hits = _cast(np.asarray(mesh.vertices) @ mesh_file.R_GLTF_WORLD, faces, T_world_view)
    pixels = np.asarray(mesh.visual.material.baseColorTexture.convert("RGB"))
    u, v = np.einsum("nk,nkc->nc", hits.share, np.asarray(mesh.visual.uv)[faces[hits.face]]).T
    row = np.clip((1.0 - v) * len(pixels), 0, len(pixels) - 1).astype(int)  # trimesh counts v from the last row
    column = np.clip(u * len(pixels), 0, len(pixels) - 1).astype(int)
    return _with_holes(pixels[row, column].astype(float), hits)


def _with_holes(colours: FloatArray, hits: Hits) -> FloatArray:
    return np.where((hits.face >= 0)[:, None], colours, float(HOLE))


def _cast(vertices_world_m: FloatArray, faces: NDArray[Any], T_world_view: FloatArray) -> Hits:
    import open3d

    tensor: Any = open3d.core.Tensor  # its stub knows no NumPy arrays
    scene = open3d.t.geometry.RaycastingScene()
    scene.add_triangles(tensor(vertices_world_m.astype(np.float32)), tensor(faces.astype(np.uint32)))
    x, y = np.meshgrid(np.arange(FINER * WIDTH), np.arange(FINER * HEIGHT))
    across, down = ((np.stack([x.ravel(), y.ravel()]) + 0.5) / FINER - [[0.5 * WIDTH], [0.5 * HEIGHT]]) / FOCAL_PX
    directions = np.stack([across, down, np.ones_like(across)], axis=1) @ T_world_view[:3, :3].T
    rays = np.hstack([np.broadcast_to(T_world_view[:3, 3], directions.shape), directions])
    hit = scene.cast_rays(tensor(rays.astype(np.float32)))
    second, third = hit["primitive_uvs"].numpy().astype(float).T
    met = np.isfinite(hit["t_hit"].numpy())
    face = np.where(met, hit["primitive_ids"].numpy().astype(np.int64), -1)
    return Hits(face, np.stack([1.0 - second - third, second, third], axis=1))


def _image(colours: FloatArray) -> Image.Image:
    """Of the rays' colours (n, 3), the mean of those of each pixel."""
    fine = colours.reshape(HEIGHT, FINER, WIDTH, FINER, 3)
    return Image.fromarray(np.round(fine.mean(axis=(1, 3))).astype(np.uint8))
