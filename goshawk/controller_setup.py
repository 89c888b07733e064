"""From what is believed about the vehicle to the controller's parameters, and what the controller leaves out.

`COMPENSATED` is the one table of which effects the embedded controller cancels; `docs/c_integration.md` explains how.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vehicle import Vehicle

_QUADRATIC, _BEM = 0.0, 2.0

Values = dict[str, float]

COMPENSATED: dict[str, Callable[[Vehicle], Values]] = {
    "thrust_bem": lambda v: {
        "thrust_model": _BEM,
        "k1_n_s2": v.value("thrust_bem.k1_n_s2"),
        "k2_n_s2_m": v.value("thrust_bem.k2_n_s2_m"),
    },
    "thrust_quadratic": lambda v: {"thrust_model": _QUADRATIC, "quad_n_s2": v.value("thrust_quadratic.thrust_n_s2")},
    "rotor_yaw_torque": lambda v: {"cq_n_m_s2": v.value("rotor_yaw_torque.torque_n_m_s2")},
    "centre_of_mass": lambda v: {"com_x_m": v.value("centre_of_mass.x_m"), "com_y_m": v.value("centre_of_mass.y_m")},
    "rotor_drag_thrust": lambda v: {"rotor_drag_s_m": v.value("rotor_drag_thrust.drag_s_m")},
    "rotor_drag_speed": lambda v: {"rotor_drag_kg": v.value("rotor_drag_speed.drag_kg")},
    "parasitic_drag": lambda v: {
        "drag_x_kg_m": v.value("parasitic_drag.drag_xy_kg_m"),
        "drag_y_kg_m": v.value("parasitic_drag.drag_xy_kg_m"),
        "drag_z_kg_m": v.value("parasitic_drag.drag_z_kg_m"),
    },
    "parasitic_drag_speed": lambda v: {
        f"drag_norm_{axis}_kg_m": v.value(f"parasitic_drag_speed.drag_{axis}_kg_m") for axis in "xyz"
    },
    "translational_lift": lambda v: {"lift_kg_m": v.value("translational_lift.lift_kg_m")},
    "flapping_moment": lambda v: {"flapping_kg_m": v.value("flapping_moment.moment_kg_m")},
    "angular_damping": lambda v: {f"damping_{a}_n_m_s": v.value(f"angular_damping.{a}_n_m_s") for a in "xyz"},
    "weak_rotor": lambda v: {f"rotor{i}_gain": 1.0 - v.value(f"weak_rotor.loss_{i}") for i in range(4)},
    "battery_sag": lambda v: {
        "battery_ref_v": v.value("battery_sag.reference_v"),
        "battery_gain_1_v": v.value("battery_sag.sag_per_v"),
    },
    "motor_lag": lambda v: {"rotor_lag_s": 0.5 * (v.value("motor_lag.rise_s") + v.value("motor_lag.fall_s"))},
}
"""Effect to the controller parameters that cancel it. An effect that is not here is flown without compensation."""

_SWITCHED_OFF = {
    "com_x_m": 0.0, "com_y_m": 0.0, "rotor_drag_s_m": 0.0, "rotor_drag_kg": 0.0, "lift_kg_m": 0.0,
    "flapping_kg_m": 0.0, "battery_ref_v": 0.0, "battery_gain_1_v": 0.0, "rotor_lag_s": 0.0,
    **{f"drag_{axis}_kg_m": 0.0 for axis in "xyz"},
    **{f"drag_norm_{axis}_kg_m": 0.0 for axis in "xyz"},
    **{f"damping_{axis}_n_m_s": 0.0 for axis in "xyz"},
    **{f"rotor{i}_gain": 1.0 for i in range(4)},
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class ControllerSetup:
    """What to set in the controller, and which of the vehicle's effects it does not cancel."""

    parameters: Values
    """Controller parameter name to value; see the controller's parameters.h."""
    not_compensated: tuple[str, ...]


def controller_setup(believed: Vehicle) -> ControllerSetup:
    """The controller's parameters for a vehicle: its geometry, its limits, and every effect the controller knows."""
    parameters = _rigid_body(believed) | _limits(believed) | _SWITCHED_OFF
    for effect in believed.effects:
        if effect in COMPENSATED:
            parameters |= COMPENSATED[effect](believed)
    return ControllerSetup(parameters, tuple(effect for effect in believed.effects if effect not in COMPENSATED))


def _rigid_body(v: Vehicle) -> Values:
    body = {
        "mass_kg": v.mass_kg,
        "inertia_xx": v.value("inertia_xx_kg_m2"),
        "inertia_yy": v.value("inertia_yy_kg_m2"),
        "inertia_zz": v.value("inertia_zz_kg_m2"),
        "air_density": v.value("air_density_kg_m3"),
        "disk_area_m2": float(np.pi * v.value("rotor_radius_m") ** 2),
    }
    for i, (x_m, y_m, _) in enumerate(v.hub_body_m):
        # the vehicle says how the rotor turns; the controller wants the torque on the body, which is opposite
        body |= {f"rotor{i}_x_m": float(x_m), f"rotor{i}_y_m": float(y_m), f"rotor{i}_spin": -float(v.spin[i])}
    return body


def _limits(v: Vehicle) -> Values:
    return {
        "rotor_min_rad_s": v.limits.rotor_speed_min_rad_s,
        "rotor_max_rad_s": v.limits.rotor_speed_max_rad_s,
        "rotor_idle_rad_s": min(150.0, v.limits.rotor_speed_min_rad_s),
        "path_speed_m_s": 1.05 * v.limits.speed_m_s,  # the planner keeps to the limit; the vehicle refuses beyond 5 %
        "path_acc_m_s2": 1.05 * v.limits.acceleration_m_s2,
        "path_yaw_rad_s": 1.05 * v.limits.yaw_rate_rad_s,
    }
