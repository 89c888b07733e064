"""Motion: model defects over each interval between nodes, whitened, with their derivatives.

Implicit midpoint rule: everything is evaluated once per interval, half-way between the two states, with the mean
rotor speed of the interval. Only the wrench is differentiated by the vehicle; the rigid body is chained here by hand.
Unmodelled acceleration is white noise in body axes, so a defect has the covariance of its integral over the interval.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from flight import rotations
from flight.rotations import FloatArray
from sysid import _sysid
from sysid.estimator.blocks.base import At, Block, Channel, Linear
from sysid.estimator.blocks.noise import MOTION, Noise
from sysid.estimator.flights.clocks import delay_name, delay_of
from sysid.estimator.flights.flight_data import Flight, IndexArray
from sysid.estimator.motors import motor, rotor_speed
from sysid.estimator.trajectory.midpoint import Middle, rates_of_change
from sysid.estimator.trajectory.model import along, slopes_along
from sysid.estimator.trajectory.states import ATTITUDE, GUST_FORCE, GUST_TORQUE, POSITION, RATE, VELOCITY, States
from vehicle import Jacobian

ROWS = 12
"""Defects of an interval, each in the place of the unknown that it belongs to."""
FORCE, TORQUE = slice(0, 3), slice(3, 6)
"""Of the six accelerations."""
GAINED = np.array([3, 4, 5, 9, 10, 11])
"""The defect that each of them moves."""
HEIGHT = 2
"""Place of the height among a node's unknowns."""
LEAST_PROCESS = np.array([2e-4, 2e-4, 2e-4, 2e-3, 2e-3, 2e-3])
"""Floor of the estimated process noise: what the midpoint rule itself leaves over."""
LEAST_FORCE_WITHOUT_POSE = 0.1
"""Without a pose, positions hang on almost nothing; a stiffer model would leave their equations singular."""
OVER_RELAXATION = 1.6
"""Power of the update of a level that falls: the plain fixed point (1) creeps, 2 overshoots."""
SECOND_DIFFERENCE_S = 2e-4
"""Change of a delay that shows how its slope changes: well below a sample, well above rounding."""


class Motion(Block):
    """What is left of the motion over each interval: position, velocity, turn, rate, in body axes."""

    name = MOTION
    order = 0
    between = True
    levels = tuple(f"{what}_sqrt_s" for what in ("force_m_s2", "torque_rad_s2") for _ in "xyz")
    usual = (1.0, 1.0, 1.0, 10.0, 10.0, 10.0)
    level_of_row = (0, 1, 2, 0, 1, 2, 3, 4, 5, 3, 4, 5)
    channels = (
        *(Channel(f"F_{axis}", (VELOCITY.start + i,), "m/s2") for i, axis in enumerate("xyz")),
        *(Channel(f"M_{axis}", (RATE.start + i,), "rad/s2") for i, axis in enumerate("xyz")),
    )

    def measured(self, flight: Flight) -> bool:
        return True

    def residual(self, at: At) -> FloatArray:
        return defects(at.states, at.mid, along(at.vehicle, at.flight, at.mid))

    def linear(self, at: At) -> Linear:
        acceleration, names = slopes_along(at.vehicle, at.model, at.flight, at.mid), at.model
        driving = next((q for q in (rotor_speed.QUANTITY, motor.QUANTITY) if q in at.flight.streams), None)
        if driving is not None:
            by_delay = along_rotors(acceleration, *rotor_speed.by_delay(at.flight, at.sensors))
            columns = np.concatenate([acceleration.parameters, by_delay[:, :, None]], axis=2)
            acceleration = replace(acceleration, parameters=columns)
            names = (*names, delay_name(driving, at.flight.log_index))
        before, after, by_shared = defect_jacobians(at.states, at.mid, acceleration)
        return Linear(defects(at.states, at.mid, acceleration.value), (before, after), by_shared, names)

    def white_residual(self, at: At, robust: bool) -> FloatArray:
        return whiten(at.mid.step_s, at.noise.process, self.residual(at))[0]

    def white(self, at: At, robust: bool) -> Linear:
        linear = self.linear(at)
        rows = (linear.residual, *linear.by_state, linear.by_shared)
        residual, before, after, by_shared = whiten(at.mid.step_s, at.noise.process, *rows)
        return Linear(residual, (before, after), by_shared, linear.shared)

    def curvature(self, at: At) -> dict[str, float]:
        """By the delay of rotor speed. A controller answers disturbances, so what the model leaves unexplained goes
        with rotor speed and its second derivative: the cost was up to five times as curved as Gauss-Newton takes it."""
        if rotor_speed.QUANTITY not in at.flight.streams:
            return {}
        name, h, e = delay_name(rotor_speed.QUANTITY, at.flight.log_index), at.mid.step_s, SECOND_DIFFERENCE_S
        delay_s = delay_of(rotor_speed.QUANTITY, at.flight, at.sensors)
        before, now, after = (
            along(at.vehicle, rotor_speed.aligned(at.flight, {name: delay_s + change}), at.mid)
            for change in (-e, 0.0, e)
        )
        second = np.zeros((len(h), ROWS))
        second[:, GAINED] = -h * (after - 2.0 * now + before) / e**2
        white = whiten(h, at.noise.process, defects(at.states, at.mid, now), second)
        return {name: float(np.vdot(*white))}

    def updated(self, levels: FloatArray, ratio: FloatArray, flights: Sequence[Flight]) -> FloatArray:
        least = LEAST_PROCESS.copy()
        if not all(flight.has_pose for flight in flights):
            least[FORCE] = LEAST_FORCE_WITHOUT_POSE
        return np.maximum(levels * over_relaxed(ratio), least)

    def reported(self, noise: Noise) -> dict[str, Any]:
        return {self.levels[part.start]: noise.process[part].tolist() for part in (FORCE, TORQUE)}


