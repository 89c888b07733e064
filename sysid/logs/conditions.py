"""In what conditions flights were flown, as their logs show them: gaps of the pose, and noise of pose and gyro.

Noise is what the second differences of neighbouring samples hold (median absolute deviation, of a normal distribution).
Vibration and the motion itself are in it: an upper estimate, the wider the slower the samples come.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flight import FlightLog, rotations
from flight.rotations import FloatArray

GAP_INTERVALS = 2.5
"""Of the median time between poses, from which on it is a gap: two poses are missing, and more."""
CARRIED_S = 0.1
"""What our controller carries a pose over before it counts dead reckoning (its stale_s, by default)."""
_EVEN = 0.25
"""By which the times between three samples may differ from the median."""
_LEAST = 50
"""Second differences, from which on they tell a noise."""
_MAD_OF_SECOND = 1.4826 / np.sqrt(6.0)
"""Standard deviation of a sample, over the median absolute second difference."""


@dataclass(frozen=True, slots=True)
class Conditions:
    """Of some flights; None: their logs do not tell."""

    flown_s: float
    """With a pose, or in a gap of it."""
    gaps: int | None = None
    gaps_per_s: float | None = None
    """So many gaps of `gap_s` a second between them miss as much time as those that were seen."""
    gap_s: float | None = None
    """Mean length, of the time that is missing: the long ones count for more. None without a gap, too."""
    position_std_m: float | None = None
    """Each axis, as the two below."""
    attitude_std_rad: float | None = None
    rate_std_rad_s: float | None = None


def of_logs(logs: Sequence[FlightLog]) -> Conditions:
    """Of all flights together; the noise is that of the noisiest."""
    gaps_s, flown_s = _gaps(logs)
    missing_s = float(gaps_s.sum())
    has_pose = flown_s > 0.0
    gap_s = float((gaps_s**2).sum() / missing_s) if gaps_s.size else None
    per_s = 0.0 if gap_s is None else missing_s / gap_s / max(flown_s - missing_s, missing_s / GAP_INTERVALS)
    noise = [_noise(log) for log in logs]
    position, attitude, rate = ([std for one in noise if (std := one[i]) is not None] for i in range(3))
    return Conditions(
        flown_s,
        int(gaps_s.size) if has_pose else None,
        per_s if has_pose else None,
        gap_s,
        max(position, default=None),
        max(attitude, default=None),
        max(rate, default=None),
    )


def _gaps(logs: Sequence[FlightLog]) -> tuple[FloatArray, float]:
    """Lengths of all gaps of the position, and the time of all poses; a stretch that was not recorded is a gap."""
    found, flown_s = [np.zeros(0)], 0.0
    for log in logs:
        times_s = log.time_s[_fresh(log, "position_world_m")]
        if len(times_s) < _LEAST:
            continue
        apart_s = np.diff(times_s)
        usual_s = float(np.median(apart_s))
        hidden_s = CARRIED_S if "reckoning_s" in log.columns else 0.0
        found.append(apart_s[apart_s > GAP_INTERVALS * usual_s] - usual_s + hidden_s)
        flown_s += float(times_s[-1] - times_s[0])
    return np.concatenate(found), flown_s


def _fresh(log: FlightLog, quantity: str) -> NDArray[np.bool_]:
    """(n,) rows with a new sample: neither missing, nor the last one again, nor dead reckoned."""
    if not log.has(quantity):
        return np.zeros(len(log), dtype=np.bool_)
    values = log.vector(quantity)
    fresh: NDArray[np.bool_] = np.asarray(np.isfinite(values).all(axis=1))
    if quantity == "position_world_m" and "reckoning_s" in log.columns:
        fresh[log.columns["reckoning_s"] > 0.0] = False
    rows = np.flatnonzero(fresh)
    fresh[rows[1:]] = (np.diff(values[rows], axis=0) != 0.0).any(axis=1)
    return fresh


def _noise(log: FlightLog) -> tuple[float | None, float | None, float | None]:
    """Of position, attitude and rate, each axis."""
    return (
        _std(*_samples(log, "position_world_m")),
        _std(*_samples(log, "q_world_body"), turns=True),
        _std(*_samples(log, "rate_body_rad_s")),
    )


def _samples(log: FlightLog, quantity: str) -> tuple[FloatArray, FloatArray]:
    fresh = _fresh(log, quantity)
    return log.time_s[fresh], log.vector(quantity)[fresh] if fresh.any() else np.zeros((0, 3))


def _std(times_s: FloatArray, values: FloatArray, *, turns: bool = False) -> float | None:
    """Root mean square over the axes; None of too few samples at even times, or of some without any noise."""
    if len(times_s) < _LEAST + 2:
        return None
    apart_s = np.diff(times_s)
    even = np.abs(apart_s - np.median(apart_s)) <= _EVEN * np.median(apart_s)
    steps = (
        rotations.log(rotations.multiply(rotations.conjugate(values[:-1]), values[1:]))
        if turns
        else np.diff(values, axis=0)
    )
    second = np.diff(steps, axis=0)[even[1:] & even[:-1]]
    if len(second) < _LEAST:
        return None
    std = _MAD_OF_SECOND * np.median(np.abs(second - np.median(second, axis=0)), axis=0)
    return float(np.sqrt(np.mean(std**2))) or None
