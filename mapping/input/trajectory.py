"""Recorded motion of the vehicle, in TUM's or EuRoC's format, at the times of the images.

TUM: `time_s x y z qx qy qz qw`, separated by spaces. EuRoC: `timestamp_ns,x,y,z,qw,qx,qy,qz`, separated by commas;
further columns (velocity, biases) are not read. Tables of others: see `pose_tables`. Lines that begin with # are
comments. Positions are in metres, times on the clock of the images' `times.csv`.
"""

import enum
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flight import FloatArray, FormatError, InputError, cells, errors, frames, rotations
from mapping import reach
from mapping.input import pose_tables

LEAST_INSTANTS = 4
"""Images that a recorded motion must cover."""
LONGEST_GAP_S = 0.5
"""A longer gap between two recorded poses is not interpolated."""
_SAME_S = 6e-4
"""A recorded pose is also known at times this close to its own, beside a gap too: files round times to 1 ms."""
FASTEST_M_S, HARDEST_M_S2 = 100.0, 20.0
"""What seems to be faster, or to accelerate harder for a tenth of the time, was recorded in another unit than metres:
at walking pace positions in centimetres are below 100 m/s, and their accelerations beyond 2 g."""
SLOWEST_S = 20.0
"""Poses that are farther apart have times in another unit."""
_SMOOTHED_S = 0.25
"""Accelerations are differences over this: 1 cm of noise is 0.4 m/s2."""
_COLUMNS = 8
_NS_PER_S = 1_000_000_000


class MotionKind(enum.StrEnum):
    """What a recorded motion is worth."""

    POSES = "recorded poses"
    """Absolute: of a tracker, motion capture or a map; z is up, and errors do not grow along the path."""
    ODOMETRY = "odometry"
    """Drifts: only the motion over short stretches counts, in any frame."""


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """Poses of one thing on the vehicle over time."""

    path: Path
    """The file."""
    time_s: FloatArray
    """(n,) increasing."""
    T_start_body: FloatArray
    """(n, 4, 4) metres, in a frame of the recorder's own."""
    std: tuple[float, float] | None = None
    """Standard deviation of turn (rad) and shift (m) of each pose, if the file states it."""

    def at(self, time_s: FloatArray) -> FloatArray:
        """(m, 4, 4) poses at other times (m,): interpolated, or a recorded one; NaN where nothing was recorded."""
        before, share, step_s = self._steps(time_s)
        after = before + 1
        recorded = np.minimum(np.abs(share), np.abs(1.0 - share)) * step_s <= _SAME_S
        known = recorded | self.interpolates(time_s)
        share = np.where(known, np.clip(share, 0.0, 1.0), 0.0)
        q = rotations.from_matrix(self.T_start_body[:, :3, :3])
        a, b = self.T_start_body[before, :3, 3], self.T_start_body[after, :3, 3]
        T = frames.transform(rotations.slerp(q[before], q[after], share), a + share[:, None] * (b - a))
        T[~known] = np.nan
        return T

    def interpolates(self, time_s: FloatArray) -> NDArray[np.bool_]:
        """(m,) whether other times (m,) lie between two recorded poses that are near each other in time."""
        _, share, step_s = self._steps(time_s)
        return (share >= 0.0) & (share <= 1.0) & (step_s <= LONGEST_GAP_S)  # not at a time that is NaN

    def _steps(self, time_s: FloatArray) -> tuple[np.ndarray, FloatArray, FloatArray]:
        """The recorded pose before each time, the share of the step from it to the next, and that step's length."""
        before = np.clip(np.searchsorted(self.time_s, time_s), 1, len(self.time_s) - 1) - 1
        step_s = self.time_s[before + 1] - self.time_s[before]
        return before, (time_s - self.time_s[before]) / step_s, step_s


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """A recorded motion, and what it is worth."""

    kind: MotionKind
    trajectory: Trajectory

    @property
    def name(self) -> str:
        """What it is, with its file."""
        return f"{self.kind} ({self.trajectory.path.name})"


