"""Closed-form distances: checked against brute force, and rasterised without losing any of it."""

import numpy as np
import pytest

from esdf import OCCUPIED, Grid, rasterize, solids
from flight import InputError, rotations

SOLIDS = [
    solids.Box((-0.4, -0.3, -0.2), (0.5, 0.3, 0.6)),
    solids.OrientedBox((0.1, 0.0, 0.1), (0.5, 0.2, 0.3), tuple(rotations.exp([0.3, -0.5, 0.9]))),
    solids.Sphere((0.1, -0.2, 0.0), 0.5),
    solids.Cylinder((0.0, 0.1, 0.1), 0.4, 0.9),
    solids.Capsule((-0.4, -0.2, -0.3), (0.5, 0.3, 0.4), 0.2),
    solids.Prism(((-0.5, -0.5), (0.6, -0.4), (0.1, 0.0), (0.5, 0.6), (-0.4, 0.4)), -0.5, 0.4),
    solids.Room((-0.5, -0.6, -0.4), (0.6, 0.5, 0.7)),
    solids.Scene([solids.Sphere((0.5, 0.0, 0.0), 0.3), solids.Box((-0.6, -0.5, -0.5), (-0.2, 0.5, 0.5))]),
]
NAMES = [type(s).__name__ for s in SOLIDS]


@pytest.mark.parametrize("solid", SOLIDS, ids=NAMES)
def test_distance_is_that_to_the_nearest_point_of_the_surface(solid):
    rng = np.random.default_rng(0)
    cloud = rng.uniform(-1.2, 1.2, (400_000, 3))
    on_surface = cloud[np.abs(solid.distance(cloud)) < 0.01]
    points = rng.uniform(-1, 1, (200, 3))
    nearest = np.array([np.linalg.norm(on_surface - p, axis=1).min() for p in points])
    distance = solid.distance(points)
    outside = distance > 0 if isinstance(solid, solids.Scene) else np.ones(len(points), bool)
    np.testing.assert_allclose(np.abs(distance[outside]), nearest[outside], atol=0.05)


@pytest.mark.parametrize("solid", SOLIDS, ids=NAMES)
def test_distance_never_changes_by_more_than_the_way_travelled(solid):
    rng = np.random.default_rng(1)
    a, b = rng.uniform(-1.5, 1.5, (2, 5000, 3))
    way = np.linalg.norm(a - b, axis=1)
    assert (np.abs(solid.distance(a) - solid.distance(b)) <= way + 1e-12).all()


@pytest.mark.parametrize("solid", SOLIDS, ids=NAMES)
def test_rasterising_covers_every_point_of_the_solid(solid):
    rng = np.random.default_rng(2)
    grid = Grid.covering((-1, -1, -1), (1, 1, 1), 0.07)
    state = rasterize(solid, grid)
    points = rng.uniform(-1, 1, (50_000, 3))
    inside = points[solid.distance(points) < 0]
    assert (state[tuple(grid.index(inside).T)] == OCCUPIED).all()
    centres = grid.centres()[state == OCCUPIED]
    assert (solid.distance(centres) <= grid.half_diagonal_m).all()


def test_a_box_on_voxel_boundaries_fills_exactly_its_voxels():
    grid = Grid((0, 0, 0), 0.1, (10, 10, 10))
    state = rasterize(solids.Box((0.2, 0.3, 0.4), (0.5, 0.7, 0.9)), grid)
    expected = np.zeros(grid.shape, bool)
    expected[2:5, 3:7, 4:9] = True
    np.testing.assert_array_equal(state == OCCUPIED, expected)
    walls = rasterize(solids.Room((0.1, 0.1, 0.1), (0.9, 0.9, 0.9)), grid)
    assert (walls == OCCUPIED).sum() == 10**3 - 8**3


@pytest.mark.parametrize(
    "make",
    [
        lambda: solids.Box((0, 0, 0), (1, 0, 1)),
        lambda: solids.Sphere((0, 0, 0), -1.0),
        lambda: solids.Sphere((0, np.nan, 0), 1.0),
        lambda: solids.Cylinder((0, 0, 0), 1.0, 0.0),
        lambda: solids.Capsule((0, 0), (1, 0, 0), 0.1),
        lambda: solids.Prism(((0, 0), (1, 1)), 0, 1),
        lambda: solids.Prism(((0, 0), (1, 1), (2, 2)), 0, 1),
        lambda: solids.OrientedBox((0, 0, 0), (1, 1, 1), (0, 0, 0, 0)),
    ],
)
def test_degenerate_solids_are_refused(make):
    with pytest.raises(InputError):
        make()
