"""Space before a wall that images contradict: nets and cords that no depth image shows."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from esdf import FREE, OCCUPIED, UNKNOWN, Grid, build
from esdf.solids import Box, Room
from flight import FormatError, frames, rotations
from goshawk.rendered import world as rendered_world
from goshawk.rendered.scene import Painted, RenderedScene
from mapping.dense import contradiction, occupancy, ranges, stereo
from mapping.dense.contradiction import Looks
from mapping.dense.stereo import StereoOptions
from mapping.dense.views import ImageView

VOXEL_M, WALL_M = 0.05, 3.0
GRID = Grid((-0.525, -2.025, 0.225), (VOXEL_M, VOXEL_M, VOXEL_M), (76, 81, 52))
CAMERA = dataclasses.replace(rendered_world.default_rig(0.75).cameras[0], T_body_camera=np.eye(4))
LOOKING_ALONG_X = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
CORDS = [Box((2.0, y, 0.8), (2.008, y + 0.008, 2.0)) for y in (-0.45, -0.15, 0.15, 0.45)]
ROOM: Painted = (Room((-1.0, -3.0, -0.5), (WALL_M, 3.0, 3.5)), "plaster")


def views(cords: Sequence[Box]) -> list[ImageView]:
    """From places beside and above each other, of a wall with cords before it."""
    scene = RenderedScene((ROOM, *((cord, "ink") for cord in cords)))
    poses = [
        frames.transform(
            rotations.from_matrix(LOOKING_ALONG_X), np.array([0.05 * n, -0.7 + 0.2 * n, 1.1 + 0.3 * (n % 3)])
        )
        for n in range(8)
    ]
    return [ImageView(CAMERA, T, rendered_world.render(CAMERA, T, scene=scene, seed=n)) for n, T in enumerate(poses)]


def wall() -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces."""
    y, z = np.arange(-1.9, 1.9, 0.04), np.arange(0.3, 2.7, 0.04)
    vertices = np.stack([np.full((len(y), len(z)), WALL_M), *np.meshgrid(y, z, indexing="ij")], axis=-1)
    number = np.arange(len(y) * len(z), dtype=np.int32).reshape(len(y), len(z))
    a, b, c, d = (part.ravel() for part in (number[:-1, :-1], number[1:, :-1], number[:-1, 1:], number[1:, 1:]))
    return vertices.reshape(-1, 3), np.concatenate([np.stack([a, c, b], axis=1), np.stack([b, c, d], axis=1)])


def all_free() -> np.ndarray:
    state = np.full(GRID.shape, FREE, np.uint8)
    state[GRID.index(np.array([[WALL_M - VOXEL_M, 0.0, 1.0]]))[0, 0] :] = OCCUPIED
    return state


def looked(images: Sequence[ImageView], state: np.ndarray, threads: int = 2) -> Looks:
    return contradiction.find(images, *wall(), state, GRID, options=StereoOptions(), farthest_m=8.0, threads=threads)


@pytest.fixture(scope="module")
def with_cords() -> list[ImageView]:
    return views(CORDS)


@pytest.fixture(scope="module")
def found(with_cords: list[ImageView]) -> Looks:
    return looked(with_cords, all_free())


@pytest.fixture(scope="module")
def clean() -> list[ImageView]:
    return views([])


def of_cords(marked: np.ndarray) -> float:
    points = np.array([[2.004, cord.low_world_m[1] + 0.004, z] for cord in CORDS for z in np.linspace(1.0, 1.8, 40)])
    return float(marked[tuple(GRID.index(points).T)].mean())


def test_cords_before_a_wall_are_contradicted_where_they_are(found: Looks) -> None:
    assert of_cords(found.looks >= 3) > 0.9
    assert of_cords(found.contradicted) > 0.9
    centres = GRID.centre(np.argwhere(found.contradicted))
    off_m = np.min([cord.distance(centres) for cord in CORDS], axis=0)
    assert np.median(off_m) < 0.25  # beside it, what the same rays pass
    assert found.contradicted.mean() < 0.03


def test_a_clean_room_is_not_contradicted(clean: list[ImageView]) -> None:
    looks = looked(clean, all_free())
    assert (looks.looks[looks.free] > 0).mean() > 0.3
    assert looks.contradicted.sum() <= 1e-3 * looks.free.sum()


def test_one_image_alone_contradicts_nothing(clean: list[ImageView]) -> None:
    pixels = clean[3].pixels.copy()
    pixels[150:200, 240:244] = 255
    before = looked(clean, all_free())
    looks = looked([*clean[:3], dataclasses.replace(clean[3], pixels=pixels), *clean[4:]], all_free())
    alone = (looks.contradictions == 1) & (before.contradictions == 0)
    assert alone.sum() > 50
    assert (looks.contradictions.astype(int) - before.contradictions).max() == 1
    assert not (looks.contradicted & ~before.contradicted & alone).any()


