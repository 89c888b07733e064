"""Levels of detail of a sampled curve: a plot of any stretch costs as much as it has pixels, not samples."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flight import FloatArray

Small = NDArray[np.float32]
"""What is drawn needs no more digits, and ten million samples half the room."""

SMALLEST_GROUP = 16
"""Samples that the finest level merges; smaller groups are merged when they are drawn: the levels take a quarter of
the samples' memory."""
GAP_FACTOR, GAP_LEAST_S = 4.0, 0.04
"""A pause is a gap where it lasts so many usual steps, and so long: as the checks and the estimator tell gaps."""


@dataclass(frozen=True, slots=True, eq=False)
class Pyramid:
    """Samples, and the smallest and largest of groups of 16, 32, 64 ... of them."""

    samples: Small
    """(n,); NaN where nothing was measured."""
    levels: tuple[tuple[Small, Small], ...]
    """Smallest and largest value of each group, the finest level first; NaN where a whole group is."""

    @staticmethod
    def of(values: FloatArray | Small) -> "Pyramid":
        samples = np.ascontiguousarray(values, dtype=np.float32)
        levels: list[tuple[Small, Small]] = []
        if len(samples) > SMALLEST_GROUP:
            low, high = (_merged(samples, SMALLEST_GROUP, pick) for pick in (np.fmin, np.fmax))
            levels.append((low, high))
            while len(low) > 2:
                low, high = _merged(low, 2, np.fmin), _merged(high, 2, np.fmax)
                levels.append((low, high))
        return Pyramid(samples, tuple(levels))

    def extremes(self, group: int, begin: int, end: int) -> Small:
        """Smallest and largest value of the groups from `begin` to before `end`, (2 * (end - begin),) in turn.

        Args:
            group: samples of each, a power of two.
        """
        if group < SMALLEST_GROUP:
            stretch = self.samples[begin * group : end * group]
            sides = [_merged(stretch, group, pick) for pick in (np.fmin, np.fmax)]
        else:
            level = (group // SMALLEST_GROUP).bit_length() - 1
            sides = [side[begin:end] for side in self.levels[level]]
        return np.stack(sides, axis=1).ravel()

    @property
    def nbytes(self) -> int:
        return self.samples.nbytes + sum(low.nbytes + high.nbytes for low, high in self.levels)


def _merged(values: Small, group: int, pick: np.ufunc) -> Small:
    """One value of each group, by a ufunc; the last group may be smaller."""
    return pick.reduceat(values, np.arange(0, len(values), group))


def part(
    time_s: FloatArray, curves: Sequence[Pyramid], from_s: float, to_s: float, points: int
) -> tuple[FloatArray, list[Small]]:
    """Curves of one time base over a stretch, one sample beyond each end included.

    Args:
        time_s: (n,) increasing; every curve has n samples.
        points: asks for about so many times; where there are up to twice as many samples, the samples themselves.

    Returns:
        (m,) times, and for each curve (m,) values. Where samples are merged, a group has two times, its first sample's
        and its middle one's, with the group's smallest value at one and the largest at the other.
    """
    first = max(int(np.searchsorted(time_s, from_s, side="right")) - 1, 0)
    last = min(int(np.searchsorted(time_s, to_s, side="left")) + 1, len(time_s))
    if last - first <= 2 * points:
        return time_s[first:last], [curve.samples[first:last] for curve in curves]
    group = 4  # of two times each: half as many as the samples
    while 2 * (last - first) / group > 2 * points:
        group *= 2
    begin, end = first // group, -(-last // group)
    starts = group * np.arange(begin, end)
    places = np.stack([starts, np.minimum(starts + group // 2, len(time_s) - 1)], axis=1).ravel()
    return time_s[places], [curve.extremes(group, begin, end) for curve in curves]


def gaps(time_s: FloatArray, factor: float = GAP_FACTOR) -> FloatArray:
    """(k, 2) begin and end of the pauses in increasing times: steps of more than `factor` usual ones."""
    step_s = np.diff(time_s)
    usual_s = float(np.median(step_s)) if len(step_s) else 0.0
    holes = np.flatnonzero(step_s > max(factor * usual_s, GAP_LEAST_S))
    return np.stack([time_s[holes], time_s[holes + 1]], axis=1)


def parted(
    time_s: FloatArray, curves: Sequence[Small | FloatArray], pauses: FloatArray
) -> tuple[FloatArray, list[FloatArray]]:
    """Curves of one time base with a NaN in the middle of each pause that they reach over, so that no line crosses it.

    Args:
        time_s: (m,) increasing; every curve has m values.
        pauses: (k, 2), of `gaps`.
    """
    middle_s = np.unique(pauses.mean(axis=1))
    places = np.searchsorted(time_s, middle_s)
    inside = (places > 0) & (places < len(time_s))
    places, middle_s = places[inside], middle_s[inside]
    return np.insert(time_s, places, middle_s), [
        np.insert(curve.astype(np.float64), places, np.nan) for curve in curves
    ]


def bridged(time_s: FloatArray, values: FloatArray | Small) -> FloatArray | Small:
    """Values with straight lines over instants at which other columns were sampled, but not over gaps of their own."""
    lost = np.isnan(values)
    if not lost.any():
        return values
    known = np.flatnonzero(~lost)
    if len(known) < 2:
        return values
    filled = np.interp(time_s, time_s[known], values[known], left=np.nan, right=np.nan)
    for begin_s, end_s in gaps(time_s[known]):
        filled[(time_s > begin_s) & (time_s < end_s)] = np.nan
    return filled
