"""The map from above, at one height: a picture that a page without a 3D view can show."""

import base64
import io

import numpy as np

import esdf
from flight import FloatArray
from gcs_web.map.slices import Picture
from gcs_web.protocol.map import MapSection, Slice
from mapping import Map

MOST_PIXELS = 512
"""Of a picture's longer side; a voxel is never more than one."""
_OBSTACLE, _NEAR, _UNKNOWN = (150, 160, 170, 255), (150, 160, 170, 78), (96, 106, 116, 120)
_FREE = (0, 0, 0, 0)
_STRIPE_PX = 4


def of(area: Map, height_m: float, required_m: float) -> MapSection:
    """A section at a height (world z), in the map's box; nearer than `required_m` to an obstacle it is shaded."""
    grid = area.field.grid
    low, high = np.array(grid.low_world_m), np.array(grid.high_world_m)
    at_m = float(np.clip(height_m, low[2] + 0.5 * grid.voxel_m[2], high[2] - 0.5 * grid.voxel_m[2]))
    cells = np.array(grid.shape[:2])
    width, height = np.maximum(cells // max(1, -(-int(cells.max()) // MOST_PIXELS)), 1).tolist()
    across = low[0] + (np.arange(width) + 0.5) * (high[0] - low[0]) / width
    down = high[1] - (np.arange(height) + 0.5) * (high[1] - low[1]) / height
    points = np.stack([*np.meshgrid(across, down), np.full((height, width), at_m)], axis=-1)
    rgba = _coloured(area.field, points.reshape(-1, 3), required_m).reshape(height, width, 4)
    return MapSection(_png(rgba), (float(low[0]), float(low[1])), (float(high[0]), float(high[1])), round(at_m, 2))


def of_slice(picture: Picture, wanted: Slice) -> MapSection:
    """A level slice of the 3D view, as it is there."""
    half = 0.5 * np.array(picture.size_m)
    low, high = picture.centre_world_m[:2] - half, picture.centre_world_m[:2] + half
    corners = (float(low[0]), float(low[1])), (float(high[0]), float(high[1]))
    return MapSection(_encoded(picture.rgba), *corners, round(wanted.at_m, 2), wanted.of)


def _coloured(field: esdf.Field, points_world_m: FloatArray, required_m: float) -> np.ndarray:
    """(n, 4) uint8: filled in an obstacle, pale near one, striped where nothing is known, clear where there is room."""
    distance_m = np.nan_to_num(field.distance(points_world_m), nan=-1.0)
    known = field.status(points_world_m) == esdf.KNOWN
    rgba = np.empty((len(points_world_m), 4), dtype=np.uint8)
    rgba[:] = _FREE
    rgba[distance_m < required_m] = _NEAR
    rgba[distance_m < 0.0] = _OBSTACLE
    rgba[~known] = _UNKNOWN
    return rgba


def _png(rgba: np.ndarray) -> str:
    row, column = np.indices(rgba.shape[:2])
    unknown = (rgba == _UNKNOWN).all(axis=-1)
    rgba[unknown & ((row + column) % _STRIPE_PX != 0), 3] //= 3
    return _encoded(rgba)


def _encoded(rgba: np.ndarray) -> str:
    from PIL import Image

    file = io.BytesIO()
    Image.fromarray(rgba).save(file, "PNG", optimize=True)
    return base64.b64encode(file.getvalue()).decode()
