"""Recorded flights that are open: their streams at the level of detail that a plot asks for, and where the vehicle was.

Columns are read when a plot wants them, and forgotten, the longest unused first, when all open flights together take
more than `MOST_BYTES`; what the present answer needs stays.
"""

import threading
from collections import OrderedDict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from firmware_bridge.airborne import IN_FREE_AIR
from firmware_bridge.controller import State
from flight import FloatArray, InputError, flight_log
from flight.flight_log import COLUMNS
from flight.project import Project
from gcs_web.flights import formulas, pyramid, streams, studies
from gcs_web.flights.alignment import Signal
from gcs_web.flights.pyramid import Pyramid
from gcs_web.flights.studies import Samples
from gcs_web.protocol.flights import CurvePart, OpenedFlight, Stream, StreamGroup, StreamPart

MOST_BYTES = 160 << 20
"""Four flights side by side, each of a million samples in four plots."""
SAMPLE_BYTES = 5
"""Of a curve, its levels of detail included."""
MOST_POINTS = 4000
"""Times in one answer, whatever was asked for."""
PATH_POINTS = 2000
"""Of a path in the 3D view."""


@dataclass(frozen=True, slots=True, eq=False)
class Path3D:
    """Where a vehicle was: at the level of detail of the 3D view."""

    time_s: FloatArray
    """(m,) shifted, as in plots."""
    position_world_m: FloatArray
    """(m, 3)."""
    q_world_body: FloatArray | None
    planned_world_m: FloatArray | None
    planned_q_world_body: FloatArray | None


@dataclass(frozen=True, slots=True)
class States:
    """What a log's mission state says; of a log without one, nothing."""

    flies_trajectory: bool
    begins_in_air: bool


@dataclass(frozen=True, slots=True, eq=False)
class _Opened:
    path: Path
    stamp: tuple[int, int]
    columns: tuple[str, ...]
    quantities: Mapping[str, streams.Quantity]
    time_s: FloatArray
    gaps_s: FloatArray
    shift_s: float
    states: States


