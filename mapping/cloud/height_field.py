"""Digital elevation models as voxels: an ESRI ASCII grid (`.asc`) or a GeoTIFF (`.tif`), one height a cell.

A height field says where the ground or the canopy is, as seen from above. What lies under it is unknown, as bridges and
trees hide it; what lies over it is unknown as well, unless a user states that nothing does. Cells without data leave
their columns unknown. Between neighbouring cells the surface is closed: a cliff is a wall.
"""

import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from esdf import FREE, OCCUPIED, UNKNOWN, Grid
from flight import FloatArray, FormatError, InputError, errors
from mapping import reach
from mapping.foreign_mesh import UNITS_M, origin_remedy
from mapping.imported import Space, require_few

SUFFIXES = (".asc", ".tif", ".tiff")
MOST_CELLS = 25_000_000
LARGEST_BYTES = 600_000_000
"""Of an ASCII grid; 25 million cells have less."""
CELLS_M = (0.02, 100.0)
_LEAST_CELLS = 2
_SCALE, _TIE, _NODATA, _KEYS = 33550, 33922, 42113, 34735
"""GeoTIFF's tags: size of a pixel, a pixel's place, the value for no data (GDAL's), and the directory of keys."""
_MODEL, _RASTER, _GEOGRAPHIC, _POINTS = 1024, 1025, 2, 2
"""GeoTIFF's keys: of a model in degrees, and of pixels that are points."""
_PROJECTION, _UNIT_OF_PLANE, _UNIT_OF_HEIGHTS = 3072, 3076, 4099
_KEYED = {9001: ("m", 1.0), 9002: ("ft", 0.3048), 9003: ("ft of the US survey", 1200 / 3937)}
"""GeoTIFF's numbers of units, and metres of each."""
HIGHEST_M = 9000.0
"""Beyond it, above or below, a height is no place on the ground: it means that there is no data."""
_NEVER_HEIGHTS = (-9999.0, -32767.0, -32768.0)
"""Values that mean no data where a file does not say so."""


@dataclass(frozen=True, slots=True, eq=False)
class HeightField:
    """Heights over a grid, x east and y north."""

    height_m: FloatArray
    """(nx, ny) z of each cell; NaN where there is no data."""
    cell_m: float
    low_m: FloatArray
    """(2,) the lower corner of the first cell."""
    unit: str = "m"
    """Of the file, and why."""


@dataclass(frozen=True, slots=True, eq=False)
class _Raster:
    """What a file holds, in its numbers."""

    height: FloatArray
    """(nx, ny); NaN where there is no data."""
    cell: float
    low: FloatArray
    """(2,)."""
    unit: tuple[str, float] | None = None
    """As the file states it, with its metres."""


def read(path: Path, *, origin: FloatArray | None = None, unit: str | None = None) -> HeightField:
    """Read a digital elevation model.

    Args:
        origin: (3,) in the file's numbers, what becomes the origin of the map's frame; None: the file's own.
        unit: one of `UNITS_M`, of cells and heights; None: as the file states it, else metres.

    Raises:
        InputError: there is no such file, it is too large, in degrees or an unknown unit, or too far from the origin.
        FormatError: it cannot be read, or holds no height.
    """
    if not path.is_file():
        raise errors.missing(path)
    raster = _ascii(path) if path.suffix.lower() == ".asc" else _geotiff(path, unit)
    unit_m, because = _unit(raster, unit)
    if not CELLS_M[0] <= raster.cell * unit_m <= CELLS_M[1]:
        raise InputError(
            f"{path}: a cell is {raster.cell * unit_m:g} wide; it must be {CELLS_M[0]:g} to {CELLS_M[1]:g} m. Of "
            "degrees make metres first, as gdalwarp -t_srs EPSG:32632 does"
        )
    with np.errstate(invalid="ignore"):
        is_known = np.isfinite(raster.height) & (np.abs(raster.height) * unit_m <= HIGHEST_M)
    height = np.where(is_known & ~np.isin(raster.height, _NEVER_HEIGHTS), raster.height, np.nan)
    if not np.isfinite(height).any():
        raise FormatError(f"{path} holds no height: all of its cells are without data")
    first = np.array([*raster.low, np.nanmin(height)])
    shift = np.zeros(3) if origin is None else origin
    moved = HeightField((height - shift[2]) * unit_m, raster.cell * unit_m, (raster.low - shift[:2]) * unit_m, because)
    ends = np.array([moved.low_m, moved.low_m + moved.cell_m * np.array(moved.height_m.shape)])
    heights = np.array([np.nanmin(moved.height_m), np.nanmax(moved.height_m)])
    reach.require_near_origin(np.column_stack([ends, heights]), str(path), origin_remedy(first))
    return moved


