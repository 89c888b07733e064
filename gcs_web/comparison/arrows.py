"""What the model leaves unexplained at a moment, as arrows at the vehicle: residual force and torque, world axes."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from flight import FloatArray, rotations
from gcs_web.protocol.comparison import ArrowScale

LONGEST_M = 1.0
"""About the length of the arrow of a large residual; few are longer."""


@dataclass(frozen=True, slots=True, eq=False)
class Wrench:
    """Measured less modelled force and torque over a flight."""

    time_s: FloatArray
    """(m,) shifted, as in plots."""
    residual: FloatArray
    """(m, 6) N and N m, body axes; NaN in each gap."""


def scale(wrenches: Iterable[Wrench]) -> ArrowScale | None:
    """One for all flights: the 99th percentile of each is at most `LONGEST_M` long; None where nothing is known."""
    every = [wrench.residual[np.isfinite(wrench.residual).all(axis=1)] for wrench in wrenches]
    known = np.concatenate([np.zeros((0, 6)), *every])
    if not len(known):
        return None
    force, torque = (np.quantile(np.linalg.norm(known[:, part], axis=1), 0.99) for part in _PARTS)
    return ArrowScale(_nice(force / LONGEST_M), _nice(torque / LONGEST_M))


def at(wrench: Wrench, time_s: float, q_world_body: FloatArray, shown: ArrowScale) -> FloatArray | None:
    """(2, 3) force and torque at a moment as arrows of the world, m; None in a gap and outside the flight."""
    body = [np.interp(time_s, wrench.time_s, values, left=np.nan, right=np.nan) for values in wrench.residual.T]
    if not (np.isfinite(body).all() and np.isfinite(q_world_body).all()):
        return None
    force, torque = (rotations.rotate(q_world_body, np.array(body)[part]) for part in _PARTS)
    return np.stack([force / shown.force_n_per_m, torque / shown.torque_n_m_per_m])


_PARTS = (slice(0, 3), slice(3, 6))


def _nice(value: float) -> float:
    """The next of 1, 2, 5 times a power of ten that is not below."""
    power = 10.0 ** np.floor(np.log10(max(value, 1e-9)))
    return float(next(step * power for step in (1.0, 2.0, 5.0, 10.0) if step * power >= value * (1.0 - 1e-9)))
