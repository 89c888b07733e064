"""Where a path fits: what is found keeps its distance, a room too small is refused, and a known box is found."""

import numpy as np
import pytest

import esdf
from esdf import solids
from flight import InfeasibleError
from planner.route import placing
from vehicle import manoeuvres


def room(*size_m: float) -> esdf.Field:
    """An empty box room with its lowest corner at the origin, in voxels of 10 cm."""
    grid = esdf.Grid.covering((-0.2, -0.2, -0.2), tuple(np.add(size_m, 0.2)), 0.1)
    return esdf.build(esdf.rasterize(solids.Room((0.0, 0.0, 0.0), (size_m[0], size_m[1], size_m[2])), grid), grid)


def test_a_path_longer_than_the_room_is_wide_is_turned_along_it():
    field = room(6.0, 2.0, 2.0)
    path = np.linspace((0.0, -2.0, 0.0), (0.0, 2.0, 0.0), 200)
    found = placing.place(path, field, 0.6)
    assert found is not None
    assert abs(np.sin(found.heading_rad)) == pytest.approx(1.0, abs=0.2)
    assert found.distance_m >= 0.6
    assert placing.place(1.4 * path, field, 0.6) is None


def test_a_placed_trajectory_has_the_distance_that_was_found():
    field = room(5.0, 4.0, 3.0)
    flown = manoeuvres.scaled(manoeuvres.make("oblique"), 0.2)
    path = flown.position(flown.sample(0.01))
    found = placing.place(path, field, 0.3)
    assert found is not None
    there = found.apply(flown, placing.middle_of(path))
    points = there.position(there.sample(0.01))
    assert field.distance(points).min() == pytest.approx(found.distance_m, abs=0.02)
    turned = there.evaluate(there.sample(0.5))[:, 3] - flown.evaluate(flown.sample(0.5))[:, 3]
    np.testing.assert_allclose(turned, found.heading_rad, atol=1e-9)
    np.testing.assert_allclose(
        np.linalg.norm(there.position(there.sample(0.5), 1), axis=1),
        np.linalg.norm(flown.position(flown.sample(0.5), 1), axis=1),
        atol=1e-9,
    )


def test_the_largest_free_box_of_an_empty_room_is_the_room_less_at_most_two_cells():
    size = np.array([6.0, 4.0, 3.0])
    found = placing.largest_free_box(room(*size.tolist()))
    assert (np.array(found.size_m) <= size).all()
    assert (np.array(found.size_m) >= size - 4.0 * found.cell_m).all()
    np.testing.assert_allclose(found.middle_world_m, 0.5 * size, atol=found.cell_m)


def test_a_map_without_free_space_has_no_free_box():
    grid = esdf.Grid.covering((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), 0.1)
    with pytest.raises(InfeasibleError, match="no free space"):
        placing.largest_free_box(esdf.build(np.zeros(grid.shape, np.uint8), grid))
