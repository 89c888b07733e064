"""Plain walls: recovered from the measured surface round them, marked as inferred, and never where there is room."""

import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from esdf import FREE, OCCUPIED, UNKNOWN, Grid
from esdf.solids import Box, Room, Scene
from flight import FloatArray, frames, rotations
from goshawk.rendered import world as rendered_world
from goshawk.rendered.scene import RenderedScene
from mapping.dense import planes, stereo, surface
from mapping.dense.planes import Plane
from mapping.dense.views import ImageView

WALL_X_M, DOOR_M, DOOR_TOP_M = 3.0, (0.6, 1.5), 2.0
HALF_WIDTH_M, HEIGHT_M = 2.5, 2.6
MATTER_M = 0.10


def rooms() -> RenderedScene:
    """A plain wall with a poster, a skirting board and a framed doorway between two papered rooms."""
    low, high = DOOR_M
    thick, front = (WALL_X_M, WALL_X_M + 0.1), WALL_X_M - 0.01
    return RenderedScene((
        (Room((-1.0, -HALF_WIDTH_M, 0.0), (6.0, HALF_WIDTH_M, HEIGHT_M)), "plaster"),
        (Box((thick[0], -HALF_WIDTH_M, 0.0), (thick[1], low, HEIGHT_M)), "plain"),
        (Box((thick[0], high, 0.0), (thick[1], HALF_WIDTH_M, HEIGHT_M)), "plain"),
        (Box((thick[0], low, DOOR_TOP_M), (thick[1], high, HEIGHT_M)), "plain"),
        (Box((front, -1.5, 0.9), (WALL_X_M, -0.7, 1.7)), "brick"),
        (Box((front, -HALF_WIDTH_M, 0.0), (WALL_X_M, low, 0.15)), "wood"),
        (Box((front, low - 0.12, 0.0), (WALL_X_M, low, DOOR_TOP_M)), "wood"),
        (Box((front, high, 0.0), (WALL_X_M, high + 0.12, DOOR_TOP_M)), "wood"),
    ))  # fmt: skip


@pytest.fixture(scope="module")
def seen() -> surface.Reconstruction:
    """What 14 images of 320x240 show of them, with true poses, and true depth but on the plain wall."""
    camera, scene = rendered_world.default_rig(0.5).cameras[0], rooms()
    plain = Scene([solid for solid, paint in scene.painted if paint == "plain"])
    steps = np.arange(14)
    at = np.column_stack([0.5 + 0.3 * np.cos(steps), np.linspace(-1.3, 1.3, len(steps)), 1.3 + 0.2 * np.sin(2 * steps)])
    views, depths = [], []
    for k, pose in enumerate(frames.transform(rotations.from_yaw(0.15 * np.cos(steps)), at)):
        image = rendered_world.render(camera, pose, scene=scene, seed=k)
        view = ImageView(camera, pose @ camera.T_body_camera, image)
        rays = stereo.depth_rays(view, 0.5)
        along = rays.reshape(-1, 3) @ view.T_world_camera[:3, :3].T
        range_m = rendered_world.cast_rays(scene, view.position_world_m, np.nan_to_num(along))
        met = view.position_world_m + np.where(np.isfinite(range_m), range_m, 0.0)[:, None] * np.nan_to_num(along)
        measured = np.isfinite(range_m) & np.isfinite(along[:, 0]) & (np.abs(plain.distance(met)) > 1e-3)
        depth_m = np.where(measured, range_m * rays[..., 2].ravel(), 0.0).reshape(rays.shape[:2])
        views.append(view)
        depths.append(surface.depth_from_sensor(view, depth_m))
    return surface.reconstruct(views, depths=depths)


def states(seen: surface.Reconstruction, points: FloatArray) -> NDArray[np.uint8]:
    return seen.state[tuple(seen.grid.index(points).T)]


def face(y_m: tuple[float, float], z_m: tuple[float, float], x_m: float = WALL_X_M) -> FloatArray:
    y, z = np.meshgrid(np.arange(*y_m, 0.05), np.arange(*z_m, 0.05))
    return np.column_stack([np.full(y.size, x_m), y.ravel(), z.ravel()])