def _unit(raster: _Raster, given: str | None) -> tuple[float, str]:
    """Metres of the unit, and the words for it."""
    if given is not None:
        return UNITS_M[given], f"{given} (as given)"
    if raster.unit is not None:
        name, metres = raster.unit
        return metres, f"{name} (the file's GeoTIFF key)"
    return 1.0, "m (assumed: the file does not say; else give --unit)"


def space(field: HeightField, voxel_m: float, free_m: tuple[float, float] | None) -> Space:
    """Voxels of a height field: the surface occupied, what is below unknown, and what is above free as it is stated.

    Args:
        free_m: z in the map between which all above the surface is stated to be free; None: it is unknown.

    Raises:
        InputError: too many voxels, or all of the surface is above `free_m`.
    """
    low_m, high_m = float(np.nanmin(field.height_m)), float(np.nanmax(field.height_m))
    from_m, to_m = free_m or (low_m, low_m)
    if free_m is not None and not max(from_m, low_m) < to_m:
        raise InputError(
            f"--heights is {from_m:g},{to_m:g} m; it must rise, and end above the lowest place, {low_m:.2f} m"
        )
    reach.require_near_origin(np.array([from_m, to_m]), "--heights")
    top_m = max(high_m, to_m)
    ends = field.low_m + field.cell_m * np.array(field.height_m.shape)
    grid = Grid.covering(np.array([*field.low_m, low_m]), np.array([*ends, top_m]), voxel_m)
    require_few(grid, "cut the elevation model", coarser=True)
    bottom, top = _columns(field, grid)
    z, layers = np.arange(grid.shape[2]), (np.array([from_m, to_m]) - grid.low_world_m[2]) / voxel_m
    first, last = int(np.ceil(layers[0] - 1e-6)), int(np.floor(layers[1] + 1e-6))  # none reaches beyond
    state = np.full(grid.shape, UNKNOWN, np.uint8)
    for i in range(grid.shape[0]):  # a slice at a time: the comparisons take as much memory as they have voxels
        lowest, highest = bottom[i, :, None], top[i, :, None]
        state[i][(z >= lowest) & (z <= highest)] = OCCUPIED
        state[i][(z > highest) & (z >= first) & (z < last) & (highest >= 0)] = FREE
    return Space(grid, state)


