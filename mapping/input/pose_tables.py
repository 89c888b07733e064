"""Recorded poses in tables with a header: Project Aria's trajectories, and `poses.csv` of our own; and ARKitScenes'.

Aria (`closed_loop_trajectory.csv`, `open_loop_trajectory.csv`): `tracking_timestamp_us`, then `tx_world_device` to
`qw_world_device`, or `tx_odometry_device` to `qw_odometry_device`. Ours: `time_s,x_m,y_m,z_m,qw,qx,qy,qz`, and
`x_std_m,y_std_m,z_std_m,turn_std_rad` where standard deviations are known. ARKitScenes (`.traj`) has no header: seven
columns `time_s rx ry rz tx ty tz`, the rotation vector (rad) and shift of world to camera.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from flight import FloatArray, FormatError, cells, frames, rotations

_POSITION, _TURN = ("tx", "ty", "tz"), ("qw", "qx", "qy", "qz")
_OURS = ("time_s", "x_m", "y_m", "z_m", "qw", "qx", "qy", "qz")
_STD = ("x_std_m", "y_std_m", "z_std_m", "turn_std_rad")
_ARIA_TIME = "tracking_timestamp_us"
_US_PER_S = 1e6
_ARKIT = 7
ARKIT_SUFFIX = ".traj"


def header(first: str) -> tuple[str, ...] | None:
    """The columns of time, position and quaternion (w first) in a table that begins with this line; None: no table."""
    names = [name.strip() for name in first.split(",")]
    if _ARIA_TIME in names:
        of = "_world_device" if "tx_world_device" in names else "_odometry_device"
        return (_ARIA_TIME, *(name + of for name in (*_POSITION, *_TURN)))
    return _OURS if set(_OURS) <= set(names) else None


def read(path: Path, lines: Sequence[tuple[int, str]]) -> tuple[FloatArray, tuple[float, float] | None]:
    """Poses (n, 8) as time (s), position (m) and quaternion (w first), and what is stated of their noise (rad, m).

    Args:
        lines: numbers and texts of the file's lines, without comments, the header first.

    Raises:
        FormatError: a column is missing, a cell is no number, or a standard deviation is not above 0.
    """
    names = [name.strip() for name in lines[0][1].split(",")]
    asked = header(lines[0][1])
    assert asked is not None
    if missing := [name for name in asked if name not in names]:
        raise FormatError(f"{path} has no column {', '.join(missing)}")
    rows = np.array([_cells(path, number, line, names, asked) for number, line in lines[1:]]).reshape(-1, len(asked))
    if asked[0] == _ARIA_TIME:
        rows[:, 0] /= _US_PER_S
    if not set(_STD) <= set(names):
        return rows, None
    std = np.array([_stds(path, number, line, names) for number, line in lines[1:]]).reshape(-1, 4)
    std = std[np.isfinite(std).all(axis=1)]
    if not len(std):
        return rows, None
    return rows, (float(np.median(std[:, 3])), float(np.median(np.sqrt((std[:, :3] ** 2).mean(axis=1)))))


def _stds(path: Path, number: int, line: str, names: Sequence[str]) -> list[float]:
    """Standard deviations of one pose, NaN where they are not known."""
    words = line.split(",")
    values = [cells.number(words[names.index(name)], path, number, name) for name in _STD]
    for name, value in zip(_STD, values, strict=True):
        if value <= 0.0:
            raise FormatError(
                f"{path}, line {number}: {name} is {value:g}, but a standard deviation is above 0; leave the cell "
                "empty where it is not known"
            )
    return values


def _cells(path: Path, number: int, line: str, names: Sequence[str], asked: Sequence[str]) -> list[float]:
    words = line.split(",")
    if len(words) != len(names):
        raise FormatError(f"{path}, line {number}: {len(words)} columns, the first line has {len(names)}")
    values = [cells.number(words[names.index(name)], path, number, name) for name in asked]
    if not np.isfinite(values).all():
        raise FormatError(f"{path}, line {number}: a number is missing or not finite; leave out such poses")
    return values


def arkit(path: Path, lines: Sequence[tuple[int, str]]) -> FloatArray:
    """(n, 8) as `read`, of the camera in the world.

    Raises:
        FormatError: a line has other columns, or a cell is no number.
    """
    values = np.array([_seven(path, number, line.split()) for number, line in lines])
    T = frames.invert(frames.transform(rotations.exp(values[:, 1:4]), values[:, 4:]))
    return np.column_stack([values[:, 0], T[:, :3, 3], rotations.from_matrix(T[:, :3, :3])])


def _seven(path: Path, number: int, words: Sequence[str]) -> list[float]:
    if len(words) != _ARKIT:
        raise FormatError(f"{path}, line {number}: {len(words)} columns; ARKitScenes has `time_s rx ry rz tx ty tz`")
    values = [cells.number(word, path, number, f"{k + 1}") for k, word in enumerate(words)]
    if not np.isfinite(values).all():
        raise FormatError(f"{path}, line {number}: a number is not finite; leave out such poses")
    return values
