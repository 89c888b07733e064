"""CSV logs, with a map that says which columns hold which quantity and in what unit; nothing is guessed."""

import csv
import gzip
import json
import math
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flight import FlightLog, FormatError, InputError, cells, errors, file_format, frames, rotations
from flight.flight_log import COLUMNS, MOST_ROTORS, ROTOR_QUANTITIES, from_vectors
from flight.rotations import FloatArray
from flight.units import RAD_S_PER_RPM
from sysid.logs.events import clock
from sysid.logs.events.event import Event, noted
from sysid.logs.readers.streams import shifted

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
    "rpm": RAD_S_PER_RPM,
    "m/s2": 1.0,
    "g": frames.GRAVITY_M_S2,
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
    """Vector of `flight.flight_log.COLUMNS` to `{columns, unit, frame, order, scale, sign, offset, shift_s}`; `order`
    for quaternions and angles."""
    scalars: dict[str, dict[str, Any]]
    """`battery_v`, or any column with a unit suffix, to `{column, unit, scale, sign, offset, shift_s}`."""
    keep: dict[str, Any]
    """`{column, equals}`: only rows where the column has that value; empty for all rows."""
    metadata: dict[str, Any]
    separator: str = ","
    """Between the values of a row."""


_MENDING = ("scale", "sign", "offset", "shift_s")
SEPARATORS = (",", ";", "\t", " ", "|")


def load_map(path: Path) -> ColumnMap:
    """Read a map file.

    Raises:
        InputError: a quantity or unit is not known.
        FormatError: the file is not a column map.
    """
    return map_of(file_format.read_toml(Path(path), format=FORMAT, version=VERSION), Path(path))


def map_of(document: dict[str, Any], path: Path) -> ColumnMap:
    """A map from its document; `path` is what errors name. Raises as `load_map`."""
    if "time" not in document:
        raise FormatError(f"{path} names no column of the time; write [time] and below it column = '...', unit = 's'")
    _only(
        path, "the map", document, ("format", "version", "time", "quantity", "scalar", "keep", "metadata", "separator")
    )
    column_map = ColumnMap(
        time=table_of(path, "time", document["time"]),
        quantities=_tables(path, "quantity", document),
        scalars=_tables(path, "scalar", document),
        keep=table_of(path, "keep", document.get("keep", {})),
        metadata=table_of(path, "metadata", document.get("metadata", {})),
        separator=document.get("separator", ","),
    )
    if column_map.separator not in SEPARATORS:
        raise InputError(f"{path}: separator {column_map.separator!r} is not one of {', '.join(map(repr, SEPARATORS))}")
    _check_entry(path, "time", column_map.time, ("column", "unit", "scale"))
    for name, entry in column_map.quantities.items():
        if name not in COLUMNS:
            raise InputError(f"{path}: unknown quantity {name}; known are {', '.join(COLUMNS)}")
        _check_entry(path, name, entry, ("columns", "unit", "frame", "order", *_MENDING))
    for name, entry in column_map.scalars.items():
        _check_entry(path, name, entry, ("column", "unit", *_MENDING))
    if column_map.keep:
        _only(path, "keep", column_map.keep, ("column", "equals"))
        if not isinstance(column_map.keep.get("column"), str) or not _is_number(column_map.keep.get("equals")):
            raise FormatError(f"{path}: [keep] needs column = a name and equals = a number")
    return column_map


def table_of(path: Path, name: str, value: object) -> dict[str, Any]:
    """
    Raises:
        FormatError: the value is no table of the map file.
    """
    if not isinstance(value, dict):
        raise FormatError(f"{path}: {name} is {str(value)[:60]!r}, not a table; write [{name}] above its keys")
    return value  # pyright: ignore[reportUnknownVariableType]


def _tables(path: Path, key: str, document: dict[str, Any]) -> dict[str, dict[str, Any]]:
    outer = table_of(path, key, document.get(key, {}))
    return {name: table_of(path, f"{key}.{name}", entry) for name, entry in outer.items()}


def _only(path: Path, name: str, table: dict[str, Any], known: tuple[str, ...]) -> None:
    """Refuse keys that would be passed over: a misspelt `unit` would otherwise be a wrong answer."""
    if surplus := sorted(set(table) - set(known)):
        raise FormatError(f"{path}: {name} has an unknown key {surplus[0]!r}; known are {', '.join(known)}")


