"""Do the channels of a log agree with each other and with physics: units, frames, rotor order, clocks?

Everything is judged from the pose, smoothed on a uniform grid: its acceleration must lie along the thrust axis, its
turning must be what the gyro reads, and the torque of the rotors must be what accelerates the turning.
"""

import numpy as np

from flight import FlightLog, Progress, rotations, silent
from flight.flight_log import COLUMNS
from flight.frames import GRAVITY_M_S2
from flight.rotations import FloatArray
from flight.units import RAD_S_PER_RPM
from sysid.logs.checks import attitude, clocks, drift, gyro_clock, mounting, position_unit, rotor_order, time_unit
from sysid.logs.checks.attitude import DEGREES, LEAST_RATE_RAD_S
from sysid.logs.checks.finding import Finding, error, warning
from sysid.logs.checks.motion import GRID_S, Kinematics, kinematics, on_grid, sampled
from sysid.logs.checks.payload import as_flown, carries_payload
from sysid.logs.events.repair import Repair
from vehicle import Vehicle, wrench
from vehicle.forces import open_air

RATIO_SIGMAS = 4.0
"""A ratio is called wrong when it is off by this many of its standard errors."""
ELECTRICAL = np.sqrt(7.0 / RAD_S_PER_RPM)
"""Rotor speed that is more times too large is in rpm; less may be electrical revolutions, of 6 or 7 pole pairs."""
LEAST_SIGNAL = 0.3
"""... and when at least this share of the variance of what it is taken against is no noise."""


def check(log: FlightLog, vehicle: Vehicle | None, progress: Progress = silent) -> tuple[list[Finding], list[str]]:
    """All findings that compare channels, and sentences on what is inconclusive; empty where a channel is not there."""
    found = [*_accelerometer(log)]
    flown = as_flown(vehicle, carries_payload(log)) if vehicle is not None else None
    if unit := time_unit.check(log):
        return [*found, *unit], []
    motion = kinematics(log)
    if motion is None:
        places, inconclusive = _order(log, None, flown)
        return [*found, *places], inconclusive
    if unit := position_unit.check(motion):
        return [*found, *unit], []
    progress("checking", 0.2)
    pose = attitude.check(log, motion)
    found += [*pose, *_velocity(log, motion)]
    if pose:
        return found, []  # whatever is judged by the attitude would only repeat that
    progress("checking", 0.3)
    if pace := drift.check(log, motion, flown):
        return [*found, *pace], []  # a delay that grows is none that a check of one delay can read
    if turned := mounting.check(log, motion, flown):
        return [*found, *turned], []
    if not any(f.level == "error" for f in found):
        found += mounting.check_accelerometer(log, motion)
    gyro, unsure = _gyro(log, motion)
    progress("checking", 0.5)
    places, inconclusive = _order(log, motion, flown, gyro_is_right=not any(f.level == "error" for f in gyro))
    progress("checking", 0.7)
    rotors = _rotors(log, motion, flown, places, gyro_is_sure=not unsure)
    return [*found, *gyro, *rotors], [*attitude.unsure(motion), *unsure, *inconclusive]


def _accelerometer(log: FlightLog) -> list[Finding]:
    if not log.has("specific_force_body_m_s2"):
        return []
    force = log.vector("specific_force_body_m_s2")
    force = force[np.isfinite(force).all(axis=1)]
    if not len(force):
        return []
    size, upward = float(np.median(np.linalg.norm(force, axis=1))), float(np.median(force[:, 2]))
    found = []
    if 0.7 < size < 1.4:
        sentence = f"the accelerometer reads {size:.2f} in hover: it is in g"
        repair = Repair("scale", COLUMNS["specific_force_body_m_s2"], factor=GRAVITY_M_S2)
        found.append(error("unit", sentence, "multiply specific_force_body_m_s2 by 9.80665", repair=repair))
    elif size < 5.0:
        sentence = f"the accelerometer reads {size:.2f} m/s2 (median): gravity is taken out, or the scale is off"
        found.append(error("frame", sentence, "log the specific force, gravity not removed"))
    if upward < -0.5 * size:
        sentence = "the accelerometer's z is negative in flight: body z points down"
        repair = Repair("flip", COLUMNS["specific_force_body_m_s2"])
        found.append(error("frame", sentence, "turn the accelerometer from z down to z up", repair=repair))
    return found


