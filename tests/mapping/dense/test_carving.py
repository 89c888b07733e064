"""Carving: which voxels are counted as seen through, how often they must be, and which become unknown again."""

import dataclasses

import numpy as np
import pytest

from esdf import FREE, OCCUPIED, UNKNOWN, Grid
from flight import InputError, rotations
from mapping.camera.rig import Camera
from mapping.dense import fusion, stereo, surface
from mapping.dense.fusion import Volume
from mapping.dense.surface import DenseOptions
from mapping.dense.views import ImageView
from tests.mapping.dense.volumes import in_bricks, whole_volume

PINHOLE = Camera("forward", ".", "PINHOLE", 160, 120, np.array([120.0, 120.0, 80.0, 60.0]), np.eye(4))
LOOKING_ALONG_X = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
FARTHEST_M, MARGIN_M = 5.0, 0.15


def view_from(position_world_m: tuple[float, float, float] = (0.1, 1.0, 1.0)) -> ImageView:
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = LOOKING_ALONG_X, position_world_m
    return ImageView(PINHOLE, T, np.full((120, 160), 90, np.uint8))


def unobserved_volume() -> Volume:
    return whole_volume(Grid.covering(np.zeros(3), [7.0, 2.0, 2.0], 0.1), truncation_m=0.25)


def centres(volume: Volume) -> np.ndarray:
    return volume.grid.centre(np.argwhere(volume.seen_through >= 0)).reshape(*volume.grid.shape, 3)


def bound(range_m: float) -> np.ndarray:
    return np.full((60, 80), 1.0 / range_m if range_m else 0.0, np.float32)


@pytest.mark.parametrize("range_m", [0.8, 3.0, 4.9, 50.0])
def test_nothing_behind_the_bound_out_of_view_or_too_far_is_counted(range_m: float) -> None:
    view, volume = view_from(), unobserved_volume()
    volume.carve(view, bound(range_m), margin_m=MARGIN_M, farthest_m=FARTHEST_M, enough=3)
    at = centres(volume) - view.position_world_m
    distance_m = np.linalg.norm(at, axis=-1)
    largest_m = min(range_m - MARGIN_M, FARTHEST_M)
    near_enough = (at[..., 0] > 0.0) & (distance_m < largest_m)
    whole = near_enough & in_view(at, 1.5 * volume.voxel_m)  # its corners, too
    counted = volume.seen_through == 1
    assert counted.any()
    near_the_edge = np.abs(distance_m - largest_m) < 1e-4
    assert not (counted & ~(near_enough & in_view(at, 0.0)) & ~near_the_edge).any()
    assert (counted | ~whole | near_the_edge).all()
    assert not volume.weight.any()


def in_view(at: np.ndarray, half_m: float) -> np.ndarray:
    """Whether a square of that half width round each point, and a depth pixel about it, are in the image."""
    at_camera = (at @ LOOKING_ALONG_X).reshape(-1, 3)
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = PINHOLE.focal_px[0] * half_m / np.linalg.norm(at_camera, axis=1) + (2.0 if half_m else 0.0)
    pixels = PINHOLE.project(at_camera)
    inside = (pixels >= reach[:, None]) & (pixels < np.array([160.0, 120.0]) - reach[:, None])
    return inside.all(axis=1).reshape(at.shape[:-1])


def test_a_voxel_is_seen_through_only_if_every_pixel_that_it_covers_is() -> None:
    rng = np.random.default_rng(7)
    view, volume = view_from((0.103, 1.017, 0.991)), unobserved_volume()  # no corner between two pixels
    open_m, near_m = 4.0, 1.2
    limit = bound(open_m)
    limit[rng.random(limit.shape) < 0.004] = 0.0  # not known
    limit[:, 40] = 1.0 / near_m  # a rod, one pixel wide
    volume.carve(view, limit, margin_m=MARGIN_M, farthest_m=FARTHEST_M, enough=3)
    at = (centres(volume) - view.position_world_m).reshape(-1, 3) @ LOOKING_ALONG_X
    corners = 0.5 * volume.voxel_m * np.stack(np.meshgrid(*[[-1.0, 1.0]] * 3), axis=-1).reshape(-1, 3)
    expected = np.zeros(len(at), bool)
    for i in np.flatnonzero((at[:, 2] > 0.1) & (np.linalg.norm(at, axis=1) < FARTHEST_M)):
        pixels = np.floor(0.5 * PINHOLE.project(at[i] + corners))
        (left, top), (right, bottom) = pixels.min(axis=0), pixels.max(axis=0)
        extent = int(max(right - left, bottom - top)) + 1
        if not (left >= 0 and top >= 0 and left + extent <= 80 and top + extent <= 60):
            continue
        window = limit[int(top) : int(top) + extent, int(left) : int(left) + extent]
        expected[i] = (window > 0.0).all() and (np.linalg.norm(at[i]) + MARGIN_M) * window.max() < 1.0
    counted = volume.seen_through.ravel() == 1
    assert counted.sum() > 1000
    np.testing.assert_array_equal(counted, expected)


