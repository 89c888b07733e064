"""Differential flatness: attitude, rates, torque and rotor speeds that a trajectory requires, drag included.

Yaw is the Hopf chart's: body axes are turned by yaw about world z, then tilted the shortest way to the thrust axis.
It is smooth everywhere except upside down, and is what the controller uses.
"""

from dataclasses import dataclass

import numpy as np

from flight import FloatArray, Trajectory, polynomial, portable, rotations
from vehicle import dynamics, invert, native
from vehicle.forces import Surroundings
from vehicle.model import Vehicle, rigid_body

_OFFSET_S = 2e-3
"""Spacing of the five instants from which rates are taken: truncation and rounding are both near 1e-8 rad/s there."""
_UNSETTLED = 1e-6
"""A last change of attitude and rotor speeds above which they are unknown."""
_FIRST = np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / 12.0
_SECOND = np.array([-1.0, 16.0, -30.0, 16.0, -1.0]) / 12.0


@dataclass(frozen=True, slots=True, eq=False)
class FlatState:
    """State and rotor speeds at n instants of a trajectory. Rows are NaN where the motion is impossible."""

    time_s: FloatArray
    position_world_m: FloatArray
    velocity_world_m_s: FloatArray
    acceleration_world_m_s2: FloatArray
    q_world_body: FloatArray
    """(n, 4); NaN where the thrust would vanish (free fall)."""
    rate_body_rad_s: FloatArray
    rate_derivative_body_rad_s2: FloatArray
    thrust_n: FloatArray
    """(n,) force along body z, drag along it included."""
    torque_n_m: FloatArray
    """(n, 3) body axes."""
    rotor_speed_rad_s: FloatArray
    """(n, r); NaN where a rotor would have to pull downward."""
    tilt_rad: FloatArray
    """(n,) angle between body z and world z."""


@dataclass(slots=True)
class _Path:
    """The trajectory at (m,) instants."""

    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    yaw: FloatArray


def state(vehicle: Vehicle, trajectory: Trajectory, times_s: FloatArray, *, ground_m: float = -np.inf) -> FlatState:
    """Attitude, rates, torque and rotor speeds along a trajectory in still air.

    Args:
        times_s: (n,) seconds from the trajectory's start.
        ground_m: height of the ground, for vehicles with ground effect.
    """
    times = np.atleast_1d(np.asarray(times_s, dtype=np.float64))
    path = _sample(trajectory, times)
    kernel = native.compiled(vehicle)
    if kernel is None:
        return _state_numpy(vehicle, times, path, ground_m)
    n = len(times)
    height = (path.position[:, 2:] - ground_m).reshape(5, n, 1)
    blocks = (path.velocity.reshape(5, n, 3), path.acceleration.reshape(5, n, 3), height, path.yaw.reshape(5, n, 1))
    rows = np.ascontiguousarray(np.concatenate(blocks, axis=2).swapaxes(0, 1)).reshape(5 * n, 8)
    out = np.empty((n, 14 + vehicle.rotors))
    kernel.model.flatness(kernel.values, vehicle.gravity_m_s2, invert.hover(vehicle)[None], _OFFSET_S, rows, out)
    return _flat_state(
        times, _middle(path), out[:, :4], out[:, 4:7], out[:, 7:10], out[:, 10], out[:, 11:14], out[:, 14:]
    )


def at_nodes(
    vehicle: Vehicle,
    velocity_world_m_s: FloatArray,
    acceleration_world_m_s2: FloatArray,
    yaw_rad: FloatArray,
    derivatives: tuple[FloatArray, FloatArray],
    scale: FloatArray,
) -> FloatArray:
    """Cosine of the tilt, body rates and rotor speeds at nodes of smooth pieces of a path, far from the ground.

    The attitudes at the nodes give the rates, and those the torque, by the derivatives of the polynomial through them.

    Args:
        velocity_world_m_s, acceleration_world_m_s2: (p, m, 3) at m nodes of p pieces.
        yaw_rad: (p, m).
        derivatives: first and second one at the nodes from the values there, (m, m) each, by the pieces' own argument.
        scale: (p,) how much that argument grows in a second.

    Returns:
        (p, m, 4 + r); rows whose rotor speeds are NaN are impossible.
    """
    p, m = yaw_rad.shape
    velocity, acceleration = velocity_world_m_s.reshape(-1, 3), acceleration_world_m_s2.reshape(-1, 3)
    kernel, yaw = native.compiled(vehicle), yaw_rad.ravel()
    if kernel is None:
        far = np.column_stack([np.zeros((p * m, 2)), np.full(p * m, np.inf)])
        return _at_nodes_numpy(vehicle, _Path(far, velocity, acceleration, yaw), derivatives, scale)
    rows, out = (
        np.column_stack([velocity, acceleration, np.full(p * m, np.inf), yaw]),
        np.empty((p * m, 4 + vehicle.rotors)),
    )
    hover = invert.hover(vehicle)[None]
    kernel.model.at_nodes(kernel.values, vehicle.gravity_m_s2, hover, *derivatives, scale[:, None], rows, out)
    return out.reshape(p, m, 4 + vehicle.rotors)


