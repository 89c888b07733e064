"""The vehicle as the optimiser sees it, fitted to the vehicle's own model.

Thrust makes up for a lateral drag c |f| / g + c' |v| times the velocity (Faessler et al. 2018, with the coefficients of
the vehicle's own effects), and turns with the path and with yaw; rotor speeds squared follow thrust and torque linearly
from hover, less the lift that air speed adds. All else that the model knows is measured with `planner.curve.attitude`
along the path and handed to the optimiser as offsets.
"""

from dataclasses import dataclass

import numpy as np

import vehicle as vehicles
from flight import FloatArray, portable
from vehicle import Limits, Vehicle, allocation, dynamics, forces, invert

_SINGLE = ("speed", "acceleration", "jerk", "tilt", "roll and pitch rate", "yaw rate")


def names_of(rotors: int) -> tuple[str, ...]:
    """What each column of an excess belongs to."""
    return (*_SINGLE, *["rotor speed"] * rotors, *["slowest rotor"] * rotors)


NAMES = names_of(4)
COLUMNS = len(NAMES)
_IDLE = 8
"""The kernel is compiled for four rotors and for so many; of fewer than these the rest never exceed a limit."""
_FIT_LATERAL_M_S = np.linspace(1.0, 10.0, 10)
_FIT_CLIMB_M_S = np.linspace(-6.0, 6.0, 7)
_LEAST_FORCE = 1e-6
"""Added to |f|^2, and below to |v|^2 (SI): lengths stay smooth at zero."""
_LEAST_PACE = 1e-2


@dataclass(frozen=True, slots=True, eq=False)
class Airframe:
    """Limits, and a vehicle reduced to what the optimiser can differentiate a million times a second."""

    gravity_m_s2: float
    speed_m_s: float
    acceleration_m_s2: float
    jerk_m_s3: float
    """Infinite: no limit."""
    cos_tilt: float
    """Cosine of the largest tilt."""
    rate_rad_s: float
    yaw_rate_rad_s: float
    drag_per_thrust_1_s: float
    """Lateral drag per mass and velocity, at one g of thrust."""
    drag_per_speed_1_m: float
    """What it grows by with the speed."""
    lift_axial_1_s: float
    """What thrust per mass gains, at steady rotor speeds, for each m/s along the thrust axis (negative)."""
    lift_lateral_1_m: float
    """The same for each m2/s2 of squared speed across it."""
    inertia_kg_m2: FloatArray
    """(3,) about the body axes."""
    effort_least: FloatArray
    """(r,) lower limit of each rotor's speed squared, in units of the mean at hover."""
    effort_most: FloatArray
    effort_hover: FloatArray
    mix: FloatArray
    """(r, 4) effort of each rotor by thrust per mass (m/s2) and by the three torques (N m)."""

    @property
    def names(self) -> tuple[str, ...]:
        """What each column of an excess belongs to."""
        return names_of(len(self.effort_hover))


def reduced(vehicle: Vehicle, limits: Limits) -> Airframe:
    """The vehicle near hover, with these limits; for the kernel five to seven rotors are filled up to eight."""
    hover = invert.hover(vehicle)
    mean_square = float(np.mean(hover**2))
    still, mass = np.zeros((1, 3)), vehicle.mass_kg
    around = forces.open_air(1, vehicle.rotors)
    slope = dynamics.wrench_jacobian(vehicle, still, still, hover[None], surroundings=around).rotor_speed[0, 2:]
    if vehicle.rotors > 4:
        by_wrench = allocation.by_wrench(vehicle, slope[None], hover[None])[0]
    else:
        by_wrench = portable.solve(slope, np.eye(4))
    mix = 2.0 * hover[:, None] / mean_square * by_wrench
    mix[:, 0] *= mass
    idle = np.zeros(0 if vehicle.rotors == 4 else _IDLE - vehicle.rotors)
    drag, lift = _in_flight(vehicle, hover)
    return Airframe(
        gravity_m_s2=vehicle.gravity_m_s2,
        speed_m_s=limits.speed_m_s,
        acceleration_m_s2=limits.acceleration_m_s2,
        jerk_m_s3=limits.largest_jerk_m_s3,
        cos_tilt=float(portable.sine_cosine(limits.tilt_rad)[1]),
        rate_rad_s=limits.rate_rad_s,
        yaw_rate_rad_s=limits.yaw_rate_rad_s,
        drag_per_thrust_1_s=float(drag[0]),
        drag_per_speed_1_m=float(drag[1]),
        lift_axial_1_s=float(lift[0]),
        lift_lateral_1_m=float(lift[1]),
        inertia_kg_m2=np.array([vehicle.value(f"inertia_{axis}_kg_m2") for axis in ("xx", "yy", "zz")]),
        effort_least=np.append(
            np.full(vehicle.rotors, np.square(limits.rotor_speed_min_rad_s) / mean_square), idle - 1.0
        ),
        effort_most=np.append(
            np.full(vehicle.rotors, np.square(limits.rotor_speed_max_rad_s) / mean_square), idle + 1.0
        ),
        effort_hover=np.append(hover**2 / mean_square, idle),
        mix=np.concatenate([mix, np.zeros((len(idle), 4))]),
    )


