"""Are the attitude's body axes those of the gyro? A sensor that is mounted turned by a quarter turn or more is named.

The turn is that which fits the attitude's rate to the gyro's best (Wahba's problem, by singular values). Whose axes are
the vehicle's the rotors decide: turning must follow the torque that they make at their places. Of smaller turns nothing
is said, for the fit estimates how the pose sensor is mounted.
"""

import numpy as np

from flight import FlightLog, rotations
from flight.flight_log import COLUMNS
from flight.rotations import FloatArray
from sysid.logs import clocks, rotor_order
from sysid.logs.attitude import LEAST_RATE_RAD_S
from sysid.logs.finding import Finding, Repair, error, turn_in_words
from sysid.logs.motion import GRID_S, Kinematics, correlation, on_grid, sampled
from vehicle import Vehicle

LEAST_RAD = np.deg2rad(45.0)
"""A smaller turn is a matter of mounting, not of axes; fits to flights turned by 45 and 90 deg come out the same."""
LEAST_CORRELATION = 0.8
"""Of the two rates after the turn."""


def check(log: FlightLog, motion: Kinematics, vehicle: Vehicle | None) -> list[Finding]:
    """The turn between the attitude's body axes and the gyro's, if it is one of axes."""
    if not sampled(log, "rate_body_rad_s") or np.sqrt((motion.rate_body_rad_s**2).mean()) < LEAST_RATE_RAD_S:
        return []
    turn_rad = _turn(motion.rate_body_rad_s, on_grid(log, "rate_body_rad_s", motion.time_s))
    if np.linalg.norm(turn_rad) < LEAST_RAD:
        return []
    keeps_z = rotations.rotate(rotations.exp(turn_rad), np.array([0.0, 0.0, 1.0]))[2] > 0.0
    accelerometer = COLUMNS["specific_force_body_m_s2"] if keeps_z else ()  # its z is judged by gravity
    imu_columns = (*COLUMNS["rate_body_rad_s"], *accelerometer)
    back = (-float(turn_rad[0]), -float(turn_rad[1]), -float(turn_rad[2]))
    sentence = f"the attitude's body axes are turned by {turn_in_words(turn_rad)} against the gyro's"
    attitude, imu = (Repair("turn body", columns, turn_rad=back) for columns in (COLUMNS["q_world_body"], imu_columns))
    of_attitude = "turn the attitude's body axes to the gyro's"
    of_imu = f"turn gyro{' and accelerometer' if keeps_z else ''} to the attitude's body axes"
    if vehicle is not None and sampled(log, "rotor_speed_rad_s"):
        gyro = (log.time_s, log.vector("rate_body_rad_s"))
        if _rotors_agree(log, gyro, vehicle):
            return [error("frame", f"{sentence}, which the rotors follow", of_attitude, repair=attitude)]
        if _rotors_agree(log, (motion.time_s, motion.rate_body_rad_s), vehicle):
            return [error("frame", f"{sentence}; the rotors follow the attitude", of_imu, repair=imu)]
    return [error("frame", sentence, f"{of_attitude}, or {of_imu}: see which sensor is mounted turned")]


def _rotors_agree(log: FlightLog, rate: tuple[FloatArray, FloatArray], vehicle: Vehicle) -> bool:
    return rotor_order.examine(log, rate, vehicle).order == rotor_order.AS_GIVEN


def _turn(rate: FloatArray, gyro: FloatArray) -> FloatArray:
    """(3,) rotation vector that takes one rate (n, 3) to the other, early or late; zero where no turn does."""
    rate, gyro = rate - rate.mean(axis=0), gyro - gyro.mean(axis=0)
    edge = round(clocks.LONGEST_S / GRID_S)
    rate, late = rate[edge : len(rate) - edge], [gyro[k : len(gyro) - 2 * edge + k] for k in range(2 * edge + 1)]
    # the clock may be off: the sum of the singular values is the largest correlation that any turn gives
    gyro = max(late, key=lambda gyro: float(np.linalg.svd(gyro.T @ rate, compute_uv=False).sum()))
    left, _, right = np.linalg.svd(gyro.T @ rate)
    turn = left @ right
    if np.linalg.det(turn) < 0.0 or correlation((rate @ turn.T).ravel(), gyro.ravel()) < LEAST_CORRELATION:
        return np.zeros(3)
    return rotations.log(rotations.from_matrix(turn))