def air_velocity_body(flat: FlatState) -> FloatArray:
    """(n, 3) velocity in body axes, relative to still air."""
    return rotations.rotate(rotations.conjugate(flat.q_world_body), flat.velocity_world_m_s)


def _middle(path: _Path) -> _Path:
    n = len(path.yaw) // 5
    return _Path(*(getattr(path, name)[2 * n : 3 * n] for name in _Path.__slots__))


def _state_numpy(vehicle: Vehicle, times: FloatArray, path: _Path, ground_m: float) -> FlatState:
    """NumPy reference of the kernel, and the form for vehicles with effects of the user's own."""
    n = len(times)
    speed = np.broadcast_to(invert.hover(vehicle), (5 * n, vehicle.rotors))
    rate, centre_rate, turn = np.zeros((5 * n, 3)), np.zeros((n, 3)), np.zeros((n, 3))
    offsets = np.repeat(np.arange(-2, 3) * _OFFSET_S, n)[:, None]
    q = np.zeros((5 * n, 4))
    for _ in range(2):  # forces depend a little on the rates, which come from the attitudes: two iterations suffice
        q, speed, _ = _attitudes(vehicle, path, rate, speed, ground_m)
        centre_rate, turn = _rates(q.reshape(5, n, 4))
        rate = np.tile(centre_rate, (5, 1)) + offsets * np.tile(turn, (5, 1))
    middle = slice(2 * n, 3 * n)
    return _finish(vehicle, times, _middle(path), q[middle], centre_rate, turn, speed[middle], ground_m)


def _at_nodes_numpy(
    vehicle: Vehicle, path: _Path, derivatives: tuple[FloatArray, FloatArray], scale: FloatArray
) -> FloatArray:
    """NumPy reference of the kernel, and the form for vehicles with effects of the user's own."""
    (p, m), n = (len(scale), len(derivatives[0])), len(path.yaw)
    q, speed = np.zeros((n, 4)), np.broadcast_to(invert.hover(vehicle), (n, vehicle.rotors))
    rate, turn, change = np.zeros((n, 3)), np.zeros((n, 3)), np.zeros(n)
    for _ in range(2):  # forces depend a little on the rates, which come from the attitudes: two iterations suffice
        q, speed, change = _attitudes(vehicle, path, rate, speed, -np.inf)
        slopes = (
            portable.product(operator, q.reshape(p, m, 4)).reshape(n, 4) * np.repeat(scale**order, m)[:, None]
            for order, operator in enumerate(derivatives, start=1)
        )
        rate, turn = (2.0 * rotations.multiply(rotations.conjugate(q), slope)[:, 1:] for slope in slopes)
    back = rotations.conjugate(q)
    thrust = rotations.rotate(back, _required(vehicle, path))[:, 2]
    velocity, around = rotations.rotate(back, path.velocity), _around(vehicle, path, q, -np.inf)
    torque = _torque(vehicle, rate, turn)
    rotor = invert.rotor_speeds(vehicle, thrust, torque, velocity, rate, surroundings=around, guess_rad_s=speed)
    rotor[~(change < _UNSETTLED)] = np.nan
    up = 1.0 - 2.0 * (q[:, 1] ** 2 + q[:, 2] ** 2)
    return np.column_stack([up, rate, rotor]).reshape(p, m, 4 + vehicle.rotors)


def _torque(vehicle: Vehicle, rate: FloatArray, turn: FloatArray) -> FloatArray:
    """(n, 3) Euler's equation."""
    inertia = rigid_body(vehicle).inertia_kg_m2
    momentum, torque = (portable.product(rates, inertia.T) for rates in (rate, turn))
    return torque + rotations.cross(rate, momentum)


def _required(vehicle: Vehicle, path: _Path) -> FloatArray:
    """(n, 3) force in world axes that gives the path's acceleration."""
    return float(rigid_body(vehicle).mass_kg) * (path.acceleration + np.array([0.0, 0.0, vehicle.gravity_m_s2]))


def _sample(trajectory: Trajectory, times: FloatArray) -> _Path:
    """The path at five instants round each time, each time's own segment continued beyond its ends."""
    segment, local = trajectory.segment_at(times)
    at = local + np.arange(-2, 3)[:, None] * _OFFSET_S
    values = [
        polynomial.evaluate(polynomial.differentiate(trajectory.coefficients, order)[segment], at[..., None])
        for order in range(3)
    ]
    flat = [value.reshape(-1, 4) for value in values]
    return _Path(flat[0][:, :3], flat[1][:, :3], flat[2][:, :3], flat[0][:, 3])


