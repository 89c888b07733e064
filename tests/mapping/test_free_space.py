"""Free space in which an obstacle could hide: how thin, where along a path, and the field without such space."""

import itertools
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import esdf
import mapping
from esdf import FREE, OCCUPIED, UNKNOWN, Edit, Grid
from esdf.solids import Box, Room
from esdf.visibility import CouldHide, View, Visibility, look, save_visibility
from flight import InputError
from mapping import map_folder
from mapping.camera.rig import Rig
from mapping.free_space import THRESHOLD_M, FreeSpace, Shot, known_empty, shots
from tests.mapping.test_map_folder import RIG, made_map

GRID = Grid((-0.1,) * 3, (0.1,) * 3, (62, 42, 27))
ROOM = esdf.rasterize(Room((0.0, 0.0, 0.0), (6.0, 4.0, 2.5)), GRID)
VIEWS = [View((0.5, 2.0, 1.2), (1.0, 0.0, 0.0), 0.6, 1 / 300)]
NOTHING = np.zeros(GRID.shape, bool)


def room(empty: np.ndarray = NOTHING, seen: Visibility | None = None) -> FreeSpace:
    return FreeSpace(esdf.build(ROOM, GRID), look(ROOM, GRID, VIEWS, pixels=8.0) if seen is None else seen, empty)


def line(first: tuple[float, float, float], last: tuple[float, float, float]) -> tuple[np.ndarray, np.ndarray]:
    share = np.linspace(0.0, 1.0, 200)
    return 2.0 * share, np.array(first) + share[:, None] * (np.array(last) - first)


def everywhere(thickness_m: float) -> Visibility:
    seen = look(ROOM, GRID, VIEWS)
    return Visibility(seen.grid, np.full_like(seen.finest_m, thickness_m))


@given(thin=st.floats(0.001, 1.0), thick=st.floats(0.001, 1.0))
def test_the_thinner_the_obstacle_the_less_is_free_and_what_is_occupied_never_changes(thin, thick):
    thin, thick = sorted((thin, thick))
    space = room()
    careful, careless = space.resolving(thin).state, space.resolving(thick).state
    for state in (careful, careless):
        np.testing.assert_array_equal(state == OCCUPIED, ROOM == OCCUPIED)
        assert (state[state != ROOM] == UNKNOWN).all()
    assert not ((careful == FREE) & (careless != FREE)).any()


def test_where_all_is_resolved_the_field_is_that_of_the_map():
    space = room(seen=everywhere(0.02))
    assert space.resolving(0.02).hash == space.field.hash
    assert not (space.resolving(0.0199).state == FREE).any()
    for wrong in (0.0, -1.0, np.nan):
        with pytest.raises(InputError, match="positive"):
            space.resolving(wrong)


def test_a_path_in_the_stricter_field_is_one_along_which_no_such_obstacle_could_hide():
    space, reach_m = room(), 0.3
    rng = np.random.default_rng(3)
    points = rng.uniform((0.4, 0.4, 0.4), (5.6, 3.6, 2.1), (150, 3))
    verdicts = set()
    for thickness_m in (0.04, 0.08, 0.12):
        near = space.resolving(thickness_m).distance(points)
        for point, distance_m in zip(points, near, strict=True):
            found = space.along([0.0], point[None], reach_m)
            if abs(distance_m - reach_m) > 2.0 * GRID.half_diagonal_m:  # the field is exact at voxels' centres only
                in_map = space.field.distance(point[None])[0] > reach_m + 2.0 * GRID.half_diagonal_m
                clear = distance_m > reach_m
                assert found.thickness_m <= thickness_m or not clear
                assert found.thickness_m > thickness_m or clear or not in_map
                verdicts.add(clear)
    assert verdicts == {True, False}