def read_motion(kind: MotionKind, path: Path, time_s: FloatArray) -> Motion:
    """A recorded motion for images taken at the times (instants,), NaN where unknown.

    Raises:
        InputError: as `read`; the images have no times, the file covers fewer than four of them, or poses are too far
            from the origin.
    """
    trajectory = read(path)
    known_s = time_s[np.isfinite(time_s)]
    if not len(known_s):
        raise InputError(f"{path} cannot be compared with images that have no times; give times.csv (image,time_s)")
    covered = int(np.isfinite(trajectory.at(time_s)[:, 0, 0]).sum())
    if covered < LEAST_INSTANTS:
        first_s, last_s = trajectory.time_s[[0, -1]]
        raise InputError(
            f"{path} covers {covered} of {len(time_s)} images, at least {LEAST_INSTANTS} are needed. Its times go from "
            f"{first_s:.3f} to {last_s:.3f} s, those of the images from {known_s.min():.3f} to {known_s.max():.3f} s; "
            "give both by one clock, in seconds (EuRoC: nanoseconds)"
        )
    if kind is MotionKind.POSES:
        reach.require_near_origin(trajectory.T_start_body[:, :3, 3], f"with the poses of {path} the map")
    return Motion(kind, trajectory)


def read(path: Path) -> Trajectory:
    """The poses of a file in TUM's or EuRoC's format; a comma says which.

    Raises:
        InputError: it does not exist, or its positions are not in metres.
        FormatError: it is neither format, a number is missing, a quaternion is not of unit length, or times do not
            increase.
    """
    if not path.is_file():
        raise errors.missing(path, "recorded poses in TUM's or EuRoC's format")
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()  # with or without a byte order mark
    except UnicodeDecodeError:
        raise FormatError(f"{path} is not a text file: recorded poses are in TUM's or EuRoC's format") from None
    used = [(k, line) for k, line in enumerate(lines, start=1) if line.strip() and not line.lstrip().startswith("#")]
    if len(used) < 2:
        raise FormatError(f"{path} has {len(used)} poses; at least 2 are needed")
    rows, std = _rows(path, used)
    if len(rows) < 2:
        raise FormatError(f"{path} has {len(rows)} poses; at least 2 are needed")
    time_s, positions_m, q = rows[:, 0], rows[:, 1:4], rows[:, 4:]
    used = used[-len(rows) :]
    _require_rising(path, time_s, [number for number, _ in used])
    if (off := np.flatnonzero(np.abs(np.linalg.norm(q, axis=1) - 1.0) > 0.01)).size:
        order = "w x y z" if "," in used[0][1] else "x y z w"
        raise FormatError(f"{path}, line {used[int(off[0])][0]}: its quaternion ({order}) is not of unit length")
    _require_seconds(path, time_s)
    _require_metres(path, time_s, positions_m)
    return Trajectory(path, time_s, frames.transform(rotations.normalise(q), positions_m), std)


def _rows(path: Path, lines: Sequence[tuple[int, str]]) -> tuple[FloatArray, tuple[float, float] | None]:
    """(n, 8) time (s), position (m) and quaternion (w first), and the stated noise; by the first line's format."""
    first = lines[0][1]
    if pose_tables.header(first) is not None:
        return pose_tables.read(path, lines)
    if path.suffix.lower() == pose_tables.ARKIT_SUFFIX:
        return pose_tables.arkit(path, lines), None
    is_euroc = "," in first
    rows = np.array([_row(path, k, line.split(",") if is_euroc else line.split(), is_euroc) for k, line in lines])
    return rows if is_euroc else rows[:, [0, 1, 2, 3, 7, 4, 5, 6]], None


def looks_like_one(path: Path) -> bool:
    """Whether the first line of a file that is no comment is a pose in TUM's or EuRoC's format; False if unreadable."""
    try:
        with path.open(encoding="utf-8") as file:
            first = next((line for line in file if line.strip() and not line.lstrip().startswith("#")), "")
        if pose_tables.header(first) is not None or path.suffix.lower() == pose_tables.ARKIT_SUFFIX:
            return True
        is_euroc = "," in first
        return bool(_row(path, 1, first.split(",") if is_euroc else first.split(), is_euroc))
    except (OSError, UnicodeDecodeError, FormatError, InputError):
        return False


