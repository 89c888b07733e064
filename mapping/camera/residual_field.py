"""Reprojection errors over image, angle and time: what a wrong lens or clock leaves has a pattern, noise has none."""

from typing import Any

import numpy as np

from flight import FloatArray, frames
from mapping.camera.rig import Camera

COLUMNS = 16
"""Cells along the image's width; they are squares but for rounding."""
RINGS = 12
"""Intervals of the angle from the optical axis."""


def field(camera: Camera, T_world_camera: FloatArray, points_world_m: FloatArray, pixels: FloatArray) -> dict[str, Any]:
    """Statistics of a camera's errors, cell by cell, for JSON.

    Args:
        T_world_camera: (n, 4, 4) of each observation; points_world_m: (n, 3); pixels: (n, 2) where it was seen.

    Returns:
        `camera`, `width`, `height` of the image, and rows of cells: `count` of observations, `mean_px` (x, y; observed
        less projected) and `rms_px`, both None in an empty cell.
    """
    rows = max(1, round(COLUMNS * camera.height / camera.width))
    error_px = pixels - camera.project(_in_camera(T_world_camera, points_world_m))
    column = _interval(pixels[:, 0], np.linspace(0.0, camera.width, COLUMNS + 1))
    row = _interval(pixels[:, 1], np.linspace(0.0, camera.height, rows + 1))
    count, mean_px, rms_px = _statistics(error_px, row * COLUMNS + column, rows * COLUMNS)

    def in_rows(values: list[Any]) -> list[list[Any]]:
        return [values[k : k + COLUMNS] for k in range(0, len(values), COLUMNS)]

    return {
        "camera": camera.name,
        "width": camera.width,
        "height": camera.height,
        "count": in_rows(count),
        "mean_px": in_rows(mean_px),
        "rms_px": in_rows(rms_px),
    }


def over_radius(
    camera: Camera, T_world_camera: FloatArray, points_world_m: FloatArray, pixels: FloatArray
) -> dict[str, Any]:
    """Statistics of a camera's errors over the angle from its optical axis, for JSON.

    Args:
        As of `field`.

    Returns:
        `camera`; `angle_rad`, the `RINGS` + 1 bounds of intervals of equal width up to the largest angle of a point;
        and of each interval `count`, `mean_radial_px` (the error's part along the radius, positive outwards) and
        `rms_px` (of the whole error), both None in an empty interval.
    """
    points_camera = _in_camera(T_world_camera, points_world_m)
    projected = camera.project(points_camera)
    error_px, outwards = pixels - projected, projected - camera.principal_point_px
    azimuth = np.arctan2(outwards[:, 1], outwards[:, 0])
    cosine, sine = np.cos(azimuth), np.sin(azimuth)
    radial_px = cosine * error_px[:, 0] + sine * error_px[:, 1]
    tangential_px = cosine * error_px[:, 1] - sine * error_px[:, 0]
    angle_rad = np.arctan2(np.hypot(points_camera[:, 0], points_camera[:, 1]), points_camera[:, 2])
    bounds_rad = np.linspace(0.0, angle_rad[np.isfinite(error_px).all(axis=1)].max(initial=0.0), RINGS + 1)
    ring = _interval(angle_rad, bounds_rad)
    count, mean_px, rms_px = _statistics(np.stack([radial_px, tangential_px], axis=1), ring, RINGS)
    return {
        "camera": camera.name,
        "angle_rad": bounds_rad.tolist(),
        "count": count,
        "mean_radial_px": [None if mean is None else mean[0] for mean in mean_px],
        "rms_px": rms_px,
    }


def over_time(
    camera: Camera,
    T_world_camera: FloatArray,
    points_world_m: FloatArray,
    pixels: FloatArray,
    image: np.ndarray,
    images: int,
) -> dict[str, Any]:
    """Statistics of a camera's errors, image by image, for JSON.

    Args:
        As of `field`, and image: (n,) number of the image of each observation; images: how many there are.

    Returns:
        `camera`, and of each image `count`, `mean_px` (x, y) and `rms_px`, both None where nothing was observed.
    """
    error_px = pixels - camera.project(_in_camera(T_world_camera, points_world_m))
    count, mean_px, rms_px = _statistics(error_px, image, images)
    return {"camera": camera.name, "count": count, "mean_px": mean_px, "rms_px": rms_px}


def _in_camera(T_world_camera: FloatArray, points_world_m: FloatArray) -> FloatArray:
    return frames.apply(frames.invert(T_world_camera), points_world_m)


def _interval(values: FloatArray, bounds: FloatArray) -> np.ndarray:
    """(n,) which of the intervals between the bounds (k,) each value is in; the nearest one if it is in none."""
    return np.clip(np.searchsorted(bounds, values, side="right") - 1, 0, len(bounds) - 2)


def _statistics(
    error_px: FloatArray, group: np.ndarray, groups: int
) -> tuple[list[int], list[list[float] | None], list[float | None]]:
    """Count, mean and RMS of the errors (n, 2) of each group, both None in an empty one; NaN errors do not count."""
    usable = np.isfinite(error_px).all(axis=1)
    error_px, group = error_px[usable], group[usable]
    count = np.bincount(group, minlength=groups)
    x, y, squared = (
        np.bincount(group, values, minlength=groups) / np.maximum(count, 1)
        for values in (error_px[:, 0], error_px[:, 1], (error_px**2).sum(axis=1))
    )
    mean = [[float(a), float(b)] if n else None for n, a, b in zip(count, x, y, strict=True)]
    rms = [float(np.sqrt(s)) if n else None for n, s in zip(count, squared, strict=True)]
    return count.tolist(), mean, rms
