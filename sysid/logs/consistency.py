"""Do the channels of a log agree with each other and with physics: units, frames, rotor order, clocks?

Everything is judged from the pose, smoothed on a uniform grid: its acceleration must lie along the thrust axis, its
turning must be what the gyro reads, and the torque of the rotors must be what accelerates the turning.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import savgol_coeffs, savgol_filter

from flight import FlightLog, Progress, frames, rotations, silent
from flight.flight_log import COLUMNS
from flight.frames import GRAVITY_M_S2
from flight.rotations import FloatArray
from sysid.logs import rotor_order, streams
from sysid.logs.finding import Finding, Repair, error, warning
from sysid.logs.payload import as_flown, carries_payload
from vehicle import Vehicle, acceleration, wrench
from vehicle.invert import open_air

GRID_S = 0.01
WINDOW = 15
"""Samples of the local cubic fits: 0.15 s."""
DEGREES = 180.0 / np.pi
RPM = 60.0 / (2.0 * np.pi)
FAST_HZ = (3.0, 20.0)
"""Turning in this band is the rotors' doing: slower, drag and disturbances take part; faster, it is noise."""
XYZW = "the quaternion is stored x y z w; reorder it to w x y z"
CONJUGATE = "the quaternion takes world to body; conjugate it"
ATTITUDE_DOWN = "the attitude is NED/FRD while positions are z up; apply flight.frames.flip_attitude"
POSITIONS_DOWN = "positions are z down while the attitude is z up; apply flight.frames.flip_vector to them"
ALL_DOWN = (
    "positions and attitude are z down (NED/FRD): apply flight.frames.flip_vector to all vectors and "
    "flight.frames.flip_attitude"
)
_REREAD = {
    XYZW: Repair("quaternion order", COLUMNS["q_world_body"]),
    CONJUGATE: Repair("conjugate", COLUMNS["q_world_body"]),
    ATTITUDE_DOWN: Repair("flip", COLUMNS["q_world_body"]),
    POSITIONS_DOWN: Repair("flip", COLUMNS["position_world_m"]),
    ALL_DOWN: Repair("flip", tuple(c for q, columns in COLUMNS.items() if "rotor" not in q for c in columns)),
}
LEAST_SAMPLES = 50
"""Fewer samples of a quantity are not judged."""
RATIO_SIGMAS = 4.0
"""A ratio is called wrong when it is off by this many of its standard errors."""
LEAST_SIGNAL = 0.3
"""... and when at least this share of the variance of what it is taken against is no noise."""
LEAST_RATE_RAD_S = 0.15
"""Below this root mean square of the body rate, turning says nothing about gyro or rotors."""


@dataclass(frozen=True, slots=True)
class Kinematics:
    """Smoothed motion on a uniform grid."""

    time_s: FloatArray
    velocity_world_m_s: FloatArray
    velocity_noise_m_s: FloatArray
    """(3,) standard deviation of what the position's noise makes of the velocity."""
    specific_force_world_m_s2: FloatArray
    """(n, 3) acceleration less gravity: what the rotors and the air do, per mass."""
    q: FloatArray
    rate_body_rad_s: FloatArray
    angular_acceleration_rad_s2: FloatArray


def check(log: FlightLog, vehicle: Vehicle | None, progress: Progress = silent) -> tuple[list[Finding], list[str]]:
    """All findings that compare channels, and sentences on what is inconclusive; empty where a channel is not there."""
    found = [*_accelerometer(log)]
    flown = as_flown(vehicle, carries_payload(log)) if vehicle is not None else None
    motion = kinematics(log)
    if motion is None:
        places, inconclusive = _order(log, None, flown)
        return [*found, *places], inconclusive
    progress("checking", 0.2)
    attitude = _attitude(motion)
    found += [*attitude, *_velocity(log, motion)]
    if attitude:
        return found, []  # whatever is judged by the attitude would only repeat that
    progress("checking", 0.3)
    gyro = _gyro(log, motion)
    progress("checking", 0.5)
    places, inconclusive = _order(log, motion, flown, gyro_is_right=not any(f.level == "error" for f in gyro))
    progress("checking", 0.7)
    return [*found, *gyro, *_rotors(log, motion, flown, places)], inconclusive


