"""Maps of ours in other programs: what these read is at the place, in the state and of the size that the map says."""

import io
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import open3d
import pycolmap
import pyoctomap
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

import esdf
from esdf import FREE, OCCUPIED, UNKNOWN, Grid
from flight import InputError, frames, rotations
from goshawk.rendered import world as rendered_world
from mapping.camera import rig as rigs
from mapping.camera.rig import Rig
from mapping.export import colmap_files, octomap, surfaces
from mapping.sparse.tracks import Tracks

VERTICES = np.array([[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 1.0]])
CUBE_M = (0.05, 0.05, 0.05)
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], np.int32)
COLOURS = np.array([[255, 0, 0], [0, 255, 0], [0, 0, 255], [9, 9, 9]], np.uint8)


@pytest.mark.parametrize("kind", [".ply", ".stl", ".obj", ".glb"])
def test_a_mesh_opens_in_trimesh_with_its_axis_up_and_its_faces_outward(kind: str) -> None:
    read = trimesh.load_mesh(io.BytesIO(surfaces.mesh(kind, VERTICES, FACES, COLOURS)), file_type=kind[1:])
    extent = {"z": [3.0, 2.0, 1.0], "y": [3.0, 1.0, 2.0]}[surfaces.UP[kind]]
    np.testing.assert_allclose(read.extents, extent, atol=1e-6)
    assert len(read.faces) == 4
    assert read.volume == pytest.approx(1.0)
    if kind != ".stl":
        shown: Any = read.visual
        assert [255, 0, 0] in shown.vertex_colors[:, :3].tolist()


def test_points_open_in_open3d_with_colours_and_deviations(tmp_path: Path) -> None:
    deviation_m = np.array([0.01, 0.02, np.nan, 0.04], np.float32)
    (tmp_path / "room.ply").write_bytes(surfaces.points(VERTICES, COLOURS, deviation_m))
    read = open3d.t.io.read_point_cloud(tmp_path / "room.ply")
    np.testing.assert_array_equal(read.point.positions.numpy(), VERTICES)
    np.testing.assert_array_equal(read.point.colors.numpy(), COLOURS)
    np.testing.assert_array_equal(read.point["std"].numpy()[:, 0], deviation_m)


def test_a_point_takes_the_colour_of_the_mesh_near_it_and_no_other() -> None:
    near = np.array([[0.0, 0.0, 0.05], [2.95, 0.0, 0.0], [9.0, 9.0, 9.0]])
    found = surfaces.colours_at(near, VERTICES, COLOURS, 0.1, 180)
    assert found.tolist() == [[255, 0, 0], [0, 255, 0], [180, 180, 180]]


STATES = st.integers(0, 2**32 - 1)


@settings(max_examples=25, deadline=None)
@given(STATES, st.tuples(*[st.integers(1, 9)] * 3), st.tuples(*[st.integers(-9, 9)] * 3), st.sampled_from([0, 4]))
def test_an_octomap_has_every_voxel_in_its_state(seed, shape, first, block) -> None:
    rng = np.random.default_rng(seed)
    state = rng.integers(0, 3, shape).astype(np.uint8)
    if block:  # of one state, so that leaves of higher levels occur
        state[:block, :block, :block] = OCCUPIED
        state[block:] = FREE
    if not (state != UNKNOWN).any():
        state[0, 0, 0] = FREE
    edge_m = 0.05
    grid = Grid(tuple(edge_m * np.array(first, float)), (edge_m, edge_m, edge_m), state.shape)
    tree = read(octomap.encode(esdf.build(state, grid)))
    assert tree.getResolution() == edge_m
    for cell in np.ndindex(*shape):
        node = tree.search(grid.centre(np.array([cell]))[0])
        found = UNKNOWN if node is None else OCCUPIED if tree.isNodeOccupied(node) else FREE
        assert found == state[cell]
    beyond = grid.low_world_m - 0.5 * edge_m
    assert tree.search(beyond) is None


