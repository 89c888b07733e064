"""Channels and variables in words, for people who do not have our list of letters beside them."""

import re
from collections.abc import Iterable


def channel(name: str) -> str:
    """`M_z` as `torque about z`, `T_2` as `thrust of rotor 2`, `L` as `lift of every rotor`."""
    if name == "L":
        return "lift of every rotor"
    if name[0] == "T":
        return f"thrust of rotor {name[2]}" if name[1:] else "thrust of every rotor"
    frame = " of the world" if name.endswith("_world") else ""
    return f"{'force along' if name[0] == 'F' else 'torque about'} {name[2]}{frame}"


def variable(name: str) -> str:
    """`v_z` as `velocity along z`."""
    if " " in name:
        first, second = (part[2] for part in name.split())
        return f"product of the velocities along {first} and {second}"
    if name.startswith("v_"):
        return f"velocity along {name[2]}"
    if name.startswith("w_"):
        return f"rate about {name[2]}"
    if name.startswith("n_"):
        return f"speed of rotor {name[2]}"
    if name.startswith("dc_"):
        return f"rate of the command of rotor {name[3]}"
    if name.startswith("dn_"):
        return f"acceleration of rotor {name[3]}"
    plain = {
        "x": "place along x",
        "y": "place along y",
        "n": "its speed",
        "s": "the speed of the wake towards it",
        "constant": "nothing (it is always there)",
        "speed": "air speed",
        "voltage": "battery voltage",
    }
    return plain.get(name, name)


TITLES = {
    "thrust_bem": "thrust by blade elements",
    "thrust_blade_element": "thrust by blade elements, with the advance ratio",
    "thrust_quadratic": "thrust with the square of rotor speed",
    "thrust_affine": "thrust not quite quadratic",
    "torque_affine": "rotor torque not quite quadratic",
    "inflow_linear": "thrust lost to axial air speed",
    "rotor_drag_thrust": "rotor drag with thrust",
    "rotor_drag_speed": "rotor drag with rotor speed",
    "parasitic_drag": "airframe drag per axis",
    "parasitic_drag_linear": "drag in proportion to air speed",
    "parasitic_drag_speed": "airframe drag with air speed",
    "imu_errors": "errors of the IMU",
    "pose_delay": "delay of the pose",
    "airframe_side_moment": "moment of the airframe's drag",
}
"""Effects whose code name does not read as words."""
UNITS = frozenset(["kg", "m", "m2", "m3", "s", "s2", "n", "rad", "v", "per"])
"""Words at the end of a parameter's code name that only say its unit."""


def effect(name: str) -> str:
    """`weak_rotor[2]` as `weak rotor (rotor 2)`, `pose_delay` as `delay of the pose`."""
    stem, _, index = name.rstrip("]").partition("[")
    said = TITLES.get(stem, stem.replace("_", " "))
    return f"{said} (rotor {index})" if index else said


def parameter(name: str) -> str:
    """`rotor_drag_thrust.drag_s_m` as `drag`: the unit is said beside it."""
    parts = name.split(".")[-1].split("_")
    while len(parts) > 1 and parts[-1] in UNITS:
        parts.pop()
    return " ".join(parts)


def parameter_in_full(name: str) -> str:
    """`centre_of_mass.x_m` as `centre of mass, x`; one of the vehicle's own as `parameter`."""
    stem, dot, _ = name.partition(".")
    return f"{effect(stem)}, {parameter(name)}" if dot else parameter(name)


def parameters_named(text: str, names: Iterable[str]) -> str:
    """A sentence with parameters by their names in full instead of these code names."""
    for name in sorted(set(names), key=len, reverse=True):
        text = re.sub(rf"(?<![\w.]){re.escape(name)}(?!\w|\.\w)", parameter_in_full(name), text)
    return text


def curves_named(text: str, channels: Iterable[str], variables: Iterable[str]) -> str:
    """`M_z against v_z` as `torque about z against velocity along z`, wherever a sentence says so."""
    one_of = ["|".join(map(re.escape, sorted(names, key=len, reverse=True))) for names in (channels, variables)]
    pattern = rf"(?<!\w)({one_of[0]}) against ({one_of[1]})(?!\w)"
    return re.sub(pattern, lambda curve: f"{channel(curve[1])} against {variable(curve[2])}", text)


def named(text: str, names: Iterable[str]) -> str:
    """A sentence with effects by their names instead of these code names."""
    for name in sorted(set(names), key=len, reverse=True):
        text = re.sub(rf"(?<![\w.]){re.escape(name)}(?![\w\[]|\.\w)", effect(name), text)
    return text
