"""Steps between samples that neither the motion around nor a second sensor explains; what follows says of which kind.

A leap that is taken back within `EXCURSION_S` is an excursion (swapped markers, a value that dropped to zero); one that
is not is a jump (an estimator that was reset).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flight.rotations import FloatArray
from sysid.logs.events.repair import Span
from sysid.logs.events.stamps import IndexArray

EXCURSION_S = 2.0
"""What jumps back later is another jump."""
BESIDE, SIDE = 2, 5
"""The motion around a step is that of this many steps on either side, beginning so many away: interpolation smears a
leap over two steps."""
USUAL, LOCAL = 8.0, 4.0
"""A leap exceeds the usual residual (as a standard deviation) of the stream by this factor, and by that the 90 %
quantile of the residuals within `LOCAL_STEPS`: quick flying is no leap."""
LOCAL_STEPS = 40
MOST = 2000
"""Candidates that are looked at: a stream with more is noise or read wrongly, which other checks say."""
RETURNED = 0.4
"""A leap is taken back when less than this share of it is left."""
EXPLAINED = 0.4
"""A step is a second sensor's too if that leaves less than this share of what the motion around leaves."""
WITNESS = 0.5
"""A second sensor counts if it leaves at most this share of what moves; or as little as the motion around does."""


@dataclass(frozen=True, slots=True)
class Leap:
    """A leap from one sample to a later one."""

    before: int
    """Last row before it."""
    after: int
    """First row after it."""


def steps_of(time_s: FloatArray, values: FloatArray) -> IndexArray:
    """Rows (m,) of (n, c) values at which a new value came: a slow stream is held in a faster one's rows."""
    known = np.flatnonzero(np.isfinite(values).all(axis=1) & np.isfinite(time_s))
    if len(known) < 2:
        return known
    fresh = np.concatenate([[True], (np.diff(values[known], axis=0) != 0.0).any(axis=1)])
    return known[fresh] if fresh.mean() < 0.7 else known


def around(moved: FloatArray, step_s: FloatArray) -> FloatArray:
    """(m, c) what steps (m, c) of these durations (m,) would be by the rates before and after."""
    rate = moved / step_s[:, None]
    reach = BESIDE + SIDE - 1
    padded = np.pad(rate, ((reach, reach), (0, 0)), constant_values=np.nan)
    windows = np.lib.stride_tricks.sliding_window_view(padded, SIDE, axis=0)  # (m + 2 reach - SIDE + 1, c, SIDE)
    whole = np.isfinite(windows).all(axis=2)
    medians = np.where(whole, np.median(windows, axis=2), np.nan)
    m = len(rate)
    left, right = medians[:m], medians[reach + BESIDE : reach + BESIDE + m]
    left, right = np.where(np.isnan(left), right, left), np.where(np.isnan(right), left, right)  # at the ends
    return 0.5 * (left + right) * step_s[:, None]


def integrated(own_s: FloatArray, rate: FloatArray, time_s: FloatArray) -> FloatArray:
    """(m - 1, c) integral of a rate (n, c) from each of the times (m,) to the next; NaN beyond its ends."""
    steps = 0.5 * (rate[1:] + rate[:-1]) * np.diff(own_s)[:, None]
    total = np.concatenate([np.zeros((1, rate.shape[1])), np.cumsum(steps, axis=0)])
    at = np.stack([np.interp(time_s, own_s, column, left=np.nan, right=np.nan) for column in total.T], axis=1)
    return np.diff(at, axis=0)


def witness_counts(left: FloatArray, moved: FloatArray, left_around: FloatArray) -> bool:
    """Whether a second sensor, that leaves `left` (m, c) of what moved, measures the same thing."""
    known = np.isfinite(left).all(axis=1)
    if known.sum() < 20:
        return False
    by_sensor, by_motion, whole = (
        float(np.median(np.linalg.norm(part[known], axis=1))) for part in (left, left_around, moved)
    )
    return by_sensor <= max(WITNESS * whole, 2.0 * by_motion)


def leaps(left: FloatArray, step_s: FloatArray, *, least: float, longest_s: float) -> list[Leap]:
    """Steps whose residual (m, c) is none of the stream's usual ones, neighbouring ones as one.

    Args:
        least: smallest size that is looked for.
        longest_s: longer steps are pauses, over which anything may happen.
    """
    size = np.where(step_s <= longest_s, np.linalg.norm(left, axis=1), 0.0)
    size = np.where(np.isfinite(size), size, 0.0)
    usual = 1.4826 * float(np.median(size[size > 0.0])) if (size > 0.0).any() else 0.0
    found = np.flatnonzero(size > max(0.5 * least, USUAL * usual))
    if len(found) > MOST:
        found = np.sort(found[np.argsort(size[found])[-MOST:]])
    runs = np.split(found, np.flatnonzero(np.diff(found) > 1) + 1)
    whole = [Leap(int(run[0]), int(run[-1]) + 1) for run in runs if len(run)]
    return [leap for leap in whole if _stands_out(size, leap)]


def _stands_out(size: FloatArray, leap: Leap) -> bool:
    first, last = leap.before, leap.after
    near = np.concatenate([size[max(0, first - LOCAL_STEPS) : max(0, first - 2)], size[last + 2 : last + LOCAL_STEPS]])
    return len(near) < 10 or float(size[first:last].max()) > LOCAL * float(np.quantile(near, 0.9))


def parted(
    found: list[Leap], time_s: FloatArray, left_after: Callable[[Leap, Leap], float], size: Callable[[Leap], float]
) -> tuple[list[Leap], list[tuple[Leap, Leap]]]:
    """Jumps, and excursions as the leap there and the one back.

    Args:
        time_s: of the rows that leaps count.
        left_after: size of what is left of two leaps together.
    """
    jumps: list[Leap] = []
    excursions: list[tuple[Leap, Leap]] = []
    k = 0
    while k < len(found):
        there = found[k]
        inside = [Leap(there.before, row) for row in range(there.before + 1, there.after)]
        if peak := max(inside, key=size, default=None):
            back = Leap(peak.after, there.after)
            if left_after(peak, back) < RETURNED * size(peak):  # a spike: there and back in neighbouring steps
                excursions.append((peak, back))
                k += 1
                continue
        later = next(
            (
                j
                for j in range(k + 1, min(k + 4, len(found)))
                if time_s[found[j].after] - time_s[there.before] <= EXCURSION_S
                and left_after(there, found[j]) < RETURNED * size(there)
            ),
            None,
        )
        if later is None:
            jumps.append(there)
            k += 1
        else:
            excursions.append((there, found[later]))
            k = later + 1
    return jumps, excursions


Mask = NDArray[np.bool_]


def outside(time_s: FloatArray, before: IndexArray, after: IndexArray, spans: Sequence[Span]) -> Mask:
    """(k,) which steps from row to row do not lie over one of the spans, where the log is split already."""
    free = np.ones(len(before), dtype=bool)
    for begin_s, end_s in spans:
        free &= ~((time_s[before] < end_s) & (time_s[after] > begin_s))
    return free
