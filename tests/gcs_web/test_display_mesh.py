"""The mesh as it is shown: fewer triangles, darker in corners, made once."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from flight import MapError
from gcs_web import display_mesh


def test_a_mesh_is_simplified_in_steps_that_are_reported(tmp_path, monkeypatch):
    trimesh.creation.icosphere(4).export(tmp_path / "mesh.ply")
    monkeypatch.setattr(display_mesh, "TRIANGLES_PER_STEP", 1500)
    told = []
    mesh = display_mesh.simplified(tmp_path / "mesh.ply", 1000, progress=lambda stage, fraction: told.append(fraction))
    np.testing.assert_allclose(told, [0.0, 1 / 3, 2 / 3])
    assert 900 <= len(mesh.triangles) <= 1000
    np.testing.assert_allclose(np.linalg.norm(np.asarray(mesh.vertices), axis=1), 1.0, atol=0.05)


def test_a_mesh_that_cannot_be_read_is_said_and_not_drawn_as_nothing(tmp_path):
    for content in (b"", b"not a mesh", b"glTF" + bytes(40)):
        (tmp_path / "mesh.glb").write_bytes(content)
        with pytest.raises(MapError, match=r"mesh\.glb holds no triangles or cannot be read"):
            display_mesh.simplified(tmp_path / "mesh.glb", 1000)


def test_a_corner_is_darker_than_the_middle_of_a_floor():
    floor = trimesh.creation.box(bounds=[[0.0, 0.0, -0.1], [6.0, 6.0, 0.0]])
    walls = [
        trimesh.creation.box(bounds=[[-0.1, 0.0, 0.0], [0.0, 6.0, 3.0]]),
        trimesh.creation.box(bounds=[[0.0, -0.1, 0.0], [6.0, 0.0, 3.0]]),
    ]
    room = trimesh.util.concatenate([floor, *walls])
    places = np.array([[3.0, 3.0, 0.0], [0.3, 3.0, 0.0], [0.3, 0.3, 0.0], [0.05, 0.05, 0.0]])
    # the light is that of vertices: these stand on the floor, in no triangle of their own
    vertices = np.concatenate([room.vertices, places])
    normals = np.concatenate([room.vertex_normals, np.tile([0.0, 0.0, 1.0], (4, 1))])
    middle, wall, corner, deep = display_mesh.light(vertices, normals, room.faces)[-4:]
    assert middle == 1.0
    assert middle > wall > corner > deep


def test_the_mesh_is_made_once_and_again_when_the_map_or_the_cache_changed(tmp_path: Path):
    source, cache = tmp_path / "mesh.ply", tmp_path / "session"
    stages: list[str] = []

    def load(triangles: int = 200) -> trimesh.Trimesh:
        stages.clear()
        return display_mesh.load(source, triangles, cache, progress=lambda stage, _: stages.append(stage))

    trimesh.creation.icosphere(3).export(source)
    first = load()
    assert "simplifying the mesh" in stages
    assert len(first.faces) <= 200
    np.testing.assert_array_equal(load().vertices, first.vertices)
    assert stages == []
    (cache / display_mesh.CACHE).write_bytes(b"PK damaged")
    np.testing.assert_array_equal(load().vertices, first.vertices)
    trimesh.creation.box().export(source)
    assert len(load().faces) == 12
    source.unlink()
    with pytest.raises(MapError, match="build the map again"):
        load()
