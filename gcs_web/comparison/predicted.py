"""Where the model predicts a vehicle: its measured pose, moved and turned by what its prediction is off."""

import numpy as np

from flight import FloatArray, rotations
from sysid.estimator.validation.comparison import Deviation


def at(
    deviation: Deviation, time_s: float, position_world_m: FloatArray, q_world_body: FloatArray
) -> tuple[FloatArray, FloatArray] | None:
    """Predicted position (3,), m, and attitude (4,) beside the measured ones; None where nothing was predicted.

    Args:
        deviation: NaN in each gap.
        time_s: the moment, on the same clock.
    """
    off = np.array([np.interp(time_s, deviation.time_s, each, left=np.nan, right=np.nan) for each in deviation.pose.T])
    if not (np.isfinite(off).all() and np.isfinite(position_world_m).all() and np.isfinite(q_world_body).all()):
        return None
    return position_world_m + off[:3], rotations.multiply(q_world_body, rotations.exp(off[3:]))