WIDE = [
    dataclasses.replace(PINHOLE, params=np.array([60.0, 60.0, 80.0, 60.0])),
    dataclasses.replace(PINHOLE, model="SIMPLE_RADIAL_FISHEYE", params=np.array([50.0, 80.0, 60.0, 0.0])),
]


@pytest.mark.parametrize("camera", WIDE)
@pytest.mark.parametrize("yaw_rad", [0.0, 0.5, 0.785])
def test_no_voxel_on_an_unknown_ray_is_counted_whatever_the_lens_and_its_direction(
    camera: Camera, yaw_rad: float
) -> None:
    """Beside the axis a lens magnifies, and an oblique voxel is wider than its edge: a fixed width misses its rim."""
    limit = np.full((60, 80), 1.0 / 6.0, np.float32)
    limit[:, 4:76:9] = 0.0
    view = dataclasses.replace(view_from((1.0, 1.0, 1.0)), camera=camera)
    view.T_world_camera[:3, :3] = rotations.matrix(rotations.from_yaw(yaw_rad)) @ LOOKING_ALONG_X
    volume = unobserved_volume()
    volume.carve(view, limit, margin_m=MARGIN_M, farthest_m=FARTHEST_M, enough=3)
    columns, rows = np.meshgrid(np.arange(4, 76, 9), np.arange(60))
    rays = camera.unproject(2.0 * np.stack([columns + 0.5, rows + 0.5], axis=-1).reshape(-1, 2))
    at = (rays[:, None] * np.linspace(0.3, 3.0, 50)[:, None]).reshape(-1, 3) @ view.T_world_camera[:3, :3].T
    cells = volume.grid.index(at + view.position_world_m)
    cells = cells[((cells >= 0) & (cells < volume.grid.shape)).all(axis=1)]
    assert len(cells) > 1000
    assert volume.seen_through.sum() > 100
    assert not volume.seen_through[tuple(cells.T)].any()


def test_where_no_bound_is_known_nothing_is_counted() -> None:
    volume = unobserved_volume()
    volume.carve(view_from(), bound(0.0), margin_m=MARGIN_M, farthest_m=FARTHEST_M, enough=3)
    assert not volume.seen_through.any()


@pytest.mark.parametrize("enough", [1, 3, fusion.MOST_COUNTED])
def test_space_is_free_only_after_enough_images_and_no_more_are_counted(enough: int) -> None:
    volume = unobserved_volume()
    for pictures in range(1, enough + 5):
        volume.carve(view_from(), bound(3.0), margin_m=MARGIN_M, farthest_m=FARTHEST_M, enough=enough)
        if pictures in (1, 2, 3, 254, 255, 256, 259):
            state = volume.occupancy(least_seen_through=enough, skin_voxels=0.87)
            assert (state == FREE).any() == (pictures >= enough)
            assert not (state == OCCUPIED).any()
    assert volume.seen_through.max() == enough


def test_that_no_more_than_enough_are_counted_changes_no_free_space() -> None:
    rng = np.random.default_rng(3)
    few, many = unobserved_volume(), unobserved_volume()
    for x_m in rng.uniform(0.1, 1.0, 12):
        limit = bound(3.0) * rng.uniform(0.5, 2.0, (60, 80)).astype(np.float32)
        for volume, enough in ((few, 3), (many, fusion.MOST_COUNTED)):
            volume.carve(view_from((x_m, 1.0, 1.0)), limit, margin_m=MARGIN_M, farthest_m=FARTHEST_M, enough=enough)
    free_few, free_many = (volume.occupancy(least_seen_through=3, skin_voxels=0.87) == FREE for volume in (few, many))
    assert 0 < free_many.sum() < free_many.size
    assert np.array_equal(free_few, free_many)


