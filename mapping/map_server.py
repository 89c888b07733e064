"""The two-dimensional maps of ROS: image and YAML file of `map_server` (REP 105, frame `map`), written and read."""

import io
import math
import warnings
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from esdf import FREE, OCCUPIED, UNKNOWN, Field, Grid
from flight import FloatArray, FormatError, InputError, errors
from mapping import reach
from mapping.camera import yaml_import

_GREYS = {FREE: 254, OCCUPIED: 0, UNKNOWN: 205}
"""As `map_saver` writes them; the thresholds below are its own."""
CELLS_M = (0.005, 1.0)
"""Least and largest edge of a cell; beyond is a wrong unit."""
MOST_CELLS = 50_000_000
"""350 m square of cells of 5 cm; an import of one layer takes 0.8 GB of memory."""
MOST_SIDES = 2_000_000
"""Of walls, two triangles each; with them an import takes 1 GB of memory. Noise has more, floors of buildings fewer."""


@dataclass(frozen=True, slots=True, eq=False)
class Floor:
    """A map of one height."""

    state: NDArray[np.uint8]
    """(nx, ny) of its cells: free, occupied or unknown."""
    cell_m: float
    low_world_m: tuple[float, float]
    """Corner of the first cell."""


def read(path: Path, *, beside: bool = False) -> Floor:
    """Read a YAML file and its image.

    Args:
        beside: take an image of the YAML file's own folder only, for a file of somebody who may not read all others.

    Raises:
        InputError: a file is missing or not beside, or the map is turned, in another mode, or of another unit.
        FormatError: a file cannot be read, or lacks something.
    """
    said = _yaml(path)
    cell_m, (x_m, y_m, turn) = _number(path, said, "resolution"), _origin(path, said)
    if not CELLS_M[0] <= cell_m <= CELLS_M[1]:
        raise InputError(f"{path}: resolution is {cell_m:g} m; it must be within {CELLS_M[0]:g} and {CELLS_M[1]:g} m")
    if turn != 0.0:
        raise InputError(f"{path}: the map is turned by {turn:g} rad; make it anew with an origin of [x, y, 0]")
    states = _states(path, said)
    if beside:
        _require_beside(path, said["image"])
    grey = _image(path.parent / said["image"])
    # Nav2 writes 205 for unknown, and thresholds between which 205 is free.
    if said.get("mode") != "scale" and states[_GREYS[UNKNOWN]] == FREE and (grey == _GREYS[UNKNOWN]).any():
        raise InputError(
            f"{path}: free_thresh makes free what is grey {_GREYS[UNKNOWN]}, by which map savers mean unknown; write "
            "free_thresh: 0.196"
        )
    corners = np.array([[x_m, y_m, 0.0], [x_m + cell_m * grey.shape[1], y_m + cell_m * grey.shape[0], 0.0]])
    reach.require_near_origin(corners, str(path))
    return Floor(np.ascontiguousarray(states[grey[::-1].T]), cell_m, (x_m, y_m))


def _states(path: Path, said: dict[str, Any]) -> NDArray[np.uint8]:
    """(256,) what each grey means."""
    if (mode := said.get("mode", "trinary")) not in ("trinary", "scale"):
        raise InputError(f"{path}: mode is {_shown(mode)}; trinary and scale are read")
    if (negate := said.get("negate", 0)) not in (0, 1):
        raise FormatError(f"{path}: negate is {_shown(negate)}; it must be 0 or 1")
    occupied, free = _number(path, said, "occupied_thresh"), _number(path, said, "free_thresh")
    if not 0.0 <= free < occupied <= 1.0:
        raise InputError(f"{path}: free_thresh {free:g} and occupied_thresh {occupied:g} must rise from 0 to 1")
    share = (np.arange(256) if negate else np.arange(255, -1, -1)) / 255.0
    return np.where(share > occupied, OCCUPIED, np.where(share < free, FREE, UNKNOWN)).astype(np.uint8)


