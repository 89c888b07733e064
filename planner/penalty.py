"""Smooth penalties for what the vehicle cannot do, and their exact gradients, point by point along the path.

The vehicle counts here as a point mass whose thrust points along the body z axis; that is close enough to steer an
optimiser. What is finally flown is checked against the full model (`planner.limits`).
"""

from dataclasses import dataclass

import numpy as np

from flight import FloatArray
from flight.frames import GRAVITY_M_S2

_UP = np.array([0.0, 0.0, GRAVITY_M_S2])


@dataclass(frozen=True, slots=True)
class Bounds:
    """Limits of a point mass with a thrust direction."""

    speed_m_s: float
    acceleration_m_s2: float
    tilt_rad: float
    rate_rad_s: float
    """Largest turning rate of the thrust direction."""
    thrust_min_m_s2: float
    """Smallest thrust per mass."""
    thrust_max_m_s2: float
    """Largest thrust per mass."""
    turn_rad_s2_per_m_s2: float
    """Angular acceleration of the thrust direction bought with each m/s2 of thrust that the weakest rotor has above
    its least, or the strongest below its most."""


@dataclass(frozen=True, slots=True, eq=False)
class Penalty:
    """Penalty (...) at each point and its gradients (..., 3) by velocity, acceleration, jerk and snap."""

    value: FloatArray
    by_velocity: FloatArray
    by_acceleration: FloatArray
    by_jerk: FloatArray
    by_snap: FloatArray


def dynamics(
    velocity: FloatArray, acceleration: FloatArray, jerk: FloatArray, snap: FloatArray, bounds: Bounds
) -> Penalty:
    """Sum of the squared relative excesses over every limit; arrays (..., 3)."""
    total = Penalty(
        np.zeros(velocity.shape[:-1]),
        np.zeros_like(velocity),
        np.zeros_like(velocity),
        np.zeros_like(velocity),
        np.zeros_like(velocity),
    )
    _speed(total, velocity, bounds)
    _acceleration(total, acceleration, bounds)
    thrust = acceleration + _UP
    # Near free fall the direction of the thrust is undefined; the lower thrust limit keeps the path from there.
    square = np.maximum(_dot(thrust, thrust), 0.04 * GRAVITY_M_S2**2)
    _tilt(total, thrust, square, bounds)
    _rate(total, thrust, square, jerk, bounds)
    _rotors(total, thrust, square, snap, bounds)
    return total


def _dot(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.einsum("...i,...i->...", a, b)


def _add(value: FloatArray, excess: FloatArray, *gradients: tuple[FloatArray, FloatArray]) -> None:
    """Add the squared excess, and twice the excess times its gradient to each target."""
    over = np.maximum(excess, 0.0)
    value += over * over
    for target, gradient in gradients:
        target += (2.0 * over)[..., None] * gradient


def _speed(total: Penalty, velocity: FloatArray, bounds: Bounds) -> None:
    square = bounds.speed_m_s**2
    _add(total.value, _dot(velocity, velocity) / square - 1.0, (total.by_velocity, 2.0 * velocity / square))


def _acceleration(total: Penalty, acceleration: FloatArray, bounds: Bounds) -> None:
    square = bounds.acceleration_m_s2**2
    excess = _dot(acceleration, acceleration) / square - 1.0
    _add(total.value, excess, (total.by_acceleration, 2.0 * acceleration / square))


def _tilt(total: Penalty, thrust: FloatArray, square: FloatArray, bounds: Bounds) -> None:
    size = np.sqrt(square)
    cosine = np.cos(bounds.tilt_rad)
    excess = (cosine * size - thrust[..., 2]) / GRAVITY_M_S2
    gradient = cosine * thrust / size[..., None]
    gradient[..., 2] -= 1.0
    _add(total.value, excess, (total.by_acceleration, gradient / GRAVITY_M_S2))


def _across(motion: FloatArray, thrust: FloatArray, square: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """|motion x thrust|^2 and its gradients by motion and thrust: the part of jerk or snap that turns the thrust."""
    along, size = _dot(motion, thrust), _dot(motion, motion)
    value = np.maximum(size * square - along * along, 0.0)
    by_motion = 2.0 * (square[..., None] * motion - along[..., None] * thrust)
    by_thrust = 2.0 * (size[..., None] * thrust - along[..., None] * motion)
    return value, by_motion, by_thrust


def _rate(total: Penalty, thrust: FloatArray, square: FloatArray, jerk: FloatArray, bounds: Bounds) -> None:
    """The thrust direction turns with |jerk x thrust| / thrust^2."""
    across, by_jerk, by_thrust = _across(jerk, thrust, square)
    scale = 1.0 / (bounds.rate_rad_s * square) ** 2
    by_thrust = by_thrust * scale[..., None] - (4.0 * across * scale / square)[..., None] * thrust
    _add(
        total.value,
        across * scale - 1.0,
        (total.by_acceleration, by_thrust),
        (total.by_jerk, by_jerk * scale[..., None]),
    )


def _rotors(total: Penalty, thrust: FloatArray, square: FloatArray, snap: FloatArray, bounds: Bounds) -> None:
    """The weakest and the strongest rotor: mean thrust, less or more what spinning the body up takes.

    The angular acceleration is taken as |snap x thrust| / thrust^2, without what is quadratic in the rates.
    """
    size = np.sqrt(square)
    across, by_snap, by_thrust = _across(snap, thrust, square)
    root = np.sqrt(across + 1e-6)
    gain = 1.0 / (bounds.turn_rad_s2_per_m_s2 * square * GRAVITY_M_S2)
    spread = root * gain
    by_snap = by_snap * (0.5 * gain / root)[..., None]
    spread_by_thrust = by_thrust * (0.5 * gain / root)[..., None] - (2.0 * spread / square)[..., None] * thrust
    direction = thrust / (size * GRAVITY_M_S2)[..., None]
    weakest = spread + (bounds.thrust_min_m_s2 - size) / GRAVITY_M_S2
    strongest = spread + (size - bounds.thrust_max_m_s2) / GRAVITY_M_S2
    _add(total.value, weakest, (total.by_acceleration, spread_by_thrust - direction), (total.by_snap, by_snap))
    _add(total.value, strongest, (total.by_acceleration, spread_by_thrust + direction), (total.by_snap, by_snap))
