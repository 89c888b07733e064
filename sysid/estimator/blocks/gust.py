"""Gust: the dynamics of disturbances that last, a first-order Gauss-Markov process for each of force and torque."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from flight.rotations import FloatArray
from sysid.estimator.blocks import noise as levels_of
from sysid.estimator.blocks.base import At, Block, Linear
from sysid.estimator.blocks.motion import over_relaxed
from sysid.estimator.blocks.noise import Gusts, Noise
from sysid.estimator.flights.flight_data import Flight
from sysid.estimator.trajectory.states import GUST, MOTION

LEAST_SIZE = np.array([1e-3, 1e-3, 1e-3, 1e-2, 1e-2, 1e-2])
"""Floor of a disturbance's size, m/s2 and rad/s2: it keeps the equations regular."""


class Gust(Block):
    """The fresh part of the disturbance in each interval; it acts once flights were found to have disturbances."""

    name = levels_of.GUST
    order = 1
    between = True
    levels = tuple(f"gust_{what}_{axis}" for what in ("force_m_s2", "torque_rad_s2") for axis in "xyz")
    level_of_row = tuple(range(GUST))

    def measured(self, flight: Flight) -> bool:
        return True

    def residual(self, at: At) -> FloatArray:
        """In units of the disturbance's size."""
        assert at.noise.gusts is not None
        assert at.states.gust is not None
        return rows(at.noise.gusts, at.mid.step_s, at.states.gust)

    def linear(self, at: At) -> Linear:
        assert at.noise.gusts is not None
        by_shared = np.zeros((len(at.mid.step_s), GUST, 0))
        return Linear(self.residual(at), jacobians(at.noise.gusts, at.mid.step_s), by_shared, ())

    def row_levels(self, noise: Noise) -> FloatArray:
        """Its rows come whitened."""
        return np.ones(GUST)

    def updated(self, levels: FloatArray, ratio: FloatArray, flights: Sequence[Flight]) -> FloatArray:
        return np.maximum(levels * over_relaxed(ratio), LEAST_SIZE)

    def reported(self, noise: Noise) -> dict[str, Any]:
        if noise.gusts is None:
            return {"gusts": None}
        size, lasts_s = noise.gusts.size.tolist(), noise.gusts.lasts_s.tolist()
        return {"gusts": {"force_m_s2": size[:3], "torque_rad_s2": size[3:], "lasts_s": lasts_s}}


def rows(gusts: Gusts, step_s: FloatArray, gust: FloatArray) -> FloatArray:
    """(k, 6) whitened fresh part of the disturbance over each interval."""
    keeps = gusts.keeps(step_s)
    return (gust[1:] - keeps * gust[:-1]) / (gusts.size * np.sqrt(1.0 - keeps**2))


def jacobians(gusts: Gusts, step_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Derivatives of `rows` by the states before and after, (k, 6, s) each."""
    keeps = gusts.keeps(step_s)
    fresh = gusts.size * np.sqrt(1.0 - keeps**2)
    before, after = np.zeros((2, len(step_s), 6, MOTION + GUST))
    i = np.arange(GUST)
    before[:, i, MOTION + i], after[:, i, MOTION + i] = -keeps / fresh, 1.0 / fresh
    return before, after


BLOCK = Gust()
