"""Wrench and accelerations of a vehicle, and their derivatives; compiled if every active effect is."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from flight import FloatArray, InputError
from vehicle import effects as registry
from vehicle import forces, native
from vehicle.effects.base import Array, Drive, RigidBody, Stage
from vehicle.forces import NOTHING_KNOWN, Surroundings
from vehicle.model import ValueMap, Vehicle, active, rigid_body, values_of

_STEP = 1e-30
"""Complex step: the derivative is exact to rounding, whatever the size of the argument."""


@dataclass(frozen=True, slots=True)
class Jacobian:
    """Six numbers per instant (force then torque, or the two accelerations) and their derivatives."""

    value: FloatArray
    """(n, 6)."""
    velocity: FloatArray
    """(n, 6, 3) by the air speed in body axes."""
    rate: FloatArray
    """(n, 6, 3) by the body rate."""
    rotor_speed: FloatArray
    """(n, 6, r)."""
    parameters: FloatArray
    """(n, 6, p) by the requested parameters, in that order."""
    attitude: FloatArray
    """(n, 6, 3) by a small rotation vector in body axes, at fixed air speed in body axes."""
    height: FloatArray
    """(n, 6) by the height, at fixed ceiling gap."""
    rotor_acceleration: FloatArray
    """(n, 6, r)."""

    def __iter__(self) -> Iterator[FloatArray]:
        """Unpacks as by velocity, by rate, by rotor speed, by parameters."""
        return iter((self.velocity, self.rate, self.rotor_speed, self.parameters))


def wrench(
    vehicle: Vehicle,
    velocity_air_body_m_s: FloatArray,
    rate_body_rad_s: FloatArray,
    rotor_speed_rad_s: FloatArray,
    surroundings: Surroundings = NOTHING_KNOWN,
) -> tuple[FloatArray, FloatArray]:
    """Force and torque of air and rotors on the body; gravity is not among them.

    Args:
        velocity_air_body_m_s: (n, 3) velocity of the centre of mass relative to the air.
        rate_body_rad_s: (n, 3).
        rotor_speed_rad_s: (n, r), a column for each rotor.
        surroundings: only for effects that read them.

    Returns:
        Force (n, 3) and torque about the centre of mass (n, 3), body axes.

    Raises:
        InputError: an active effect reads a surrounding that was not given, or the shapes do not fit.
    """
    six = _six(vehicle, velocity_air_body_m_s, rate_body_rad_s, rotor_speed_rad_s, surroundings, False)
    return six[:, :3], six[:, 3:]


def acceleration(
    vehicle: Vehicle,
    velocity_air_body_m_s: FloatArray,
    rate_body_rad_s: FloatArray,
    rotor_speed_rad_s: FloatArray,
    surroundings: Surroundings = NOTHING_KNOWN,
) -> tuple[FloatArray, FloatArray]:
    """Specific force (n, 3) and angular acceleration (n, 3), body axes: the wrench over the mass, and Euler's equation.

    Arguments and errors as `wrench`.
    """
    six = _six(vehicle, velocity_air_body_m_s, rate_body_rad_s, rotor_speed_rad_s, surroundings, True)
    return six[:, :3], six[:, 3:]


def wrench_jacobian(
    vehicle: Vehicle,
    velocity_air_body_m_s: FloatArray,
    rate_body_rad_s: FloatArray,
    rotor_speed_rad_s: FloatArray,
    *,
    parameters: Sequence[str] = (),
    surroundings: Surroundings = NOTHING_KNOWN,
) -> Jacobian:
    """Derivatives of the six numbers of `wrench`; `parameters` are full names such as `parasitic_drag.drag_xy_kg_m`.

    Raises as `wrench`, and for an unknown parameter.
    """
    motion = _motion(vehicle, velocity_air_body_m_s, rate_body_rad_s, rotor_speed_rad_s)
    return _jacobian(vehicle, motion, parameters, surroundings, False)


def acceleration_jacobian(
    vehicle: Vehicle,
    velocity_air_body_m_s: FloatArray,
    rate_body_rad_s: FloatArray,
    rotor_speed_rad_s: FloatArray,
    *,
    parameters: Sequence[str] = (),
    surroundings: Surroundings = NOTHING_KNOWN,
) -> Jacobian:
    """Derivatives of the six numbers of `acceleration`, mass and inertia among the parameters. As `wrench_jacobian`."""
    motion = _motion(vehicle, velocity_air_body_m_s, rate_body_rad_s, rotor_speed_rad_s)
    return _jacobian(vehicle, motion, parameters, surroundings, True)


def _motion(vehicle: Vehicle, velocity: FloatArray, rate: FloatArray, rotor_speed: FloatArray) -> FloatArray:
    columns = [np.atleast_2d(np.asarray(a, dtype=np.float64)) for a in (velocity, rate, rotor_speed)]
    for column, width, name in zip(columns, (3, 3, vehicle.rotors), ("velocity", "rate", "rotor_speed"), strict=True):
        if column.ndim != 2 or column.shape[1] != width:
            raise InputError(f"{name}: expected shape (n, {width}), got {column.shape}")
    n = max(len(column) for column in columns)
    if any(len(column) not in (1, n) for column in columns):
        raise InputError(f"velocity, rate and rotor speed have {', '.join(str(len(c)) for c in columns)} rows")
    motion = np.empty((n, 6 + vehicle.rotors))
    motion[:, 0:3], motion[:, 3:6], motion[:, 6:] = columns
    return motion


def _check_needs(vehicle: Vehicle, surroundings: Surroundings, n: int) -> FloatArray:
    for name in vehicle.effects:
        for need in registry.find(name).needs:
            if getattr(surroundings, need) is None:
                raise InputError(f"effect {name} reads {need}; give it in the surroundings")
    rows = native.surroundings_rows(surroundings, vehicle.rotors)
    if len(rows) not in (1, n):
        raise InputError(f"the surroundings have {len(rows)} rows, the motion {n}")
    return rows


def _six(
    vehicle: Vehicle, velocity: Any, rate: Any, rotor_speed: Any, around: Surroundings, as_acc: bool
) -> FloatArray:
    motion = _motion(vehicle, velocity, rate, rotor_speed)
    kernel = native.compiled(vehicle)
    if kernel is None:
        return _six_numpy(vehicle, motion, around, as_acc)
    rows = _check_needs(vehicle, around, len(motion))
    out = np.empty((len(motion), 6))
    kernel.model.evaluate(kernel.values, motion, rows, as_acc, out)
    return out


def _six_numpy(
    vehicle: Vehicle,
    motion: Array,
    around: Surroundings,
    as_acceleration: bool,
    values: ValueMap | None = None,
) -> Array:
    force, torque = forces.wrench_numpy(vehicle, motion[:, :3], motion[:, 3:6], motion[:, 6:], around, values)
    if as_acceleration:
        force, torque = _accelerations(rigid_body(vehicle, values), motion[:, 3:6], force, torque)
    return np.concatenate([force, torque], axis=1)


def _jacobian(
    vehicle: Vehicle, motion: FloatArray, parameters: Sequence[str], around: Surroundings, as_acceleration: bool
) -> Jacobian:
    for name in parameters:
        vehicle.parameter(name)
    kernel = native.compiled(vehicle)
    n, p, r = len(motion), len(parameters), vehicle.rotors
    rows = _check_needs(vehicle, around, n)
    if kernel is None:
        out, slopes = _complex_steps(vehicle, motion, parameters, around, as_acceleration)
    else:
        column = {name: 12 + 2 * r + i for i, name in enumerate(kernel.names)}
        # parameters of sensors and motors have no influence here, and no column
        slots, directions = _nonzero_directions(vehicle, [column.get(name) for name in parameters])
        out, slopes = np.empty((n, 6)), np.zeros((n, 6, 10 + 2 * r + p))
        kernel.model.jacobian(kernel.values, motion, rows, slots, directions, as_acceleration, out, slopes)
    return Jacobian(
        value=out,
        velocity=slopes[:, :, 0:3],
        rate=slopes[:, :, 3:6],
        rotor_speed=slopes[:, :, 6 : 6 + r],
        attitude=slopes[:, :, 6 + r : 9 + r],
        height=slopes[:, :, 9 + r],
        rotor_acceleration=slopes[:, :, 10 + r : 10 + 2 * r],
        parameters=slopes[:, :, 10 + 2 * r :],
    )


def _nonzero_directions(vehicle: Vehicle, columns: list[int | None]) -> tuple[list[int], list[int]]:
    """Columns of the Jacobian that are not zero, and the kernel's number for each of those directions."""
    needs, r = {need for name in vehicle.effects for need in registry.find(name).needs}, vehicle.rotors
    nonzero = [(slot, slot) for slot in range(6 + r)]
    if "q_world_body" in needs:
        nonzero += [(slot, slot) for slot in range(6 + r, 9 + r)]
    if "height_m" in needs:
        nonzero += [(9 + r, 10 + r)]
    if "rotor_acceleration_rad_s2" in needs:
        nonzero += [(10 + r + k, 12 + r + k) for k in range(r)]
    nonzero += [(10 + 2 * r + i, column) for i, column in enumerate(columns) if column is not None]
    return [slot for slot, _ in nonzero], [direction for _, direction in nonzero]


