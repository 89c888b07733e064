"""A simulated flight, and the CSV that a foreign recorder might have made of it: other units, frames and clocks."""

from pathlib import Path

import numpy as np

from flight import FlightLog, frames
from vehicle import Vehicle, flights, manoeuvres

BOB = [(1.25, 1.0), (1.25, -1.0)] * 2


def simulated(flown: Vehicle, *, size: float = 7.0, seed: int = 5) -> FlightLog:
    """Ten seconds of weaving at 100 Hz."""
    rng = np.random.default_rng(seed)
    weave = manoeuvres.from_legs(x=[(2.5, size), (2.5, -size)], y=[(1.0, 0.0), (2.0, 4.0), (2.0, -4.0)], z=BOB)
    return flights.measure(flights.fly_trajectory(flown, weave), rng=rng)


def write(path: Path, log: FlightLog, *, separator: str = ";", rotors_late_s: float = 0.04) -> Path:
    """Milliseconds, z down, degrees a second, rpm, q as x y z w, and rotor speeds that come late."""
    names = "t_ms px py pz qx qy qz qw gyro_x gyro_y gyro_z motor1 motor2 motor3 motor4 vbat"
    position = frames.flip_vector(log.vector("position_world_m")) * 1000.0
    q = np.roll(frames.flip_attitude(log.vector("q_world_body")), -1, axis=1)
    gyro = np.rad2deg(frames.flip_vector(log.vector("rate_body_rad_s")))
    speeds = log.vector("rotor_speed_rad_s")
    late = np.stack([np.interp(log.time_s - rotors_late_s, log.time_s, s) for s in speeds.T], axis=1) * 30.0 / np.pi
    table = np.column_stack([1000.0 * log.time_s, position, q, gyro, late, np.full(len(log), 15.3)])
    with open(path, "w", encoding="utf-8") as file:
        file.write(separator.join(names.split()) + "\n")
        file.writelines(separator.join(f"{v:.9g}" for v in row) + "\n" for row in table)
    return path