def test_a_plain_wall_is_recovered_between_a_poster_a_skirting_board_and_a_door_frame(
    seen: surface.Reconstruction,
) -> None:
    wall = face((-1.4, 0.4), (0.2, 1.6))
    measured = states(seen, wall) == OCCUPIED
    inferred = seen.inferred[tuple(seen.grid.index(wall).T)]
    assert measured.mean() < 0.6
    assert (measured | inferred).mean() > 0.85
    assert (states(seen, wall) != FREE).all()


def test_a_doorway_in_it_stays_open_and_free(seen: surface.Reconstruction) -> None:
    low, high = DOOR_M
    doorway = face((low + 0.2, high - 0.2), (0.6, DOOR_TOP_M - 0.3))
    assert (states(seen, doorway) == FREE).mean() > 0.8
    assert not seen.inferred[tuple(seen.grid.index(doorway).T)].any()


def test_only_unknown_voxels_near_matter_are_inferred(seen: surface.Reconstruction) -> None:
    assert (seen.state[seen.inferred] == UNKNOWN).all()
    distance_m = rooms().distance(seen.grid.centre(np.argwhere(seen.inferred)))
    assert (distance_m > MATTER_M).mean() < 0.02


def test_nothing_is_inferred_where_no_plane_is_found() -> None:
    grid, camera = Grid((0.0, 0.0, 0.0), (0.05, 0.05, 0.05), (8, 8, 8)), rendered_world.default_rig(0.25).cameras[0]
    grey = np.full((camera.height, camera.width), 128, np.uint8)
    nothing = np.zeros(grey.shape, np.float32)
    depth = stereo.DepthImage(nothing, nothing, nothing, nothing, 1.0)
    faces = np.array([[0, 1, 2]], np.int32)
    state, view = np.full(grid.shape, UNKNOWN, np.uint8), ImageView(camera, np.eye(4), grey)
    marked = planes.inferred(state, grid, 0.1 * np.eye(3), faces, [view], [depth], skin_voxels=1.0, farthest_m=8.0)
    assert marked.shape == grid.shape
    assert not marked.any()


def test_false_matches_behind_a_plain_wall_open_neither_the_wall_nor_what_is_behind_it() -> None:
    """Stereo past the wall at 2 m; with its matches taken at their word, 8 % of the wall is free."""
    camera, scene, steps = rendered_world.default_rig(0.5).cameras[0], rooms(), np.arange(10)
    at = np.column_stack([1.0 + 0.1 * np.cos(1.7 * steps), 0.2 * (steps - 4.5), 1.3 + 0.1 * np.sin(2.3 * steps)])
    poses = frames.transform(rotations.from_yaw(np.zeros(len(steps))), at)
    images = [rendered_world.render(camera, pose, scene=scene, seed=k) for k, pose in enumerate(poses)]
    views = [ImageView(camera, pose @ camera.T_body_camera, image) for pose, image in zip(poses, images, strict=True)]
    found = surface.reconstruct(views)
    wall = face((-2.4, 0.45), (0.25, 2.4))
    behind = [states(found, wall + np.array([depth_m, 0.0, 0.0])) for depth_m in (0.1, 0.2, 0.3)]
    assert (np.array(behind) == OCCUPIED).mean() > 0.1  # the false matches
    assert (states(found, wall) != FREE).all()
    assert (behind[0] != FREE).all()
    assert (scene.distance(found.grid.centre(np.argwhere(found.state == FREE))) > 0.0).all()


def flat(state: NDArray[np.uint8], support: NDArray[np.bool_]) -> Plane:
    return Plane(np.eye(4), support, support, 0.05)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_what_is_inferred_of_a_plane_was_unknown_and_lies_within_the_hull_of_its_measured_part(seed: int) -> None:
    from scipy.spatial import Delaunay

    rng = np.random.default_rng(seed)
    state = rng.choice([UNKNOWN, FREE], (24, 18), p=[0.9, 0.1]).astype(np.uint8)
    support = rng.random(state.shape) < 0.1
    support[rng.integers(8, 24) :] = False
    state[support] = OCCUPIED
    marked = planes.enclosed_cells(flat(state, support), state)
    assert (state[marked] == UNKNOWN).all()
    if support.sum() > 3 and marked.any():
        assert (Delaunay(np.argwhere(support)).find_simplex(np.argwhere(marked)) >= 0).all()


