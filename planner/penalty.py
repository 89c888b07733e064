"""Smooth penalties for what the vehicle cannot do, and their exact gradients, point by point along the path.

The vehicle counts here as a point mass whose thrust points along the body z axis; that is close enough to steer an
optimiser. What is finally flown is checked against the full model (`planner.limits`).
"""

from dataclasses import dataclass

import numpy as np

from flight import FloatArray

GRAVITY_M_S2 = 9.80665
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
    turn_rad_s2: float
    """Largest angular acceleration of the thrust direction that the rotors give at any thrust in between."""

    def scaled(self, factor: float) -> "Bounds":
        """Tighter (factor < 1) speeds, accelerations and rates; thrust and tilt shrink towards hover."""
        return Bounds(
            speed_m_s=self.speed_m_s * factor,
            acceleration_m_s2=self.acceleration_m_s2 * factor,
            tilt_rad=self.tilt_rad * factor,
            rate_rad_s=self.rate_rad_s * factor,
            thrust_min_m_s2=GRAVITY_M_S2 + (self.thrust_min_m_s2 - GRAVITY_M_S2) * factor,
            thrust_max_m_s2=GRAVITY_M_S2 + (self.thrust_max_m_s2 - GRAVITY_M_S2) * factor,
            turn_rad_s2=self.turn_rad_s2 * factor,
        )


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
    _thrust(total, thrust, square, bounds)
    _tilt(total, thrust, square, bounds)
    _turning(total.value, total.by_acceleration, total.by_jerk, thrust, square, jerk, bounds.rate_rad_s)
    _turning(total.value, total.by_acceleration, total.by_snap, thrust, square, snap, bounds.turn_rad_s2)
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


def _thrust(total: Penalty, thrust: FloatArray, square: FloatArray, bounds: Bounds) -> None:
    most = bounds.thrust_max_m_s2**2
    least = bounds.thrust_min_m_s2**2
    _add(total.value, square / most - 1.0, (total.by_acceleration, 2.0 * thrust / most))
    _add(total.value, (least - square) / GRAVITY_M_S2**2, (total.by_acceleration, -2.0 * thrust / GRAVITY_M_S2**2))


def _tilt(total: Penalty, thrust: FloatArray, square: FloatArray, bounds: Bounds) -> None:
    size = np.sqrt(square)
    cosine = np.cos(bounds.tilt_rad)
    excess = (cosine * size - thrust[..., 2]) / GRAVITY_M_S2
    gradient = cosine * thrust / size[..., None]
    gradient[..., 2] -= 1.0
    _add(total.value, excess, (total.by_acceleration, gradient / GRAVITY_M_S2))


def _turning(
    value: FloatArray,
    by_acceleration: FloatArray,
    by_motion: FloatArray,
    thrust: FloatArray,
    square: FloatArray,
    motion: FloatArray,
    limit: float,
) -> None:
    """The part of jerk (or snap) across the thrust, over the thrust: how fast the direction turns (or is spun up)."""
    along = _dot(motion, thrust)
    across = np.maximum(_dot(motion, motion) * square - along * along, 0.0)
    scale = 1.0 / (limit**2 * square * square)
    excess = across * scale - 1.0
    by_thrust = 2.0 * (_dot(motion, motion)[..., None] * thrust - along[..., None] * motion)
    by_thrust = by_thrust * scale[..., None] - (4.0 * across * scale / square)[..., None] * thrust
    by_this = 2.0 * (square[..., None] * motion - along[..., None] * thrust) * scale[..., None]
    _add(value, excess, (by_acceleration, by_thrust), (by_motion, by_this))