def walls(floor: Floor, low_m: float, high_m: float) -> tuple[FloatArray, NDArray[np.int32]]:
    """Vertices (v, 3) and faces (f, 3) of the upright sides of what is occupied, from one height to another.

    Raises:
        InputError: there are more than `MOST_SIDES`.
    """
    solid = np.pad(floor.state == OCCUPIED, 1)
    ends = []
    if (count := sum(np.count_nonzero(np.diff(solid, axis=axis)) for axis in (0, 1))) > MOST_SIDES:
        raise InputError(
            f"what is occupied has {count / 1e6:.1f} million sides of cells, at most {MOST_SIDES / 1e6:g} million are "
            "read: remove its speckle, or cut the map"
        )
    for axis in (0, 1):
        steps = np.diff(solid.astype(np.int8), axis=axis)
        for sign in (1, -1):
            i, j = np.nonzero(steps == sign)
            # A side lies before the cell of the padded array that follows it on this axis.
            first = np.stack([i, j - 1] if axis == 0 else [i - 1, j], axis=1)
            second = first + ([0, 1] if axis == 0 else [1, 0])
            ends.append(np.stack([first, second] if (sign == 1) == (axis == 1) else [second, first], axis=1))
    sides = np.concatenate(ends) * floor.cell_m + np.array(floor.low_world_m)
    lower, upper = (np.concatenate([sides, np.full((*sides.shape[:2], 1), z)], axis=2) for z in (low_m, high_m))
    corners = np.concatenate([lower, upper[:, ::-1]], axis=1)
    first = 4 * np.arange(len(corners))[:, None]
    faces = np.concatenate([np.add(first, [0, 1, 2]), np.add(first, [0, 2, 3])])
    return corners.reshape(-1, 3), faces.astype(np.int32)


def _yaml(path: Path) -> dict[str, Any]:
    said = yaml_import.parsed(path)
    if not isinstance(said, dict) or "image" not in said:
        raise FormatError(f"{path} names no image: it is no map of map_server")
    if not isinstance(said["image"], str) or not said["image"]:
        raise FormatError(f"{path}: image is {_shown(said['image'])}; it must be the name of a file")
    return said


def _require_beside(path: Path, image: str) -> None:
    """Says the same of all that is elsewhere, so that no answer tells what is there."""
    if image != PurePath(image).name or image == ".." or (path.parent / image).is_symlink():
        raise InputError(f"{path}: image is {_shown(image)}; it must be the name of a file that was sent with this one")


def _shown(value: Any) -> str:
    """A value for a message, never long: aliases make a few lines of YAML a list of millions."""
    if isinstance(value, str):
        return repr(value[:60])
    if value is None or isinstance(value, bool | float) or (isinstance(value, int) and value.bit_length() < 64):
        return repr(value)
    return {int: "a huge number", list: "a list", dict: "a table"}.get(type(value), type(value).__name__)


def _number(path: Path, said: dict[str, Any], name: str) -> float:
    value = said.get(name)
    try:
        number = float(value) if isinstance(value, int | float) and not isinstance(value, bool) else math.nan
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise FormatError(f"{path}: {name} is {_shown(value)}; it must be a number")
    return number


def _origin(path: Path, said: dict[str, Any]) -> tuple[float, float, float]:
    origin = said.get("origin")
    if not isinstance(origin, list) or len(origin) != 3:
        raise FormatError(f"{path}: origin is {_shown(origin)}; it must be [x, y, yaw]")
    x, y, yaw = (_number(path, {"origin": value}, "origin") for value in origin)
    return x, y, yaw


def _image(path: Path) -> NDArray[np.uint8]:
    """(rows, columns) greys; refused before it is decoded where it is too large or of another kind."""
    from PIL import Image

    if not path.is_file():
        raise errors.missing(path)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            image = Image.open(path)
        with image:
            _require_grey_and_few(path, image)
            pixels = np.asarray(image if image.mode == "RGB" else image.convert("L"))
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise FormatError(f"{path} cannot be read: {' '.join(str(error).split())[:200]}") from None
    if pixels.ndim == 3:
        if (pixels != pixels[:, :, :1]).any():  # programs differ in the grey that they make of a colour
            raise InputError(f"{path} has colours; save it as 8-bit grey")
        pixels = pixels[:, :, 0]
    return pixels


def _require_grey_and_few(path: Path, image: Any) -> None:
    kind = image.mode if "transparency" not in image.info else "transparent"
    if kind not in ("1", "L", "RGB"):  # of 16 bits, what is unknown would be as white as what is free
        raise InputError(f"{path} has pixels of kind {kind}; save it as 8-bit grey without transparency")
    if (cells := image.width * image.height) > MOST_CELLS:
        raise InputError(
            f"{path} has {cells / 1e6:,.0f} million cells, at most {MOST_CELLS / 1e6:g} million are read: cut it, or "
            "make it coarser"
        )


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