def test_a_plane_is_not_extended_past_a_free_corner_nor_into_an_open_notch() -> None:
    state = np.full((40, 40), UNKNOWN, np.uint8)
    support = np.zeros(state.shape, bool)
    support[5, 5:35] = support[5:35, 5] = support[34, 5:20] = support[5:20, 34] = True  # a frame, open at a corner
    state[20:35, 20:35] = FREE
    state[support] = OCCUPIED
    marked = planes.enclosed_cells(flat(state, support), state)
    assert marked[6:12, 6:12].all()
    assert not marked[20:, 20:].any()
    assert not marked[36:].any()
    assert not marked[:, 36:].any()
    state[20:, 20:] = UNKNOWN  # not seen either, and nothing bounds it
    assert not planes.enclosed_cells(flat(state, support), state)[21:, 21:].any()


def patch(normal: FloatArray, rng: np.random.Generator, lean_rad: float = 0.0) -> tuple[FloatArray, FloatArray]:
    """Noisy points of 2 x 2 m round (1, 2, 3), leaning by an angle, and their noisy normals."""
    along = np.cross(normal, [0.3, 0.2, 0.9])
    along /= np.linalg.norm(along)
    if normal[2] == 0.0:
        along = np.cross([0.0, 0.0, 1.0], normal)
    normal = np.cos(lean_rad) * normal + np.sin(lean_rad) * np.cross(along, normal)
    axes = np.stack([along, np.cross(normal, along)])
    points = np.array([1.0, 2.0, 3.0]) + rng.uniform(-1.0, 1.0, (4000, 2)) @ axes
    points += rng.normal(0.0, 0.01, (len(points), 1)) * normal
    directions = normal + rng.normal(0.0, 0.1, points.shape)
    return points, directions / np.linalg.norm(directions, axis=1, keepdims=True)


def ball(rng: np.random.Generator) -> FloatArray:
    outwards = rng.normal(size=(4000, 3))
    return outwards / np.linalg.norm(outwards, axis=1, keepdims=True)


@pytest.mark.parametrize("normal", [(0.8, -0.6, 0.0), (-0.28, -0.96, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)])
def test_upright_and_level_planes_are_found_among_noise(normal: tuple[float, float, float]) -> None:
    rng = np.random.default_rng(1)
    points, directions = patch(np.array(normal), rng)
    noise = ball(rng)
    found = planes.planes(np.vstack([points, 0.4 * noise]), np.vstack([directions, noise]), 0.05)
    assert len(found) == 1
    assert found[0].normal @ normal > np.cos(np.radians(0.5))
    assert found[0].normal[2] == normal[2]  # exactly
    assert abs((found[0].T_world_plane[:3, 3] - [1.0, 2.0, 3.0]) @ normal) < 0.005
    assert found[0].patches.sum() * 0.05**2 == pytest.approx(4.0, rel=0.15)


def test_no_plane_is_found_in_a_ball_nor_in_a_ramp() -> None:
    noise = ball(np.random.default_rng(1))
    assert planes.planes(0.4 * noise, noise, 0.05) == []
    assert planes.planes(*patch(np.array([0.6, -0.64, 0.48]), np.random.default_rng(1)), 0.05) == []


@pytest.mark.parametrize(("lean_deg", "is_found"), [(3.0, True), (-3.0, True), (7.0, False)])
def test_a_wall_of_a_map_that_leans_a_little_is_taken_for_upright(lean_deg: float, is_found: bool) -> None:
    points, directions = patch(np.array([0.8, -0.6, 0.0]), np.random.default_rng(1), np.radians(lean_deg))
    found = planes.planes(points, directions, 0.05)
    assert bool(found) == is_found
    for plane in found:
        assert plane.normal[2] == 0.0
        assert plane.normal @ [0.8, -0.6, 0.0] > np.cos(np.radians(1.0))


def test_normals_become_upright_or_level_whichever_is_nearer() -> None:
    normals = np.array([[0.6, -0.64, 0.48], [0.0, 0.6, -0.8], [0.0, 0.0, 1.0], [-0.28, 0.96, 0.0]])
    expected = [[0.6 / np.hypot(0.6, 0.64), -0.64 / np.hypot(0.6, 0.64), 0.0], [0.0, 0.0, -1.0], *normals[2:]]
    np.testing.assert_allclose(planes._upright_or_level(normals), expected, atol=1e-12)


