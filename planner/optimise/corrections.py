"""What the optimiser's idea of each limit lacks, measured with the vehicle's own model along the path."""

import numpy as np

from flight import FloatArray, Trajectory, polynomial
from planner._planner import StopFlag
from planner.curve import attitude
from planner.curve.attitude import Memory
from planner.curve.minimum_snap import Spline
from planner.gate import limits
from planner.optimise import airframe, time_allocation
from planner.optimise.airframe import Airframe
from planner.optimise.time_allocation import Problem
from planner.request.options import check_stop
from vehicle import Vehicle, invert

_SPARE = 0.006
"""Relative excess that is kept from every limit, for what is not measured."""
_STRICTER = 0.005, 1.0
"""The same where the gate, with its finer samples, found a limit exceeded, more each time it does: at least, and as a
share of the excess. At least 0.01, two equal starts ended 0.3 % apart where a path near free fall was refused; with a
share of 0.5 the gate refused a maze's path five times, with 1 twice at most of 50 scenes."""
_FARTHER_M = 0.002, 0.01
"""Least and most clearance that is aimed at beyond what was, each time some is lacking."""
_NEAR = 0.3
"""The vehicle's own model is expensive: it is asked in segments where a limit is nearer than this."""
_MOST, _RISE, _FALL = 0.5, 0.1, 0.5
"""Largest correction of the reduced model; how much it grows in one round, and the share by which it comes down. At a
large one the path is another, for which it would be wrong again: growing in steps, path and correction come to rest."""
_GROUP = 100
"""Segments in which it is asked together: more would make cancelling slow."""
_IMPOSSIBLE = 0.2
"""Excess of every rotor where no rotor speeds give the motion."""


