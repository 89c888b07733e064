"""A horizontal slice of a map for ROS: the image and YAML file of `map_server` (REP 105, frame `map`)."""

import io
from pathlib import PurePath

import numpy as np
from numpy.typing import NDArray

from esdf import FREE, OCCUPIED, UNKNOWN, Field, Grid
from flight import InputError

_GREYS = {FREE: 254, OCCUPIED: 0, UNKNOWN: 205}
"""As `map_saver` writes them; the thresholds below are its own."""


def slice_at(field: Field, height_m: float) -> NDArray[np.uint8]:
    """(nx, ny) states of the voxels at a height.

    Raises:
        InputError: the map does not reach there, or its voxels are not square.
    """
    low_m, high_m = float(field.grid.low_world_m[2]), float(field.grid.high_world_m[2])
    if not low_m <= height_m < high_m:
        raise InputError(f"--height is {height_m:g} m; the map reaches from {low_m:.2f} to {high_m:.2f} m")
    if field.grid.voxel_m[0] != field.grid.voxel_m[1]:
        raise InputError(f"the voxels are {field.grid.voxel_m[:2]} m wide; ROS wants squares")
    return field.state[:, :, int(field.grid.index(np.array([[0.0, 0.0, height_m]]))[0, 2])]


def pgm(states: NDArray[np.uint8]) -> bytes:
    """The image of a slice (nx, ny): x right, y up."""
    from PIL import Image

    greys = np.array([_GREYS[state] for state in sorted(_GREYS)], np.uint8)[states]
    coded = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(greys.T[::-1])).save(coded, format="PPM")
    return coded.getvalue()


def yaml(image: str, grid: Grid) -> str:
    """The file beside the image.

    Args:
        image: its name.
    """
    x_m, y_m, _ = grid.origin_world_m
    name = PurePath(image).name.replace("'", "''")
    return (
        f"image: '{name}'\nmode: trinary\nresolution: {grid.voxel_m[0]!r}\norigin: [{x_m!r}, {y_m!r}, 0.0]\n"
        "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
