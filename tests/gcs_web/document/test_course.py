"""Many waypoints at once: snapped where they are asked to be, turned, boxed on the screen."""

import numpy as np
import pytest

import esdf
from esdf import solids
from flight import InputError, rotations
from gcs_web.document import edits
from gcs_web.document.document import Content, Point
from gcs_web.planning import snapping
from gcs_web.protocol.course import Place, RandomYaw
from gcs_web.scene import picking

GRID = esdf.Grid((0.0, 0.0, 0.0), 0.05, (80, 60, 50))
ROOM = solids.Scene([solids.Room((0.1, 0.1, 0.1), (3.9, 2.9, 2.4)), solids.Box((1.0, 1.0, 0.0), (2.0, 2.0, 0.8))])


@pytest.fixture(scope="module")
def field() -> esdf.Field:
    return esdf.build(esdf.rasterize(ROOM, GRID), GRID)


def test_a_grid_moves_nothing_farther_than_half_its_diagonal_and_twice_is_once():
    places = np.random.default_rng(1).uniform(-3.0, 3.0, (50, 3))
    snapped = snapping.onto_grid(places, 0.25)
    assert np.linalg.norm(snapped - places, axis=1).max() <= 0.5 * 0.25 * np.sqrt(3.0) + 1e-12
    np.testing.assert_allclose(snapping.onto_grid(snapped, 0.25), snapped, atol=1e-12)
    np.testing.assert_allclose(snapped / 0.25, np.round(snapped / 0.25), atol=1e-9)


def test_a_height_is_above_what_is_below_a_table_or_the_floor(field):
    places = np.array([[1.5, 1.5, 1.7], [3.0, 1.5, 1.7]])
    placed = snapping.above_ground(places, 0.5, field)
    np.testing.assert_array_equal(placed[:, :2], places[:, :2])
    np.testing.assert_allclose(placed[:, 2], [0.8 + 0.5, 0.1 + 0.5], atol=0.05)


def test_what_is_too_near_goes_straight_away_and_the_others_stay(field):
    places = np.array([[2.2, 1.5, 0.5], [3.0, 2.7, 1.2], [3.0, 1.5, 1.3]])
    placed = snapping.away_from_obstacles(places, 0.6, field)
    assert (field.distance(placed) >= 0.6 - 2e-3).all()
    np.testing.assert_array_equal(placed[2], places[2])
    assert abs(placed[1, 0] - 3.0) < 0.05  # away from the wall, not along it


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        (lambda field: snapping.away_from_obstacles(np.array([[3.0, 1.5, 1.2]]), 2.5, field), "no 2.50 m of room"),
        (lambda field: snapping.away_from_obstacles(np.array([[9.0, 1.5, 1.2]]), 0.5, field), "nothing is known"),
        (lambda field: snapping.above_ground(np.array([[9.0, 1.5, 1.2]]), 0.5, field), "no floor below"),
        (lambda _: snapping.onto_grid(np.zeros((1, 3)), 0.0), "spacing of the grid would be 0 m"),
        (lambda _: snapping.onto_grid(np.zeros((1, 3)), float("nan")), "spacing of the grid would be nan m"),
    ],
)
def test_what_cannot_be_is_refused_in_words(field, asked, words):
    with pytest.raises(InputError, match=words):
        asked(field)


def content() -> Content:
    return Content().with_points([Point(i, (float(i), 0.0, 1.0)) for i in range(4)])


def test_random_headings_are_one_change_of_the_named_waypoints_and_the_same_for_the_same_revision():
    wanted = RandomYaw(serial=0, revision=7, waypoints=[1, 3])
    after, label = edits.apply(content(), wanted)
    assert [p.yaw_rad is None for p in after.points] == [True, False, True, False]
    assert edits.apply(content(), wanted)[0] == after
    assert edits.apply(content(), RandomYaw(serial=0, revision=8, waypoints=[1, 3]))[0] != after
    assert label == "random headings for 2 waypoints"


def test_places_are_taken_by_each_waypoint_for_itself():
    wanted = Place(
        serial=0, revision=0, waypoints=[2, 0], positions_m=[(5.0, 5.0, 5.0), (6.0, 6.0, 6.0)], label="snapped"
    )
    after, label = edits.apply(content(), wanted)
    assert [p.position_world_m[0] for p in after.points] == [6.0, 1.0, 5.0, 3.0]
    assert label == "2 waypoints snapped"


def test_a_point_is_on_the_screen_where_a_pinhole_camera_sees_it():
    q = rotations.exp(np.array([0.3, -0.2, 0.5]))
    camera = np.array([1.0, -2.0, 0.5])
    ahead = camera + rotations.rotate(q, np.array([[0.0, 0.0, 3.0], [0.0, 0.0, -3.0]]))
    places = picking.on_screen(ahead, camera, q, np.radians(60.0), 1.5)
    np.testing.assert_allclose(places[0], [0.5, 0.5], atol=1e-12)
    assert np.isnan(places[1]).all()  # behind it
    corner = np.tan(np.radians(30.0))
    edge = camera + rotations.rotate(q, np.array([[1.5 * corner, -corner, 1.0]]))
    np.testing.assert_allclose(picking.on_screen(edge, camera, q, np.radians(60.0), 1.5)[0], [1.0, 0.0], atol=1e-12)
