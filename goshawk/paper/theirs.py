"""What is known here of Rigter et al. (2019): every number of theirs that this package shows, and no other.

The paper itself is not part of this system. What none of our sources states is said to be not known.
"""

import re
from dataclasses import dataclass

import vehicle
from vehicle import Vehicle

TITLE = (
    "M. Rigter et al., An Autonomous Quadrotor System for Robust High-Speed Flight Through Cluttered Environments "
    "Without GPS, IROS 2019"
)
NOT_KNOWN = "not known here"
TABLE = "Table I"
_PRINTED = f"Rigter et al. 2019, {TABLE}"
_CAD = re.compile(r"CAD: ([0-9.e-]+)")
FIGURES = {
    "Fig. 7": NOT_KNOWN,
    "Fig. 8": f"each parameter over repeated trials, in three stages; its values are {NOT_KNOWN}",
    "Fig. 9": NOT_KNOWN,
    "Fig. 10": NOT_KNOWN,
    "Fig. 11": NOT_KNOWN,
}
"""What each shows. Tracking errors of theirs are known, but not in which figure they stand."""
LEVEL_CM, VERTICAL_CM = (10.5, 6.5, 5.1), (2.76, 1.84, 1.32)
"""Mean tracking error in flight of PD with feed-forward, with drag, with drag and thrust; centimetres."""
GENERAL_CM = 4.9
"""The same of a flight on all axes with yaw; which controller is not known here."""


@dataclass(frozen=True, slots=True)
class Printed:
    """A row of Table I, in SI."""

    name: str
    value: float
    unit: str
    cad: float | None
    """What their drawing gives; None where it is not known."""


def drone() -> Vehicle:
    """Their vehicle, as Table I has it."""
    return vehicle.example("rigter2019")


def table() -> tuple[Printed, ...]:
    """Of Table I, what acts on the motion."""
    found = []
    for name, parameter in drone().parameters.items():
        if parameter.source.startswith(_PRINTED):
            cad = _CAD.search(parameter.source)
            found.append(Printed(name, parameter.value, parameter.unit, float(cad[1]) if cad else None))
    return tuple(found)