class Recorded:
    """Thread-safe."""

    def __init__(self, opened: Project) -> None:
        self._project = opened
        self._lock = threading.RLock()
        self._opened: dict[str, _Opened] = {}
        self._kept: OrderedDict[tuple[str, str], list[Pyramid]] = OrderedDict()

    def open(self, name: str, written: Sequence[str] = ()) -> OpenedFlight:
        """
        Args:
            written: keys of formulas that are offered too.

        Raises:
            FlightError: there is no such flight, or it cannot be read.
        """
        found = self._found(name)
        time_s = found.time_s - found.shift_s
        listed = [Stream(q.key, q.name, q.unit, _group(q)) for q in found.quantities.values()]
        left_out = []
        for key in written:
            try:
                own = _quantity(name, found, key)
            except InputError as error:
                left_out.append(str(error))
                continue
            listed.append(Stream(own.key, own.name, own.unit, "column"))
        return OpenedFlight(name, float(time_s[0]), float(time_s[-1]), found.shift_s, listed, left_out)

    def read(self, name: str, keys: Sequence[str], from_s: float, to_s: float, points: int) -> list[StreamPart]:
        """Streams of a flight over a stretch of its shifted time.

        Raises:
            FlightError: the flight or a stream is not there.
        """
        quantities, found = self._asked(name, keys, from_s, to_s)
        wanted = min(max(points, 2), MOST_POINTS)
        answer = []
        for quantity, curves in zip(quantities, self._curves(name, found, quantities), strict=True):
            part = pyramid.part(found.time_s, curves, from_s + found.shift_s, to_s + found.shift_s, wanted)
            when, values = pyramid.parted(*part, found.gaps_s)
            lines = [
                CurvePart(curve.label, curve.kind, line.tolist())
                for curve, line in zip(quantity.curves, values, strict=True)
            ]
            answer.append(StreamPart(name, quantity.key, (when - found.shift_s).tolist(), lines))
        return answer

    def samples(self, name: str, keys: Sequence[str], from_s: float, to_s: float) -> list[Samples]:
        """Every sample of streams' curves over a stretch of the flight's shifted time, as the log has them: what a plot
        bridges is NaN. Raises as `read`."""
        stretches = list(self.stretches(name, keys, from_s, to_s))
        return [studies.joined(parts) for parts in zip(*stretches, strict=True)]

    def stretches(self, name: str, keys: Sequence[str], from_s: float, to_s: float) -> Iterator[list[Samples]]:
        """`samples` one piece of the log after the other, so that a long one needs little memory. Raises as `read`,
        before the first piece; `FlightError` with a piece that cannot be read."""
        quantities, found = self._asked(name, keys, from_s, to_s)
        return _stretches(found, quantities, from_s, to_s)

    def states(self, name: str) -> States:
        """Raises as `open`."""
        return self._found(name).states

    def measured(self, name: str, key: str) -> Signal:
        """All samples of a stream's measured curve on the flight's shifted time, NaN where it was not measured.

        Raises:
            FlightError: the flight cannot be read, or has no such stream.
        """
        found = self._found(name)
        if key not in found.quantities:
            raise InputError("was not measured")
        quantity = found.quantities[key]
        place = next(i for i, curve in enumerate(quantity.curves) if curve.kind == "measured")
        (curves,) = self._curves(name, found, [quantity])
        return Signal(found.time_s - found.shift_s, curves[place].samples.astype(np.float64))

    def gaps_s(self, name: str) -> FloatArray:
        """(k, 2) begin and end of each pause of the log, on the flight's shifted time. Raises as `open`."""
        found = self._found(name)
        return found.gaps_s - found.shift_s

    def path(self, name: str) -> Path3D:
        """
        Raises:
            FlightError: the flight cannot be read, or has no positions.
        """
        found = self._found(name)
        names, _ = flight_log.head(found.path)
        there = [q for q in _POSES if set(COLUMNS[q]) <= set(names)]
        if "position_world_m" not in there:
            raise InputError(f"{name} has no positions to draw")
        places = flight_log.pieces(found.path, COLUMNS["position_world_m"])
        known = np.flatnonzero(
            np.concatenate([np.isfinite(piece.vector("position_world_m")).all(axis=1) for piece in places])
        )
        if len(known) < 2:
            raise InputError(f"{name} has no positions to draw")
        rows = known[np.linspace(0, len(known) - 1, min(PATH_POINTS, len(known))).astype(int)]
        read = _rows(found.path, there, rows)
        return Path3D(
            found.time_s[rows] - found.shift_s,
            read["position_world_m"],
            read.get("q_world_body"),
            read.get("setpoint_position_world_m"),
            read.get("setpoint_q_world_body"),
        )

    @property
    def nbytes(self) -> int:
        with self._lock:
            kept = sum(curve.nbytes for curves in self._kept.values() for curve in curves)
            return kept + sum(found.time_s.nbytes for found in self._opened.values())

    def _asked(
        self, name: str, keys: Sequence[str], from_s: float, to_s: float
    ) -> tuple[list[streams.Quantity], _Opened]:
        if not from_s < to_s:  # nor if either is no number
            raise InputError(f"a stretch from {from_s:g} s to {to_s:g} s has no length")
        found = self._found(name)
        return [_quantity(name, found, key) for key in keys], found

    def _found(self, name: str) -> _Opened:
        path = self._project.flight(name)
        try:
            status = path.stat()
        except OSError:
            raise InputError(f"there is no flight {name} (any more)") from None
        stamp = (status.st_mtime_ns, status.st_size)
        with self._lock:
            known = self._opened.pop(name, None)
            if known is None or known.stamp != stamp:
                self._forget(name)
                known = _open(path, stamp)
            self._opened[name] = known  # last: used most recently
            self._make_room(name)
            return known

    def _curves(self, name: str, found: _Opened, quantities: Sequence[streams.Quantity]) -> list[list[Pyramid]]:
        with self._lock:
            kept = {q.key: self._kept[name, q.key] for q in quantities if (name, q.key) in self._kept}
            for key in kept:
                self._kept.move_to_end((name, key))
            missing = [q for q in quantities if q.key not in kept]
            if missing:
                rows = len(found.time_s)
                coming = sum(len(q.curves) for q in missing) * rows * SAMPLE_BYTES
                self._make_room(name, len(kept), coming)
                for quantity, lines in zip(missing, streams.read(found.path, missing, rows), strict=True):
                    made = [Pyramid.of(pyramid.bridged(found.time_s, line)) for line in lines]
                    kept[quantity.key] = self._kept[name, quantity.key] = made
            return [kept[quantity.key] for quantity in quantities]

    def _make_room(self, wanted: str, needed: int = 0, coming: int = 0) -> None:
        """Forget what was not used for longest, but not the flight `wanted` and the `needed` streams used last, until
        there is room for so many bytes more."""
        while self.nbytes + coming > MOST_BYTES:
            others = next((other for other in self._opened if other != wanted), None)
            if others is not None:
                del self._opened[others]
                self._forget(others)
            elif len(self._kept) > needed:
                self._kept.popitem(last=False)
            else:
                return

    def _forget(self, name: str) -> None:
        for place in [place for place in self._kept if place[0] == name]:
            del self._kept[place]