def test_the_worst_place_and_the_share_of_the_way_are_those_of_a_known_patch():
    seen = everywhere(0.01)
    x = seen.grid.centres()[..., 0]
    seen.finest_m[(x > 3.0) & (x < 3.8)] = 0.05  # two slabs of the mask, each 0.4 m: 3.1 to 3.9 m
    seen.finest_m[15:] = 0.01
    thick = np.flatnonzero(seen.finest_m[:, 0, 0] > THRESHOLD_M)
    low = seen.grid.low_world_m[0] + 0.4 * thick[0]
    high = seen.grid.low_world_m[0] + 0.4 * (thick[-1] + 1)
    found = room(seen=seen).along(*line((1.0, 2.0, 1.2), (5.0, 2.0, 1.2)), 0.3)
    assert found.thickness_m == pytest.approx(0.05)
    assert low <= found.point_world_m[0] <= high
    assert found.length_share == pytest.approx((high - low + 0.6) / 4.0, abs=0.02)
    assert found.time_s == pytest.approx(2.0 * (low - 0.3 - 1.0) / 4.0, abs=0.4)
    assert found.as_dict()["thickness_m"] == pytest.approx(0.05)
    assert "50 mm" in found.describe()


def test_where_no_image_looked_anything_could_hide_and_nothing_where_the_carrier_was():
    behind = line((0.3, 0.5, 1.2), (0.3, 0.9, 1.2))
    found = room().along(*behind, 0.25)
    assert found.unobserved
    assert found.as_dict()["thickness_m"] is None
    assert found.length_share == 1.0
    assert "any thickness" in found.describe()
    swept = room(empty=np.ones(GRID.shape, bool)).along(*behind, 0.25)
    assert (swept.thickness_m, swept.length_share) == (0.0, 0.0)
    assert "no obstacle" in swept.describe()


def test_a_longer_reach_never_finds_less():
    path = line((1.5, 2.0, 1.2), (4.5, 2.2, 1.2))
    found = [room().along(*path, reach_m) for reach_m in (0.05, 0.2, 0.4, 0.8)]
    assert [f.thickness_m for f in found] == sorted(f.thickness_m for f in found)
    assert [f.length_share for f in found] == sorted(f.length_share for f in found)


def test_the_profile_of_a_path_is_never_below_what_is_found_along_it_and_meets_it_where_all_is_alike():
    times, path = line((0.3, 0.4, 1.2), (5.5, 3.5, 1.0))
    for reach_m in (0.15, 0.4):
        profile = room().profile(path, reach_m)
        for k in range(0, len(path), 23):
            assert profile[k] >= room().along(times[k : k + 1], path[k : k + 1], reach_m).thickness_m
        assert np.isinf(profile).any()
    alike = room(seen=everywhere(0.05))
    np.testing.assert_allclose(alike.profile(path, 0.3), 0.05, atol=1e-6)
    assert alike.along(times, path, 0.3).thickness_m == pytest.approx(0.05)
    nothing = room(empty=np.ones(GRID.shape, bool)).profile(path, 0.3)
    np.testing.assert_array_equal(nothing, 0.0)
    np.testing.assert_array_equal(room().profile(path + 50.0, 0.3), 0.0)


def test_space_that_the_pilot_freed_counts_as_empty_and_an_added_obstacle_does_not():
    freed, added = Box((3.0, 2.0, 1.0), (3.4, 2.4, 1.4)), Box((5.0, 2.0, 1.0), (5.4, 2.4, 1.4))
    edits = [Edit("remove", freed), Edit("add", added)]
    empty = known_empty(GRID, edits, RIG, np.eye(4)[None], 0.0)
    inside = (freed.distance(GRID.centres().reshape(-1, 3)) <= 0.0).reshape(GRID.shape)
    np.testing.assert_array_equal(empty, inside)


