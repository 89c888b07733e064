"""Recorded flights beside plan and model: their streams, the newest comparison, and whether it is out of date."""

import threading
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import vehicle
from flight import FlightError, FloatArray, InputError
from gcs_web.comparison import reports, residuals
from gcs_web.comparison.arrows import Wrench
from gcs_web.comparison.flight_scene import FlightScene
from gcs_web.comparison.residuals import Compared
from gcs_web.flights import pyramid, reading, studies
from gcs_web.flights.flights import Flights
from gcs_web.flights.studies import Samples
from gcs_web.protocol.comparison import ArrowScale, Comparison, Scatter, ShowFlights
from gcs_web.protocol.flights import CurvePart, OpenedFlight, Pairs, Spectrogram, Spectrum, SpectrumCurve, StreamPart
from sysid.estimator.validation.comparison import Deviation

if TYPE_CHECKING:
    from flight.project import Project

MOST_STREAMS = 64
"""In one table."""
PIECES_APART = 2.0
"""Means that are further apart than so many of their spans belong to different pieces of a flight."""


def comparison_file(folder: Path) -> Path:
    return folder / ".session" / "comparison.msgpack"


class Comparing:
    """Thread-safe."""

    def __init__(self, opened: "Project", flights: Flights, scene: FlightScene) -> None:
        self._project, self._flights, self._scene = opened, flights, scene
        self._lock = threading.RLock()
        self._compared: Compared | None = residuals.load(comparison_file(opened.folder))

    def take(self, compared: Compared) -> None:
        with self._lock:
            self._compared = compared

    def state(self) -> Comparison:
        """The newest comparison as the page shows it; `old` if vehicle or flights are others now."""
        compared = self._compared
        if compared is None:
            return Comparison("none")
        held_out = [flight.name for flight in compared.flights if flight.held_out]
        learn = [flight.name for flight in compared.flights if not flight.held_out]
        return Comparison(
            "current" if self._is_current(compared, learn, held_out) else "old",
            learn,
            held_out,
            compared.judged_how,
            [residuals.variable(name) for name in compared.variables],
            residuals.channels(compared),
            residuals.horizons_s(),
            residuals.errors(compared),
            compared.predictions,
            compared.remarks,
            reports.report_file(self._project.folder, "comparison").is_file(),
        )

    def opened(self, name: str, written: Sequence[str] = ()) -> OpenedFlight:
        """A flight with all its streams, those of the comparison and the formulas `written` too.

        Raises:
            FlightError: it cannot be read.
        """
        found = self._flights.recorded.open(name, written)
        flight = self._residual(name)
        forces = [] if flight is None else [stream for stream, _, _ in residuals.forces(flight).values()]
        flown = [stream for stream in found.streams if stream.group == "flight"]
        columns = [stream for stream in found.streams if stream.group == "column"]
        all_there = [*flown, *forces, *columns]
        return OpenedFlight(name, found.start_s, found.end_s, found.shift_s, all_there, found.left_out)

    def read(self, name: str, keys: list[str], from_s: float, to_s: float, points: int) -> list[StreamPart]:
        """Streams of a flight over a stretch of its shifted time.

        Raises:
            FlightError: the flight or a stream is not there.
        """
        flight = self._residual(name)
        ours = {} if flight is None else residuals.forces(flight)
        rest = [key for key in keys if key not in ours]
        answer = {part.key: part for part in self._flights.recorded.read(name, rest, from_s, to_s, points)}
        if flight is not None:
            for key in set(keys) & set(ours):
                _, curves, band = ours[key]
                when, lines = self._with_gaps(name, flight.time_s, [np.array(curve.values) for curve in curves])
                drawn = [
                    CurvePart(curve.label, curve.kind, line.tolist()) for curve, line in zip(curves, lines, strict=True)
                ]
                answer[key] = StreamPart(name, key, when.tolist(), drawn, band)
        return [answer[key] for key in keys]

    def samples(self, name: str, key: str, from_s: float, to_s: float) -> list[Samples]:
        """Every sample of a stream over a stretch of a flight's shifted time, of the comparison's streams too.

        Raises:
            FlightError: the flight or the stream is not there.
        """
        if not from_s < to_s:
            raise InputError(f"a stretch from {from_s:g} s to {to_s:g} s has no length")
        flight = self._residual(name)
        ours = {} if flight is None else residuals.forces(flight)
        if flight is None or key not in ours:
            return self._flights.recorded.samples(name, [key], from_s, to_s)
        stream, curves, _ = ours[key]
        when = np.array(flight.time_s) - self._flights.recorded.open(name).shift_s
        inside = (when >= from_s) & (when <= to_s)
        return [
            Samples(key, one.label, one.kind, stream.unit, when[inside], np.array(one.values, dtype=float)[inside])
            for one in curves
        ]

    def spectrum(self, name: str, key: str, from_s: float, to_s: float) -> Spectrum:
        """Raises as `samples`, or if there is too little of it."""
        curves = []
        for one in self.samples(name, key, from_s, to_s):
            found = studies.density(one)
            frequency_hz, density = found.frequency_hz.tolist(), found.density.tolist()
            curves.append(SpectrumCurve(one.label, one.kind, frequency_hz, density, found.share))
        return Spectrum(name, key, curves)

    def spectrogram(self, name: str, key: str, from_s: float, to_s: float) -> Spectrogram:
        """Of what was measured. Raises as `spectrum`."""
        found = studies.spectrogram(_measured(self.samples(name, key, from_s, to_s)))
        power_db = np.round(found.power_db, 1).tolist()
        return Spectrogram(name, key, found.time_s.tolist(), found.frequency_hz.tolist(), power_db)

    def pairs(self, name: str, keys: tuple[str, str], from_s: float, to_s: float) -> Pairs:
        """What was measured of two streams, one against the other. Raises as `spectrum`."""
        x, y = (_measured(self.samples(name, key, from_s, to_s)) for key in keys)
        time_s, x_values, y_values = studies.pairs(x, y)
        return Pairs(name, time_s.tolist(), x_values.tolist(), y_values.tolist())

    def table(
        self, name: str, keys: Sequence[str], from_s: float, to_s: float, *, as_parquet: bool = False
    ) -> Iterator[bytes]:
        """A CSV or Parquet file with every sample of some streams, piece by piece. Raises as `samples`, before the
        first piece."""
        wanted = list(dict.fromkeys(keys))
        if len(wanted) > MOST_STREAMS:
            raise InputError(f"{len(wanted)} streams are more than the {MOST_STREAMS} of a table; choose fewer")
        flight = self._residual(name)
        ours = {} if flight is None else residuals.forces(flight)
        others = [one for key in wanted if key in ours for one in self.samples(name, key, from_s, to_s)]
        recorded = self._flights.recorded
        stretches = recorded.stretches(name, [key for key in wanted if key not in ours], from_s, to_s)
        write = studies.parquet if as_parquet else studies.table
        return write(studies.beside(stretches, others), recorded.open(name).shift_s)

    def asked_table(self, asked: Mapping[str, str]) -> Iterator[bytes]:
        """`table` by the words of an address: flight, streams (with | between), from and to (s). Raises as `table`."""
        try:
            from_s, to_s = float(asked["from"]), float(asked["to"])
            as_parquet = asked.get("as") == "parquet"
            return self.table(asked["flight"], asked["streams"].split("|"), from_s, to_s, as_parquet=as_parquet)
        except (KeyError, ValueError) as error:
            raise InputError(f"a flight, streams, from and to are needed ({error})") from error

    def scatter(self, channel: str, variable: str) -> Scatter:
        """
        Raises:
            FlightError: there is no comparison, or it does not have these.
        """
        compared = self._compared
        if compared is None:
            raise InputError("nothing was compared yet; compare the flights with the model first")
        return residuals.scatter(compared, channel, variable, self._shifts(compared))

    def draw(self, wanted: ShowFlights) -> tuple[ArrowScale | None, float | None]:
        """Draw these flights in the 3D view, and no others.

        Returns:
            The scale of the arrows, and the value at the upper end of the colours; None where there are none.

        Raises:
            FlightError: a flight cannot be read, or nothing is predicted over that horizon.
        """
        names, colour = wanted.flights, wanted.colour
        paths = {name: self._flights.recorded.path(name) for name in names}
        values: dict[str, tuple[FloatArray, FloatArray]] = {}
        for name in names if colour else []:
            flight = self._residual(name)
            if flight is not None:
                row = residuals.CHANNELS.index(colour)
                when, (left,) = self._with_gaps(name, flight.time_s, [np.array(flight.residual[row])])
                values[name] = (when, left)
        wrenches: dict[str, Wrench] = {}
        for name in names if wanted.arrows else []:
            flight = self._residual(name)
            if flight is not None:
                when, left = self._with_gaps(name, flight.time_s, [np.array(channel) for channel in flight.residual])
                wrenches[name] = Wrench(when, np.stack(left, axis=1))
        deviations: dict[str, Deviation] = {}
        for name in names[:1] if wanted.predicted_s is not None else []:
            flight = self._residual(name)
            if flight is not None:
                ended = flight.predicted[_horizon(wanted.predicted_s)]
                when, pose = self._with_gaps(name, ended.time_s, [np.array(each) for each in ended.deviation])
                deviations[name] = Deviation(when, np.stack(pose, axis=1))
        return self._scene.draw(paths, values, wanted.moved_s, wrenches, deviations)

    def _with_gaps(
        self, name: str, time_s: list[float], curves: list[FloatArray]
    ) -> tuple[FloatArray, list[FloatArray]]:
        """Shifted time and values of a comparison's curves, NaN in each gap of the log and between its pieces.

        Args:
            time_s: of the values, on the log's clock.
        """
        recorded = self._flights.recorded
        shifted_s = np.array(time_s) - recorded.open(name).shift_s
        pauses = np.concatenate([recorded.gaps_s(name), pyramid.gaps(shifted_s, PIECES_APART)])
        return pyramid.parted(shifted_s, curves, pauses)

    def _residual(self, name: str) -> residuals.FlightResidual | None:
        compared = self._compared
        return None if compared is None else compared.flight(name)

    def _shifts(self, compared: Compared) -> dict[str, float]:
        found: dict[str, float] = {}
        for flight in compared.flights:
            try:
                found[flight.name] = self._flights.recorded.open(flight.name).shift_s
            except FlightError:  # discarded since
                found[flight.name] = flight.time_s[0]
        return found

    def _is_current(self, compared: Compared, learn: list[str], held_out: list[str]) -> bool:
        try:
            same = vehicle.vehicle_hash(vehicle.load(self._project.vehicle)) == compared.vehicle
        except FlightError:
            return False
        return (
            same
            and compared.logs == reading.contents(self._project, [*learn, *held_out])
            and sorted(learn) == self._flights.names("learn")
            and sorted(held_out) == self._flights.names("hold_out")
        )


def _measured(curves: Sequence[Samples]) -> Samples:
    """What was measured of a stream; of a residual, that."""
    return next((one for one in curves if one.kind in ("measured", "residual")), curves[0])


def _horizon(horizon_s: float | None) -> int:
    """Its number among those of every comparison."""
    offered = residuals.horizons_s()
    if horizon_s not in offered:
        raise InputError(f"nothing is predicted over {horizon_s} s; choose one of {', '.join(map(str, offered))} s")
    return offered.index(horizon_s)
