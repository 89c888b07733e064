"""A flight log for other programs: CSV with units in the names, or an MCAP recording of ROS 2 messages."""

import csv
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from flight import FlightLog, InputError, Progress, silent
from flight.flight_log import COLUMNS

POSE_TOPIC, IMU_TOPIC = "/goshawk/pose", "/goshawk/imu"
ROWS_PER_REPORT = 5000
"""Progress is reported once in so many rows."""


def write_csv(path: Path, log: FlightLog, progress: Progress = silent) -> None:
    """One row per instant; a value that was not sampled is an empty cell."""
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(log.columns)
        for i, row in enumerate(zip(*(values.tolist() for values in log.columns.values()), strict=True)):
            if i % ROWS_PER_REPORT == 0:
                progress("writing CSV", i / len(log))
            writer.writerow(["" if value != value else repr(value) for value in row])


def write_mcap(path: Path, log: FlightLog, progress: Progress = silent) -> list[str]:
    """ROS 2 messages: `PoseStamped`, `Imu`, and `Float64MultiArray` for every other vector; returns the topics.

    The instants are those of the log, from 0 at 1970. ROS's body and world axes are ours.

    Raises:
        InputError: the log holds no finite row, or times before 1970.
    """
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    if log.time_s[0] < 0.0:
        raise InputError(f"the log's time begins at {log.time_s[0]:g} s; MCAP has no times before 0: shift it")
    store = get_typestore(Stores.ROS2_HUMBLE)
    written = []
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=".goshawk-mcap-") as scratch:
        folder = Path(scratch) / "recording"
        with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            for topic, kind, messages in _topics(log, store):
                connection = writer.add_connection(topic, kind, typestore=store)
                for i, (time_ns, message) in enumerate(messages):
                    if i % ROWS_PER_REPORT == 0:
                        progress(f"writing MCAP, {topic}", i / len(log))
                    writer.write(connection, time_ns, store.serialize_cdr(message, kind))
                written.append(topic)
        recorded = sorted(folder.glob("*.mcap*"))
        if not written or len(recorded) != 1:
            raise InputError("the log holds no stream with a finite row; there is nothing to write")
        recorded[0].replace(path)
    return written


def _topics(log: FlightLog, store: Any) -> Iterator[tuple[str, str, Iterator[tuple[int, Any]]]]:
    """Topic, message type and messages of every stream."""
    done = {"time_s"}
    if log.has("position_world_m") and log.has("q_world_body"):
        done |= {*COLUMNS["position_world_m"], *COLUMNS["q_world_body"]}
        yield POSE_TOPIC, "geometry_msgs/msg/PoseStamped", _poses(log, store)
    if log.has("rate_body_rad_s") and log.has("specific_force_body_m_s2"):
        done |= {*COLUMNS["rate_body_rad_s"], *COLUMNS["specific_force_body_m_s2"]}
        yield IMU_TOPIC, "sensor_msgs/msg/Imu", _imu(log, store)
    for quantity, names in COLUMNS.items():
        if log.has(quantity) and not set(names) <= done:
            done |= set(names)
            yield f"/goshawk/{quantity}", "std_msgs/msg/Float64MultiArray", _arrays(log, list(names), store)
    for name in log.columns:
        if name not in done:
            yield f"/goshawk/{name}", "std_msgs/msg/Float64MultiArray", _arrays(log, [name], store)


def _sampled(log: FlightLog, names: list[str]) -> Iterator[tuple[int, list[float]]]:
    """Nanoseconds and values of the rows where all of `names` were sampled."""
    values = np.stack([log.columns[name] for name in names], axis=1)
    for row in np.flatnonzero(np.isfinite(values).all(axis=1)):
        yield round(float(log.time_s[row]) * 1e9), values[row].tolist()


def _header(time_ns: int, store: Any, frame: str) -> Any:
    types = store.types
    stamp = types["builtin_interfaces/msg/Time"](sec=time_ns // 10**9, nanosec=time_ns % 10**9)
    return types["std_msgs/msg/Header"](stamp=stamp, frame_id=frame)


def _poses(log: FlightLog, store: Any) -> Iterator[tuple[int, Any]]:
    types = store.types
    for time_ns, v in _sampled(log, [*COLUMNS["position_world_m"], *COLUMNS["q_world_body"]]):
        point = types["geometry_msgs/msg/Point"](x=v[0], y=v[1], z=v[2])
        turned = types["geometry_msgs/msg/Quaternion"](w=v[3], x=v[4], y=v[5], z=v[6])
        pose = types["geometry_msgs/msg/Pose"](position=point, orientation=turned)
        yield time_ns, types["geometry_msgs/msg/PoseStamped"](header=_header(time_ns, store, "world"), pose=pose)


def _imu(log: FlightLog, store: Any) -> Iterator[tuple[int, Any]]:
    types = store.types
    none = types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0)
    unknown, absent = (
        np.zeros(9),
        np.array([-1.0, *[0.0] * 8]),
    )  # sensor_msgs/Imu: a first element of -1 means that there is no attitude
    vector = types["geometry_msgs/msg/Vector3"]
    for time_ns, v in _sampled(log, [*COLUMNS["rate_body_rad_s"], *COLUMNS["specific_force_body_m_s2"]]):
        yield (
            time_ns,
            types["sensor_msgs/msg/Imu"](
                header=_header(time_ns, store, "body"),
                orientation=none,
                orientation_covariance=absent,
                angular_velocity=vector(x=v[0], y=v[1], z=v[2]),
                angular_velocity_covariance=unknown,
                linear_acceleration=vector(x=v[3], y=v[4], z=v[5]),
                linear_acceleration_covariance=unknown,
            ),
        )


def _arrays(log: FlightLog, names: list[str], store: Any) -> Iterator[tuple[int, Any]]:
    types = store.types
    size = types["std_msgs/msg/MultiArrayDimension"](label=" ".join(names), size=len(names), stride=len(names))
    layout = types["std_msgs/msg/MultiArrayLayout"](dim=[size], data_offset=0)
    for time_ns, values in _sampled(log, names):
        yield time_ns, types["std_msgs/msg/Float64MultiArray"](layout=layout, data=np.array(values))