def _check_entry(path: Path, name: str, entry: dict[str, Any], known: tuple[str, ...]) -> None:
    _only(path, name, entry, known)
    key = known[0]
    names = [entry.get(key)] if key == "column" else entry.get(key)
    if not isinstance(names, list) or not names or not all(isinstance(n, str) for n in names):
        raise FormatError(f"{path}: {name} names no {key}; write {key} = {'[...]' if key == 'columns' else '...'}")
    if str(entry.get("unit", "1")) not in UNITS:
        raise InputError(f"{path}: {name} has an unknown unit {entry['unit']!r}; known are {', '.join(UNITS)}")
    if entry.get("frame", "z up") not in ("z up", "z down") or not isinstance(entry.get("order", ""), str):
        got = " and ".join(repr(entry[key]) for key in ("frame", "order") if key in entry)
        raise InputError(f"{path}: {name}: frame must be 'z up' or 'z down' and order a word like 'w x y z', not {got}")
    for key in ("scale", "sign", "offset"):
        _numbers(entry.get(key, 1.0), f"{path}: {name}.{key}")
    if not _is_number(entry.get("shift_s", 0.0)):
        raise FormatError(f"{path}: {name}.shift_s is {entry['shift_s']!r}, not a finite number of seconds")
    if not np.isin(_numbers(entry.get("sign", 1), ""), (-1.0, 1.0)).all():
        raise InputError(f"{path}: {name}.sign is {entry['sign']!r}; 1 or -1 is expected, or a list of them")


def _numbers(value: Any, what: str) -> FloatArray:
    """A number, or a list with one for each column."""
    numbers = value if isinstance(value, list) else [value]
    if not numbers or not all(map(_is_number, numbers)):
        raise FormatError(f"{what} is {value!r}, not a finite number, nor a list with one for each column")
    return np.asarray(value, dtype=np.float64)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def read(path: Path, column_map: ColumnMap) -> FlightLog:
    """Read a CSV file (also gzipped) into a flight log.

    Raises:
        InputError: the file or a column is not there.
        FormatError: a row does not fit the header, or the time is none.
    """
    table = _table(Path(path), column_map.separator)
    time = column_map.time
    if column_map.keep:
        column, equals = column_map.keep["column"], float(column_map.keep["equals"])
        table.rows = [row for row, value in zip(table.rows, table.column(column), strict=True) if value == equals]
        if not table.rows:
            raise InputError(f"{path}: no row has {column} = {column_map.keep['equals']}")
    time_s = table.column(time["column"]) * UNITS[time.get("unit", "s")] * float(time.get("scale", 1.0))
    vectors = {name: _vector(table, name, entry, path) for name, entry in column_map.quantities.items()}
    for name, entry in column_map.scalars.items():
        vectors[name] = _scaled(table.column(entry["column"])[:, None], name, entry, path)
    time_s, vectors, events = _clocked(time_s, vectors)
    entries = {**column_map.quantities, **column_map.scalars}
    vectors = {name: _in_time(values, time_s, entries[name], name) for name, values in vectors.items()}
    scalars = {name: vectors.pop(name)[:, 0] for name in column_map.scalars}
    metadata = {
        "name": Path(path).name.split(".")[0],
        "source": Path(path).name,
        **noted(events),
        **column_map.metadata,
    }
    moved = [n for n, entry in entries.items() if entry.get("shift_s")]
    known = np.ones(len(time_s), dtype=bool)
    for name in moved:
        rows = np.flatnonzero(np.isfinite(vectors[name]).all(axis=1) if name in vectors else np.isfinite(scalars[name]))
        if len(rows) < 2:
            raise InputError(f"{path}: nothing is left of {name} after its shift_s: it is longer than the log")
        known[: rows[0]] = known[rows[-1] + 1 :] = False
    vectors = {name: values[known] for name, values in vectors.items()}
    scalars = {name: values[known] for name, values in scalars.items()}
    return from_vectors(time_s[known], vectors, scalars=scalars, metadata=metadata)


def _clocked(
    time_s: FloatArray, vectors: dict[str, FloatArray]
) -> tuple[FloatArray, dict[str, FloatArray], tuple[Event, ...]]:
    """Rising times, the rows that have them, and what was found and done about the others."""
    row = "row"
    columns = {f"{name} {i}": column for name, values in vectors.items() for i, column in enumerate(values.T)}
    own = {"time_s": time_s, row: np.arange(len(time_s), dtype=np.float64)}
    streams, events = clock.examined({"the log": own | columns}, not_motion=(row,))
    rows = streams["the log"][row].astype(np.intp)
    return streams["the log"]["time_s"], {name: values[rows] for name, values in vectors.items()}, events


def _in_time(values: FloatArray, time_s: FloatArray, entry: dict[str, Any], name: str) -> FloatArray:
    """The stream with its own clock corrected: `shift_s` is added to its time stamps; NaN where nothing is known."""
    shift_s = float(entry.get("shift_s", 0.0))
    return shifted(time_s, values, shift_s, quaternion=name.endswith("q_world_body")) if shift_s else values


