"""CSV logs, with a map that says which columns hold which quantity and in what unit; nothing is guessed."""

import csv
import gzip
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flight import FlightLog, FormatError, InputError, file_format, frames, rotations
from flight.flight_log import COLUMNS, from_vectors
from flight.rotations import FloatArray

FORMAT = "goshawk-csv-map"
VERSION = 1

UNITS = {
    "1": 1.0,
    "s": 1.0,
    "ms": 1e-3,
    "us": 1e-6,
    "ns": 1e-9,
    "m": 1.0,
    "cm": 1e-2,
    "mm": 1e-3,
    "m/s": 1.0,
    "cm/s": 1e-2,
    "mm/s": 1e-3,
    "rad": 1.0,
    "deg": np.pi / 180.0,
    "rad/s": 1.0,
    "deg/s": np.pi / 180.0,
    "rpm": 2.0 * np.pi / 60.0,
    "m/s2": 1.0,
    "g": 9.80665,
    "V": 1.0,
    "mV": 1e-3,
}
"""Unit name in a map to what one of it is in SI."""


@dataclass(frozen=True, slots=True)
class ColumnMap:
    """What a CSV file's columns mean."""

    time: dict[str, Any]
    """`{column, unit}`."""
    quantities: dict[str, dict[str, Any]]
    """Vector of `flight.flight_log.COLUMNS` to `{columns, unit, frame, order}`; `order` for quaternions and angles."""
    scalars: dict[str, dict[str, Any]]
    """`battery_v`, or any column with a unit suffix, to `{column, unit}`."""
    keep: dict[str, Any]
    """`{column, equals}`: only rows where the column has that value; empty for all rows."""
    metadata: dict[str, Any]


def load_map(path: Path) -> ColumnMap:
    """Read a map file.

    Raises:
        InputError: a quantity or unit is not known.
        FormatError: the file is not a column map.
    """
    document = file_format.read_toml(Path(path), format=FORMAT, version=VERSION)
    if "time" not in document:
        raise FormatError(f"{path} does not say which column is the time: [time] column = ..., unit = ...")
    column_map = ColumnMap(
        time=document["time"],
        quantities=document.get("quantity", {}),
        scalars=document.get("scalar", {}),
        keep=document.get("keep", {}),
        metadata=document.get("metadata", {}),
    )
    for name, entry in column_map.quantities.items():
        if name not in COLUMNS:
            raise InputError(f"{path}: unknown quantity {name}; known are {', '.join(COLUMNS)}")
        if "columns" not in entry:
            raise InputError(f"{path}: {name} does not say its columns")
    for entry in (column_map.time, *column_map.quantities.values(), *column_map.scalars.values()):
        if entry.get("unit", "1") not in UNITS:
            raise InputError(f"{path}: unknown unit {entry['unit']!r}; known are {', '.join(UNITS)}")
    return column_map


def read(path: Path, column_map: ColumnMap) -> FlightLog:
    """Read a CSV file (also gzipped) into a flight log.

    Raises:
        InputError: the file or a column is not there.
        FormatError: a row does not fit the header.
    """
    table = _table(Path(path))
    time = column_map.time
    keep = np.ones(len(next(iter(table.values()))), dtype=bool)
    if column_map.keep:
        keep = _column(table, column_map.keep["column"], path) == float(column_map.keep["equals"])
        if not keep.any():
            raise InputError(f"{path}: no row has {column_map.keep['column']} = {column_map.keep['equals']}")
    vectors = {name: _vector(table, name, entry, path)[keep] for name, entry in column_map.quantities.items()}
    scalars = {
        name: (_column(table, entry["column"], path) * UNITS[entry.get("unit", "1")])[keep]
        for name, entry in column_map.scalars.items()
    }
    time_s = (_column(table, time["column"], path) * UNITS[time.get("unit", "s")])[keep]
    metadata = {"name": Path(path).name.split(".")[0], "source": Path(path).name, **column_map.metadata}
    return from_vectors(time_s, vectors, scalars=scalars, metadata=metadata)


def _table(path: Path) -> dict[str, FloatArray]:
    if not path.is_file():
        raise InputError(f"{path} does not exist or is not a file")
    opener = gzip.open if path.name.endswith(".gz") else open
    try:
        with opener(path, "rt", newline="", encoding="utf-8") as file:
            header = [name.strip() for name in next(csv.reader(file))]
            values = np.genfromtxt(file, delimiter=",", dtype=np.float64, ndmin=2)
    except (StopIteration, OSError, UnicodeDecodeError, ValueError, EOFError) as error:
        raise FormatError(f"{path} is not a readable CSV file: {error}") from error
    if values.shape[1:] != (len(header),):
        raise FormatError(f"{path} has {len(header)} names in its header and {values.shape[1:]} values in its rows")
    return dict(zip(header, values.T, strict=True))


def _column(table: dict[str, FloatArray], name: str, path: Path) -> FloatArray:
    if name not in table:
        raise InputError(f"{path} has no column {name}; it has {', '.join(table)}")
    return table[name]


def _vector(table: dict[str, FloatArray], name: str, entry: dict[str, Any], path: Path) -> FloatArray:
    values = np.stack([_column(table, column, path) for column in entry["columns"]], axis=1)
    values = values * UNITS[entry.get("unit", "1")] * float(entry.get("scale", 1.0)) + float(entry.get("offset", 0.0))
    if name.endswith("q_world_body"):
        return _attitude(values, entry, name, path)
    if values.shape[1] != len(COLUMNS[name]):
        raise InputError(f"{path}: {name} needs {len(COLUMNS[name])} columns, the map names {values.shape[1]}")
    return frames.flip_vector(values) if entry.get("frame", "z up") == "z down" else values


def _attitude(values: FloatArray, entry: dict[str, Any], name: str, path: Path) -> FloatArray:
    order = entry.get("order")
    if order == "x y z w":
        values = np.roll(values, 1, axis=1)
    elif order == "roll pitch yaw":
        values = from_roll_pitch_yaw(values)
    elif order != "w x y z":
        raise InputError(f"{path}: {name} needs order = 'w x y z', 'x y z w' or 'roll pitch yaw', not {order!r}")
    return frames.flip_attitude(values) if entry.get("frame", "z up") == "z down" else values


def from_roll_pitch_yaw(angles_rad: FloatArray) -> FloatArray:
    """R = Rz(yaw) Ry(pitch) Rx(roll) as quaternions, (n, 3) to (n, 4)."""
    axes = [rotations.exp(angles_rad[:, i : i + 1] * np.eye(3)[i]) for i in range(3)]
    return rotations.multiply(axes[2], rotations.multiply(axes[1], axes[0]))
