"""Where the images of a map were taken: its `poses.csv`, the body in the world."""

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from flight import FloatArray, FormatError, file_format, frames, rotations
from mapping.input.images import read_table

_COLUMNS = ("image", "time_s", "x_m", "y_m", "z_m", "qw", "qx", "qy", "qz")
_STD_COLUMNS = ("x_std_m", "y_std_m", "z_std_m", "turn_std_rad")


def write_poses(
    path: Path,
    images: Sequence[str],
    time_s: FloatArray,
    T_world_body: FloatArray,
    covariance: FloatArray | None = None,
) -> None:
    """Write a `poses.csv`; instants without a pose (NaN) are left out.

    Args:
        images: (n,) names; time_s: (n,) NaN where unknown; T_world_body: (n, 4, 4).
        covariance: (n, 6, 6) of position (world, m) and turn (body, rad), whose standard deviations are written too:
            of the position along each axis, and of the turn about its least certain axis.
    """
    std = np.zeros((len(images), 0)) if covariance is None else _standard_deviations(covariance)
    with file_format.atomic_file(path) as temporary, open(temporary, "w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(_COLUMNS if covariance is None else (*_COLUMNS, *_STD_COLUMNS))
        for k in map(int, np.flatnonzero(np.isfinite(T_world_body[:, 0, 0]))):
            numbers = [time_s[k], *T_world_body[k, :3, 3], *rotations.from_matrix(T_world_body[k, :3, :3]), *std[k]]
            writer.writerow([images[k], *(f"{v:.9g}" for v in numbers)])


def _standard_deviations(covariance: FloatArray) -> FloatArray:
    """(n, 4) of x, y, z and the largest of the turn."""
    known = np.isfinite(covariance[:, 0, 0])
    std = np.full((len(covariance), 4), np.nan)
    std[known, :3] = np.sqrt(np.diagonal(covariance[known, :3, :3], axis1=1, axis2=2))
    std[known, 3] = np.sqrt(np.linalg.eigvalsh(covariance[known, 3:, 3:])[:, -1])
    return std


def read_poses(path: Path) -> tuple[tuple[str, ...], FloatArray, FloatArray]:
    """Names, times (n,) and poses (n, 4, 4) of a `poses.csv`.

    Raises:
        FormatError: it is missing or damaged.
    """
    if not path.is_file():
        raise FormatError(f"{path} is missing; build the map again")
    table = read_table(path, _COLUMNS)
    values = np.array(list(table.values()), dtype=np.float64).reshape(-1, 8)
    if (cut := np.flatnonzero(~np.isfinite(values[:, 1:]).all(axis=1))).size:
        raise FormatError(f"{path} is damaged: {list(table)[cut[0]]} has no whole pose; build the map again")
    return tuple(table), values[:, 0], frames.transform(rotations.normalise(values[:, 4:]), values[:, 1:4])