def _row(path: Path, number: int, words: Sequence[str], is_euroc: bool) -> list[float]:
    """Time in seconds, position and quaternion as they stand in the line."""
    if len(words) < _COLUMNS or not (is_euroc or len(words) == _COLUMNS):
        raise FormatError(
            f"{path}, line {number}: {len(words)} columns; TUM's format has `time_s x y z qx qy qz qw`, EuRoC's "
            "`timestamp_ns,x,y,z,qw,qx,qy,qz`"
        )
    try:
        values = [cells.number(word, path, number, f"{k + 1}") for k, word in enumerate(words[:_COLUMNS])]
    except FormatError:
        raise FormatError(
            f"{path}, line {number}: {' '.join(words)[:60]!r} are not numbers; a line that is no pose must begin with #"
        ) from None
    if not np.isfinite(values).all():
        raise FormatError(
            f"{path}, line {number}: a number is missing or not finite; leave out poses that are not known"
        )
    if is_euroc:
        values[0] /= _NS_PER_S
    return values


def _require_rising(path: Path, time_s: FloatArray, lines: Sequence[int]) -> None:
    """
    Raises:
        FormatError: a time is not after the one before, or one is far from its neighbours' times.
    """
    late = np.flatnonzero(np.diff(time_s) <= 0.0)
    if not late.size:
        return
    k = int(late[0])
    if 0 < k < len(time_s) - 2 and time_s[k - 1] < time_s[k + 1] < time_s[k + 2] and time_s[k] > time_s[k + 2]:
        raise FormatError(
            f"{path}, line {lines[k]}: its time ({time_s[k]:g} s) is after those of the lines below, which are in "
            "order; take the line out"
        )
    raise FormatError(f"{path}, line {lines[k + 1]}: its time is not after that of the pose before; sort and thin them")


def _require_seconds(path: Path, time_s: FloatArray) -> None:
    """
    Raises:
        InputError: poses are so far apart that the times are in another unit.
    """
    step = float(np.median(np.diff(time_s)))
    if step < SLOWEST_S:
        return
    unit = "nanoseconds" if step > 1e6 else "microseconds" if step > 1e3 else "milliseconds"
    raise InputError(
        f"{path}: times from {time_s[0]:.6g} to {time_s[-1]:.6g} s, a pose every {step:.3g} s (median): {unit}? TUM's "
        "format holds seconds, EuRoC's nanoseconds: divide the first column"
    )


def _require_metres(path: Path, time_s: FloatArray, positions_m: FloatArray) -> None:
    """
    Raises:
        InputError: the motion is implausible in metres. Slow and even motion in another unit may be not: then only
            another source of scale shows it.
    """
    steps_m = np.linalg.norm(np.diff(positions_m, axis=0), axis=1)
    speed_m_s = float(np.percentile(steps_m / np.diff(time_s), 90.0))
    wrong = "" if speed_m_s <= FASTEST_M_S else f"fly at {speed_m_s:.0f} m/s (at most {FASTEST_M_S:g})"
    acceleration_m_s2 = _acceleration_m_s2(time_s, positions_m)
    if not wrong and acceleration_m_s2 > HARDEST_M_S2:
        wrong = f"accelerate with {acceleration_m_s2:.0f} m/s2 (at most {HARDEST_M_S2:g})"
    if wrong:
        raise InputError(
            f"{path}: the vehicle would {wrong}: the positions must be in metres, not in millimetres or centimetres, "
            "and the times in seconds (EuRoC: nanoseconds)"
        )


def _acceleration_m_s2(time_s: FloatArray, positions_m: FloatArray) -> float:
    """90th percentile over the recorded stretches without a gap; 0 where there are none."""
    middle_s = np.unique(np.floor(time_s / _SMOOTHED_S)) * _SMOOTHED_S  # as many as poses at most, however long a gap
    middle_s = middle_s[(middle_s >= time_s[0] + _SMOOTHED_S) & (middle_s <= time_s[-1] - _SMOOTHED_S)]
    ends_s = (middle_s - _SMOOTHED_S, middle_s, middle_s + _SMOOTHED_S)
    before_m, at_m, after_m = (
        np.stack([np.interp(when, time_s, axis) for axis in positions_m.T], axis=1) for when in ends_s
    )
    gap_s = np.diff(time_s)[np.clip(np.searchsorted(time_s, np.array(ends_s)), 1, len(time_s) - 1) - 1].max(axis=0)
    known = gap_s <= _SMOOTHED_S
    if not known.any():
        return 0.0
    change_m = np.linalg.norm(after_m - 2.0 * at_m + before_m, axis=1)[known]
    return float(np.percentile(change_m, 90.0)) / _SMOOTHED_S**2
