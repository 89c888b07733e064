"""The volume keeps bricks only where surfaces are; its surface and states are those of a volume that keeps all."""

import dataclasses
import itertools
import re

import numpy as np
import pytest
from scipy import ndimage

from esdf import FREE, OCCUPIED, Grid
from esdf.solids import Box
from flight import InputError, MapError, frames, rotations
from goshawk.rendered import world as rendered_world
from goshawk.rendered.scene import RenderedScene
from mapping.camera.rig import Camera
from mapping.dense import fusion, stereo, surface
from mapping.dense.fusion import BRICK, Volume
from mapping.dense.stereo import DepthImage
from mapping.dense.surface import DenseOptions
from mapping.dense.views import ImageView
from tests.mapping.dense.volumes import in_bricks, whole_volume

PINHOLE = Camera("pinhole", ".", "PINHOLE", 160, 120, np.array([100.0, 100.0, 80.0, 60.0]), np.eye(4))
FISHEYE = dataclasses.replace(PINHOLE, model="SIMPLE_RADIAL_FISHEYE", params=np.array([60.0, 80.0, 60.0, -0.01]))
NARROW = dataclasses.replace(FISHEYE, field_of_view_rad=1.2)  # a circle within the image
BOARDS = RenderedScene(
    (
        (Box((2.0, -2.5, -1.5), (2.02, 0.4, 1.0)), "wood"),
        (Box((1.0, 0.9, -1.5), (2.4, 0.93, 1.5)), "wood"),
        (Box((3.4, -3.0, -2.0), (3.6, 3.0, 2.0)), "wood"),
        (Box((-2.0, -3.0, -1.6), (4.0, 3.0, -1.5)), "wood"),
    )
)
"""Two boards of 2 and 3 cm that are seen from both sides, a wall and a floor."""
VOXEL_M, TRUNCATION_M, FARTHEST_M = 0.05, 0.125, 5.0


def pose(rng: np.random.Generator) -> np.ndarray:
    """Of a camera that looks at the boards' middle from anywhere around, rolled at random."""
    position = np.array([2.0, 0.0, 0.0]) + rng.uniform([-2.5, -2.0, -0.8], [1.2, 2.0, 1.2])
    forward = np.array([2.0, 0.2, -0.2]) + rng.normal(0.0, 0.3, 3) - position
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, rng.normal(size=3))
    right /= np.linalg.norm(right)
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = np.column_stack([right, np.cross(forward, right), forward]), position
    return T


def noisy_depths(camera: Camera, count: int, seed: int) -> tuple[list[ImageView], list[DepthImage]]:
    """Depth images of the boards with noise, gaps and a few false depths."""
    rng = np.random.default_rng(seed)
    views, depths = [], []
    for _ in range(count):
        view = ImageView(camera, pose(rng), rng.integers(0, 255, (120, 160), dtype=np.uint8))
        rays = stereo.depth_rays(view, 0.5)
        directions = rays.reshape(-1, 3) @ view.T_world_camera[:3, :3].T
        range_m = rendered_world.cast_rays(BOARDS, view.position_world_m, directions).reshape(60, 80)
        inverse = np.where(np.isfinite(range_m), 1.0 / range_m, 0.0) * rng.normal(1.0, 0.01, range_m.shape)
        false = rng.random(range_m.shape) < 0.002
        inverse = np.where(false, rng.uniform(0.1, 1.0, range_m.shape), inverse)
        inverse = np.where(rng.random(range_m.shape) < 0.02, 0.0, inverse).astype(np.float32)
        bound = (1.05 * inverse).astype(np.float32)
        depths.append(DepthImage(inverse, 0.01 * inverse, stereo.facing(inverse, rays), bound, 0.5))
        views.append(view)
    return views, depths


