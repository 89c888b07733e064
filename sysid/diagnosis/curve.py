"""From a drawn curve to an effect: a file of the user's own, to be tried at once and replaced by physics later."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from flight import FloatArray, FormatError, InputError, file_format
from flight.flight_log import MOST_ROTORS
from sysid.diagnosis.evidence.free_form import EVERY_CHANNEL, LIFT, SHOWN_BY_THRUST, THRUST, UNIT, WORLD, unit
from sysid.diagnosis.findings import OutsideFinding
from vehicle import effects

KNOTS = 9
"""Of the curve in the file; the drawn one has no more freedom than that."""
DEGREE = 3
"""Of a polynomial."""
UNSEEN = {
    "time": "what drifts with time is not known at the next flight; look for what changes (battery, temperature, load)",
    "x": "a place in the room says nothing of the vehicle; look for what stands there (a draught, a magnet, a surface)",
    "voltage": "what falls with the battery lies between command and rotor speed: see battery_sag, or log rotor speed",
    **{f"dc_{i}/dt": "rotors answer commands late: see motor_lag, or log rotor speed" for i in range(MOST_ROTORS)},
    "y": "a place in the room says nothing of the vehicle; look for what stands there (a draught, a magnet, a surface)",
}
"""Variables that a vehicle model cannot see, and where to look instead."""
PULLED = (
    "a level pull along the world's axes whatever the heading comes from the room, not from the vehicle. Look for a "
    "tether, a cable or a draught, and check that the pose's frame is level (1 deg looks like 0.17 N per kilogram)"
)
"""What to look for behind a force that is fixed in the world."""
CONSTANT = {
    **dict.fromkeys(("F_x", "F_y"), "look at how the pose sensor is turned, or for a steady wind"),
    "F_z": "weigh the vehicle again: a wrong mass has the same effect",
    **dict.fromkeys(("M_x", "M_y", "M_z"), "look for a centre of mass off the middle, or a weak or tilted rotor"),
}
"""What is always there is no curve of anything, and has names in the catalogue."""


@dataclass(frozen=True, slots=True)
class Reading:
    """How an effect reads a variable."""

    expression: str
    excited_by: str
    needs: str = ""
    before: str = ""
    """A line that the expression builds on."""


_HEADING = "turned(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))"
_PAIRS = ((0, 1), (0, 2), (1, 2))
READ = {
    "v_x": Reading("flow.velocity_m_s[0]", "fast_level"),
    "v_y": Reading("flow.velocity_m_s[1]", "fast_level"),
    "v_z": Reading("flow.velocity_m_s[2]", "vertical"),
    "w_x": Reading("flow.rate_rad_s[0]", "rotation"),
    "w_y": Reading("flow.rate_rad_s[1]", "rotation"),
    "w_z": Reading("flow.rate_rad_s[2]", "yaw_doublets"),
    "speed": Reading("length(flow.velocity_m_s)", "fast_level"),
    "n": Reading("flow.rotor_speed_rad_s", "throttle_steps"),
    "s": Reading(
        "-(flow.hub_m[:2] * flow.velocity_m_s[:2, None]).sum(axis=0) / (flow.hub_m[:2] ** 2).sum(axis=0) ** 0.5",
        "fast_level",
    ),
    "height": Reading("flow.height_m", "ground_sweep", "height_m"),
    "heading": Reading(_HEADING, "yaw_sweep", "q_world_body", "w, x, y, z = flow.q_world_body"),
}
for _i, _j in _PAIRS:
    _product = f"flow.velocity_m_s[{_i}] * flow.velocity_m_s[{_j}]"
    READ[f"v_{'xyz'[_i]} v_{'xyz'[_j]}"] = Reading(_product, "oblique")
for _i in range(MOST_ROTORS):
    _spin_up = f"flow.rotor_acceleration_rad_s2[{_i}]"
    READ[f"n_{_i}"] = Reading(f"flow.rotor_speed_rad_s[{_i}]", "throttle_steps")
    READ[f"dn_{_i}/dt"] = Reading(_spin_up, "yaw_doublets", "rotor_acceleration_rad_s2")


@dataclass(frozen=True, slots=True)
class Drawn:
    """A curve as the diagnosis drew it."""

    channel: str
    variable: str
    variable_unit: str
    at: FloatArray
    residual: FloatArray
    """Force (N), torque (N m), share of thrust, or thrust of each rotor (N)."""
    sigma: FloatArray

    @property
    def unit(self) -> str:
        return unit(self.channel)


def drawn(outside: OutsideFinding | Mapping[str, Any]) -> Drawn:
    """From a finding, or from `outside` of a diagnosis in JSON.

    Raises:
        FormatError: the JSON lacks something, or its arrays do not fit together.
    """
    facts = outside.as_dict() if isinstance(outside, OutsideFinding) else outside
    try:
        channel, variable, unit = (str(facts[key]) for key in ("channel", "variable", "variable_unit"))
        at, residual, sigma = (np.asarray(facts[key], np.float64) for key in ("at", "residual", "residual_sigma"))
        found = Drawn(channel, variable, unit, at, residual, sigma)
    except (KeyError, TypeError, ValueError) as error:
        raise FormatError(f"the diagnosis holds no usable curve: {file_format.damage_text(error)}") from None
    m = len(found.at) if found.at.ndim == 1 else 0
    if found.channel not in EVERY_CHANNEL:
        raise FormatError(f"the diagnosis names a channel {found.channel!r}; known are {', '.join(EVERY_CHANNEL)}")
    if found.variable_unit != UNIT.get(found.variable, found.variable_unit):
        raise FormatError(
            f"the diagnosis gives {found.variable} in {found.variable_unit!r}; it is in {UNIT[found.variable]!r}"
        )
    sound = m >= 4 and found.residual.shape == found.sigma.shape == (m,)
    sound = sound and bool(np.isfinite([found.at, found.residual, found.sigma]).all() and np.diff(found.at).min() > 0.0)
    if not sound:
        raise FormatError("the diagnosis holds no usable curve: at, residual and residual_sigma do not fit together")
    return found


def advice(channel: str, variable: str) -> str:
    """Where to look instead when no vehicle can know the variable, or when names exist for it; empty otherwise."""
    if channel in WORLD:
        return PULLED
    return CONSTANT[channel] if variable == "constant" else UNSEEN.get(variable, "")


def suggested_name(curve: OutsideFinding | Drawn) -> str:
    """A name for the effect that only says what was drawn: `m_z_of_v_z`."""
    variable = curve.variable.replace("/", "_").replace(" ", "_")
    return f"{curve.channel}_of_{variable}".lower()


def scaffold(
    outside: OutsideFinding | Mapping[str, Any],
    path: str | Path,
    *,
    name: str,
    form: Literal["spline", "polynomial"] = "spline",
) -> Path:
    """Write an effect file that adds the drawn curve, times a `scale` that an identification estimates anew.

    Outside the range that was flown the curve keeps the value of its end.

    Returns:
        The file, absolute. Try it with `vehicle.with_effect_file(path)`.

    Raises:
        InputError: the file is there already, the name is taken or no name, or no vehicle can know the variable.
        FormatError: there is no usable curve.
    """
    file, curve = Path(path).resolve(), drawn(outside)
    check(file, curve.channel, curve.variable, name)
    text = _text(curve, name, *(_polynomial(curve) if form == "polynomial" else _spline(curve)))
    file_format.write_bytes(file, text.encode())
    return file


def check(file: Path, channel: str, variable: str, name: str) -> None:
    """Whether an effect of this name can be made of a curve or an equation, and written to this file.

    Raises:
        InputError: the file is there already, the name is taken or no name, or no vehicle can know the variable.
        FormatError: there is no such variable.
    """
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name):
        raise InputError(
            f"{name!r} cannot name an effect; use small letters, digits and _, such as turning_when_climbing"
        )
    if name in effects.catalogue():
        raise InputError(f"the name {name!r} is taken by the catalogue; choose another")
    if file.suffix != ".py":
        raise InputError(f"an effect is a Python file; {file.name} does not end in .py")
    if file.exists():
        raise InputError(f"{file} exists already and is not overwritten; choose another file, or remove it")
    if variable in UNSEEN or channel in WORLD:
        raise InputError(f"{channel} against {variable} cannot become an effect: {advice(channel, variable)}")
    if variable == "constant":
        raise InputError(f"{channel} is off by a constant; {advice(channel, variable)}")
    if variable not in READ:
        raise FormatError(f"the diagnosis names a variable {variable!r}; known are {', '.join(READ)}")


def _spline(curve: Drawn) -> tuple[str, str, str]:
    """Data, the function, and the form in words."""
    from scipy.interpolate import CubicSpline

    knots = np.linspace(curve.at[0], curve.at[-1], KNOTS)
    spline = CubicSpline(curve.at, curve.residual)
    values, slopes = spline(knots), spline(knots, 1)
    data = "\n".join(
        [
            f"AT = np.array({_numbers(knots)})  # {curve.variable_unit}",
            f"VALUE = np.array({_numbers(values)})  # {curve.unit}",
            f"SLOPE = np.array({_numbers(slopes)})",
        ]
    )
    function = '''def curve(x: Array) -> Array:
    """Cubic between the knots; beyond them the value of the last one."""
    x = clipped(x, AT[0], AT[-1])
    i = np.clip(np.searchsorted(AT, np.real(x)) - 1, 0, len(AT) - 2)
    h = AT[i + 1] - AT[i]
    t = (x - AT[i]) / h
    rise, bulge_0, bulge_1 = t * t * (3.0 - 2.0 * t), t * (1.0 - t) ** 2, t * t * (t - 1.0)
    return VALUE[i] + rise * (VALUE[i + 1] - VALUE[i]) + h * (bulge_0 * SLOPE[i] + bulge_1 * SLOPE[i + 1])'''
    return data, function, "a spline"


def _polynomial(curve: Drawn) -> tuple[str, str, str]:
    middle, half = 0.5 * (curve.at[0] + curve.at[-1]), 0.5 * (curve.at[-1] - curve.at[0])
    weights = 1.0 / np.maximum(curve.sigma, 1e-3 * curve.sigma.max() + 1e-30)
    c = np.polynomial.polynomial.polyfit((curve.at - middle) / half, curve.residual, DEGREE, w=weights)
    data = "\n".join(
        [
            f"LOW, HIGH = {curve.at[0]:.6g}, {curve.at[-1]:.6g}  # {curve.variable_unit}",
            f"COEFFICIENTS = {_numbers(c)}  # {curve.unit}, of powers of s = -1 ... 1 from LOW to HIGH",
        ]
    )
    function = '''def curve(x: Array) -> Array:
    """A polynomial from LOW to HIGH; beyond them the value of that end."""
    s = (2.0 * clipped(x, LOW, HIGH) - (HIGH + LOW)) / (HIGH - LOW)
    return sum(c * s**k for k, c in enumerate(COEFFICIENTS))'''
    return data, function, "a polynomial"


TURNED = '''

def turned(sine: Array, cosine: Array) -> Array:
    """Angle of a direction, which keeps a complex step where arctan2 would not."""
    a = np.arctan2(np.real(sine), np.real(cosine))
    s, c = np.sin(a), np.cos(a)
    return a + np.arctan((sine * c - cosine * s) / (cosine * c + sine * s))'''


def _text(curve: Drawn, name: str, data: str, function: str, form: str) -> str:
    """The whole file."""
    change, stage, channel = changes(curve.channel)
    read = READ[curve.variable]
    assignments = [f"assert flow.{read.needs} is not None"] if read.needs else []
    assignments += [read.before] if read.before else []
    lines = "\n".join(f"    {line}" for line in [*assignments, f"{change} p.scale * curve({read.expression})"])
    functions = function + (TURNED if curve.variable == "heading" else "")
    numpy = "import numpy as np\n\n" if "np." in data + functions else ""
    length = ", length" if curve.variable == "speed" else ""
    needs = f'\n    needs=("{read.needs}",),' if read.needs else ""
    return f'''"""{name}: {curve.channel} against {curve.variable}, as `goshawk diagnose` drew it.

