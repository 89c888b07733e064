"""Do flights that were not used agree? Cost of whole flights under two models, block by block."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from flight import InputError
from flight.rotations import FloatArray
from sysid.diagnosis.evidence.evidence import block_edges
from sysid.estimator.blocks.noise import Noise
from sysid.estimator.flights.flight_data import Flight
from sysid.estimator.flights.parallel import each
from sysid.estimator.identification import start
from sysid.estimator.joint_problem.chain import Eliminated, eliminate
from sysid.estimator.joint_problem.problem import Point, Residuals, cost_of, linearise
from sysid.estimator.joint_problem.solver import all_residuals
from sysid.estimator.joint_problem.unknowns import SENSOR_NAMES, Unknowns, nuisances, sensor_values
from sysid.estimator.motors import motor
from sysid.estimator.options import Reference
from sysid.estimator.trajectory.midpoint import middle
from sysid.estimator.trajectory.model import along
from sysid.estimator.trajectory.states import States
from vehicle import Vehicle

MOST_STEPS = 60
"""Gauss-Newton steps from smoothed poses to the best states under a model; four are usually enough, and 19 where a
model that lacks an effect moves the clock of a flight that hardly shows it."""
SETTLED = 0.05
"""States are at their best when a step promises less than this of the cost, a log likelihood: verdicts begin at 3.

