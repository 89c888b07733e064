"""Meshes far from their origin: moved by `--origin` where their numbers are fine enough, else refused."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from flight import InputError
from mapping import foreign_mesh

GRID = np.array([512_000.25, 5_403_000.5, 410.125])
"""Coordinates of a national grid, metres."""
CORNER = np.array([4.0, 3.0, 2.5])


def written(file: Path, offset: np.ndarray = GRID) -> Path:
    mesh = trimesh.creation.box(bounds=[offset, offset + CORNER + 0.001])
    mesh.export(file)
    return file


def double_ply(file: Path) -> Path:
    mesh = trimesh.creation.box(bounds=[GRID, GRID + CORNER + 0.001])
    head = "ply\nformat binary_little_endian 1.0\nelement vertex 8\n"
    head += "".join(f"property double {axis}\n" for axis in "xyz")
    head += "element face 12\nproperty list uchar int vertex_indices\nend_header\n"
    rows = np.zeros(12, [("n", "u1"), ("of", "<i4", 3)])
    rows["n"], rows["of"] = 3, mesh.faces
    file.write_bytes(head.encode() + np.asarray(mesh.vertices, "<f8").tobytes() + rows.tobytes())
    return file


def test_origin_moves_a_mesh_of_a_national_grid_in_its_numbers_before_its_axes_turn(tmp_path: Path) -> None:
    for file in (written(tmp_path / "a.obj"), double_ply(tmp_path / "a.ply")):
        with pytest.raises(InputError, match=r"give --origin 5120[0-9]0,5403000,410,"):
            foreign_mesh.read(file, up="z")
        found = foreign_mesh.read(file, up="z", origin=GRID).vertices_world_m
        assert np.ptp(found, axis=0) == pytest.approx(CORNER + 0.001, abs=1e-6)
        assert found.min(axis=0) == pytest.approx(np.zeros(3), abs=1e-6)
    turned = foreign_mesh.read(tmp_path / "a.obj", up="y", origin=GRID).vertices_world_m
    assert np.ptp(turned, axis=0) == pytest.approx([4.001, 2.501, 3.001], abs=1e-6)


@pytest.mark.parametrize("name", ["a.ply", "a.stl", "a.glb"])
def test_a_mesh_whose_numbers_were_rounded_is_refused_with_and_without_an_origin(tmp_path: Path, name: str) -> None:
    file = written(tmp_path / name)
    for origin in (None, GRID):
        with pytest.raises(InputError, match="single precision") as caught:
            foreign_mesh.read(file, unit="m", origin=origin)
        assert "--origin" not in str(caught.value)
        assert "where it was exported" in str(caught.value)
    near = written(tmp_path / f"near_{name}", np.array([2000.0, 1000.0, 0.0]))
    assert len(foreign_mesh.read(near, unit="m").faces) == 12


def test_a_single_precision_mesh_that_its_file_moves_far_away_in_double_precision_is_fine(tmp_path: Path) -> None:
    scene = trimesh.Scene()
    box = trimesh.creation.box(bounds=[np.zeros(3), CORNER + 0.001])
    scene.add_geometry(box, transform=trimesh.transformations.translation_matrix(GRID))
    scene.export(tmp_path / "moved.glb")
    found = foreign_mesh.read(tmp_path / "moved.glb", up="z", origin=GRID)
    assert np.ptp(found.vertices_world_m, axis=0) == pytest.approx(CORNER + 0.001, abs=1e-6)


def test_two_maps_in_one_file_are_counted_and_the_rooms_of_one_are_not(tmp_path: Path) -> None:
    def rooms(*corners: float) -> int:
        boxes = [trimesh.creation.box(bounds=[[x, 0.0, 0.0], [x + 4.0, 3.0, 2.5]]) for x in corners]
        crumb = trimesh.creation.box(bounds=[[90.0, 0.0, 0.0], [90.1, 0.1, 0.1]])
        trimesh.util.concatenate([*boxes, crumb]).export(tmp_path / "rooms.stl")
        return foreign_mesh.parts(foreign_mesh.read(tmp_path / "rooms.stl", unit="m"))

    assert [rooms(0.0), rooms(0.0, 4.2, 8.4), rooms(0.0, 9.0), rooms(0.0, 9.0, 4.5)] == [1, 1, 2, 1]