def _in_flight(vehicle: Vehicle, hover: FloatArray) -> tuple[FloatArray, FloatArray]:
    """What air speed does at hover's rotor speeds, by least squares over level and vertical motion.

    Returns:
        Drag per mass over lateral speed as a + b |v|, never negative; thrust per mass as a u + b (v_x^2 + v_y^2).
    """
    grids = np.meshgrid(np.arange(8) * np.pi / 4.0, _FIT_LATERAL_M_S, _FIT_CLIMB_M_S)
    turn, lateral, up = (np.asarray(grid, dtype=np.float64).ravel() for grid in grids)
    sine, cosine = portable.sine_cosine(turn)
    velocity: FloatArray = np.stack([lateral * cosine, lateral * sine, up], axis=1)
    count, rotors = len(velocity), len(hover)
    force, _ = vehicles.wrench(
        vehicle, velocity, np.zeros_like(velocity), np.broadcast_to(hover, (count, rotors)),
        surroundings=forces.open_air(count, rotors),
    )  # fmt: skip
    per_mass = force / vehicle.mass_kg
    drag = -np.sum(per_mass[:, :2] * velocity[:, :2], axis=1) / lateral**2
    by_speed = np.stack([np.ones_like(lateral), np.sqrt(lateral**2 + up**2)], axis=1)
    by_climb = np.stack([up, lateral**2], axis=1)
    lift = per_mass[:, 2] - vehicle.gravity_m_s2
    fitted = [_least_squares(x, y) for x, y in ((by_speed, drag), (by_climb, lift))]
    return np.maximum(fitted[0], 0.0), fitted[1]


def _least_squares(x: FloatArray, y: FloatArray) -> FloatArray:
    """By the normal equations: two columns that are far from parallel."""
    return portable.solve(portable.product(x.T, x), portable.product(x.T, y[:, None]))[:, 0]


def excess_numpy(airframe: Airframe, derivatives: FloatArray) -> FloatArray:
    """The NumPy reference of the kernel's `Demand`: relative excess (n, names) over each limit.

    Args:
        derivatives: (n, 5, 4) position and yaw with four derivatives.
    """
    w, up = airframe, np.array([0.0, 0.0, airframe.gravity_m_s2])
    v, a, j, s = (derivatives[:, r, :3] for r in range(1, 5))
    yaw, yaw_rate, yaw_acceleration = derivatives[:, :3, 3].T
    f = a + up
    force, pace = (np.sqrt(_dot(x, x) + least)[:, None] for x, least in ((f, _LEAST_FORCE), (v, _LEAST_PACE)))
    drag = w.drag_per_thrust_1_s * force / w.gravity_m_s2 + w.drag_per_speed_1_m * pace
    thrust, thrust_1, thrust_2 = f + drag * v, j + drag * a, s + drag * j
    size = np.sqrt(np.maximum(_dot(thrust, thrust), 0.04 * np.square(w.gravity_m_s2)))[:, None]
    z = thrust / size
    change = _dot(z, thrust_1)[:, None]
    z_1 = (thrust_1 - z * change) / size
    z_2 = (thrust_2 - z * _dot(z, thrust_2)[:, None] - 2.0 * change * z_1) / size  # across z only
    low = np.maximum(1.0 + z[:, 2], 0.1)[:, None]
    flat_1, flat_2 = ((d - z * d[:, 2:] / low)[:, :2] for d in (z_1, z_2))
    sine, cosine = portable.sine_cosine(yaw)
    forward, left = np.stack([cosine, sine], axis=1), np.stack([-sine, cosine], axis=1)
    rate = np.stack([-_dot(left, flat_1), _dot(forward, flat_1), np.zeros(len(v))], axis=1)
    turn = np.stack([-_dot(left, flat_2), _dot(forward, flat_2), np.zeros(len(v))], axis=1)
    spin_1, spin_2 = (z[:, 0] * d[:, 1] - z[:, 1] * d[:, 0] for d in (z_1, z_2))
    rate[:, 2] = yaw_rate - spin_1 / low[:, 0]
    turn[:, 2] = yaw_acceleration - spin_2 / low[:, 0] + spin_1 * z_1[:, 2] / low[:, 0] ** 2
    # the body's axes turn with it: what that adds to the change of the rates
    turn[:, 0] += rate[:, 1] * rate[:, 2]
    turn[:, 1] -= rate[:, 0] * rate[:, 2]
    torque = turn * w.inertia_kg_m2 + np.cross(rate, rate * w.inertia_kg_m2)
    climb = _dot(v, z)
    lift = w.lift_axial_1_s * climb + w.lift_lateral_1_m * (_dot(v, v) - climb**2)
    asked = np.concatenate([(_dot(f, z) - lift - w.gravity_m_s2)[:, None], torque], axis=1)
    effort = w.effort_hover + portable.product(asked, w.mix.T)
    return np.column_stack(
        [
            _dot(v, v) / np.square(w.speed_m_s) - 1.0,
            _dot(a, a) / np.square(w.acceleration_m_s2) - 1.0,
            _dot(j, j) / np.square(w.jerk_m_s3) - 1.0,
            (w.cos_tilt - z[:, 2]) / (1.0 - w.cos_tilt),
            _dot(z_1, z_1) / np.square(w.rate_rad_s) - 1.0,
            rate[:, 2] ** 2 / np.square(w.yaw_rate_rad_s) - 1.0,
            effort - w.effort_most,
            w.effort_least - effort,
        ]
    )


def _dot(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.einsum("ni,ni->n", a, b)
