"""Signals of a log brought to the nodes of a flight and to the intervals between them."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from flight import FlightLog
from flight.rotations import FloatArray
from sysid.estimator.flights.smoothing import most_likely
from sysid.estimator.options import Options

if TYPE_CHECKING:
    from scipy.interpolate import PPoly


@dataclass(frozen=True, slots=True, eq=False)
class Stretch:
    """A stretch of a log without gaps, and where the flight's nodes are in it."""

    log: FlightLog
    name: str
    """For messages."""
    inside: NDArray[np.bool_]
    """Rows of the log that belong to it."""
    nodes: NDArray[np.intp]
    """Rows of the log that are nodes."""
    with_pose: bool
    """Whether nodes are pose samples; else they are the IMU's."""
    options: Options

    @property
    def time_s(self) -> FloatArray:
        """(n,) instants of the nodes."""
        return self.log.time_s[self.nodes]

    def unmeasured(self, width: int, *, between: bool = False) -> FloatArray:
        """NaN for every node, or for every interval."""
        return np.full((len(self.nodes) - between, width), np.nan)

    def sampled(self, quantity: str) -> bool:
        """Whether a quantity was recorded here, not only named."""
        return self.log.has(quantity) and int(np.count_nonzero(self._rows(quantity))) >= 2

    def at_nodes(self, quantity: str) -> FloatArray:
        """(n, c) samples taken with the nodes."""
        return self.log.vector(quantity)[self.nodes]

    def samples(self, quantity: str) -> tuple[FloatArray, FloatArray]:
        """Instants and values of all samples."""
        rows = self._rows(quantity)
        return self.log.time_s[rows], self.log.vector(quantity)[rows]

    def stream(self, quantity: str) -> "Signal":
        """A quantity between its samples, freed of white noise."""
        time_s, values = self.samples(quantity)
        return Signal.through(time_s, most_likely(time_s, values))

    def between_nodes(self, quantity: str) -> FloatArray:
        """(n - 1, c) means over the intervals."""
        return Signal.through(*self.samples(quantity)).means(self.time_s)[0]

    def around_nodes(self, quantity: str) -> FloatArray:
        """(n, c) means over half an interval to each side of every node."""
        node_s = self.time_s
        middle = 0.5 * (node_s[1:] + node_s[:-1])
        edges = np.concatenate([node_s[:1], middle, node_s[-1:]])
        return Signal.through(*self.samples(quantity)).means(edges)[0]

    def _rows(self, quantity: str) -> NDArray[np.bool_]:
        return self.inside & np.isfinite(self.log.vector(quantity)).all(axis=1)


@dataclass(frozen=True, slots=True, eq=False)
class Signal:
    """A sampled signal between its samples, by polynomials; before the first and after the last it is held."""

    spline: "PPoly"
    area: "PPoly"
    """Its antiderivative."""

    @staticmethod
    def through(time_s: FloatArray, values: FloatArray) -> "Signal":
        """Through samples (n, c)."""
        from scipy.interpolate import CubicSpline

        spline = CubicSpline(time_s, values, axis=0)
        return Signal(spline, spline.antiderivative())

    @staticmethod
    def held(time_s: FloatArray, values: FloatArray) -> "Signal":
        """Each sample (n, c) held until the next, as commands are."""
        from scipy.interpolate import PPoly

        steps = PPoly(values[None], np.append(time_s, np.nextafter(time_s[-1], np.inf)))
        return Signal(steps, steps.antiderivative())

    def value(self, time_s: FloatArray) -> FloatArray:
        """(n, c)."""
        return self.spline(self._inside(time_s))

    def slope(self, time_s: FloatArray) -> FloatArray:
        """(n, c) derivative by time; zero where it is held."""
        inside = self._inside(time_s)
        return self.spline(inside, 1) * (inside == time_s)[:, None]

    def means(self, node_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Mean of the signal and of its slope over each interval between nodes: (k, c) twice.

        The spline matters: a mean of the two end samples damps what the midpoint rule of the model passes, and biases
        inertias by (frequency x interval)^2 / 12, about 1 % for a fast motor at 100 Hz.
        """
        inside, value = self._inside(node_s), self.value(node_s)
        area = self.area(inside) + value * (node_s - inside)[:, None]
        step_s = np.diff(node_s)[:, None]
        return np.diff(area, axis=0) / step_s, np.diff(value, axis=0) / step_s

    def _inside(self, time_s: FloatArray) -> FloatArray:
        return np.clip(time_s, self.spline.x[0], self.spline.x[-1])


def means_over(values: FloatArray, time_s: FloatArray, span_s: float) -> FloatArray:
    """Means over consecutive stretches of time."""
    bin_ = ((time_s - time_s[0]) / span_s).astype(int)
    count = np.maximum(np.bincount(bin_), 1)
    return np.stack([np.bincount(bin_, column) / count for column in values.T], axis=1)
