"""Where to look again: seen by rays through the true room, which the search for views does not know."""

import dataclasses
import functools

import numpy as np
import pytest

import esdf
from esdf import FREE, OCCUPIED, UNKNOWN, Field, Grid
from esdf.solids import Box, Room, Scene, Solid
from flight import FloatArray, InputError, frames, rotations
from mapping.camera import rig as rigs
from mapping.exploration import view_planning
from mapping.exploration.view_planning import Again, ViewOptions, look_again

T_BODY_LEFT = frames.transform(rotations.from_yaw(0.5 * np.pi), np.zeros(3))
FRONT = dataclasses.replace(
    rigs.forward_camera("SIMPLE_RADIAL_FISHEYE", 160, 120, [50.0, 80.0, 60.0, 0.0], name="front"), folder="front"
)
LEFT = dataclasses.replace(FRONT, name="left", folder="left", T_body_camera=T_BODY_LEFT @ FRONT.T_body_camera)
RIG = rigs.Rig((FRONT, LEFT))

ROOM = Room((0.0, 0.0, 0.0), (5.0, 4.0, 2.4))
SCREEN = Box((3.2, -1.0, -1.0), (3.4, 2.4, 4.0))
ALCOVE = Box((3.4, 0.0, 0.0), (5.0, 2.4, 2.4))
GRID = Grid.covering([-0.5] * 3, [5.5, 4.5, 2.9], 0.1)
POSES = frames.transform(
    rotations.from_yaw([0.3, 0.5, 2.5, 3.0]), [[0.6, 0.6, 1.2], [1, 2, 1], [2, 3, 1.4], [2, 1, 1.2]]
)


def clear(truth: Solid, eye: FloatArray, points: FloatArray) -> np.ndarray:
    """(n,) whether nothing true lies between, by steps along the ray as long as the distance allows."""
    way = points - eye
    length = np.linalg.norm(way, axis=1)
    ray, gone, on = way / length[:, None], np.zeros(len(points)), np.arange(len(points))
    for _ in range(80):
        step = truth.distance(eye + gone[on, None] * ray[on])
        gone[on] = np.minimum(gone[on] + np.maximum(step, 0.0), length[on])
        on = on[(step > 1e-3) & (gone[on] < length[on])]
    return gone > length - 0.02


@functools.cache
def alcove() -> Field:
    """The room with an alcove behind a screen, as far as the recorded places see it, all round them."""
    truth = Scene((ROOM, SCREEN))
    centres = GRID.centres().reshape(-1, 3)
    empty = truth.distance(centres) > 0.05
    seen = np.zeros(len(centres), bool)
    for position in POSES[:, :3, 3]:
        asked = np.flatnonzero(empty & ~seen)
        seen[asked] = clear(truth, position, centres[asked])
    return field_of(seen.reshape(GRID.shape), ~empty.reshape(GRID.shape))


def field_of(free: np.ndarray, solid: np.ndarray) -> Field:
    """Free where it was seen, occupied where something solid is beside that, unknown elsewhere."""
    from scipy import ndimage

    state = np.where(free, np.uint8(FREE), np.uint8(UNKNOWN))
    state[ndimage.binary_dilation(free, np.ones((3, 3, 3))) & solid] = OCCUPIED
    return esdf.build(state, GRID)


def closed(*unknown: Box) -> Field:
    """The whole room seen, but for these boxes; what is behind its walls is unknown."""
    inside = (ROOM.distance(GRID.centres().reshape(-1, 3)) > 0.0).reshape(GRID.shape)
    field = field_of(inside, ~inside)
    state = field.state.copy()
    for box in unknown:
        state[(box.distance(GRID.centres().reshape(-1, 3)) < 0.0).reshape(GRID.shape)] = UNKNOWN
    return esdf.build(state, GRID)


def looks(truth: Solid, found: Again, points: FloatArray) -> np.ndarray:
    """(n,) images of the tour that see each point of the true room, from where the cameras really are."""
    count = np.zeros(len(points), int)
    for view in found.views:
        T_world_body = frames.transform(rotations.from_yaw(view.heading_rad), view.position_world_m)
        for camera in RIG:
            T = T_world_body @ camera.T_body_camera
            in_image = camera.contains(camera.project((points - T[:3, 3]) @ T[:3, :3]))
            count += in_image & clear(truth, T[:3, 3], points)
    return count


def test_the_views_see_an_alcove_behind_a_screen_three_times_from_free_space():
    truth, field, options = Scene((ROOM, SCREEN)), alcove(), ViewOptions()
    found = look_again(field, RIG, POSES, options)
    assert found.views
    places = np.array([view.position_world_m for view in found.views])
    assert (truth.distance(places) >= options.clearance_m).all()
    assert (field.state[tuple(GRID.index(places).T)] == FREE).all()
    assert (field.proven_distance(places) >= options.clearance_m - 1e-6).all()
    empty = truth.distance(found.targets_world_m) > 0.05
    seen = looks(truth, found, found.targets_world_m[found.shown & empty])
    assert (seen >= options.looks).mean() > 0.9
    new = (ALCOVE.distance(GRID.centres().reshape(-1, 3)) < -0.05).reshape(GRID.shape) & (field.state == UNKNOWN)
    near_frontier = new & _within(field.state == FREE, 4)
    assert (looks(truth, found, GRID.centre(np.argwhere(near_frontier))) >= options.looks).mean() > 0.8
    assert 0.5 * found.unknown_m3 < found.shown_m3 <= found.unknown_m3


def _within(marked: np.ndarray, voxels: int) -> np.ndarray:
    from scipy import ndimage

    return ndimage.binary_dilation(marked, iterations=voxels)


