"""One integrator, two implementations: the compiled kernel, and NumPy as its reference.

A state is a row of 13 + r with r rotors: position 0-2 and velocity 3-5 in world axes, q_world_body 6-9, body rate
10-12, rotor speeds from 13. The world is a row of 6: wind 0-2, gravity 3, floor height 4, ceiling height 5.
"""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from flight import FloatArray, InputError, rotations
from vehicle import dynamics, native
from vehicle.forces import Surroundings
from vehicle.model import Vehicle

Advance = Callable[[FloatArray, FloatArray, FloatArray, int, float, FloatArray, FloatArray], FloatArray]
"""advance(world (1 or m, 6), command (1 or m, r), battery_v (1 or m, 1), steps, step_s, states (m, 13 + r) changed in
place, specific_force (m, 3) filled) -> rotor energy in joules (m,)."""


def world_row(wind_m_s: Sequence[float], gravity_m_s2: float, ground_m: float, ceiling_m: float) -> FloatArray:
    return np.array([[*wind_m_s, gravity_m_s2, ground_m, ceiling_m]], dtype=np.float64)


def stepper(vehicle: Vehicle, values: Mapping[str, FloatArray] | None = None, count: int = 1) -> Advance:
    """The fastest implementation for this vehicle; `values` gives each of `count` vehicles its own numbers.

    Raises:
        InputError: a value has no such parameter, another length, or the vehicle has no compiled form.
    """
    kernel = native.compiled(vehicle)
    if kernel is not None:
        return _kernel_stepper(kernel, _own_rows(vehicle, kernel, values, count) if values else kernel.values)
    if values:
        raise InputError(
            "vehicles with tilted rotors or effects of the user's own fly with shared values only; fly them one by one"
        )
    kernel = native.for_stepping(vehicle)
    return numpy_stepper(vehicle) if kernel is None else _kernel_stepper(kernel, kernel.values)


def _own_rows(vehicle: Vehicle, kernel: native.Compiled, values: Mapping[str, FloatArray], count: int) -> FloatArray:
    rows = np.repeat(kernel.values, count, axis=0)
    for name, column in values.items():
        vehicle.parameter(name)
        if np.shape(column) != (count,) or not np.isfinite(column).all():
            raise InputError(f"{name} needs {count} finite values, one per vehicle; it has shape {np.shape(column)}")
        rows[:, kernel.names.index(name)] = column
    return rows


def _kernel_stepper(kernel: native.Compiled, rows: FloatArray) -> Advance:
    def advance(world, command, battery_v, steps, step_s, states, specific_force):
        energy = np.empty((len(states), 1))
        kernel.model.step(rows, world, command, battery_v, steps, step_s, states, specific_force, energy)
        return energy[:, 0]

    return advance


def numpy_stepper(vehicle: Vehicle) -> Advance:
    """NumPy reference of the kernel."""

    def advance(world, command, battery_v, steps, step_s, states, specific_force):
        energy = np.zeros(len(states))
        slope = lambda x: _derive(vehicle, world, command, battery_v, x)[0]  # noqa: E731
        for _ in range(steps):
            before = states.copy()
            k1, _, power = _derive(vehicle, world, command, battery_v, states)
            k2 = slope(states + 0.5 * step_s * k1)
            k3 = slope(states + 0.5 * step_s * k2)
            k4 = slope(states + step_s * k3)
            states += step_s / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
            states[:, 6:10] = rotations.normalise(states[:, 6:10])
            _rest_on_ground(world, before, states)
            energy += step_s * power
        reached, spin_up = dynamics.motor_response(vehicle, command, states[:, 13:], battery_v[:, 0])
        if spin_up is None:
            states[:, 13:] = reached
        k, specific, _ = _derive(vehicle, world, command, battery_v, states)
        carried = (states[:, 2] <= world[:, 4]) & (k[:, 5] <= 0.0)
        weight = rotations.rotate(rotations.conjugate(states[:, 6:10]), np.array([0.0, 0.0, 1.0]) * world[:, 3:4])
        specific_force[:] = np.where(carried[:, None], weight, specific)
        return energy

    return advance


def _derive(
    vehicle: Vehicle, world: FloatArray, command: FloatArray, battery_v: FloatArray, x: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Time derivative of the state, specific force, and the power the rotors put into the air."""
    q, w, speed = x[:, 6:10], x[:, 10:13], x[:, 13:]
    reached, spin_up = dynamics.motor_response(vehicle, command, speed, battery_v[:, 0])
    if spin_up is None:
        speed, spin_up = np.broadcast_to(reached, speed.shape), np.zeros_like(speed)
    around = Surroundings(q, x[:, 2] - world[:, 4], world[:, 5] - x[:, 2], spin_up)
    velocity = rotations.rotate(rotations.conjugate(q), x[:, 3:6] - world[:, :3])
    specific, turn, thrust = dynamics.motion_numpy(vehicle, velocity, w, speed, around)
    gravity = np.array([0.0, 0.0, -1.0]) * world[:, 3:4]
    q_slope = 0.5 * rotations.multiply(q, np.concatenate([np.zeros((len(x), 1)), w], axis=1))
    slope = np.concatenate([x[:, 3:6], rotations.rotate(q, specific) + gravity, q_slope, turn, spin_up], axis=1)
    return slope, specific, _rotor_power(vehicle, thrust)


def _rotor_power(vehicle: Vehicle, thrust_n: FloatArray) -> FloatArray:
    """Momentum theory: lifting takes at least thrust times the air's speed through the disk. (n, r) to (n,)."""
    disk = np.pi * vehicle.value("rotor_radius_m") ** 2 * vehicle.value("air_density_kg_m3")
    lifting = np.maximum(thrust_n, 0.0)
    return (lifting * np.sqrt(lifting / (2.0 * disk))).sum(axis=1) if disk > 0.0 else np.zeros(len(thrust_n))


def _rest_on_ground(world: FloatArray, before: FloatArray, states: FloatArray) -> None:
    """A vehicle on the floor does not sink, slide or turn until the rotors lift it off."""
    ground = np.broadcast_to(world[:, 4], len(states))
    resting = (states[:, 2] <= ground) & (states[:, 5] <= 0.0)
    states[resting, 0:10] = before[resting, 0:10]
    states[resting, 2] = ground[resting]
    states[resting, 3:6] = 0.0
    states[resting, 10:13] = 0.0
