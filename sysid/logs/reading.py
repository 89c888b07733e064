"""Read a flight log of any kind we know: our own Parquet, PX4 ULog, CSV or a ROS recording with a map."""

from pathlib import Path

from flight import FlightLog, FormatError, InputError, flight_log
from sysid.logs import read_bag, read_csv, read_ulog


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


def _read(path: Path, column_map: Path | None) -> FlightLog:
    name = path.name.lower()
    if name.endswith((".csv", ".csv.gz")):
        if column_map is None:
            raise FormatError(
                f"{path} is CSV: give its column map with --columns; "
                f"`goshawk log {path} --draft-columns columns.toml` drafts one"
            )
        return read_csv.read(path, read_csv.load_map(column_map))
    if name.endswith(".ulg"):
        return read_ulog.read(path)
    if name.endswith((".mcap", ".bag", ".db3")) or (path / "metadata.yaml").is_file():
        if column_map is None:
            raise FormatError(f"{path} is a ROS recording; give its column map with --columns (docs/identification.md)")
        return read_bag.read(path, column_map)
    log = flight_log.load(path)
    return FlightLog(log.columns, {"name": path.stem, **log.metadata})
