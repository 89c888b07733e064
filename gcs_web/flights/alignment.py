"""How far one recorded flight's clock must move to stand beside another's: by an event, or by correlation of a stream.

Pure functions of sampled signals. Every answer may be that the signals do not say: `InputError` tells why.
"""

from dataclasses import dataclass

import numpy as np

from flight import FloatArray, InputError
from gcs_web.flights import pyramid

LASTS_S = 0.5
"""A threshold is passed where the signal keeps above it for so long; before, it was below it for as long."""
TAKE_OFF_M, MOTION_M_S = 0.1, 0.15
"""Height over that at the log's beginning, and speed, that are more than an estimator's noise at rest."""
LEAST_PEAK, LEAST_LEAD = 0.7, 0.1
"""Correlation that an alignment must reach, and by how much it must exceed that of any shift outside the peak."""
LEAST_OVERLAP = 0.5
"""Share of the shorter signal's samples that a shift must leave to compare."""
LEAST_VARIANCE = 0.1
"""Share of each signal's variance that the compared samples must have: a still stretch correlates with anything."""
MOST_SAMPLES = 50_000
"""Of the longer signal, when both are sampled anew at equal steps."""


@dataclass(frozen=True, slots=True, eq=False)
class Signal:
    """What one flight measured."""

    time_s: FloatArray
    """(n,) increasing."""
    values: FloatArray
    """(n,), NaN where nothing was measured."""


@dataclass(frozen=True, slots=True)
class Correlated:
    """The peak of a correlation over shifts."""

    shift_s: float
    """To be added to the second signal's time."""
    peak: float
    """Pearson correlation at that shift, at most 1."""
    half_width_s: float
    """The correlation falls to half its peak within so much on the wider side."""
    elsewhere: float
    """Largest correlation at shifts outside that peak; 0 where there is none."""


def first_above(signal: Signal, threshold: float) -> float:
    """When a signal first passes a threshold and keeps above it for `LASTS_S`, s.

    Raises:
        InputError: it is above from the beginning, or never, or was not measured.
    """
    known = np.isfinite(signal.values)
    time_s, values = signal.time_s[known], signal.values[known]
    if len(values) < 2:
        raise InputError("was not measured")
    if np.median(values[time_s <= time_s[0] + LASTS_S]) > threshold:
        raise InputError("was there from the beginning of the log")
    parted_s, (parted,) = pyramid.parted(time_s, [values], pyramid.gaps(time_s))
    is_above = np.concatenate([[False], parted > threshold, [False]]).astype(int)
    begins, ends = np.flatnonzero(np.diff(is_above) == 1), np.flatnonzero(np.diff(is_above) == -1) - 1
    lasting = parted_s[ends] - parted_s[begins] >= LASTS_S
    if not lasting.any():
        raise InputError(f"does not come: nothing stays above {threshold:g} for {LASTS_S:g} s")
    return float(parted_s[begins[lasting][0]])


def above_beginning(height: Signal) -> Signal:
    """Height over that at which the log begins, the median of its first `LASTS_S`, m."""
    known = np.isfinite(height.values)
    if not known.any():
        raise InputError("was not measured")
    first_s = height.time_s[known][0]
    rest = np.median(height.values[known & (height.time_s <= first_s + LASTS_S)])
    return Signal(height.time_s, height.values - rest)


