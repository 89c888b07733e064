"""The thinnest resolved obstacle, voxel by voxel and over the free space."""

import numpy as np
import pytest

from esdf import FREE, UNKNOWN, Grid
from esdf.visibility import View, look
from mapping.camera.rig import Camera
from mapping.dense import resolution

GRID = Grid((0.0, 0.0, 0.0), (0.1,) * 3, (23, 10, 9))
EYE_M = (0.15, 0.5, 0.45)


def test_every_voxel_has_the_thickness_of_the_place_it_lies_in() -> None:
    seen = look(np.full(GRID.shape, FREE), GRID, [View(EYE_M, (1.0, 0.0, 0.0), 0.6, 1 / 250)])
    finest = resolution.finest_of_voxels(seen, GRID)
    assert finest.shape == GRID.shape
    assert 0.1 < np.isfinite(finest).mean() < 0.9
    cells = np.argwhere(finest >= 0.0)
    np.testing.assert_array_equal(finest.ravel(), seen.finest(GRID.centre(cells)).astype(np.float32))


def test_a_camera_resolves_what_is_wide_enough_in_its_image() -> None:
    camera = Camera("c", ".", "PINHOLE", 400, 400, np.array([200.0, 200.0, 200.0, 200.0]), np.eye(4))
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]), EYE_M
    seen = resolution.visibility(np.full(GRID.shape, FREE), GRID, [(camera, T)])
    at_m = 2.0
    expected_m = resolution.RESOLVED_PX * at_m / 200.0
    assert seen.finest([[EYE_M[0] + at_m, *EYE_M[1:]]])[0] == pytest.approx(expected_m, rel=0.35)
    assert seen.finest([[EYE_M[0] + at_m, *EYE_M[1:]]])[0] >= expected_m


def test_the_figures_of_the_free_space_leave_out_what_is_not_resolved() -> None:
    seen = look(np.full(GRID.shape, FREE), GRID, [View(EYE_M, (1.0, 0.0, 0.0), 0.6, 1 / 250)])
    resolved = np.isfinite(resolution.finest_of_voxels(seen, GRID))
    figures = resolution.thickness_quantiles_m(seen, GRID, resolved)
    half, most = figures.values()
    assert 0.0 < half < most
    assert resolution.thickness_quantiles_m(seen, GRID, ~resolved) == {}
    assert resolution.thickness_quantiles_m(seen, GRID, np.full(GRID.shape, UNKNOWN, bool)) == {}
