"""The numbers of a file of points, whatever its format."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flight import InputError, Progress, errors, silent
from mapping.cloud import e57_file, las_file, point_file

_READERS = (point_file, las_file, e57_file)
SUFFIXES = tuple(suffix for reader in _READERS for suffix in reader.SUFFIXES)


def read(path: Path, *, progress: Progress = silent) -> Mapping[str, NDArray[np.generic]]:
    """The named columns (n,) of the points; `x`, `y` and `z` are among them.

    Raises:
        InputError: there is no such file, or it is of another type or too large.
        FormatError: it is damaged or cut off, or holds no points.
    """
    reader = next((reader for reader in _READERS if path.suffix.lower() in reader.SUFFIXES), None)
    if reader is None:
        raise InputError(f"{path} is not one of {', '.join(SUFFIXES)}; convert it, with CloudCompare say")
    if not path.is_file():
        raise errors.missing(path)
    return las_file.read(path, progress=progress) if reader is las_file else reader.read(path)


def stated_unit(path: Path, unit: str | None) -> str | None:
    """The unit of `foreign_mesh.UNITS_M` that a file states, if none is given. Raises as `las_file.stated_unit`."""
    return las_file.stated_unit(path, unit) if path.suffix.lower() in las_file.SUFFIXES else unit