A clock that a flight hardly shows creeps on for long, by less each step than that (vertical flight cut at gaps)."""


@dataclass(frozen=True, slots=True)
class CostReduction:
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


class Judge:
    """Flights to judge models on, with one noise level for all of them."""

    def __init__(
        self,
        flights: Sequence[Flight],
        noise: Noise,
        near: Point | None = None,
        clock: Reference = "pose",
    ) -> None:
        """
        Args:
            near: states, biases and delays to start from; else the smoothed pose, and none.
            clock: against which delays are estimated.
        """
        self._flights, self._noise, self._near = list(flights), noise, near
        self._clock: Reference = clock
        self._known: list[tuple[Vehicle, FloatArray]] = []
        self._given = self._flights

    @property
    def flights(self) -> tuple[Flight, ...]:
        """With what each carries, where that was decided."""
        return tuple(self._flights)

    def decide_load(self, vehicle: Vehicle) -> int:
        """Say of each log that does not say so itself whether it carries the vehicle's payload: the likelier of both.

        Returns:
            How many logs it was decided for.
        """
        both = {carries: [_told(f, carries) for f in self._given] for carries in (True, False)}
        costs = {c: Judge(f, self._noise, self._near, self._clock).costs(vehicle) for c, f in both.items()}
        open_ = sorted({f.log_index for f in self._given if f.carries_payload is None})
        log_of_block = np.concatenate([np.full(len(block_edges(f.time_s)), f.log_index) for f in self._given])
        lighter = {i for i in open_ if (costs[True] - costs[False])[log_of_block == i].sum() > 0.0}
        self._flights = [_told(f, f.log_index not in lighter) for f in self._given]
        self._known = []
        return len(open_)

    def at(self, noise: Noise, near: Point) -> "Judge":
        """Another one of the same flights at another noise level; `near` is where to start from."""
        return Judge(self._flights, noise, near, self._clock)

    def set_noise(self, noise: Noise) -> None:
        """Judge at this noise level from now on."""
        if noise is not self._noise:
            self._noise, self._known = noise, []

    def costs(self, vehicle: Vehicle, near: Point | None = None) -> FloatArray:
        """(b,) half the sum of squares of each block, states, biases and delays at their best under the vehicle.

        Args:
            near: where these are likely to be, if known.
        """
        known = next((costs for other, costs in self._known if other is vehicle), None)
        if known is not None:
            return known
        near = near or self._near or start(vehicle, self._flights)[0]
        point = Point(vehicle, {**near.sensors, **sensor_values(vehicle)}, near.states)
        self._near, residuals = settle(self._flights, point, self._noise, self._clock)
        costs = np.concatenate([_block_costs(f, r) for f, r in zip(self._flights, residuals, strict=True)])
        self._known.append((vehicle, costs))
        return costs

    def strength(self, before: Vehicle, after: Vehicle) -> float:
        """Half the sum of squares, in units of the noise, of what two models say differently about these flights."""
        if self._near is None:
            self.costs(before)
        assert self._near is not None
        total = 0.0
        for flight, states in zip(self._flights, self._near.states, strict=True):
            mid = middle(flight, states)
            first, second = (along(v, motor.driven(flight, v), mid) for v in (before, after))
            total += 0.5 * float((mid.step_s * ((first - second) / self._noise.process) ** 2).sum())
        return total

    def reduction(self, before: Vehicle, after: Vehicle, near_after: Point | None = None) -> CostReduction:
        """From one model to another."""
        return CostReduction(self.costs(before) - self.costs(after, near_after))


def _told(flight: Flight, carries: bool) -> Flight:
    return flight if flight.carries_payload is not None else replace(flight, carries_payload=carries)


def settle(flights: Sequence[Flight], point: Point, noise: Noise, clock: Reference) -> tuple[Point, list[Residuals]]:
    """States, biases and delays at their best with everything else held, and each flight's residuals there.

    Raises:
        InputError: the states do not settle.
    """
    if any((s.gust is None) != (noise.gusts is None) for s in point.states):  # a point of another model's fit
        fitting = [replace(s, gust=None) if noise.gusts is None else s.with_gust() for s in point.states]
        point = replace(point, states=tuple(fitting))
    unknowns, width = nuisances(flights, clock, point.vehicle)
    kept = (*SENSOR_NAMES, *unknowns.names)  # a point of other clocks may hold delays that are none by this one
    point = replace(point, sensors={name: value for name, value in point.sensors.items() if name in kept})
    weak = np.diag(1.0 / width**2)
    for _ in range(MOST_STEPS):
        residuals, eliminated = _linearised(flights, point, unknowns, noise)
        now = sum(map(cost_of, residuals))
        information = weak + sum(e.information for e in eliminated)
        gradient = sum((e.gradient for e in eliminated), np.zeros(unknowns.size))
        border = np.asarray(-np.linalg.solve(information, gradient), dtype=np.float64)
        if sum(e.promised(border) for e in eliminated) < SETTLED:
            return point, residuals
        changes = [e.states(border) for e in eliminated]
        point, lower = _lowered(flights, point, unknowns, noise, border, changes, now)
        if not lower:
            return point, residuals
    raise InputError(f"the states of {flights[0].name} do not settle under the model; it may be far from the truth")


def _linearised(
    flights: Sequence[Flight], point: Point, unknowns: Unknowns, noise: Noise
) -> tuple[list[Residuals], list[Eliminated]]:
    """Each flight's residuals at a point, and what their derivatives say of the unknowns."""

    def one(flight: Flight, states: States) -> tuple[Residuals, Eliminated]:
        rows = linearise(flight, states, point, unknowns, noise, False)
        return (rows.defect, rows.sensor), eliminate(rows)

    residuals, eliminated = zip(*each(point.vehicle, one, flights, point.states), strict=True)
    return list(residuals), list(eliminated)


def _lowered(
    flights: Sequence[Flight],
    point: Point,
    unknowns: Unknowns,
    noise: Noise,
    border: FloatArray,
    changes: Sequence[FloatArray],
    before: float,
) -> tuple[Point, bool]:
    """The point after the largest share of a step that lowers the cost, or where it was and False if none does."""
    share = 1.0
    while share > 1e-2:
        tried = point.moved(unknowns, share * border, [share * c for c in changes])
        after = sum(map(cost_of, all_residuals(flights, tried, noise)))
        if np.isfinite(after) and after <= before:
            return tried, True
        share *= 0.5
    return point, False


def _block_costs(flight: Flight, residuals: Residuals) -> FloatArray:
    return np.array([cost_of((residuals[0][a:b], residuals[1][a:b])) for a, b in block_edges(flight.time_s)])
