"""What people study of a flight beside its curves over time: spectra, one stream against another, tables of numbers."""

import csv
import importlib
import io
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

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
MOST_COLUMNS = 240
"""Instants of a spectrogram."""
SPECTROGRAM_DB = 60.0
"""Below its peak: weaker is drawn alike."""
_WINDOWS = 8
"""Lengths of a window in the longest stretch."""
_TIME_DIGITS = 9
"""Of seconds, in a table."""


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


@dataclass(frozen=True, slots=True, eq=False)
class Density:
    """Power spectral density of one curve."""

    frequency_hz: FloatArray
    """(m,)."""
    density: FloatArray
    """(m,) in the unit squared a Hz: its integral over frequency is the variance."""
    share: float
    """Of the samples that are in it, 0 to 1; the others stand in stretches too short for one window."""


@dataclass(frozen=True, slots=True, eq=False)
class Spectrogram:
    """Power of one curve over time and frequency."""

    time_s: FloatArray
    """(k,)."""
    frequency_hz: FloatArray
    """(m,)."""
    power_db: FloatArray
    """(m, k), of the unit squared a Hz."""


def density(samples: Samples) -> Density:
    """By Welch's method: Hann windows that overlap by half, the mean of each taken off; about eight lengths of a window
    in the longest stretch, so that noise does not look like peaks.

    Pauses of the log are left out: no window reaches over one. Between, samples are taken for evenly spaced, by
    straight lines at their median step. What the stretches give is averaged by their numbers of windows.

    Raises:
        InputError: no stretch without a pause is long enough.
    """
    from scipy import signal

    step_s, found_even = _even_stretches(samples)
    even = [values for _, values in found_even]
    longest = max(len(part) for part in even)
    length = 2 * int(np.clip(longest // _WINDOWS // 2, LEAST_SAMPLES // 2, MOST_BANDS))
    long_enough = [part for part in even if len(part) >= length]
    found = [signal.welch(part, 1.0 / step_s, nperseg=length, noverlap=length // 2) for part in long_enough]
    step = length - length // 2
    windows = [(len(part) - length // 2) // step for part in long_enough]
    used = sum(length // 2 + count * step for count in windows)
    mean = np.average([power for _, power in found], axis=0, weights=windows)
    return Density(found[0][0], mean, min(used / sum(len(part) for part in even), 1.0))


def spectrogram(samples: Samples) -> Spectrogram:
    """Power over time and frequency, dB: Hann windows that overlap by three quarters, the mean of each taken off; of
    more than `MOST_COLUMNS` windows, neighbours are averaged.

    Of the longest stretch without a pause, taken for evenly spaced as by `density`.

    Raises:
        InputError: it is too short.
    """
    from scipy import signal

    step_s, even = _even_stretches(samples)
    time_s, values = max(even, key=lambda part: len(part[0]))
    length = 2 * int(np.clip(len(values) // MOST_COLUMNS * 4 // 2, LEAST_SAMPLES // 2, MOST_BANDS // 4))
    frequency_hz, at_s, power = signal.spectrogram(
        values, 1.0 / step_s, window="hann", nperseg=length, noverlap=length - length // 4, detrend="constant"
    )
    begins = np.arange(0, len(at_s), -(-len(at_s) // MOST_COLUMNS))  # of windows that are one column together
    together = np.diff(begins, append=len(at_s))
    at_s, power = np.add.reduceat(at_s, begins) / together, np.add.reduceat(power, begins, axis=1) / together
    least = max(float(power.max()), np.finfo(float).tiny) * 10.0 ** (-0.1 * SPECTROGRAM_DB)
    return Spectrogram(time_s[0] + at_s, frequency_hz, 10.0 * np.log10(np.maximum(power, least)))


def _even_stretches(samples: Samples) -> tuple[float, list[tuple[FloatArray, FloatArray]]]:
    """The median step, s, and times and values at even steps of each stretch without a pause, one of them long enough.

    Raises:
        InputError: none is.
    """
    known = np.isfinite(samples.values)
    time_s, values = samples.time_s[known], samples.values[known]
    if len(time_s) < LEAST_SAMPLES:
        raise InputError(f"{samples.label} has {len(time_s)} samples here; a spectrum needs {LEAST_SAMPLES}: zoom out")
    step_s = float(np.median(np.diff(time_s)))
    spans = np.split(time_s, np.searchsorted(time_s, pyramid.gaps(time_s)[:, 1]))
    even_s = [np.arange(part[0], part[-1] + 0.5 * step_s, step_s) for part in spans]
    longest = max(len(part) for part in even_s)
    if longest < LEAST_SAMPLES:
        raise InputError(
            f"{samples.label} pauses every {longest} samples; a spectrum needs {LEAST_SAMPLES} without one"
        )
    return step_s, [(part, np.interp(part, time_s, values)) for part in even_s]


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


def joined(parts: Sequence[Samples]) -> Samples:
    """Of one curve, stretches that follow each other."""
    time_s, values = (np.concatenate(each) for each in zip(*((one.time_s, one.values) for one in parts), strict=True))
    return replace(parts[0], time_s=time_s, values=values)


def beside(stretches: Iterable[list[Samples]], others: Sequence[Samples]) -> Iterator[list[Samples]]:
    """Stretches, with what further curves have until the end of each; their rest comes last."""
    last: list[Samples] = []
    begin_s = -np.inf
    for last in stretches:
        end_s = max((one.time_s[-1] for one in last if len(one.time_s)), default=begin_s)
        yield [*last, *(_between(one, begin_s, end_s) for one in others)]
        begin_s = end_s
    yield [*(_between(one, begin_s, begin_s) for one in last), *(_between(one, begin_s, np.inf) for one in others)]


def _between(one: Samples, begin_s: float, end_s: float) -> Samples:
    part = slice(*np.searchsorted(one.time_s, [begin_s, end_s], side="right"))
    return replace(one, time_s=one.time_s[part], values=one.values[part])


def table(stretches: Iterable[list[Samples]], shift_s: float) -> Iterator[bytes]:
    """A CSV, piece by piece: both times, then a column for each curve, empty at instants at which others were sampled.

    Args:
        stretches: the same curves in each.
        shift_s: of the shifted time, which is 0 at so many seconds of the log.
    """
    for i, curves in enumerate(stretches):
        if i == 0:
            yield _line(["log_time_s", "plot_time_s", *(_title(one) for one in curves)])
        times_s, columns = _side_by_side(curves)
        if len(times_s):
            yield _lines([*_times(times_s, shift_s), *columns])


def _times(times_s: FloatArray, shift_s: float) -> list[FloatArray]:
    """Of the log, and of the plot."""
    return [np.round(times_s + since_s, _TIME_DIGITS) for since_s in (shift_s, 0.0)]


def _side_by_side(curves: Sequence[Samples]) -> tuple[FloatArray, FloatArray]:
    """(n,) instants at which any of the curves was measured, and (k, n) their values, NaN where one was not."""
    every_s = np.unique(np.concatenate([one.time_s for one in curves]))
    columns = np.full((len(curves), len(every_s)), np.nan)
    for column, one in zip(columns, curves, strict=True):
        column[np.searchsorted(every_s, one.time_s)] = one.values
    there = np.isfinite(columns).any(axis=0)
    return every_s[there], columns[:, there]


def _lines(columns: Sequence[FloatArray]) -> bytes:
    """NaN is an empty cell; the other numbers in as many digits as tell them from their neighbours."""
    pa, csv_writer = importlib.import_module("pyarrow"), importlib.import_module("pyarrow.csv")  # they carry no types
    named = {f"{i}": pa.array(column, from_pandas=True) for i, column in enumerate(columns)}
    text = pa.BufferOutputStream()
    csv_writer.write_csv(pa.table(named), text, csv_writer.WriteOptions(include_header=False))
    return text.getvalue().to_pybytes()


def _title(one: Samples) -> str:
    label = "" if one.label == one.key.rpartition(":")[2] else f" {one.label}"
    return f"{one.key}{label}{f' [{one.unit}]' if one.unit else ''}"


def _line(cells: Sequence[str]) -> bytes:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerow(cells)
    return text.getvalue().encode()


class _Sink(io.RawIOBase):
    """A file that is read while it is written, and kept nowhere."""

    def __init__(self) -> None:
        super().__init__()
        self._pieces, self._at = list[bytes](), 0

    def writable(self) -> bool:
        return True

    def write(self, data: Any, /) -> int:
        self._pieces.append(bytes(data))
        self._at += len(self._pieces[-1])
        return len(self._pieces[-1])

    def tell(self) -> int:
        return self._at

    def taken(self) -> bytes:
        """What was written since it was asked last."""
        taken, self._pieces = b"".join(self._pieces), []
        return taken


def parquet(stretches: Iterable[list[Samples]], shift_s: float) -> Iterator[bytes]:
    """As `table`, in Parquet: numbers as they were logged, with names and units as the CSV has them."""
    pa, pq = importlib.import_module("pyarrow"), importlib.import_module("pyarrow.parquet")  # they carry no types
    with _Sink() as sink:
        writer = None
        for curves in stretches:
            times_s, columns = _side_by_side(curves)
            if writer is None:
                names = ["log_time_s", "plot_time_s", *(_title(one) for one in curves)]
                schema = pa.schema([(name, pa.float64()) for name in names])
                writer = pq.ParquetWriter(sink, schema, compression="zstd")
            arrays = [*_times(times_s, shift_s), *columns]
            writer.write_table(pa.table([pa.array(each, from_pandas=True) for each in arrays], schema=schema))
            if piece := sink.taken():
                yield piece
        if writer is not None:
            writer.close()
        yield sink.taken()
