"""A trajectory for other programs: Crazyflie's poly4d, mav_trajectory_generation's YAML, PX4's offboard setpoints.

The first two carry polynomials in our world frame (z up), the Crazyflie's fitted anew where its memory is too small
(`poly4d`); the last is sampled, in PX4's frame (NED).
"""

import csv
from pathlib import Path

import numpy as np

from flight import FloatArray, InputError, Trajectory, frames
from flight.trajectory import AXES
from goshawk.commands.plan import poly4d

MOST_SETPOINTS = 1_000_000
PX4_COLUMNS = (
    "t_s",
    *(f"{name}_{axis}" for name in ("position", "velocity", "acceleration", "jerk") for axis in ("x", "y", "z")),
    "yaw",
    "yawspeed",
)
"""The fields of PX4's TrajectorySetpoint: metres, seconds and radians, x north, y east, z down, yaw from x to y."""


def write_crazyflie(path: Path, flown: Trajectory) -> poly4d.Refit:
    """`Duration,x^0,...,x^7,y^0,...,yaw^7`: one line a piece, ascending powers of seconds from its start.

    Returns:
        What the file holds, read back in the firmware's single precision.

    Raises:
        InputError: the plan does not fit into the firmware's memory, or its single precision loses too much.
    """
    pieces = poly4d.refit(flown).trajectory
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["Duration", *(f"{axis}^{i}" for axis in AXES for i in range(poly4d.TERMS))])
        for T, c in zip(pieces.durations_s.tolist(), pieces.coefficients, strict=True):
            writer.writerow([repr(T), *map(repr, c.ravel().tolist())])
    held = poly4d.compared(flown, read_crazyflie(path))
    poly4d.require_near(held)
    return held


def read_crazyflie(path: Path) -> Trajectory:
    """The pieces of such a file, as the firmware keeps them: in single precision."""
    rows = np.loadtxt(path, delimiter=",", skiprows=1, ndmin=2).astype(np.float32).astype(np.float64)
    return Trajectory(rows[:, 0], rows[:, 1:].reshape(len(rows), len(AXES), poly4d.TERMS))


def write_mav_trajectory_generation(path: Path, flown: Trajectory) -> None:
    """The YAML of its `segmentsToFile`: N coefficients, D axes, time in whole nanoseconds, ascending coefficients.

    Durations are rounded to nanoseconds; nothing else changes.
    """
    lines = ["segments:"]
    for T, c in zip(flown.durations_s.tolist(), flown.coefficients, strict=True):
        lines += [f"  - N: {c.shape[1]}", f"    D: {len(c)}", f"    time: {round(T * 1e9)}", "    coefficients:"]
        lines += [f"      - [{', '.join(repr(value) for value in axis)}]" for axis in c.tolist()]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def write_px4(path: Path, flown: Trajectory, step_s: float) -> None:
    """Setpoints `step_s` apart, the end included.

    Raises:
        InputError: the step is not positive, or so small that more than `MOST_SETPOINTS` would be written.
    """
    if step_s > 0.0 and flown.duration_s > MOST_SETPOINTS * step_s:
        raise InputError(
            f"a step of {step_s:g} s makes {flown.duration_s / step_s:.3g} setpoints; at most {MOST_SETPOINTS} are "
            f"written: take {flown.duration_s / MOST_SETPOINTS:.2g} s or more"
        )
    times = flown.sample(step_s)
    rows = px4_setpoints(flown, times)
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(PX4_COLUMNS)
        writer.writerows([repr(value) for value in row] for row in rows.tolist())


def px4_setpoints(flown: Trajectory, times_s: FloatArray) -> FloatArray:
    """(n, 15) in the order of `PX4_COLUMNS`; yaw within -pi to pi."""
    motion = [flown.evaluate(times_s, r) for r in range(4)]
    vectors = [frames.flip_vector(values[:, :3]) for values in motion]
    yaw = -motion[0][:, 3]
    wrapped = np.arctan2(np.sin(yaw), np.cos(yaw))
    return np.column_stack([times_s, *vectors, wrapped, -motion[1][:, 3]])
