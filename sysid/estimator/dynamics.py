"""Model defects over each interval between nodes, whitened, with their derivatives.

Implicit midpoint rule: everything is evaluated once per interval, half-way between the two states, with the mean
rotor speed of the interval. Only the wrench is differentiated by the vehicle; the rigid body is chained here by hand.
Unmodelled acceleration is white noise in body axes, so a defect has the covariance of its integral over the interval.
"""

import numpy as np

from flight import rotations
from flight.frames import GRAVITY_M_S2
from flight.rotations import FloatArray
from sysid import _sysid
from sysid.estimator.flight_data import Flight
from sysid.estimator.midpoint import Middle, middle
from sysid.estimator.model import along
from sysid.estimator.states import GUST, MOTION, States
from vehicle import Jacobian, Vehicle

GRAVITY_WORLD_M_S2 = np.array([0.0, 0.0, -GRAVITY_M_S2])


def unexplained(flight: Flight, states: States, vehicle: Vehicle) -> FloatArray:
    """(k, 6) mean acceleration the vehicle does not explain: body axes, m/s2 and rad/s2."""
    mid = middle(flight, states)
    return rates_of_change(states, mid) - along(vehicle, flight, mid)


def rates_of_change(states: States, mid: Middle) -> FloatArray:
    dv = np.diff(states.velocity_world_m_s, axis=0) / mid.step_s - GRAVITY_WORLD_M_S2
    specific_force = (dv[:, None, :] @ mid.R_world_body)[:, 0]
    return np.concatenate([specific_force, np.diff(states.rate_body_rad_s, axis=0) / mid.step_s], axis=1)


def defects(states: States, mid: Middle, value: FloatArray) -> FloatArray:
    """(k, 12) what is left of the motion over each interval: position, velocity (body axes), turn, rate."""
    h = mid.step_s
    moved = np.diff(states.position_world_m, axis=0) - h * mid.velocity_world_m_s
    # The cross product is the coning term of a rate that changes linearly over the interval (Magnus, fourth order).
    coning = h * h / 12.0 * np.cross(states.rate_body_rad_s[:-1], states.rate_body_rad_s[1:])
    change = h * (rates_of_change(states, mid) - value)
    if states.gust is not None:
        gust = 0.5 * (states.gust[:-1] + states.gust[1:])
        change -= h * np.concatenate([(gust[:, None, :3] @ mid.R_world_body)[:, 0], gust[:, 3:]], axis=1)
    return np.concatenate(
        [
            (moved[:, None, :] @ mid.R_world_body)[:, 0],
            change[:, :3],
            mid.turn_rad - h * mid.rate_body_rad_s - coning,
            change[:, 3:],
        ],
        axis=1,
    )


def defect_jacobians(states: States, mid: Middle, acceleration: Jacobian) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Derivatives of `defects` by the states before and after (k, 12, 12 or 18) and by the parameters (k, 12, p)."""
    k = len(mid.step_s)
    h = mid.step_s[:, :, None]
    Rt = np.swapaxes(mid.R_world_body, 1, 2)
    eye = np.broadcast_to(np.eye(3), (k, 3, 3))
    half_turn = rotations.hat(mid.turn_rad)
    # attitude of the middle by the attitudes before and after, to first order in the turn
    m0, m1 = 0.5 * eye - 0.125 * half_turn, 0.5 * eye + 0.125 * half_turn
    square = half_turn @ half_turn / 12.0
    moved = np.diff(states.position_world_m, axis=0) - mid.step_s * mid.velocity_world_m_s
    gained = np.diff(states.velocity_world_m_s, axis=0) - mid.step_s * GRAVITY_WORLD_M_S2
    if states.gust is not None:
        gained -= 0.5 * mid.step_s * (states.gust[:-1, :3] + states.gust[1:, :3])
    hat_moved = rotations.hat((moved[:, None, :] @ mid.R_world_body)[:, 0])
    hat_gained = rotations.hat((gained[:, None, :] @ mid.R_world_body)[:, 0])
    by_velocity, by_rate = h * acceleration.velocity, h * acceleration.rate
    by_attitude = by_velocity @ rotations.hat(mid.velocity_body_m_s) + h * acceleration.attitude
    by_velocity_world = by_velocity @ Rt
    by_height = 0.5 * h[:, 0] * acceleration.height

    before, after = np.zeros((2, k, 12, MOTION if states.gust is None else MOTION + GUST))
    for jacobian, sign, half in ((before, -1.0, m0), (after, 1.0, m1)):
        jacobian[:, 0:3, 0:3] = sign * Rt
        jacobian[:, 0:3, 3:6] = -0.5 * h * Rt
        jacobian[:, 0:3, 6:9] = hat_moved @ half
        jacobian[:, 3:6, 3:6] = sign * Rt - 0.5 * by_velocity_world[:, :3]
        jacobian[:, 3:6, 6:9] = (hat_gained - by_attitude[:, :3]) @ half
        jacobian[:, 3:6, 9:12] = -0.5 * by_rate[:, :3]
        jacobian[:, 6:9, 6:9] = sign * (eye + square) + 0.5 * half_turn
        jacobian[:, 6:9, 9:12] = -0.5 * h * eye
        jacobian[:, 9:12, 3:6] = -0.5 * by_velocity_world[:, 3:]
        jacobian[:, 9:12, 6:9] = -by_attitude[:, 3:] @ half
        jacobian[:, 9:12, 9:12] = sign * eye - 0.5 * by_rate[:, 3:]
        jacobian[:, 3:6, 2] -= by_height[:, :3]
        jacobian[:, 9:12, 2] -= by_height[:, 3:]
        if states.gust is not None:
            jacobian[:, 3:6, 12:15] = -0.5 * h * Rt
            jacobian[:, 9:12, 15:18] = -0.5 * h * eye
    border = np.zeros((k, 12, acceleration.parameters.shape[2]))
    border[:, 3:6] = -h * acceleration.parameters[:, :3]
    border[:, 9:12] = -h * acceleration.parameters[:, 3:]
    return before, after, border


def accelerometer(flight: Flight, states: States, mid: Middle, bias_m_s2: FloatArray) -> FloatArray:
    """(k, 3) mean specific force measured over each interval, less what the states say."""
    return flight.specific_force_body_m_s2 - bias_m_s2 - rates_of_change(states, mid)[:, :3]


def accelerometer_jacobians(states: States, mid: Middle) -> tuple[FloatArray, FloatArray]:
    """Derivatives of `accelerometer` by the state before and the state after, (k, 3, 12)."""
    k, h = len(mid.step_s), mid.step_s[:, :, None]
    Rt = np.swapaxes(mid.R_world_body, 1, 2)
    hat_force = rotations.hat(rates_of_change(states, mid)[:, :3])
    quarter_turn = 0.125 * rotations.hat(mid.turn_rad)
    before, after = np.zeros((k, 3, 12)), np.zeros((k, 3, 12))
    before[:, :, 3:6], after[:, :, 3:6] = Rt / h, -Rt / h
    before[:, :, 6:9] = -hat_force @ (0.5 * np.eye(3) - quarter_turn)
    after[:, :, 6:9] = -hat_force @ (0.5 * np.eye(3) + quarter_turn)
    return before, after


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
        white = np.array(row.reshape(len(row), 12, -1 if row.size else 0), dtype=np.float64, order="C")
        _sysid.whiten(scale, white)
        result.append(white.reshape(row.shape))
    return result
