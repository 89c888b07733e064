"""The distance volume: known planes and spheres come back, surfaces close, and what was not seen stays unknown."""

import dataclasses

import numpy as np
import pytest

from esdf import FREE, OCCUPIED, UNKNOWN, Grid
from flight import InputError, frames, rotations
from mapping.camera.rig import Camera
from mapping.dense import fusion, stereo, surface
from mapping.dense.confidence import SurfaceConfidence
from mapping.dense.surface import DenseOptions, ImageView
from tests.mapping.dense.volumes import filled, in_bricks, whole_volume

PINHOLE = Camera("depth", ".", "PINHOLE", 160, 120, np.array([120.0, 120.0, 80.0, 60.0]), np.eye(4))


def signed_volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)


@pytest.mark.parametrize("seed", range(5))
def test_marching_cubes_closes_around_any_matter_inside_the_volume(seed: int) -> None:
    """Every edge belongs to exactly two faces, run through in opposite senses; white noise meets all 256 cases."""
    distance = np.ones((14, 12, 13))
    distance[1:-1, 1:-1, 1:-1] = np.random.default_rng(seed).normal(size=(12, 10, 11))
    vertices, faces, *_ = filled(distance).surface(least_weight=0.5)
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).astype(np.int64)
    one_way, counts = np.unique(edges[:, 0] * len(vertices) + edges[:, 1], return_counts=True)
    other_way = np.unique(edges[:, 1] * len(vertices) + edges[:, 0])
    np.testing.assert_array_equal(one_way, other_way)
    assert counts.max() <= 2
    assert len(np.unique(faces)) == len(vertices)


def test_marching_cubes_finds_a_sphere_and_faces_free_space() -> None:
    radius, voxel_m = 1.0, 0.1
    grid = Grid((0.0, 0.0, 0.0), (voxel_m, voxel_m, voxel_m), (26, 26, 26))
    centres = grid.centre(np.argwhere(np.ones(grid.shape)))
    centre = np.array([1.31, 1.27, 1.3])
    volume = filled((np.linalg.norm(centres - centre, axis=1) - radius).reshape(grid.shape))
    vertices, faces, *_ = volume.surface(least_weight=0.5)
    assert np.abs(np.linalg.norm(vertices - centre, axis=1) - radius).max() < 0.002
    assert signed_volume(vertices - centre, faces) == pytest.approx(4 / 3 * np.pi, rel=0.01)


def test_no_surface_is_drawn_where_a_corner_was_not_seen() -> None:
    distance = np.broadcast_to(np.linspace(0.45, -0.45, 10)[:, None, None], (10, 8, 8)).copy()
    holed, weight = filled(distance), np.ones(distance.shape)
    assert len(holed.surface(least_weight=0.5)[1]) == 2 * 7 * 7
    weight[5, 4, 4] = 0.0
    holed.weight[...] = in_bricks(weight)
    assert len(holed.surface(least_weight=0.5)[1]) == 2 * (7 * 7 - 4)
    weight[5:] = 0.0
    holed.weight[...] = in_bricks(weight)
    assert len(holed.surface(least_weight=0.5)[1]) == 0
    assert (holed.occupancy(least_seen_through=3, skin_voxels=0.87)[5:] == UNKNOWN).all()


def plane_view(tilt_rad: float, distance_m: float = 2.0) -> tuple[ImageView, np.ndarray, np.ndarray]:
    """A depth camera at (0.5, 0.2, 1) looking along world x at a plane: view, depth, plane normal (world)."""
    T = np.eye(4)
    T[:3, :3] = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    T[:3, 3] = [0.5, 0.2, 1.0]
    view = ImageView(PINHOLE, T, np.full((120, 160), 90, np.uint8))
    normal_camera = np.array([np.sin(tilt_rad), 0.0, -np.cos(tilt_rad)])
    rays = stereo.depth_rays(view, 1.0)
    along = -distance_m * np.cos(tilt_rad) / (rays @ normal_camera)
    return view, along * rays[..., 2], T[:3, :3] @ normal_camera