def along_rotors(acceleration: Jacobian, speed: FloatArray, change: FloatArray) -> FloatArray:
    """(k, 6) change of the model's acceleration with changes (k, r) of rotor speed and of rotor acceleration."""
    return np.einsum("kij,kj->ki", acceleration.rotor_speed, speed) + np.einsum(
        "kij,kj->ki", acceleration.rotor_acceleration, change
    )


def over_relaxed(ratio: FloatArray) -> FloatArray:
    """Ratios of an update, those below one the further from it."""
    return np.where(ratio < 1.0, ratio**OVER_RELAXATION, ratio)


def defects(states: States, mid: Middle, value: FloatArray) -> FloatArray:
    """(k, 12) what is left of the motion over each interval: position, velocity (body axes), turn, rate."""
    h = mid.step_s
    moved = np.diff(states.position_world_m, axis=0) - h * mid.velocity_world_m_s
    # The cross product is the coning term of a rate that changes linearly over the interval (Magnus, fourth order).
    coning = h * h / 12.0 * np.cross(states.rate_body_rad_s[:-1], states.rate_body_rad_s[1:])
    change = h * (rates_of_change(states, mid) - value)
    if states.gust is not None:
        gust = 0.5 * (states.gust[:-1] + states.gust[1:])
        change -= h * np.concatenate([(gust[:, None, FORCE] @ mid.R_world_body)[:, 0], gust[:, TORQUE]], axis=1)
    return np.concatenate(
        [
            (moved[:, None, :] @ mid.R_world_body)[:, 0],
            change[:, FORCE],
            mid.turn_rad - h * mid.rate_body_rad_s - coning,
            change[:, TORQUE],
        ],
        axis=1,
    )