_POSES = ("position_world_m", "q_world_body", "setpoint_position_world_m", "setpoint_q_world_body")


def _open(path: Path, stamp: tuple[int, int]) -> _Opened:
    names, _ = flight_log.head(path)
    has_state = "mission_state" in names
    times, flying_s, first = [np.zeros(0)], np.zeros(0), np.zeros(0)
    for piece in flight_log.pieces(path, ["mission_state"] if has_state else []):
        times.append(piece.time_s.copy())  # of its own, or all that was read with it would stay in memory
        if has_state:
            states = piece.columns["mission_state"]
            flying_s = flying_s if len(flying_s) else piece.time_s[states == State.TRAJECTORY][:1].copy()
            first = first if len(first) else states[np.isfinite(states)][:1].copy()
    time_s = np.concatenate(times)
    if not len(time_s):
        raise InputError(f"{path.name} is empty")
    # Where the trajectory begins, flights of one course stand side by side.
    begins_s = flying_s[0] if len(flying_s) else time_s[0]
    states = States(len(flying_s) > 0, bool(np.isin(first, IN_FREE_AIR).any()))
    return _Opened(
        path, stamp, tuple(names), streams.of_log(names), time_s, pyramid.gaps(time_s), float(begins_s), states
    )


def _quantity(name: str, found: _Opened, key: str) -> streams.Quantity:
    """Raises `InputError` where the flight has none of this key."""
    if key.startswith(formulas.PREFIX):
        return formulas.quantity(key, found.columns)
    if key not in found.quantities:
        raise InputError(f"{name} has no stream {key}")
    return found.quantities[key]


def _stretches(
    found: _Opened, quantities: Sequence[streams.Quantity], from_s: float, to_s: float
) -> Iterator[list[Samples]]:
    needs = {column for quantity in quantities for curve in quantity.curves for column in curve.needs}
    for piece in flight_log.pieces(found.path, needs):
        time_s = piece.time_s - found.shift_s
        part = slice(np.searchsorted(time_s, from_s, side="left"), np.searchsorted(time_s, to_s, side="right"))
        yield [
            Samples(q.key, curve.label, curve.kind, q.unit, time_s[part], curve.values(piece.columns)[part])
            for q in quantities
            for curve in q.curves
        ]
        if time_s[-1] > to_s:
            return


def _rows(path: Path, quantities: Sequence[str], rows: np.ndarray) -> dict[str, FloatArray]:
    """Some rows of a log's vectors; `rows` increase."""
    read: dict[str, list[FloatArray]] = {quantity: [] for quantity in quantities}
    begin = 0
    for piece in flight_log.pieces(path, [column for quantity in quantities for column in COLUMNS[quantity]]):
        low, high = np.searchsorted(rows, [begin, begin + len(piece)])
        for quantity, parts_read in read.items():
            parts_read.append(np.stack([piece.columns[c][rows[low:high] - begin] for c in COLUMNS[quantity]], axis=1))
        begin += len(piece)
    return {quantity: np.concatenate(parts_read) for quantity, parts_read in read.items()}


def _group(quantity: streams.Quantity) -> StreamGroup:
    return "column" if quantity.key.startswith(streams.COLUMN) else "flight"
