"""Limits that fit a vehicle: so much of the thrust that its rotors have beyond its weight, by preset.

With w = thrust at the fastest rotor speed over weight, s = the preset's share and a level flight at tilt t:

    1 / cos(t) = 1 + s (w - 1),  t at most the preset's
    acceleration = the lesser of g tan(t), level, and s (w - 1) g, upwards
    speed = acceleration times the preset's braking time

Rotor speeds and jerk stay as they are. Turn rates are the preset's, and not above `RATE_SHARE` of full stick where the
vehicle file holds a firmware's rate profile.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from flight import InputError
from vehicle.dynamics import wrench
from vehicle.model import Vehicle
from vehicle.parameters import Limits

RATE_SHARE = 0.8
"""Of what the firmware turns at full stick; the rest is for what disturbs."""
FULL_STICK = "full_stick_rad_s"
"""In a vehicle's provenance: roll, pitch and yaw rate of its firmware at full stick."""


@dataclass(frozen=True, slots=True)
class Preset:
    """What is asked of a vehicle."""

    thrust_share: float
    """Of the thrust beyond the weight."""
    tilt_rad: float
    """Most."""
    rate_rad_s: float
    yaw_rate_rad_s: float
    braking_s: float
    """In which the largest acceleration stops the largest speed."""


PRESETS = {
    "careful": Preset(0.27, 0.5, 4.0, 1.5, 0.75),
    "usual": Preset(0.5, 0.8, 8.0, 3.0, 1.0),
    "race": Preset(0.8, 1.1, 14.0, 5.0, 1.25),
}


def thrust_to_weight(model: Vehicle) -> float:
    """In air at rest, every rotor at its fastest."""
    still, fastest = np.zeros((1, 3)), np.full((1, len(model.spin)), model.limits.rotor_speed_max_rad_s)
    force, _ = wrench(model, still, still, fastest)
    return float(force[0, 2]) / (model.mass_kg * model.gravity_m_s2)


def limits(model: Vehicle, name: str) -> Limits:
    """Those of a preset for this vehicle.

    Raises:
        InputError: there is no such preset, or the rotors do not lift the vehicle.
    """
    if name not in PRESETS:
        raise InputError(f"there are no limits {name!r}; there are {', '.join(PRESETS)}")
    preset, ratio = PRESETS[name], thrust_to_weight(model)
    if ratio <= 1.0:
        raise InputError(
            f"{model.name} lifts {ratio:.2f} of its weight at its fastest rotor speed, "
            f"{model.limits.rotor_speed_max_rad_s:.0f} rad/s; check limits.rotor_speed_max_rad_s, mass and thrust"
        )
    beyond = preset.thrust_share * (ratio - 1.0)
    tilt_rad = min(preset.tilt_rad, float(np.arccos(1.0 / (1.0 + beyond))))
    acceleration_m_s2 = model.gravity_m_s2 * min(float(np.tan(tilt_rad)), beyond)
    rate_rad_s, yaw_rate_rad_s = _turn_rates(model, preset)
    return replace(
        model.limits,
        speed_m_s=_short(preset.braking_s * acceleration_m_s2),
        acceleration_m_s2=_short(acceleration_m_s2),
        tilt_rad=_short(tilt_rad),
        rate_rad_s=_short(rate_rad_s),
        yaw_rate_rad_s=_short(yaw_rate_rad_s),
    )


def _turn_rates(model: Vehicle, preset: Preset) -> tuple[float, float]:
    """Of roll or pitch, and of yaw."""
    full: Sequence[float] = model.provenance.get(FULL_STICK, (np.inf, np.inf, np.inf))
    roll_pitch, yaw = RATE_SHARE * min(full[:2]), RATE_SHARE * full[2]
    return min(preset.rate_rad_s, roll_pitch), min(preset.yaw_rate_rad_s, yaw)


def _short(value: float) -> float:
    """To two digits: no limit is known better."""
    return float(f"{value:.2g}")
