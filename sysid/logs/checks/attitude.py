"""Is the attitude read as it was written? Its thrust axis must follow the acceleration that the positions show.

Other readings of the quaternion are tried: another order, the inverse, axes with z down, another heading than that of
the positions. What contradicts a third sensor is left out before they are compared: which way the positions' z points
is shown by thrust (more of it accelerates upwards), which of the readings turns like the vehicle by the gyro.
"""

from dataclasses import dataclass

import numpy as np

from flight import FlightLog, frames, rotations
from flight.flight_log import COLUMNS
from flight.frames import GRAVITY_M_S2
from flight.rotations import FloatArray
from sysid.logs.checks import clocks
from sysid.logs.checks.finding import Finding, error, warning
from sysid.logs.checks.motion import GRID_S, Kinematics, on_grid, sampled
from sysid.logs.events.repair import Repair

DEGREES = 180.0 / np.pi
XYZW = "reorder the quaternion, which is stored x y z w, to w x y z"
CONJUGATE = "conjugate the quaternion, which takes world to body"
BOTH = "reorder the quaternion, which is stored x y z w, and conjugate it: it takes world to body"
ATTITUDE_DOWN = "turn the attitude from NED/FRD to z up, as the positions are"
POSITIONS_DOWN = "turn the positions from z down to z up, as the attitude is"
ALL_DOWN = "turn attitude and all vectors from z down (NED/FRD) to z up"
WORLD_DOWN = "turn the attitude's world axes from z down (NED) to z up, as the positions are"
BODY_DOWN = "turn the attitude's body axes from z down (FRD) to z up"
_HALF_TURN = (np.pi, 0.0, 0.0)
_REREAD = {
    XYZW: Repair("quaternion order", COLUMNS["q_world_body"]),
    CONJUGATE: Repair("conjugate", COLUMNS["q_world_body"]),
    ATTITUDE_DOWN: Repair("flip", COLUMNS["q_world_body"]),
    WORLD_DOWN: Repair("turn", COLUMNS["q_world_body"], turn_rad=_HALF_TURN),
    BODY_DOWN: Repair("turn body", COLUMNS["q_world_body"], turn_rad=_HALF_TURN),
    POSITIONS_DOWN: Repair("flip", COLUMNS["position_world_m"]),
    ALL_DOWN: Repair("flip", tuple(c for q, columns in COLUMNS.items() if "rotor" not in q for c in columns)),
}
SIGMAS = 4.0
"""What thrust or a heading shows by so many standard errors is sure."""
LEAST_HEADING_RAD = np.deg2rad(10.0)
"""A heading this far off is no drift: on 89 real flights of two small quadrotors one was off by 9.3 deg, the others by
up to 4.8 deg."""
LEAST_KNOWN_RAD = np.deg2rad(45.0)
"""A heading that is less sure than this is no heading: axis and force are not turned against each other at all."""
CLEARLY = 0.9
"""One reading explains clearly more than another if it brings the thrust axis to this share of the other's angle."""
LEAST_CORRELATION = 0.5
"""Of the gyro and a reading's rate, from which on the one follows the other; a reading with half as much does not."""
LEAST_RATE_RAD_S = 0.15
"""Below this root mean square of the body rate, turning says nothing about gyro or rotors."""
BLOCK_S = 1.0
"""Errors are taken as independent between blocks of this length."""
SPARE_BLOCKS = 3
"""Of so many blocks more than coefficients an error can be estimated: of fewer, their pulls cancel to nothing."""
LEVEL_COEFFICIENTS = 5
"""Of `level_gain`."""
WITHIN = 3.0
"""A gain that is further than this factor from what physics has is another thing: a controller's answer to gusts."""


@dataclass(frozen=True, slots=True)
class Reading:
    """One way to read a pose."""

    fix: str
    """What it changes, in words; empty: nothing."""
    q_world_body: FloatArray
    upward: bool
    """Whether z of the positions points up."""


