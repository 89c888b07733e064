"""How large the random errors are: a noise level per block and channel, and how long disturbances last."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from flight.rotations import FloatArray

MOTION, GUST = "motion", "gust"
"""Blocks whose levels are asked for by what they mean."""


@dataclass(frozen=True, slots=True)
class Gusts:
    """How large disturbances are and how long they last: force per mass in world axes, turning in body axes."""

    size: FloatArray
    """(6,) standard deviations: m/s2 (3), rad/s2 (3)."""
    lasts_s: FloatArray
    """(6,) correlation times."""

    def keeps(self, step_s: FloatArray) -> FloatArray:
        """(k, 6) share of a disturbance that is left after each interval; `step_s` is (k, 1)."""
        return np.exp(-step_s / self.lasts_s)


@dataclass(frozen=True, slots=True, eq=False)
class Noise:
    """Standard deviations of all random errors; estimated along with everything else."""

    levels: Mapping[str, FloatArray]
    """By block, one per noise level of it; a block that is not among them has no rows."""
    gusts_last_s: FloatArray | None = None
    """(6,) correlation times of the disturbances."""

    @property
    def process(self) -> FloatArray:
        """(6,) densities of unmodelled acceleration, body axes: m/s2 and rad/s2 times root second."""
        return self.levels[MOTION]

    @property
    def gusts(self) -> Gusts | None:
        """Disturbances that last; None when all unmodelled acceleration is taken for white."""
        return None if self.gusts_last_s is None else Gusts(self.levels[GUST], self.gusts_last_s)

    def with_process(self, process: FloatArray) -> "Noise":
        """The same with other densities of unmodelled acceleration."""
        return Noise({**self.levels, MOTION: process}, self.gusts_last_s)

    def with_gusts(self, gusts: Gusts) -> "Noise":
        """The same with disturbances that last."""
        return Noise({**self.levels, GUST: gusts.size}, gusts.lasts_s)