def kinematics(log: FlightLog) -> Kinematics | None:
    """Motion from the pose alone; None without enough of it."""
    if not (log.has("position_world_m") and log.has("q_world_body")):
        return None
    position, q = log.vector("position_world_m"), log.vector("q_world_body")
    rows = np.flatnonzero(np.isfinite(position).all(axis=1) & np.isfinite(q).all(axis=1))
    if len(rows) < 50 or log.time_s[rows[-1]] - log.time_s[rows[0]] < 100 * GRID_S:
        return None
    first_s, last_s = float(log.time_s[rows[0]]), float(log.time_s[rows[-1]])
    if last_s - first_s > streams.LONGEST_S:
        return None
    time_s = np.arange(first_s, last_s, GRID_S)
    flips = np.cumprod(np.where((q[rows][1:] * q[rows][:-1]).sum(axis=1) < 0.0, -1.0, 1.0))
    smooth_q = q[rows] * np.concatenate([[1.0], flips])[:, None]
    q_grid = _resampled(time_s, log.time_s[rows], smooth_q)
    norm = np.linalg.norm(q_grid, axis=1, keepdims=True)
    q_grid = q_grid / np.where(norm > 0.0, norm, 1.0)
    rate = 2.0 * rotations.multiply(rotations.conjugate(_fit(q_grid, 0)), _fit(q_grid, 1))[:, 1:]
    grid = _resampled(time_s, log.time_s[rows], position[rows])
    return Kinematics(
        time_s=time_s,
        velocity_world_m_s=_fit(grid, 1),
        velocity_noise_m_s=_slope_noise(grid, float(np.median(np.diff(log.time_s[rows])))),
        specific_force_world_m_s2=_fit(grid, 2) + np.array([0.0, 0.0, GRAVITY_M_S2]),
        q=rotations.normalise(_fit(q_grid, 0)),
        rate_body_rad_s=rate,
        angular_acceleration_rad_s2=_fit(rate, 1),
    )


def _resampled(at: FloatArray, time_s: FloatArray, values: FloatArray) -> FloatArray:
    return np.stack([np.interp(at, time_s, column) for column in values.T], axis=1)


def _fit(values: FloatArray, derivative: int) -> FloatArray:
    return np.asarray(savgol_filter(values, WINDOW, 3, deriv=derivative, delta=GRID_S, axis=0))


