"""Reprojection errors over the image: what a wrong lens leaves has a pattern, noise has none."""

from typing import Any

import numpy as np

from flight import FloatArray, frames
from mapping.camera.rig import Camera

COLUMNS = 16
"""Cells along the image's width; they are squares but for rounding."""


def field(camera: Camera, T_world_camera: FloatArray, points_world_m: FloatArray, pixels: FloatArray) -> dict[str, Any]:
    """Statistics of a camera's errors, cell by cell, for JSON.

    Args:
        T_world_camera: (n, 4, 4) of each observation; points_world_m: (n, 3); pixels: (n, 2) where it was seen.

    Returns:
        `camera`, `width`, `height` of the image, and rows of cells: `count` of observations, `mean_px` (x, y; observed
        less projected) and `rms_px`, both None in an empty cell.
    """
    rows = max(1, round(COLUMNS * camera.height / camera.width))
    points_camera = frames.apply(frames.invert(T_world_camera), points_world_m)
    error = pixels - camera.project(points_camera)
    usable = np.isfinite(error).all(axis=1)
    error, seen = error[usable], pixels[usable]
    column = np.clip(seen[:, 0] * COLUMNS / camera.width, 0, COLUMNS - 1).astype(int)
    row = np.clip(seen[:, 1] * rows / camera.height, 0, rows - 1).astype(int)
    cell = row * COLUMNS + column
    count = np.bincount(cell, minlength=rows * COLUMNS)
    x, y, squared = (
        np.bincount(cell, values, minlength=rows * COLUMNS) / np.maximum(count, 1)
        for values in (error[:, 0], error[:, 1], (error**2).sum(axis=1))
    )
    cells = [
        ([float(a), float(b)], float(np.sqrt(c))) if n else (None, None)
        for n, a, b, c in zip(count, x, y, squared, strict=True)
    ]

    def in_rows(values: list[Any]) -> list[list[Any]]:
        return [values[k : k + COLUMNS] for k in range(0, len(values), COLUMNS)]

    return {
        "camera": camera.name,
        "width": camera.width,
        "height": camera.height,
        "count": in_rows(count.tolist()),
        "mean_px": in_rows([mean for mean, _ in cells]),
        "rms_px": in_rows([rms for _, rms in cells]),
    }