def test_a_closed_room_that_was_seen_whole_asks_for_nothing_behind_its_walls():
    found = look_again(closed(), RIG, POSES)
    assert (found.views, found.unknown_m3, found.shown_m3) == ((), 0.0, 0.0)


def test_only_unknown_space_of_some_size_is_worth_a_view():
    small, large = Box((3.0, 1.0, 1.0), (3.2, 1.2, 1.2)), Box((3.0, 1.0, 1.0), (3.6, 1.6, 1.6))
    assert not look_again(closed(small), RIG, POSES).views
    found = look_again(closed(large), RIG, POSES)
    assert found.unknown_m3 == pytest.approx(0.216)
    assert found.shown_m3 == pytest.approx(0.216)
    assert look_again(closed(small), RIG, POSES, ViewOptions(least_m3=0.004)).views


def test_what_many_images_looked_at_in_vain_is_not_looked_at_again():
    blank = closed(Box((4.95, 1.0, 0.5), (5.5, 3.0, 2.0)))  # a piece of wall without texture: no surface was found
    places = np.column_stack([np.full(8, 2.5), np.linspace(1.4, 2.6, 8), np.full(8, 1.2)])
    facing, away = (frames.transform(rotations.from_yaw(np.full(8, yaw)), places) for yaw in (0.0, 0.75 * np.pi))
    found = look_again(blank, RIG, facing)
    assert not found.views
    assert found.in_vain_m3 > 0.2
    unseen = look_again(blank, RIG, away)
    assert unseen.views
    assert unseen.in_vain_m3 == 0.0
    hovering = look_again(blank, RIG, np.repeat(facing[3:4], 20, axis=0))
    assert hovering.views
    assert hovering.in_vain_m3 == 0.0


def test_only_unknown_space_near_a_given_path_counts():
    here, there = Box((0.8, 2.8, 0.8), (1.4, 3.4, 1.4)), Box((4.0, 0.6, 0.8), (4.6, 1.2, 1.4))
    field, path = closed(here, there), np.array([[0.5, 2.2, 1.0], [2.0, 2.2, 1.0]])
    assert look_again(field, RIG, POSES).shown_m3 == pytest.approx(0.432, rel=0.1)
    found = look_again(field, RIG, POSES, ViewOptions(within_m=1.0), near_world_m=path)
    assert found.unknown_m3 == pytest.approx(0.216, rel=0.1)
    assert found.shown_m3 == pytest.approx(0.216, rel=0.1)
    assert (here.distance(found.targets_world_m) < 0.0).all()
    one_point = look_again(field, RIG, POSES, ViewOptions(within_m=1.2), near_world_m=np.array([[1.1, 2.2, 1.0]]))
    assert one_point.unknown_m3 == pytest.approx(0.216, rel=0.1)
    out_of_the_map = np.array([[0.5, 3.1, 1.0], [0.5, 1e9, 1.0]])  # memory must not grow with its length
    far = look_again(field, RIG, POSES, ViewOptions(within_m=1.0), near_world_m=out_of_the_map)
    assert far.unknown_m3 == pytest.approx(0.216, rel=0.1)
    with pytest.raises(InputError, match="another map"):
        look_again(field, RIG, POSES, near_world_m=np.array([[50.0, 50.0, 1.0]]))


def test_on_foot_the_views_are_at_the_heights_of_hands():
    field = closed(Box((3.0, 1.0, 0.0), (3.6, 1.6, 0.6)))
    found = look_again(field, RIG, POSES, ViewOptions(heights_world_m=(1.0, 1.4)))
    assert found.views
    assert all(1.0 <= view.position_world_m[2] <= 1.4 for view in found.views)


def test_views_are_not_closer_than_gives_parallax_and_no_more_than_asked_for():
    found = look_again(alcove(), RIG, POSES)
    places = np.array([view.position_world_m for view in found.views])
    apart = np.linalg.norm(places[:, None] - places, axis=2) + 9.0 * np.eye(len(places))
    assert apart.min() >= 0.3
    assert len(look_again(alcove(), RIG, POSES, ViewOptions(most_views=3)).views) <= 3


def test_the_tour_is_no_longer_than_any_exchange_of_two_views_makes_it():
    rng = np.random.default_rng(5)
    views = [view_planning.View(tuple(p), 0.0, 1.0, 1.0) for p in rng.uniform(0.0, 5.0, (9, 3)).tolist()]
    tour = view_planning._tour(views, np.zeros(3))

    def length(order: list[view_planning.View]) -> float:
        points = np.array([np.zeros(3), *(view.position_world_m for view in order)])
        return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())

    assert sorted(tour, key=str) == sorted(views, key=str)
    for i in range(9):
        for j in range(i + 1, 9):
            turned = [*tour[:i], *tour[i : j + 1][::-1], *tour[j + 1 :]]
            assert length(list(tour)) <= length(turned) + 1e-9


def test_what_cannot_be_answered_is_refused_with_the_way_out():
    with pytest.raises(InputError, match="no poses"):
        look_again(closed(), RIG, POSES[:0])
    with pytest.raises(InputError, match="smaller clearance"):
        look_again(closed(), RIG, POSES, ViewOptions(clearance_m=1.5))
    for name in ("clearance_m", "farthest_m", "least_m3", "within_m"):
        for value in (0.0, -1.0, np.nan, np.inf):
            with pytest.raises(InputError, match=name):
                ViewOptions(**{name: value})
    with pytest.raises(InputError, match="most_views"):
        ViewOptions(most_views=0)
