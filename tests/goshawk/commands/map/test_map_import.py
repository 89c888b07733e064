"""`goshawk map import` and `export`: meshes of other programs, of a room whose distances are known."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

import esdf
import mapping
from esdf import FREE, OCCUPIED, UNKNOWN
from flight import trajectory
from tests.goshawk.running import answer, run

LOW, HIGH = np.array([0.025, 0.025, 0.025]), np.array([6.025, 4.025, 2.525])
"""Walls in the middle of voxels of 5 cm: these are occupied up to 2.5 cm before the wall."""
PILLAR, RADIUS_M = np.array([2.0, 1.5]), 0.25


def room(*, pillar: bool = False) -> trimesh.Trimesh:
    walls = trimesh.creation.box(bounds=[LOW, HIGH])
    if not pillar:
        return walls
    inside = trimesh.creation.cylinder(RADIUS_M, 2.5)
    inside.apply_translation([*PILLAR, 1.275])
    joined = trimesh.util.concatenate([walls, inside])
    assert isinstance(joined, trimesh.Trimesh)
    return joined


def imported(mesh: trimesh.Trimesh, file: Path, *more: object) -> dict:
    mesh.export(file)
    return json.loads(run("map", "import", file, "--out", file.with_suffix(""), "--json", *more))


def refusal(file: Path, *more: object) -> str:
    ended = answer("map", "import", file, "--out", file.parent / "none", *more)
    assert ended.returncode == 2
    assert not (file.parent / "none").exists()
    return ended.stderr


def test_the_distance_in_an_empty_room_is_that_to_its_nearest_wall(tmp_path: Path) -> None:
    found = imported(room(), tmp_path / "room.ply", "--observed", "1,1,1")
    area = mapping.open_map(tmp_path / "room")
    points = np.random.default_rng(1).uniform(LOW + 0.06, HIGH - 0.06, (2000, 3))
    centres = area.field.grid.centre(area.field.grid.index(points))
    nearest_m = np.minimum(centres - LOW, HIGH - centres).min(axis=1)
    assert area.field.distance(centres) == pytest.approx(np.minimum(nearest_m - 0.025, 2.0), abs=1e-6)
    assert found["free_m3"] == pytest.approx(5.95 * 3.95 * 2.45)
    assert found["hash"] == area.hash


def test_without_a_statement_nothing_is_free_and_the_answer_says_so(tmp_path: Path) -> None:
    found = imported(room(), tmp_path / "room.ply")
    assert found["free_m3"] == 0.0
    assert set(np.unique(mapping.open_map(tmp_path / "room").field.state)) == {UNKNOWN, OCCUPIED}
    assert "no plan is possible" in run("map", "import", tmp_path / "room.ply", "--out", tmp_path / "m", "--dry-run")
    assert not (tmp_path / "m").exists()


def test_the_inside_of_a_pillar_and_the_outside_of_the_room_stay_unknown(tmp_path: Path) -> None:
    imported(room(pillar=True), tmp_path / "room.ply", "--observed", "1,1,1")
    area = mapping.open_map(tmp_path / "room")
    places = np.array([[2.0, 1.5, 1.2], [-0.03, 2.0, 1.0], [1.0, 1.0, 1.0]])
    states = [int(area.field.state[tuple(index)]) for index in area.field.grid.index(places)]
    assert states == [UNKNOWN, UNKNOWN, FREE]


def test_inverted_normals_change_nothing(tmp_path: Path) -> None:
    inverted = room(pillar=True)
    inverted.invert()
    for name, mesh in (("a", room(pillar=True)), ("b", inverted)):
        imported(mesh, tmp_path / f"{name}.ply", "--observed", "1,1,1")
    assert mapping.open_map(tmp_path / "a").hash == mapping.open_map(tmp_path / "b").hash


def test_a_room_in_each_unit_type_and_axis_is_the_same_room(tmp_path: Path) -> None:
    expected = None
    for name, scale, more in (
        ("m.ply", 1.0, ()), ("mm.stl", 1000.0, ()), ("cm.stl", 100.0, ("--unit", "cm")),
        ("ft.obj", 1 / 0.3048, ("--unit", "ft", "--up", "z")), ("gltf.glb", 1.0, ()),
    ):  # fmt: skip
        mesh = room(pillar=True)
        mesh.apply_scale(scale)
        if name == "gltf.glb":
            mesh.apply_transform(np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]], float))
        found = imported(mesh, tmp_path / name, "--observed", "1,1,1", *more)
        state = mapping.open_map(tmp_path / Path(name).stem).field.state
        expected = state if expected is None else expected
        assert np.array_equal(state, expected), name
        assert found["unit"].startswith({"gltf": "m"}.get(Path(name).stem, Path(name).stem))


def test_a_hole_is_counted_and_what_leaks_through_it_is_said(tmp_path: Path) -> None:
    mesh = room()
    mesh.update_faces(np.abs(mesh.triangles_center[:, 0] - HIGH[0]) > 1e-6)
    found = imported(mesh, tmp_path / "open.ply", "--observed", "1,1,1")
    assert found["open_edges"] == 4
    assert found["open_sides"] > 0
    assert "has a hole" in run(
        "map", "import", tmp_path / "open.ply", "--out", tmp_path / "m", "--observed", "1,1,1", "--dry-run"
    )


def test_what_cannot_be_a_room_is_refused_in_a_sentence(tmp_path: Path) -> None:
    def written(name: str, scale: float = 1.0, offset: float = 0.0) -> Path:
        mesh = room()
        mesh.apply_scale(scale)
        mesh.apply_translation([offset, 0.0, 0.0])
        mesh.export(tmp_path / name)
        return tmp_path / name

    assert "6000 m long" in refusal(written("mm.stl", 1000.0), "--unit", "m")
    assert "give --unit" in refusal(written("cm.stl", 100.0))
    assert "km from the origin" in refusal(written("far.obj", offset=400_000.0))
    assert "single precision" in refusal(written("far.stl", offset=400_000.3), "--origin", "400000,0,0")
    assert "take --voxel" in refusal(written("fine.stl"), "--voxel", "0.002")
    assert "voxel of the surface" in refusal(written("at.stl"), "--observed", "0.025,1,1")
    assert "outside of the mesh's box" in refusal(written("out.stl"), "--observed", "9,1,1")
    assert "nor a direction" in refusal(written("up.stl"), "--up", "w")
    assert "is not one of" in refusal(tmp_path / "room.fbx")
    assert "does not exist" in refusal(tmp_path / "none.ply") or "none.ply" in refusal(tmp_path / "none.ply")
    (tmp_path / "points.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 3 0\n")
    assert "no triangles" in refusal(tmp_path / "points.obj")
    (tmp_path / "nan.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 nan 0\nv 2 1 1\nf 1 2 3\nf 1 2 4\n")
    assert "not finite" in refusal(tmp_path / "nan.obj")
    (tmp_path / "cut.ply").write_bytes(written("whole.ply").read_bytes()[:400])
    assert "cut.ply" in refusal(tmp_path / "cut.ply")


def test_a_plan_through_an_imported_room_keeps_clear_of_the_true_pillar(tmp_path: Path) -> None:
    imported(room(pillar=True), tmp_path / "room.ply", "--observed", "1,1,1")
    size = ("--mass", "0.7", "--arm", "0.12", "--prop-diameter", "0.127")
    run("vehicle", "new", tmp_path / "vehicle.toml", *size)
    (tmp_path / "way.csv").write_text("x,y,z\n1,1.5,1.2\n3.5,1.5,1.2\n")
    asked = ("--map", tmp_path / "room", "--vehicle", tmp_path / "vehicle.toml", "--radius", "0.2", "--margin", "0.1")
    ended = answer("plan", tmp_path / "way.csv", *asked, "--out", tmp_path / "flight.json")
    assert ended.returncode == 0, ended.stderr
    assert "were not measured" in ended.stderr
    flown = trajectory.load(tmp_path / "flight.json").trajectory
    path = flown.position(flown.sample(0.001))
    assert (np.linalg.norm(path[:, :2] - PILLAR, axis=1) - RADIUS_M).min() >= 0.3
    assert np.minimum(path - LOW, HIGH - path).min() >= 0.3


def test_an_exported_mesh_comes_back_as_the_same_map(tmp_path: Path) -> None:
    imported(room(pillar=True), tmp_path / "room.ply", "--observed", "1,1,1")
    run("map", "export", tmp_path / "room", "--out", tmp_path / "again.ply")
    run("map", "import", tmp_path / "again.ply", "--out", tmp_path / "again", "--observed", "1,1,1")
    assert mapping.open_map(tmp_path / "again").hash == mapping.open_map(tmp_path / "room").hash
    seen = trimesh.load(tmp_path / "again.ply")
    assert seen.bounds == pytest.approx(np.array([LOW, HIGH]), abs=1e-6)


def test_a_slice_for_ros_is_at_its_place_and_has_the_edits(tmp_path: Path) -> None:
    import yaml

    imported(room(pillar=True), tmp_path / "room.ply", "--observed", "1,1,1")
    run("map", "edit", "add", tmp_path / "room", "--box", "4,2,0.5,4.5,2.5,2")
    run("map", "export", tmp_path / "room", "--out", tmp_path / "s.pgm", "--height", "1.2")
    said = yaml.safe_load((tmp_path / "s.yaml").read_text())
    image = np.array(Image.open(tmp_path / said["image"]))

    def at(x: float, y: float) -> int:
        column, row = (int((v - o) / said["resolution"]) for v, o in zip((x, y), said["origin"][:2], strict=True))
        return int(image[image.shape[0] - 1 - row, column])

    assert (at(1, 1), at(2, 1.5), at(4.25, 2.25), at(2.25, 1.5)) == (254, 205, 0, 0)
    assert (
        "reaches from"
        in answer("map", "export", tmp_path / "room", "--out", tmp_path / "t.pgm", "--height", "9").stderr
    )


def test_what_needs_images_says_that_there_are_none(tmp_path: Path) -> None:
    imported(room(), tmp_path / "room.ply", "--observed", "1,1,1")
    (tmp_path / "images").mkdir()
    for words in (
        ("camera", "add", tmp_path / "room", "--out", tmp_path / "c.toml"),
        ("camera", "export", tmp_path / "room", "--out", tmp_path / "colmap"),
        ("localize", tmp_path / "images", "--map", tmp_path / "room", "--out", tmp_path / "w.csv"),
        ("map", "crop", tmp_path / "room", "--box", "0,0,0,1,1,1", "--out", tmp_path / "part"),
        ("map", "texture", tmp_path / "room"),
        ("map", "again", tmp_path / "room"),
    ):
        ended = answer(*words)
        assert ended.returncode == 2, words
        assert "images" in ended.stderr, words
    run("map", "report", tmp_path / "room", "--out", tmp_path / "room.html")
    run("map", "measure", tmp_path / "room", "--first", "1,1,1", "--second", "2,1,1")
    shutil.rmtree(tmp_path / "images")
    assert esdf.load(tmp_path / "room" / "esdf").hash == mapping.open_map(tmp_path / "room").hash
