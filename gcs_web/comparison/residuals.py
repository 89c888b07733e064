"""What a model leaves unexplained on recorded flights: the result of a comparison as it is kept and shown."""

from collections.abc import Sequence
from pathlib import Path

import msgspec
import numpy as np

from flight import FlightLog, FloatArray, InputError, Progress, file_format
from gcs_web.flights import session_files
from gcs_web.protocol.comparison import ChannelResidual, HorizonError, Scatter, VariableName
from gcs_web.protocol.flights import CurveKind, CurvePart, Stream
from sysid.diagnosis.evidence import explained
from sysid.diagnosis.evidence.free_form import UNIT, VARIABLE
from sysid.estimator.flights.sampling import means_over
from sysid.estimator.options import Options
from sysid.estimator.result import CHANNELS, SPAN_S
from sysid.estimator.trajectory.model import along
from sysid.estimator.validation.comparison import HORIZONS_S, QUANTITIES, Comparison, Deviation, Residual, compare
from sysid.logs.checks.payload import as_flown
from sysid.report import drawing, words
from sysid.report.pages import SHOWN
from sysid.report.residual_plots import SIGMAS, unit
from vehicle import Vehicle, rigid_body

FORMAT, VERSION = "goshawk-page-comparison", 5
MODEL = "vehicle"
"""Name of the one model in the comparison, as the verb calls the project's vehicle file."""
DISTURBANCE = "measured disturbance"
"""Label of what the vehicle's observer found, as the verb has it."""


class Predicted(msgspec.Struct, frozen=True):
    """Where predictions over one horizon ended, on one flight; its pieces between gaps one after the other."""

    time_s: list[float]
    """(k,) on the log's clock."""
    deviation: list[list[float]]
    """Six of (k,): predicted less measured pose there; see `sysid.estimator.validation.comparison.Deviation`."""


class FlightResidual(msgspec.Struct, frozen=True):
    """Of one flight, means over 0.1 s; its pieces between gaps one after the other."""

    name: str
    held_out: bool
    time_s: list[float]
    """(m,) middle of each mean, on the log's clock."""
    residual: list[list[float]]
    """Six channels of (m,): measured less modelled, N and N m, body axes."""
    modelled: list[list[float]]
    sigma: list[float]
    """Of each channel, what white noise of the estimated strength gives to a mean."""
    variables: list[list[float]]
    """Each of the comparison's variables, (m,)."""
    predicted: list[Predicted]
    """For each of `HORIZONS_S`."""
    disturbance: list[list[float | None]]
    """Measured disturbance: six channels of (m,), N and N m, body axes; empty where the log holds none."""


class Compared(msgspec.Struct, frozen=True):
    """A comparison of the project's vehicle with flights."""

    format: str
    version: int
    vehicle: str
    """Hash of the vehicle's behaviour."""
    logs: str
    """`reading.contents` of the flights."""
    variables: list[str]
    shares: list[list[float]]
    """Six channels by variables."""
    judged_how: str
    rms: list[float]
    errors: dict[str, list[float]]
    """Quantity: root mean square error of prediction at each horizon."""
    predictions: int
    remarks: list[str]
    flights: list[FlightResidual]

    @property
    def names(self) -> set[str]:
        return {flight.name for flight in self.flights}

    def flight(self, name: str) -> FlightResidual | None:
        return next((flight for flight in self.flights if flight.name == name), None)


def made(
    learn: Sequence[FlightLog],
    held_out: Sequence[FlightLog],
    model: Vehicle,
    vehicle_hash: str,
    contents: str,
    options: Options,
    progress: Progress,
) -> tuple[Compared, Comparison]:
    """Compare a vehicle with flights, as `goshawk compare` does.

    Returns:
        What the page shows, and the comparison on the held-out flights, or on all if none is. Errors of prediction are
        those of the latter; the shares are of curves through the other flights, judged on the held-out ones.

    Raises:
        InputError: a log that cannot be used.
    """
    logs = [*learn, *held_out]
    both = compare(logs, {MODEL: model}, options, progress=progress)
    judged = compare(held_out, {MODEL: model}, options) if held_out and learn else both
    left = both.residuals[MODEL]
    count = len(learn)
    taught = [r for r in left if r.flight.log_index < count] or list(left)
    judging = [r for r in left if r.flight.log_index >= count] if learn else []
    variables, shares = explained.shares(taught, judging)
    named = [VARIABLE[name] for name in variables]
    deviations = _deviations(both, 0) | (_deviations(judged, count) if judged is not both else {})
    flights = []
    for i, log in enumerate(logs):
        pieces = [r for r in left if r.flight.log_index == i]
        if not pieces:
            continue
        read = [explained.read(pieces, variable).tolist() for variable in named]
        modelled = np.concatenate([_modelled(r, model) for r in pieces])
        flights.append(
            FlightResidual(
                str(log.metadata["name"]),
                i >= count,
                np.concatenate([_middles(r) for r in pieces]).tolist(),
                np.concatenate([r.means() for r in pieces]).T.tolist(),
                modelled.T.tolist(),
                pieces[0].sigma.tolist(),
                read,
                [_predicted(ends) for ends in zip(*deviations[i], strict=True)],
                _disturbance(pieces),
            )
        )
    shown = Compared(
        FORMAT,
        VERSION,
        vehicle_hash,
        contents,
        list(variables),
        shares.tolist(),
        explained.judged_how(taught, judging),
        both.wrench_rms(MODEL).tolist(),
        {quantity: list(judged.errors[MODEL][quantity]) for quantity in QUANTITIES},
        judged.predictions,
        _remarks(both),
        flights,
    )
    return shown, judged


