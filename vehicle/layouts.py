"""Where the rotors of usual frames sit and how they turn, in our own order and in those of three firmwares.

Places are angles clockwise from ahead, seen from above, in degrees. Betaflight's are those of its mixers (the sign of
the yaw column is the spin), ArduPilot's those of its motor matrices; PX4's generic airframes number motors alike.
"""

from dataclasses import dataclass

import numpy as np

from flight import FloatArray, InputError

_CW, _CCW = -1, 1
COAXIAL_Z = 0.1
"""Half the distance between the two rotors at the end of a coaxial arm, as a share of the arm."""


@dataclass(frozen=True, slots=True)
class Layout:
    """Rotors on arms of one length."""

    words: str
    """The order, for the reader of a vehicle file."""
    rotors: tuple[tuple[float, int, int], ...]
    """Angle, spin (+1 counter-clockwise seen from above), and 1, -1 or 0: above, below or in the plane of the hubs."""

    def geometry(self, arm_m: float) -> tuple[FloatArray, FloatArray]:
        """Hubs (r, 3) and spins (r,)."""
        angle, spin, level = np.array(self.rotors, dtype=np.float64).T
        left = -np.radians(angle)
        hubs = arm_m * np.stack([np.cos(left), np.sin(left), COAXIAL_Z * level], axis=1)
        return np.round(hubs, 6) + 0.0, spin + 0.0


def _ring(first: float, count: int, words: str) -> Layout:
    """Counter-clockwise from the first, which turns clockwise; neighbours turn opposite ways."""
    step = 360.0 / count
    return Layout(words, tuple((first - step * i, _CCW if i % 2 else _CW, 0) for i in range(count)))


def _coaxial(angles: tuple[float, ...], upper: tuple[int, ...], words: str) -> Layout:
    above = tuple((angle, spin, 1) for angle, spin in zip(angles, upper, strict=True))
    return Layout(words, (*above, *((angle, -spin, -1) for angle, spin, _ in above)))


OWN = {
    "x": _ring(
        -45.0, 4, "front left (clockwise unless --props-out), rear left, rear right, front right, neighbours opposite"
    ),
    "+": _ring(0.0, 4, "front (clockwise unless --props-out), left, rear, right, neighbours opposite"),
    "hex": _ring(-30.0, 6, "front left (clockwise unless --props-out) and on to the left, neighbours opposite"),
    "hex+": _ring(0.0, 6, "front (clockwise unless --props-out) and on to the left, neighbours opposite"),
    "octo": _ring(-22.5, 8, "front left (clockwise unless --props-out) and on to the left, neighbours opposite"),
    "octo+": _ring(0.0, 8, "front (clockwise unless --props-out) and on to the left, neighbours opposite"),
    "y6": _coaxial(
        (-60.0, 180.0, 60.0), (_CW, _CCW, _CW),
        "above: front left (clockwise), rear (the other way), front right (clockwise); below opposite",
    ),
    "x8": _coaxial(
        (-45.0, -135.0, 135.0, 45.0), (_CW, _CCW, _CW, _CCW),
        "above: front left (clockwise), rear left, rear right, front right, neighbours opposite; below opposite",
    ),
}  # fmt: skip
"""By the name that `--frame` takes."""


def _listed(words: str, *rotors: tuple[float, int]) -> Layout:
    return Layout(words, tuple((angle, spin, 0) for angle, spin in rotors))


_ARDUPILOT = {
    "x": _listed("ArduPilot's motors of Quad X", (45, _CCW), (-135, _CCW), (-45, _CW), (135, _CW)),
    "+": _listed("ArduPilot's motors of Quad plus", (90, _CCW), (-90, _CCW), (0, _CW), (180, _CW)),
    "hex": _listed(
        "ArduPilot's motors of Hexa X",
        (90, _CW), (-90, _CCW), (-30, _CW), (150, _CCW), (30, _CCW), (-150, _CW),
    ),
    "hex+": _listed(
        "ArduPilot's motors of Hexa plus",
        (0, _CW), (180, _CCW), (-120, _CW), (60, _CCW), (-60, _CCW), (120, _CW),
    ),
    "octo": _listed(
        "ArduPilot's motors of Octo X",
        (22.5, _CW), (-157.5, _CW), (67.5, _CCW), (157.5, _CCW), (-22.5, _CCW), (-112.5, _CCW), (-67.5, _CW),
        (112.5, _CW),
    ),
    "octo+": _listed(
        "ArduPilot's motors of Octo plus",
        (0, _CW), (180, _CW), (45, _CCW), (135, _CCW), (-45, _CCW), (-135, _CCW), (-90, _CW), (90, _CW),
    ),
    "x8": Layout(
        "ArduPilot's motors of OctaQuad X",
        ((45, _CCW, 1), (-45, _CW, 1), (-135, _CCW, 1), (135, _CW, 1), (-45, _CCW, -1), (45, _CW, -1),
         (135, _CCW, -1), (-135, _CW, -1)),
    ),
}  # fmt: skip
_BETAFLIGHT = {
    "x": _listed("Betaflight's motors of QUADX", (135, _CW), (45, _CCW), (-135, _CCW), (-45, _CW)),
    "+": _listed("Betaflight's motors of QUADP", (180, _CW), (90, _CCW), (-90, _CCW), (0, _CW)),
    "hex": _listed(
        "Betaflight's motors of HEX6X",
        (150, _CCW), (30, _CCW), (-150, _CW), (-30, _CW), (90, _CW), (-90, _CCW),
    ),
    "hex+": _listed(
        "Betaflight's motors of HEX6",
        (120, _CCW), (60, _CW), (-120, _CCW), (-60, _CW), (0, _CCW), (180, _CW),
    ),
    "octo": _listed(
        "Betaflight's motors of OCTOFLATX",
        (-67.5, _CCW), (22.5, _CCW), (112.5, _CCW), (-157.5, _CCW), (-22.5, _CW), (67.5, _CW), (157.5, _CW),
        (-112.5, _CW),
    ),
    "octo+": _listed(
        "Betaflight's motors of OCTOFLATP",
        (-45, _CCW), (45, _CCW), (135, _CCW), (-135, _CCW), (0, _CW), (90, _CW), (180, _CW), (-90, _CW),
    ),
    "y6": _coaxial((180, 60, -60), (_CCW, _CW, _CW), "Betaflight's motors of Y6"),
    "x8": _coaxial((135, 45, -135, -45), (_CW, _CCW, _CCW, _CW), "Betaflight's motors of OCTOX8"),
}  # fmt: skip
FIRMWARES = {"ardupilot": _ARDUPILOT, "betaflight": _BETAFLIGHT, "px4": _ARDUPILOT}
"""By firmware, then frame."""
FRAMES = tuple(OWN)


def find(frame: str, firmware: str | None = None) -> Layout:
    """A frame in our own order, or in that of a firmware's motors.

    Raises:
        InputError: there is no such frame, or the firmware's order of it is not known here.
    """
    known = OWN if firmware is None else FIRMWARES[firmware]
    if frame not in known:
        order = f" in the order of {firmware}" if firmware else ""
        raise InputError(f"frame {frame!r} is not known{order}; there are {', '.join(known)}")
    return known[frame]
