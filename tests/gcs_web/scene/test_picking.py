"""Clicks in the 3D view: a ray finds what an eye along it sees first."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import trimesh
from hypothesis import assume, given
from hypothesis import strategies as st

from gcs_web.scene import picking

SCENE = trimesh.util.concatenate(
    [
        trimesh.creation.box(bounds=[[0.0, 0.0, -0.1], [6.0, 4.0, 0.0]]),
        trimesh.creation.box(bounds=[[2.0, 1.0, 0.0], [3.0, 2.0, 2.0]]),
    ]
)
SURFACE = picking.Surface(SCENE.vertices, SCENE.faces)


def cast(origin_m, target_m):
    direction = np.subtract(target_m, origin_m)
    return SURFACE.first_hit(np.array(origin_m), direction / np.linalg.norm(direction))


def test_the_floor_and_the_front_of_a_box_are_hit_and_the_sky_is_not():
    point, normal = cast([1.0, 3.0, 5.0], [1.0, 3.0, 0.0])
    np.testing.assert_allclose((point, normal), ([1.0, 3.0, 0.0], [0.0, 0.0, 1.0]), atol=1e-6)
    point, normal = cast([0.0, 1.5, 1.0], [6.0, 1.5, 1.0])
    np.testing.assert_allclose((point, normal), ([2.0, 1.5, 1.0], [-1.0, 0.0, 0.0]), atol=1e-6)
    assert cast([1.0, 3.0, 5.0], [1.0, 3.0, 9.0]) is None


def test_backs_are_passed_through_as_they_are_not_drawn():
    point, _ = cast([2.5, 1.5, 1.0], [2.5, 1.5, -5.0])  # from inside of the box, through its bottom, to the floor
    np.testing.assert_allclose(point, [2.5, 1.5, 0.0], atol=1e-6)


@given(st.floats(0.05, 5.95), st.floats(0.05, 3.95))
def test_a_click_from_above_lands_on_the_box_or_the_floor_under_it(x, y):
    assume(min(abs(x - 2.0), abs(x - 3.0), abs(y - 1.0), abs(y - 2.0)) > 1e-3)
    height = 2.0 if 2.0 < x < 3.0 and 1.0 < y < 2.0 else 0.0
    found = cast([x, y, 5.0], [x, y, 0.0])
    assert found is not None
    np.testing.assert_allclose(found[0], [x, y, height], atol=1e-5)


def test_a_click_near_the_path_finds_its_moment_and_one_beside_it_none():
    path = np.stack([np.linspace(0.0, 6.0, 61), np.full(61, 2.0), np.full(61, 1.0)], axis=1)
    eye = np.array([3.0, -2.0, 5.0])
    for k in (5, 30, 55):
        direction = (path[k] - eye) / np.linalg.norm(path[k] - eye)
        assert picking.nearest_on_path(eye, direction, path) == k
        assert picking.nearest_on_path(eye, -direction, path) is None  # behind the camera
    assert picking.nearest_on_path(eye, np.array([0.0, 0.0, -1.0]), path) is None


@pytest.mark.parametrize(("height_m", "expected_m"), [(1.2, 1.2), (0.1, 0.4)])
def test_a_waypoint_over_a_floor_keeps_the_height_and_never_less_than_the_clearance(height_m, expected_m):
    up = np.array([0.0, 0.0, 1.0])
    placed = picking.waypoint_over(np.array([1.0, 2.0, 0.0]), up, height_m=height_m, clearance_m=0.4)
    np.testing.assert_allclose(placed, [1.0, 2.0, expected_m])


def test_a_waypoint_at_a_wall_stands_off_by_the_clearance():
    wall = np.array([-1.0, 0.0, 0.0])
    placed = picking.waypoint_over(np.array([2.0, 1.5, 1.0]), wall, height_m=3.0, clearance_m=0.4)
    np.testing.assert_allclose(placed, [1.6, 1.5, 1.0])


@pytest.mark.parametrize(
    ("distance_m", "fov_deg", "height_m"), [(2.0, 90.0, 4.0), (4.0, 90.0, 8.0), (1.0, 60.0, 1.1547)]
)
def test_the_height_of_a_picture_is_that_at_the_point_looked_at(distance_m, fov_deg, height_m):
    far = np.array([1.0, 2.0, 3.0])
    ahead = np.array([0.0, distance_m, 0.0])
    camera: Any = SimpleNamespace(position=far, look_at=far + ahead, fov=np.radians(fov_deg))
    assert picking.height_seen(camera) == pytest.approx(height_m, rel=1e-4)
