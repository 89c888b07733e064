"""The mesh as it is shown: fewer triangles, darker in corners, made once."""

import io
from pathlib import Path

import numpy as np
import pytest
import trimesh

from flight import MapError
from gcs_web.map import display_mesh
from gcs_web.scene import picking, tiles
from mapping.dense import mesh_file


def sphere(level: int) -> display_mesh.Mesh:
    """Of radius 1 m, with the colours of its places."""
    made = trimesh.creation.icosphere(level)
    colours = (127.0 * (1.0 + made.vertices)).astype(np.uint8)
    return display_mesh.Mesh(made.vertices.astype(np.float32), made.faces.astype(np.int32), colours)


def test_a_simplified_mesh_has_the_same_shape_and_colours():
    simple = display_mesh.simplified(sphere(4), 1000)
    assert 900 <= len(simple.faces) <= 1000
    np.testing.assert_allclose(np.linalg.norm(simple.vertices_m, axis=1), 1.0, atol=0.05)
    np.testing.assert_allclose(simple.colours / 127.0 - 1.0, simple.vertices_m, atol=0.1)


def test_tiles_cover_the_mesh_and_those_simplified_apart_leave_no_crack(monkeypatch):
    monkeypatch.setattr(display_mesh, "TILE_TRIANGLES", 1500)
    whole = sphere(5)
    fine = display_mesh.cut(whole)
    assert len(fine) > 4
    centres = {tuple(np.round(c, 5)) for part in fine for c in part.vertices_m[part.faces].mean(axis=1).tolist()}
    assert len(centres) == len(whole.faces)
    for level in (fine, [display_mesh.simplified(tile, 200) for tile in fine]):
        shown = display_mesh.joined(level)
        surface = picking.Surface(shown.vertices_m, shown.faces)
        for direction in np.random.default_rng(0).normal(size=(300, 3)):
            direction /= np.linalg.norm(direction)
            assert surface.first_hit(3.0 * direction, -direction) is not None


def test_for_slow_browsers_the_whole_mesh_is_there_in_one_piece_of_few_triangles(tmp_path):
    whole = sphere(5)
    mesh_file.save(tmp_path / "mesh.ply", whole.vertices_m, whole.faces, whole.colours)
    display_mesh._make(tmp_path, (tmp_path / "mesh.ply", 15_000, "key"), lambda *_: None)
    shown = tiles.load(tmp_path / display_mesh.CACHE, "key")
    assert shown is not None
    for asked, most in ((100, 1_500), (1_500, 1_500), (7_000, 6_000), (10**6, 20_000)):
        piece = trimesh.load(io.BytesIO(display_mesh.plain(shown, asked).tobytes()), "glb", force="mesh")
        assert 0.9 * min(most, 15_000) <= len(piece.faces) <= most
        np.testing.assert_allclose(piece.bounds, [[-1.0] * 3, [1.0] * 3], atol=0.05)


@pytest.mark.parametrize("most", display_mesh.PLAIN_TRIANGLES)
def test_a_pole_and_a_wire_stay_for_slow_browsers(most: int):
    ground = rough_ground()
    pole = tube(0.03, [4.0, -3.0, 0.3], [4.0, -3.0, 3.3])
    wire = tube(0.01, [-3.0, 2.0, 3.0], [3.0, 2.0, 3.0])
    specks = [tube(0.01, [x, 0.0, 1.0], [x, 0.0, 1.03]) for x in np.linspace(-9.0, 9.0, 60)]
    shown = display_mesh.sparse(display_mesh.joined([*specks, ground, pole, wire]), most)
    assert len(shown.faces) <= most
    surface = picking.Surface(shown.vertices_m, shown.faces)
    for along in np.linspace(0.05, 0.95, 30):
        for origin, direction in (
            ([0.0, -3.0, 0.3 + 3.0 * along], [1.0, 0.0, 0.0]),
            ([-3.0 + 6.0 * along, 2.0, 6.0], [0.0, 0.0, -1.0]),
        ):
            hit = surface.first_hit(np.array(origin), np.array(direction))
            assert hit is not None
            assert hit[0][2] > 0.25


def rough_ground() -> display_mesh.Mesh:
    """20 m wide, 50,000 triangles, as a scan has it."""
    count = 160
    x, y = np.meshgrid(np.linspace(-10.0, 10.0, count), np.linspace(-10.0, 10.0, count))
    z = 0.02 * np.random.default_rng(0).normal(size=x.shape)
    corner = np.arange((count - 1) * count).reshape(-1, count)[:, :-1].ravel()
    steps = np.array([[0, 1, count], [1, count + 1, count]])
    faces = (corner[:, None, None] + steps).reshape(-1, 3)
    return grey(np.stack([x, y, z], axis=-1).reshape(-1, 3), faces)


