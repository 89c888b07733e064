"""Are the attitude's body axes those of gyro and accelerometer? What is turned by 90 deg or more is named.

The gyro's turn is that which fits the attitude's rate to the gyro's best (Wahba's problem, by singular values). Whose
axes are the vehicle's the rotors decide: turning must follow the torque that they make at their places. Of smaller
turns nothing is said, for the fit estimates how the pose sensor is mounted. The accelerometer's axes, in any order and
of any sign, must show gravity along z, and level what the positions show: drag, mostly. It may be elsewhere on the body
than the pose sensor: what turning makes of an arm between the two is taken out, or an arm that points the other way
would look like other signs.
"""

from itertools import permutations, product

import numpy as np

from flight import FlightLog, rotations
from flight.flight_log import COLUMNS
from flight.rotations import FloatArray
from sysid.logs.checks import clocks, rotor_order
from sysid.logs.checks.attitude import LEAST_RATE_RAD_S
from sysid.logs.checks.finding import Finding, error, turn_in_words
from sysid.logs.checks.motion import GRID_S, Kinematics, correlation, on_grid, sampled
from sysid.logs.events.repair import Repair
from vehicle import Vehicle

LEAST_RAD = np.deg2rad(45.0)
"""A smaller turn is a matter of mounting, not of axes; fits to flights turned by 45 and 90 deg come out the same."""
LEAST_CORRELATION = 0.8
"""Of the two rates after the turn."""
LEAST_SECOND = 0.5
"""Of the two rates along the second of the axes about which they agree: one axis alone shows no turn about itself."""
MOST_LEFT = 0.5
"""A turn leaves at most this share of what another clock alone leaves unexplained."""
LEAST_UPRIGHT = 0.7
"""Share of the specific force along z, from which on gravity shows there."""
AXES = [np.diag(signs)[list(order)] for order in permutations(range(3)) for signs in product((1.0, -1.0), repeat=3)]
"""All orders and signs of three axes, as matrices."""


def check(log: FlightLog, motion: Kinematics, vehicle: Vehicle | None) -> list[Finding]:
    """The turn between the attitude's body axes and the gyro's, if it is one of axes."""
    if not sampled(log, "rate_body_rad_s") or np.sqrt((motion.rate_body_rad_s**2).mean()) < LEAST_RATE_RAD_S:
        return []
    gyro = on_grid(log, "rate_body_rad_s", motion.time_s)
    turn_rad = _turn(motion.rate_body_rad_s, gyro)
    if _in_world_axes(motion, gyro, turn_rad):
        sentence = "the gyro follows the attitude's rate in world axes"
        return [error("frame", sentence, "log the rate in body axes: turn it by the inverse of the attitude")]
    if np.linalg.norm(turn_rad) < LEAST_RAD:
        return []
    keeps_z = rotations.rotate(rotations.exp(turn_rad), np.array([0.0, 0.0, 1.0]))[2] > 0.0
    keeps_z = keeps_z and not _accelerometer_is_right(log, motion, turn_rad)
    accelerometer = COLUMNS["specific_force_body_m_s2"] if keeps_z else ()  # its z is judged by gravity
    imu_columns = (*COLUMNS["rate_body_rad_s"], *accelerometer)
    back = (-float(turn_rad[0]), -float(turn_rad[1]), -float(turn_rad[2]))
    sentence = f"the attitude's body axes are turned by {turn_in_words(turn_rad)} against the gyro's"
    attitude, imu = (Repair("turn body", columns, turn_rad=back) for columns in (COLUMNS["q_world_body"], imu_columns))
    of_attitude = "turn the attitude's body axes to the gyro's"
    of_imu = f"turn gyro{' and accelerometer' if keeps_z else ''} to the attitude's body axes"
    if vehicle is not None and sampled(log, "rotor_speed_rad_s"):
        if _rotors_agree(log, (log.time_s, log.vector("rate_body_rad_s")), vehicle):
            return [error("frame", f"{sentence}, which the rotors follow", of_attitude, repair=attitude)]
        if _rotors_agree(log, (motion.time_s, motion.rate_body_rad_s), vehicle):
            return [error("frame", f"{sentence}; the rotors follow the attitude", of_imu, repair=imu)]
    return [error("frame", sentence, f"{of_attitude}, or {of_imu}: see which sensor is mounted turned")]


