"""Voxels that a mesh touches: against points on it, and against the planes of boxes."""

import numpy as np
import pytest

from esdf import Grid, triangles

GRID = Grid((-1.0, -1.0, -1.0), (0.05, 0.05, 0.05), (40, 40, 40))


def random_mesh(seed: int, count: int, size_m: float) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    corners = rng.uniform(-0.8, 0.8, (count, 1, 3)) + rng.uniform(-size_m, size_m, (count, 3, 3))
    return corners.reshape(-1, 3), np.arange(3 * count, dtype=np.int32).reshape(-1, 3)


@pytest.mark.parametrize("size_m", [0.01, 0.1, 1.0])
def test_every_voxel_with_a_point_of_the_mesh_is_touched_and_few_others(size_m: float) -> None:
    vertices, faces = random_mesh(3, 12, size_m)
    hit = triangles.touched(vertices, faces, GRID)
    weights = np.random.default_rng(4).dirichlet([1.0, 1.0, 1.0], 40_000)
    points = np.einsum("nk,fkd->fnd", weights, vertices[faces]).reshape(-1, 3)
    index = GRID.index(points[GRID.contains(points)])
    sampled = np.zeros(GRID.shape, bool)
    sampled[tuple(np.clip(index, 0, 39).T)] = True
    assert not (sampled & ~hit).any()
    assert hit.sum() <= 1.3 * sampled.sum() + 3, "corners of voxels that random points miss"


def test_moving_mesh_and_grid_together_changes_nothing() -> None:
    vertices, faces = random_mesh(5, 20, 0.4)
    moved = Grid(tuple(GRID.low_world_m + 3.0), GRID.voxel_m, GRID.shape)
    assert np.array_equal(triangles.touched(vertices, faces, GRID), triangles.touched(vertices + 3.0, faces, moved))


def test_a_face_between_two_layers_touches_both_and_one_inside_a_layer_that_one() -> None:
    corners = np.array([[-0.5, -0.5, 0.0], [0.5, -0.5, 0.0], [-0.5, 0.5, 0.0]])
    one = np.array([[0, 1, 2]], np.int32)
    between = triangles.touched(corners, one, GRID)
    inside = triangles.touched(corners + np.array([0.0, 0.0, 0.02]), one, GRID)
    assert set(np.nonzero(between)[2]) == {19, 20}
    assert set(np.nonzero(inside)[2]) == {20}