def _predicted(pieces: Sequence[Deviation]) -> Predicted:
    ends_s = np.concatenate([one.time_s for one in pieces])
    return Predicted(ends_s.tolist(), np.concatenate([one.pose for one in pieces]).T.tolist())


def _deviations(found: Comparison, first: int) -> dict[int, list[tuple[Deviation, ...]]]:
    """By log, of its pieces, by horizon; the first log has this number."""
    by_log: dict[int, list[tuple[Deviation, ...]]] = {}
    for flight, one in zip(found.flights, found.deviations[MODEL], strict=True):
        by_log.setdefault(first + flight.log_index, []).append(one)
    return by_log


def _remarks(found: Comparison) -> list[str]:
    return [*found.remarks, *found.left_out]


def _modelled(one: Residual, model: Vehicle) -> FloatArray:
    """(m, 6) force and torque of the model as means over 0.1 s, N and N m."""
    body = rigid_body(as_flown(model, one.flight.carries_payload))
    acceleration = along(model, one.flight, one.mid)
    wrench = np.concatenate([body.mass_kg * acceleration[:, :3], acceleration[:, 3:] @ body.inertia_kg_m2], axis=1)
    return means_over(wrench, one.time_s, SPAN_S)


def _disturbance(pieces: Sequence[Residual]) -> list[list[float | None]]:
    parts = [one.disturbance_means() for one in pieces]
    known = [part for part in parts if part is not None]
    if not known:
        return []  # of one log: all of its pieces have it, or none
    return [[value if value == value else None for value in column] for column in np.concatenate(known).T.tolist()]


def _middles(one: Residual) -> FloatArray:
    return means_over(one.time_s[:, None], one.time_s, SPAN_S)[:, 0]


def remarked(compared: Compared, more: Sequence[str]) -> Compared:
    """The comparison with further remarks."""
    return msgspec.structs.replace(compared, remarks=[*compared.remarks, *more])


def save(path: Path, compared: Compared) -> None:
    file_format.write_bytes(path, msgspec.msgpack.encode(compared))


def load(path: Path) -> Compared | None:
    """The comparison that was saved; None where there is none that can be read."""
    found = session_files.read(path, Compared, msgspec.msgpack.decode)
    return found if found is not None and _can_be_shown(found) else None


def _can_be_shown(found: Compared) -> bool:
    known = set(found.variables) <= set(UNIT) and set(found.errors) <= set(SHOWN)
    whole = len(found.rms) == len(found.shares) == len(CHANNELS)
    return (found.format, found.version) == (FORMAT, VERSION) and known and whole


# --- as the page shows it ---


def variable(name: str) -> VariableName:
    return VariableName(name, UNIT[name], words.variable(name))


def channels(compared: Compared) -> list[ChannelResidual]:
    rows = []
    for channel, rms, shares in zip(CHANNELS, compared.rms, compared.shares, strict=True):
        scale, written = unit(channel)
        rows.append(ChannelResidual(channel, written, scale * rms, shares))
    return rows


def errors(compared: Compared) -> list[HorizonError]:
    """In the units that people read."""
    rows = []
    for quantity, values in compared.errors.items():
        written, scale = SHOWN[quantity]
        rows.append(HorizonError(quantity, written, [scale * value for value in values]))
    return rows


def horizons_s() -> list[float]:
    return list(HORIZONS_S)


def scatter(compared: Compared, channel: str, name: str, shift_s: dict[str, float]) -> Scatter:
    """
    Args:
        shift_s: by flight, what is taken off the log's clock.

    Raises:
        InputError: there is no such channel, or the flights did not show the variable.
    """
    if channel not in CHANNELS or name not in compared.variables:
        raise InputError(f"the comparison has no {channel} against {name}")
    row, column = CHANNELS.index(channel), compared.variables.index(name)
    scale, written = unit(channel)
    x = np.concatenate([flight.variables[column] for flight in compared.flights])
    y = scale * np.concatenate([flight.residual[row] for flight in compared.flights])
    centre, mean, error = drawing.binned(x, y)
    return Scatter(
        channel,
        written,
        variable(name),
        compared.shares[row][column],
        x.tolist(),
        y.tolist(),
        [i for i, flight in enumerate(compared.flights) for _ in flight.time_s],
        [t - shift_s.get(flight.name, 0.0) for flight in compared.flights for t in flight.time_s],
        [flight.name for flight in compared.flights],
        [flight.held_out for flight in compared.flights],
        centre.tolist(),
        mean.tolist(),
        (SIGMAS * error).tolist(),
        SPAN_S,
    )


def forces(flight: FlightResidual) -> dict[str, tuple[Stream, list[CurvePart], float | None]]:
    """Streams of the comparison on one flight, by key: model and measured, and the residual with its band."""
    found: dict[str, tuple[Stream, list[CurvePart], float | None]] = {}
    for i, channel in enumerate(CHANNELS):
        scale, written = unit(channel)
        modelled, left = scale * np.array(flight.modelled[i]), scale * np.array(flight.residual[i])
        what = f"{'Force' if channel[0] == 'F' else 'Torque'} {channel[2]}"
        both = [_curve("model", modelled), _curve("measured", modelled + left)]
        found[channel] = (Stream(channel, what, written, "force"), both, None)
        key = f"residual_{channel}"
        band = SIGMAS * scale * flight.sigma[i]
        curves = [_curve("residual", left)]
        if flight.disturbance:
            values = scale * np.array(flight.disturbance[i], dtype=np.float64)
            curves.append(CurvePart(DISTURBANCE, "measured", values.tolist()))
        found[key] = (
            Stream(key, f"Residual {channel[2] if channel[0] == 'F' else what.lower()}", written, "force"),
            curves,
            band,
        )
    return found


def _curve(kind: CurveKind, values: FloatArray) -> CurvePart:
    return CurvePart(kind, kind, values.tolist())
