"""`goshawk map import` of maps of ROS' map_server, written here by Pillow and PyYAML, and by our own export."""

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

import mapping
from esdf import FREE, OCCUPIED, UNKNOWN
from mapping import map_server
from tests.goshawk.commands.map.test_map_import import imported, refusal, room
from tests.goshawk.running import answer, run

GREYS = np.array([[0, 0, 0, 0], [0, 254, 254, 0], [0, 254, 205, 0]], np.uint8)
"""Rows from north to south: a bay of three free cells, open to the south, with an unknown one."""
SAID = {"image": "hall.pgm", "resolution": 0.1, "origin": [-1.0, 2.0, 0.0], "negate": 0}
THRESHOLDS = {"occupied_thresh": 0.65, "free_thresh": 0.196}


def written(folder: Path, greys: np.ndarray = GREYS, **changed: object) -> Path:
    folder.mkdir(exist_ok=True)
    Image.fromarray(greys).save(folder / "hall.pgm")
    (folder / "hall.yaml").write_text(yaml.safe_dump(SAID | THRESHOLDS | changed))
    return folder / "hall.yaml"


def test_cells_become_columns_at_their_place_and_what_is_beyond_stays_unknown(tmp_path: Path) -> None:
    file = written(tmp_path)
    said = json.loads(run("map", "import", file, "--out", tmp_path / "hall", "--heights", "0.5,2.59", "--json"))
    area = mapping.open_map(tmp_path / "hall")
    places = {(-0.85, 2.15): FREE, (-0.75, 2.05): UNKNOWN, (-0.85, 2.05): FREE, (-0.95, 2.25): OCCUPIED}
    for (x, y), state in places.items():
        for z in (0.55, 2.45):
            assert area.field.state[tuple(area.field.grid.index(np.array([[x, y, z]]))[0])] == state
    assert area.field.grid.high_world_m.tolist() == pytest.approx([-0.6, 2.3, 2.5])
    assert said["free_m3"] == pytest.approx(3 * 0.01 * 2.0)
    assert said["unit"].startswith("m")


@settings(max_examples=30)
@given(st.integers(0, 10_000), st.integers(1, 8), st.integers(1, 8))
def test_walls_stand_between_what_is_occupied_and_what_is_not_and_face_outward(seed, nx, ny):
    state = np.random.default_rng(seed).integers(0, 3, (nx, ny)).astype(np.uint8)
    vertices, faces = map_server.walls(map_server.Floor(state, 0.1, (3.0, -7.0)), 0.2, 1.2)
    padded = np.pad(state == OCCUPIED, 1).astype(int)
    sides = sum(int(np.abs(np.diff(padded, axis=axis)).sum()) for axis in (0, 1))
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    assert len(faces) == 2 * sides
    assert mesh.area == pytest.approx(0.1 * sides)
    for step, occupied in ((0.03, False), (-0.03, True)):
        cells = np.floor((mesh.triangles_center + step * mesh.face_normals)[:, :2] / 0.1 - [30.0, -70.0] + 1e-6)
        assert (padded[tuple(cells.astype(int).T + 1)] == occupied).all()


def test_an_exported_slice_comes_back_as_it_was(tmp_path: Path) -> None:
    imported(room(pillar=True), tmp_path / "room.ply", "--observed", "1,1,1")
    run("map", "export", tmp_path / "room", "--out", tmp_path / "slice.pgm", "--height", "1.2")
    run("map", "import", tmp_path / "slice.yaml", "--out", tmp_path / "again", "--heights", "0,2")
    before, after = (mapping.open_map(tmp_path / name).field for name in ("room", "again"))
    layer = int(before.grid.index(np.array([[0.0, 0.0, 1.2]]))[0, 2])
    assert after.state.shape[2] == 40
    assert (after.state == before.state[:, :, layer, None]).all()
    assert after.grid.origin_world_m[:2] == before.grid.origin_world_m[:2]


def test_a_negated_image_is_the_same_map(tmp_path: Path) -> None:
    usual, negated = written(tmp_path / "a"), written(tmp_path / "b", 255 - GREYS, negate=1)
    assert np.array_equal(map_server.read(usual).state, map_server.read(negated).state)


def test_what_is_no_map_of_ros_is_refused_in_a_sentence(tmp_path: Path) -> None:
    def refused(*more: object, **changed: object) -> str:
        return refusal(written(tmp_path / "m", **changed), *(more or ("--heights", "0,2")))

    assert "turned by 0.3 rad" in refused(origin=[0.0, 0.0, 0.3])
    assert "must be [x, y, yaw]" in refused(origin=[0.0, 0.0])
    assert "resolution is 50 m" in refused(resolution=50)
    assert "resolution is 'five'" in refused(resolution="five")
    assert "resolution is nan" in refused(resolution=float("nan"))
    assert "occupied_thresh is None" in refused(occupied_thresh=None)
    assert "must rise" in refused(free_thresh=0.9)
    assert "mode is 'raw'" in refused(mode="raw")
    assert "negate is 'yes'" in refused(negate="yes")
    wide = Image.fromarray(GREYS.astype(np.uint16) * 257)
    for image in (wide, Image.fromarray(GREYS).convert("RGBA")):
        image.save(tmp_path / "other.png")
        assert f"pixels of kind {image.mode}" in refused(image="../other.png")
    assert "none.pgm" in refused(image="none.pgm")
    assert "km from the origin" in refused(origin=[5e5, 0.0, 0.0])
    assert "names no image" in refusal(_text(tmp_path, "a: 1\n"), "--heights", "0,2")
    assert "not valid YAML" in refusal(_text(tmp_path, "a: [1\n"), "--heights", "0,2")
    assert "give --heights" in refused("--voxel", "0.05")
    assert "0.1 m higher" in refused("--heights", "2,2.01")
    assert "million" in refused("--heights", "0,1e8")
    assert "for meshes" in refused("--heights", "0,2", "--up", "z")
    (tmp_path / "m" / "hall.pgm").write_bytes(b"P5 4 3 255\n\0")
    assert "cannot be read" in refusal(tmp_path / "m" / "hall.yaml", "--heights", "0,2")
    nothing = written(tmp_path / "free", np.full((3, 4), 254, np.uint8))
    assert "nothing occupied" in refusal(nothing, "--heights", "0,2")
    imported(room(), tmp_path / "room.ply", "--observed", "1,1,1")
    ended = answer("map", "import", tmp_path / "room.ply", "--out", tmp_path / "n", "--heights", "0,2")
    assert "two-dimensional" in ended.stderr


def _text(folder: Path, text: str) -> Path:
    (folder / "text.yaml").write_text(text)
    return folder / "text.yaml"