def check_accelerometer(log: FlightLog, motion: Kinematics) -> list[Finding]:
    """Order and signs of the accelerometer's axes, if they are not those of the attitude's body axes."""
    if not sampled(log, "specific_force_body_m_s2"):
        return []
    beside = _of_arm_and_bias(motion)
    expected = _less(beside, rotations.rotate(rotations.conjugate(motion.q), motion.specific_force_world_m_s2)[:, :2])
    read = on_grid(log, "specific_force_body_m_s2", motion.time_s)
    size = float(np.median(np.linalg.norm(read, axis=1)))
    upright = [axes for axes in AXES if np.median(read @ axes[2]) > LEAST_UPRIGHT * size]
    if not upright:
        return []
    level = [_less(beside, read @ axes[:2].T) for axes in upright]
    follows = [correlation(expected.ravel(), one.ravel()) for one in level]
    best = int(np.argmax(follows))
    given = [f for f, axes in zip(follows, upright, strict=True) if np.array_equal(axes, np.eye(3))]
    if given and not (
        follows[best] > LEAST_CORRELATION and 1.0 - follows[best] ** 2 < MOST_LEFT * (1.0 - max(0.0, *given) ** 2)
    ):
        return []
    axes = upright[best]
    both = [correlation(expected[:, i], level[best][:, i]) for i in range(2)]
    if min(both) < LEAST_SECOND:
        sentence = "its level axes are not the attitude's" if given else "gravity is not along its z"
        return [error("frame", f"accelerometer: {sentence}", "check the order and signs of its axes")]
    said = ", ".join(f"{name} is its {_axis(row)}" for name, row in zip("xyz", axes, strict=True))
    sentence = f"the accelerometer's axes are not the attitude's: the body's {said}"
    if np.linalg.det(axes) < 0.0:
        return [error("frame", sentence, "reorder its axes so, and see why they are left-handed")]
    turn = rotations.log(rotations.from_matrix(axes))
    back = (float(turn[0]), float(turn[1]), float(turn[2]))
    repair = Repair("turn body", COLUMNS["specific_force_body_m_s2"], turn_rad=back)
    return [error("frame", sentence, "turn the accelerometer to the attitude's body axes", repair=repair)]


def _of_arm_and_bias(motion: Kinematics) -> FloatArray:
    """(n, 2, 5) level specific force by 1 m of an arm along each body axis, and by a bias of each level axis."""
    rate, turning = motion.rate_body_rad_s, motion.angular_acceleration_rad_s2
    arms = [np.cross(turning, arm) + np.cross(rate, np.cross(rate, arm)) for arm in np.eye(3)]
    biases = [np.broadcast_to(axis, rate.shape) for axis in np.eye(3)[:2]]
    return np.stack([*arms, *biases], axis=2)[:, :2]


def _less(beside: FloatArray, level: FloatArray) -> FloatArray:
    """What is left of level forces (n, 2) once these columns (n, 2, m) have explained what they can."""
    columns = beside.reshape(-1, beside.shape[2])
    return level - beside @ np.linalg.lstsq(columns, level.ravel(), rcond=None)[0]


def _axis(row: FloatArray) -> str:
    i = int(np.abs(row).argmax())
    return f"{'-' if row[i] < 0.0 else ''}{'xyz'[i]}"


def _rotors_agree(log: FlightLog, rate: tuple[FloatArray, FloatArray], vehicle: Vehicle) -> bool:
    return rotor_order.examine(log, rate, vehicle).order == tuple(range(vehicle.rotors))