def fused_in_all_bricks(views: list[ImageView], depths: list[DepthImage], grid: Grid, options: DenseOptions) -> Volume:
    volume = whole_volume(grid, truncation_m=options.truncation_voxels * options.voxel_m)
    for view, depth in zip(views, depths, strict=True):
        volume.integrate(view, depth.inverse_range, depth.deviation, depth.facing, farthest_m=options.farthest_m)
        margin_m, enough = options.skin_voxels * options.voxel_m, options.least_seen_through
        volume.carve(view, depth.bound, margin_m=margin_m, farthest_m=options.farthest_m, enough=enough)
    return volume


@pytest.mark.parametrize("camera", [PINHOLE, FISHEYE], ids=["pinhole", "fisheye"])
def test_surface_and_states_are_those_of_a_volume_that_keeps_every_brick(camera: Camera) -> None:
    options = DenseOptions(farthest_m=FARTHEST_M, skin_voxels=1.0)
    views, depths = noisy_depths(camera, 8, seed=4)
    needed = surface.fuse(views, depths, options)
    whole = fused_in_all_bricks(views, depths, needed.grid, options)
    assert len(needed.bricks) < 0.8 * len(whole.bricks)
    one, other = surface.measured(needed, options), surface.measured(whole, options)
    assert len(one.faces) > 5000
    assert {FREE, OCCUPIED} < set(one.state.ravel())
    for name in ("vertices_world_m", "faces", "colours", "state"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


def test_the_bricks_that_are_kept_do_not_depend_on_the_order_of_the_images() -> None:
    views, depths = noisy_depths(PINHOLE, 6, seed=5)
    first, second = (surface.fuse(views[s], depths[s], DenseOptions()) for s in (slice(None), slice(None, None, -1)))
    np.testing.assert_array_equal(first.bricks, second.bricks)


def marked(grid: Grid, view: ImageView, inverse_range: np.ndarray, facing: np.ndarray) -> np.ndarray:
    near, rays = fusion.no_bricks(grid), stereo.depth_rays(view, inverse_range.shape[1] / view.camera.width)
    fusion.mark_near_surface(
        near, grid, view, rays, inverse_range, facing, truncation_m=TRUNCATION_M, farthest_m=FARTHEST_M
    )
    return near


def near_surface(volume: Volume) -> np.ndarray:
    """(nx, ny, nz) less than a voxel before a surface, or behind one."""
    return (volume.in_grid(volume.weight) > 0.0) & (volume.in_grid(volume.distance) < volume.voxel_m)


def assert_kept(grid: Grid, voxels: np.ndarray, near: np.ndarray) -> None:
    """Each of these voxels (nx, ny, nz) and those around it are in bricks that are marked, and not all bricks are."""
    kept = fusion.empty_volume(grid, near, truncation_m=TRUNCATION_M, channels=1)
    around = ndimage.binary_dilation(voxels, np.ones((3, 3, 3)))
    assert voxels.any()
    assert kept.in_grid(np.ones_like(kept.weight))[around].all()
    assert not near.all()


@pytest.mark.parametrize("camera", [PINHOLE, FISHEYE], ids=["pinhole", "fisheye"])
@pytest.mark.parametrize("rows", [12, 60])
@pytest.mark.parametrize("seed", range(6))
def test_every_voxel_less_than_a_voxel_before_a_surface_is_kept_with_those_around(
    camera: Camera, rows: int, seed: int
) -> None:
    """Whatever an image shows: smooth ground, on which ranges are interpolated, jumps, gaps, and any facing."""
    rng = np.random.default_rng(seed)
    grid = Grid.covering([-1.0, -2.5, -1.7], [4.3, 2.6, 1.9], VOXEL_M)  # the last bricks reach beyond it
    view = ImageView(camera, pose(rng), np.zeros((120, 160), np.uint8))
    shape = (rows, 4 * rows // 3)
    smooth = ndimage.zoom(rng.uniform(0.15, 1.5, (4, 5)), (shape[0] / 4, shape[1] / 5), order=1)
    sparse = rng.random(shape) < 0.1
    inverse_range = np.where(sparse if seed % 2 else ~sparse, smooth, 0.0).astype(np.float32)
    facing = rng.uniform(0.1, 1.0, shape).astype(np.float32)
    volume = whole_volume(grid, truncation_m=TRUNCATION_M)
    volume.integrate(view, inverse_range, 0.01 * inverse_range, facing, farthest_m=FARTHEST_M)
    assert_kept(grid, near_surface(volume), marked(grid, view, inverse_range, facing))


def wall_view(range_m: float) -> tuple[ImageView, np.ndarray]:
    """A camera before a wall that it meets squarely: the image and its inverse range."""
    view = ImageView(PINHOLE, np.eye(4), np.zeros((120, 160), np.uint8))
    return view, (stereo.depth_rays(view, 1.0)[..., 2] / range_m).astype(np.float32)


def test_the_number_of_bricks_grows_with_the_surface_and_not_with_the_volume() -> None:
    view, inverse_range = wall_view(2.0)
    facing = np.ones_like(inverse_range)
    counts = {}
    for voxel_m, side_m in itertools.product((0.02, 0.04), (4.0, 8.0)):
        grid = Grid.covering(np.full(3, -side_m), np.full(3, side_m), voxel_m)
        counts[voxel_m, side_m] = int(marked(grid, view, inverse_range, facing).sum())
    assert counts[0.02, 4.0] == counts[0.02, 8.0]
    assert 2.5 < counts[0.02, 4.0] / counts[0.04, 4.0] < 4.5


@pytest.mark.parametrize("step", range(BRICK))
def test_the_voxels_beside_those_near_a_wall_are_kept_wherever_it_stands(step: int) -> None:
    """In fine pixels, which mark little more than is needed, at each place of the border between two bricks."""
    camera = dataclasses.replace(PINHOLE, width=320, height=240, params=np.array([400.0, 400.0, 160.0, 120.0]))
    view = ImageView(camera, np.eye(4), np.zeros((240, 320), np.uint8))
    inverse_range = (stereo.depth_rays(view, 1.0)[..., 2] / (1.01 + step * VOXEL_M)).astype(np.float32)
    facing = np.ones_like(inverse_range)
    grid = Grid.covering([-0.8, -0.8, 0.0], [0.8, 0.8, 2.0], VOXEL_M)
    volume = whole_volume(grid, truncation_m=TRUNCATION_M)
    volume.integrate(view, inverse_range, 0.01 * inverse_range, facing, farthest_m=FARTHEST_M)
    assert_kept(grid, near_surface(volume), marked(grid, view, inverse_range, facing))


def test_all_ranges_that_are_interpolated_between_two_pixels_are_kept() -> None:
    """A comb of which each tooth is of one surface with the next, by the ratio of their ranges; through a telescope."""
    camera = dataclasses.replace(PINHOLE, width=40, height=30, params=np.array([1000.0, 1000.0, 20.0, 15.0]))
    view = ImageView(camera, np.eye(4), np.zeros((30, 40), np.uint8))
    inverse_range = np.where(np.arange(40) % 2, 1.0 / 4.2, 1.0 / 4.55).astype(np.float32) + np.zeros(
        (30, 1), np.float32
    )
    facing = np.ones_like(inverse_range)
    grid = Grid.covering([-0.1, -0.1, 3.5], [0.1, 0.1, 5.1], 0.01)
    volume = whole_volume(grid, truncation_m=0.02)
    volume.integrate(view, inverse_range, 0.01 * inverse_range, facing, farthest_m=FARTHEST_M)
    near, rays = fusion.no_bricks(grid), stereo.depth_rays(view, 1.0)
    fusion.mark_near_surface(near, grid, view, rays, inverse_range, facing, truncation_m=0.02, farthest_m=FARTHEST_M)
    assert_kept(grid, near_surface(volume), near)


def test_what_is_in_front_of_a_slanted_surface_is_kept_as_far_as_the_distance_to_it_is_small() -> None:
    view, inverse_range = wall_view(3.0)
    grid = Grid.covering(np.full(3, -2.0), np.full(3, 4.0), VOXEL_M)
    squarely, grazing = (marked(grid, view, inverse_range, np.full_like(inverse_range, c)) for c in (1.0, 0.1))
    nearest_m = [BRICK * VOXEL_M * (np.argwhere(near)[:, 2].min() + 1) - 2.0 for near in (squarely, grazing)]
    assert nearest_m[0] > 3.0 - VOXEL_M - BRICK * VOXEL_M
    assert 3.0 - 10 * VOXEL_M - 2 * BRICK * VOXEL_M < nearest_m[1] < 3.0 - 10 * VOXEL_M + BRICK * VOXEL_M


@pytest.mark.parametrize("range_m", [FARTHEST_M - 0.1, FARTHEST_M + 0.1])
def test_surfaces_beyond_the_farthest_range_mark_nothing(range_m: float) -> None:
    view, along_axis = wall_view(range_m)
    grid = Grid.covering(np.full(3, -1.0), np.full(3, 8.0), VOXEL_M)
    inverse_range = np.where(along_axis > 0.0, np.float32(1.0 / range_m), np.float32(0.0))  # a ball, not a wall
    assert marked(grid, view, inverse_range, np.ones_like(inverse_range)).any() == (range_m < FARTHEST_M)


def test_voxels_in_bricks_come_back_where_they_were_and_nothing_lies_beyond_the_grid() -> None:
    grid = Grid((0.0, 0.0, 0.0), (VOXEL_M,) * 3, (21, 8, 13))
    values = np.random.default_rng(2).normal(size=grid.shape).astype(np.float32)
    volume = whole_volume(grid, truncation_m=TRUNCATION_M)
    np.testing.assert_array_equal(volume.in_grid(in_bricks(values)), values)
    some = dataclasses.replace(volume, bricks=volume.bricks[1:])
    expected = values.copy()
    expected[:BRICK, :BRICK, :BRICK] = 0.0
    np.testing.assert_array_equal(some.in_grid(in_bricks(values)[1:]), expected)


def test_nothing_is_measured_in_voxels_beyond_the_grid() -> None:
    view, inverse_range = wall_view(1.0)
    volume = whole_volume(Grid.covering([-0.63, -0.41, 0.0], [0.52, 0.33, 1.1], VOXEL_M), truncation_m=TRUNCATION_M)
    volume.integrate(view, inverse_range, 0.01 * inverse_range, np.ones_like(inverse_range), farthest_m=FARTHEST_M)
    assert volume.weight.any()
    assert np.count_nonzero(volume.weight) == np.count_nonzero(volume.in_grid(volume.weight))


@pytest.mark.parametrize("camera", [PINHOLE, FISHEYE, NARROW], ids=["pinhole", "fisheye", "narrow"])
@pytest.mark.parametrize("seed", range(3))
def test_each_voxel_in_view_is_measured_though_the_middle_of_its_brick_is_not_in_view(
    camera: Camera, seed: int
) -> None:
    range_m = 1.5
    view = ImageView(camera, pose(np.random.default_rng(seed)), np.zeros((120, 160), np.uint8))
    volume = whole_volume(Grid.covering([-1.0, -2.5, -1.7], [4.3, 2.6, 1.9], VOXEL_M), truncation_m=TRUNCATION_M)
    shown = np.full((120, 160), 1.0 / range_m, np.float32)
    volume.integrate(view, shown, 0.01 * shown, np.ones_like(shown), farthest_m=FARTHEST_M)
    at_camera = frames.apply(frames.invert(view.T_world_camera), volume.grid.centres().reshape(-1, 3))
    off_m = np.linalg.norm(at_camera, axis=1) - range_m
    in_view = camera.contains(camera.project(at_camera)) & (off_m < TRUNCATION_M - 1e-6)
    beside = np.abs(camera.project(at_camera) - [80.0, 60.0]) > [80.0 - 1e-2, 60.0 - 1e-2]
    measured = volume.in_grid(volume.weight).ravel() > 0.0
    assert in_view.sum() > 1000
    assert measured[in_view & ~beside.any(axis=1)].all()


def test_turning_the_camera_over_marks_no_other_bricks() -> None:
    """The rays of the pixels stay the same, in another order."""
    view, inverse_range = wall_view(2.0)
    T = frames.transform(rotations.exp(np.array([0.0, 0.0, np.pi])), np.zeros(3))
    over = dataclasses.replace(view, T_world_camera=T)
    grid = Grid.covering([-3.011, -3.017, -1.0], [3.0, 3.0, 3.0], VOXEL_M)
    facing = np.ones_like(inverse_range)
    np.testing.assert_array_equal(
        marked(grid, view, inverse_range, facing), marked(grid, over, inverse_range[::-1, ::-1].copy(), facing)
    )


def test_a_truncation_below_a_voxel_is_refused() -> None:
    grid = Grid.covering(np.zeros(3), np.ones(3), VOXEL_M)
    with pytest.raises(InputError, match="truncation"):
        fusion.empty_volume(grid, fusion.no_bricks(grid), truncation_m=0.01, channels=1)


@pytest.mark.parametrize("voxel_m", [0.0, -0.1, np.nan])
def test_a_voxel_size_that_is_not_positive_is_refused(voxel_m: float) -> None:
    with pytest.raises(InputError, match="voxel"):
        fusion.covering(np.zeros(3), np.ones(3), voxel_m)


def size_that_fits(error: pytest.ExceptionInfo[MapError]) -> float:
    found = re.search(r"voxel_m >= ([0-9.]+) does", str(error.value))
    assert found
    return float(found[1])


def test_a_volume_of_more_voxels_than_fit_is_refused_with_the_size_that_does() -> None:
    low, high = np.zeros(3), np.array([40.0, 40.0, 28.0])
    grid = fusion.covering(low, high, 0.0505)
    assert 0.97 * fusion.MOST_VOXELS < grid.voxels <= fusion.MOST_VOXELS
    with pytest.raises(MapError) as error:
        fusion.covering(low, high, 0.0495)
    assert 0.0495 < size_that_fits(error) < 0.0505
    fusion.covering(low, high, size_that_fits(error) + 1e-3)


@pytest.mark.parametrize("channels", [1, 3])
def test_more_surface_than_fits_is_refused_with_a_size_that_does(channels: int) -> None:
    """Surface, unlike volume, is divided into fewer bricks by the square of their size."""
    most = fusion.MOST_BRICK_BYTES // ((4 * (4 + channels) + 1) * BRICK**3)
    grid = Grid((0.0, 0.0, 0.0), (VOXEL_M,) * 3, (BRICK * (most + 1), 1, 1))
    with pytest.raises(MapError, match="surface") as error:
        fusion.empty_volume(grid, np.ones((most + 1, 1, 1), np.uint8), truncation_m=TRUNCATION_M, channels=channels)
    assert size_that_fits(error) == pytest.approx(VOXEL_M * np.sqrt((most + 1) / most), abs=6e-4)
    fitting = np.ones((most + 1, 1, 1), np.uint8)
    fitting[0] = 0  # arrays of zeros take no memory before they are written
    volume = fusion.empty_volume(grid, fitting, truncation_m=TRUNCATION_M, channels=channels)
    of_distances = (volume.distance, volume.weight, volume.scatter, volume.images)
    assert sum(a.nbytes for a in (*of_distances, volume.colour, volume.colour_weight)) <= fusion.MOST_BRICK_BYTES