def test_what_an_image_adds_does_not_depend_on_the_extent_of_the_volume() -> None:
    """Only the voxels within the range of what it shows are visited; all it shows is in either volume."""
    rng = np.random.default_rng(5)
    small, large = (
        whole_volume(Grid.covering(np.full(3, -side_m), np.full(3, side_m), 0.1), truncation_m=0.25)
        for side_m in (3.0, 8.0)
    )
    for _ in range(4):
        place = tuple(rng.uniform(-0.5, 0.5, 3))
        shown = (1.0 / rng.uniform(0.5, 2.0) + np.zeros((60, 80))).astype(np.float32)
        shown[rng.random(shown.shape) < 0.01] = 0.0
        for volume in (small, large):
            volume.carve(view_from(place), shown, margin_m=MARGIN_M, farthest_m=FARTHEST_M, enough=3)
            deviation, facing = 0.01 * shown, np.ones_like(shown)
            volume.integrate(view_from(place), shown, deviation, facing, farthest_m=FARTHEST_M)
    lower = large.grid.index(small.grid.centre(np.zeros((1, 3), np.int64)))[0]
    common = tuple(slice(a, a + n) for a, n in zip(lower, small.grid.shape, strict=True))
    assert (small.weight > 0.0).any()
    assert small.seen_through.any()

    def known(volume: Volume) -> list[np.ndarray]:
        kept = (volume.distance, volume.weight, volume.scatter, volume.colour[..., 0], volume.colour_weight)
        return [volume.seen_through, volume.in_grid(volume.images), *map(volume.in_grid, kept)]

    for one, other in zip(known(small), known(large), strict=True):
        np.testing.assert_allclose(other[common], one, atol=1e-4)
        assert np.count_nonzero(other) == np.count_nonzero(other[common])


def test_a_surface_is_known_a_truncation_behind_the_farthest_that_an_image_shows() -> None:
    view, volume, range_m = view_from(), unobserved_volume(), 2.0
    shown = bound(range_m)
    volume.integrate(view, shown, 0.01 * shown, np.ones_like(shown), farthest_m=FARTHEST_M)
    off_m = np.linalg.norm(centres(volume) - view.position_world_m, axis=-1) - range_m
    behind = off_m[volume.in_grid(volume.weight) > 0.0].max()
    assert volume.truncation_m - volume.voxel_m < behind <= volume.truncation_m


def test_any_trace_of_a_surface_outweighs_all_carving() -> None:
    volume = unobserved_volume()
    volume.seen_through[...] = 255
    weight, distance_m = np.zeros(volume.grid.shape), np.zeros(volume.grid.shape)
    weight[30], distance_m[30] = 0.01, -0.02
    volume.weight[...], volume.distance[...] = in_bricks(weight), in_bricks(distance_m)
    state = volume.occupancy(least_seen_through=3, skin_voxels=0.87)
    assert (state[30] == OCCUPIED).all()
    assert (np.delete(state, 30, axis=0) == FREE).all()


def test_what_lies_before_a_measured_surface_is_not_free_unless_it_was_seen_through() -> None:
    volume = unobserved_volume()
    volume.weight[...], volume.distance[...] = 10.0, 0.2
    state = volume.occupancy(least_seen_through=3, skin_voxels=0.87)
    assert (state == UNKNOWN).all()


def test_free_space_cut_off_from_the_path_becomes_unknown_and_nothing_else_changes() -> None:
    rng = np.random.default_rng(3)
    grid = Grid((0.0, 0.0, 0.0), (0.1, 0.1, 0.1), (20, 12, 12))
    state = rng.choice(np.array([UNKNOWN, FREE, FREE, FREE, OCCUPIED], np.uint8), grid.shape)
    state[10] = OCCUPIED  # a wall through all of it
    state[3, 3, 3] = FREE
    before = state.copy()
    fusion.unreached_is_unknown(state, grid, np.array([[0.35, 0.35, 0.35], [50.0, 0.0, 0.0]]))
    assert state[3, 3, 3] == FREE
    assert not (state[10:] == FREE).any()
    changed = state != before
    assert (before[changed] == FREE).all()
    assert (state[changed] == UNKNOWN).all()
    edge_to_edge = np.full((4, 4, 4), OCCUPIED, np.uint8)
    edge_to_edge[1, 1, 1] = edge_to_edge[2, 2, 1] = FREE  # a vehicle does not pass through an edge
    fusion.unreached_is_unknown(edge_to_edge, Grid((0.0, 0.0, 0.0), (0.1, 0.1, 0.1), (4, 4, 4)), np.array([[0.15] * 3]))
    assert edge_to_edge[1, 1, 1] == FREE
    assert edge_to_edge[2, 2, 1] == UNKNOWN


@pytest.mark.parametrize("place_m", [9.0, 0.25])
def test_without_a_path_in_free_space_nothing_stays_free(place_m: float) -> None:
    """Outside of the grid or in an occupied voxel: what is beside that was not reached."""
    state = np.full((5, 5, 5), FREE, np.uint8)
    state[2, 2, 2] = OCCUPIED
    fusion.unreached_is_unknown(state, Grid((0.0, 0.0, 0.0), (0.1, 0.1, 0.1), (5, 5, 5)), np.full((1, 3), place_m))
    assert state[2, 2, 2] == OCCUPIED
    assert not (state == FREE).any()