def _columns(field: HeightField, grid: Grid) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(nx, ny) the lowest and the highest voxel of the surface in each column; 1 and -1 where there is no data.

    A column that reaches beyond the cells has none.
    """
    from scipy import ndimage

    # up to the straight line to the highest neighbour, half of which lies in the cell, and down to the lowest one
    z, known = field.height_m, np.isfinite(field.height_m)
    lowest = ndimage.minimum_filter(np.where(known, z, np.inf), 3, mode="nearest")
    highest = np.where(known, 0.5 * (z + ndimage.maximum_filter(np.where(known, z, -np.inf), 3, mode="nearest")), 0.0)
    at, inside = [], []
    for axis in (0, 1):
        edges_m = grid.low_world_m[axis] + grid.voxel_m[axis] * np.arange(grid.shape[axis] + 1)
        cells = (edges_m - field.low_m[axis]) / field.cell_m
        last = field.height_m.shape[axis] - 1
        inside.append((cells[:-1] > -1e-6) & (cells[1:] < last + 1 + 1e-6))
        at.append((np.clip(np.floor(cells[:-1]), 0, last), np.clip(np.ceil(cells[1:]) - 1, 0, last)))
    (x0, x1), (y0, y1) = ((a.astype(int), b.astype(int)) for a, b in at)
    bottom, top = np.full(grid.shape[:2], np.inf), np.full(grid.shape[:2], -np.inf)
    is_known = inside[0][:, None] & inside[1][None]
    widest = int(max((x1 - x0).max(), (y1 - y0).max())) + 1
    for dx in range(widest):
        for dy in range(widest):
            i, j = np.minimum(x0 + dx, x1)[:, None], np.minimum(y0 + dy, y1)[None]
            bottom, top = np.minimum(bottom, lowest[i, j]), np.maximum(top, highest[i, j])
            is_known &= known[i, j]
    index = [np.floor((np.where(is_known, z, 0.0) - grid.low_world_m[2]) / grid.voxel_m[2]) for z in (bottom, top)]
    low, high = (np.clip(each, 0, grid.shape[2] - 1).astype(np.int64) for each in index)
    return np.where(is_known, low, 1), np.where(is_known, high, -1)


def surface(field: HeightField) -> tuple[FloatArray, NDArray[np.int32]]:
    """Vertices (v, 3) at the middles of cells, and faces (f, 3) upward between four that have heights.

    Raises:
        InputError: no four cells in a square have heights.
    """
    known = np.isfinite(field.height_m)
    number = np.where(known, np.cumsum(known.ravel()).reshape(known.shape) - 1, -1)
    cells = np.argwhere(known)
    vertices = np.column_stack([field.low_m + field.cell_m * (cells + 0.5), field.height_m[known]])
    a, b, c, d = (part.ravel() for part in (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]))
    whole = (np.stack([a, b, c, d]) >= 0).all(axis=0)
    faces = np.concatenate([np.stack(each, axis=1)[whole] for each in ((a, b, c), (a, c, d))])
    if not len(faces):
        raise InputError("no four neighbouring cells have heights: there is no surface to plan above")
    return vertices, faces.astype(np.int32)


def _ascii(path: Path) -> _Raster:
    if (size := path.stat().st_size) > LARGEST_BYTES:
        raise InputError(f"{path} has {size / 1e6:,.0f} MB, at most {LARGEST_BYTES / 1e6:g} MB are read: cut it")
    try:
        lines = path.read_text(encoding="ascii").splitlines()
    except UnicodeDecodeError:
        raise FormatError(f"{path} is not an ASCII grid; it holds other characters") from None
    said: dict[str, float] = {}
    start = 0
    for start, line in enumerate(lines):
        words = line.split()
        if len(words) != 2 or not words[0][:1].isalpha():
            break
        said[words[0].lower()] = _number(path, start + 1, words[1])
    columns, rows = (int(_header(path, said, name)) for name in ("ncols", "nrows"))
    _require_few_cells(path, columns, rows)
    cell_m = _header(path, said, "cellsize")
    of_centre = "xllcenter" in said
    corner = [_header(path, said, f"{axis}ll{'center' if of_centre else 'corner'}") for axis in "xy"]
    try:
        heights = np.array(" ".join(lines[start:]).split(), np.float64)
    except ValueError as error:
        raise FormatError(f"{path}: {str(error)[:80]}; a height must be a number") from None
    if heights.size != rows * columns:
        raise FormatError(
            f"{path} has {heights.size:,} heights; {columns} columns of {rows} rows are {rows * columns:,}"
        )
    _clear(heights, said.get("nodata_value", -9999.0), 1e-6)
    low = np.array(corner) - (0.5 * cell_m if of_centre else 0.0)
    return _Raster(heights.reshape(rows, columns)[::-1].T, cell_m, low)


def _clear(heights: FloatArray, no_data: float, tolerance: float) -> None:
    """Make NaN what is the value for no data, but for the last digits in which writers differ."""
    with np.errstate(invalid="ignore", over="ignore"):
        heights[np.isclose(heights, no_data, rtol=tolerance, atol=0.0)] = np.nan


def _number(path: Path, line: int, word: str) -> float:
    try:
        return float(word)
    except ValueError:
        raise FormatError(f"{path}, line {line}: {word[:40]!r} is no number") from None


def _header(path: Path, said: dict[str, float], name: str) -> float:
    if name not in said or not np.isfinite(said[name]):
        raise FormatError(
            f"{path} has no {name}: an ASCII grid begins with ncols, nrows, xllcorner, yllcorner, cellsize"
        )
    return said[name]


def _require_few_cells(path: Path, columns: int, rows: int) -> None:
    if min(columns, rows) < _LEAST_CELLS:
        raise FormatError(f"{path} has {columns} columns and {rows} rows; at least {_LEAST_CELLS} of each are needed")
    if columns * rows > MOST_CELLS:
        raise InputError(
            f"{path} has {columns * rows / 1e6:,.0f} million cells, at most {MOST_CELLS / 1e6:g} million are read: cut "
            "it, or make it coarser"
        )


def _geotiff(path: Path, unit: str | None) -> _Raster:
    from PIL import Image

    try:
        with warnings.catch_warnings(action="ignore"), Image.open(path) as image:  # of large images and damaged tags
            _require_few_cells(path, image.width, image.height)
            tags: Any = getattr(image, "tag_v2", {})
            if image.mode not in ("F", "I", "I;16", "I;16B", "I;16L"):
                raise InputError(
                    f"{path} has pixels of kind {image.mode}, not heights: of a ROS map give the YAML file beside it"
                )
            pixels = np.asarray(image)
            said = {tag: tags.get(tag) for tag in (_SCALE, _TIE, _NODATA, _KEYS)}
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise FormatError(f"{path} cannot be read: {' '.join(str(error).split())[:200]}; export it again") from None
    return _placed(path, pixels, said, unit)


def _placed(path: Path, pixels: NDArray[Any], said: dict[int, Any], unit: str | None) -> _Raster:
    keys = np.array(said[_KEYS] or (), dtype=np.int64)[4:]
    rows = keys[: len(keys) // 4 * 4].reshape(-1, 4)
    stated = {int(key): int(value) for key, place, _, value in rows if not place}
    if stated.get(_MODEL) == _GEOGRAPHIC:
        raise InputError(f"{path} is in degrees; make metres of it first, as gdalwarp -t_srs EPSG:32632 does")
    size, tie = said[_SCALE], said[_TIE]
    if size is None or tie is None or len(size) < 2 or len(tie) < 6:
        raise InputError(f"{path} does not say where it is (no ModelPixelScale and ModelTiepoint): it is no GeoTIFF")
    if not np.isclose(size[0], size[1]):
        raise InputError(f"{path}: its cells are {size[0]:g} by {size[1]:g}; they must be squares")
    half = 0.5 if stated.get(_RASTER) == _POINTS else 0.0
    left, upper = tie[3] - (tie[0] + half) * size[0], tie[4] + (tie[1] + half) * size[0]
    heights = pixels.astype(np.float64)
    if said[_NODATA] is not None:
        no_data = _number(path, 0, str(said[_NODATA]).strip("\x00 "))
        _clear(heights, no_data, 1e-6 if pixels.dtype.kind == "f" else 0.0)
    low = np.array([left, upper - size[0] * len(heights)])
    return _Raster(heights[::-1].T, float(size[0]), low, None if unit else _keyed_unit(path, stated))


def _keyed_unit(path: Path, stated: dict[int, int]) -> tuple[str, float] | None:
    """The unit that GeoTIFF's keys state, with its metres; None where they state none.

    Raises:
        InputError: it is another than metres and feet, that of the heights is another, or it is not stated of feet.
    """
    plane, heights = stated.get(_UNIT_OF_PLANE), stated.get(_UNIT_OF_HEIGHTS)
    if strange := [code for code in (plane, heights) if code is not None and code not in _KEYED]:
        raise InputError(f"{path} is in GeoTIFF's unit {strange[0]}; metres (9001) and feet (9002, 9003) are read")
    if plane is None and heights is None:
        if _PROJECTION in stated:
            raise InputError(f"{path} names a projection and not its unit: look it up, and give --unit m or --unit ft")
        return None
    if plane is None or (heights is None and plane != 9001):
        raise InputError(
            f"{path} states the unit of its {'plane' if heights is None else 'heights'} alone; give --unit m or "
            "--unit ft if both are in it"
        )
    if heights not in (None, plane):
        raise InputError(
            f"{path} is in {_KEYED[plane][0]}, its heights in {_KEYED[heights][0]}; write it anew in one unit, by GDAL"
        )
    return _KEYED[plane]


def encode(height_m: FloatArray, cell_m: float, low_m: tuple[float, float]) -> bytes:
    """An ASCII grid of heights (nx, ny), NaN where there is none."""
    no_data = -9999.0
    head = (
        f"ncols {height_m.shape[0]}\nnrows {height_m.shape[1]}\nxllcorner {low_m[0]!r}\nyllcorner {low_m[1]!r}\n"
        f"cellsize {cell_m!r}\nNODATA_value {no_data:g}\n"
    )
    rows = np.where(np.isfinite(height_m), height_m, no_data).T[::-1]
    return (head + "".join(" ".join(f"{z:.4f}" for z in row) + "\n" for row in rows)).encode()


def of_states(state: NDArray[np.uint8], grid: Grid) -> FloatArray:
    """(nx, ny) the upper side of the highest occupied voxel of each column, z in metres; NaN where there is none."""
    occupied = state == OCCUPIED
    highest = grid.shape[2] - np.argmax(occupied[:, :, ::-1], axis=2)
    return np.where(occupied.any(axis=2), grid.low_world_m[2] + grid.voxel_m[2] * highest, np.nan)