def by_correlation(one: Signal, other: Signal, *, least_spread: float) -> Correlated:
    """The shift of `other` at which it correlates best with `one`.

    Pearson correlation of the samples that both have at each shift, with gaps masked: Padfield, Masked Object
    Registration in the Fourier Domain, IEEE Trans. Image Processing 21(5), 2012, eq. (23), in one dimension. Both are
    taken as means over equal steps, of the slower sampled one; a parabola through the peak gives fractions of a step.

    Args:
        least_spread: standard deviation below which a signal is flat, in its unit.

    Raises:
        InputError: the signals do not say which shift is right: one is flat, or the peak is low, wide, or one of
            several that are about as high.
    """
    step_s = max(_usual_step_s(one), _usual_step_s(other), max(map(_length_s, (one, other))) / MOST_SAMPLES)
    first_s, second_s = one.time_s[0], other.time_s[0]
    a, b = _means(one, first_s, step_s), _means(other, second_s, step_s)
    if min(np.nanstd(a), np.nanstd(b)) < least_spread:
        raise InputError(f"one of the two is flat: it varies by less than {least_spread:g}")
    found = _masked_correlation(a, b)
    if not np.isfinite(found).any():
        raise InputError("no shift leaves enough of both to compare")
    place = int(np.nanargmax(found))
    peak = float(found[place])
    if peak < LEAST_PEAK:
        raise InputError(f"the correlation is {peak:.2f} at most, less than {LEAST_PEAK:g}")
    below = np.flatnonzero(~(found >= 0.5 * peak))
    before, after = below[below < place], below[below > place]
    if not len(before) or not len(after) or not np.isfinite(found[[before[-1], after[0]]]).all():
        raise InputError(f"the correlation has no peak: it is {peak:.2f} and does not fall on both sides of it")
    outside = np.concatenate([found[: before[-1]], found[after[0] :]])
    elsewhere = max(0.0, float(np.nanmax(outside)))
    if elsewhere > peak - LEAST_LEAD:
        raise InputError(
            f"two shifts fit about as well: the correlation is {peak:.2f} at one, {elsewhere:.2f} at another"
        )
    lag = place - (len(b) - 1) + _vertex(*found[place - 1 : place + 2])
    half_width_s = step_s * max(place - before[-1], after[0] - place)
    return Correlated(float(first_s - second_s + step_s * lag), peak, float(half_width_s), elsewhere)


def _usual_step_s(signal: Signal) -> float:
    known_s = signal.time_s[np.isfinite(signal.values)]
    if len(known_s) < 3:
        raise InputError("one of the two was not measured")
    return float(np.median(np.diff(known_s)))


def _length_s(signal: Signal) -> float:
    return float(np.ptp(signal.time_s))


def _means(signal: Signal, first_s: float, step_s: float) -> FloatArray:
    """Means of the line through the samples over equal steps, the first around `first_s`; NaN where a gap reaches."""
    known = np.isfinite(signal.values)
    time_s, values = signal.time_s[known], signal.values[known]
    integral = np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(time_s))])
    edges_s = first_s + step_s * (np.arange(int((signal.time_s[-1] - first_s) / step_s) + 2) - 0.5)
    means = np.diff(np.interp(edges_s, time_s, integral)) / step_s
    low_s, high_s = edges_s[:-1], edges_s[1:]
    means[(low_s < time_s[0]) | (high_s > time_s[-1])] = np.nan
    for begin_s, end_s in pyramid.gaps(time_s):
        means[(high_s > begin_s) & (low_s < end_s)] = np.nan
    return means


def _masked_correlation(a: FloatArray, b: FloatArray) -> FloatArray:
    """(len(a) + len(b) - 1,) correlation with b's first sample beside a's sample k - (len(b) - 1), NaN where it says
    nothing."""
    seen_a, seen_b = np.isfinite(a), np.isfinite(b)
    a, b = np.where(seen_a, a - np.nanmean(a), 0.0), np.where(seen_b, b - np.nanmean(b), 0.0)
    a, b = a / a[seen_a].std(), b / b[seen_b].std()

    def sums(left: FloatArray, right: FloatArray) -> FloatArray:
        from scipy.signal import fftconvolve  # half of what the station's processes would import

        return fftconvolve(left, right[::-1])

    count = np.round(sums(seen_a.astype(float), seen_b.astype(float)))
    n = np.maximum(count, 1.0)
    mean_a, mean_b = sums(a, seen_b.astype(float)) / n, sums(seen_a.astype(float), b) / n
    variance_a = sums(a**2, seen_b.astype(float)) / n - mean_a**2
    variance_b = sums(seen_a.astype(float), b**2) / n - mean_b**2
    enough = count >= max(3.0, LEAST_OVERLAP * min(seen_a.sum(), seen_b.sum()))
    enough &= np.minimum(variance_a, variance_b) >= LEAST_VARIANCE
    found = np.full(len(n), np.nan)
    covariance = sums(a, b) / n - mean_a * mean_b
    found[enough] = covariance[enough] / np.sqrt(variance_a[enough] * variance_b[enough])
    return found


def _vertex(left: float, middle: float, right: float) -> float:
    """Where the parabola through three equally spaced values peaks, from the middle one, in steps."""
    bend = left - 2.0 * middle + right
    return float(0.5 * (left - right) / bend) if bend < 0.0 else 0.0