def check(log: FlightLog, motion: Kinematics) -> list[Finding]:
    """The reading of the pose in which the thrust axis follows the acceleration, if it is not the one given."""
    upward, gyros = _points_up(log, motion), _gyros(log, motion)
    readings = _uncontradicted(motion, upward, gyros)
    angle = {r.fix: _angle_to_thrust(r.q_world_body, _force(motion, r)) for r in readings}
    as_given = _angle_to_thrust(motion.q, motion.specific_force_world_m_s2)
    force = motion.specific_force_world_m_s2
    spread = float(np.median(np.arccos(np.clip((force / _length(force))[:, 2], -1.0, 1.0))))
    best = min(angle, key=lambda fix: angle[fix])
    headings = _headings(motion, readings)
    if headings and min(headings) < CLEARLY * angle[best]:
        return [_turned(*headings[min(headings)], sure=len(gyros) == 1)]
    if as_given > np.deg2rad(60.0) and best == "":
        sentence = (
            f"the thrust axis is {DEGREES * as_given:.0f} deg from where the acceleration points: position and "
            "attitude are in different frames"
        )
        return [error("frame", sentence, "check which world axes both use; world z must be up")]
    if best and angle[best] < 0.6 * as_given and as_given - angle[best] > np.deg2rad(1.0):
        sentence = (
            f"the thrust axis is {DEGREES * as_given:.1f} deg from where the acceleration points "
            f"(median; {DEGREES * angle[best]:.1f} deg after the fix)"
        )
        if upward is None and headings and CLEARLY * min(headings) < angle[best]:
            other = _turned(*headings[min(headings)], sure=False)
            fix = f"either {best}, or {other.fix}: fly quickly up and down to decide"
            return [error("frame", sentence, fix)]
        return [error("frame", sentence, best, repair=_REREAD.get(best))]
    if upward is False and as_given < angle[best]:
        sentence = (
            "more thrust accelerates towards -z: the positions' z points down, and x and y are as the attitude is"
        )
        repair = Repair("scale", ("position_world_z_m",), factor=-1.0)
        return [error("frame", sentence, "turn the sign of position_world_z", repair=repair)]
    if as_given > max(0.7 * spread, np.deg2rad(8.0)) and spread > np.deg2rad(4.0):
        sentence = f"attitude explains little of the acceleration: {DEGREES * as_given:.1f} deg apart (median)"
        return [
            warning(
                "frame", sentence, "check unit, order and signs of the positions' axes, and the frame of the attitude"
            )
        ]
    return []


def unsure(motion: Kinematics) -> list[str]:
    """In words, that a flight is too short to compare the headings of attitude and positions; empty if it is not."""
    length_s, blocks = GRID_S * len(motion.time_s), LEVEL_COEFFICIENTS + SPARE_BLOCKS
    least_s = (blocks - 1) * BLOCK_S  # the last block may be a part of one
    if length_s > least_s:
        return []
    sentence = "whether the attitude's heading is that of the positions shows in flights of more than"
    return [f"the flight lasts {length_s:.1f} s: {sentence} {least_s:.0f} s"]


def _headings(motion: Kinematics, readings: list[Reading]) -> dict[float, tuple[Reading, float, float]]:
    """By the thrust axis's angle that is left: readings whose heading is surely another, that heading and its error."""
    found = {}
    for reading in readings:
        if reading.fix not in ("", ATTITUDE_DOWN, POSITIONS_DOWN, ALL_DOWN):
            continue
        heading_rad, sigma_rad = _heading(motion, reading)
        known_rad = SIGMAS * sigma_rad
        if known_rad < LEAST_KNOWN_RAD and abs(heading_rad) > LEAST_HEADING_RAD + known_rad:
            q = rotations.multiply(rotations.exp(np.array([0.0, 0.0, heading_rad])), reading.q_world_body)
            found[_angle_to_thrust(q, _force(motion, reading))] = reading, heading_rad, sigma_rad
    return found


