"""A trajectory: position and yaw as piecewise polynomials of time, and the file that carries it.

The file records which map and which vehicle it was checked against; `goshawk upload` refuses one that was not checked.
"""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from flight import file_format, polynomial
from flight.errors import FormatError, InputError
from flight.rotations import FloatArray

FORMAT = "goshawk-trajectory"
VERSION = 2
"""Version 1 had no hash of what a trajectory was checked for (`sealed`)."""
LONGEST_S = 1e4
"""No small vehicle flies for hours; a longer trajectory is a damaged file."""
AXES = ("x", "y", "z", "yaw")


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """k polynomial segments flown one after the other, in world axes."""

    durations_s: FloatArray
    """(k,) duration of each segment; all positive."""
    coefficients: FloatArray
    """(k, 4, n) of x, y, z in metres and yaw in radians; ascending powers of seconds from the segment's start."""
    starts_s: FloatArray = field(init=False)
    """(k + 1,) start time of each segment; the last entry is the total duration."""

    def __post_init__(self) -> None:
        durations = np.ascontiguousarray(self.durations_s, dtype=np.float64)
        coefficients = np.ascontiguousarray(self.coefficients, dtype=np.float64)
        if durations.ndim != 1 or coefficients.ndim != 3 or coefficients.shape[:2] != (len(durations), 4):
            raise InputError(
                f"durations {durations.shape} and coefficients {coefficients.shape} do not fit (k,) and (k, 4, n)"
            )
        if len(durations) == 0 or coefficients.shape[2] == 0:
            raise InputError("a trajectory needs at least one segment with at least one coefficient")
        if not (np.isfinite(durations).all() and np.isfinite(coefficients).all()):
            raise InputError("a trajectory's durations and coefficients must be finite")
        if durations.min() <= 0.0:
            raise InputError(f"segment {int(durations.argmin())} lasts {durations.min():g} s; it must be positive")
        object.__setattr__(self, "durations_s", durations)
        object.__setattr__(self, "coefficients", coefficients)
        object.__setattr__(self, "starts_s", np.concatenate([[0.0], np.cumsum(durations)]))

    @property
    def duration_s(self) -> float:
        return float(self.starts_s[-1])

    def segment_at(self, times_s: ArrayLike) -> tuple[np.ndarray, FloatArray]:
        """Segment index and seconds since its start, for times (n,).

        Raises:
            InputError: a time is not finite, or outside [0, duration] by more than a nanosecond.
        """
        t = np.asarray(times_s, dtype=np.float64)
        if not np.isfinite(t).all():
            raise InputError("a time is not finite")
        if t.size and (t.min() < -1e-9 or t.max() > self.duration_s + 1e-9):
            raise InputError(f"times {t.min():g} to {t.max():g} s leave the trajectory's 0 to {self.duration_s:g} s")
        segment = np.clip(np.searchsorted(self.starts_s, t, side="right") - 1, 0, len(self.durations_s) - 1)
        return segment, np.clip(t - self.starts_s[segment], 0.0, self.durations_s[segment])

    def evaluate(self, times_s: ArrayLike, derivative: int = 0) -> FloatArray:
        """Value of the given derivative of (x, y, z, yaw) at times (n,) from the start: (n, 4).

        At a join the segment that starts there counts. Raises as `segment_at`.
        """
        segment, local_s = self.segment_at(times_s)
        coefficients = polynomial.differentiate(self.coefficients, derivative)
        return polynomial.evaluate(coefficients[segment], local_s[..., None])

    def position(self, times_s: ArrayLike, derivative: int = 0) -> FloatArray:
        """World position in metres (n, 3), or its time derivative of the given order."""
        return self.evaluate(times_s, derivative)[..., :3]

    def sample(self, step_s: float) -> FloatArray:
        """Times from 0 to the duration inclusive, at most `step_s` apart."""
        if not step_s > 0.0:
            raise InputError(f"the sampling step is {step_s:g} s; it must be positive")
        return np.linspace(0.0, self.duration_s, int(np.ceil(self.duration_s / step_s)) + 1)

    def join_jumps(self, derivative: int) -> FloatArray:
        """Discontinuity of the given derivative at each inner join: (k - 1, 4), later minus earlier."""
        coefficients = polynomial.differentiate(self.coefficients, derivative)
        ends = polynomial.evaluate(coefficients, self.durations_s[:, None])
        return coefficients[1:, :, 0] - ends[:-1]

    def split(self, time_s: float) -> tuple["Trajectory", "Trajectory"]:
        """The part before `time_s` and the part from it on; each starts its own clock at zero.

        Raises:
            InputError: `time_s` is not strictly inside the trajectory.
        """
        if not 0.0 < time_s < self.duration_s:
            raise InputError(f"cannot split at {time_s:g} s: the trajectory runs from 0 to {self.duration_s:g} s")
        segment, local = self.segment_at(np.array([time_s]))
        i, local_s = int(segment[0]), float(local[0])
        before = np.append(self.durations_s[:i], local_s)
        after = np.append(self.durations_s[i] - local_s, self.durations_s[i + 1 :])
        shifted = polynomial.shift_argument(self.coefficients[i], np.full(4, local_s))
        first = (
            Trajectory(before, self.coefficients[: i + 1])
            if local_s > 0.0
            else Trajectory(self.durations_s[:i], self.coefficients[:i])
        )
        return first, Trajectory(after, np.concatenate([shifted[None], self.coefficients[i + 1 :]]))

    def cut(self, times_s: FloatArray) -> "Trajectory":
        """The same motion with joins at these times (n,) too, but for those within a nanosecond of a join."""
        inner = np.unique(times_s)
        inner = inner[np.abs(inner[:, None] - self.starts_s).min(axis=1, initial=np.inf) > 1e-9]
        inner = inner[np.diff(inner, prepend=-np.inf) > 1e-9]
        starts = np.sort(np.concatenate([self.starts_s, inner[(inner > 0.0) & (inner < self.duration_s)]]))
        segment = np.searchsorted(self.starts_s, starts[:-1], side="right") - 1
        after_s = np.repeat((starts[:-1] - self.starts_s[segment])[:, None], 4, axis=1)
        return Trajectory(np.diff(starts), polynomial.shift_argument(self.coefficients[segment], after_s))

    def scale_time(self, factor: float) -> "Trajectory":
        """The same path flown `factor` times as slowly (a factor of 2 halves every speed)."""
        if not (np.isfinite(factor) and factor > 0.0):
            raise InputError(f"the time scale is {factor:g}; it must be positive")
        slower = polynomial.scale_argument(self.coefficients, 1.0 / factor)
        return Trajectory(self.durations_s * factor, slower)

    def reverse(self) -> "Trajectory":
        """The same path flown from end to start (yaw values are kept, not turned round)."""
        T = self.durations_s[::-1, None]
        from_the_end = polynomial.shift_argument(self.coefficients[::-1], np.broadcast_to(T, (len(T), 4)))
        return Trajectory(self.durations_s[::-1], polynomial.scale_argument(from_the_end, -1.0))


