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
from flight import InputError
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
    assert said["open_sides"] == 2 * 3 + 20  # the ends of three columns, and the south side of one
    mesh = trimesh.load(tmp_path / "hall" / "mesh.glb", force="mesh")
    assert isinstance(mesh, trimesh.Trimesh)
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    used = np.unique(np.sort(mesh.edges, axis=1), axis=0, return_counts=True)[1]
    assert said["open_edges"] == (used == 1).sum()


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


def test_images_of_other_kinds_and_the_same_greys_are_the_same_map(tmp_path: Path) -> None:
    usual = map_server.read(written(tmp_path / "m")).state
    black = np.where(GREYS == 0, 0, 254).astype(np.uint8)
    without_unknown = map_server.read(written(tmp_path / "m", black)).state
    for name, image, expected in (
        ("rgb.png", Image.fromarray(GREYS).convert("RGB"), usual),
        ("bits.png", Image.fromarray(black).convert("1", dither=Image.Dither.NONE), without_unknown),
    ):
        image.save(tmp_path / name)
        assert np.array_equal(map_server.read(written(tmp_path / "m", image=f"../{name}")).state, expected)


@pytest.mark.parametrize(
    "image", ["{home}/secret.png", "../secret.png", "../secrets.png", "..", "./hall.pgm", "link.png"]
)
def test_a_file_that_was_sent_takes_an_image_of_its_own_folder_only(tmp_path: Path, image: str) -> None:
    """And the refusal does not tell whether something is there, or what has a similar name."""
    Image.fromarray(GREYS).save(tmp_path / "secret.png")
    file = written(tmp_path / "m", image=image.format(home=tmp_path))
    (tmp_path / "m" / "link.png").symlink_to(tmp_path / "secret.png")
    with pytest.raises(InputError, match=r"must be the name of a file that was sent with this one$"):
        map_server.read(file, beside=True)
    assert map_server.read(written(tmp_path / "m"), beside=True).state.any()


def test_what_map_savers_mean_by_unknown_is_never_free(tmp_path: Path) -> None:
    said = refusal(written(tmp_path / "nav2", free_thresh=0.25), "--heights", "0,2")
    assert "205" in said
    assert "write free_thresh: 0.196" in " ".join(said.split())
    known = np.where(GREYS == 205, 254, GREYS).astype(np.uint8)
    assert (map_server.read(written(tmp_path / "known", known, free_thresh=0.25)).state != UNKNOWN).all()
    scaled = map_server.read(written(tmp_path / "scale", free_thresh=0.25, mode="scale")).state
    assert (scaled == FREE).sum() == 4


def test_an_image_in_which_unknown_could_read_as_free_is_refused(tmp_path: Path) -> None:
    coloured = np.stack([GREYS, GREYS, np.where(GREYS == 205, 255, GREYS)], axis=2).astype(np.uint8)
    Image.fromarray(coloured).save(tmp_path / "colour.png")
    assert "has colours" in refusal(written(tmp_path / "m", image="../colour.png"), "--heights", "0,2")
    Image.fromarray(GREYS).save(tmp_path / "key.png", transparency=205)
    assert "transparent" in refusal(written(tmp_path / "m", image="../key.png"), "--heights", "0,2")


def test_a_map_too_large_for_memory_is_refused_before_it_is_decoded(tmp_path: Path) -> None:
    file = written(tmp_path / "m")
    for header in (b"P5 13000 13000 255\n", b"P5 7072 7072 255\n"):
        (tmp_path / "m" / "hall.pgm").write_bytes(header)  # without its pixels, which decoding would miss
        said = refusal(file, "--heights", "0,2")
        assert "million cells" in said
        assert "Warning" not in said
    wide = np.full((1000, 2000), 254, np.uint8)
    wide[0, 0] = 0
    assert "million: give less between the heights" in refusal(written(tmp_path / "w", wide), "--heights", "0,40")
    noise = np.zeros((1100, 1100), bool)
    noise[::2, 1::2] = noise[1::2, ::2] = True
    with pytest.raises(InputError, match=r"2\.4 million sides"):
        map_server.walls(map_server.Floor(np.where(noise, OCCUPIED, FREE).astype(np.uint8), 0.05, (0.0, 0.0)), 0, 1)


def test_a_message_is_short_whatever_the_file_holds(tmp_path: Path) -> None:
    bomb = "".join(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]\n" for i in range(1, 10))
    bomb = f"a0: &a0 [x]\n{bomb}image: hall.pgm\nresolution: 0.1\norigin: [0, 0, 0]\n"
    for line in ("mode: *a9", "negate: *a9", "occupied_thresh: *a9"):
        said = refusal(_text(tmp_path, f"{bomb}{line}\n"), "--heights", "0,2")
        assert line.split(":")[0] in said
        assert len(said) < 300
    for key in ("resolution", "origin"):
        for value in (10**30, int("f" * 5000, 16)):
            text = "0x" + f"{value:x}"
            file = written(tmp_path / "m")
            place = text if key == "resolution" else f"[{text}, 0, 0]"
            file.write_text(file.read_text().replace(f"{key}:", f"{key}: {place}\n#"))
            assert 20 < len(refusal(file, "--heights", "0,2")) < 400
    for image in (["hall.pgm"], None, ""):
        assert "must be the name of a file" in refusal(written(tmp_path / "m", image=image), "--heights", "0,2")


def test_what_is_no_map_of_ros_is_refused_in_a_sentence(tmp_path: Path) -> None:
    def refused(*more: object, **changed: object) -> str:
        return refusal(written(tmp_path / "m", **changed), *(more or ("--heights", "0,2")))

    for turn in (0.3, 0.01, -0.01):
        assert f"turned by {turn:g} rad" in refused(origin=[0.0, 0.0, turn])
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
    assert "give --heights" in refused("--dry-run")
    assert "0.1 m higher" in refused("--heights", "2,2.01")
    for heights in ("1e9,1000000002", "0,1e300"):
        said = refused("--heights", heights)
        assert "km from the origin" in said
        assert len(said) < 300
    for more in (("--up", "z"), ("--voxel", "0.5"), ("--unit", "m"), ("--observed", "0,0,1")):
        assert "for meshes" in refused("--heights", "0,2", *more)
    for more in ((), ("--heights", "0,2")):
        assert "give the YAML" in refusal(tmp_path / "m" / "hall.pgm", *more)
    (tmp_path / "m" / "hall.pgm").write_bytes(b"P5 4 3 255\n\0")
    assert "cannot be read" in refusal(tmp_path / "m" / "hall.yaml", "--heights", "0,2")
    nothing = written(tmp_path / "free", np.full((3, 4), 254, np.uint8))
    assert "nothing occupied" in refusal(nothing, "--heights", "0,2")
    full = written(tmp_path / "full", np.zeros((3, 4), np.uint8))
    advice = run("map", "import", full, "--out", tmp_path / "full_map", "--heights", "0,2", "--dry-run")
    assert "nothing is free" in advice
    assert "--observed" not in advice
    imported(room(), tmp_path / "room.ply", "--observed", "1,1,1")
    ended = answer("map", "import", tmp_path / "room.ply", "--out", tmp_path / "n", "--heights", "0,2")
    assert "two-dimensional" in ended.stderr


def _text(folder: Path, text: str) -> Path:
    (folder / "text.yaml").write_text(text)
    return folder / "text.yaml"
