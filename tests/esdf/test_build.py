"""The transform: exact, signed, capped, the same on every instruction set, window and number of threads."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from esdf import FREE, OCCUPIED, UNKNOWN, Grid, _esdf, build, reference
from esdf.build import Recipe, transform
from esdf.grid import Region
from flight import InputError


def random_case(rng):
    """A random map: any density, any policy, cubes or not, capped or not, one edge sometimes long."""
    edges = rng.integers(1, 24, 3)
    if rng.random() < 0.5:  # longer than the lanes of a vector, and than the cap reaches
        edges[rng.integers(3)] = rng.integers(24, 150)
    shape = tuple(int(n) for n in edges)
    density = rng.choice([0.0, 0.01, 0.1, 0.5, 0.9])
    state = rng.choice([UNKNOWN, FREE, OCCUPIED], size=shape, p=[density / 2, 1 - density, density / 2]).astype(
        np.uint8
    )
    voxel = (0.1, 0.1, 0.1) if rng.random() < 0.5 else tuple(rng.uniform(0.05, 0.3, 3))
    cap = float(rng.choice([0.35, 2.0, 9.0, math.inf]))
    return state, Grid((0.0, 0.0, 0.0), voxel, shape), cap, ("obstacle", "nan")[int(rng.integers(2))]


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=150)
def test_every_instruction_set_and_thread_count_is_bit_equal_to_the_numpy_reference(seed):
    rng = np.random.default_rng(seed)
    state, grid, cap, unknown = random_case(rng)
    recipe = Recipe.of(grid, cap, unknown)
    expected = reference.transform(recipe, state)
    for instruction_set in _esdf.instruction_sets():
        out = np.empty(grid.shape, np.float32)
        threads = int(rng.integers(1, 4))
        transform(recipe, state, grid.everything, out, recipe.faces, threads=threads, instruction_set=instruction_set)
        np.testing.assert_array_equal(out, expected)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=150)
def test_any_window_equals_the_same_part_of_the_whole(seed):
    rng = np.random.default_rng(seed)
    state, grid, cap, unknown = random_case(rng)
    recipe = Recipe.of(grid, cap, unknown)
    whole = build(state, grid, cap_m=cap, unknown=unknown).values_m
    low = [int(rng.integers(0, n)) for n in grid.shape]
    high = [int(rng.integers(a + 1, n + 1)) for a, n in zip(low, grid.shape, strict=True)]
    region = Region(tuple(low), tuple(high))
    values = np.zeros_like(whole)
    transform(recipe, state, region, values[region.slices], recipe.faces)
    np.testing.assert_array_equal(values[region.slices], whole[region.slices])
    values[region.slices] = 0.0
    assert not values.any()  # nothing was written beside the window


def scipy_distance_to_boxes(sites, voxel):
    """Distance from voxel centres to the boxes of the sites, by scipy, on a lattice of half voxels.

    On that lattice voxel i sits at 2 i + 1 and its box covers 2 i .. 2 i + 2; the nearest point of a box to a lattice
    point is a lattice point, so this is exact.
    """
    fine = np.zeros([2 * n + 1 for n in sites.shape], bool)
    for index in np.argwhere(sites):
        i, j, k = 2 * index
        fine[i : i + 3, j : j + 3, k : k + 3] = True
    return ndimage.distance_transform_edt(~fine, sampling=np.array(voxel) / 2)[1::2, 1::2, 1::2]


@pytest.mark.parametrize("shape", [(9, 12, 7), (20, 4, 16)])
def test_distances_are_those_of_scipy_on_random_masks(shape):
    rng = np.random.default_rng(5)
    for trial in range(30):
        voxel = (0.1, 0.1, 0.1) if trial % 2 else tuple(rng.uniform(0.05, 0.3, 3))
        state = np.where(rng.random(shape) < rng.uniform(0.003, 0.6), OCCUPIED, FREE).astype(np.uint8)
        state.flat[0], state.flat[-1] = OCCUPIED, FREE
        field = build(state, Grid((0, 0, 0), voxel, shape), cap_m=math.inf, unknown="nan")
        solid = state == OCCUPIED
        outside, inside = scipy_distance_to_boxes(solid, voxel), scipy_distance_to_boxes(~solid, voxel)
        np.testing.assert_allclose(field.values_m, np.where(solid, -inside, outside), rtol=2e-7)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=50)
def test_a_cap_only_clips(seed):
    rng = np.random.default_rng(seed)
    state, grid, _, unknown = random_case(rng)
    free_running = build(state, grid, cap_m=math.inf, unknown=unknown).values_m
    capped = build(state, grid, cap_m=0.6, unknown=unknown).values_m
    np.testing.assert_allclose(capped, np.clip(free_running, -0.6, 0.6), rtol=2e-7)


def test_unknown_and_the_outside_are_obstacles_under_the_obstacle_policy():
    state = np.full((20, 20, 20), FREE, np.uint8)
    state[15:] = UNKNOWN
    field = build(state, Grid((0, 0, 0), 0.1, state.shape), unknown="obstacle")
    assert field.distance([[0.95, 1.05, 1.05]])[0] == pytest.approx(0.55)
    assert field.distance([[1.05, 1.05, 0.15]])[0] == pytest.approx(0.15)
    assert field.distance([[1.75, 1.05, 1.05]])[0] < 0


def test_unknown_has_no_distance_and_stops_none_under_the_nan_policy():
    state = np.full((20, 20, 20), UNKNOWN, np.uint8)
    state[:10] = FREE
    state[18:] = OCCUPIED
    field = build(state, Grid((0, 0, 0), 0.1, state.shape), unknown="nan")
    assert field.distance([[0.55, 1.0, 1.0]])[0] == pytest.approx(1.25)
    assert np.isnan(field.distance([[1.5, 1.0, 1.0]])[0])


def test_a_map_without_obstacles_is_as_far_as_the_cap_everywhere():
    grid = Grid((0, 0, 0), 0.1, (6, 7, 8))
    free = np.full(grid.shape, FREE, np.uint8)
    assert (build(free, grid, cap_m=1.5, unknown="nan").values_m == 1.5).all()
    assert (build(free, grid, cap_m=math.inf, unknown="nan").values_m == 1e9).all()


def test_an_all_unknown_map_has_no_free_space():
    grid = Grid((0, 0, 0), 0.1, (6, 7, 8))
    unknown = np.full(grid.shape, UNKNOWN, np.uint8)
    assert (build(unknown, grid, unknown="obstacle").values_m < 0).all()
    assert np.isnan(build(unknown, grid, unknown="nan").values_m).all()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: Grid((0, 0, 0), 0.0, (4, 4, 4)), "must be positive"),
        (lambda: Grid((0, np.nan, 0), 0.1, (4, 4, 4)), "not finite"),
        (lambda: Grid((0, 0, 0), 0.1, (10_000, 10_000, 10_000)), "1e\\+12 voxels"),
        (lambda: Grid((0, 0, 0), 0.1, (4, 0, 4)), "at least 1"),
        (lambda: Grid.covering((0, 0, 0), (1e4, 1e4, 1e4), 0.01), r"a box of 1e\+04 .* take voxels of 2\.5 m"),
        (lambda: Grid.covering((0, 0, 0), (1, 0, 1), 0.01), "empty"),
        (lambda: build(np.ones((3, 3, 3), np.uint8), Grid((0, 0, 0), 0.1, (4, 4, 4))), "shape"),
        (lambda: build(np.full((4, 4, 4), 3, np.uint8), Grid((0, 0, 0), 0.1, (4, 4, 4))), "state is 3"),
        (lambda: build(np.full((4, 4, 4), np.nan), Grid((0, 0, 0), 0.1, (4, 4, 4))), "floating point"),
        (lambda: build(np.ones((4, 4, 4), np.uint8), Grid((0, 0, 0), 0.1, (4, 4, 4)), cap_m=-1.0), "cap_m"),
        (lambda: build(np.ones((4, 4, 4), np.uint8), Grid((0, 0, 0), 0.1, (4, 4, 4)), cap_m=math.nan), "cap_m"),
        (lambda: build(np.ones((4, 4, 4), np.uint8), Grid((0, 0, 0), 0.1, (4, 4, 4)), unknown="free"), "choose"),
    ],
)
def test_bad_input_is_refused_with_the_reason(call, message):
    with pytest.raises(InputError, match=message):
        call()
