"""Read a flight log of any kind we know: our own Parquet, PX4, ArduPilot, CSV or a ROS recording."""

import tomllib
from pathlib import Path

from flight import FlightLog, FormatError, InputError, errors, flight_log
from sysid.logs.readers import (
    draft_columns,
    draft_topics,
    own_columns,
    read_ardupilot,
    read_bag,
    read_blackbox,
    read_csv,
    read_poses,
    read_tlog,
    read_ulog,
    read_usdlog,
)
from sysid.logs.readers.draft_columns import Draft
from sysid.logs.readers.kinds import kind_of, own_other

DRAFTED = "drafted"
"""Key of a log's metadata: what the columns of a file without a map were taken for, one sentence each."""
READERS = {
    "ulog": read_ulog.read,
    "ardupilot": read_ardupilot.read,
    "blackbox": read_blackbox.read,
    "usdlog": read_usdlog.read,
    "tlog": read_tlog.read,
    "tum": read_poses.read_tum,
}
"""Kinds that say themselves what their columns are."""
_BY_OPTION = {
    "goshawk-vehicle": "give it by --vehicle",
    "goshawk-csv-map": "give it by --columns",
    "goshawk-bag-map": "give it by --columns",
}
KINDS = (
    "PX4 (.ulg), ArduPilot (.BIN, .log), blackbox (.BBL, .BFL), Crazyflie's SD card, telemetry (.tlog), TUM, EuRoC's "
    "folder, CSV, ROS (.bag, .mcap, .db3) or our own (.parquet)"
)


def read_log(path: Path, column_map: Path | None = None) -> FlightLog:
    """The log in `path`; the kind goes by its content.

    A CSV file or a ROS recording without a map is read by a drafted one; the metadata say under `drafted` what it is.

    Args:
        column_map: TOML file that says what the columns of a CSV file, or the topics of a ROS recording, are.

    Raises:
        InputError: the file is not there, or a column the map names is missing.
        FormatError: the file cannot be read as what it is.
    """
    path = Path(path)
    try:
        return _read(path, column_map)
    except (InputError, FormatError) as error:
        if str(path) in str(error) or (column_map is not None and str(column_map) in str(error)):
            raise
        raise type(error)(f"{path}: {error}") from None
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}") from error


def draft(path: Path) -> Draft:
    """A first map of a CSV file or a ROS recording.

    Raises:
        InputError: there is no such file, or it says itself what its columns are.
        FormatError: it cannot be read.
    """
    kind = _kind(Path(path))
    if kind in (*READERS, "parquet"):
        raise InputError(f"{path} says itself what its columns are: read it without a column map")
    return (draft_topics if kind == "ros" else draft_columns).draft(Path(path))


def needs_map(path: Path) -> bool:
    """Whether it is a CSV file or a ROS recording, which does not say itself what its columns are."""
    return _kind(Path(path)) in ("csv", "ros")


def _kind(path: Path) -> str:
    if not path.exists():
        raise errors.missing(path)
    kind = kind_of(path)
    if kind == "csv" and (own := own_other(path)):
        raise FormatError(f"{path} is a {own} file, no flight log; {_BY_OPTION.get(own, 'give a log')}")
    return kind


def _read(path: Path, column_map: Path | None) -> FlightLog:
    if column_map is not None and not column_map.exists():
        raise errors.missing(column_map, "the column map (--columns)")
    kind = _kind(path)
    if kind == "csv":
        return _drafted(path) if column_map is None else read_csv.read(path, read_csv.load_map(column_map))
    if kind == "ros":
        return _drafted_topics(path) if column_map is None else read_bag.read(path, column_map)
    if kind == "euroc":
        return _euroc(path)
    if kind == "folder":
        raise InputError(
            f"{path} is a folder; give a flight log (a folder is one as a ROS 2 recording or EuRoC's mav0)"
        )
    if kind in READERS:
        return READERS[kind](path)
    try:
        log = flight_log.load(path)
    except FormatError as error:
        if path.suffix == ".parquet":
            raise
        raise FormatError(f"{path} is not a flight log: by its content it is none of {KINDS}") from error
    return FlightLog(log.columns, {"name": path.stem, **log.metadata})


def read_joined(pose: Path, imu: Path, column_map: Path | None = None, *, align: bool = False) -> FlightLog:
    """One log of a pose and an IMU in two files that one clock stamped.

    Args:
        column_map: of both, where they are CSV with the same names; else each is drafted.
        align: two clocks stamped them, whose offset is found by how both saw the vehicle turn.

    Raises:
        InputError: one lacks what it should hold, or the clocks share no time.
        FormatError: one cannot be read.
    """
    logs = [read_log(path, column_map if needs_map(path) else None) for path in (pose, imu)]
    joined = read_poses.joined_on_clocks(pose, *logs, align=align)
    drafted = [f"{log.metadata['source']}: {s}" for log in logs for s in log.metadata.get(DRAFTED, ())]
    return FlightLog(joined.columns, {**joined.metadata, **({DRAFTED: drafted} if drafted else {})})


def _euroc(folder: Path) -> FlightLog:
    pose, imu = read_poses.euroc_files(folder)
    if pose is not None and imu is not None:
        log = read_joined(pose, imu)
    elif (one := pose or imu) is not None:
        log = read_log(one)
    else:
        raise InputError(f"{folder} has neither imu0/data.csv nor a pose (state_groundtruth_estimate0/data.csv ...)")
    return FlightLog(log.columns, {**log.metadata, "name": folder.resolve().name, "source": folder.name})


def _drafted(path: Path) -> FlightLog:
    if (own := own_columns.column_map(path)) is not None:
        return read_csv.read(path, own)
    drafted = draft_columns.draft(path)
    column_map = read_csv.map_of(tomllib.loads(drafted.text), Path(f"the columns drafted for {path}"))
    return _marked(read_csv.read(path, column_map), drafted)


def _drafted_topics(path: Path) -> FlightLog:
    drafted = draft_topics.draft(path)
    return _marked(
        read_bag.read_with(path, tomllib.loads(drafted.text), Path(f"the topics drafted for {path}")), drafted
    )


def _marked(log: FlightLog, drafted: Draft) -> FlightLog:
    """The log with what was drafted in its metadata."""
    sentences = [guess.sentence for guess in drafted.guesses]
    if drafted.unused:
        sentences.append(f"not used: {', '.join(drafted.unused)}")
    return FlightLog(log.columns, {**log.metadata, DRAFTED: sentences})
