"""A flight log: one row per instant, one column per quantity, the unit in the column's name; Parquet on disk.

The standard columns are in `COLUMNS`; any further column is allowed if its name ends in a unit of `UNITS`.
A quantity that was not recorded has no column; one that was not sampled at a row is NaN there. Rotors from the fifth
on have columns numbered like those of the first four.
"""

import importlib
import json
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flight import file_format
from flight.errors import FormatError, InputError, missing
from flight.rotations import FloatArray

FORMAT = "goshawk-flight-log"
VERSION = 1

PIECE_ROWS = 1 << 16
"""Of what `pieces` reads at a time, and of a row group on disk: a minute at 1 kHz."""
UNITS = ("s", "m", "m_s", "m_s2", "m_s3", "rad", "rad_s", "rad_s2", "n", "n_m", "v", "a", "pa", "k", "kg", "ratio")
"""Unit suffixes a column may end in (after an underscore). `ratio` is for numbers without a unit."""

_AXES = ("x", "y", "z")
_QUATERNION = ("w", "x", "y", "z")
_ROTORS = ("0", "1", "2", "3")
_GROUPS: dict[str, tuple[str, tuple[str, ...], str]] = {
    # name of the vector: (column stem, component labels, unit suffix)
    "position_world_m": ("position_world", _AXES, "_m"),
    "velocity_world_m_s": ("velocity_world", _AXES, "_m_s"),
    "q_world_body": ("q_world_body", _QUATERNION, ""),
    "rate_body_rad_s": ("rate_body", _AXES, "_rad_s"),
    "specific_force_body_m_s2": ("specific_force_body", _AXES, "_m_s2"),
    "rotor_speed_rad_s": ("rotor_speed", _ROTORS, "_rad_s"),
    "rotor_speed_command_rad_s": ("rotor_speed_command", _ROTORS, "_rad_s"),
    "setpoint_position_world_m": ("setpoint_position_world", _AXES, "_m"),
    "setpoint_velocity_world_m_s": ("setpoint_velocity_world", _AXES, "_m_s"),
    "setpoint_q_world_body": ("setpoint_q_world_body", _QUATERNION, ""),
    "wind_world_m_s": ("wind_world", _AXES, "_m_s"),
    "disturbance_force_world_n": ("disturbance_force_world", _AXES, "_n"),
    "disturbance_torque_body_n_m": ("disturbance_torque_body", _AXES, "_n_m"),
    "disturbance_torque_std_n_m": ("disturbance_torque_std", _AXES, "_n_m"),
}

COLUMNS: dict[str, tuple[str, ...]] = {
    name: tuple(f"{stem}_{label}{unit}" for label in labels) for name, (stem, labels, unit) in _GROUPS.items()
}
"""Vector quantity to its column names, e.g. `position_world_m` to `position_world_x_m`, `_y_m`, `_z_m`."""

ROTOR_QUANTITIES = ("rotor_speed_rad_s", "rotor_speed_command_rad_s")
"""Vectors of `COLUMNS` that have more columns where there are more than four rotors."""
MOST_ROTORS = 8


def rotor_columns(quantity: str, count: int) -> tuple[str, ...]:
    """The columns of a quantity of `ROTOR_QUANTITIES` for so many rotors."""
    stem, _, unit = _GROUPS[quantity]
    return tuple(f"{stem}_{i}{unit}" for i in range(count))


def columns_of(quantity: str, values: FloatArray) -> dict[str, FloatArray]:
    """(n, k) values of a vector of `COLUMNS` by column name; of rotors k is how many there are."""
    names = rotor_columns(quantity, values.shape[1]) if quantity in ROTOR_QUANTITIES else COLUMNS[quantity]
    return dict(zip(names, values.T, strict=True))


SCALARS = (
    "time_s",
    "battery_v",
    "mission_state",
    "saturation",
    "mission_reason",
    "limit_reason",
    "warnings",
    "landing_stage",
    "estimate_valid",
    "estimate_faults",
    "observer_state",
)
"""Further standard columns. All from `mission_state` on are codes or bits of the controller (see its headers)."""

_QUATERNION_COLUMNS = frozenset(COLUMNS["q_world_body"] + COLUMNS["setpoint_q_world_body"])


