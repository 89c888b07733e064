"""Which rows of an on-board log are in the air, and how well the vehicle kept to its trajectory there."""

import numpy as np

from firmware_bridge.controller import State
from firmware_bridge.words import reason_text
from flight import FlightLog, InputError

IN_FREE_AIR = (State.HOLD, State.APPROACH, State.TRAJECTORY, State.PAUSING, State.PAUSED, State.STOPPING)
"""Mission states in which the vehicle has no contact with the ground."""
ON_THE_GROUND = (State.DISARMED, State.ARMED, State.FAULT)


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
    """Tracking error (distance to the set-point) and speed while on the trajectory, at the instants that have both.

    Returns:
        `flown_s` alone where there is no such instant.
    """
    rows = log.columns["mission_state"] == State.TRAJECTORY
    if not rows.any():
        return {"flown_s": 0.0}
    flown_s = float(np.ptp(log.time_s[rows]))
    error_m = np.linalg.norm(log.vector("position_world_m") - log.vector("setpoint_position_world_m"), axis=1)
    speed_m_s = np.linalg.norm(log.vector("velocity_world_m_s"), axis=1)
    rows &= np.isfinite(error_m) & np.isfinite(speed_m_s)
    if not rows.any():
        return {"flown_s": flown_s}
    error_m, speed_m_s = error_m[rows], speed_m_s[rows]
    return {
        "flown_s": flown_s,
        "tracking_mean_m": float(error_m.mean()),
        "tracking_worst_m": float(error_m.max()),
        "top_speed_m_s": float(speed_m_s.max()),
    }


def slowed(log: FlightLog) -> str:
    """How far and why the controller slowed the trajectory down, in words; empty where it did not."""
    if not (log.has("path_limit_ratio") and log.has("limit_reason")):
        return ""
    rows = log.columns["mission_state"] == State.TRAJECTORY
    limit = np.where(rows, np.nan_to_num(log.columns["path_limit_ratio"], nan=1.0), 1.0)
    if not limit.size or limit.min() >= 1.0:
        return ""
    why = reason_text(int(log.columns["limit_reason"][int(np.argmin(limit))]))
    return f"{why}, to {limit.min():.0%} of the planned speed at the slowest"


def aloft_s(log: FlightLog) -> tuple[float, float] | None:
    """First and last instant in free air; None where the log has no mission state."""
    if not log.has("mission_state"):
        return None
    rows = np.flatnonzero(np.isin(log.columns["mission_state"], IN_FREE_AIR))
    return (float(log.time_s[rows[0]]), float(log.time_s[rows[-1]])) if rows.size else None
