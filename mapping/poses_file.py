"""Where the images of a map were taken: its `poses.csv`, the body in the world."""

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from flight import FloatArray, FormatError, file_format, frames, rotations
from mapping.input.images import read_table

_COLUMNS = ("image", "time_s", "x_m", "y_m", "z_m", "qw", "qx", "qy", "qz")


def write_poses(path: Path, images: Sequence[str], time_s: FloatArray, T_world_body: FloatArray) -> None:
    """Write a `poses.csv`; instants without a pose (NaN) are left out.

    Args:
        images: (n,) names; time_s: (n,) NaN where unknown; T_world_body: (n, 4, 4).
    """
    with file_format.atomic_file(path) as temporary, open(temporary, "w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(_COLUMNS)
        for k in map(int, np.flatnonzero(np.isfinite(T_world_body[:, 0, 0]))):
            numbers = [time_s[k], *T_world_body[k, :3, 3], *rotations.from_matrix(T_world_body[k, :3, :3])]
            writer.writerow([images[k], *(f"{v:.9g}" for v in numbers)])


def read_poses(path: Path) -> tuple[tuple[str, ...], FloatArray, FloatArray]:
    """Names, times (n,) and poses (n, 4, 4) of a `poses.csv`.

    Raises:
        FormatError: it is missing or damaged.
    """
    if not path.is_file():
        raise FormatError(f"{path} is missing; build the map again")
    table = read_table(path, _COLUMNS)
    values = np.array(list(table.values()), dtype=np.float64).reshape(-1, 8)
    return tuple(table), values[:, 0], frames.transform(rotations.normalise(values[:, 4:]), values[:, 1:4])