def layers(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Bounds of four partners (0: nothing known), a depth and its deviation (0: none) for 30 by 40 pixels."""
    rng = np.random.default_rng(seed)
    bounds = np.where(rng.random((4, 30, 40)) < 0.1, 0.0, rng.uniform(0.1, 2.0, (4, 30, 40))).astype(np.float32)
    value = np.where(rng.random((30, 40)) < 0.5, 0.0, rng.uniform(0.1, 2.0, (30, 40))).astype(np.float32)
    return bounds, value, (0.05 * value).astype(np.float32)


@pytest.mark.parametrize("seed", range(4))
def test_a_bound_is_never_below_a_known_depth_and_needs_partners_that_agree(seed: int) -> None:
    bounds, value, deviation = layers(seed)
    agreed = stereo.agreed_bound(bounds, value, deviation, 2)
    known = agreed > 0.0
    assert known.any()
    assert (agreed[known] >= (value + 3.0 * deviation)[known]).all()
    agreeing = ((bounds > 0.0) & (bounds <= agreed)).sum(axis=0)
    assert (agreeing[known] >= 2).all()
    silent = (bounds > 0.0).sum(axis=0) < 2
    assert silent.any()
    assert not known[silent].any()


@pytest.mark.parametrize("seed", range(4))
def test_more_partners_that_must_agree_never_open_more_space(seed: int) -> None:
    bounds, value, deviation = layers(seed)
    fewer = stereo.agreed_bound(bounds, value, deviation, 1)
    more = stereo.agreed_bound(bounds, value, deviation, 2)
    assert (fewer[more > 0.0] > 0.0).all()
    assert (more[more > 0.0] >= fewer[more > 0.0]).all()


def test_a_near_edge_bounds_the_pixels_around_it_too() -> None:
    bounds = np.full((2, 21, 21), 0.2, np.float32)
    bounds[:, 10, 10] = 1.0
    agreed = stereo.agreed_bound(bounds, np.zeros((21, 21), np.float32), np.zeros((21, 21), np.float32), 2)
    expected = np.full((21, 21), 0.2, np.float32)
    expected[9:12, 9:12] = 1.0
    np.testing.assert_array_equal(agreed, expected)


def test_a_vehicle_smaller_than_a_voxel_is_refused_because_nothing_would_be_reached() -> None:
    with pytest.raises(InputError, match="carrier_radius_m"):
        DenseOptions(carrier_radius_m=0.0)
    with pytest.raises(InputError, match=r"at most 0\.115"):
        DenseOptions(voxel_m=0.12)
    DenseOptions(voxel_m=0.115)


NOWHERE = Grid.covering(-np.ones(3), np.full(3, 4.0), 0.05)


def path_along(views: list[ImageView], wall_x_m: float | None = None) -> np.ndarray:
    occupied = np.zeros(NOWHERE.shape, bool)
    if wall_x_m is not None:
        occupied[NOWHERE.index(np.array([[wall_x_m, 0.0, 0.0]]))[0, 0]] = True
    return surface.carried_path(views, 0.05, NOWHERE, occupied)


def test_the_way_between_two_images_is_free_only_if_they_are_near_each_other() -> None:
    places = [(0.0, 0.0, 0.0), (0.3, 0.0, 0.0), (1.2, 0.0, 0.0)]
    path = path_along([view_from(place) for place in places])
    np.testing.assert_allclose(sorted({round(x, 3) for x in path[:, 0]}), [*np.linspace(0.0, 0.3, 7), 1.2], atol=1e-9)
    other = dataclasses.replace(PINHOLE, name="backward")
    pair = [view_from(), dataclasses.replace(view_from((0.3, 1.0, 1.0)), camera=other)]
    assert len(path_along(pair)) == 2


def test_the_way_is_not_joined_past_missing_images_or_through_a_surface() -> None:
    def pair(second: int) -> list[ImageView]:
        places = [(0.0, 0.0, 0.0), (0.3, 0.0, 0.0)]
        return [dataclasses.replace(view_from(p), instant=i) for p, i in zip(places, (4, second), strict=True)]

    assert len(path_along(pair(5))) > 2
    assert len(path_along(pair(6))) == 2
    assert len(path_along(pair(5), wall_x_m=0.16)) == 2
    assert len(path_along(pair(5), wall_x_m=0.46)) > 2


@pytest.mark.parametrize(
    "options",
    [
        {"thinnest_m": np.nan},
        {"thinnest_m": -0.01},
        {"least_seen_through": 0},
        {"skin_voxels": -0.1},
        {"skin_voxels": np.nan},
    ],
)
def test_options_that_would_open_space_unasked_are_refused(options: dict) -> None:
    with pytest.raises(InputError, match=next(iter(options))):
        DenseOptions(**options)


def test_more_images_to_see_through_than_are_counted_are_refused() -> None:
    with pytest.raises(InputError, match="least_seen_through 256 must be 1 to 255"):
        DenseOptions(least_seen_through=256)