def _complex_steps(
    vehicle: Vehicle, motion: FloatArray, parameters: Sequence[str], around: Surroundings, as_acceleration: bool
) -> tuple[FloatArray, FloatArray]:
    """The same derivatives without the kernel: one evaluation per direction."""

    def slope(m: Array = motion, a: Surroundings = around, v: ValueMap | None = None) -> FloatArray:
        return np.imag(_six_numpy(vehicle, m, a, as_acceleration, v)) / _STEP

    r = vehicle.rotors
    slopes = np.zeros((len(motion), 6, 10 + 2 * r + len(parameters)))
    for j in range(6 + r):
        stepped = motion.astype(complex)
        stepped[:, j] += 1j * _STEP
        slopes[:, :, j] = slope(m=stepped)
    for slot, shifted in _surroundings_steps(around, r):
        slopes[:, :, slot] = slope(a=shifted)
    for j, name in enumerate(parameters):
        values = values_of(vehicle)
        values[name] = values[name] + 1j * _STEP
        slopes[:, :, 10 + 2 * r + j] = slope(v=values)
    return _six_numpy(vehicle, motion, around, as_acceleration), slopes


def _surroundings_steps(around: Surroundings, rotors: int) -> list[tuple[int, Surroundings]]:
    """Each known surrounding with a complex step added, and its column of the Jacobian."""
    steps: list[tuple[int, Any]] = []
    if around.q_world_body is not None:
        w, x, y, z = np.atleast_2d(around.q_world_body).T
        turns = ((-x, w, z, -y), (-y, -z, w, x), (-z, y, -x, w))
        for k, turn in enumerate(turns):
            q = np.atleast_2d(around.q_world_body) + 0.5j * _STEP * np.stack(turn, axis=1)
            steps.append((6 + rotors + k, _replaced(around, q_world_body=q)))
    if around.height_m is not None:
        steps.append((9 + rotors, _replaced(around, height_m=np.asarray(around.height_m) + 1j * _STEP)))
    if around.rotor_acceleration_rad_s2 is not None:
        for k in range(rotors):
            a = np.atleast_2d(around.rotor_acceleration_rad_s2).astype(complex)
            a[:, k] += 1j * _STEP
            steps.append((10 + rotors + k, _replaced(around, rotor_acceleration_rad_s2=a)))
    return steps