def join(parts: list[Trajectory]) -> Trajectory:
    """Concatenate the parts. Continuity is not checked; see `join_jumps`."""
    if not parts:
        raise InputError("nothing to join")
    n = max(part.coefficients.shape[2] for part in parts)
    padded = [np.pad(p.coefficients, ((0, 0), (0, 0), (0, n - p.coefficients.shape[2]))) for p in parts]
    return Trajectory(np.concatenate([p.durations_s for p in parts]), np.concatenate(padded))


@dataclass(frozen=True, slots=True)
class TrajectoryFile:
    """A trajectory with its origin and the map and vehicle it was checked against."""

    trajectory: Trajectory
    name: str
    map_hash: str
    """Hash of the map it was checked in (`map.toml`'s `hash`); empty if it was not checked in a map."""
    vehicle_hash: str
    """Hash of the vehicle file whose limits it was checked against."""
    waypoints_world_m: FloatArray
    """(m, 3) the waypoints it was planned through."""
    check: Mapping[str, Any]
    """The final gate's report: `passed`, `clearance_m`, `required_clearance_m`, margins; empty if never checked."""
    version: int = VERSION
    """Of the file's format; one of version 1 keeps it until it is checked again."""

    @property
    def checked(self) -> bool:
        """Whether it passed the final gate."""
        return self.check.get("passed") is True  # not the text "false", which is true as well

    @property
    def as_checked(self) -> bool:
        """Whether trajectory, waypoints, map, vehicle and report are, bit by bit, those of the check.

        In a file of version 1 the trajectory alone can be told (`record_kept`).
        """
        return fingerprint(self.trajectory) == self.check.get("trajectory_hash") and self.record_kept is not False

    @property
    def record_kept(self) -> bool | None:
        """Whether what it was checked for, and what was found, is what was written; None in a file of version 1."""
        kept = self.check.get("record_hash")
        if kept is None and self.version < 2:
            return None
        return kept == _record_hash(self)