def _scaled(values: FloatArray, name: str, entry: dict[str, Any], path: Path) -> FloatArray:
    """From the file's unit to ours: times unit, scale and sign, plus offset; each one number or one for each column."""
    count = values.shape[1]
    factors = []
    for key, neutral in (("scale", 1.0), ("sign", 1.0), ("offset", 0.0)):
        given = _numbers(entry.get(key, neutral), f"{path}: {key} of {name}")
        if given.ndim and len(given) != count:
            raise InputError(f"{path}: {key} of {name} has {len(given)} numbers for {count} columns")
        factors.append(given)
    return values * UNITS[entry.get("unit", "1")] * factors[0] * factors[1] + factors[2]


@dataclass(slots=True)
class _Table:
    """The cells of a CSV file, as text: only columns that the map names must hold numbers."""

    path: Path
    names: list[str]
    rows: list[tuple[int, list[str]]]
    """Line in the file, and the cells."""

    def column(self, name: str) -> FloatArray:
        """
        Raises:
            InputError: there is no such column.
            FormatError: a cell is neither a number nor one of `cells.MISSING`.
        """
        if name not in self.names:
            found = next((one for one in ("\t", ";", "|", " ") if len(self.names) == 1 and one in self.names[0]), None)
            remedy = "" if found is None else f"; write separator = {json.dumps(found)} in the column map"
            raise InputError(f"{self.path} has no column {name}; it has {', '.join(self.names)}{remedy}")
        place = self.names.index(name)
        return cells.numbers(((line, row[place]) for line, row in self.rows), self.path, name)


def _table(path: Path, separator: str) -> _Table:
    if not path.is_file():
        raise errors.missing(path)
    opener = gzip.open if path.name.endswith(".gz") else open
    try:
        with opener(path, "rt", newline="", encoding="utf-8") as file:
            lines = _Lines(file)
            header = header_names(lines, separator)
            rows = [(lines.number, row) for row in cells_of(lines, separator)]
    except StopIteration:
        raise FormatError(f"{path} is empty; a CSV file starts with the names of its columns") from None
    except UnicodeDecodeError:
        raise FormatError(f"{path} is not a readable CSV file: it is not UTF-8 text; save it as UTF-8") from None
    except (OSError, ValueError, EOFError, csv.Error, zlib.error) as error:
        said = " ".join(str(error).split())[:200]
        raise FormatError(f"{path} is not a readable CSV file: {said}") from error
    if not rows:
        raise FormatError(f"{path} has no rows below its header")
    if twice := next((name for name in header if header.count(name) > 1), None):
        raise FormatError(f"{path} has two columns named {twice!r}; rename one")
    for line, row in rows:
        if len(row) != len(header):
            raise FormatError(f"{path}, line {line}: {len(row)} values below {len(header)} names in the header")
    return _Table(path, header, rows)


class _Lines:
    """The lines of a text file, counted as they are read."""

    def __init__(self, lines: Iterable[str]) -> None:
        self._lines = iter(lines)
        self.number = 0

    def __iter__(self) -> Iterator[str]:
        return self

    def __next__(self) -> str:
        """
        Raises:
            ValueError: the line holds what no text does; the file is damaged.
        """
        line = next(self._lines)
        self.number += 1
        if "\0" in line:
            raise ValueError(f"line {self.number} holds a NUL byte; the file is damaged")
        return line


def header_names(lines: Iterator[str], separator: str) -> list[str]:
    """Names of the columns: the first line that is not empty. Reads up to it.

    Raises:
        StopIteration: there is none.
    """
    line = next(line for line in lines if line.strip())
    line = line.lstrip("\ufeff#").strip()
    names = line.split() if separator == " " else next(csv.reader([line], delimiter=separator))
    return [name.strip() for name in names]


def cells_of(lines: Iterable[str], separator: str) -> Iterator[list[str]]:
    """The cells of each line below the header; a blank separator is any run of blanks.

    Blank lines and lines that begin with `#` are left out.
    """
    rows = (line.split() for line in lines) if separator == " " else csv.reader(lines, delimiter=separator)
    return (row for row in rows if (len(row) > 1 or "".join(row).strip()) and not row[0].startswith("#"))


def _vector(table: _Table, name: str, entry: dict[str, Any], path: Path) -> FloatArray:
    values = np.stack([table.column(column) for column in entry["columns"]], axis=1)
    values = _scaled(values, name, entry, path)
    if name.endswith("q_world_body"):
        return _attitude(values, entry, name, path)
    rotors = 4 < values.shape[1] <= MOST_ROTORS and name in ROTOR_QUANTITIES
    if values.shape[1] != len(COLUMNS[name]) and not rotors:
        raise InputError(f"{path}: {name} needs {len(COLUMNS[name])} columns, the map names {values.shape[1]}")
    return frames.flip_vector(values) if entry.get("frame", "z up") == "z down" else values


def _attitude(values: FloatArray, entry: dict[str, Any], name: str, path: Path) -> FloatArray:
    order = entry.get("order")
    if order in ("x y z w", "w x y z", "roll pitch yaw") and values.shape[1] != len(order.split()):
        raise InputError(f"{path}: {name} in order {order!r} has {values.shape[1]} columns in the map")
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