def _turned(reading: Reading, heading_rad: float, sigma_rad: float, *, sure: bool) -> Finding:
    """A heading of the attitude that is not the positions'; where z is down as well, that is to be changed first.

    Args:
        sure: whether gyro and accelerometer tell an attitude with z down from positions that are left-handed.
    """
    sentence = (
        f"the attitude's heading is {DEGREES * heading_rad:+.1f} ± {DEGREES * sigma_rad:.1f} deg from that of the "
        "positions: they are in different frames"
    )
    if reading.fix in (ATTITUDE_DOWN, ALL_DOWN) and not sure:
        fix = f"{reading.fix}, or check order and signs of the positions' axes; gyro and accelerometer would decide"
        return error("frame", sentence, fix)
    if reading.fix:
        return error("frame", f"{sentence}, and z of one points down", reading.fix, repair=_REREAD[reading.fix])
    fix = f"turn the attitude by {DEGREES * heading_rad:+.1f} deg about the vertical, or take both from one source"
    return error(
        "frame", sentence, fix, repair=Repair("turn", COLUMNS["q_world_body"], turn_rad=(0.0, 0.0, heading_rad))
    )


def _uncontradicted(motion: Kinematics, upward: bool | None, gyros: list[FloatArray]) -> list[Reading]:
    """All readings but those that thrust or gyro contradict; where these contradict all, all."""
    q = motion.q
    turned, half = frames.flip_attitude(q), rotations.exp(np.array(_HALF_TURN))
    readings = [
        Reading("", q, True),
        Reading(XYZW, np.roll(q, 1, axis=1), True),
        Reading(CONJUGATE, rotations.conjugate(q), True),
        Reading(BOTH, rotations.conjugate(np.roll(q, 1, axis=1)), True),
        Reading(ATTITUDE_DOWN, turned, True),
        Reading(WORLD_DOWN, rotations.multiply(half, q), True),
        Reading(BODY_DOWN, rotations.multiply(q, half), True),
        Reading(POSITIONS_DOWN, q, False),
        Reading(ALL_DOWN, turned, False),
    ]
    same_sense = [r for r in readings if upward is None or r.upward == upward]
    follows = {r.fix: max((_correlation(gyro, r) for gyro in gyros), default=0.0) for r in same_sense}
    most = max(follows.values())
    return [r for r in same_sense if most < LEAST_CORRELATION or follows[r.fix] > 0.5 * most]


def _points_up(log: FlightLog, motion: Kinematics) -> bool | None:
    """Whether the positions' z points up; None where the flight does not show it.

    With the positions' acceleration a and gravity g, of which the sign s depends on z, the thrust T per mass has
    T^2 = |a|^2 + 2 s g a_z + g^2, in whatever unit and body axes T was measured. Accelerometer or rotors measure it.
    """
    acceleration = motion.specific_force_world_m_s2 - np.array([0.0, 0.0, GRAVITY_M_S2])
    for quantity in ("specific_force_body_m_s2", "rotor_speed_rad_s", "rotor_speed_command_rad_s"):
        if not sampled(log, quantity):
            continue
        squares = (on_grid(log, quantity, motion.time_s) ** 2).sum(axis=1)  # of a rotor's speed: its thrust
        thrust_squared = squares if quantity.startswith("specific") else squares**2
        beside = np.column_stack([acceleration[:, 2], (acceleration**2).sum(axis=1), np.ones(len(squares))])
        slope, covariance = _regressed(beside, thrust_squared / max(float(thrust_squared.mean()), 1e-300))
        gain = 0.5 * GRAVITY_M_S2 * abs(slope[0])  # 1, as the mean of T^2 is near that of hover
        if abs(slope[0]) > SIGMAS * np.sqrt(covariance[0, 0]) and 1.0 / WITHIN < gain < WITHIN:
            return bool(slope[0] > 0.0)
    return None


def _gyros(log: FlightLog, motion: Kinematics) -> list[FloatArray]:
    """(n, 3) body rate by the gyro, body z up; both readings without an accelerometer, none if it hardly turns."""
    if not sampled(log, "rate_body_rad_s") or np.sqrt((motion.rate_body_rad_s**2).mean()) < LEAST_RATE_RAD_S:
        return []
    rate = on_grid(log, "rate_body_rad_s", motion.time_s)
    if not sampled(log, "specific_force_body_m_s2"):
        return [rate, frames.flip_vector(rate)]
    upward = np.median(on_grid(log, "specific_force_body_m_s2", motion.time_s)[:, 2]) > 0.0
    return [rate if upward else frames.flip_vector(rate)]