def test_space_about_each_camera_is_empty_within_the_radius_of_what_carried_it():
    poses = np.tile(np.eye(4), (2, 1, 1))
    poses[:, :3, 3] = (2.0, 2.0, 1.0), (2.3, 2.0, 1.0)
    empty = known_empty(GRID, (), RIG, poses, 0.2)
    corners = GRID.centre(np.argwhere(empty))[:, None] + 0.05 * (2.0 * np.array(list(np.ndindex(2, 2, 2))) - 1.0)
    apart_m = np.linalg.norm(corners[:, :, None] - poses[:, :3, 3], axis=3)
    assert len(corners) > 10
    assert (apart_m.max(axis=1).min(axis=1) <= 0.2).all()  # each voxel wholly in one of the balls
    assert not known_empty(GRID, (), RIG, poses, 0.0).any()


def test_a_map_without_images_says_that_it_is_not_known(tmp_path: Path) -> None:
    folder = made_map(tmp_path / "map")
    space = mapping.open_map(folder).free_space()
    assert space is not None
    assert not space.empty.any()
    seen = mapping.open_map(folder).visibility()
    (folder / "poses.csv").write_text("image,time_s,x_m,y_m,z_m,qw,qx,qy,qz\n")
    assert mapping.open_map(folder).free_space() is None
    save_visibility(folder / map_folder.VISIBILITY, seen)
    assert mapping.open_map(folder).free_space() is not None


def stated(chance: float, patch: float = np.nan, x: tuple[float, float] = (0.0, 0.0)) -> np.ndarray:
    """How likely each voxel holds something, another chance between two x."""
    values = np.full(GRID.shape, chance, np.float16)
    places = GRID.centres()[..., 0]
    values[(places > x[0]) & (places < x[1])] = patch
    return values


def likely(chances: np.ndarray | None, thickness_m: float = 0.08, shots: tuple[Shot, ...] = ()) -> CouldHide:
    space = FreeSpace(esdf.build(ROOM, GRID), everywhere(thickness_m), NOTHING, chances, shots)
    return space.along(*line((1.0, 2.0, 1.2), (5.0, 2.0, 1.2)), 0.3)


def test_a_stretch_lies_where_the_map_states_that_something_is_likely():
    found = likely(stated(1e-6, 1e-3, (2.5, 3.0)))
    (stretch,) = found.stretches
    assert 0.5 - 0.2 < stretch.start_s < stretch.end_s < 1.0 + 0.35  # the path is at x = 1 + 2 t
    assert 2.4 < stretch.point_world_m[0] < 3.1
    assert np.linalg.norm(np.array(stretch.point_world_m)[1:] - [2.0, 1.2]) < 0.3 + GRID.half_diagonal_m
    assert 0.7 * found.probability < stretch.probability <= found.probability  # its ends are too unlikely to name
    assert stretch.thickness_m == pytest.approx(0.08)
    assert "% at" in found.describe()
    assert "80 mm thick" in found.describe()
    assert found.as_dict()["stretches"][0]["probability"] == stretch.probability


def test_a_path_is_never_safer_than_the_worst_voxel_near_it():
    one = np.zeros(GRID.shape, np.float16)
    one[tuple(GRID.index(np.array([[3.05, 2.05, 1.25]]))[0])] = 0.6
    found = likely(one)
    assert found.probability == pytest.approx(0.6, abs=1e-3)
    assert found.stretches[0].probability == found.probability


def test_a_rod_through_the_reach_counts_about_once():
    voxels = np.full(GRID.shape, 0.0, np.float16)
    rod = tuple(GRID.index(np.array([[3.05, 0.0, 1.25]]))[0][[0, 2]])
    voxels[rod[0], :, rod[1]] = 0.5  # as likely there as not, along a whole row
    assert 0.3 < likely(voxels).probability < 0.6


@given(st.floats(1e-5, 1e-2), st.floats(1.0, 10.0))
def test_the_likelier_a_voxel_holds_something_the_likelier_the_path_meets_it(chance, times):
    assert likely(stated(chance)).probability <= likely(stated(chance * times)).probability