def defect_jacobians(states: States, mid: Middle, acceleration: Jacobian) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Derivatives of `defects` by the states before and after (k, 12, s) and by the parameters (k, 12, p)."""
    k = len(mid.step_s)
    h = mid.step_s[:, :, None]
    Rt = np.swapaxes(mid.R_world_body, 1, 2)
    eye = np.broadcast_to(np.eye(3), (k, 3, 3))
    half_turn = rotations.hat(mid.turn_rad)
    # attitude of the middle by the attitudes before and after, to first order in the turn
    m0, m1 = 0.5 * eye - 0.125 * half_turn, 0.5 * eye + 0.125 * half_turn
    square = half_turn @ half_turn / 12.0
    moved = np.diff(states.position_world_m, axis=0) - mid.step_s * mid.velocity_world_m_s
    gained = np.diff(states.velocity_world_m_s, axis=0) - mid.step_s * mid.gravity_world_m_s2
    if states.gust is not None:
        gained -= 0.5 * mid.step_s * (states.gust[:-1, FORCE] + states.gust[1:, FORCE])
    hat_moved = rotations.hat((moved[:, None, :] @ mid.R_world_body)[:, 0])
    hat_gained = rotations.hat((gained[:, None, :] @ mid.R_world_body)[:, 0])
    by_velocity, by_rate = h * acceleration.velocity, h * acceleration.rate
    by_attitude = by_velocity @ rotations.hat(mid.velocity_body_m_s) + h * acceleration.attitude
    by_velocity_world = by_velocity @ Rt
    by_height = 0.5 * h[:, 0] * acceleration.height

    before, after = np.zeros((2, k, ROWS, states.size))
    for jacobian, sign, half in ((before, -1.0, m0), (after, 1.0, m1)):
        jacobian[:, POSITION, POSITION] = sign * Rt
        jacobian[:, POSITION, VELOCITY] = -0.5 * h * Rt
        jacobian[:, POSITION, ATTITUDE] = hat_moved @ half
        jacobian[:, VELOCITY, VELOCITY] = sign * Rt - 0.5 * by_velocity_world[:, FORCE]
        jacobian[:, VELOCITY, ATTITUDE] = (hat_gained - by_attitude[:, FORCE]) @ half
        jacobian[:, VELOCITY, RATE] = -0.5 * by_rate[:, FORCE]
        jacobian[:, ATTITUDE, ATTITUDE] = sign * (eye + square) + 0.5 * half_turn
        jacobian[:, ATTITUDE, RATE] = -0.5 * h * eye
        jacobian[:, RATE, VELOCITY] = -0.5 * by_velocity_world[:, TORQUE]
        jacobian[:, RATE, ATTITUDE] = -by_attitude[:, TORQUE] @ half
        jacobian[:, RATE, RATE] = sign * eye - 0.5 * by_rate[:, TORQUE]
        jacobian[:, VELOCITY, HEIGHT] -= by_height[:, FORCE]
        jacobian[:, RATE, HEIGHT] -= by_height[:, TORQUE]
        if states.gust is not None:
            jacobian[:, VELOCITY, GUST_FORCE] = -0.5 * h * Rt
            jacobian[:, RATE, GUST_TORQUE] = -0.5 * h * eye
    border = np.zeros((k, ROWS, acceleration.parameters.shape[2]))
    border[:, VELOCITY] = -h * acceleration.parameters[:, FORCE]
    border[:, RATE] = -h * acceleration.parameters[:, TORQUE]
    return before, after, border


def whiten(step_s: FloatArray, std: FloatArray, *rows: FloatArray) -> list[FloatArray]:
    """Rows (k, 12, ...) of defects divided by the Cholesky factor of their covariance.

    White acceleration of density std^2 (six channels, m/s2 and rad/s2 times root second) makes the covariance of the
    pair (position, velocity) over h std^2 [[h^3/3, h^2/2], [h^2/2, h]]; turn and rate likewise.

    Args:
        step_s: (k, 1).
        std: (6,).
    """
    first, second = np.sqrt(step_s**3 / 3.0), 0.5 * np.sqrt(step_s)
    mixed = 0.5 * step_s**2 / first
    scale = np.concatenate([1.0 / (first * std), 1.0 / (second * std), mixed / second * np.ones(6)], axis=1)
    result = []
    for row in rows:
        white = np.array(row.reshape(len(row), ROWS, -1 if row.size else 0), dtype=np.float64, order="C")
        _sysid.whiten(scale, white)
        result.append(white.reshape(row.shape))
    return result


def moved_by_acceleration(
    which: slice | IndexArray, step_s: FloatArray, process: FloatArray
) -> tuple[IndexArray, FloatArray]:
    """Rows that a mean acceleration in some of the six channels moves, and (k, channels) by how much, whitened.

    The integral of the acceleration over the interval goes with its rate of change, and takes no row of its own.
    """
    return GAINED[which], -2.0 * np.sqrt(step_s)[:, None] / process[which]


BLOCK = Motion()
