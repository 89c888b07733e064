"""Flight logs for the estimator: the rows in the air, without take-off and landing."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np

import sysid
from firmware_bridge.controller import State
from flight import FlightLog, InputError, file_format

IN_FREE_AIR = (State.HOLD, State.APPROACH, State.TRAJECTORY, State.PAUSING, State.PAUSED, State.STOPPING)
"""Mission states in which the vehicle has no contact with the ground."""
ON_THE_GROUND = (State.DISARMED, State.ARMED, State.FAULT)


def load(path: Path, columns: Path | None = None) -> FlightLog:
    """Read a log; if it has the mission state, keep the rows between take-off and landing.

    Args:
        columns: column map (TOML) of a CSV log.

    Raises:
        InputError: the vehicle was never in the air.
    """
    log = sysid.read_log(path, columns)
    return in_the_air(log, str(path)) if log.has("mission_state") else log


def refuse_repeated(paths: Iterable[Path], use: str) -> None:
    """Refuse files that hold the same flight, by their content.

    Args:
        use: what each flight may be given for, in the words of the verb.

    Raises:
        InputError: two files are the same, or one is missing.
    """
    seen: dict[str, Path] = {}
    for path in paths:
        if not path.exists():
            raise InputError(f"{path}: there is no such file")
        digest = file_format.file_hash(path) if path.is_file() else str(path.resolve())
        if digest in seen:
            raise InputError(f"{path} and {seen[digest]} are the same flight; give each flight once, {use}")
        seen[digest] = path


def marked_file(path: Path) -> Path:
    """The file that marks are written to: the log itself if it is in our format, else a converted one beside it."""
    return path.with_suffix(".parquet")


def in_the_air(log: FlightLog, name: str) -> FlightLog:
    """The rows from the first to the last in free air.

    Raises:
        InputError: there are none, or the vehicle stood on the ground in between: ground contact would be
            mistaken for an aerodynamic force.
    """
    states = log.columns["mission_state"]
    rows = np.flatnonzero(np.isin(states, IN_FREE_AIR))
    if not rows.size:
        raise InputError(f"{name}: the vehicle was never in free air (column mission_state); choose another log")
    kept = slice(rows[0], rows[-1] + 1)
    landed = np.flatnonzero(np.isin(states[kept], ON_THE_GROUND))
    if landed.size:
        landed_s = log.time_s[kept][landed[0]]
        raise InputError(f"{name} holds more than one flight: it stands at {landed_s:.1f} s; cut it there")
    return FlightLog({column: values[kept] for column, values in log.columns.items()}, log.metadata)


def tracking(log: FlightLog) -> dict[str, float]:
    """Tracking error (distance to the set-point) and speed while on the trajectory."""
    rows = log.columns["mission_state"] == State.TRAJECTORY
    if not rows.any():
        return {"flown_s": 0.0}
    error_m = np.linalg.norm(log.vector("position_world_m") - log.vector("setpoint_position_world_m"), axis=1)[rows]
    speed_m_s = np.linalg.norm(log.vector("velocity_world_m_s"), axis=1)[rows]
    return {
        "flown_s": float(np.ptp(log.time_s[rows])),
        "tracking_mean_m": float(error_m.mean()),
        "tracking_worst_m": float(error_m.max()),
        "top_speed_m_s": float(speed_m_s.max()),
    }
