"""A mission from our JSON, or waypoints from a CSV file with columns x, y, z (metres) and, optionally, a heading."""

import csv
import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np

import flight.mission
from flight import FormatError, InputError, errors, project
from flight.mission import Mission
from flight.project import Waypoints

_NAMES = {
    "x_m": "x", "x": "x", "y_m": "y", "y": "y", "z_m": "z", "z": "z",
    "yaw_rad": "yaw_rad", "yaw_deg": "yaw_deg",
}  # fmt: skip
MOST = 10_000


def load(path: Path) -> Waypoints:
    """Read waypoints; the suffix determines the format.

    Raises:
        InputError: no such file, a column is missing or listed twice, or a number is out of range.
        FormatError: it is not a waypoint file.
    """
    return _from_csv(path) if path.suffix.lower() == ".csv" else project.load_waypoints(path)


def load_mission(path: Path) -> Mission:
    """Read waypoints and what is asked besides; a CSV file holds waypoints only. Raises as `load`."""
    return Mission(_from_csv(path)) if path.suffix.lower() == ".csv" else flight.mission.load(path)


def _from_csv(path: Path) -> Waypoints:
    if not path.is_file():
        raise errors.missing(path, "waypoints")
    try:
        lines = [line for line in path.read_text(encoding="utf-8-sig").splitlines() if line.strip()]
    except UnicodeDecodeError:
        raise FormatError(f"{path} is not a CSV file: it holds bytes that are no text") from None
    if len(lines) > MOST + 1:
        raise InputError(
            f"{path} has {len(lines) - 1} waypoints; at most {MOST} are read: a recorded path goes to --path"
        )
    separator = next((s for s in (";", "\t") if lines and s in lines[0]), ",")
    reader = csv.DictReader(lines, delimiter=separator, skipinitialspace=True)
    columns = {_NAMES[n.strip().lower()]: n for n in reader.fieldnames or [] if n and n.strip().lower() in _NAMES}
    missing = [axis for axis in "xyz" if axis not in columns]
    if missing:
        raise InputError(
            f"{path} has no column {missing[0]}_m; its first line must name x_m, y_m, z_m (metres) and may name "
            "yaw_deg or yaw_rad"
        )
    if {"yaw_deg", "yaw_rad"} <= set(columns):
        raise InputError(f"{path} names yaw_deg and yaw_rad; keep one of them")
    rows = list(enumerate(reader, start=2))
    if len(rows) < 2:
        raise InputError(f"{path} holds {len(rows)} waypoint(s); a path has at least two")
    positions = [[_number(row, columns[axis], path, line) for axis in "xyz"] for line, row in rows]
    return Waypoints(np.array(positions), np.array([_yaw(row, columns, path, line) for line, row in rows]))


def _yaw(row: Mapping[str, str | None], columns: Mapping[str, str], path: Path, line: int) -> float:
    """NaN where the planner may choose: no column, or an empty cell."""
    name = columns.get("yaw_deg") or columns.get("yaw_rad")
    if name is None or not (row[name] or "").strip():
        return math.nan
    value = _number(row, name, path, line)
    return math.radians(value) if "yaw_deg" in columns else value


def _number(row: Mapping[str, str | None], name: str, path: Path, line: int) -> float:
    text = (row[name] or "").strip()
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{path}, line {line}: {name} is {text!r}; a finite number is expected")
    return value