def _replaced(around: Surroundings, **changes: Any) -> Surroundings:
    kept = {name: getattr(around, name) for name in Surroundings.__slots__}
    return Surroundings(**(kept | changes))


def motion_numpy(
    vehicle: Vehicle, velocity: FloatArray, rate: FloatArray, rotor_speed: FloatArray, around: Surroundings
) -> tuple[Array, Array, Array]:
    """Specific force (n, 3), angular acceleration (n, 3) and thrust (n, r) without the kernel."""
    flow = forces.evaluate(vehicle, velocity.T, rate.T, rotor_speed.T, around)
    body = rigid_body(vehicle)
    return (*_accelerations(body, rate, flow.force_n.T, flow.torque_n_m.T), flow.thrust_n.T)


def _accelerations(body: RigidBody, rate: Array, force: Array, torque: Array) -> tuple[Array, Array]:
    net = torque - np.cross(rate, rate @ body.inertia_kg_m2.T)
    return force / body.mass_kg, np.linalg.solve(body.inertia_kg_m2, net.T).T


def motor_response(
    vehicle: Vehicle, command: FloatArray, speed: FloatArray, battery_v: Any
) -> tuple[Array, Array | None]:
    """Response of the motors to a command (n, r): the command that reaches the rotors (n, r), and the rotor
    acceleration (n, r), or None when no active effect models it and the rotors follow at once."""
    drive = Drive(np.atleast_2d(command).T, np.atleast_2d(speed).T, battery_v)
    for name in active(vehicle, Stage.COMMAND, Stage.DRIVE):
        registry.find(name).apply(drive, vehicle.values(name))
    return drive.command_rad_s.T, None if drive.acceleration_rad_s2 is None else drive.acceleration_rad_s2.T
