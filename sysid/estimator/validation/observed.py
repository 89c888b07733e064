"""What the vehicle's disturbance observer measured, to stand beside what a model leaves unexplained.

The observer subtracts the rotors and the drag of the model that the vehicle was flown with from its specific force and
angular acceleration, and passes two equal low-passes: by its default cut-offs the force is 53 ms late, the torque 32.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flight import FlightLog, rotations
from flight.rotations import FloatArray

FORCE, TORQUE, STATE = "disturbance_force_world_n", "disturbance_torque_body_n_m", "observer_state"
FORCE_STD, TORQUE_STD = "disturbance_force_std_n", "disturbance_torque_std_n_m"
RUNS = 2
"""Of `observer_state` (`tc_observer_state` of the controller): it estimates. Else the force is zero, or held."""
NEAR_S = 0.1
"""Between samples that are further apart nothing is said."""


@dataclass(frozen=True, slots=True, eq=False)
class Observed:
    """The samples at which the observer ran."""

    rows: NDArray[np.bool_]
    """(n,) which rows of the log."""
    time_s: FloatArray
    """(k,) on the log's clock."""
    force_world_n: FloatArray
    """(k, 3) of all that the vehicle's own model does not hold."""
    wrench_body: FloatArray
    """(k, 6) the same force and the torque, N and N m, body axes."""
    force_std_n: FloatArray
    """(k,) of one axis, by the sensors' noise."""
    torque_std_n_m: FloatArray
    """(k, 3)."""


def observed(log: FlightLog) -> Observed | None:
    """The samples at which the observer ran; None where the log has none."""
    if not all(log.has(name) for name in (FORCE, TORQUE, STATE, "q_world_body")):
        return None
    force, torque, q = log.vector(FORCE), log.vector(TORQUE), log.vector("q_world_body")
    finite = np.isfinite(np.concatenate([force, torque, q], axis=1)).all(axis=1)
    rows = finite & (log.columns[STATE] == RUNS)
    if not rows.any():
        return None
    force_body = rotations.rotate(rotations.conjugate(q[rows]), force[rows])
    unknown = np.full(len(log), np.nan)
    return Observed(
        rows,
        log.time_s[rows],
        force[rows],
        np.concatenate([force_body, torque[rows]], axis=1),
        log.columns.get(FORCE_STD, unknown)[rows],
        log.vector(TORQUE_STD)[rows] if log.has(TORQUE_STD) else np.stack([unknown] * 3, axis=1)[rows],
    )


def wrench_at(found: Observed, time_s: FloatArray) -> FloatArray:
    """(k, 6) force, N, and torque, N m, in body axes at these instants; NaN where the observer did not run."""
    after = np.searchsorted(found.time_s, time_s).clip(1, max(len(found.time_s) - 1, 1))
    if len(found.time_s) < 2:
        return np.full((len(time_s), 6), np.nan)
    apart_s = found.time_s[after] - found.time_s[after - 1]
    inside = (time_s >= found.time_s[0]) & (time_s <= found.time_s[-1]) & (apart_s <= NEAR_S)
    at = np.stack([np.interp(time_s, found.time_s, column) for column in found.wrench_body.T], axis=1)
    return np.where(inside[:, None], at, np.nan)
