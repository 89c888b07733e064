"""What lasted in the measured disturbance, in sentences, and the values that would make the vehicle file agree."""

import contextlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from flight import FloatArray, InfeasibleError
from sysid.estimator.validation.steady import (
    SEEN_OFFSET_M,
    SEEN_WEIGHT,
    SEEN_WIND_M_S,
    SIGMA90,
    SIGMAS,
    Known,
    Steady,
)
from vehicle import Vehicle, invert, rigid_body, wrench
from vehicle.forces import open_air

SEEN_FORCE = 0.02
"""Of the weight: a smaller lasting force is not told where no wind is."""
SEEN_DRAG = 0.01
"""Of the weight for each m/s: less is what the observer's delay makes. Below 1 m/s the force itself must show."""
SLOWEST_M_S = 1e-3
THRUST = {"thrust_bem": ("k1_n_s2", "k2_n_s2_m"), "thrust_quadratic": ("k_n_s2",)}
"""Laws whose thrust grows with all of these parameters alike."""
CENTRE = "centre_of_mass"
SOLVES = 20
"""Steps of a fixed point; each leaves a tenth of the error or less."""


@dataclass(frozen=True, slots=True)
class Lasting:
    """What is offered; empty where the flights show nothing of it."""

    sentences: tuple[str, ...] = ()
    changes: tuple[tuple[str, Mapping[str, float]], ...] = ()
    """In words what it would mean, and parameters of the vehicle file by name; only one of each pair is right."""


def lasting(found: Mapping[str, Steady], model: Vehicle) -> Lasting:
    """What flights, by name, say of one vehicle: weight and centre of mass of all of them, the wind of each."""
    if not found:
        return Lasting()
    said = [sentence for name, one in found.items() for sentence in _horizontal(name, one, model)]
    changes: list[tuple[str, Mapping[str, float]]] = []
    weight = _mean([one.weight for one in found.values()])
    offset = [_mean([one.offset_m[axis] for one in found.values()]) for axis in range(2)]
    weighs = Known(weight.value - 1.0, weight.std).shows(SEEN_WEIGHT)
    is_off = any(one.shows(SEEN_OFFSET_M) for one in offset)
    rotor = _weak_rotor(weight, offset, model) if weighs and is_off else None
    if rotor is not None:
        said.append(_rotor_sentence(rotor, weight, model))
        changes += _rotor_changes(rotor, weight, model)
        return Lasting(tuple(said), tuple(changes))
    if weighs:
        said += _weight_sentences(weight)
        changes += _weight_changes(weight.value, model)
    if is_off:
        said.append(_offset_sentence(offset))
        changes += _offset_changes(offset, model)
    return Lasting(tuple(said), tuple(changes))


def _weak_rotor(weight: Known, offset: Sequence[Known], model: Vehicle) -> int | None:
    """The rotor whose loss makes both the missing thrust and the torque; None where none does."""
    lost = 1.0 - 1.0 / weight.value
    if not 0.0 < model.rotors * lost < 1.0:
        return None
    arms_m = model.hub_body_m - rigid_body(model).centre_of_mass_m
    for i in range(len(arms_m)):
        expected_m = [float(arm_m) * lost for arm_m in arms_m[i, :2]]
        off = [
            abs(one.value - at) <= SIGMAS * one.std + SEEN_OFFSET_M for one, at in zip(offset, expected_m, strict=True)
        ]
        if all(off):
            return i
    return None


def _rotor_sentence(rotor: int, weight: Known, model: Vehicle) -> str:
    lost = model.rotors * (1.0 - 1.0 / weight.value)
    half = model.rotors * SIGMA90 * weight.std / weight.value**2
    return (
        f"rotor {rotor} gives {lost:.0%} less thrust than the file's (90 %: {lost - half:.1%} to {lost + half:.1%}), "
        "as a nicked propeller does: missing thrust and torque fit it together"
    )


def _rotor_changes(rotor: int, weight: Known, model: Vehicle) -> list[tuple[str, Mapping[str, float]]]:
    name = f"weak_rotor.loss_{rotor}"
    if "weak_rotor" not in model.effects:
        return []  # `goshawk vehicle effect add` fits it
    left = (1.0 - model.value(name)) * (1.0 - model.rotors * (1.0 - 1.0 / weight.value))
    return [("the propeller stays", {name: 1.0 - left})]


def _mean(parts: Sequence[Known]) -> Known:
    """By their errors; flights that disagree raise the error (Birge 1932)."""
    values, weights = np.array([p.value for p in parts]), 1.0 / np.array([max(p.std, 1e-12) for p in parts]) ** 2
    mean = float(values @ weights / weights.sum())
    scatter = float(weights @ (values - mean) ** 2) / max(len(parts) - 1, 1)
    return Known(mean, float(np.sqrt(max(1.0, scatter) / weights.sum())))


