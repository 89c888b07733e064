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
from typing import Any

import numpy as np

from flight import InputError
from vehicle.dynamics import wrench
from vehicle.model import Vehicle
from vehicle.parameters import Limits

_NEAR = 1.001
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


def thrust_to_weight_std(model: Vehicle) -> float:
    """Of that ratio, as the stds of mass and thrust in the file make it."""
    ratio, square = thrust_to_weight(model), 0.0
    for name, parameter in model.parameters.items():
        if not name.startswith(("thrust_", "mass_kg")) or parameter.std == 0.0 or parameter.value == 0.0:
            continue
        near = model.with_value(name, _NEAR * parameter.value)
        square += ((thrust_to_weight(near) / ratio - 1.0) / (_NEAR - 1.0) * parameter.std / parameter.value) ** 2
    return ratio * float(np.sqrt(square))


def beyond_thrust(model: Vehicle) -> list[str]:
    """A sentence for each limit that asks for more than the rotors give."""
    ratio, own = thrust_to_weight(model), model.limits
    if ratio <= 1.0:
        return [f"the rotors lift {ratio:.2f} of the weight"]
    upwards_m_s2, tilt_rad = model.gravity_m_s2 * (ratio - 1.0), float(np.arccos(1.0 / ratio))
    told = f"the rotors lift {ratio:.2f} times the weight"
    found = []
    if own.acceleration_m_s2 > upwards_m_s2:
        found.append(f"limits.acceleration_m_s2 is {own.acceleration_m_s2:g}; {told}: {upwards_m_s2:.2g} upwards")
    if own.tilt_rad > tilt_rad:
        found.append(f"limits.tilt_rad is {own.tilt_rad:g}; {told}: level flight up to {tilt_rad:.2g}")
    return found


def limits(model: Vehicle, name: str) -> Limits:
    """Those of a preset for this vehicle.

    Raises:
        InputError: there is no such preset, the rotors do not lift the vehicle, or its full stick is none.
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
    acceleration_m_s2 = _short(model.gravity_m_s2 * min(float(np.tan(tilt_rad)), beyond))
    rate_rad_s, yaw_rate_rad_s = _turn_rates(model, preset)
    return replace(
        model.limits,
        speed_m_s=_short(preset.braking_s * acceleration_m_s2),
        acceleration_m_s2=acceleration_m_s2,
        tilt_rad=_short(tilt_rad),
        rate_rad_s=_short(rate_rad_s),
        yaw_rate_rad_s=_short(yaw_rate_rad_s),
    )


def _turn_rates(model: Vehicle, preset: Preset) -> tuple[float, float]:
    """Of roll or pitch, and of yaw."""
    if FULL_STICK not in model.provenance:
        return preset.rate_rad_s, preset.yaw_rate_rad_s
    full = model.provenance[FULL_STICK]
    if not _three_rates(full):
        raise InputError(
            f"provenance.{FULL_STICK} is {full!r}; it holds three positive numbers: the firmware's roll, pitch and yaw "
            "rate at full stick, rad/s"
        )
    roll_pitch, yaw = RATE_SHARE * min(full[:2]), RATE_SHARE * full[2]
    return min(preset.rate_rad_s, roll_pitch), min(preset.yaw_rate_rad_s, yaw)


def _three_rates(full: Any) -> bool:
    if not isinstance(full, Sequence) or len(full) != 3:
        return False
    return all(type(rate) in (int, float) and 0.0 < rate < np.inf for rate in full)


def _short(value: float) -> float:
    """Down to two digits: no limit is known better, and none exceeds its share."""
    unit = 10.0 ** (np.floor(np.log10(value)) - 1.0)
    return float(f"{np.floor(value / unit * (1.0 + 1e-9)) * unit:.2g}")