def _in_world_axes(motion: Kinematics, gyro: FloatArray, turn_rad: FloatArray) -> bool:
    """Whether the gyro follows the rate in world axes, and clearly better than in body axes, turned or not."""
    body = rotations.rotate(rotations.exp(turn_rad), motion.rate_body_rad_s)
    world = rotations.rotate(motion.q, motion.rate_body_rad_s)
    in_body, in_world = (max(clocks.largest_correlation(rate, gyro)[1], 0.0) for rate in (body, world))
    return in_world > LEAST_CORRELATION and 1.0 - in_world**2 < MOST_LEFT * (1.0 - in_body**2)


def _accelerometer_is_right(log: FlightLog, motion: Kinematics, turn_rad: FloatArray) -> bool:
    """Whether it reads the positions' level acceleration in the attitude's body axes, though the gyro is turned."""
    if not sampled(log, "specific_force_body_m_s2"):
        return False
    expected = rotations.rotate(rotations.conjugate(motion.q), motion.specific_force_world_m_s2)[:, :2].ravel()
    read = on_grid(log, "specific_force_body_m_s2", motion.time_s)
    back = rotations.rotate(rotations.exp(-turn_rad), read)
    as_given, after = (correlation(expected, force[:, :2].ravel()) for force in (read, back))
    return as_given > max(after, LEAST_SECOND)


def _turn(rate: FloatArray, gyro: FloatArray) -> FloatArray:
    """(3,) rotation vector that takes one rate (n, 3) to the other, early or late; zero where no turn is needed.

    A rate that swings to and fro looks half a period later like one turned by half, and one about a single axis shows
    no turn about that axis: so the turn must explain clearly more than another clock does, and about two axes.
    """
    rate, gyro = rate - rate.mean(axis=0), gyro - gyro.mean(axis=0)
    edge = round(clocks.LONGEST_S / GRID_S)
    plain = max(
        correlation(rate[edge:-edge].ravel(), later.ravel())
        for later in _later(gyro, clocks.largest_correlation(rate, gyro)[0], edge)
    )
    # the clock may be off: the sum of the singular values is the largest correlation that any turn gives
    rate, delays_s = rate[edge:-edge], GRID_S * np.arange(-edge, edge + 1)
    steps = [gyro[edge + k : len(gyro) - edge + k] for k in range(-edge, edge + 1)]
    near_s = delays_s[int(np.argmax([_turned_correlation(rate, later) for later in steps]))]
    gyro = max(_later(gyro, float(near_s), edge), key=lambda later: _turned_correlation(rate, later))
    left, values, right = np.linalg.svd(gyro.T @ rate)
    turn = left @ right
    turned = correlation((rate @ turn.T).ravel(), gyro.ravel())
    second = float(values[1]) / (_size(gyro @ left[:, 1]) * _size(rate @ right[1]))
    if np.linalg.det(turn) < 0.0 or turned < LEAST_CORRELATION or second < LEAST_SECOND:
        return np.zeros(3)
    if 1.0 - turned**2 > MOST_LEFT * (1.0 - max(plain, 0.0) ** 2):
        return np.zeros(3)
    return rotations.log(rotations.from_matrix(turn))


def _later(gyro: FloatArray, delay_s: float, edge: int) -> list[FloatArray]:
    """The gyro read about this much later, in tenths of the grid's step, without its ends."""
    read = clocks.reader(gyro)
    return [read(delay_s + part * GRID_S)[edge:-edge] for part in np.linspace(-0.5, 0.5, 11)]


def _turned_correlation(rate: FloatArray, gyro: FloatArray) -> float:
    """The largest that any turn gives, but for the size of `rate`."""
    return float(np.linalg.svd(gyro.T @ rate, compute_uv=False).sum()) / _size(gyro)


def _size(values: FloatArray) -> float:
    return max(float(np.linalg.norm(values)), float(np.finfo(float).tiny))
