"""Channels and variables in words, for people who do not have our list of letters beside them."""


def channel(name: str) -> str:
    """`M_z` as `torque about z`."""
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
        "constant": "nothing (it is always there)",
        "speed": "air speed",
        "voltage": "battery voltage",
    }
    return plain.get(name, name)
