"""What points make of space: scans of a room with a pillar by rays whose ends are known in closed form."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from esdf import FREE, OCCUPIED, UNKNOWN, Grid, observe
from flight import FloatArray, InputError
from mapping.cloud import occupancy
from mapping.cloud.point_cloud import PointCloud

LOW, HIGH = np.array([0.0, 0.0, 0.0]), np.array([4.0, 3.0, 2.0])
PILLAR, RADIUS_M = np.array([2.0, 1.5]), 0.3
NOWHERE = np.zeros((0, 3))


def scan(origin: FloatArray, count: int, seed: int = 0) -> FloatArray:
    """(count, 3) where rays of random directions end."""
    way = np.random.default_rng(seed).normal(size=(count, 3))
    way /= np.linalg.norm(way, axis=1)[:, None]
    length = np.where(way > 0.0, HIGH - origin, LOW - origin) / way
    a = (way[:, :2] ** 2).sum(axis=1)
    b = way[:, :2] @ (origin[:2] - PILLAR)
    inside = b**2 - a * (((origin[:2] - PILLAR) ** 2).sum() - RADIUS_M**2)
    with np.errstate(invalid="ignore"):
        to_pillar = (-b - np.sqrt(inside)) / a
    to_pillar[~(to_pillar > 0.0)] = np.inf
    return origin + way * np.minimum(length.min(axis=1), to_pillar)[:, None]


def cloud(points: FloatArray, origins: FloatArray | None = None) -> PointCloud:
    return PointCloud(points, None if origins is None else np.broadcast_to(origins, points.shape), 0, "m", "z", None)


def carved(found: PointCloud, voxel_m: float = 0.1, observed: FloatArray = NOWHERE, gap_m: float = 0.2, least: int = 1):
    return occupancy.carve(found, voxel_m, observed_world_m=observed, gap_m=gap_m, least_points=least)


def state_at(space: object, points: FloatArray) -> FloatArray:
    return space.state[tuple(space.grid.index(points).T)]  # type: ignore[attr-defined]


def test_points_are_occupied_and_nothing_else_is() -> None:
    points = scan(np.array([1.0, 1.0, 1.0]), 5000)
    space = carved(cloud(points)).space
    assert (state_at(space, points) == OCCUPIED).all()
    assert (space.state == OCCUPIED).sum() == len(np.unique(space.grid.index(points), axis=0))
    assert (space.state == FREE).sum() == 0


@settings(max_examples=15)
@given(st.integers(0, 10_000), st.tuples(st.floats(0.3, 1.5), st.floats(0.2, 2.8), st.floats(0.2, 1.8)))
def test_a_ray_never_frees_beyond_its_point(seed, origin):
    eye = np.array(origin)
    points = scan(eye, 400, seed)
    space = carved(cloud(points, eye)).space
    centres = space.grid.centre(np.argwhere(space.state == FREE))
    reach = space.grid.half_diagonal_m
    # Some ray comes within reach of each free voxel before its end.
    way = points - eye
    share = np.clip((centres - eye) @ way.T / (way**2).sum(axis=1), 0.0, 1.0)
    off_m = np.linalg.norm(eye + share[:, :, None] * way - centres[:, None], axis=2)
    assert (off_m.min(axis=1) <= reach + 1e-9).all()
    assert (centres > LOW - reach).all()
    assert (centres < HIGH + reach).all()
    assert (np.linalg.norm(centres[:, :2] - PILLAR, axis=1) > RADIUS_M - reach).all()


def test_behind_the_pillar_is_unknown_until_a_second_scan_sees_it() -> None:
    one, two = np.array([0.7, 1.5, 1.0]), np.array([3.3, 1.5, 1.0])
    behind = np.array([[2.6, 1.5, 1.0], [2.9, 1.55, 1.1]])
    first, second = scan(one, 60_000), scan(two, 60_000, 1)
    assert (state_at(carved(cloud(first, one)).space, behind) == UNKNOWN).all()
    both = carved(cloud(np.concatenate([first, second]), np.repeat([one, two], 60_000, axis=0)))
    assert (state_at(both.space, behind) == FREE).all()
    assert both.stopped < 0.02 * both.rays
    inside = np.array([[2.0, 1.5, 1.0]])
    assert (state_at(both.space, inside) == UNKNOWN).all()
    # Of the room's free space, but for the pillar, most is found.
    volume_m3 = np.prod(HIGH - LOW) - np.pi * RADIUS_M**2 * HIGH[2]
    assert both.space.volume_m3(FREE) == pytest.approx(volume_m3, rel=0.15)


def test_a_sensor_that_was_elsewhere_frees_nothing_behind_a_surface_and_is_refused() -> None:
    points = scan(np.array([0.7, 1.5, 1.0]), 60_000)
    with pytest.raises(InputError, match="the sensor was elsewhere"):
        carved(cloud(points, np.array([-0.6, 1.5, 1.0])))
    grid = Grid.covering([-1.0, -1.0, -1.0], [6.0, 4.0, 3.0], 0.1)
    state = np.zeros(grid.shape, np.uint8)
    state[tuple(grid.index(points).T)] = OCCUPIED
    outside = np.broadcast_to([-0.6, 1.5, 1.0], points.shape)
    reached_m = observe.free_visible(state, points, outside, grid)
    centres = grid.centre(np.argwhere(state == FREE))
    assert len(centres) > 0
    within = ((centres > LOW + 0.1) & (centres < HIGH - 0.1)).all(axis=1)
    assert within.mean() < 0.02  # through holes between points alone
    assert np.isfinite(reached_m).mean() > 0.6


def test_fewer_points_than_the_least_neither_occupy_nor_stop_a_ray() -> None:
    eye = np.array([0.55, 0.55, 0.55])
    wall = np.array([[3.05, 0.55, 0.55]] * 3)
    speck = np.array([[1.55, 0.55, 0.55]])
    points = np.concatenate([wall, speck])
    for least, expected, beyond in ((1, OCCUPIED, UNKNOWN), (2, FREE, FREE)):
        found = carved(cloud(np.concatenate([points, [[0.55, 3.05, 0.55]] * 9]), eye), least=least)
        assert state_at(found.space, speck) == expected
        assert state_at(found.space, np.array([[2.05, 0.55, 0.55]])) == beyond
        assert state_at(found.space, wall[:1]) == OCCUPIED
        assert found.stopped == (3 if least == 1 else 0)
    assert state_at(carved(cloud(points), least=2).space, speck) == UNKNOWN
    with pytest.raises(InputError, match="the most are 3"):
        carved(cloud(points), least=4)


def test_a_point_without_a_known_sensor_occupies_and_frees_nothing() -> None:
    points = np.array([[3.05, 0.55, 0.55], [0.55, 3.05, 0.55]])
    origins = np.array([[0.55, 0.55, 0.55], [np.nan] * 3])
    found = carved(PointCloud(points, origins, 0, "m", "z", None))
    assert found.rays == 1
    assert (state_at(found.space, points) == OCCUPIED).all()
    free = found.space.grid.centre(np.argwhere(found.space.state == FREE))
    assert np.abs(free[:, 1:] - 0.55).max() < 0.06


def box_with_hole(hole_m: float) -> FloatArray:
    """Points 4 cm apart on the sides of a box of 2 m, one of which has a square hole."""
    steps = np.arange(0.0, 2.001, 0.04)
    u, v = (a.ravel() for a in np.meshgrid(steps, steps))
    sides = [np.insert(np.stack([u, v], axis=1), axis, at, axis=1) for axis in range(3) for at in (0.0, 2.0)]
    points = np.concatenate(sides)
    hole = (points[:, 0] == 2.0) & (np.abs(points[:, 1:] - 1.0) < 0.5 * hole_m).all(axis=1)
    return points[~hole]


def test_a_place_frees_what_no_hole_as_wide_as_the_gap_leads_to() -> None:
    inside = np.array([[1.0, 1.0, 1.0]])
    for voxel_m in (0.03, 0.05):
        for hole_m, gap_m, leaks in ((0.0, 0.06, False), (0.14, 0.3, False), (0.5, 0.2, True)):
            points = np.concatenate([box_with_hole(hole_m), [[3.0, 1.0, 1.0]]])
            space = carved(cloud(points), voxel_m, inside, gap_m).space
            assert (state_at(space, np.array([[2.5, 1.0, 1.0]])) == FREE) == leaks
            assert state_at(space, inside) == FREE


def test_what_a_place_frees_is_half_the_gap_away_from_every_point() -> None:
    points = box_with_hole(0.0)
    space = carved(cloud(points), 0.05, np.array([[1.0, 1.0, 1.0]]), 0.3).space
    corners = np.stack(np.meshgrid(*[[-0.025, 0.025]] * 3), axis=-1).reshape(-1, 3)
    free = (space.grid.centre(np.argwhere(space.state == FREE))[:, None] + corners).reshape(-1, 3)
    nearest_m = np.minimum(free, 2.0 - free).min(axis=1)
    assert 0.15 - 1e-9 <= nearest_m.min() < 0.26
    with pytest.raises(InputError, match=r"within 0\.15 m of points"):
        carved(cloud(points), 0.05, np.array([[0.1, 1.0, 1.0]]), 0.3)
    with pytest.raises(InputError, match="outside of the cloud's box"):
        carved(cloud(points), 0.05, np.array([[9.0, 1.0, 1.0]]), 0.3)


def test_too_many_voxels_are_refused_with_a_size_that_fits() -> None:
    with pytest.raises(InputError, match="take --voxel"):
        carved(cloud(np.array([[0.0, 0.0, 0.0], [30.0, 30.0, 30.0]])), 0.03)


@settings(max_examples=20)
@given(st.integers(0, 10_000))
def test_the_surface_encloses_what_is_occupied_and_faces_outward(seed):
    rng = np.random.default_rng(seed)
    state = (OCCUPIED * (rng.random((4, 5, 3)) < 0.4)).astype(np.uint8)
    state[0, 0, 0] = OCCUPIED
    grid = Grid((1.0, -2.0, 0.5), (0.1, 0.1, 0.1), state.shape)
    space = occupancy.Space(grid, state)
    vertices, faces, side_m = occupancy.surface(space)
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    assert side_m == 0.1
    assert mesh.volume == pytest.approx(space.volume_m3(OCCUPIED))
    for step, occupied in ((0.03, False), (-0.03, True)):
        beside = grid.index(mesh.triangles_center + step * mesh.face_normals)
        assert ((np.pad(state, 1) == OCCUPIED)[tuple(beside.T + 1)] == occupied).all()


def test_a_surface_of_too_many_sides_is_coarser_and_covers_it(monkeypatch: pytest.MonkeyPatch) -> None:
    state = (OCCUPIED * (np.random.default_rng(0).random((9, 9, 9)) < 0.3)).astype(np.uint8)
    space = occupancy.Space(Grid((0.0, 0.0, 0.0), (0.1, 0.1, 0.1), state.shape), state)
    monkeypatch.setattr(occupancy, "MOST_SIDES", 300)
    vertices, faces, side_m = occupancy.surface(space)
    assert side_m in (0.2, 0.4)
    assert len(faces) <= 600
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    assert mesh.volume >= space.volume_m3(OCCUPIED)