def test_surface_is_of_a_plane_within_one_and_a_half_voxels() -> None:
    points, normals = np.array([[0.0, 0.0, 0.0], [0.2, 0.0, 0.07], [0.4, 0.0, 0.08]]), np.tile([0.0, 0.0, 1.0], (3, 1))
    plane = planes._with_cells(points, normals, points[0], normals[0], 0.05)
    assert plane is not None
    assert plane.support.sum() == 2


@pytest.mark.parametrize(("own_sides", "expected"), [((0,), False), ((0, 1), False), ((0, 2), True), ((0, 4), True)])
def test_other_surface_may_enclose_a_plane_but_for_two_sides(own_sides: tuple[int, ...], expected: bool) -> None:
    state, support = np.full((21, 21), UNKNOWN, np.uint8), np.zeros((21, 21), bool)
    sides = [(10 + 8 * x, 10 + 8 * y) for x, y in planes._DIRECTIONS]
    for number, side in enumerate(sides):
        state[side] = OCCUPIED
        support[side] = number in own_sides
    assert planes.enclosed_cells(flat(state, support), state)[10, 10] == expected


def test_cells_on_the_outer_face_of_the_grid_have_the_states_of_the_last_voxels() -> None:
    grid = Grid((0.0, 0.0, 0.0), (0.05, 0.05, 0.05), (8, 6, 4))
    state = np.random.default_rng(0).choice([UNKNOWN, FREE, OCCUPIED], grid.shape).astype(np.uint8)
    T = np.eye(4)
    T[2, 3] = 0.2
    support = np.zeros((8, 6), bool)
    np.testing.assert_array_equal(planes._states(Plane(T, support, support, 0.05), state, grid), state[:, :, -1])


def long_wall(grid: Grid, voxel_m: float) -> Plane:
    """Upright, from corner to corner of a grid, as a map's axes need not be those of a building."""
    upright = rotations.from_matrix(np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]))
    turned = rotations.multiply(rotations.from_yaw(0.7), upright)
    T = frames.transform(turned, grid.low_world_m + np.array([0.1, 0.2, 0.3]))
    support = np.zeros((int(1.2 * grid.shape[0]), 30), bool)
    return Plane(T, support, support, voxel_m)


def test_the_voxels_of_plain_cells_are_those_with_their_centre_above_or_below_one() -> None:
    grid, skin_m = Grid((-1.0, 2.0, 0.5), (0.05, 0.05, 0.05), (40, 36, 30)), 0.87 * 0.05
    wall = long_wall(grid, 0.05)
    cells = np.random.default_rng(0).random(wall.support.shape) < 0.3
    marked = np.zeros(grid.shape, bool)
    planes._mark(marked, wall, cells, grid, skin_m)
    cell, height_m = wall.cells(grid.centres().reshape(-1, 3))
    over = ((cell >= 0) & (cell < cells.shape)).all(axis=1)
    expected = over & (np.abs(height_m) <= skin_m) & cells[tuple(np.where(over, cell.T, 0))]
    assert marked.sum() > 300
    np.testing.assert_array_equal(marked.ravel(), expected)


def test_a_long_wall_is_marked_without_a_look_at_the_whole_map() -> None:
    grid = Grid((0.0, 0.0, 0.0), (0.05, 0.05, 0.05), (300, 300, 40))
    wall, marked = long_wall(grid, 0.05), np.zeros(grid.shape, bool)
    tracemalloc.start()
    planes._mark(marked, wall, ~wall.support, grid, 0.87 * 0.05)
    most_bytes = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert marked.any()
    assert most_bytes < 0.1 * 8 * 3 * grid.voxels  # the centres of its voxels


def square_ahead(range_m: float, cells: int = 1) -> Plane:
    """A square of cells across the axis of a camera in the origin, facing it."""
    T = np.diag([1.0, -1.0, -1.0, 1.0])
    T[:3, 3] = [-0.025 * cells, 0.025 * cells, range_m]
    support = np.zeros((cells, cells), bool)
    return Plane(T, support, support, 0.05)


