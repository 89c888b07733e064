"""What a residual block is: one kind of rows of the joint problem, with everything that is its own.

A block owns its residual and Jacobian, the noise levels they are whitened by, the parameters that only it shows, and
the names of all these. Solver, noise update and reports loop over the list of blocks in `sysid.estimator.blocks`.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from flight.rotations import FloatArray
from sysid.estimator.blocks.noise import Noise
from sysid.estimator.flights.flight_data import Flight
from sysid.estimator.flights.sampling import Stretch
from sysid.estimator.trajectory.midpoint import Middle
from sysid.estimator.trajectory.states import States
from vehicle import Vehicle

HUBER = 2.0
"""Standard deviations beyond which a robust fit counts a sample less."""
LEAST_LEVEL = 1e-5
"""Floor of a sensor's noise level: it keeps the equations regular."""


@dataclass(frozen=True, slots=True, eq=False)
class At:
    """Where blocks are evaluated: one flight, and where the unknowns stand."""

    flight: Flight
    """With the rotor speeds that drive the model."""
    states: States
    mid: Middle
    vehicle: Vehicle
    model: tuple[str, ...]
    """Parameters of the vehicle's motion to differentiate by."""
    sensors: Mapping[str, float]
    """Values of the sensors' parameters, biases and delays; a bias or delay that is not among them is zero."""
    noise: Noise

    def values(self, names: Sequence[str]) -> FloatArray:
        """Of sensors' parameters or biases."""
        return np.array([self.sensors.get(name, 0.0) for name in names])

    def by_state(self, rows: int, between: bool) -> FloatArray:
        """(n or n - 1, rows, state) zeros to be filled with derivatives."""
        return np.zeros((len(self.flight) - between, rows, self.states.size))


@dataclass(frozen=True, slots=True, eq=False)
class Linear:
    """Residuals of one block on one flight and their derivatives."""

    residual: FloatArray
    """(n or n - 1, m)."""
    by_state: tuple[FloatArray, ...]
    """(..., m, s) by the state of the node; between nodes, by the state before and by the one after."""
    by_shared: FloatArray
    """(..., m, p) by parameters and biases."""
    shared: tuple[str, ...]
    """(p,) names of these."""

    def weighted(self, weights: FloatArray) -> "Linear":
        """Rows times weights (m,) or (..., m)."""
        w = weights[..., None]
        return Linear(self.residual * weights, tuple(j * w for j in self.by_state), self.by_shared * w, self.shared)


@dataclass(frozen=True, slots=True)
class Channel:
    """Rows of a block that reports speak of together."""

    name: str
    rows: tuple[int, ...]
    unit: str
    """In which it is shown."""
    scale: float = 1.0
    """Of that unit, per SI unit."""


class Block(ABC):
    """One kind of residual. Class variables are its names; methods its mathematics."""

    name: ClassVar[str]
    order: ClassVar[int] = 100
    """Place of its rows among those of all blocks; of equals, the name decides."""
    between: ClassVar[bool] = False
    """Whether its rows belong to the intervals between nodes, not to the nodes."""
    levels: ClassVar[tuple[str, ...]] = ()
    """Names of its noise levels, with their units."""
    usual: ClassVar[tuple[float, ...]] = ()
    """What these are before the first fit; none where the block has to be asked for."""
    level_of_row: ClassVar[tuple[int, ...]]
    """Which noise level each row is whitened by."""
    channels: ClassVar[tuple[Channel, ...]] = ()
    parameters: ClassVar[tuple[str, ...]] = ()
    """Of the vehicle file, that only this sensor shows."""
    bias: ClassVar[tuple[str, ...]] = ()
    """Names of constant errors, which each log has of its own."""
    bias_std: ClassVar[float] = np.inf
    """Standard deviation of the prior on each of them."""

    def read(self, stretch: Stretch) -> dict[str, FloatArray]:
        """What it needs of a log, by quantity, (n, c) at the nodes or (n - 1, c) between; NaN: not measured."""
        return {}

    @abstractmethod
    def measured(self, flight: Flight) -> bool:
        """Whether a flight has what its rows need."""

    @abstractmethod
    def residual(self, at: At) -> FloatArray:
        """(n or n - 1, m), not yet whitened."""

    @abstractmethod
    def linear(self, at: At) -> Linear:
        """Residual and derivatives, not yet whitened."""

    def curvature(self, at: At) -> dict[str, float]:
        """Whitened residuals times their second derivatives by delays, summed, by name: what Gauss-Newton leaves out
        of the second derivative of the cost. Only where that is large."""
        return {}

    def acts(self, flight: Flight, noise: Noise) -> bool:
        """Whether it has rows on a flight."""
        return self.measured(flight) and (not self.levels or self.name in noise.levels)

    def bias_names(self, log: int) -> tuple[str, ...]:
        return tuple(f"{name}[{log}]" for name in self.bias)

    def row_levels(self, noise: Noise) -> FloatArray:
        """(m,) standard deviation of each row; rows of a block without levels come whitened."""
        if not self.levels:
            return np.ones(len(self.level_of_row))
        return noise.levels[self.name][list(self.level_of_row)]

    def white_residual(self, at: At, robust: bool) -> FloatArray:
        """(n or n - 1, m) in standard deviations."""
        white = self.residual(at) / self.row_levels(at.noise)
        return white * self.robust_weights(white) if robust else white

    def white(self, at: At, robust: bool) -> Linear:
        """Residual and derivatives in standard deviations."""
        weights = 1.0 / self.row_levels(at.noise)
        linear = self.linear(at)
        if robust:
            weights = weights * self.robust_weights(linear.residual * weights)
        return linear.weighted(weights)

    def robust_weights(self, white: FloatArray) -> FloatArray:
        """(..., m) square roots of Huber's weights, one per sample and noise level; only nodes have samples."""
        if self.between:
            return np.ones(white.shape)
        weights = np.empty(white.shape)
        for level in set(self.level_of_row):
            rows = [i for i, of in enumerate(self.level_of_row) if of == level]
            size = np.sqrt((white[:, rows] ** 2).mean(axis=1, keepdims=True))
            weights[:, rows] = np.sqrt(np.where(size > HUBER, HUBER / np.maximum(size, HUBER), 1.0))
        return weights

    def updated(self, levels: FloatArray, ratio: FloatArray, flights: Sequence[Flight]) -> FloatArray:
        """Noise levels after residuals were found `ratio` times as large as they said."""
        return np.maximum(levels * ratio, LEAST_LEVEL)

    def channel_level(self, channel: Channel, noise: Noise) -> float:
        """Noise level of one of its channels."""
        return float(noise.levels[self.name][self.level_of_row[channel.rows[0]]])

    def reported(self, noise: Noise) -> dict[str, Any]:
        """Its noise levels as plain JSON values."""
        if not self.levels:
            return {}
        return dict(zip(self.levels, map(float, noise.levels[self.name]), strict=True))
