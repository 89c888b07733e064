"""What can be drawn over a flight's time: quantities with plan and measurement side by side, then every column."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from flight import FloatArray, InputError, flight_log
from flight.flight_log import COLUMNS, MOST_ROTORS, SCALARS, UNITS, rotor_columns
from gcs_web.flights.pyramid import Small
from gcs_web.protocol.flights import CurveKind

Columns = Mapping[str, FloatArray]
PLAN, MEASURED = "plan", "measured"
COLUMN = "column:"
"""A stream of one column is called this and the column's name."""


@dataclass(frozen=True, slots=True)
class Curve:
    """One line of a plot."""

    label: str
    kind: CurveKind
    needs: tuple[str, ...]
    """Columns that it is made of."""
    values: Callable[[Columns], FloatArray]
    """(n,) of those columns, in the stream's unit."""


@dataclass(frozen=True, slots=True)
class Quantity:
    """A plot: its curves share unit and axis."""

    key: str
    name: str
    unit: str
    curves: tuple[Curve, ...]


def of_log(names: tuple[str, ...]) -> dict[str, Quantity]:
    """Every stream of a log with these columns, by key; a quantity has the curves whose columns are there."""
    there = set(names)
    found: dict[str, Quantity] = {}
    for quantity in _QUANTITIES:
        curves = tuple(curve for curve in quantity.curves if there.issuperset(curve.needs))
        if any(curve.kind == "measured" for curve in curves):
            found[quantity.key] = Quantity(quantity.key, quantity.name, quantity.unit, curves)
    for name in sorted(there - {"time_s"}):
        found[COLUMN + name] = _column(name)
    return found


def _column(name: str) -> Quantity:
    unit = "" if name in SCALARS and not name.endswith("_v") else _unit(name)
    curve = Curve(name, "measured", (name,), lambda columns: columns[name])
    return Quantity(COLUMN + name, name, unit, (curve,))


_WRITTEN = {"m_s": "m/s", "m_s2": "m/s²", "m_s3": "m/s³", "rad_s": "rad/s", "rad_s2": "rad/s²", "n": "N", "n_m": "N m",
            "v": "V", "a": "A", "pa": "Pa", "k": "K", "ratio": ""}  # fmt: skip


def _unit(name: str) -> str:
    ends = [unit for unit in UNITS if name.endswith("_" + unit)]
    unit = max(ends, key=len, default="")
    return _WRITTEN.get(unit, unit)


def _size(quantity: str, kind: CurveKind) -> Curve:
    names = COLUMNS[quantity]
    return Curve(kind, kind, names, lambda columns: np.sqrt(sum(columns[name] ** 2 for name in names)))


def _one(name: str, label: str, kind: CurveKind, scale: float = 1.0) -> Curve:
    return Curve(label, kind, (name,), lambda columns: scale * columns[name])


def _error() -> Curve:
    """Distance from the set-point."""
    pairs = tuple(zip(COLUMNS["position_world_m"], COLUMNS["setpoint_position_world_m"], strict=True))
    needs = tuple(name for pair in pairs for name in pair)
    return Curve(
        MEASURED, MEASURED, needs, lambda columns: 1e3 * np.sqrt(sum((columns[a] - columns[b]) ** 2 for a, b in pairs))
    )


def _tilt(quantity: str, kind: CurveKind) -> Curve:
    """Angle between body z and world z."""
    _, x, y, _ = names = COLUMNS[quantity]
    return Curve(
        kind,
        kind,
        names,
        lambda columns: np.degrees(np.arccos(np.clip(1.0 - 2.0 * (columns[x] ** 2 + columns[y] ** 2), -1.0, 1.0))),
    )


def _position(axis: int) -> Quantity:
    letter = "xyz"[axis]
    curves = (
        _one(COLUMNS["setpoint_position_world_m"][axis], PLAN, "plan"),
        _one(COLUMNS["position_world_m"][axis], MEASURED, "measured"),
    )
    return Quantity(f"position_{letter}", "Height" if letter == "z" else f"Position {letter}", "m", curves)


def _rotor(i: int) -> Quantity:
    curves = (
        _one(rotor_columns("rotor_speed_command_rad_s", MOST_ROTORS)[i], "command", "plan"),
        _one(rotor_columns("rotor_speed_rad_s", MOST_ROTORS)[i], MEASURED, "measured"),
    )
    return Quantity(f"rotor_{i}", f"Rotor {i}", "rad/s", curves)


_QUANTITIES: tuple[Quantity, ...] = (
    Quantity(
        "speed", "Speed", "m/s", (_size("setpoint_velocity_world_m_s", PLAN), _size("velocity_world_m_s", MEASURED))
    ),
    Quantity("error", "Position error", "mm", (_error(),)),
    Quantity("tilt", "Tilt", "°", (_tilt("setpoint_q_world_body", PLAN), _tilt("q_world_body", MEASURED))),
    _position(2),
    _position(0),
    _position(1),
    *(
        Quantity(f"rate_{a}", f"Body rate {a}", "°/s", (_one(name, MEASURED, "measured", float(np.degrees(1.0))),))
        for a, name in zip("xyz", COLUMNS["rate_body_rad_s"], strict=True)
    ),
    *(_rotor(i) for i in range(MOST_ROTORS)),
    Quantity(
        "disturbance",
        "Disturbance, as the observer saw it",
        "N",
        (_size("disturbance_force_world_n", MEASURED),),
    ),
    *(
        Quantity(f"disturbance_{a}", f"Disturbance along {a}, observer", "N", (_one(name, MEASURED, "measured"),))
        for a, name in zip("xyz", COLUMNS["disturbance_force_world_n"], strict=True)
    ),
    Quantity("battery", "Battery", "V", (_one("battery_v", MEASURED, "measured"),)),
)


def read(path: Path, quantities: Sequence[Quantity], rows: int) -> list[list[Small]]:
    """The curves of each quantity, of a log that has so many rows; only the columns that they need are read.

    Raises:
        FlightError: the log cannot be read, or has another number of rows.
    """
    read = [[np.empty(rows, dtype=np.float32) for _ in quantity.curves] for quantity in quantities]
    begin = 0
    needs = {name for quantity in quantities for curve in quantity.curves for name in curve.needs}
    for piece in flight_log.pieces(path, needs):
        part = slice(begin, begin + len(piece))
        if part.stop > rows:
            break
        for quantity, lines in zip(quantities, read, strict=True):
            for curve, line in zip(quantity.curves, lines, strict=True):
                line[part] = curve.values(piece.columns)
        begin = part.stop
    if begin != rows:
        raise InputError(f"{path.name} was changed while it was read; open it again")
    return read
