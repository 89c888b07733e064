"""Where the model predicts the vehicle: its measured pose, moved and turned by what the comparison's prediction was off."""

from dataclasses import dataclass

import numpy as np

from flight import FloatArray, rotations


@dataclass(frozen=True, slots=True, eq=False)
class Deviation:
    """Predicted less measured pose over a flight, each predicted from the motion 0.5 s earlier."""

    time_s: FloatArray
    """(m,) shifted, as in plots."""
    pose: FloatArray
    """(m, 6) position, m, world axes, and rotation vector from measured to predicted, rad, body; NaN in each gap."""


def at(
    deviation: Deviation, time_s: float, position_world_m: FloatArray, q_world_body: FloatArray
) -> tuple[FloatArray, FloatArray] | None:
    """Predicted position (3,) and attitude (4,) at a moment beside the measured ones; None where nothing was predicted."""
    off = np.array(
        [np.interp(time_s, deviation.time_s, each, left=np.nan, right=np.nan) for each in deviation.pose.T]
    )
    if not (np.isfinite(off).all() and np.isfinite(position_world_m).all() and np.isfinite(q_world_body).all()):
        return None
    return position_world_m + off[:3], rotations.multiply(q_world_body, rotations.exp(off[3:]))