def _correlation(gyro: FloatArray, reading: Reading) -> float:
    """Of the gyro and the reading's rate, whatever their clocks."""
    q = reading.q_world_body
    rate = 2.0 * rotations.multiply(rotations.conjugate(q), np.gradient(q, GRID_S, axis=0))[:, 1:]
    return clocks.largest_correlation(rate, gyro)[1]


def _heading(motion: Kinematics, reading: Reading) -> tuple[float, float]:
    """By how much the attitude is to be turned about the vertical to have the positions' heading, and its error."""
    force = _force(motion, reading)
    velocity = motion.velocity_world_m_s if reading.upward else frames.flip_vector(motion.velocity_world_m_s)
    axis = rotations.rotate(reading.q_world_body, np.array([0.0, 0.0, 1.0])) * _length(force)
    gain, sigma = level_gain(axis, velocity, force)
    if not 1.0 / WITHIN < abs(gain) < WITHIN:
        return 0.0, np.inf
    return float(np.angle(gain)), sigma / abs(gain)


def level_gain(axis: FloatArray, velocity: FloatArray, force: FloatArray) -> tuple[complex, float]:
    """Level force over level thrust axis (n, 3), as complex numbers: `c`, and its error across.

    force = c axis - d velocity + e: the angle of c is a heading, its size 1; drag (d) and wind or a tilt (e) would
    otherwise look like a heading in turns flown one way.
    """
    one, none = np.ones(len(force)), np.zeros(len(force))
    east = np.column_stack([axis[:, 0], -axis[:, 1], velocity[:, 0], one, none])
    north = np.column_stack([axis[:, 1], axis[:, 0], velocity[:, 1], none, one])
    (real, imaginary, *_), covariance = _regressed(np.stack([east, north]), force[:, :2].T)
    size = float(np.hypot(real, imaginary))
    if not size > 0.0 or not np.isfinite(covariance[0, 0]):
        return 0j, np.inf
    across = np.array([-imaginary, real]) / size
    return complex(real, imaginary), float(np.sqrt(across @ covariance[:2, :2] @ across))


def _regressed(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Coefficients (k,) of y (..., n) on x (..., n, k), and their covariance, errors being correlated in a block.

    The covariance is infinite where there are too few blocks to estimate it.
    """
    columns = x.reshape(-1, x.shape[-1])
    found = np.asarray(np.linalg.lstsq(columns, y.ravel(), rcond=None)[0], dtype=np.float64)
    pulls = (x * (y - x @ found)[..., None]).reshape(-1, *x.shape[-2:]).sum(axis=0)
    blocks = np.add.reduceat(pulls, np.arange(0, len(pulls), round(BLOCK_S / GRID_S)))
    spare = len(blocks) - len(found)
    if spare < SPARE_BLOCKS:
        return found, np.diag(np.full(len(found), np.inf))
    inverse = np.linalg.pinv(columns.T @ columns)
    return found, inverse @ (blocks.T @ blocks) @ inverse * len(blocks) / spare


def _force(motion: Kinematics, reading: Reading) -> FloatArray:
    """(n, 3) specific force by the positions, z up."""
    gravity = np.array([0.0, 0.0, GRAVITY_M_S2])
    upright = motion.specific_force_world_m_s2
    return upright if reading.upward else frames.flip_vector(upright - gravity) + gravity


def _angle_to_thrust(q: FloatArray, force: FloatArray) -> float:
    """Median angle between body z and the specific force."""
    axis = rotations.rotate(q, np.array([0.0, 0.0, 1.0]))
    return float(np.median(np.arccos(np.clip((axis * force / _length(force)).sum(axis=1), -1.0, 1.0))))


def _length(vectors: FloatArray) -> FloatArray:
    return np.linalg.norm(vectors, axis=1, keepdims=True)