def _weight_sentences(weight: Known) -> list[str]:
    off, half = weight.value - 1.0, SIGMA90 * weight.std
    heavier, weaker = ("more", "less") if off > 0.0 else ("less", "more")
    low, high = sorted((abs(off) - half, abs(off) + half))
    return [
        f"this vehicle weighs {abs(off):.1%} {heavier} than its file (90 %: {low:.1%} to {high:.1%}), or its rotors "
        f"give {abs(1.0 - 1.0 / weight.value):.1%} {weaker} thrust",
        "no force tells mass from thrust, in hover or elsewhere: weigh the vehicle; weaker rotors also turn it less",
    ]


def _weight_changes(weight: float, model: Vehicle) -> list[tuple[str, Mapping[str, float]]]:
    mass_kg = model.mass_kg + (weight - 1.0) * rigid_body(model).mass_kg
    found: list[tuple[str, Mapping[str, float]]] = [("the mass is wrong", {"mass_kg": mass_kg})]
    for law, names in THRUST.items():
        if law in model.effects:
            with contextlib.suppress(InfeasibleError):  # a file whose rotors cannot carry it has no hover to scale
                found.append(("the thrust is", _scaled(model, [f"{law}.{name}" for name in names], 1.0 / weight)))
    return found


def _scaled(model: Vehicle, names: Sequence[str], ratio: float) -> dict[str, float]:
    """Parameters, scaled alike, with which the hover thrust is that ratio of the model's: inflow follows thrust."""
    speed_rad_s, scale, changed = invert.hover(model), 1.0, model
    whole_n = _thrust_n(model, speed_rad_s)
    for _ in range(SOLVES):
        scale *= ratio * whole_n / _thrust_n(changed, speed_rad_s)
        for name in names:
            changed = changed.with_value(name, scale * model.value(name))
    return {name: changed.value(name) for name in names}


def _thrust_n(model: Vehicle, speed_rad_s: FloatArray) -> float:
    still = np.zeros((1, 3))
    return float(wrench(model, still, still, speed_rad_s[None], open_air(1, model.rotors))[0][0, 2])


def _horizontal(name: str, one: Steady, model: Vehicle) -> list[str]:
    weight_n = rigid_body(model).mass_kg * model.gravity_m_s2
    said: list[str] = []
    if one.wind_m_s is not None and _size(one.wind_m_s).shows(SEEN_WIND_M_S):
        wind, off_deg = _size(one.wind_m_s), math.degrees(_size(one.force_n).value / weight_n)
        low, high = wind.interval90
        said.append(
            f"{name}: wind of {wind.value:.1f} m/s from {_from_deg(one.wind_m_s):.0f} deg (0: world x, 90: y; 90 %: "
            f"{low:.2f} to {high:.2f}), by the file's drag; no drag, as it keeps its direction"
        )
        alike = f"a tether or a pose frame {off_deg:.1f} deg off level would push alike"
        said.append(alike if one.turned else f"{alike}, and so would a tilted thrust axis: the heading hardly changed")
    elif _size(one.force_n).shows(SEEN_FORCE * weight_n):
        said.append(
            f"{name}: a lasting force of {_size(one.force_n).value:.2f} N from {_from_deg(one.force_n):.0f} deg "
            "(0: world x, 90: y); the file's drag does not make it a wind"
        )
    if one.drag_n_s_m.shows(SEEN_DRAG * weight_n / min(max(one.level_m_s, SLOWEST_M_S), 1.0)):
        said.append(
            f"{name}: a force of {one.drag_n_s_m.value:.2g} N for each m/s follows the velocity: drag, which "
            "`goshawk diagnose` names"
        )
    return said


def _size(both: tuple[Known, Known]) -> Known:
    x, y = both
    size = math.hypot(x.value, y.value)
    along = (x.value / size, y.value / size) if size > 0.0 else (1.0, 0.0)
    return Known(size, math.hypot(along[0] * x.std, along[1] * y.std))


def _from_deg(both: tuple[Known, Known]) -> float:
    """Where it comes from, 0 to 360."""
    return math.degrees(math.atan2(-both[1].value, -both[0].value)) % 360.0


def _offset_sentence(offset: Sequence[Known]) -> str:
    x, y = (f"{1000.0 * one.value:.1f} ± {1000.0 * SIGMA90 * one.std:.1f}" for one in offset)
    return (
        f"a torque goes with thrust: the centre of mass is x {x}, y {y} mm beside the file's, an arm bent or "
        "rotors unlike; it is no effect of flight"
    )


def _offset_changes(offset: Sequence[Known], model: Vehicle) -> list[tuple[str, Mapping[str, float]]]:
    if CENTRE not in model.effects:
        return []
    values = {
        f"{CENTRE}.{axis}_m": model.value(f"{CENTRE}.{axis}_m") + one.value
        for axis, one in zip("xy", offset, strict=True)
    }
    return [("the centre of mass is", values)]
