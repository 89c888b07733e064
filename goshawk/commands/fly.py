"""`goshawk fly`: take off, fly what was uploaded, land; the flight's log as a file."""

from pathlib import Path

import click
import numpy as np

import firmware_bridge
from flight import FlightLog, flight_log, trajectory
from goshawk import console


@click.command()
@console.path_option("--out", "out", "Flight log to write.", required=True)
@console.path_option("--trajectory", "trajectory_file", "Refuse to fly unless the vehicle holds this one.")
@console.url_option
@console.key_option
@console.json_option
def command(out: Path, trajectory_file: Path | None, url: str, key_file: Path | None, as_json: bool) -> None:
    """Fly the trajectory that the vehicle holds, and write the flight log.

    \b
    goshawk fly --out flights/walk.parquet
    goshawk fly --trajectory walk.json --out flights/walk.parquet

    Ctrl-C brakes along the path and lands.
    """
    item = trajectory.load(trajectory_file) if trajectory_file is not None else None
    with firmware_bridge.connect(url, key=key_file) as link, console.progress() as report:
        link.take_control()
        log = link.fly(item, progress=report)
    flight_log.save(out, log)
    facts = {"written": str(out), "rows": len(log), **tracking(log)}
    console.show("flight", facts, as_json=as_json)


TRAJECTORY_STATE = 5
"""`TC_TRAJECTORY` of the controller's mission.h: the rows that count for tracking."""


def on_trajectory(log: FlightLog) -> np.ndarray:
    """Which rows were flown on the trajectory: (n,) bool."""
    return log.columns["mission_state"] == TRAJECTORY_STATE


def tracking(log: FlightLog) -> dict[str, float]:
    """How well the vehicle followed: distance to the set-point while on the trajectory, and how fast it was."""
    rows = on_trajectory(log)
    error_m = np.linalg.norm(log.vector("position_world_m") - log.vector("setpoint_position_world_m"), axis=1)[rows]
    speed_m_s = np.linalg.norm(log.vector("velocity_world_m_s"), axis=1)[rows]
    return {
        "flown_s": float(np.ptp(log.time_s[rows])) if rows.any() else 0.0,
        "tracking_mean_m": float(np.mean(error_m)) if rows.any() else float("nan"),
        "tracking_worst_m": float(np.max(error_m, initial=0.0)),
        "top_speed_m_s": float(np.max(speed_m_s, initial=0.0)),
    }