def look(
    *walls: Plane, inverse_range: float = 0.0, bound: float = 0.0, looks: int = 3, used: NDArray[np.bool_] | None = None
) -> list[bool]:
    """Whether each plane is inferred in the middle of grey images that look along z, each with the same depth."""
    camera = rendered_world.default_rig(0.25).cameras[0]
    grey = np.full((camera.height, camera.width), 128, np.uint8)
    some = np.full(grey.shape, 1.0, np.float32)
    view = ImageView(camera, np.eye(4), grey, used=used)
    depth = stereo.DepthImage(inverse_range * some, 0.0 * some, some, bound * some, 1.0)
    enclosed = [~wall.support for wall in walls]
    kept = planes._seen_plain(walls, enclosed, [view] * looks, [depth] * looks, 8.0)
    return [bool(cells[tuple(np.array(cells.shape) // 2)]) for cells in kept]


@pytest.mark.parametrize("masked", [False, True])
def test_what_is_masked_is_no_sight_of_a_plain_wall(masked: bool) -> None:
    camera = rendered_world.default_rig(0.25).cameras[0]
    used = np.full((camera.height, camera.width), not masked)
    assert look(square_ahead(2.0), used=used) == [not masked]


@pytest.mark.parametrize(("looks", "expected"), [(2, False), (3, True)])
def test_three_images_must_look(looks: int, expected: bool) -> None:
    assert look(square_ahead(2.0), looks=looks) == [expected]


@pytest.mark.parametrize(("nearer_m", "expected"), [(0.07, True), (0.09, False), (-0.07, True)])
def test_a_depth_confirms_a_plane_within_one_and_a_half_voxels(nearer_m: float, expected: bool) -> None:
    assert look(square_ahead(2.0), inverse_range=1.0 / (2.0 - nearer_m), bound=1.0) == [expected]


@pytest.mark.parametrize(("bound_m", "expected"), [(1.0, True), (2.1, True), (2.2, False)])
def test_a_match_behind_rules_out_only_what_it_excludes(bound_m: float, expected: bool) -> None:
    assert look(square_ahead(2.0), inverse_range=1.0 / 3.0, bound=1.0 / bound_m) == [expected]


def test_a_plain_region_shows_the_first_of_the_planes_on_its_rays() -> None:
    near, far = square_ahead(2.0, 21), square_ahead(3.0, 21)
    assert look(near, far) == [True, False]
    assert look(far, near) == [True, False]


def test_a_plane_seen_from_behind_shows_nothing_and_hides_nothing() -> None:
    back = square_ahead(3.0, 21)
    turned = np.eye(4)
    turned[:3, 3] = [-0.525, -0.525, 3.0]
    behind = Plane(turned, back.support, back.patches, 0.05)
    assert look(behind, square_ahead(2.0)) == [False, True]
    hides = planes._shown_instead(np.array([[0.0, 0.0, 2.0]]), np.zeros((1, 3)), [behind], [~behind.support])
    assert not np.any(hides)


def test_planes_a_voxel_apart_are_one_place() -> None:
    assert look(square_ahead(2.0, 21), square_ahead(2.1, 21)) == [True, True]


def test_a_plane_shown_by_few_images_of_many_is_ruled_out_by_those_that_see_through_it() -> None:
    """Beside the edge of what lies behind, some images see the plain region past it and some see through."""
    camera = rendered_world.default_rig(0.25).cameras[0]
    grey = np.full((camera.height, camera.width), 128, np.uint8)
    nothing = np.zeros(grey.shape, np.float32)
    depth = stereo.DepthImage(nothing, nothing, nothing, nothing, 1.0)
    walls = [square_ahead(3.0, 9), square_ahead(2.0, 1)]
    poses = [np.eye(4) for _ in range(7)]
    for k, aside_m in enumerate((1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0)):
        poses[k][0, 3] = aside_m
    for seen_through, expected in ((1, True), (2, False)):
        views = [ImageView(camera, pose, grey) for pose in poses[: 4 + seen_through]]
        kept = planes._seen_plain(walls, [~wall.support for wall in walls], views, [depth] * len(views), 8.0)
        assert kept[0][4, 4]
        assert kept[1][0, 0] == expected


def test_walls_come_before_floors_and_what_is_measured_most_first() -> None:
    def plane(normal_axis: int, measured: int) -> Plane:
        T = np.eye(4)
        T[:3, :3] = np.roll(np.eye(3), normal_axis + 1, axis=0)
        support = np.zeros((4, 4), bool)
        support.ravel()[:measured] = True
        return Plane(T, support, support, 0.05)

    floor, small, large = plane(2, 9), plane(0, 3), plane(1, 7)
    assert planes._strongest_first([small, floor, large]) == [large, small, floor]
