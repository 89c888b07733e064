"""A vehicle file for editing by hand: every number with its source, every section with a comment."""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from flight import file_format
from vehicle import presets
from vehicle.files import AXES, FORMAT, VERSION
from vehicle.model import BODY, Vehicle
from vehicle.parameters import Limits, Parameter

_LIMITS = {
    "speed_m_s": "largest speed along the path",
    "acceleration_m_s2": "largest acceleration, gravity not included",
    "tilt_rad": "largest angle from level",
    "rate_rad_s": "largest roll or pitch rate",
    "yaw_rate_rad_s": "largest yaw rate",
    "rotor_speed_min_rad_s": "slowest a rotor may turn in flight",
    "rotor_speed_max_rad_s": "fastest a rotor reaches",
    "jerk_m_s3": "largest jerk",
}


def write(path: Path, vehicle: Vehicle, *, schema: str | None = None) -> None:
    """Write `vehicle` with comments.

    Args:
        schema: where an editor finds the JSON schema, relative to the file; None: the line is left out.
    """
    file_format.write_bytes(Path(path), text(vehicle, schema=schema).encode())


def text(vehicle: Vehicle, *, schema: str | None = None) -> str:
    """The file's text; `vehicle.load` reads it back."""
    lines = [] if schema is None else [f"#:schema {schema}"]
    lines += [
        "# A vehicle of goshawk. SI units; body axes x forward, y left, z up.",
        "# Each number: value, std (standard deviation; 0 = taken as exact), unit, source (where it came from).",
        "# A source that begins with `default` or `estimated` was not measured: replace the value when you know better",
        "# (or run `goshawk identify FLIGHTS --vehicle THIS_FILE --out NEW_FILE`). Only the mass must be weighed.",
        *(f"# Note: {note}" for note in vehicle.provenance.get("notes", [])),
        "",
        f"format = {json.dumps(FORMAT)}",
        f"version = {VERSION}",
        f"name = {_quoted(vehicle.name)}",
        f"gravity_m_s2 = {vehicle.gravity_m_s2!r}  # where it flies; 9.780 at the equator, 9.832 at the poles",
        "",
        "# The laws the model is made of, in the order in which they act; `goshawk vehicle effect add` adds one.",
        f"effects = [{', '.join(json.dumps(name) for name in vehicle.effects)}]",
        "",
        *_rotors(vehicle),
        "",
        "[body]",
    ]
    shown = [s.name for s in BODY if not s.name.startswith("pose_sensor")]
    lines += [_entry(name, vehicle.parameters[name]) for name in shown]
    lines += ["# Where the pose sensor (markers, camera) is, from the centre of mass, and how it is turned:"]
    lines += [_entry(s.name, vehicle.parameters[s.name]) for s in BODY if s.name not in shown]
    for name in vehicle.effects:
        effect = vehicle.effect(name)
        lines += ["", f"# {effect.law}", f"[effect.{name}]"]
        lines += [_entry(s.name, vehicle.parameters[f"{name}.{s.name}"]) for s in effect.parameters]
    lines += [
        "",
        "# What the planner may ask of the vehicle; `goshawk vehicle set THIS_FILE limits=usual` fits all of them.",
    ]
    lines += ["[limits]", *_limits(vehicle.limits)]
    lines += ["", "[provenance]", f"made_by = {_quoted(str(vehicle.provenance.get('made_by', 'goshawk')))}"]
    notes = vehicle.provenance.get("notes", [])
    lines += [f"notes = [{', '.join(_quoted(note) for note in notes)}]"]
    if presets.FULL_STICK in vehicle.provenance:
        lines += [f"{presets.FULL_STICK} = {[float(rate) for rate in vehicle.provenance[presets.FULL_STICK]]}"]
    lines += [""]
    return "\n".join(lines)


def _rotors(vehicle: Vehicle) -> list[str]:
    rows = ",\n".join(f"  [{', '.join(f'{v:g}' if v else '0.0' for v in hub)}]" for hub in _floats(vehicle.hub_body_m))
    named = ", ".join(places(vehicle.hub_body_m))
    lines = [
        f"# Rotors 0 to {vehicle.rotors - 1} ({named}): a log's rotor speeds come in this order.",
        "# Position in metres from the centre of mass; spin 1 turns counter-clockwise seen from above, -1 clockwise.",
        "[rotors]",
        f"position_body_m = [\n{rows},\n]",
        f"spin = [{', '.join(str(int(s)) for s in vehicle.spin)}]",
    ]
    if vehicle.axis_body is None:
        return lines
    axes = ",\n".join(f"  [{', '.join(repr(float(v)) for v in axis)}]" for axis in vehicle.axis_body)
    return [*lines, "# Unit vectors along which they thrust.", f"{AXES} = [\n{axes},\n]"]


def _floats(array: np.ndarray) -> Sequence[Sequence[float]]:
    return [[float(f"{v:.6g}") for v in row] for row in array]


def places(hub_body_m: np.ndarray) -> list[str]:
    """Of each hub (r, 3) its place; of more than four with the angle clockwise from ahead, one above another told."""
    if len(hub_body_m) == 4:
        return [place(hub) for hub in hub_body_m]
    return [_exact_place(hub, hub_body_m) for hub in hub_body_m]


def _exact_place(hub: np.ndarray, hub_body_m: np.ndarray) -> str:
    words = place(hub)
    if words != "middle":
        words += f" {round(float(np.degrees(np.arctan2(-hub[1], hub[0]))), 1) + 0.0:g}°"
    same = np.hypot(*(hub_body_m[:, :2] - hub[:2]).T) < 1e-3
    above = hub[2] - float(hub_body_m[same, 2].mean())
    return words if abs(above) < 1e-6 else f"{words} {'above' if above > 0.0 else 'below'}"


def place(hub: np.ndarray) -> str:
    """`front left`, `rear`, ... of a hub."""
    near = 0.1 * float(np.hypot(hub[0], hub[1]))
    along = "front" if hub[0] > near else "rear" if hub[0] < -near else ""
    across = "left" if hub[1] > near else "right" if hub[1] < -near else ""
    return " ".join(word for word in (along, across) if word) or "middle"


def _entry(name: str, p: Parameter) -> str:
    facts = (
        f"value = {float(p.value)!r}, std = {float(p.std)!r}, unit = {_quoted(p.unit)}, source = {_quoted(p.source)}"
    )
    return f"{name} = {{ {facts} }}"


def _limits(limits: Limits) -> list[str]:
    return [f"{name} = {float(value)!r}  # {_LIMITS[name]}" for name, value in limits.as_dict().items()]


def _quoted(text: str) -> str:
    """A TOML basic string: JSON's escapes are a subset of TOML's, but for the character DEL."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