def _velocity(log: FlightLog, motion: Kinematics) -> list[Finding]:
    """Logged velocity over the position's slope, axis by axis, where both errors of that ratio are small.

    Noise of the differentiated position pulls the ratio towards zero; how far is known from what the smoothing takes
    out of the position. Where an axis hardly moves, that is all there is.
    """
    if not sampled(log, "velocity_world_m_s"):
        return []
    logged = on_grid(log, "velocity_world_m_s", motion.time_s)
    ratio, error_of_ratio = _ratios(motion, logged)
    found = []
    for i, axis in enumerate("xyz"):
        slope, sure = ratio[i], RATIO_SIGMAS * error_of_ratio[i]
        if not np.std(motion.velocity_world_m_s[:, i]) > 0.1 or not np.isfinite(sure):
            continue
        if slope + sure < -0.5:
            sentence = f"velocity_world_{axis} has the opposite sign of the position's derivative ({slope:.2f} of it)"
            repair = Repair("scale", (COLUMNS["velocity_world_m_s"][i],), factor=-1.0)
            found.append(error("frame", sentence, f"turn the sign of velocity_world_{axis}", repair=repair))
        elif slope + sure < 0.8 or slope - sure > 1.25:
            sentence = f"velocity_world_{axis} is {slope:.2f} times the position's derivative"
            found.append(warning("unit", sentence, "check its unit, or whether it is in body axes"))
    return found


def _gyro(log: FlightLog, motion: Kinematics) -> tuple[list[Finding], list[str]]:
    if not sampled(log, "rate_body_rad_s") or np.sqrt((motion.rate_body_rad_s**2).mean()) < LEAST_RATE_RAD_S:
        return [], []
    logged = on_grid(log, "rate_body_rad_s", motion.time_s)
    offset = gyro_clock.after_attitude(log, motion)
    found, inconclusive = gyro_clock.findings(offset, gyro_clock.compared_plainly(log, motion))
    matrix = _regression(motion.rate_body_rad_s, clocks.reader(logged)(offset.delay_s))
    for i, axis in enumerate("xyz"):
        if np.std(motion.rate_body_rad_s[:, i]) < LEAST_RATE_RAD_S:
            continue
        slope = matrix[i, i]
        if 0.6 * DEGREES < abs(slope) < 1.5 * DEGREES:
            found.append(
                error(
                    "unit",
                    f"rate_body_{axis} is {slope:.0f} times the rate of the attitude: deg/s",
                    "divide it by 57.2958",
                    repair=Repair("scale", (COLUMNS["rate_body_rad_s"][i],), factor=1.0 / DEGREES),
                )
            )
        elif slope < -0.5:
            found.append(
                error(
                    "frame",
                    f"rate_body_{axis} has the opposite sign of the attitude's rate",
                    f"turn the sign of rate_body_{axis}",
                    repair=Repair("scale", (COLUMNS["rate_body_rad_s"][i],), factor=-1.0),
                )
            )
        elif abs(slope) < 0.4 and np.abs(matrix[:, i]).max() > 0.6:
            other = "xyz"[int(np.abs(matrix[:, i]).argmax())]
            found.append(
                error(
                    "frame",
                    f"rate_body_{axis} follows the attitude's rate about {other}",
                    "check the order of the gyro's axes",
                )
            )
    return found, inconclusive


def _order(
    log: FlightLog, motion: Kinematics | None, vehicle: Vehicle | None, *, gyro_is_right: bool = True
) -> tuple[list[Finding], list[str]]:
    """Order and spins of the rotors, by the gyro, or by the attitude where the gyro is faulty or not there."""
    if vehicle is None or not rotor_order.drivers(log):
        return [], []
    if gyro_is_right and sampled(log, "rate_body_rad_s"):
        return rotor_order.check(log, (log.time_s, log.vector("rate_body_rad_s")), vehicle)
    if motion is None:
        return [], []
    rate = (motion.time_s, motion.rate_body_rad_s)
    return rotor_order.check(log, rate, vehicle, gyro=sampled(log, "rate_body_rad_s"))


