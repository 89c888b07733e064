"""Many RotorPy vehicles at once: its dynamics and its SE3 controller, restated over arrays so that campaigns are cheap.

RotorPy integrates one vehicle at 1.6 times real time, too slow for hundreds of flights. Here the same equations act on
a whole batch, one column per flight; `tests/sysid/diagnosis/test_blind_truth.py` holds them to RotorPy's own to 1e-9.
What RotorPy lacks comes in through `Extra`s, which see the flow and add thrust, force and torque.
Quaternions are RotorPy's x y z w here; nothing of Goshawk's own models is used.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

GRAVITY_M_S2 = 9.80665
POSITION, VELOCITY, ATTITUDE, RATE, ROTORS = slice(0, 3), slice(3, 6), slice(6, 10), slice(10, 13), slice(13, 17)
"""Rows of a state (17, flights)."""


@dataclass(frozen=True, slots=True)
class Air:
    """What an `Extra` may look at, for the flights it acts on; components first, flights last."""

    time_s: float
    position: Array
    rotation: Array
    """(3, 3, b) body to world."""
    velocity: Array
    """(3, b) air speed in body axes."""
    rate: Array
    rotor_speed: Array
    rotor_acceleration: Array
    hub: Array
    """(3, 4, b) from the centre of mass."""
    direction: Array
    """(4, b) sign of the torque on the body (RotorPy's convention)."""


class Extra(Protocol):
    """Physics RotorPy lacks."""

    def thrust(self, air: Air, thrust: Array) -> Array:
        """(4, b) thrust of the rotors, given what it would be without."""
        ...

    def wrench(self, air: Air, thrust: Array) -> tuple[Array, Array] | None:
        """Force and torque (3, b) at the centre of mass, given the final thrust."""
        ...


@dataclass(frozen=True, slots=True)
class Fleet:
    """RotorPy's parameters of every flight; arrays end in the flight."""

    mass: Array
    inertia: Array
    """(3, 3, b)."""
    inverse_inertia: Array
    hub: Array
    direction: Array
    thrust: Array
    yaw_torque: Array
    rotor_drag: Array
    inflow: Array
    lift: Array
    flapping: Array
    drag: Array
    """(3, b)."""
    lag_s: Array
    least_speed: Array
    most_speed: Array
    attitude_gain: Array
    rate_gain: Array
    allocation: Array
    """(4, 4, b) from thrust and moments to the thrust of each rotor."""

    @staticmethod
    def of(vehicles: Sequence[Mapping[str, Any]]) -> "Fleet":
        """From RotorPy's parameter dictionaries, one per flight."""

        def row(name: str, default: float = 0.0) -> Array:
            return np.array([float(p.get(name, default)) for p in vehicles])

        inertia = np.stack([_inertia(p) for p in vehicles], axis=-1)
        return Fleet(
            mass=row("mass"),
            inertia=inertia,
            inverse_inertia=np.stack([np.linalg.inv(_inertia(p)) for p in vehicles], axis=-1),
            hub=np.stack([_hubs(p).T for p in vehicles], axis=-1),
            direction=np.stack([np.asarray(p["rotor_directions"], float) for p in vehicles], axis=-1),
            thrust=row("k_eta"),
            yaw_torque=row("k_m"),
            rotor_drag=row("k_d"),
            inflow=row("k_z"),
            lift=row("k_h"),
            flapping=row("k_flap"),
            drag=np.stack([row(f"c_D{axis}") for axis in "xyz"]),
            lag_s=row("tau_m"),
            least_speed=row("rotor_speed_min"),
            most_speed=row("rotor_speed_max"),
            attitude_gain=row("kp_att"),
            rate_gain=row("kd_att"),
            allocation=np.stack([_allocation(p) for p in vehicles], axis=-1),
        )


def _inertia(p: Mapping[str, Any]) -> Array:
    xx, yy, zz, xy, xz, yz = (float(p["I" + axes]) for axes in ("xx", "yy", "zz", "xy", "xz", "yz"))
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _hubs(p: Mapping[str, Any]) -> Array:
    return np.stack([np.asarray(place, float) for place in p["rotor_pos"].values()])


def _allocation(p: Mapping[str, Any]) -> Array:
    x, y, _ = _hubs(p).T
    yaw = p["k_m"] / p["k_eta"] * np.asarray(p["rotor_directions"], float)
    return np.linalg.inv(np.stack([np.ones(4), y, -x, yaw]))


@dataclass(frozen=True, slots=True)
class Sky:
    """What acts on a batch besides RotorPy's terms: each extra with the flights (a slice of columns) it acts on."""

    extras: tuple[tuple[slice, Extra], ...] = ()


def slope(fleet: Fleet, state: Array, command: Array, wind: Array, time_s: float, sky: Sky) -> Array:
    """Time derivative (17, b) of the state; RotorPy's `_s_dot_fn`, plus the extras."""
    rotation = matrix(state[ATTITUDE])
    velocity = turned_back(rotation, state[VELOCITY] - wind)
    rate, speed = state[RATE], state[ROTORS]
    change = (command - speed) / fleet.lag_s
    force, torque = _wrench(fleet, state, rotation, velocity, change, time_s, sky)
    found = np.empty_like(state)
    found[POSITION] = state[VELOCITY]
    found[VELOCITY] = turned(rotation, force) / fleet.mass
    found[5] -= GRAVITY_M_S2
    x, y, z, w = state[ATTITUDE]
    p, q, r = rate
    found[6] = 0.5 * (w * p - z * q + y * r)
    found[7] = 0.5 * (z * p + w * q - x * r)
    found[8] = 0.5 * (-y * p + x * q + w * r)
    found[9] = 0.5 * (-x * p - y * q - z * r)
    spun = turned(fleet.inertia, rate)
    found[RATE] = turned(fleet.inverse_inertia, torque - cross(rate, spun))
    found[ROTORS] = change
    return found


def _wrench(
    fleet: Fleet, state: Array, rotation: Array, velocity: Array, change: Array, time_s: float, sky: Sky
) -> tuple[Array, Array]:
    rate, speed, hub = state[RATE], state[ROTORS], fleet.hub
    at_hub = velocity[:, None] + cross(rate[:, None], hub)
    edgewise = at_hub[0] ** 2 + at_hub[1] ** 2
    thrust = fleet.thrust * speed**2 + fleet.lift * edgewise - fleet.inflow * speed * at_hub[2]
    views = [
        (columns, extra, _view(fleet, state, rotation, velocity, change, time_s, columns))
        for columns, extra in sky.extras
    ]
    for columns, extra, air in views:
        thrust[:, columns] = extra.thrust(air, thrust[:, columns])
    h_x, h_y = -fleet.rotor_drag * speed * at_hub[0], -fleet.rotor_drag * speed * at_hub[1]
    airspeed = np.sqrt((velocity**2).sum(axis=0))
    force = -airspeed * fleet.drag * velocity
    force[0] += h_x.sum(axis=0)
    force[1] += h_y.sum(axis=0)
    force[2] += thrust.sum(axis=0)
    flap = fleet.flapping * speed
    torque = np.stack(
        [
            (hub[1] * thrust - hub[2] * h_y - flap * at_hub[1]).sum(axis=0),
            (hub[2] * h_x - hub[0] * thrust + flap * at_hub[0]).sum(axis=0),
            (hub[0] * h_y - hub[1] * h_x + fleet.direction * fleet.yaw_torque * speed**2).sum(axis=0),
        ]
    )
    for columns, extra, air in views:
        added = extra.wrench(air, thrust[:, columns])
        if added is not None:
            force[:, columns] += added[0]
            torque[:, columns] += added[1]
    return force, torque


def _view(
    fleet: Fleet, state: Array, rotation: Array, velocity: Array, change: Array, time_s: float, columns: slice
) -> Air:
    return Air(
        time_s,
        state[POSITION, columns],
        rotation[..., columns],
        velocity[:, columns],
        state[RATE, columns],
        state[ROTORS, columns],
        change[:, columns],
        fleet.hub[..., columns],
        fleet.direction[:, columns],
    )


@dataclass(frozen=True, slots=True)
class Reference:
    """Where a batch should be at one instant, (3, b) and (b,)."""

    position: Array
    velocity: Array
    acceleration: Array
    yaw: Array
    yaw_rate: Array


POSITION_GAIN = np.array([9.0, 9.0, 15.0])
VELOCITY_GAIN = np.array([5.0, 5.0, 9.0])
"""Gains handed to RotorPy's controller; a little firmer along the level axes than its defaults."""


def se3_command(fleet: Fleet, state: Array, reference: Reference) -> Array:
    """Rotor speeds (4, b) that RotorPy's SE3Control asks for; `fleet` is the controller's model."""
    force = fleet.mass * demanded_force_per_mass(state, reference)
    rotation = matrix(state[ATTITUDE])
    thrust = (force * rotation[:, 2]).sum(axis=0)
    desired = upright(force, reference.yaw)
    product = np.einsum("kib,kjb->ijb", desired, rotation)
    # half of R_d^T R - R^T R_d, and its vee map
    tilt = 0.5 * np.stack([product[2, 1] - product[1, 2], product[0, 2] - product[2, 0], product[1, 0] - product[0, 1]])
    slip = state[RATE].copy()
    slip[2] -= reference.yaw_rate
    spun = turned(fleet.inertia, state[RATE])
    moment = turned(fleet.inertia, -fleet.attitude_gain * tilt - fleet.rate_gain * slip) + cross(state[RATE], spun)
    thrusts = turned(fleet.allocation, np.concatenate([thrust[None], moment]))
    squared = thrusts / fleet.thrust
    return np.sign(squared) * np.sqrt(np.abs(squared))


def demanded_force_per_mass(state: Array, reference: Reference) -> Array:
    """(3, b) specific force that corrects position and velocity."""
    demand = reference.acceleration - POSITION_GAIN[:, None] * (state[POSITION] - reference.position)
    demand -= VELOCITY_GAIN[:, None] * (state[VELOCITY] - reference.velocity)
    demand[2] += GRAVITY_M_S2
    return demand


def upright(force: Array, yaw: Array) -> Array:
    """(3, 3, b) attitude whose z axis lies along a force, heading as given."""
    up = force / np.sqrt((force**2).sum(axis=0))
    left = cross(up, np.stack([np.cos(yaw), np.sin(yaw), np.zeros_like(yaw)]))
    left /= np.sqrt((left**2).sum(axis=0))
    return np.stack([cross(left, up), left, up], axis=1)


def advance(fleet: Fleet, state: Array, command: Array, wind: Array, time_s: float, step_s: float, sky: Sky) -> Array:
    """One Runge-Kutta step of fourth order with the command held, as RotorPy's `step`."""
    held = np.clip(command, fleet.least_speed, fleet.most_speed)
    k1 = slope(fleet, state, held, wind, time_s, sky)
    k2 = slope(fleet, state + 0.5 * step_s * k1, held, wind, time_s + 0.5 * step_s, sky)
    k3 = slope(fleet, state + 0.5 * step_s * k2, held, wind, time_s + 0.5 * step_s, sky)
    k4 = slope(fleet, state + step_s * k3, held, wind, time_s + step_s, sky)
    ahead = state + step_s / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
    ahead[ATTITUDE] /= np.sqrt((ahead[ATTITUDE] ** 2).sum(axis=0))
    ahead[ROTORS] = np.clip(ahead[ROTORS], fleet.least_speed, fleet.most_speed)
    return ahead


def matrix(q: Array) -> Array:
    """(3, 3, b) of quaternions x y z w, normalised first as RotorPy does."""
    x, y, z, w = q / np.sqrt((q**2).sum(axis=0))
    xx, yy, zz, xy, xz, yz, wx, wy, wz = x * x, y * y, z * z, x * y, x * z, y * z, w * x, w * y, w * z
    rows = [
        [1.0 - 2.0 * (yy + zz), 2.0 * (xy - wz), 2.0 * (xz + wy)],
        [2.0 * (xy + wz), 1.0 - 2.0 * (xx + zz), 2.0 * (yz - wx)],
        [2.0 * (xz - wy), 2.0 * (yz + wx), 1.0 - 2.0 * (xx + yy)],
    ]
    return np.array(rows)


def turned(matrices: Array, vectors: Array) -> Array:
    return (matrices * vectors[None]).sum(axis=1)


def turned_back(matrices: Array, vectors: Array) -> Array:
    return (matrices * vectors[:, None]).sum(axis=0)


def cross(a: Array, b: Array) -> Array:
    first = a[1] * b[2] - a[2] * b[1]
    found = np.empty((3, *first.shape))
    found[0] = first
    found[1] = a[2] * b[0] - a[0] * b[2]
    found[2] = a[0] * b[1] - a[1] * b[0]
    return found
