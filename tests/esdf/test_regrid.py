"""Cropping, merging, resampling: the map stays what it was, or becomes more careful, never less."""

import numpy as np
import pytest

from esdf import FREE, OCCUPIED, UNKNOWN, Grid, build
from esdf.grid import Region
from esdf.regrid import coarser_state, crop, merge, resample
from flight import InputError


def random_field(seed, origin=(0.0, 0.0, 0.0), shape=(24, 20, 16)):
    rng = np.random.default_rng(seed)
    state = rng.choice(3, size=shape, p=[0.02, 0.96, 0.02]).astype(np.uint8)
    return build(state, Grid(origin, 0.1, shape), cap_m=0.8)


def test_two_halves_merge_to_the_whole():
    whole = random_field(0)
    left, right = crop(whole, Region((0, 0, 0), (14, 20, 16))), crop(whole, Region((10, 0, 0), (24, 20, 16)))
    for merged in (merge(left, right), merge(right, left)):
        assert merged.grid.shape == whole.grid.shape
        np.testing.assert_array_equal(merged.values_m, whole.values_m)


def test_a_crop_is_never_more_permissive_than_the_map():
    whole = random_field(1)
    part = crop(whole, Region((4, 4, 4), (20, 16, 12)))
    points = np.random.default_rng(2).uniform(part.grid.low_world_m, part.grid.high_world_m, (2000, 3))
    assert (part.distance(points) <= whole.distance(points) + whole.grid.half_diagonal_m).all()


@pytest.mark.parametrize("voxel", [0.05, 0.1, 0.17, 0.3])
def test_resampling_loses_no_obstacle_and_frees_nothing_unknown(voxel):
    field = random_field(3)
    other = resample(field, Grid.covering((-0.3, 0.2, 0.1), (2.6, 1.9, 1.4), voxel))
    points = np.random.default_rng(4).uniform((-0.3, 0.2, 0.1), (2.6, 1.9, 1.4), (50_000, 3))
    points = points[other.grid.contains(points)]
    new = other.state[tuple(other.grid.index(points).T)]
    inside = field.grid.contains(points)
    assert (new[~inside] != FREE).all()
    old = field.state[tuple(field.grid.index(points[inside]).T)]
    assert (new[inside][old == OCCUPIED] == OCCUPIED).all()
    assert (new[inside][old == UNKNOWN] != FREE).all()


def test_resampling_to_the_same_lattice_changes_nothing():
    field = random_field(5)
    assert resample(field, field.grid).hash == field.hash


def test_a_coarser_level_shows_every_obstacle():
    field = random_field(6)
    coarse = coarser_state(field.state, 5)
    assert coarse.shape == (5, 4, 4)
    at = np.argwhere(field.state == OCCUPIED) // 5
    assert (coarse[tuple(at.T)] == OCCUPIED).all()


@pytest.mark.parametrize(
    "other",
    [
        lambda: random_field(1, origin=(0.05, 0.0, 0.0)),
        lambda: build(np.ones((4, 4, 4), np.uint8), Grid((0, 0, 0), 0.2, (4, 4, 4)), cap_m=0.8),
        lambda: build(np.ones((4, 4, 4), np.uint8), Grid((0, 0, 0), 0.1, (4, 4, 4)), cap_m=0.9),
    ],
)
def test_maps_that_do_not_fit_are_not_merged(other):
    with pytest.raises(InputError):
        merge(random_field(0), other())


def test_a_crop_outside_of_the_map_is_refused():
    with pytest.raises(InputError):
        crop(random_field(0), Region((30, 0, 0), (40, 5, 5)))
