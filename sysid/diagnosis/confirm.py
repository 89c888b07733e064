"""Do flights that were not used agree? Cost of whole flights under two models, block by block."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from flight.rotations import FloatArray
from sysid import problem, solver
from sysid.chain import Rows
from sysid.diagnosis.evidence import block_edges
from sysid.flight_data import Flight
from sysid.identification import start
from sysid.problem import Noise, Point, Unknowns
from sysid.sensors import PoseSensor
from sysid.states import States
from vehicle import Vehicle

SETTLING_STEPS = 4
"""Gauss-Newton steps from smoothed poses to the best states under a model; two are usually enough."""


@dataclass(frozen=True, slots=True)
class Fall:
    """By how much the cost of flights falls from one model to another."""

    by_block: FloatArray
    """(b,) half the sum of squares before less after."""

    @property
    def total(self) -> float:
        return float(self.by_block.sum())

    @property
    def sigma(self) -> float:
        """Standard deviation of the total, blocks taken as independent."""
        count = len(self.by_block)
        return float(np.sqrt(count * np.var(self.by_block, ddof=1))) if count > 1 else float("inf")

    @property
    def confirmed(self) -> bool:
        """Whether the fall is beyond chance."""
        return self.total > 0.0 and self.total > 1.64 * self.sigma


class Judge:
    """Flights to judge models on, with one noise level for all of them."""

    def __init__(self, flights: Sequence[Flight], noise: Noise) -> None:
        """Of the flights, only what was measured is used."""
        self._flights, self._noise = list(flights), noise
        self._states: tuple[States, ...] | None = None

    def costs(self, vehicle: Vehicle) -> FloatArray:
        """(b,) half the sum of squares of each block, states at their best under the vehicle."""
        point = start(vehicle, self._flights)[0]
        steps = SETTLING_STEPS
        if self._states is not None:
            point, steps = replace(point, states=self._states), SETTLING_STEPS // 2
        point, rows = settle(self._flights, replace(point, pose_sensor=PoseSensor.of(vehicle)), self._noise, steps)
        self._states = point.states
        return np.concatenate([_block_costs(f, r) for f, r in zip(self._flights, rows, strict=True)])

    def fall(self, before: Vehicle, after: Vehicle) -> Fall:
        """From one model to another."""
        return Fall(self.costs(before) - self.costs(after))


def settle(flights: Sequence[Flight], point: Point, noise: Noise, steps: int) -> tuple[Point, tuple[Rows, ...]]:
    """States and gyro biases at their best with everything else held, and the rows there."""
    gyro = tuple(sorted({f.log_index for f in flights if np.isfinite(f.rate_body_rad_s).any()}))
    unknowns = Unknowns((), (), gyro)
    rows: list[Rows] = []
    for step in range(steps + 1):
        rows = [
            problem.linearise(f, s, point, unknowns, noise, False) for f, s in zip(flights, point.states, strict=True)
        ]
        if step == steps:
            break
        eliminated = [solver.eliminate(r) for r in rows]
        weak = 1e2 * np.eye(unknowns.size)  # the identification's own prior on a gyro bias, 0.1 rad/s
        information = weak + sum(e.information for e in eliminated)
        border = -np.linalg.solve(information, sum((e.gradient for e in eliminated), np.zeros(unknowns.size)))
        changes = [-(e.state_step + e.sensitivity @ border) if unknowns.size else -e.state_step for e in eliminated]
        point = point.moved(unknowns, border, changes)
    return point, tuple(rows)


def _block_costs(flight: Flight, rows: Rows) -> FloatArray:
    return np.array([
        0.5 * (np.vdot(rows.defect[a:b], rows.defect[a:b]) + np.vdot(rows.sensor[a:b], rows.sensor[a:b]))
        for a, b in block_edges(flight.time_s)
    ])
