"""Truths of RotorPy's equations and step (benchmarks/blind_flight.py, held to RotorPy's own to 1e-9), flown in wind.

Of RotorPy's own parameters, and of those of crazyflow's cf21B_500 where RotorPy has the law. Nothing is shared with
`vehicle` or a preflight.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks import blind_flight
from flight import FloatArray
from vehicle import Parameter, Vehicle
from vehicle.draft import Known, draft

OUR_ORDER = [0, 3, 2, 1]
"""Of RotorPy's rotors, clockwise from front left."""
_RAD_S_PER_RPM = math.pi / 30.0
CRAZYFLOW_LAG_S = 0.05
"""First-order, in place of crazyflow's rates of rise and fall (14 and 6 a second and quadratic terms)."""


@dataclass(frozen=True)
class RotorPy:
    """One vehicle."""

    parameters: Mapping[str, Any]
    """RotorPy's."""
    lag: float

    def steps(
        self, truths: Sequence["RotorPy"], state: FloatArray, command: FloatArray, duration_s: float
    ) -> FloatArray:
        """As `other_physics.Physics`."""
        fleet = blind_flight.Fleet.of([{**truth.parameters, "tau_m": truth.lag} for truth in truths])
        theirs = state.T.copy()
        theirs[6:10], theirs[13:17] = np.roll(state[:, 6:10], -1, axis=1).T, state[:, 13:17].T[OUR_ORDER]
        still = np.zeros((3, len(state)))
        after = blind_flight.advance(
            fleet, theirs, command.T[OUR_ORDER], still, 0.0, duration_s, blind_flight.Sky()
        ).T  # fmt: skip
        found = after.copy()
        found[:, 6:10], found[:, 13:17] = np.roll(after[:, 6:10], 1, axis=1), after[:, 13:17][:, OUR_ORDER]
        return found


def hummingbird() -> Mapping[str, Any]:
    """RotorPy's Hummingbird with thrust, drag and inertia that nobody told a model of."""
    from rotorpy.vehicles.hummingbird_params import quad_params as usual

    changed = {"k_eta": 1.02, "c_Dx": 1.4, "c_Dy": 1.4, "k_d": 0.85, "Ixx": 1.1, "Iyy": 0.95, "Izz": 1.05}
    return {**usual, **{name: ratio * usual[name] for name, ratio in changed.items()}}


def crazyflow() -> Mapping[str, Any]:
    """The cf21B_500 of crazyflow 0.2 (dynamics/first_principles/params.toml); its linear drag is that of the rotors at
    hover, its lag the mean of its rise and fall."""
    from rotorpy.vehicles.hummingbird_params import quad_params as others

    mass_kg, arm_m, thrust, torque = 0.0434, 0.035355, 4.407354891648379e-10, 2.4693477924534137e-12
    k = thrust / _RAD_S_PER_RPM**2
    hover_rad_s = math.sqrt(mass_kg * 9.80665 / (4.0 * k))
    return {
        **dict.fromkeys(others, 0.0), "mass": mass_kg, "Ixx": 25e-6, "Iyy": 28e-6, "Izz": 49e-6, "Ixy": 0.0, "Ixz": 0.0,
        "Iyz": 0.0, "k_eta": k, "k_m": torque / _RAD_S_PER_RPM**2, "k_d": 0.0216 / (4.0 * hover_rad_s),
        "rotor_directions": others["rotor_directions"], "rotor_speed_min": 0.0,
        "rotor_speed_max": math.sqrt(0.2 / k), "kp_att": 1.0, "kd_att": 1.0,
        "rotor_pos": {f"r{i}": arm_m * np.sign(place) for i, place in enumerate(others["rotor_pos"].values(), 1)},
    }  # fmt: skip


def crazyflow_drawing() -> Vehicle:
    """What a data sheet tells of the same vehicle, a twentieth off."""
    given, source = crazyflow(), "this test's data sheet"
    hubs = np.array(list(given["rotor_pos"].values()))[OUR_ORDER]
    effects = {
        "thrust_quadratic.k_n_s2": (0.97 * given["k_eta"], "N s2"),
        "rotor_yaw_torque.torque_n_m_s2": (given["k_m"], "N m s2"),
        "rotor_drag_speed.drag_kg": (1.2 * given["k_d"], "kg"),
        "motor_lag.rise_s": (CRAZYFLOW_LAG_S, "s"),
        "motor_lag.fall_s": (CRAZYFLOW_LAG_S, "s"),
        **{f"inertia_{axis}_kg_m2": (0.95 * given[f"I{axis}"], "kg m2") for axis in ("xx", "yy", "zz")},
    }
    return draft(
        Known(
            name="cf21B_500",
            mass_kg=Parameter(given["mass"], 0.0, "kg", source),
            hub_body_m=hubs,
            spin=-np.asarray(given["rotor_directions"], np.float64)[OUR_ORDER],
            rotor_radius_m=Parameter(0.0275, 0.0, "m", source),
            parameters={name: Parameter(value, 0.0, unit, source) for name, (value, unit) in effects.items()},
            rotor_speed_max_rad_s=given["rotor_speed_max"],
        )
    )
