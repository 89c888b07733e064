"""Queries: between voxels, at the outer faces, outside; and the bounds stated for them."""

import numpy as np
import pytest

from esdf import (
    FREE,
    KNOWN,
    OCCUPIED,
    OUTSIDE,
    UNKNOWN,
    UNMAPPED,
    Field,
    Grid,
    _esdf,
    build,
    profile,
    rasterize,
    solids,
)
from flight import InputError, Trajectory

ROOM = solids.Scene(
    [
        solids.Room((0.0, 0.0, 0.0), (4.0, 3.0, 2.0)),
        solids.Sphere((2.2, 1.4, 0.9), 0.4),
        solids.Cylinder((1.0, 1.0, 1.0), 0.2, 2.0),
        solids.Box((3.0, 0.5, 0.0), (3.4, 1.5, 0.8)),
    ]
)


@pytest.fixture(scope="module")
def room_field() -> Field:
    grid = Grid((-0.2, -0.2, -0.2), 0.05, (88, 68, 48))
    return build(rasterize(ROOM, grid), grid, cap_m=2.0)


def exact_distance(field, points):
    """Distance to the union of the solid boxes, by looking at each of them."""
    low = field.grid.centre(np.argwhere(field.state != FREE)) - 0.5 * np.array(field.grid.voxel_m)
    high = low + np.array(field.grid.voxel_m)
    beyond = [np.maximum(np.maximum(low - p, p - high), 0.0) for p in points]
    return np.array([np.sqrt((b**2).sum(axis=1).min()) for b in beyond])


def test_the_field_of_a_rasterised_scene_is_the_formula_within_a_voxel_and_never_above_it(room_field):
    rng = np.random.default_rng(0)
    points = rng.uniform((0, 0, 0), (4, 3, 2), (20_000, 3))
    error = room_field.distance(points) - ROOM.distance(points)
    free = ROOM.distance(points) > 0.1
    assert error[free].max() < room_field.grid.half_diagonal_m / 2  # interpolation alone may round upwards
    assert error[free].min() > -2.5 * room_field.grid.half_diagonal_m
    proven = room_field.proven_distance(points)
    assert (proven <= np.maximum(ROOM.distance(points), 0.0) + 1e-9).all()


def test_interpolation_is_within_half_a_diagonal_and_the_proven_distance_is_below_the_exact_one():
    rng = np.random.default_rng(1)
    for voxel in ((0.1, 0.1, 0.1), (0.05, 0.1, 0.2)):
        state = np.where(rng.random((14, 12, 10)) < 0.02, OCCUPIED, FREE).astype(np.uint8)
        field = build(state, Grid((0, 0, 0), voxel, state.shape), cap_m=5.0, unknown="nan")
        points = rng.uniform(0, np.array(voxel) * state.shape, (3000, 3))
        exact, value, proven = exact_distance(field, points), field.distance(points), field.proven_distance(points)
        outside = exact > 0
        assert np.abs(value - exact)[outside].max() <= field.grid.half_diagonal_m + 1e-6
        assert (proven <= exact).all()
        far = value > 2 * field.grid.half_diagonal_m
        inner = ((points > 0.5 * np.array(voxel)) & (points < np.array(voxel) * (np.array(state.shape) - 0.5))).all(
            axis=1
        )
        gap = (value - proven)[far & inner]
        assert gap.size > 20
        assert gap.max() < 0.28 * field.grid.half_diagonal_m


def test_the_gradient_is_the_slope_of_the_value(room_field):
    rng = np.random.default_rng(2)
    cell = rng.integers((0, 0, 0), np.array(room_field.grid.shape) - 1, (2000, 3))
    points = room_field.grid.centre(cell) + rng.uniform(0.05, 0.95, (2000, 3)) * 0.05
    value, gradient = room_field.distance_and_gradient(points)
    np.testing.assert_array_equal(value, room_field.distance(points))
    np.testing.assert_array_equal(gradient, room_field.gradient(points))
    for axis in range(3):
        step = np.eye(3)[axis] * 1e-3
        slope = (room_field.distance(points + step) - room_field.distance(points - step)) / 2e-3
        np.testing.assert_allclose(gradient[:, axis], slope, atol=2e-3)