@dataclass(frozen=True, slots=True, eq=False)
class FlightLog:
    """Columns of equal length, `time_s` among them and strictly increasing."""

    columns: Mapping[str, FloatArray]
    """Column name to (n,) values."""
    metadata: Mapping[str, Any]
    """Describes the flight: `vehicle`, `trajectory`, `source`, ...; values that JSON can represent."""

    def __post_init__(self) -> None:
        columns = {name: np.ascontiguousarray(values, dtype=np.float64) for name, values in self.columns.items()}
        if "time_s" not in columns:
            raise InputError("a flight log needs a column time_s")
        n = len(columns["time_s"])
        for name, values in columns.items():
            if values.shape != (n,):
                raise InputError(f"column {name} has shape {values.shape}; time_s has {n} rows")
            if name not in SCALARS and name not in _QUATERNION_COLUMNS and not _has_unit(name):
                raise InputError(f"column {name} names no unit; end it in one of: {', '.join('_' + u for u in UNITS)}")
        time_s = columns["time_s"]
        if not np.isfinite(time_s).all():
            raise InputError(f"time_s is not finite in {int((~np.isfinite(time_s)).sum())} rows")
        backward = np.flatnonzero(np.diff(time_s) <= 0.0)
        if backward.size:
            i = int(backward[0])
            raise InputError(
                f"time does not increase at row {i + 1} ({time_s[i]:.6f} s, then {time_s[i + 1]:.6f} s), "
                f"{backward.size} times in all; drop or sort the repeated rows first"
            )
        object.__setattr__(self, "columns", columns)

    def __len__(self) -> int:
        return len(self.columns["time_s"])

    @property
    def time_s(self) -> FloatArray:
        return self.columns["time_s"]

    def has(self, quantity: str) -> bool:
        """Whether every column of a vector of `COLUMNS`, or the scalar column, is there."""
        return all(name in self.columns for name in COLUMNS.get(quantity, (quantity,)))

    def names(self, quantity: str) -> tuple[str, ...]:
        """The columns of a vector of `COLUMNS`: of rotors as many as the log has, the first four at least."""
        if quantity not in ROTOR_QUANTITIES:
            return COLUMNS[quantity]
        every = rotor_columns(quantity, MOST_ROTORS)
        return every[: next((i for i in range(4, MOST_ROTORS) if every[i] not in self.columns), MOST_ROTORS)]

    def vector(self, quantity: str) -> FloatArray:
        """A vector quantity of `COLUMNS` as (n, 3) or (n, 4); of rotors (n, r).

        Raises:
            InputError: a column of it is missing; the message names those and what is there.
        """
        names = self.names(quantity)
        missing = [name for name in names if name not in self.columns]
        if missing:
            raise InputError(f"the log has no {', '.join(missing)}; it has {', '.join(sorted(self.columns))}")
        return np.stack([self.columns[name] for name in names], axis=-1)

    def slice(self, start_s: float, end_s: float) -> "FlightLog":
        """Rows with start_s <= time < end_s."""
        keep = slice(*np.searchsorted(self.time_s, [start_s, end_s]))
        return FlightLog({name: values[keep] for name, values in self.columns.items()}, self.metadata)


def from_vectors(
    time_s: FloatArray,
    vectors: Mapping[str, FloatArray],
    *,
    scalars: Mapping[str, FloatArray] | None = None,
    metadata: Mapping[str, Any] | None = None,
) -> FlightLog:
    """Build a log from (n, 3), (n, 4) and, of r rotors, (n, r) arrays keyed as in `COLUMNS`, and (n,) scalars."""
    columns: dict[str, FloatArray] = {"time_s": np.asarray(time_s, dtype=np.float64)}
    for quantity, values in vectors.items():
        if quantity not in COLUMNS:
            raise InputError(f"unknown quantity {quantity}; known are {', '.join(COLUMNS)}")
        names, shape = COLUMNS[quantity], np.shape(values)
        if quantity in ROTOR_QUANTITIES and len(shape) == 2 and 4 < shape[1] <= MOST_ROTORS:
            names = rotor_columns(quantity, shape[1])
        if shape != (len(columns["time_s"]), len(names)):
            raise InputError(f"{quantity} : expected shape (n, {len(names)}), got {shape}")
        columns |= {name: values[:, i] for i, name in enumerate(names)}
    return FlightLog(columns | dict(scalars or {}), dict(metadata or {}))


def save(path: Path, log: FlightLog) -> None:
    """Write a log (format `goshawk-flight-log`: Parquet, with the format, version and metadata in the schema)."""
    pa, parquet = _arrow()
    header = {"format": FORMAT, "version": VERSION, "metadata": dict(log.metadata)}
    try:
        text = json.dumps(header, allow_nan=False)
    except (TypeError, ValueError) as error:
        raise InputError(f"{path}: not written, the log's metadata do not fit JSON ({error})") from error
    table = pa.table({name: pa.array(values) for name, values in log.columns.items()})
    with file_format.atomic_file(path) as temporary:
        table = table.replace_schema_metadata({"goshawk": text})
        # measured values hardly repeat: a dictionary makes the file larger, and three times as slow to write
        parquet.write_table(table, temporary, compression="zstd", use_dictionary=False, row_group_size=PIECE_ROWS)