@pytest.mark.parametrize("tilt_deg", [0.0, 25.0, -50.0])
def test_a_plane_seen_by_a_depth_camera_comes_back(tilt_deg: float) -> None:
    view, depth_m, normal = plane_view(np.radians(tilt_deg))
    depth = stereo.depth_from_sensor(view, depth_m)
    result = surface.reconstruct([view], DenseOptions(least_component_faces=10), depths=[depth])
    offset = (result.vertices_world_m - view.position_world_m - [2.0, 0.0, 0.0]) @ normal
    assert np.abs(offset).max() < 0.01
    assert np.median(np.abs(offset)) < 0.002
    corners = result.vertices_world_m[result.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (normals @ normal > 0.0).all()
    assert (result.colours == 90).all()


@pytest.mark.parametrize("tilt_deg", [0.0, 40.0])
def test_space_is_free_before_a_plane_occupied_at_it_and_unknown_behind(tilt_deg: float) -> None:
    view, depth_m, normal = plane_view(np.radians(tilt_deg))
    depth = stereo.depth_from_sensor(view, depth_m, relative_std=0.005)
    result = surface.reconstruct([view], DenseOptions(least_component_faces=10, least_seen_through=1), depths=[depth])
    cells = np.argwhere(result.state >= 0)
    centres, state = result.grid.centre(cells), result.state.ravel()
    before_m = (centres - view.position_world_m - [2.0, 0.0, 0.0]) @ normal
    at_camera = frames.apply(frames.invert(view.T_world_camera), centres)
    pixels = PINHOLE.project(at_camera)
    seen = (np.abs(pixels - [80.0, 60.0]) < [60.0, 39.0]).all(axis=1) & (at_camera[:, 2] > 0.2)
    assert (state[seen & (before_m > 0.15)] == FREE).all()
    assert (state[seen & (np.abs(before_m) < 0.04)] == OCCUPIED).all()
    assert (state[before_m < -0.2] == UNKNOWN).all()
    flown = np.linalg.norm(at_camera, axis=1) <= DenseOptions().carrier_radius_m - result.grid.half_diagonal_m
    assert (state[flown] == FREE).all()
    unobserved = (~PINHOLE.contains(pixels) | (at_camera[:, 2] < 0.0)) & ~flown
    assert (state[unobserved] == UNKNOWN).all()


def test_where_a_thin_obstacle_could_be_missing_space_is_not_free_if_that_is_asked() -> None:
    view, depth_m, _ = plane_view(0.0)
    depth = stereo.depth_from_sensor(view, depth_m, relative_std=0.005)
    options = DenseOptions(least_component_faces=10, least_seen_through=1)
    usual = surface.reconstruct([view], options, depths=[depth])
    careful = surface.reconstruct([view], dataclasses.replace(options, thinnest_m=0.06), depths=[depth])
    changed = usual.state != careful.state
    assert changed.any()
    assert (usual.state[changed] == FREE).all()
    assert (careful.state[changed] == UNKNOWN).all()
    free = careful.grid.centre(np.argwhere(careful.state == FREE))
    flown = np.linalg.norm(free - view.position_world_m, axis=1) <= options.carrier_radius_m
    assert not flown.all()
    assert not careful.seen.could_hide(free[~flown], 0.06).any()


def test_facing_is_the_cosine_of_incidence() -> None:
    tilt = np.radians(35.0)
    view, depth_m, normal = plane_view(tilt)
    rays = stereo.depth_rays(view, 1.0)
    expected = np.abs(rays @ view.T_world_camera[:3, :3].T @ normal)
    found = stereo.depth_from_sensor(view, depth_m).facing
    np.testing.assert_allclose(found, expected, atol=2e-3)


def test_pixels_beside_a_jump_of_depth_are_dropped_and_others_kept() -> None:
    inverse_range = np.full((40, 40), 0.5, np.float32)
    inverse_range[:, 20:] = 0.25
    inverse_range[5, 5] = 0.0
    kept = stereo.without_jumps(inverse_range) > 0.0
    expected = np.ones((40, 40), bool)
    expected[:, 18:22] = False
    expected[5, 5] = False
    np.testing.assert_array_equal(kept, expected)


def test_averaging_weights_measurements_by_their_inverse_variance() -> None:
    near, far = (plane_view(0.0, distance) for distance in (2.00, 2.04))
    volume = whole_volume(Grid.covering([0.4, -1, 0], [3, 1.4, 2], 0.05), truncation_m=0.2)
    for (view, depth_m, _), relative_std in ((near, 0.02), (far, 0.04)):
        depth = stereo.depth_from_sensor(view, depth_m, relative_std=relative_std)
        volume.integrate(view, depth.inverse_range, depth.deviation, depth.facing, farthest_m=5.0)
    vertices, *_ = volume.surface(least_weight=0.01)
    weight = [1.0 / ((2.0 * 0.02) ** 2 + 0.01**2), 1.0 / ((2.04 * 0.04) ** 2 + 0.01**2)]
    expected = 0.5 + (2.0 * weight[0] + 2.04 * weight[1]) / sum(weight)
    middle = np.abs(vertices[:, 1:] - [0.2, 1.0]).max(axis=1) < 0.5
    assert vertices[middle, 0].mean() == pytest.approx(expected, abs=2e-3)


def test_a_tube_about_a_path_holds_the_voxels_that_lie_wholly_in_it() -> None:
    grid = Grid((0.0, 0.0, 0.0), (0.05, 0.05, 0.05), (40, 40, 40))
    path = np.array([[1.0, 1.0, 1.0], [1.2, 1.01, 1.02], [5.0, 5.0, 5.0]])
    near = fusion.within(grid, path, 0.2)
    low = grid.centre(np.argwhere(np.ones(grid.shape))) - 0.025
    corners = low[:, None] + 0.05 * np.array(list(np.ndindex(2, 2, 2)))
    farthest = np.linalg.norm(corners[:, :, None] - path, axis=3).max(axis=1).min(axis=1)
    np.testing.assert_array_equal(near.ravel(), farthest <= 0.2)
    assert near.any()


@pytest.mark.parametrize("radius_m", [0.2, 0.6, 1.5])
def test_what_the_carrier_swept_is_free_and_no_surface_is_erased(radius_m: float) -> None:
    view, depth_m, _ = plane_view(0.0, distance_m=1.0)
    depth = stereo.depth_from_sensor(view, depth_m, relative_std=0.005)
    options = DenseOptions(least_component_faces=10, least_seen_through=1)
    usual = surface.reconstruct([view], options, depths=[depth])
    swept = surface.reconstruct([view], dataclasses.replace(options, carrier_radius_m=radius_m), depths=[depth])
    np.testing.assert_array_equal(usual.state == OCCUPIED, swept.state == OCCUPIED)
    near = fusion.within(swept.grid, view.position_world_m[None], radius_m)
    changed = usual.state != swept.state
    assert (changed == (near & (usual.state == UNKNOWN) & (swept.state == FREE))).all()
    occupied_m3 = float((near & (swept.state == OCCUPIED)).sum()) * options.voxel_m**3
    assert swept.swept_occupied_m3 == pytest.approx(occupied_m3)
    assert (occupied_m3 > 0.0) == (radius_m > 1.0)


def test_small_components_are_dropped() -> None:
    distance = np.ones((20, 20, 20))
    distance[3:12, 3:12, 3:12] = -1.0
    distance[17, 17, 17] = -1.0
    vertices, faces, colours, _ = filled(distance).surface(least_weight=0.5)
    known = SurfaceConfidence(vertices[:, 0].astype(np.float32), np.ones(len(vertices), np.uint8))
    mesh = vertices, faces, colours, known
    vertices, faces, colours, known = surface.without_small_components(*mesh, least_faces=50)
    assert len(faces) == len(mesh[1]) - 8
    assert vertices.max() < 1.5
    assert len(np.unique(faces)) == len(vertices) == len(colours)
    np.testing.assert_array_equal(known.deviation_m, vertices[:, 0].astype(np.float32))


def test_an_image_of_another_size_than_its_camera_is_refused() -> None:
    with pytest.raises(InputError, match=r"\(120, 160\)"):
        ImageView(PINHOLE, np.eye(4), np.zeros((60, 80), np.uint8))
    view, depth_m, _ = plane_view(0.0)
    with pytest.raises(InputError, match="does not fit"):
        stereo.depth_from_sensor(view, depth_m[:90])


def test_turning_and_moving_everything_turns_and_moves_the_surface() -> None:
    """Same answer in any world frame, up to the grid: vertices stay on the moved plane."""
    view, depth_m, normal = plane_view(np.radians(20.0))
    T = frames.transform(rotations.exp(np.array([0.3, -0.5, 0.8])), np.array([3.0, -2.0, 1.0]))
    moved = dataclasses.replace(view, T_world_camera=T @ view.T_world_camera)
    depth = stereo.depth_from_sensor(view, depth_m)
    result = surface.reconstruct([moved], DenseOptions(least_component_faces=10), depths=[depth])
    offset = (frames.apply(frames.invert(T), result.vertices_world_m) - view.position_world_m - [2.0, 0, 0]) @ normal
    assert np.abs(offset).max() < 0.015


def test_a_hall_that_does_not_fit_is_known_by_its_recorded_places_however_they_are_turned() -> None:
    corners = np.array(np.meshgrid([0.0, 100.0], [0.0, 50.0], [0.0, 10.0])).reshape(3, -1).T
    T = frames.transform(rotations.from_yaw(0.6), np.array([5.0, -3.0, 1.0]))
    turned = corners @ T[:3, :3].T + T[:3, 3]
    for places in (corners, turned, np.concatenate([corners, np.full((2, 3), np.nan)])):
        with pytest.raises(InputError, match=r"400 million voxels of 0.05 m, .* take --voxel 0.055"):
            fusion.require_room("recorded poses", places, 0.05)
        fusion.require_room("recorded poses", places, 0.055)
    fusion.require_room("recorded poses", corners * [1.0, 1.0, 0.0], 0.01)
    fusion.require_room("recorded poses", corners[:2], 0.01)
    fusion.require_room("recorded poses", np.full((9, 3), np.nan), 0.01)