def test_masked_pixels_say_nothing(with_cords: list[ImageView]) -> None:
    nothing = np.zeros((CAMERA.height, CAMERA.width), bool)
    looks = looked([dataclasses.replace(view, used=nothing) for view in with_cords], all_free())
    assert not looks.looks.any()


@pytest.mark.parametrize("error_rad_m", [0.002, 0.01, 0.05])
def test_errors_of_the_poses_contradict_little(clean: list[ImageView], error_rad_m: float) -> None:
    rng = np.random.default_rng(1)
    wrong = [
        dataclasses.replace(view, T_world_camera=view.T_world_camera @ frames.transform(rotations.exp(turn), turn))
        for view, turn in zip(clean, rng.normal(0.0, error_rad_m, (len(clean), 3)), strict=True)
    ]
    looks = looked(wrong, all_free())
    assert looks.contradicted.sum() <= 0.01 * looks.free.sum()


def test_the_order_of_the_images_and_the_number_of_threads_do_not_matter(
    with_cords: list[ImageView], found: Looks
) -> None:
    for other in (looked(with_cords[::-1], all_free()), looked(with_cords, all_free(), threads=1)):
        np.testing.assert_array_equal(other.looks, found.looks)
        np.testing.assert_array_equal(other.contradictions, found.contradictions)


def test_a_cord_that_is_occupied_already_contradicts_nothing_beside_it(with_cords: list[ImageView]) -> None:
    state = all_free()
    centres = GRID.centre(np.argwhere(state == FREE))
    near = np.min([cord.distance(centres) for cord in CORDS], axis=0) < 0.87 * VOXEL_M
    state[tuple(np.argwhere(state == FREE)[near].T)] = OCCUPIED
    beside = looked(with_cords, state)
    assert beside.contradicted.sum() < 0.1 * looked(with_cords, all_free()).contradicted.sum()


def test_a_voxel_beside_a_contradicted_one_needs_less() -> None:
    looks, against = np.full((5, 5, 5), 10, np.uint8), np.zeros((5, 5, 5), np.uint8)
    against[1, 1, 1], against[2, 2, 2], against[4, 4, 4] = 4, 3, 3
    assert np.argwhere(Looks(looks > 0, looks, against).contradicted).tolist() == [[1, 1, 1], [2, 2, 2]]


def test_ranges_to_a_wall_are_those_of_its_formula() -> None:
    planes = ranges.planes_in_voxels(*wall(), all_free(), GRID)
    view = views([])[0]
    rays = stereo.depth_rays(view, 0.25)
    found_m = ranges.of_planes(planes, rays, view.T_world_camera, 8.0)
    towards = rays @ view.T_world_camera[:3, :3].T
    expected_m = (WALL_M - view.position_world_m[0]) / towards[..., 0]
    at = view.position_world_m + expected_m[..., None] * towards
    on_it = (np.abs(at[..., 1]) < 1.8) & (np.abs(at[..., 2] - 1.5) < 1.1) & (towards[..., 0] > 0.3)
    assert on_it.sum() > 500
    np.testing.assert_allclose(found_m[on_it], expected_m[on_it], rtol=1e-5)
    planes.number[GRID.index(np.array([[1.0, 0.0, 0.0]]))[0, 0]] = ranges.BLOCKED
    planes.filled[...] = 1
    assert not ranges.of_planes(planes, rays, view.T_world_camera, 8.0)[on_it].any()


def test_the_probability_rises_with_the_share_of_looks_against() -> None:
    looks, against = np.full((1, 1, 11), 10, np.uint8), np.arange(11, dtype=np.uint8)[None, None]
    rising = occupancy.probability(Looks(looks > 0, looks, against))[0, 0]
    assert (np.diff(rising) >= 0.0).all()
    assert 0.0 < rising[0] < 1e-3 < rising[-1] < 1.0
    assert np.isnan(occupancy.probability(Looks(looks == 0, looks, against))).all()


def test_the_layer_of_a_map_says_what_it_was_given(tmp_path: Path, found: Looks) -> None:
    occupancy.save(tmp_path / occupancy.FILE, occupancy.probability(found))
    stated = occupancy.load(tmp_path / occupancy.FILE, GRID.shape)
    assert stated is not None
    np.testing.assert_array_equal(stated, occupancy.probability(found))
    state = all_free()
    state[found.contradicted] = UNKNOWN
    figures = occupancy.figures(stated, build(state, GRID))
    assert figures["contradicted_m3"] == pytest.approx(found.contradicted.sum() * VOXEL_M**3)
    assert 0.0 < figures["expected_in_free"] < 1e-3 * (state == FREE).sum()
    assert occupancy.load(tmp_path / "none.npz", GRID.shape) is None
    with pytest.raises(FormatError, match="shape"):
        occupancy.load(tmp_path / occupancy.FILE, (1, 2, 3))
    (tmp_path / occupancy.FILE).write_bytes(b"no archive")
    with pytest.raises(FormatError, match="damaged"):
        occupancy.load(tmp_path / occupancy.FILE, GRID.shape)