def _rotors(
    log: FlightLog, motion: Kinematics, vehicle: Vehicle | None, places: list[Finding], *, gyro_is_sure: bool
) -> list[Finding]:
    """Unit of rotor speed, then its order and spins (`places`), then its clock."""
    if not sampled(log, "rotor_speed_rad_s"):
        return places
    speed = on_grid(log, "rotor_speed_rad_s", motion.time_s)
    if vehicle is None:
        if np.median(speed) > 4000.0:
            return [_rpm(log, float(np.median(speed)))]
        return []
    rest = np.zeros((len(speed), 3))
    thrust = wrench(vehicle, rest, rest, speed, open_air(len(speed), vehicle.rotors))[0][:, 2] / vehicle.mass_kg
    needed = np.linalg.norm(motion.specific_force_world_m_s2, axis=1)
    strong = thrust >= 0.5 * np.quantile(thrust, 0.95)  # a log may begin long before the flight
    ratio = float(np.median(thrust[strong]) / np.median(needed[strong]))
    if 0.4 < ratio * RAD_S_PER_RPM**2 < 2.5:
        return [_rpm(log, float(np.median(speed))) if ratio > ELECTRICAL**2 else _electrical(float(np.sqrt(ratio)))]
    found = []
    if not 0.25 < ratio < 4.0:
        sentence = f"the rotors make {ratio:.2g} times the thrust that the motion needs"
        found.append(warning("unit", sentence, "check mass, thrust coefficient and the unit of rotor speed"))
    found += places
    turns = np.sqrt((motion.rate_body_rad_s[:, :2] ** 2).mean()) >= LEAST_RATE_RAD_S
    if any(f.what == "rotor order" for f in places) or not turns:
        return found
    return found + clocks.of_rotors(log, motion, vehicle, gyro_is_sure=gyro_is_sure)


def _electrical(times: float) -> Finding:
    sentence = (
        f"rotor speed is {times:.1f} times what the thrust needs: electrical revolutions of a motor with "
        f"{2 * round(times)} poles are {round(times)} times, rpm in a rad/s column 9.5 times as large"
    )
    return error("unit", sentence, "divide rotor_speed_rad_s by the motor's pole pairs, or multiply it by 2 pi / 60")


def _rpm(log: FlightLog, typical: float) -> Finding:
    sentence = f"rotor speed is {typical:.0f} (median): that is rpm in a rad/s column"
    repair = Repair("scale", log.names("rotor_speed_rad_s"), factor=RAD_S_PER_RPM)
    return error("unit", sentence, "multiply rotor_speed_rad_s by 2 pi / 60", repair=repair)


def _ratios(motion: Kinematics, logged: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(3,) logged velocity over the position's slope, and the standard error of that; infinite where nothing shows it.

    The velocity may be of another point of the body than the position (a pose sensor on an arm), so what turning makes
    of an unknown arm is fitted along, and the other axes too (a velocity in body axes).
    """
    arms = [rotations.rotate(motion.q, np.cross(motion.rate_body_rad_s, axis)) for axis in np.eye(3)]
    ratio, sigma = np.full(3, np.nan), np.full(3, np.inf)
    starts = np.arange(0, len(logged), round(1.0 / GRID_S))  # errors are correlated within a second or so
    for i in range(3):
        x = np.column_stack([motion.velocity_world_m_s, *(arm[:, i] for arm in arms)])
        x, y = x - x.mean(axis=0), logged[:, i] - logged[:, i].mean()
        others = np.delete(x, i, axis=1)
        own = x[:, i] - others @ np.linalg.lstsq(others, x[:, i], rcond=None)[0]
        signal = float((own**2).mean()) - motion.velocity_noise_m_s[i] ** 2
        if len(starts) < 4 or not signal > LEAST_SIGNAL * float((own**2).mean()):  # also where nothing moves at all
            continue
        slope = float(own @ y) / float(own @ own)
        left = y - others @ np.linalg.lstsq(others, y, rcond=None)[0] - slope * own
        pulls = np.add.reduceat(own * left, starts)
        ratio[i] = slope * float((own**2).mean()) / signal
        sigma[i] = np.sqrt((pulls**2).sum() * len(starts) / (len(starts) - 3)) / (signal * len(own))
    return ratio, sigma


def _regression(x: FloatArray, y: FloatArray) -> FloatArray:
    """(3, 3) matrix A of y = x A, means taken out."""
    return np.linalg.lstsq(x - x.mean(axis=0), y - y.mean(axis=0), rcond=None)[0]