Flown from {curve.at[0]:.3g} to {curve.at[-1]:.3g} {curve.variable_unit}. This is what was measured, not why: when you
know why, put the law of physics in place of the curve.
"""

{numpy}from vehicle.effects.base import Array, Effect, Flow, Spec, Stage, Values, clipped{length}

{data}


{functions}


def apply(flow: Flow, p: Values) -> None:
{lines}


EFFECT = Effect(
    name="{name}",
    number=0,
    stage=Stage.{stage},
    apply=apply,
    parameters=(Spec("scale", "1", prior=1.0, bounds=(-20.0, 20.0), default=1.0, planted=1.0),),  # 0: no effect
    law="{curve.channel} = s f({curve.variable}), f {form} drawn through flights",
    source="drawn by goshawk diagnose",
    channel="{channel}",
    regressor="{curve.variable}",
    excited_by=("{read.excited_by}",),{needs}
)
'''


def changes(channel: str) -> tuple[str, str, str]:
    """What a curve in a channel is added to, at which stage, and the channels of the body that it shows in."""
    if channel == THRUST:
        return "flow.thrust_n += flow.thrust_n *", "THRUST_FACTOR", " ".join(SHOWN_BY_THRUST)
    if channel == LIFT:
        return "flow.thrust_n +=", "THRUST", " ".join(SHOWN_BY_THRUST)
    if channel[0] == THRUST:
        return (
            f"flow.thrust_n[{channel[2]}] += flow.thrust_n[{channel[2]}] *",
            "THRUST_FACTOR",
            " ".join(SHOWN_BY_THRUST),
        )
    target = "force_n" if channel[0] == "F" else "torque_n_m"
    return f"flow.{target}[{'xyz'.index(channel[2])}] +=", "FORCE", channel


def _numbers(values: FloatArray) -> str:
    return "[" + ", ".join(f"{v:.6g}" for v in values) + "]"