def _attitudes(
    vehicle: Vehicle, path: _Path, rate: FloatArray, speed: FloatArray, ground_m: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Attitude and even rotor speeds at which the vehicle's own forces give the path's acceleration; last change.

    Drag decides the thrust axis and the thrust axis decides drag: a contraction, as drag is a fraction of thrust.
    """
    required = _required(vehicle, path)
    size, change = np.linalg.norm(required, axis=1), np.zeros(len(required))
    q = hopf(required / np.where(size > 1e-9, size, np.nan)[:, None], path.yaw)
    for _ in range(200):
        turned, along, force_z = _turned(vehicle, required, path, q, rate, speed, ground_m)
        ratio = np.sqrt(np.clip(along / np.maximum(force_z, 1e-12), 0.25, 4.0))
        change = np.abs(turned - q).max(axis=1) + np.abs(ratio - 1.0)
        q, speed = turned, speed * ratio[:, None]
        if not (change > 1e-13).any():
            break
    return q, speed, change


def _turned(
    vehicle: Vehicle,
    required: FloatArray,
    path: _Path,
    q: FloatArray,
    rate: FloatArray,
    speed: FloatArray,
    ground_m: float,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Attitude that aligns thrust with the required force less drag at the old attitude; thrust; old thrust."""
    velocity = rotations.rotate(rotations.conjugate(q), path.velocity)
    force, _ = dynamics.wrench(vehicle, velocity, rate, speed, _around(vehicle, path, q, ground_m))
    # With drag -c v the axis is required + c v whatever the attitude (Faessler et al. 2018); only what is not of that
    # form has to be iterated.
    lateral = velocity * np.array([1.0, 1.0, 0.0])
    square = (lateral**2).sum(axis=1)
    c = np.where(square > 1e-6, -(force * lateral).sum(axis=1) / np.maximum(square, 1e-6), 0.0)[:, None]
    rest = force * np.array([1.0, 1.0, 0.0]) + c * lateral
    axis = required - rotations.rotate(q, rest) + c * path.velocity
    axis = axis / np.linalg.norm(axis, axis=1, keepdims=True)
    return hopf(axis, path.yaw), (required * axis).sum(axis=1), force[:, 2]


def hopf(axis: FloatArray, yaw_rad: FloatArray) -> FloatArray:
    """Attitude whose body z is `axis` (n, 3, unit), turned by yaw before tilting the shortest way. (n, 4)."""
    x, y, z = axis.T
    scale = 1.0 / np.sqrt(2.0 * np.maximum(1.0 + z, 1e-15))
    tilt = np.stack([(1.0 + z) * scale, -y * scale, x * scale, np.zeros_like(x)], axis=1)
    return rotations.multiply(tilt, rotations.from_yaw(yaw_rad))


def _rates(q: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Body rate and its derivative at the middle of five attitudes (5, n, 4)."""
    slope = np.einsum("i,inj->nj", _FIRST, q) / _OFFSET_S
    bend = np.einsum("i,inj->nj", _SECOND, q) / (_OFFSET_S * _OFFSET_S)
    back = rotations.conjugate(q[2])
    return 2.0 * rotations.multiply(back, slope)[:, 1:], 2.0 * rotations.multiply(back, bend)[:, 1:]


def _around(vehicle: Vehicle, path: _Path, q: FloatArray, ground_m: float) -> Surroundings:
    n = len(q)
    return Surroundings(q, path.position[:, 2] - ground_m, np.full(n, np.inf), np.zeros((n, vehicle.rotors)))


def _finish(
    vehicle: Vehicle,
    times: FloatArray,
    path: _Path,
    q: FloatArray,
    rate: FloatArray,
    turn: FloatArray,
    speed: FloatArray,
    ground_m: float,
) -> FlatState:
    """Individual rotor speeds; where drag depends on each of them, the attitude is aligned with thrust once more."""
    torque, required = _torque(vehicle, rate, turn), _required(vehicle, path)
    for _ in range(20):
        back = rotations.conjugate(q)
        thrust, velocity = rotations.rotate(back, required)[:, 2], rotations.rotate(back, path.velocity)
        around = _around(vehicle, path, q, ground_m)
        speed = invert.rotor_speeds(vehicle, thrust, torque, velocity, rate, surroundings=around, guess_rad_s=speed)
        turned, _, _ = _turned(vehicle, required, path, q, rate, speed, ground_m)
        if not (np.abs(turned - q) > 1e-12).any():
            break
        q = turned
    return _flat_state(times, path, q, rate, turn, thrust, torque, speed)


def _flat_state(
    times: FloatArray,
    path: _Path,
    q: FloatArray,
    rate: FloatArray,
    turn: FloatArray,
    thrust: FloatArray,
    torque: FloatArray,
    speed: FloatArray,
) -> FlatState:
    _, x, y, _ = q.T
    return FlatState(
        time_s=times,
        position_world_m=path.position,
        velocity_world_m_s=path.velocity,
        acceleration_world_m_s2=path.acceleration,
        q_world_body=q,
        rate_body_rad_s=rate,
        rate_derivative_body_rad_s2=turn,
        thrust_n=thrust,
        torque_n_m=torque,
        rotor_speed_rad_s=speed,
        tilt_rad=portable.arccosine(np.clip(1.0 - 2.0 * (x * x + y * y), -1.0, 1.0)),
    )