class Corrections:
    """What is added to the reduced model's excess at each sample, (k, samples, limits), and to the clearance."""

    def __init__(self, segments: int, columns: int = airframe.COLUMNS) -> None:
        """
        Args:
            columns: of the airframe's excess.
        """
        shape = (segments, time_allocation.SAMPLES, columns)
        self.model, self.between, self.multiplier = np.zeros(shape), np.zeros(shape), np.zeros(shape)
        self.measured, self.believed = np.zeros(shape), np.zeros(shape)
        """The correction that was measured last, and the excess with the one that is believed."""
        self.gate = np.full((segments, 1, columns), _SPARE)
        self.farther_m = np.zeros(segments)
        """As `Problem.farther_m`."""

    def spliced(self, first: int, last: int, segments: int) -> "Corrections":
        """A copy in which the segments from `first` up to `last` are replaced by so many new ones, none measured yet.

        Where the number stays the same, what was measured of the old ones is where the new ones start from.
        """
        fresh = Corrections(segments, self.gate.shape[-1])
        copy = Corrections(0, self.gate.shape[-1])
        for name, old in vars(self).items():
            new = old[first:last] if segments == last - first else getattr(fresh, name)
            setattr(copy, name, np.concatenate([old[:first], new, old[last:]]))
        return copy

    @property
    def _names(self) -> tuple[str, ...]:
        return airframe.names_of((self.gate.shape[-1] - len(airframe.names_of(0))) // 2)

    def unpressed(self) -> "Corrections":
        """A copy with what was measured, and no multipliers yet."""
        copy = self.spliced(0, 0, 0)
        copy.multiplier[:] = 0.0
        return copy

    def total(self) -> FloatArray:
        return self.model + self.between + self.multiplier + self.gate

    def measure(
        self,
        problem: Problem,
        spline: Spline,
        path: Trajectory,
        vehicle: Vehicle,
        touched: np.ndarray,
        memory: Memory | None = None,
        stop: StopFlag | None = None,
    ) -> FloatArray:
        """Ask the vehicle's own model in segments `touched` (k,); what it says each excess is, (k, samples, limits).

        Raises:
            PlanCancelledError: `stop` was set.
        """
        reduced, peaks = time_allocation.excess(problem, spline)
        near = np.flatnonzero(touched & ((peaks + self.model).max(axis=(1, 2)) > -_NEAR))
        for group in np.split(near, range(_GROUP, len(near), _GROUP)) if near.size else []:
            check_stop(stop)
            full = measured_excess(
                problem.airframe,
                vehicle,
                path,
                group,
                time_allocation.FRACTIONS,
                problem.speed_m_s,
                problem.jerk_m_s3,
                memory,
            )
            full = np.where(np.isfinite(full), full, np.maximum(reduced[group], 0.0) + _IMPOSSIBLE)
            self.measured[group] = np.clip(full - reduced[group], -_MOST, _MOST)
            self.model[group] = _approached(self.model[group], self.measured[group])
        self.between = _approached(self.between, peaks - reduced)
        self.believed = peaks + self.model
        return peaks + self.measured

    def press(self, touched: np.ndarray) -> None:
        """Raise the multipliers of what is believed to be exceeded, lower those of what is not."""
        pressed = np.maximum(0.0, self.believed + self.gate + self.multiplier)
        self.multiplier = np.where(touched[:, None, None], pressed, self.multiplier)

    def active(self, touched: np.ndarray) -> tuple[str, ...]:
        """The limit of each segment with the largest multipliers, "" for none; where untouched, of the last round."""
        now = np.maximum(0.0, self.believed + self.gate + self.multiplier)
        held = np.where(touched[:, None, None], now, self.multiplier).sum(axis=1)
        return tuple(self._names[most] if held[i, most] > 0.0 else "" for i, most in enumerate(held.argmax(axis=1)))

    def farther(self, lack_m: FloatArray) -> None:
        """Aim at more clearance in segments that lack some, (k,), infinite where it is not known how much."""
        self.farther_m = self.farther_m + np.where(lack_m > 0.0, np.clip(lack_m, *_FARTHER_M), 0.0)

    def stricter(self, used: limits.Usage, on_legs: dict[str, np.ndarray]) -> None:
        """Keep more from the limits that the gate found exceeded, in those segments only.

        Args:
            on_legs: by name of the limit, (k,) bool, where what is asked for on a leg is.
        """
        columns = np.array([limits.NAMES.index(name) for name in self._names])
        exceeded, excess = ~used.passed[columns].T, np.nan_to_num(used.share[columns].T - 1.0, nan=0.0)
        for name, beyond in on_legs.items():
            exceeded[:, self._names.index(name)] |= beyond
        least, share = _STRICTER
        self.gate[:, 0] += np.where(exceeded, np.clip(share * excess, least, 10.0 * least), 0.0)


def measured_excess(
    frame: Airframe,
    vehicle: Vehicle,
    trajectory: Trajectory,
    segments: np.ndarray,
    fractions: FloatArray,
    speed_m_s: FloatArray | None = None,
    jerk_m_s3: FloatArray | None = None,
    memory: Memory | None = None,
) -> FloatArray:
    """The excess (s, f, limits) from the vehicle's own model, at fractions (f,) of the given segments (s,).

    NaN where it cannot fly the motion at all. `speed_m_s` and `jerk_m_s3` (k,) are limits of all segments, if not the
    airframe's.
    """
    k = len(trajectory.durations_s)
    most = np.full(k, frame.speed_m_s) if speed_m_s is None else speed_m_s
    most_jerk = np.full(k, frame.jerk_m_s3) if jerk_m_s3 is None else jerk_m_s3
    w, values = frame, attitude.sampled(vehicle, trajectory, segments, fractions, memory)
    effort = values[..., attitude.ROTOR] ** 2 / np.mean(invert.hover(vehicle) ** 2)
    idle = np.zeros((*effort.shape[:-1], len(w.effort_hover) - effort.shape[-1]))
    effort = np.concatenate([effort, idle], axis=2) if idle.size else effort
    rate = values[..., attitude.RATE]
    times = fractions * trajectory.durations_s[segments, None]
    c = trajectory.coefficients[segments, :3]
    speed, push, jerk = (
        (polynomial.evaluate(polynomial.differentiate(c, r)[:, None], times[..., None]) ** 2).sum(axis=2)
        for r in (1, 2, 3)
    )
    single = [
        speed / most[segments, None] ** 2 - 1.0,
        push / np.square(w.acceleration_m_s2) - 1.0,
        jerk / most_jerk[segments, None] / most_jerk[segments, None] - 1.0,  # no square of a huge limit
        (w.cos_tilt - values[..., attitude.UP]) / (1.0 - w.cos_tilt),
        (rate[..., :2] ** 2).sum(axis=2) / np.square(w.rate_rad_s) - 1.0,
        rate[..., 2] ** 2 / np.square(w.yaw_rate_rad_s) - 1.0,
    ]
    return np.concatenate([np.stack(single, axis=2), effort - w.effort_most, w.effort_least - effort], axis=2)


def _approached(believed: FloatArray, measured: FloatArray) -> FloatArray:
    """A correction on its way to what was measured."""
    falling = believed + _FALL * (measured - believed)
    return np.where(measured > believed, np.minimum(measured, believed + _RISE), falling)
