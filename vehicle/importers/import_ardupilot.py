"""Rotors of an ArduPilot copter's `.param` file: their order and spins; the file holds no lengths and no mass.

https://ardupilot.org/copter/docs/connect-escs-and-motors.html
"""

from pathlib import Path

import numpy as np

from flight import InputError
from vehicle import layouts
from vehicle.draft import Known
from vehicle.importers import import_px4
from vehicle.layouts import Layout

_CORNERS = {"FR": (1.0, -1.0), "RL": (-1.0, 1.0), "FL": (1.0, 1.0), "RR": (-1.0, -1.0)}
_ENDS = {"R": (0.0, -1.0), "L": (0.0, 1.0), "F": (1.0, 0.0), "B": (-1.0, 0.0)}
_FRAMES = {
    # FRAME_TYPE: places of motors 1 to 4, and their spins (+1 counter-clockwise seen from above)
    0: ("+", "R L F B", (1, 1, -1, -1)),
    1: ("X", "FR RL FL RR", (1, 1, -1, -1)),
    3: ("H", "FR RL FL RR", (-1, -1, 1, 1)),
    12: ("BetaFlight X", "RR FR RL FL", (-1, 1, 1, -1)),
    13: ("DJI X", "FR FL RL RR", (1, -1, 1, -1)),
    14: ("clockwise X", "FR RR RL FL", (1, -1, 1, -1)),
    18: ("BetaFlight X reversed", "RR FR RL FL", (1, -1, -1, 1)),
}


_MORE = {(2, 0): "hex+", (2, 1): "hex", (3, 0): "octo+", (3, 1): "octo", (4, 1): "x8"}
"""FRAME_CLASS and FRAME_TYPE of more than four rotors, and the name of the layout."""


def _of_more(path: Path, layout: Layout) -> Known:
    hubs, spin = layout.geometry(1.0)
    note = f"rotors 0 to {len(spin) - 1} are {layout.words} of {path.name}"
    return Known(hub_body_m=hubs, spin=spin, arm_known=False, notes=(note,))


def is_ardupilot(path: Path) -> bool:
    """Whether it holds ArduPilot's parameters (in place of PX4's)."""
    return "FRAME_CLASS" in import_px4.parameters(path)


def read(path: Path) -> Known:
    """Order and spins of the motors; places on arms of 1 m, to be scaled by `--arm`.

    Raises:
        InputError: it has another number of rotors, or its frame is not known.
        FormatError: it holds no parameters.
    """
    values = import_px4.parameters(path)
    kind = int(values.get("FRAME_TYPE", 1.0))
    if (found := _MORE.get((int(values.get("FRAME_CLASS", 0.0)), kind))) is not None:
        return _of_more(Path(path), layouts.find(found, "ardupilot"))
    if int(values.get("FRAME_CLASS", 0.0)) != 1:
        raise InputError(
            f"{path} has FRAME_CLASS = {values.get('FRAME_CLASS', 0):g} and FRAME_TYPE = {kind}; quadrotors (1), "
            "hexarotors (2) and octorotors (3) of FRAME_TYPE 0 or 1, and OctaQuad X (4, 1) can be modelled"
        )
    if kind not in _FRAMES:
        known = ", ".join(f"{number} ({frame[0]})" for number, frame in _FRAMES.items())
        raise InputError(f"{path} has FRAME_TYPE = {kind}; known are {known}: give --arm and --frame without --import")
    name, order, spin = _FRAMES[kind]
    places = np.array([{**_CORNERS, **_ENDS}[place] for place in order.split()])
    hubs = np.column_stack([places / np.hypot(places[:, :1], places[:, 1:]), np.zeros(4)])
    note = f"rotors 0 to 3 are ArduPilot's motors 1 to 4 of {Path(path).name}, frame {name}: {order.replace(' ', ', ')}"
    return Known(hub_body_m=hubs, spin=np.array(spin, dtype=np.float64), arm_known=False, notes=(note,))