def tube(radius_m: float, begin_m: list[float], end_m: list[float]) -> display_mesh.Mesh:
    made = trimesh.creation.cylinder(radius_m, segment=[begin_m, end_m], sections=8).subdivide().subdivide()
    return grey(np.asarray(made.vertices), np.asarray(made.faces))


def grey(vertices_m: np.ndarray, faces: np.ndarray) -> display_mesh.Mesh:
    colours = np.full((len(vertices_m), 3), 120, dtype=np.uint8)
    return display_mesh.Mesh(vertices_m.astype(np.float32), faces.astype(np.int32), colours)


def test_a_mesh_that_cannot_be_read_is_said_and_not_drawn_as_nothing(tmp_path):
    for content in (b"", b"not a mesh", b"glTF" + bytes(40)):
        (tmp_path / "mesh.glb").write_bytes(content)
        with pytest.raises(MapError, match=r"mesh\.glb (holds no triangles|cannot be read)"):
            display_mesh.read(tmp_path / "mesh.glb")


def test_a_mesh_with_vertices_nowhere_is_refused(tmp_path):
    made = sphere(1)
    made.vertices_m[3] = np.nan
    mesh_file.save(tmp_path / "mesh.ply", made.vertices_m, made.faces, made.colours)
    with pytest.raises(MapError, match="not finite"):
        display_mesh.read(tmp_path / "mesh.ply")


def test_a_mesh_file_is_read_as_it_was_written(tmp_path):
    made = sphere(2)
    for suffix in mesh_file.SUFFIXES:
        mesh_file.save(tmp_path / f"mesh{suffix}", made.vertices_m, made.faces, made.colours)
        again = display_mesh.read(tmp_path / f"mesh{suffix}")
        np.testing.assert_allclose(again.vertices_m, made.vertices_m, atol=1e-6)
        np.testing.assert_array_equal(again.faces, made.faces)
        np.testing.assert_array_equal(again.colours, made.colours)


def test_a_texture_gives_the_vertices_their_colours_and_a_missing_one_leaves_them_plain(tmp_path):
    import trimesh
    from PIL import Image

    picture = Image.new("RGB", (2, 1), (255, 0, 0))
    picture.putpixel((1, 0), (0, 0, 255))
    corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]])
    uv = np.array([[0.1, 0.5], [0.9, 0.5], [0.9, 0.5]])
    textured = trimesh.visual.TextureVisuals(uv=uv, image=picture)
    trimesh.Trimesh(corners, [[0, 1, 2]], visual=textured, process=False).export(tmp_path / "mesh.glb")
    found = display_mesh.read(tmp_path / "mesh.glb")
    of_left = found.colours[found.vertices_m[:, 0] < 0.5]
    of_right = found.colours[found.vertices_m[:, 0] > 0.5]
    assert (of_left == [255, 0, 0]).all()
    assert (of_right == [0, 0, 255]).all()
    bare = trimesh.visual.TextureVisuals(uv=uv)
    trimesh.Trimesh(corners, [[0, 1, 2]], visual=bare, process=False).export(tmp_path / "bare.glb")
    plain = display_mesh.read(tmp_path / "bare.glb").colours
    assert (plain == plain[0, 0]).all()


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


def test_normals_of_a_sphere_point_outward():
    made = sphere(3)
    np.testing.assert_allclose(display_mesh.normals(made), made.vertices_m, atol=0.02)


def test_the_mesh_is_made_once_and_again_when_the_map_or_the_cache_changed(tmp_path: Path):
    source, cache = tmp_path / "mesh.ply", tmp_path / "session"
    stages: list[str] = []

    def faces(triangles: int = 200) -> np.ndarray:
        stages.clear()
        return display_mesh.load(source, triangles, cache, progress=lambda stage, _: stages.append(stage)).array(
            "faces"
        )

    trimesh.creation.icosphere(3).export(source)
    first = faces()
    assert "simplifying the mesh" in stages
    assert len(first) <= 200
    np.testing.assert_array_equal(faces(), first)
    assert stages == []
    (cache / display_mesh.CACHE).write_bytes(b"PK damaged")
    np.testing.assert_array_equal(faces(), first)
    trimesh.creation.box().export(source)
    assert len(faces()) == 12
    source.unlink()
    with pytest.raises(MapError, match="build the map again"):
        faces()