def _slope_noise(grid: FloatArray, step_s: float) -> FloatArray:
    """Noise of `_fit(grid, 1)` by what the fit leaves of the samples, which were `step_s` apart before resampling."""
    left = grid - _fit(grid, 0)
    kept = savgol_coeffs(WINDOW, 3)
    share = np.sqrt(np.sum((np.eye(WINDOW)[WINDOW // 2] - kept) ** 2))  # of white noise that the fit leaves
    gain = np.linalg.norm(savgol_coeffs(WINDOW, 3, deriv=1, delta=GRID_S))
    fewer = np.sqrt(max(step_s / GRID_S, 1.0))  # interpolated samples are no new ones
    return left.std(axis=0) / share * gain * fewer


def _sampled(log: FlightLog, quantity: str) -> bool:
    """Whether a log has a quantity, and enough of it to judge."""
    return log.has(quantity) and int(np.isfinite(log.vector(quantity)).all(axis=1).sum()) >= LEAST_SAMPLES


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
        found.append(error("unit", sentence, "multiply specific_force_body by 9.80665", repair=repair))
    elif size < 5.0:
        sentence = f"the accelerometer reads {size:.2f} m/s2 as a rule: gravity is taken out, or the scale is off"
        found.append(error("frame", sentence, "log the specific force, gravity not removed"))
    if upward < -0.5 * size:
        sentence = "the accelerometer's z is negative in flight: body z points down"
        repair = Repair("flip", COLUMNS["specific_force_body_m_s2"])
        found.append(error("frame", sentence, "give it to flight.frames.flip_vector", repair=repair))
    return found


def _attitude(motion: Kinematics) -> list[Finding]:
    """The thrust axis must follow the acceleration; other readings of the quaternion are tried when it does not."""
    upright = motion.specific_force_world_m_s2
    gravity = np.array([0.0, 0.0, GRAVITY_M_S2])
    downward = frames.flip_vector(upright - gravity) + gravity
    q = motion.q
    turned = frames.flip_attitude(q)
    readings = {
        "": (q, upright),
        XYZW: (np.roll(q, 1, axis=1), upright),
        CONJUGATE: (rotations.conjugate(q), upright),
        "the quaternion is stored x y z w and takes world to body": (
            rotations.conjugate(np.roll(q, 1, axis=1)),
            upright,
        ),
        ATTITUDE_DOWN: (turned, upright),
        POSITIONS_DOWN: (q, downward),
        ALL_DOWN: (turned, downward),
    }
    angle = {fix: _angle_to_thrust(*reading) for fix, reading in readings.items()}
    spread = float(np.median(np.arccos(np.clip((upright / _length(upright))[:, 2], -1.0, 1.0))))
    best = min(angle, key=lambda fix: angle[fix])
    found = []
    if angle[""] > np.deg2rad(60.0) and best == "":
        found.append(
            error(
                "frame",
                f"the thrust axis is {DEGREES * angle['']:.0f} deg from where the acceleration points: position and "
                "attitude are in different frames",
                "check which world axes both use; world z must be up",
            )
        )
    elif best and angle[best] < 0.6 * angle[""] and angle[""] - angle[best] > np.deg2rad(1.0):
        sentence = (
            f"the thrust axis is {DEGREES * angle['']:.1f} deg from where the acceleration points "
            f"(median; {DEGREES * angle[best]:.1f} deg when read otherwise)"
        )
        found.append(error("frame", sentence, best, repair=_REREAD.get(best)))
    elif angle[""] > max(0.7 * spread, np.deg2rad(8.0)) and spread > np.deg2rad(4.0):
        sentence = f"attitude explains little of the acceleration: {DEGREES * angle['']:.1f} deg apart (median)"
        found.append(warning("frame", sentence, "check units of position and the frame of the attitude"))
    return found


def _angle_to_thrust(q: FloatArray, force: FloatArray) -> float:
    """Median angle between body z and the specific force."""
    axis = rotations.rotate(q, np.array([0.0, 0.0, 1.0]))
    return float(np.median(np.arccos(np.clip((axis * force / _length(force)).sum(axis=1), -1.0, 1.0))))


def _length(vectors: FloatArray) -> FloatArray:
    return np.linalg.norm(vectors, axis=1, keepdims=True)


def _velocity(log: FlightLog, motion: Kinematics) -> list[Finding]:
    """Logged velocity over the position's slope, axis by axis, where both errors of that ratio are small.

    Noise of the differentiated position pulls the ratio towards zero; how far is known from what the smoothing takes
    out of the position. Where an axis hardly moves, that is all there is.
    """
    if not _sampled(log, "velocity_world_m_s"):
        return []
    logged = _on_grid(log, "velocity_world_m_s", motion.time_s)
    ratio, error_of_ratio = _ratios(motion, logged)
    found = []
    for i, axis in enumerate("xyz"):
        slope, sure = ratio[i], RATIO_SIGMAS * error_of_ratio[i]
        if not np.std(motion.velocity_world_m_s[:, i]) > 0.1 or not np.isfinite(sure):
            continue
        if slope + sure < -0.5:
            sentence = f"velocity_world_{axis} runs against the position's slope ({slope:.2f} of it)"
            repair = Repair("scale", (COLUMNS["velocity_world_m_s"][i],), factor=-1.0)
            found.append(error("frame", sentence, f"turn the sign of velocity_world_{axis}", repair=repair))
        elif slope + sure < 0.8 or slope - sure > 1.25:
            sentence = f"velocity_world_{axis} is {slope:.2f} times the position's slope"
            found.append(warning("unit", sentence, "check its unit, or whether it is in body axes"))
    return found


def _gyro(log: FlightLog, motion: Kinematics) -> list[Finding]:
    if not _sampled(log, "rate_body_rad_s") or np.sqrt((motion.rate_body_rad_s**2).mean()) < LEAST_RATE_RAD_S:
        return []
    logged = _on_grid(log, "rate_body_rad_s", motion.time_s)
    delay_s, quality = gyro_after_attitude(log, motion)
    found = []
    if abs(delay_s) > 4e-3 and quality > 0.8:
        later = "late" if delay_s > 0.0 else "early"
        sentence = f"the gyro is {1000.0 * abs(delay_s):.0f} ms {later} against the attitude"
        fix = f"shift the gyro's time stamps by {-1000.0 * delay_s:+.0f} ms"
        repair = Repair("shift", COLUMNS["rate_body_rad_s"], shift_s=-delay_s)
        found.append(warning("clock", sentence, fix, repair=repair))
    matrix = _regression(motion.rate_body_rad_s, _shifted(logged, delay_s))
    for i, axis in enumerate("xyz"):
        if np.std(motion.rate_body_rad_s[:, i]) < LEAST_RATE_RAD_S:
            continue
        slope = matrix[i, i]
        if 0.6 * DEGREES < abs(slope) < 1.5 * DEGREES:
            found.append(
                error(
                    "unit",
                    f"rate_body_{axis} is {slope:.0f} times the attitude's turning: deg/s",
                    "divide it by 57.2958",
                    repair=Repair("scale", (COLUMNS["rate_body_rad_s"][i],), factor=1.0 / DEGREES),
                )
            )
        elif slope < -0.5:
            found.append(
                error(
                    "frame",
                    f"rate_body_{axis} turns against the attitude",
                    f"turn the sign of rate_body_{axis}",
                    repair=Repair("scale", (COLUMNS["rate_body_rad_s"][i],), factor=-1.0),
                )
            )
        elif abs(slope) < 0.4 and np.abs(matrix[:, i]).max() > 0.6:
            other = "xyz"[int(np.abs(matrix[:, i]).argmax())]
            found.append(
                error(
                    "frame",
                    f"rate_body_{axis} follows the turning about {other}",
                    "check the order of the gyro's axes",
                )
            )
    return found


def gyro_after_attitude(log: FlightLog, motion: Kinematics) -> tuple[float, float]:
    """By how much the gyro comes later than the attitude, and their correlation then."""
    return clock_offset(motion.rate_body_rad_s, _on_grid(log, "rate_body_rad_s", motion.time_s))


def _order(
    log: FlightLog, motion: Kinematics | None, vehicle: Vehicle | None, *, gyro_is_right: bool = True
) -> tuple[list[Finding], list[str]]:
    """Order and spins of the rotors, by the gyro, or by the attitude where the gyro is faulty or not there."""
    if vehicle is None or not _sampled(log, "rotor_speed_rad_s"):
        return [], []
    if gyro_is_right and _sampled(log, "rate_body_rad_s"):
        return rotor_order.check(log, (log.time_s, log.vector("rate_body_rad_s")), vehicle)
    return rotor_order.check(log, (motion.time_s, motion.rate_body_rad_s), vehicle) if motion is not None else ([], [])


def _rotors(log: FlightLog, motion: Kinematics, vehicle: Vehicle | None, places: list[Finding]) -> list[Finding]:
    """Unit of rotor speed, then its order and spins (`places`), then its clock."""
    if not _sampled(log, "rotor_speed_rad_s"):
        return []
    speed = _on_grid(log, "rotor_speed_rad_s", motion.time_s)
    if vehicle is None:
        if np.median(speed) > 4000.0:
            return [_rpm(float(np.median(speed)))]
        return []
    rest = np.zeros((len(speed), 3))
    thrust = wrench(vehicle, rest, rest, speed, open_air(len(speed)))[0][:, 2] / vehicle.mass_kg
    needed = np.linalg.norm(motion.specific_force_world_m_s2, axis=1)
    ratio = float(np.median(thrust) / np.median(needed))
    if 0.4 * RPM**2 < ratio < 2.5 * RPM**2:
        return [_rpm(float(np.median(speed)))]
    found = []
    if not 0.25 < ratio < 4.0:
        sentence = f"the rotors make {ratio:.2g} times the thrust that the motion needs"
        found.append(warning("unit", sentence, "check mass, thrust coefficient and the unit of rotor speed"))
    found += places
    return found if any(f.what == "rotor order" for f in places) else found + _rotor_clock(log, speed, motion, vehicle)


def _rpm(typical: float) -> Finding:
    sentence = f"rotor speed is {typical:.0f} as a rule: that is rpm in a rad/s column"
    repair = Repair("scale", COLUMNS["rotor_speed_rad_s"], factor=1.0 / RPM)
    return error("unit", sentence, "multiply rotor_speed by 2 pi / 60", repair=repair)


def _rotor_clock(log: FlightLog, speed: FloatArray, motion: Kinematics, vehicle: Vehicle) -> list[Finding]:
    """Rotor speed against the gyro or, where that follows it too little, against the motion."""
    if np.sqrt((motion.rate_body_rad_s[:, :2] ** 2).mean()) < LEAST_RATE_RAD_S:
        return []
    if _sampled(log, "rate_body_rad_s"):
        delay_s, quality = rotors_after_gyro(log, motion.time_s, vehicle)
        if quality > 0.7:
            return _late(delay_s, "gyro")
    driven, damping = _turning_by_rotors(speed, motion, vehicle)
    delay_s, quality = clock_offset((motion.angular_acceleration_rad_s2 - damping)[:, :2], driven[:, :2])
    return _late(delay_s, "motion") if quality > 0.7 else []


def _late(delay_s: float, against: str) -> list[Finding]:
    """Of rotor speed, where it is worth a word."""
    if abs(delay_s) < 8e-3:
        return []
    later = "late" if delay_s > 0.0 else "early"
    sentence = f"rotor speed is {1000.0 * abs(delay_s):.0f} ms {later} against the {against}"
    fix = f"shift rotor speed by {-1000.0 * delay_s:+.0f} ms against the {against}"
    repair = Repair("shift", COLUMNS["rotor_speed_rad_s"], shift_s=-delay_s)
    return [warning("clock", sentence, fix, repair=repair)]


def rotors_after_gyro(log: FlightLog, grid_s: FloatArray, vehicle: Vehicle) -> tuple[float, float]:
    """By how much rotor speed comes later than the gyro, from roll and pitch, and their correlation then."""
    speed, rate = (
        _resampled(grid_s, log.time_s[rows], values[rows])
        for values in (log.vector("rotor_speed_rad_s"), log.vector("rate_body_rad_s"))
        for rows in (np.isfinite(values).all(axis=1),)
    )
    rest = np.zeros((len(speed), 3))
    driven = acceleration(vehicle, rest, rest, speed, open_air(len(speed)))[1]
    return _fast_offset(np.gradient(rate[:, :2], GRID_S, axis=0), driven[:, :2])


def _fast_offset(reference: FloatArray, other: FloatArray, longest_s: float = 0.06) -> tuple[float, float]:
    """The same as `clock_offset` within `FAST_HZ`, to half a millisecond."""
    hz = np.fft.rfftfreq(len(reference), GRID_S)
    band, window = (hz > FAST_HZ[0]) & (hz < FAST_HZ[1]), np.hanning(len(reference))[:, None]
    a, b = (np.fft.rfft((x - x.mean(axis=0)) * window, axis=0)[band] for x in (reference, other))
    size = float(np.sqrt((np.abs(a) ** 2).sum() * (np.abs(b) ** 2).sum()))
    if size == 0.0:
        return 0.0, 0.0
    lags_s = np.arange(-longest_s, longest_s, 5e-4)
    together = (a.conj() * b).sum(axis=1)
    values = (np.exp(2j * np.pi * np.outer(lags_s, hz[band])) @ together).real / size
    best = int(np.argmax(values))
    return float(lags_s[best]), float(values[best])


def _turning_by_rotors(speed: FloatArray, motion: Kinematics, vehicle: Vehicle) -> tuple[FloatArray, FloatArray]:
    """(n, 3) angular acceleration the rotors alone make, and what the model adds for speed and turning."""
    rest = np.zeros((len(speed), 3))
    air = rotations.rotate(rotations.conjugate(motion.q), motion.velocity_world_m_s)
    around = replace(open_air(len(speed)), q_world_body=motion.q)
    driven = acceleration(vehicle, rest, rest, speed, around)[1]
    return driven, acceleration(vehicle, air, motion.rate_body_rad_s, speed, around)[1] - driven


def clock_offset(reference: FloatArray, other: FloatArray, longest_s: float = 0.15) -> tuple[float, float]:
    """By how much `other` comes later than `reference`, both (n, c) on the grid, and their correlation then."""
    lags = np.arange(-int(longest_s / GRID_S), int(longest_s / GRID_S) + 1)
    edge = len(lags) // 2
    base = reference[edge : len(reference) - edge]
    values = np.array([_correlation(base.ravel(), other[edge + lag : len(other) - edge + lag].ravel()) for lag in lags])
    best = int(np.argmax(values))
    if best in (0, len(lags) - 1):
        return 0.0, float(values[best])
    left, middle, right = values[best - 1 : best + 2]
    curve = left - 2.0 * middle + right
    fine = 0.5 * (left - right) / curve if curve < 0.0 else 0.0
    return float((lags[best] + fine) * GRID_S), float(middle)


def _shifted(values: FloatArray, delay_s: float) -> FloatArray:
    grid = np.arange(len(values), dtype=np.float64)
    return _resampled(grid + delay_s / GRID_S, grid, values)


def _on_grid(log: FlightLog, quantity: str, time_s: FloatArray) -> FloatArray:
    values = log.vector(quantity)
    rows = np.isfinite(values).all(axis=1)
    return _fit(_resampled(time_s, log.time_s[rows], values[rows]), 0)


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
        if len(starts) < 4 or signal < LEAST_SIGNAL * float((own**2).mean()):
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


def _correlation(a: FloatArray, b: FloatArray) -> float:
    a, b = a - a.mean(), b - b.mean()
    size = float(np.sqrt((a @ a) * (b @ b)))
    return float(a @ b) / size if size > 0.0 else 0.0
