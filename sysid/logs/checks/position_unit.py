"""Are the positions in metres? Their level acceleration must be what the tilt of the thrust axis makes of gravity."""

import numpy as np

from flight import rotations
from flight.flight_log import COLUMNS
from flight.frames import GRAVITY_M_S2
from sysid.logs.checks import attitude
from sysid.logs.checks.finding import Finding, error
from sysid.logs.checks.motion import Kinematics
from sysid.logs.events.repair import Repair

UNITS = {"millimetres": 1000.0, "centimetres": 100.0}
WITHIN = 1.5
"""The acceleration is within this factor of a unit's; drag and wind are fitted along."""
MOST_APART_RAD = np.deg2rad(10.0)
"""Between thrust axis and acceleration after the change of unit (median); more, and the attitude is wrong as well."""


def check(motion: Kinematics) -> list[Finding]:
    """A unit in which acceleration and tilt agree, if it is not the metre; whatever the heading of the attitude."""
    gravity = np.array([0.0, 0.0, GRAVITY_M_S2])
    acceleration = motion.specific_force_world_m_s2 - gravity
    axis = rotations.rotate(motion.q, np.array([0.0, 0.0, 1.0]))
    for unit, factor in UNITS.items():
        force = acceleration / factor + gravity
        size = np.linalg.norm(force, axis=1, keepdims=True)
        gain, sigma = attitude.level_gain(axis * size, motion.velocity_world_m_s / factor, force)
        sure = abs(gain) > attitude.SIGMAS * sigma and 1.0 / WITHIN < abs(gain) < WITHIN
        apart = np.median(np.arccos(np.clip((axis * force / size).sum(axis=1), -1.0, 1.0)))
        if sure and apart < MOST_APART_RAD:
            sentence = f"the positions accelerate {factor * abs(gain):.0f} times as the tilt shows: they are in {unit}"
            repair = Repair("scale", COLUMNS["position_world_m"], factor=1.0 / factor)
            return [error("unit", sentence, f"divide position_world by {factor:.0f}", repair=repair)]
    return []