def test_the_hessian_of_the_distance_to_a_ball_is_its_curvature():
    ball = solids.Sphere((0.0, 0.0, 0.0), 0.5)
    grid = Grid((-2.0, -2.0, -2.0), 0.04, (100, 100, 100))
    field = build(rasterize(ball, grid), grid, cap_m=3.0, unknown="nan")
    direction = np.random.default_rng(5).normal(size=(200, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    hessian = field.hessian(1.5 * direction)
    np.testing.assert_array_equal(hessian, hessian.transpose(0, 2, 1))
    mean = hessian.mean(axis=0)  # voxels are coarse; on average the curvature is (I - n n^T) / r
    np.testing.assert_allclose(np.trace(mean), 2 / 1.5, rtol=0.15)


def test_along_a_curve_the_rate_is_the_slope_of_the_distance(room_field):
    coefficients = np.zeros((1, 4, 3))
    coefficients[0, :3] = [[0.6, 0.5, 0.1], [0.4, 0.6, -0.1], [0.5, 0.2, 0.05]]
    path = Trajectory(np.array([2.0]), coefficients)
    times = np.linspace(0.1, 1.9, 500)
    distance, rate = profile(room_field, path, times)
    np.testing.assert_array_equal(distance, room_field.distance(path.position(times)))
    before, after = profile(room_field, path, times - 1e-4)[0], profile(room_field, path, times + 1e-4)[0]
    smooth = np.abs((after - before) / 2e-4 - rate) < 1e-2  # a kink at a cell's face may fall between
    assert smooth.mean() > 0.98


def test_at_a_centre_the_value_is_the_voxels(room_field):
    index = np.argwhere(np.ones(room_field.grid.shape, bool))[::97]
    np.testing.assert_allclose(
        room_field.distance(room_field.grid.centre(index)), room_field.values_m[tuple(index.T)], atol=1e-6
    )


def test_the_outer_half_voxel_is_inside_and_beyond_it_is_outside(room_field):
    low, high = room_field.grid.low_world_m, room_field.grid.high_world_m
    assert np.isfinite(room_field.distance([low, high, low + 0.01])).all()
    assert np.isnan(room_field.distance([low - 1e-6, high + 1e-6, [100, 0, 0]])).all()
    assert np.isnan(room_field.gradient([[100, 0, 0]])).all()


def test_outside_and_unknown_have_different_status():
    state = np.full((10, 10, 10), FREE, np.uint8)
    state[5:] = UNKNOWN
    field = build(state, Grid((0, 0, 0), 0.1, state.shape), unknown="nan")
    points = [[0.2, 0.5, 0.5], [0.8, 0.5, 0.5], [1.2, 0.5, 0.5]]
    assert field.status(points).tolist() == [KNOWN, UNMAPPED, OUTSIDE]
    assert np.isnan(field.distance(points)).tolist() == [False, True, True]


def test_a_grid_one_voxel_thick_can_be_queried():
    field = build(np.array([[[FREE]], [[OCCUPIED]]], np.uint8), Grid((0, 0, 0), 1.0, (2, 1, 1)), unknown="nan")
    value, gradient = field.distance_and_gradient([[1.0, 0.3, 0.5]])
    assert value[0] == pytest.approx(0.0)
    assert gradient[0] == pytest.approx([-1.0, 0.0, 0.0])


def test_queries_are_bit_equal_on_every_instruction_set(room_field):
    points = np.random.default_rng(4).uniform(-0.3, 4.3, (5000, 3))
    value, gradient = room_field.distance_and_gradient(points)
    for instruction_set in _esdf.instruction_sets():
        v, g = np.empty(5000), np.empty((5000, 3))
        grid = room_field.grid
        _esdf.query_dense(room_field.values_m, grid.origin_world_m, grid.voxel_m, points, v, g, instruction_set)
        np.testing.assert_array_equal(v, value)
        np.testing.assert_array_equal(g, gradient)


def test_a_value_does_not_depend_on_the_other_points_of_the_query(room_field):
    points = np.random.default_rng(5).uniform(-0.1, 4.1, (150, 3))
    value, gradient = room_field.distance_and_gradient(points)
    for count in (1, 3, 4, 7, 8, 9, 31, 32, 33, 65, 149):
        some, slopes = room_field.distance_and_gradient(points[-count:])
        np.testing.assert_array_equal(some, value[-count:])
        np.testing.assert_array_equal(slopes, gradient[-count:])
        np.testing.assert_array_equal(room_field.distance(points[-count:]), value[-count:])


@pytest.mark.parametrize("points", [[1.0, 2.0, 3.0], [[1.0, 2.0]], np.zeros((2, 3, 1)), "abc", [[0.0, np.nan, 0.0]]])
def test_points_of_the_wrong_shape_or_not_finite_are_refused(room_field, points):
    with pytest.raises(InputError):
        room_field.distance(points)


def test_no_points_give_no_values(room_field):
    assert room_field.distance(np.empty((0, 3))).shape == (0,)


def test_the_hash_depends_on_everything_that_decides_the_values(room_field):
    grid, state = room_field.grid, room_field.state
    changed = state.copy()
    changed[40, 30, 20] = UNKNOWN
    moved = Grid((0.0, 0.0, 0.0), grid.voxel_m, grid.shape)
    others = [
        build(changed, grid),
        build(state, moved),
        build(state, grid, cap_m=1.0),
        build(state, grid, unknown="nan"),
    ]
    assert build(state, grid).hash == room_field.hash
    assert len({f.hash for f in [room_field, *others]}) == 5
