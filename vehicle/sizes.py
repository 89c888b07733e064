"""How large an effect usually is on this vehicle: the catalogue's sizes, carried over from a reference vehicle.

The catalogue gives sizes as a quadrotor of 0.7 kg has them. A nano quadrotor has a twentieth of the mass, a third of
the arm and twice the rotor speed; what is usual there follows by similarity: the same share of the weight, of weight
times arm, of the tip speed, or of a force in air of the same density, as each parameter's `scaling` says.
"""

import numpy as np

from vehicle.effects.base import Spec
from vehicle.model import Vehicle

REFERENCE = (0.70, 0.125, 950.0)
"""Mass (kg), arm (m) and hover rotor speed (rad/s) of the quadrotor of Rigter et al., which the catalogue describes."""


def usual(spec: Spec, vehicle: Vehicle, hover_rad_s: float) -> float:
    """Usual size of a parameter on a vehicle, in the parameter's unit.

    Args:
        hover_rad_s: rotor speed at hover, or the root mean square of a flight.
    """
    arm_m = float(np.linalg.norm(vehicle.hub_body_m[:, :2], axis=1).mean())
    ratios = np.array([vehicle.mass_kg, arm_m, hover_rad_s]) / REFERENCE
    return spec.prior * float(np.prod(ratios ** np.array(spec.scaling)))