def read(data: bytes) -> Any:
    tree: Any = getattr(pyoctomap, "OcTree")(0.1)  # noqa: B009 - compiled, without a stub
    with tempfile.NamedTemporaryFile(suffix=".bt") as file:
        file.write(data)
        file.flush()
        assert tree.readBinary(file.name)
    stated = int(data.split(b"size ")[1].split(b"\n")[0])
    assert tree.size() == stated
    return tree


def test_an_octomap_is_not_made_of_voxels_that_lie_between_its_own() -> None:
    state = np.full((2, 2, 2), FREE, np.uint8)
    with pytest.raises(InputError, match=r"multiples of 0\.05 m"):
        octomap.encode(esdf.build(state, Grid((0.02, 0.0, 0.0), CUBE_M, (2, 2, 2))))
    with pytest.raises(InputError, match="cubes"):
        octomap.encode(esdf.build(state, Grid((0.0, 0.0, 0.0), (0.05, 0.05, 0.1), (2, 2, 2))))
    with pytest.raises(InputError, match="farther than 1638"):
        octomap.encode(esdf.build(state, Grid((2000.0, 0.0, 0.0), CUBE_M, (2, 2, 2))))
    with pytest.raises(InputError, match="unknown"):
        octomap.encode(esdf.build(np.full((2, 2, 2), UNKNOWN, np.uint8), Grid((0.0, 0.0, 0.0), CUBE_M, (2, 2, 2))))


def test_colmap_reads_every_image_point_and_observation_where_it_is(tmp_path: Path) -> None:
    rig = rendered_world.default_rig(0.5)
    rng = np.random.default_rng(0)
    T = frames.transform(rotations.exp(rng.normal(0.0, 0.3, (3, 3))), rng.normal(size=(3, 3)))
    points = rng.normal(size=(200, 3)) * [3.0, 3.0, 1.0]
    index, pixels = [], []
    shown = np.ones((3, 2), bool)
    shown[1, 1] = False
    for instant, camera in np.argwhere(shown):
        lens = rig.cameras[camera]
        seen = lens.project(frames.apply(frames.invert(T[instant] @ lens.T_body_camera), points))
        inside = np.flatnonzero(lens.contains(seen))
        index.append(np.column_stack([inside, np.full((len(inside), 2), [instant, camera])]))
        pixels.append(seen[inside])
    tracks = Tracks(np.concatenate(index).astype(np.int32), np.concatenate(pixels))
    colours = rng.integers(0, 255, (200, 3), dtype=np.uint8)
    names = ("0.png", "1.png", "2.png")
    colmap_files.write(tmp_path, rig, names, T, shown, points, colours, tracks)
    assert {file.name for file in tmp_path.iterdir()} == set(colmap_files.FILES)

    model = pycolmap.Reconstruction(tmp_path)
    assert model.num_reg_images() == 5
    assert {image.name for image in model.images.values()} == {"front/0.png", "front/1.png", "front/2.png",
                                                               "down/0.png", "down/2.png"}  # fmt: skip
    assert model.compute_num_observations() == len(tracks.index)
    model.update_point_3d_errors()
    assert model.compute_mean_reprojection_error() < 2e-3  # pixels are written to a thousandth
    for k, point in model.points3D.items():
        np.testing.assert_allclose(point.xyz, points[k - 1], atol=1e-6)
        np.testing.assert_array_equal(point.color, colours[k - 1])
    for image in model.images.values():
        folder, name = image.name.split("/")
        expected = T[names.index(name)] @ rig[folder].T_body_camera
        np.testing.assert_allclose(image.cam_from_world().inverse().matrix(), expected[:3], atol=1e-9)


def test_colmap_takes_points_without_observations_and_images_of_one_folder(tmp_path: Path) -> None:
    rig = Rig((rigs.forward_camera("PINHOLE", 64, 48, [40.0, 40.0, 32.0, 24.0]),))
    none = Tracks(np.zeros((0, 3), np.int32), np.zeros((0, 2)))
    colmap_files.write(tmp_path, rig, ("a.png",), np.eye(4)[None], np.ones((1, 1), bool), VERTICES, COLOURS, none)
    model = pycolmap.Reconstruction(tmp_path)
    assert [image.name for image in model.images.values()] == ["a.png"]
    assert model.num_points3D() == 4
