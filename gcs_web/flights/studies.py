"""What people study of a flight beside its curves over time: spectra, one stream against another, tables of numbers."""

import csv
import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from flight import FloatArray, InputError
from gcs_web.flights import pyramid
from gcs_web.protocol.flights import CurveKind

LEAST_SAMPLES = 64
"""Of a stretch whose spectrum says anything."""
MOST_BANDS = 1024
"""Frequencies of a spectrum: more samples make more pieces to average, not more bands."""
MOST_PAIRS = 4000
"""Points of one stream against another."""


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """One curve of a stream at every instant at which it was sampled, over a stretch of the flight's shifted time."""

    key: str
    label: str
    kind: CurveKind
    unit: str
    time_s: FloatArray
    """(n,) increasing."""
    values: FloatArray
    """(n,), NaN where nothing was measured."""


def density(samples: Samples) -> tuple[FloatArray, FloatArray]:
    """Power spectral density by Welch's method: Hann windows that overlap by half, the mean of each taken off.

    Pauses of the log are left out: no piece reaches over one. Between, samples are taken for evenly spaced, by
    straight lines at their median step. The integral over frequency is the variance.

    Returns:
        (m,) frequencies in Hz, and (m,) densities in the unit squared a Hz.

    Raises:
        InputError: no stretch without a pause is long enough.
    """
    known = np.isfinite(samples.values)
    time_s, values = samples.time_s[known], samples.values[known]
    if len(time_s) < LEAST_SAMPLES:
        raise InputError(f"{samples.label} has {len(time_s)} samples here; a spectrum needs {LEAST_SAMPLES}: zoom out")
    step_s = float(np.median(np.diff(time_s)))
    cuts = np.searchsorted(time_s, pyramid.gaps(time_s)[:, 1])
    spans = [(part[0], part[-1]) for part in np.split(time_s, cuts)]
    even = [np.interp(np.arange(begin, end + 0.5 * step_s, step_s), time_s, values) for begin, end in spans]
    longest = max(len(part) for part in even)
    if longest < LEAST_SAMPLES:
        raise InputError(
            f"{samples.label} pauses every {longest} samples; a spectrum needs {LEAST_SAMPLES} without one"
        )
    length = min(2 * MOST_BANDS, longest)
    window = np.hanning(length + 1)[:-1]
    pieces = [
        part[begin : begin + length] for part in even for begin in range(0, len(part) - length + 1, max(length // 2, 1))
    ]
    power = [np.abs(np.fft.rfft(window * (piece - piece.mean()))) ** 2 for piece in pieces]
    one_sided = np.full(length // 2 + 1, 2.0)
    one_sided[0] = 1.0
    if length % 2 == 0:
        one_sided[-1] = 1.0
    scale = step_s / float(window @ window)
    frequency_hz = np.fft.rfftfreq(length, step_s).astype(np.float64)
    return frequency_hz, scale * one_sided * np.mean(power, axis=0)


def pairs(x: Samples, y: Samples) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(m,) times, and both values there: at the instants of `x`, `y` by straight lines that cross no pause of its own.

    Raises:
        InputError: at no instant are both known.
    """
    known = np.isfinite(y.values)
    if known.sum() < 2:
        raise InputError(f"{y.label} was not measured here: zoom out, or choose another stream")
    at = np.interp(x.time_s, y.time_s[known], y.values[known], left=np.nan, right=np.nan)
    for begin_s, end_s in pyramid.gaps(y.time_s[known]):
        at[(x.time_s > begin_s) & (x.time_s < end_s)] = np.nan
    both = np.flatnonzero(np.isfinite(x.values) & np.isfinite(at))
    if not len(both):
        raise InputError(f"{x.label} and {y.label} were never measured together here")
    chosen = both[:: -(-len(both) // MOST_PAIRS)]
    return x.time_s[chosen], x.values[chosen], at[chosen]


def table(curves: Sequence[Samples]) -> Iterator[str]:
    """Lines of a CSV: time, then a column for each curve, empty at instants at which others were sampled."""
    times = [one.time_s for one in curves]
    every_s = np.unique(np.concatenate(times)) if times else np.zeros(0)
    columns = np.full((len(curves), len(every_s)), np.nan)
    for column, one in zip(columns, curves, strict=True):
        column[np.searchsorted(every_s, one.time_s)] = one.values
    yield _line(["time_s", *(_title(one) for one in curves)])
    for time_s, row in zip(every_s, columns.T, strict=True):
        yield _line([f"{time_s:.6f}", *("" if np.isnan(value) else f"{value:.9g}" for value in row)])


def _title(one: Samples) -> str:
    label = "" if one.label == one.key.rpartition(":")[2] else f" {one.label}"
    return f"{one.key}{label}{f' [{one.unit}]' if one.unit else ''}"


def _line(cells: Sequence[str]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerow(cells)
    return text.getvalue()
