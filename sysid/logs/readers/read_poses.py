"""Poses and IMU in plain tables: TUM files, EuRoC folders (`mav0`), and two files joined on their clocks."""

from pathlib import Path

import numpy as np

from flight import FlightLog, FormatError, InputError
from flight.rotations import FloatArray
from sysid.logs.motors import full_throttle, rotor_places
from sysid.logs.readers.assemble import ATTITUDE, FORCE, POSE, RATE, assembled, columns
from sysid.logs.readers.streams import Stream
from sysid.logs.sensors import common_turning, low_pass

TUM_COLUMNS = 8
_POSES = ("state_groundtruth_estimate0", "groundtruth", "mocap0", "vicon0", "leica0")
"""Folders of EuRoC and its followers that hold a pose, the best first."""
_AVERAGED = ("rate_body", "specific_force_body", "rotor_speed", "motor_command")
"""What is averaged over a period of the poses; flags and slow readings are not."""
_MOTION = ("position_world", "velocity_world", "q_world_body")


def is_tum(head: bytes) -> bool:
    """Whether every line is eight numbers between blanks: time, position, quaternion (x y z w)."""
    try:
        lines = head.decode("ascii").splitlines()[:20]
    except UnicodeDecodeError:
        return False
    rows = [line.split() for line in lines if line.strip() and not line.startswith("#")]
    return len(rows) > 1 and all(len(row) == TUM_COLUMNS and all(map(_is_number, row)) for row in rows[:-1])


def is_euroc(folder: Path) -> bool:
    return _sensors(folder) is not None


def read_tum(path: Path) -> FlightLog:
    """A TUM file: seconds, x y z in metres, quaternion x y z w of the body in the world, z up.

    Raises:
        FormatError: a line is no row of eight numbers.
        InputError: fewer than two rows.
    """
    rows, number, line = [], 0, ""
    try:
        for number, line in enumerate(path.read_text(encoding="utf-8-sig").splitlines(), 1):  # noqa: B007
            if line.strip() and not line.startswith("#"):
                row = [float(word) for word in line.split()]
                if len(row) != TUM_COLUMNS:
                    raise ValueError
                rows.append(row)
    except UnicodeDecodeError:
        raise FormatError(f"{path} is not text") from None
    except ValueError:
        raise FormatError(
            f"{path}, line {number}: {line[:60]!r} is not time, x, y, z, qx, qy, qz, qw; cut the file there or mend it"
        ) from None
    table = np.array(rows, dtype=np.float64).reshape(-1, TUM_COLUMNS)
    _seconds(path, table[:, 0])
    pose = columns(POSE, table[:, 1:4]) | columns(ATTITUDE, table[:, [7, 4, 5, 6]])
    return assembled(
        path, {POSE: {"time_s": table[:, 0], **pose}}, ["TUM: position and attitude x y z w"], own_clock=True
    )


def _seconds(path: Path, time_s: FloatArray) -> None:
    """Refuse stamps that are no seconds."""
    step = float(np.median(np.diff(time_s))) if len(time_s) > 1 else 0.0
    unit = "nanoseconds" if step > 1e6 else "microseconds" if step > 1e3 else "milliseconds" if step >= 1.0 else ""
    if unit:
        raise InputError(f"{path}: rows are {step:g} apart, so in {unit}? TUM holds seconds: divide column 1")


def euroc_files(folder: Path) -> tuple[Path | None, Path | None]:
    """Pose and IMU of a EuRoC folder; None for what it has not."""
    sensors = _sensors(folder)
    if sensors is None:
        return None, None
    pose = next((p for p in (sensors / name / "data.csv" for name in _POSES) if p.is_file()), None)
    imu = sensors / "imu0" / "data.csv"
    return pose, imu if imu.is_file() else None


def _sensors(folder: Path) -> Path | None:
    for place in (folder / "mav0", folder):
        if (place / "imu0").is_dir() or any((place / name).is_dir() for name in _POSES):
            return place
    return None


def joined_on_clocks(path: Path, pose: FlightLog, imu: FlightLog, *, align: bool = False) -> FlightLog:
    """One log of a pose and an IMU that were recorded to two files by one clock.

    Args:
        align: by two clocks; their offset is found by how both saw the vehicle turn.

    Raises:
        InputError: one lacks what it should hold, the clocks share no time, or their offset does not show.
    """
    own = {name: values for name, values in pose.columns.items() if name.startswith((*_MOTION, "time_s"))}
    rest = {name: values for name, values in imu.columns.items() if not name.startswith(_MOTION)}
    if not pose.has(POSE):
        raise InputError(f"{pose.metadata.get('source')} has no position; it has {', '.join(sorted(pose.columns))}")
    if not imu.has(RATE) and not imu.has(FORCE):
        raise InputError(
            f"{imu.metadata.get('source')} has no gyro nor accelerometer; it has {', '.join(sorted(rest))}"
        )
    told = []
    if align:
        later_s = _offset_s(path, pose, imu)
        rest["time_s"] = imu.time_s + later_s
        imu = FlightLog(rest, imu.metadata)
        told = [f"clocks: {later_s:+.4f} s were added to the IMU's, by how both saw the vehicle turn"]
    begins, ends = (pose.time_s[0], imu.time_s[0]), (pose.time_s[-1], imu.time_s[-1])
    if max(begins) >= min(ends):
        raise InputError(
            f"{path}: the pose lasts from {begins[0]:.3f} to {ends[0]:.3f} s, the IMU from {begins[1]:.3f} to "
            f"{ends[1]:.3f} s: they share no time. Give both in one clock (unit or scale in a column map), or --align"
        )
    streams: dict[str, Stream] = {POSE: own, RATE: _averaged(rest, float(np.median(np.diff(own["time_s"]))))}
    notes = [f"pose: {pose.metadata.get('source')}", f"IMU: {imu.metadata.get('source')}", *told]
    log = assembled(path, streams, notes)
    of_imu = {
        key: imu.metadata[key] for key in (rotor_places.KEY, low_pass.KEY, full_throttle.IDLE) if key in imu.metadata
    }
    return FlightLog(log.columns, {**log.metadata, **of_imu})


def _averaged(stream: Stream, period_s: float) -> Stream:
    """Over a period of the poses, at whose instants it is read: what is faster would come back as slow noise."""
    rows = 2 * int(0.5 * period_s / float(np.median(np.diff(stream["time_s"])))) + 1
    rows = min(rows, 2 * ((len(stream["time_s"]) - 1) // 2) + 1)
    if rows == 1:
        return stream
    half, ones = rows // 2, np.full(rows, 1.0 / rows)

    def mean(values: FloatArray) -> FloatArray:
        """The ends, which have rows on one side only, as they are."""
        inner = np.convolve(values, ones, "valid")
        return np.concatenate([values[:half], inner, values[len(values) - half :]])

    return {name: mean(values) if name.startswith(_AVERAGED) else values for name, values in stream.items()}


def _offset_s(path: Path, pose: FlightLog, imu: FlightLog) -> float:
    if not pose.has(ATTITUDE) or not imu.has(RATE):
        raise InputError(f"{path}: clocks are aligned by attitudes of the pose and rates of the gyro; one is missing")
    by_pose, by_gyro = pose.vector(ATTITUDE), imu.vector(RATE)
    posed, felt = np.isfinite(by_pose).all(axis=1), np.isfinite(by_gyro).all(axis=1)
    return common_turning.offset_s(pose.time_s[posed], by_pose[posed], imu.time_s[felt], by_gyro[felt])


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