def fingerprint(trajectory: Trajectory) -> str:
    """SHA-256 of the durations and coefficients."""
    digest = hashlib.sha256(trajectory.durations_s.tobytes())
    digest.update(trajectory.coefficients.tobytes())
    return digest.hexdigest()


def sealed(item: TrajectoryFile) -> TrajectoryFile:
    """The file with a hash of its record, so that `as_checked` sees any later change of it. For who checked it only."""
    check = {name: value for name, value in item.check.items() if name != "record_hash"}
    item = replace(item, check=check, version=VERSION)
    return replace(item, check=check | {"record_hash": _record_hash(item)})


def _record_hash(item: TrajectoryFile) -> str:
    """SHA-256 of the check's report, and of the waypoints, map and vehicle it belongs to, as JSON with sorted keys."""
    record = {
        "check": {name: value for name, value in item.check.items() if name != "record_hash"},
        "map_hash": item.map_hash,
        "vehicle_hash": item.vehicle_hash,
        "waypoints_world_m": np.asarray(item.waypoints_world_m, dtype=np.float64).tolist(),
    }
    return hashlib.sha256(json.dumps(record, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


def _check_duration(duration_s: float) -> None:
    if duration_s > LONGEST_S:
        raise InputError(f"it lasts {duration_s:.4g} s; at most {LONGEST_S:g} s are allowed")


def save(path: Path, item: TrajectoryFile) -> None:
    """Write a trajectory file (format `goshawk-trajectory`, JSON).

    Raises:
        InputError: it lasts longer than `load` allows.
    """
    _check_duration(item.trajectory.duration_s)
    segments = [
        {"duration_s": float(T), **{axis: c[i].tolist() for i, axis in enumerate(AXES)}}
        for T, c in zip(item.trajectory.durations_s, item.trajectory.coefficients, strict=True)
    ]
    body = {
        "name": item.name,
        "frame": "world",
        "basis": "ascending powers of seconds from the segment's start",
        "map_hash": item.map_hash,
        "vehicle_hash": item.vehicle_hash,
        "waypoints_world_m": np.asarray(item.waypoints_world_m).tolist(),
        "check": dict(item.check),
        "segments": segments,
    }
    file_format.write_json(path, format=FORMAT, version=item.version, body=body)


def load(path: Path) -> TrajectoryFile:
    """Read a trajectory file.

    Raises:
        InputError: there is no such file.
        FormatError: it is not a trajectory file, is damaged, or newer than this version.
    """
    document = file_format.read_json(path, format=FORMAT, version=VERSION)
    try:
        durations = np.array([s["duration_s"] for s in document["segments"]], dtype=np.float64)
        coefficients = np.array([[s[axis] for axis in AXES] for s in document["segments"]], dtype=np.float64)
        _check_duration(float(durations.sum()))
        return TrajectoryFile(
            trajectory=Trajectory(durations, coefficients),
            name=str(document["name"]),
            map_hash=str(document["map_hash"]),
            vehicle_hash=str(document["vehicle_hash"]),
            waypoints_world_m=np.array(document["waypoints_world_m"], dtype=np.float64).reshape(-1, 3),
            check=dict(document["check"]),
            version=document["version"],
        )
    except (KeyError, TypeError, ValueError, InputError) as error:
        raise FormatError(f"{path} is a damaged trajectory file: {file_format.damage_text(error)}") from error
