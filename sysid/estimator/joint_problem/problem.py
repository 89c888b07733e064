"""The joint estimation problem: where the unknowns stand, and the linearised residuals of all blocks there."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from flight.rotations import FloatArray
from sysid.estimator.blocks.base import At, Linear
from sysid.estimator.blocks.catalogue import acting
from sysid.estimator.blocks.noise import Noise
from sysid.estimator.flights.flight_data import Flight
from sysid.estimator.joint_problem.chain import Rows
from sysid.estimator.joint_problem.unknowns import Unknowns
from sysid.estimator.motors import motor, rotor_speed
from sysid.estimator.trajectory.midpoint import middle
from sysid.estimator.trajectory.states import States
from vehicle import Parameter, Vehicle, specs


@dataclass(frozen=True, slots=True)
class Point:
    """Where the unknowns stand."""

    vehicle: Vehicle
    """With the values tried at the moment."""
    sensors: Mapping[str, float]
    """Values of the sensors' parameters, and of biases and delays that are not zero."""
    states: tuple[States, ...]
    """One per flight."""

    def moved(self, unknowns: Unknowns, shared: FloatArray, states: Sequence[FloatArray]) -> "Point":
        """The point after a change of the shared parameters (p,) and of the states (n, size) each."""
        m = len(unknowns.model)
        changed = zip(unknowns.names[m:], shared[m:].tolist(), strict=True)
        return Point(
            with_values(self.vehicle, unknowns.model, self.values(unknowns.model) + shared[:m]),
            {**self.sensors, **{name: self.sensors.get(name, 0.0) + change for name, change in changed}},
            tuple(s.moved(d) for s, d in zip(self.states, states, strict=True)),
        )

    def value(self, name: str) -> float:
        """Value of one of the model's or the sensors' parameters."""
        return self.sensors[name] if name in self.sensors else self.vehicle.value(name)

    def shared(self, unknowns: Unknowns) -> FloatArray:
        """(p,) values of all shared parameters."""
        named = self.values((*unknowns.model, *unknowns.sensor))
        return np.concatenate([named, [self.sensors.get(name, 0.0) for name in (*unknowns.bias, *unknowns.delay)]])

    def values(self, names: Sequence[str]) -> FloatArray:
        """Several at once."""
        return np.array([self.value(name) for name in names], dtype=np.float64)


def with_values(vehicle: Vehicle, names: tuple[str, ...], values: FloatArray) -> Vehicle:
    """The vehicle with trial values, clipped by rounding at most (the solver keeps to the bounds)."""
    bounds = specs(vehicle)
    changed = dict(vehicle.parameters)
    for name, value in zip(names, values, strict=True):
        old = changed[name]
        changed[name] = Parameter(float(np.clip(value, *bounds[name].bounds)), old.std, old.unit, old.source)
    return replace(vehicle, parameters=changed)


def linearise(flight: Flight, states: States, point: Point, unknowns: Unknowns, noise: Noise, robust: bool) -> Rows:
    """Whitened residual rows of one flight with all derivatives."""
    at = located(flight, states, point, noise, unknowns.model)
    intervals = [block.white(at, robust) for block in acting(flight, noise, between=True)]
    nodes = [block.white(at, robust) for block in acting(flight, noise, between=False)]
    return Rows(
        defect=_joined([part.residual for part in intervals]),
        defect_before=_joined([part.by_state[0] for part in intervals]),
        defect_after=_joined([part.by_state[1] for part in intervals]),
        defect_border=_by_shared(intervals, unknowns),
        sensor=_joined([part.residual for part in nodes]),
        sensor_state=_joined([part.by_state[0] for part in nodes]),
        sensor_border=_by_shared(nodes, unknowns),
    )


def curvature_of(flight: Flight, states: States, point: Point, unknowns: Unknowns, noise: Noise) -> FloatArray:
    """(p,) what Gauss-Newton leaves out of the cost's second derivatives by the shared parameters, of one flight."""
    at = located(flight, states, point, noise)
    found: dict[str, float] = {}
    for between in (True, False):
        for block in acting(flight, noise, between=between):
            found |= block.curvature(at)
    return np.array([found.get(name, 0.0) for name in unknowns.names])


Residuals = tuple[FloatArray, FloatArray]
"""Of one flight, whitened: (k, d) of the intervals between nodes, (k + 1, m) at the nodes."""


def residuals_of(flight: Flight, states: States, point: Point, noise: Noise, robust: bool) -> Residuals:
    """One flight's whitened residuals, without derivatives."""
    at = located(flight, states, point, noise)
    defect, sensor = (
        _joined([block.white_residual(at, robust) for block in acting(flight, noise, between=between)])
        for between in (True, False)
    )
    return defect, sensor


def cost_of(found: Residuals) -> float:
    """Half the sum of squares."""
    return 0.5 * float(sum(np.vdot(part, part) for part in found))


def located(flight: Flight, states: States, point: Point, noise: Noise, model: tuple[str, ...] = ()) -> At:
    """Where blocks are evaluated; `model`: parameters of the vehicle to differentiate by."""
    driven = motor.driven(rotor_speed.aligned(flight, point.sensors), point.vehicle)
    return At(driven, states, middle(driven, states), point.vehicle, model, point.sensors, noise)


def _joined(parts: list[FloatArray]) -> FloatArray:
    return parts[0] if len(parts) == 1 else np.concatenate(parts, axis=1)


def _by_shared(parts: list[Linear], unknowns: Unknowns) -> FloatArray:
    """(..., m, p) derivatives of the blocks' rows by all shared parameters."""
    if len(parts) == 1 and parts[0].shared == unknowns.names:
        return parts[0].by_shared
    place = {name: i for i, name in enumerate(unknowns.names)}
    rows = sum(part.residual.shape[1] for part in parts)
    found = np.zeros((len(parts[0].residual), rows, unknowns.size))
    first = 0
    for part in parts:
        last = first + part.residual.shape[1]
        known = [i for i, name in enumerate(part.shared) if name in place]
        columns = [place[part.shared[i]] for i in known]
        if columns == list(range(len(part.shared))):  # the first ones, in their order: the vehicle's
            found[:, first:last, : len(columns)] = part.by_shared
        else:
            found[:, first:last, columns] = part.by_shared[:, :, known]
        first = last
    return found
