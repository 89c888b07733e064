"""The exact inverse: the rotor speeds that give a required thrust and torque, with every active effect included."""

from weakref import WeakKeyDictionary

import numpy as np

from flight import FloatArray, InfeasibleError, portable
from vehicle import allocation, dynamics, native
from vehicle.forces import Surroundings, open_air
from vehicle.model import Vehicle, rigid_body

_STEPS = 25
_TOLERANCE_RAD_S = 1e-9


def rotor_speeds(
    vehicle: Vehicle,
    thrust_n: FloatArray,
    torque_n_m: FloatArray,
    velocity_air_body_m_s: FloatArray,
    rate_body_rad_s: FloatArray,
    *,
    surroundings: Surroundings | None = None,
    guess_rad_s: FloatArray | None = None,
) -> FloatArray:
    """Rotor speeds whose force along body z and torque are the required ones (Newton on all at once).

    More than four rotors share them as `vehicle.allocation` says.

    Args:
        thrust_n: (n,) required force along body z, drag along it included.
        torque_n_m: (n, 3) required torque.
        guess_rad_s: (n, r) start; the speeds of an even thrust if not given.

    Returns:
        (n, r) rotor speeds; a row is NaN where none exist (a rotor would have to pull downward).
    """
    required = np.column_stack([np.atleast_1d(thrust_n), np.atleast_2d(torque_n_m)])
    count = len(required)
    velocity = np.broadcast_to(np.atleast_2d(velocity_air_body_m_s), (count, 3))
    rate = np.broadcast_to(np.atleast_2d(rate_body_rad_s), (count, 3))
    around, shape = surroundings or open_air(count, vehicle.rotors), (count, vehicle.rotors)
    speed = np.full(shape, 0.5 * vehicle.limits.rotor_speed_max_rad_s) if guess_rad_s is None else guess_rad_s
    speed = np.array(np.broadcast_to(speed, shape))
    kernel = native.compiled(vehicle)
    if kernel is None:
        return rotor_speeds_numpy(vehicle, required, velocity, rate, speed, around)
    out = np.empty(shape)
    rows = native.surroundings_rows(around, vehicle.rotors)
    kernel.model.invert(kernel.values, required, np.hstack([velocity, rate, speed]), rows, out)
    return out


def rotor_speeds_numpy(
    vehicle: Vehicle,
    required: FloatArray,
    velocity: FloatArray,
    rate: FloatArray,
    speed: FloatArray,
    around: Surroundings,
) -> FloatArray:
    """NumPy reference of the kernel: the same Newton steps, on the rows not yet converged. `required` is (n, 4)."""
    count = len(required)
    change = np.full(count, np.inf)
    for _ in range(_STEPS):
        todo = np.flatnonzero(change > _TOLERANCE_RAD_S)
        if not todo.size:
            break
        speed[todo], step = _newton_step(
            vehicle, required[todo], velocity[todo], rate[todo], speed[todo], _rows(around, todo, count)
        )
        change[todo] = np.abs(step).max(axis=1)
    speed[~(change <= _TOLERANCE_RAD_S)] = np.nan
    return speed


def _newton_step(
    vehicle: Vehicle,
    required: FloatArray,
    velocity: FloatArray,
    rate: FloatArray,
    speed: FloatArray,
    around: Surroundings,
) -> tuple[FloatArray, FloatArray]:
    """New rotor speeds, and the change that the whole step asked for."""
    jacobian = dynamics.wrench_jacobian(vehicle, velocity, rate, speed, surroundings=around)
    missing = required - jacobian.value[:, 2:]
    slope = jacobian.rotor_speed[:, 2:]
    singular = ~np.isfinite(slope).all(axis=(1, 2)) | (np.abs(speed).min(axis=1) < 1e-9)
    slope[singular] = np.eye(4, vehicle.rotors)
    if vehicle.rotors > 4:
        moved, step = allocation.step(vehicle, slope, missing, np.maximum(speed, 1e-9))
    else:
        step = portable.solve(slope, missing[..., None])[..., 0]
        # a far start may overshoot below zero, towards the root -n of n^2: stop at a tenth of the speed
        moved = np.maximum(speed + step, 0.1 * speed)
    return np.where(singular[:, None], np.nan, moved), np.where(singular[:, None], np.nan, step)


def _rows(around: Surroundings, index: np.ndarray, n: int) -> Surroundings:
    def pick(array: FloatArray | None) -> FloatArray | None:
        return array[index] if array is not None and len(array) == n else array

    return Surroundings(
        pick(around.q_world_body),
        pick(around.height_m),
        pick(around.ceiling_gap_m),
        pick(around.rotor_acceleration_rad_s2),
    )


_hovers: WeakKeyDictionary[Vehicle, FloatArray] = WeakKeyDictionary()


def hover(vehicle: Vehicle) -> FloatArray:
    """(r,) rotor speeds of a level hover in still air, far from ground and ceiling.

    Raises:
        InfeasibleError: the rotors cannot carry the weight within their fastest speed.
    """
    if vehicle not in _hovers:
        _hovers[vehicle] = _hover(vehicle)
    return _hovers[vehicle].copy()


def _hover(vehicle: Vehicle) -> FloatArray:
    weight = np.array([float(rigid_body(vehicle).mass_kg) * vehicle.gravity_m_s2])
    speed = rotor_speeds(vehicle, weight, np.zeros((1, 3)), np.zeros(3), np.zeros(3))[0]
    fastest = vehicle.limits.rotor_speed_max_rad_s
    if not (speed <= fastest).all():
        raise InfeasibleError(
            f"{vehicle.name} cannot hover: it needs rotor speeds {np.round(speed)} rad/s, the limit is {fastest:g}"
        )
    return speed
