"""Read a flight log of any kind we know: our own Parquet, PX4 ULog, CSV or a ROS recording with a map."""

from pathlib import Path

from flight import FlightLog, FormatError, InputError, flight_log
from sysid.logs.readers import read_bag, read_csv, read_ulog

FOREIGN = (".csv", ".csv.gz", ".ulg", ".bag", ".db3", ".mcap")
"""Endings of other programs' logs."""


def read_log(path: Path, column_map: Path | None = None) -> FlightLog:
    """The log in `path`; the kind goes by its ending.

    Args:
        column_map: TOML file that says what the columns of a CSV file, or the topics of a ROS recording, are.

    Raises:
        InputError: the file is not there, or a column the map names is missing.
        FormatError: the file cannot be read as what its name says.
    """
    path = Path(path)
    try:
        return _read(path, column_map)
    except (InputError, FormatError) as error:
        if str(path) in str(error) or (column_map is not None and str(column_map) in str(error)):
            raise
        raise type(error)(f"{path}: {error}") from None


def is_recording(path: Path) -> bool:
    """Whether it is a ROS recording by its ending, or a folder of one."""
    return path.name.lower().endswith((".mcap", ".bag", ".db3")) or (path / "metadata.yaml").is_file()


def _read(path: Path, column_map: Path | None) -> FlightLog:
    name = path.name.lower()
    if column_map is not None and not column_map.exists():
        raise InputError(f"{column_map} does not exist; it should hold the column map (--columns)")
    if name.endswith((".csv", ".csv.gz")):
        if column_map is None:
            raise FormatError(
                f"{path} is CSV: give its column map with --columns; "
                f"`goshawk log draft-columns {path} --out columns.toml` drafts one"
            )
        return read_csv.read(path, read_csv.load_map(column_map))
    if name.endswith(".ulg"):
        return read_ulog.read(path)
    if is_recording(path):
        if column_map is None:
            raise FormatError(f"{path} is a ROS recording; give its column map with --columns")
        return read_bag.read(path, column_map)
    if path.is_dir():
        raise InputError(f"{path} is a folder; give a flight log (a folder is one only as a ROS 2 recording)")
    try:
        log = flight_log.load(path)
    except FormatError as error:
        if path.suffix == ".parquet":
            raise
        raise FormatError(
            f"{path} is not a flight log: by its ending it is none of {', '.join(FOREIGN)}, and as our own {error}"
        ) from None
    return FlightLog(log.columns, {"name": path.stem, **log.metadata})