def test_well_seen_space_says_nothing_and_what_is_not_stated_counts_as_not_looked_at():
    assert likely(stated(1e-7)).stretches == ()
    assert likely(stated(1.0), thickness_m=0.02).probability == 0.0  # images resolve 20 mm everywhere
    assert likely(stated(np.nan)).probability == pytest.approx(likely(stated(6e-4)).probability, rel=1e-2)
    spread = sorted(likely(stated(3e-4)).stretches, key=lambda stretch: stretch.start_s)
    assert spread[0].start_s == 0.0  # unlikely at each place but both ends, not along the whole way
    assert spread[-1].end_s == pytest.approx(2.0)
    assert all(before.end_s < after.start_s < before.end_s + 0.02 for before, after in itertools.pairwise(spread))
    assert likely(None).probability is None


def test_the_stretches_come_likeliest_first_and_make_up_the_whole():
    chances = stated(0.0, 2e-3, (1.5, 1.8))
    chances[stated(0.0, 1.0, (4.0, 4.6)) == 1.0] = 4e-3
    found = likely(chances)
    first, second = found.stretches
    assert first.probability > second.probability
    assert first.start_s > second.end_s
    whole = 1.0 - (1.0 - first.probability) * (1.0 - second.probability)
    assert found.probability == pytest.approx(whole, rel=1e-3)


def test_the_image_to_look_at_shows_the_place_from_nearest_by_with_nothing_before_it():
    camera = RIG.cameras[0]
    poses = np.tile(np.eye(4), (4, 1, 1))
    poses[:, :3, 3] = [[1.0, 2.0, 1.2], [2.0, 2.0, 1.2], [4.0, 2.0, 1.2], [2.9, 2.0, 9.0]]  # the third looks away
    taken = tuple(Shot(f"{k}.png", camera, pose @ camera.T_body_camera) for k, pose in enumerate(poses))
    found = likely(stated(0.0, 1e-2, (2.9, 3.1)), shots=taken)
    assert found.stretches[0].image == "1.png"
    assert likely(stated(0.0, 1e-2, (2.9, 3.1)), shots=taken[2:]).stretches[0].image == ""


def test_each_image_of_each_camera_is_named_by_its_folder_and_stands_where_that_camera_was():
    @dataclass
    class Placed:
        images: tuple[str, ...]
        rig: Rig
        T_world_body: np.ndarray

    left = RIG.cameras[0]
    aside = left.T_body_camera.copy()
    aside[1, 3] -= 0.1
    rig = Rig((replace(left, name="a", folder="front"), replace(left, name="b", folder="down", T_body_camera=aside)))
    poses = np.tile(np.eye(4), (2, 1, 1))
    poses[1, :3] = [[0, -1, 0, 2], [1, 0, 0, 3], [0, 0, 1, 1]]
    found = shots(Placed(("0.png", "1.png"), rig, poses))
    assert [shot.name for shot in found] == ["front/0.png", "down/0.png", "front/1.png", "down/1.png"]
    alone = shots(Placed(("0.png", "1.png"), Rig((replace(left, folder="."),)), poses))
    assert [shot.name for shot in alone] == ["0.png", "1.png"]
    assert [shot.camera.name for shot in found] == ["a", "b", "a", "b"]
    for shot, pose in zip(found, poses.repeat(2, axis=0), strict=True):
        np.testing.assert_array_equal(shot.T_world_camera, pose @ shot.camera.T_body_camera)


def test_a_price_counts_what_could_hide_but_for_where_the_space_is_known_to_be_empty():
    empty = NOTHING.copy()
    empty[:31] = True
    points = np.array([[1.0, 2.0, 1.2], [4.0, 2.0, 1.2], [9.0, 2.0, 1.2]])  # the last is outside the map
    np.testing.assert_array_equal(room(empty, everywhere(np.inf)).hidden_share(points), [0.0, 1.0, 1.0])
    np.testing.assert_array_equal(room(empty, everywhere(THRESHOLD_M)).hidden_share(points[:2]), [0.0, 0.0])
