"""Volumes with every brick of their grid kept, as the dense arrays that tests read and write."""

import numpy as np

from esdf import Grid
from mapping.dense import fusion
from mapping.dense.fusion import BRICK, Volume


def whole_volume(grid: Grid, *, truncation_m: float, channels: int = 1) -> Volume:
    """Without measurements."""
    everywhere = np.ones_like(fusion.no_bricks(grid))
    return fusion.empty_volume(grid, everywhere, truncation_m=truncation_m, channels=channels)


def in_bricks(values: np.ndarray) -> np.ndarray:
    """(bricks, BRICK, BRICK, BRICK) of (nx, ny, nz), with 0 beyond."""
    padded = np.pad(values, [(0, -n % BRICK) for n in values.shape])
    x, y, z = (n // BRICK for n in padded.shape)
    return padded.reshape(x, BRICK, y, BRICK, z, BRICK).transpose(0, 2, 4, 1, 3, 5).reshape(-1, BRICK, BRICK, BRICK)


def filled(distance_m: np.ndarray, voxel_m: float = 0.1) -> Volume:
    """A fully observed volume with these distances (nx, ny, nz)."""
    grid = Grid((0.0, 0.0, 0.0), (voxel_m, voxel_m, voxel_m), distance_m.shape)
    volume = whole_volume(grid, truncation_m=3 * voxel_m)
    volume.distance[...] = in_bricks(distance_m)
    volume.weight[...] = volume.colour_weight[...] = in_bricks(np.ones(distance_m.shape))
    return volume
