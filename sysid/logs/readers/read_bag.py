"""ROS recordings (.bag, .mcap, .db3, or the folder of a rosbag2), with a map that says which topic holds what."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from flight import FlightError, FlightLog, FormatError, InputError, errors, file_format, frames
from flight.flight_log import COLUMNS, MOST_ROTORS, ROTOR_QUANTITIES, columns_of
from flight.rotations import FloatArray
from sysid.logs.events import clock
from sysid.logs.events.event import noted
from sysid.logs.readers.read_csv import UNITS, table_of
from sysid.logs.readers.read_ulog import LOST
from sysid.logs.readers.salvage import is_cut_database, salvage
from sysid.logs.readers.streams import Stream, interpolated, joined

FORMAT = "goshawk-bag-map"
VERSION = 1

KNOWN = {
    "geometry_msgs/msg/PoseStamped": "pose",
    "geometry_msgs/msg/PoseWithCovarianceStamped": "pose.pose",
    "nav_msgs/msg/Odometry": "pose.pose",
}
"""Message types that hold a pose, and where."""
XYZ = ("x", "y", "z")
LONG_AGO_NS = 10**12
"""A recording that begins so late after the zero of its clock has no message at 0."""


def read(path: Path, map_file: Path) -> FlightLog:
    """Read a recording; rows are the instants of the pose (without one, of the IMU), others are interpolated there.

    Rotor speeds and commands keep their own rows, NaN elsewhere.

    Raises:
        InputError: there is no such file, or no such topic or field in it.
        FormatError: it is not a recording, or the map is not one.
    """
    return read_with(path, file_format.read_toml(Path(map_file), format=FORMAT, version=VERSION), Path(map_file))


def read_with(path: Path, wanted: dict[str, Any], map_file: Path) -> FlightLog:
    """The same with a map that was read; `map_file` is what errors name."""
    path = Path(path)
    topics = _topics(wanted, map_file)
    messages, lost = _messages(path, {entry["topic"] for entry in topics.values()})
    raw = {name: _stream(name, entry, *messages[entry["topic"]]) for name, entry in topics.items()}
    try:
        streams, events = clock.examined(raw)
    except FlightError as error:
        raise type(error)(f"{path}: {error}") from None
    base = next((streams.pop(name) for name in ("pose", "imu") if name in streams), None)
    if base is None:
        raise InputError(f"{map_file} names neither a [pose] nor an [imu] topic: nothing shows the motion")
    rotors = [streams.pop(name) for name in list(streams) if name.startswith("rotor_speed")]
    for stream in streams.values():
        base |= interpolated(base["time_s"], stream)
    for stream in rotors:
        base = joined(base, stream)
    begin_s = float(base["time_s"][0])
    base["time_s"] = base["time_s"] - begin_s
    found = noted(events, begin_s=begin_s)
    told = {LOST: lost} if lost else {}
    return FlightLog(base, {"name": path.stem, "source": path.name, **told, **found, **wanted.get("metadata", {})})


def _topics(wanted: dict[str, Any], map_file: Path) -> dict[str, dict[str, Any]]:
    """Stream name to `{topic, ...}`."""
    found = {name: wanted[name] for name in ("pose", "imu") if name in wanted}
    for key in ("quantity", "scalar"):
        found |= table_of(map_file, key, wanted.get(key, {}))
    table_of(map_file, "metadata", wanted.get("metadata", {}))
    for name, entry in found.items():
        table_of(map_file, name, entry)
        if not isinstance(entry.get("topic"), str):
            raise InputError(f'{map_file}: {name} names no topic; write topic = "/..."')
        scale, fields = entry.get("scale", 1.0), entry.get("fields", ())
        per_field = isinstance(scale, list) and isinstance(fields, list) and len(scale) == len(fields)
        scales = scale if per_field else [scale]
        if not all(isinstance(one, int | float) for one in scales):
            raise InputError(f"{map_file}: {name}.scale is {scale!r}; a number, or one a field, is expected")
        fields = entry.get("fields")
        if name not in ("pose", "imu") and not (isinstance(fields, list) and all(isinstance(f, str) for f in fields)):
            raise InputError(f"{map_file}: {name} names no fields; write fields = ['data[0]', 'data[1]']")
        if str(entry.get("unit", "1")) not in UNITS:
            raise InputError(f"{map_file}: unknown unit {entry['unit']!r}; known are {', '.join(UNITS)}")
    for name in wanted.get("quantity", {}):
        if name not in COLUMNS:
            raise InputError(f"{map_file}: unknown quantity {name}; known are {', '.join(COLUMNS)}")
    return found


def sampled(path: Path, count: int) -> list[tuple[str, str, int, list[Any]]]:
    """Per topic with messages: its name, its type, how many messages it has, and the first `count` that can be read.

    A topic of a type that the recording does not define is left out.

    Raises:
        InputError: there is no such file.
        FormatError: it is no recording.
    """
    found: dict[str, tuple[str, str, int, list[Any]]] = {}
    with _opened(path) as reader:
        known = [c for c in reader.connections if c.msgtype in reader.typestore.fielddefs]
        for connection, _, raw in reader.messages(known):
            name, kind, many, kept = found.get(connection.topic, (connection.topic, connection.msgtype, 0, []))
            if many < count:
                kept.append(reader.deserialize(raw, kind))
            found[name] = (name, kind, many + 1, kept)
    return list(found.values())


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """A reader of the recording; what goes wrong inside is said of the recording."""
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    if not path.exists():
        raise errors.missing(path)
    reader: Any = None
    if not (path.is_file() and is_cut_database(path)):
        try:
            reader = AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE))
            reader.open()
        except Exception as error:  # rosbags raises whatever its parsers stumble over
            reader = salvage(path, _said(error))
    try:
        yield reader if reader is not None else salvage(path, "the database is cut")
    except FlightError:
        raise
    except Exception as error:
        said = _said(error)
        raise FormatError(
            f"{path} is a damaged ROS recording: {said}; copy it again, or mend it (`ros2 bag reindex`, `rosbag fix`)"
        ) from error
    finally:
        if isinstance(reader, AnyReader):
            reader.close()


def _messages(path: Path, topics: set[str]) -> tuple[dict[str, tuple[str, FloatArray, list[Any]]], str]:
    """Per topic its type, the instants (s from a common zero) and the messages; and what could not be read.

    The instant is the header's stamp where there is one, else when the recorder received it.
    """
    stamps: dict[str, list[int]] = {topic: [] for topic in topics}
    received: dict[str, list[int]] = {topic: [] for topic in topics}
    kept: dict[str, list[Any]] = {topic: [] for topic in topics}
    with _opened(path) as reader:
        kinds = {c.topic: c.msgtype for c in reader.connections}
        missing = sorted(topics - set(kinds))
        if missing:
            raise InputError(f"{path} has no topic {missing[0]}; it has {', '.join(sorted(kinds))}")
        unknown = next((topic for topic in sorted(topics) if kinds[topic] not in reader.typestore.fielddefs), None)
        if unknown is not None:
            raise InputError(
                f"{path}: topic {unknown} is {kinds[unknown]}, which the recording does not define; leave it out of "
                "the map, "
                "or record with ROS 2 Iron or newer, or to MCAP"
            )
        lost = str(getattr(reader, "lost", ""))
        for connection, received_ns, raw in reader.messages([c for c in reader.connections if c.topic in topics]):
            message = reader.deserialize(raw, connection.msgtype)
            stamp = getattr(getattr(message, "header", None), "stamp", None)
            stamped_ns = 0 if stamp is None else stamp.sec * 10**9 + stamp.nanosec
            stamps[connection.topic].append(stamped_ns)
            received[connection.topic].append(received_ns)
            kept[connection.topic].append(message)
    empty = [topic for topic in topics if not kept[topic]]
    if empty:
        raise InputError(f"{path} has no message on {empty[0]}")
    # where most messages bear no stamp the recorder's counts; a single one without is a fault of its stream
    times = {topic: stamps[topic] if np.median(stamps[topic]) > 0 else received[topic] for topic in topics}
    first_ns = min(int(np.median(ns)) for ns in times.values())
    return {topic: (kinds[topic], _seconds(times[topic], first_ns), kept[topic]) for topic in topics}, lost


def _seconds(times_ns: list[int], first_ns: int) -> FloatArray:
    """Times after the first. On a clock that began long ago a stamp of 0 is none."""
    unset = first_ns > LONG_AGO_NS
    return np.array([np.nan if unset and not t else 1e-9 * (t - first_ns) for t in times_ns], dtype=np.float64)


def _stream(name: str, entry: dict[str, Any], kind: str, time_s: FloatArray, messages: list[Any]) -> Stream:
    """Columns of one stream in our frames and units, in the order of the file."""
    flipped = entry.get("frame", "z up") == "z down"
    columns: Stream = {}
    for quantity, fields in _fields(name, entry, kind):
        values = np.array([[_value(m, f, entry["topic"]) for f in fields] for m in messages], dtype=np.float64)
        values *= UNITS[entry.get("unit", "1")] * np.asarray(entry.get("scale", 1.0), dtype=np.float64)
        if flipped:
            values = frames.flip_attitude(values) if quantity == "q_world_body" else frames.flip_vector(values)
        columns |= columns_of(quantity, values) if quantity in COLUMNS else {quantity: values[:, 0]}
    return {"time_s": time_s} | columns


def _fields(name: str, entry: dict[str, Any], kind: str) -> Iterator[tuple[str, list[str]]]:
    if name == "pose":
        if kind not in KNOWN:
            raise InputError(f"{entry['topic']} is {kind}; a pose comes as {', '.join(KNOWN)}")
        yield "position_world_m", [f"{KNOWN[kind]}.position.{axis}" for axis in XYZ]
        yield "q_world_body", [f"{KNOWN[kind]}.orientation.{axis}" for axis in ("w", *XYZ)]
    elif name == "imu":
        if kind != "sensor_msgs/msg/Imu":
            raise InputError(f"{entry['topic']} is {kind}; an IMU comes as sensor_msgs/msg/Imu")
        yield "rate_body_rad_s", [f"angular_velocity.{axis}" for axis in XYZ]
        yield "specific_force_body_m_s2", [f"linear_acceleration.{axis}" for axis in XYZ]
    else:
        fields = entry["fields"]
        rotors = name in ROTOR_QUANTITIES and 4 < len(fields) <= MOST_ROTORS
        if len(fields) != len(COLUMNS.get(name, (name,))) and not rotors:
            raise InputError(f"{name} needs {len(COLUMNS.get(name, (name,)))} fields, the map names {len(fields)}")
        yield name, list(fields)


def _value(message: Any, field: str, topic: str) -> float:
    """The number at a path like `twist.linear.x` or `data[2]`."""
    found = message
    try:
        for part in re.findall(r"\w+", field):
            found = found[int(part)] if part.isdigit() else getattr(found, part)
        return float(found)
    except (AttributeError, IndexError, TypeError, ValueError):
        raise InputError(f"messages on {topic} have no number at {field}") from None


def _said(error: Exception) -> str:
    if isinstance(error, UnicodeDecodeError):  # where rosbags reads a name or a first line
        return "bytes stand where it has text"
    return " ".join(str(error).split()) or type(error).__name__
