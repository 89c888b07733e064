"""`goshawk map export`: what a file's name and --as ask for, and that the files are of the map."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import open3d
import pycolmap
import pytest
import trimesh

import mapping
from esdf import FREE, OCCUPIED, UNKNOWN
from flight import InputError
from goshawk.commands.map import export_map
from mapping import map_parts
from mapping.sparse.tracks import Tracks
from tests.goshawk.commands.map.test_map_copy_verbs import folder
from tests.goshawk.running import answer, run

__all__ = ["folder"]  # a fixture


def test_a_folder_for_colmap_has_the_maps_images_points_and_observations(folder: Path, tmp_path: Path) -> None:
    parts = map_parts.read(folder)
    index = np.array([[k, k % len(parts.images), 1] for k in range(300)], np.int32)
    seen = dataclasses.replace(parts, tracks=Tracks(index, np.full((300, 2), 100.0)))
    map_parts.write(tmp_path / "seen", seen)
    said = json.loads(run("map", "export", tmp_path / "seen", "--out", tmp_path / "sparse", "--as", "colmap", "--json"))
    model = pycolmap.Reconstruction(tmp_path / "sparse")
    assert (said["images"], said["points"], said["observations"]) == (len(parts.images), 300, 300)
    assert model.num_reg_images() == len(parts.images)  # of the camera that sees points
    np.testing.assert_array_equal(model.points3D[1].color, [90, 90, 90])
    run("map", "export", folder, "--out", tmp_path / "sparse", "--as", "colmap", "--overwrite")
    assert pycolmap.Reconstruction(tmp_path / "sparse").num_reg_images() == 2 * len(parts.images)
    assert (tmp_path / "sparse.old-1").is_dir()


@pytest.mark.parametrize(
    ("name", "options", "said"),
    [
        ("a.las", (), "ends in none of"),
        ("sparse", (), "--as colmap"),
        ("a.ply", ("--as", "ros", "--height", "1"), "ros is a file that ends in .pgm"),
        ("a.bt", ("--as", "colmap"), "colmap is a folder"),
        ("a.bt", ("--height", "1"), "--height goes with"),
        ("a.pgm", (), "needs --height"),
        ("a.ply", ("--as", "distances", "--height", "99"), "the map reaches from"),
    ],
)
def test_what_does_not_fit_the_name_is_refused(folder: Path, tmp_path: Path, name, options, said: str) -> None:
    ended = answer("map", "export", folder, "--out", tmp_path / name, *options)
    assert ended.returncode == 2
    assert said in ended.stderr
    assert not (tmp_path / name).exists()


@pytest.mark.parametrize("name", ["a.obj", "a.stl", "a.glb"])
def test_a_mesh_comes_back_at_its_place_by_our_own_import(folder: Path, tmp_path: Path, name: str) -> None:
    run("map", "export", folder, "--out", tmp_path / name)
    asked = ("--unit", "m") if name == "a.stl" else ()
    run("map", "import", tmp_path / name, "--out", tmp_path / "again", *asked)
    again = trimesh.load_mesh(tmp_path / "again" / "mesh.glb")
    vertices = map_parts.read(folder).vertices_world_m
    np.testing.assert_allclose(np.ptp(again.vertices, axis=0)[[0, 2]], np.ptp(vertices, axis=0)[:2], atol=1e-5)
    assert mapping.open_map(tmp_path / "again").field.grid.contains(vertices).all()


def test_points_and_voxels_are_written_by_their_names(folder: Path, tmp_path: Path) -> None:
    said = json.loads(run("map", "export", folder, "--out", tmp_path / "a.ply", "--as", "points", "--json"))
    assert said["points"] == 300
    assert isinstance(trimesh.load(tmp_path / "a.ply"), trimesh.PointCloud)
    run("map", "export", folder, "--out", tmp_path / "a.bt")
    assert (tmp_path / "a.bt").read_bytes().startswith(b"# Octomap OcTree binary file\nid OcTree\n")


def test_a_voxblox_layer_and_an_openvdb_volume_are_the_maps_field(folder: Path, tmp_path: Path) -> None:
    area = mapping.open_map(folder)
    run("map", "export", folder, "--out", tmp_path / "a.vxblx")
    said = run("map", "import", tmp_path / "a.vxblx", "--out", tmp_path / "again", "--json")
    assert json.loads(said)["layer"] == "esdf"
    again = mapping.open_map(tmp_path / "again")
    places = area.field.grid.centre(np.argwhere(area.field.state != UNKNOWN))
    index = again.field.grid.index(places)
    on_surface = area.field.values_m <= area.field.grid.half_diagonal_m  # voxblox' surfaces pass through such voxels
    wanted = np.where(on_surface, OCCUPIED, FREE)[area.field.state != UNKNOWN]
    np.testing.assert_array_equal(again.field.state[tuple(index.T)], wanted)
    assert (again.field.state != UNKNOWN).sum() == len(places)
    tinyvdb = pytest.importorskip("tinyvdb", reason="TinyVDB reads what we write")
    run("map", "export", folder, "--out", tmp_path / "a.vdb")
    assert "m (Goshawk's rule)" in run("map", "import", tmp_path / "a.vdb", "--out", tmp_path / "same")
    same, known = mapping.open_map(tmp_path / "same").field, area.field.state[area.field.state != UNKNOWN]
    np.testing.assert_array_equal(same.state[tuple(same.grid.index(places).T)], known)
    assert (same.state != UNKNOWN).sum() == len(places)
    file = tinyvdb.open(str(tmp_path / "a.vdb"))
    file.read_grids()
    volume = file.grid(0)
    np.testing.assert_allclose(volume.transform["translation"], area.field.grid.centre([0, 0, 0]), atol=1e-12)
    index = np.frombuffer(volume.to_sparse()["coords"], np.int32).reshape(-1, 3)
    values = np.frombuffer(volume.to_sparse()["values"], np.float32)
    near = (np.abs(area.field.values_m) < area.field.cap_m) & (area.field.state != UNKNOWN)
    leaves = [node for node in map(volume.tree.node, range(volume.tree.num_nodes)) if node.type == "leaf"]
    assert len(leaves) >= len(np.unique(np.argwhere(near) // 8, axis=0))  # what is farther is stored by whole blocks
    assert len(index) > 10_000  # it gives the voxels of 64 leaves at most
    np.testing.assert_array_equal(values, area.field.values_m[tuple(index.T)])


def test_an_elevation_model_and_distances_are_those_of_the_map(folder: Path, tmp_path: Path) -> None:
    area = mapping.open_map(folder)
    run("map", "export", folder, "--out", tmp_path / "a.asc")
    words = (tmp_path / "a.asc").read_text().split()
    assert words[1:4:2] == [str(n) for n in area.field.grid.shape[:2]]
    said = json.loads(run("map", "export", folder, "--out", tmp_path / "d.ply", "--as", "distances", "--json"))
    points = open3d.t.io.read_point_cloud(tmp_path / "d.ply")
    assert len(points.point.positions) == said["points"] == int((area.field.state != UNKNOWN).sum())
    places = points.point.positions.numpy()
    np.testing.assert_allclose(points.point["intensity"].numpy()[:, 0], area.field.distance(places), atol=1e-6)
    height_m = float(places[:, 2].mean())
    run("map", "export", folder, "--out", tmp_path / "s.ply", "--as", "distances", "--height", height_m)
    layer = open3d.t.io.read_point_cloud(tmp_path / "s.ply").point.positions.numpy()
    assert 0 < len(layer) < len(places)
    assert np.ptp(layer[:, 2]) == 0.0
    assert abs(layer[0, 2] - height_m) <= 0.5 * area.field.grid.voxel_m[2] + 1e-9
    run("map", "import", tmp_path / "d.ply", "--out", tmp_path / "again")
    again = mapping.open_map(tmp_path / "again").field
    known = area.field.state[area.field.state != UNKNOWN]
    np.testing.assert_array_equal(again.state[tuple(again.grid.index(places).T)], known)
    ended = answer("map", "import", tmp_path / "s.ply", "--out", tmp_path / "none")
    assert ended.returncode == 2
    assert "--heights LOW,HIGH" in ended.stderr


def test_more_distances_than_memory_is_for_are_refused_and_a_slice_is_not(folder: Path, monkeypatch) -> None:
    area = mapping.open_map(folder)
    known = area.field.state != UNKNOWN
    layer = int(np.argmax(known.any(axis=(0, 1))))
    monkeypatch.setattr(export_map, "MOST_DISTANCES", int(known[:, :, layer].sum()))
    with pytest.raises(InputError, match="give --height, for one slice"):
        export_map._distances(area, None)
    height_m = float(area.field.grid.centre([0, 0, layer])[2])
    assert export_map._distances(area, height_m)[1] == known[:, :, layer].sum()