def load(path: Path, columns: Collection[str] | None = None) -> FlightLog:
    """Read a log that `save` wrote.

    Args:
        columns: names of the columns to read besides `time_s`; None: all of them.

    Raises:
        InputError: there is no such file, or it has no such column.
        FormatError: it is not a flight log, is cut off, or newer than this version.
    """
    pa, parquet = _arrow()
    names, metadata = _chosen(path, columns)
    try:
        table = parquet.read_table(path, columns=names)
    except (pa.ArrowException, OSError) as error:
        raise _unreadable(path, error) from error
    return _log(path, table, metadata)


def pieces(path: Path, columns: Collection[str] | None = None) -> Iterator[FlightLog]:
    """Read a log that `save` wrote, a stretch of rows after the other, so that a long one needs little memory.

    Arguments and errors are those of `load`; the errors come with the piece that has them.
    """
    pa, parquet = _arrow()
    names, metadata = _chosen(path, columns)
    last_s = -np.inf
    try:
        with parquet.ParquetFile(path) as file:
            for batch in _batches(file, names):
                piece = _log(path, batch, metadata)
                if len(piece) and piece.time_s[0] <= last_s:
                    raise InputError(
                        f"{path}: time does not increase ({last_s:.6f} s, then {piece.time_s[0]:.6f} s); "
                        "drop or sort the repeated rows first"
                    )
                last_s = piece.time_s[-1] if len(piece) else last_s
                yield piece
    except (pa.ArrowException, OSError) as error:
        raise _unreadable(path, error) from error


def _batches(file: Any, names: list[str]) -> Iterator[Any]:
    """Group by group: asked for all groups at once, Arrow reads them all ahead."""
    for group in range(file.num_row_groups):
        yield from file.iter_batches(PIECE_ROWS, row_groups=[group], columns=names)


def _chosen(path: Path, columns: Collection[str] | None) -> tuple[list[str], Mapping[str, Any]]:
    names, metadata = head(path)
    if columns is None:
        return list(names), metadata
    missing = sorted(set(columns) - set(names))
    if missing:
        raise InputError(f"{path} has no {', '.join(missing)}; it has {', '.join(sorted(names))}")
    return [name for name in names if name == "time_s" or name in columns], metadata


def _log(path: Path, read: Any, metadata: Mapping[str, Any]) -> FlightLog:
    """`read`: a table or a batch of rows, of Arrow."""
    columns = {name: read[name].to_numpy(zero_copy_only=False) for name in read.schema.names}
    try:
        return FlightLog(columns, metadata)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    except (TypeError, ValueError) as error:
        raise FormatError(f"{path} is a damaged flight log: {file_format.damage_text(error)}") from error


def head(path: Path) -> tuple[tuple[str, ...], Mapping[str, Any]]:
    """Names of the columns of a log that `save` wrote, and its metadata, without reading the columns.

    Raises:
        InputError: there is no such file.
        FormatError: it is not a flight log, is cut off, or newer than this version.
    """
    pa, parquet = _arrow()
    if not Path(path).is_file():
        raise missing(path)
    try:
        schema = parquet.read_schema(path)
    except (pa.ArrowException, OSError) as error:
        raise _unreadable(path, error) from error
    header = _header(schema.metadata)
    if header.get("format") != FORMAT or not isinstance(header.get("version"), int):
        raise FormatError(f"{path} is Parquet but not a {FORMAT}; convert it to CSV and read that with --columns")
    if header["version"] > VERSION:
        raise FormatError(
            f"{path} is version {header['version']} of {FORMAT}; this Goshawk reads up to {VERSION}: update Goshawk"
        )
    metadata: Any = header.get("metadata")
    if not isinstance(metadata, dict):
        raise FormatError(f"{path} is a damaged flight log: its metadata are {str(metadata)[:60]!r}, not a table")
    return tuple(schema.names), metadata  # pyright: ignore[reportUnknownVariableType]


def _unreadable(path: Path, error: Exception) -> FormatError:
    said = " ".join(str(error).split())
    return FormatError(f"{path} is not a readable Parquet file ({said}); it may have been cut off")


def _header(schema_metadata: dict[bytes, bytes] | None) -> dict[str, Any]:
    try:
        header: Any = json.loads((schema_metadata or {}).get(b"goshawk", b"{}"))
    except ValueError:
        return {}
    return dict(header) if isinstance(header, dict) else {}  # pyright: ignore[reportUnknownArgumentType]


def _arrow() -> tuple[Any, Any]:
    """pyarrow and pyarrow.parquet, imported when first needed (it takes a third of a second); they carry no types."""
    return importlib.import_module("pyarrow"), importlib.import_module("pyarrow.parquet")


def _has_unit(name: str) -> bool:
    return any(name.endswith("_" + unit) for unit in UNITS)
