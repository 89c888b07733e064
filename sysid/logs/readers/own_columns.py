"""Is a CSV file one that `goshawk log export` wrote? Then its columns name themselves, and nothing is drafted."""

from pathlib import Path

from flight.flight_log import COLUMNS, SCALARS, UNITS
from sysid.logs.readers.read_csv import ColumnMap

STANDARD = frozenset((*SCALARS, *(name for columns in COLUMNS.values() for name in columns)))
UNIT_ENDS = tuple(f"_{unit}" for unit in UNITS)


def column_map(path: Path) -> ColumnMap | None:
    """Every column as it stands; None unless `time_s`, a standard vector and else only names with a unit are there."""
    with open(path, "rb") as file:
        first = file.readline(1 << 16)
    names = first.decode("utf-8", "replace").rstrip("\r\n").split(",")
    whole = any(set(columns) <= set(names) for columns in COLUMNS.values())
    known = all(name in STANDARD or name.endswith(UNIT_ENDS) for name in names)
    if names[0] != "time_s" or not whole or not known or len(set(names)) < len(names):
        return None
    others = {name: {"column": name} for name in names[1:]}
    return ColumnMap({"column": "time_s", "unit": "s"}, {}, others, {}, {})
