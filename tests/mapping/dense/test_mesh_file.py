"""Meshes survive being written and read."""

from pathlib import Path

import numpy as np
import pytest

from flight import InputError
from mapping.dense import mesh_file

VERTICES = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 3.0]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]], np.int32)
COLOURS = np.array([[0, 0, 0], [255, 0, 0], [0, 128, 0], [10, 20, 30]], np.uint8)


@pytest.mark.parametrize("suffix", mesh_file.SUFFIXES)
def test_vertices_faces_and_colours_come_back(tmp_path: Path, suffix: str) -> None:
    import trimesh

    path = tmp_path / f"mesh{suffix}"
    mesh_file.save(path, VERTICES, FACES, COLOURS)
    mesh = trimesh.load(path, force="mesh", process=False)
    x, y, z = VERTICES.T
    seen = np.column_stack([x, z, -y]) if suffix == ".glb" else VERTICES  # glTF's y is up
    np.testing.assert_allclose(mesh.vertices, seen, atol=1e-6)
    np.testing.assert_array_equal(mesh.faces, FACES)
    np.testing.assert_array_equal(mesh.visual.vertex_colors[:, :3], COLOURS)


def test_an_unknown_format_is_refused_and_nothing_is_written(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"\.glb, \.ply"):
        mesh_file.save(tmp_path / "mesh.stl", VERTICES, FACES, COLOURS)
    assert not list(tmp_path.iterdir())
