"""Levels of detail of a sampled curve: a plot of any stretch costs as much as it has pixels, not samples."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flight import FloatArray

Small = NDArray[np.float32]
"""What is drawn needs no more digits, and ten million samples half the room."""

SMALLEST_GROUP = 4
"""Samples that the finest level merges."""


@dataclass(frozen=True, slots=True, eq=False)
class Pyramid:
    """Samples, and the smallest and largest of groups of 4, 8, 16 ... of them."""

    samples: Small
    """(n,); NaN where nothing was measured."""
    levels: tuple[tuple[Small, Small], ...]
    """Smallest and largest value of each group, the finest level first; NaN where a whole group is."""

    @staticmethod
    def of(values: FloatArray | Small) -> "Pyramid":
        samples = np.ascontiguousarray(values, dtype=np.float32)
        levels: list[tuple[Small, Small]] = []
        low = high = samples
        merged = 1
        while len(low) > 2:
            low, high = _halved(low, np.fmin), _halved(high, np.fmax)
            merged *= 2
            if merged >= SMALLEST_GROUP:
                levels.append((low, high))
        return Pyramid(samples, tuple(levels))

    @property
    def nbytes(self) -> int:
        return self.samples.nbytes + sum(low.nbytes + high.nbytes for low, high in self.levels)


def _halved(values: Small, smaller: np.ufunc) -> Small:
    even = values if len(values) % 2 == 0 else np.append(values, values[-1])
    return smaller(even[0::2], even[1::2])


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
    level, group = 0, SMALLEST_GROUP
    while 2 * (last - first) / group > 2 * points:
        level, group = level + 1, 2 * group
    begin, end = first // group, -(-last // group)
    starts = group * np.arange(begin, end)
    places = np.stack([starts, np.minimum(starts + group // 2, len(time_s) - 1)], axis=1).ravel()
    merged = [np.stack([side[begin:end] for side in curve.levels[level]], axis=1).ravel() for curve in curves]
    return time_s[places], merged
