"""Writers of recordings with stamps of their own choosing, in five formats; with no code of the readers."""

import shutil
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import sysid
from flight import FlightLog
from flight.flight_log import COLUMNS
from tests.sysid.logs.readers import encode_dataflash

BEGAN_S = 60.0
NED = np.array([1.0, -1.0, -1.0])


@dataclass(frozen=True)
class Recorded:
    """A flight as arrays; z up."""

    time_s: np.ndarray
    stamps_s: np.ndarray
    """(n,) what is written for the pose's times (in CSV, for all)."""
    position: np.ndarray
    q: np.ndarray
    rate: np.ndarray
    rotors: np.ndarray


def recorded(log: FlightLog) -> Recorded:
    vectors = [log.vector(q) for q in ("position_world_m", "q_world_body", "rate_body_rad_s", "rotor_speed_rad_s")]
    time_s = log.time_s - log.time_s[0]
    return Recorded(time_s, BEGAN_S + time_s, *vectors)


MAP = """format = "goshawk-csv-map"
version = 1
time = { column = "t", unit = "us" }
[quantity.position_world_m]
columns = ["x", "y", "z"]
[quantity.q_world_body]
columns = ["qw", "qx", "qy", "qz"]
order = "w x y z"
[quantity.rate_body_rad_s]
columns = ["p", "q", "r"]
[quantity.rotor_speed_rad_s]
columns = ["n0", "n1", "n2", "n3"]
"""


def csv(folder: Path, flight: Recorded) -> FlightLog:
    """The stamps are in microseconds, as signed counters write them."""
    table = np.column_stack([np.round(1e6 * flight.stamps_s), flight.position, flight.q, flight.rate, flight.rotors])
    header = "t,x,y,z,qw,qx,qy,qz,p,q,r,n0,n1,n2,n3"
    np.savetxt(folder / "f.csv", table, delimiter=",", header=header, comments="", fmt="%.15g")
    (folder / "map.toml").write_text(MAP)
    log = sysid.read_log(folder / "f.csv", folder / "map.toml")
    return FlightLog(log.columns, {**log.metadata, "began_s": -float(log.time_s[0])})


def ulog(folder: Path, flight: Recorded) -> FlightLog:
    """The position's and the attitude's topics bear the stamps; gyro and ESCs the right ones."""
    flipped = np.hstack([flight.position * NED, np.gradient(flight.position, flight.time_s, axis=0) * NED])
    topics = {
        "vehicle_local_position": ("float x;float y;float z;float vx;float vy;float vz;", flipped, flight.stamps_s),
        "vehicle_attitude": ("float[4] q;", flight.q * np.array([1, 1, -1, -1]), flight.stamps_s),
        "vehicle_angular_velocity": ("float[3] xyz;", flight.rate * NED, BEGAN_S + flight.time_s),
        "esc_status": ("esc_report[4] esc;", flight.rotors * 30.0 / np.pi, BEGAN_S + flight.time_s),
    }

    def message(kind: bytes, body: bytes) -> bytes:
        return struct.pack("<HB", len(body), kind[0]) + body

    data = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0) + message(b"B", bytes(40))
    data += message(b"F", b"esc_report:float esc_rpm;")
    for name, (fields, _, _) in topics.items():
        data += message(b"F", f"{name}:uint64_t timestamp;{fields}".encode())
    data += b"".join(message(b"A", struct.pack("<BH", 0, i) + name.encode()) for i, name in enumerate(topics))
    rows = []
    for k in range(len(flight.time_s)):
        for i, (_, values, stamps_s) in enumerate(topics.values()):
            stamp = round(1e6 * float(stamps_s[k])) % 2**64
            rows.append(message(b"D", struct.pack(f"<HQ{values.shape[1]}f", i, stamp, *values[k])))
    (folder / "f.ulg").write_bytes(data + b"".join(rows))
    return sysid.read_log(folder / "f.ulg")


BAG = """format = "goshawk-bag-map"
version = 1
pose = { topic = "/pose" }
imu = { topic = "/imu" }
[quantity.rotor_speed_rad_s]
topic = "/motors"
fields = ["data[0]", "data[1]", "data[2]", "data[3]"]
"""


KINDS = {
    "/pose": "geometry_msgs/msg/PoseStamped",
    "/imu": "sensor_msgs/msg/Imu",
    "/motors": "std_msgs/msg/Float64MultiArray",
}
LATE_S = 1e6


def _messages(store: Any, flight: Recorded, ros1: bool) -> Iterator[tuple[str, int, Any]]:
    """Topic, time of reception in ns, message. Header stamps of the pose are those given."""
    make, none = store.types, np.zeros(9)

    def header(stamp_s: float) -> Any:
        ns = max(round(1e9 * stamp_s), 0)
        stamp = make["builtin_interfaces/msg/Time"](sec=ns // 10**9, nanosec=ns % 10**9)
        return make["std_msgs/msg/Header"](stamp=stamp, frame_id="world", **({"seq": 0} if ros1 else {}))

    def three(kind: str, v: np.ndarray) -> Any:
        return make[f"geometry_msgs/msg/{kind}"](x=float(v[0]), y=float(v[1]), z=float(v[2]))

    def four(v: np.ndarray) -> Any:
        return make["geometry_msgs/msg/Quaternion"](w=float(v[0]), x=float(v[1]), y=float(v[2]), z=float(v[3]))

    for k, time_s in enumerate(LATE_S + BEGAN_S + flight.time_s):
        stamp_s = LATE_S + flight.stamps_s[k] if flight.stamps_s[k] else 0.0
        place = make["geometry_msgs/msg/Pose"](
            position=three("Point", flight.position[k]), orientation=four(flight.q[k])
        )
        layout = make["std_msgs/msg/MultiArrayLayout"](dim=[], data_offset=0)
        yield "/pose", round(1e9 * time_s), make[KINDS["/pose"]](header=header(stamp_s), pose=place)
        yield (
            "/imu",
            round(1e9 * time_s),
            make[KINDS["/imu"]](
                header=header(time_s),
                orientation=four(np.eye(4)[0]),
                orientation_covariance=none,
                angular_velocity=three("Vector3", flight.rate[k]),
                angular_velocity_covariance=none,
                linear_acceleration=three("Vector3", np.array([0.0, 0.0, 9.8])),
                linear_acceleration_covariance=none,
            ),
        )
        yield "/motors", round(1e9 * time_s), make[KINDS["/motors"]](layout=layout, data=flight.rotors[k])


def _without_force(log: FlightLog) -> FlightLog:
    still = {name: values for name, values in log.columns.items() if not name.startswith("specific_force")}
    assert set(COLUMNS["q_world_body"]) <= set(still)
    return FlightLog(still, log.metadata)


def mcap(folder: Path, flight: Recorded) -> FlightLog:
    """Recorded when the samples were taken."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store: Any = get_typestore(Stores.ROS2_HUMBLE)
    place = folder / "bag"
    shutil.rmtree(place, ignore_errors=True)
    with Writer(place, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        links = {topic: writer.add_connection(topic, kind, typestore=store) for topic, kind in KINDS.items()}
        for topic, ns, message in _messages(store, flight, ros1=False):
            writer.write(links[topic], ns, store.serialize_cdr(message, KINDS[topic]))
    (folder / "bag.toml").write_text(BAG)
    return _without_force(sysid.read_log(place, folder / "bag.toml"))


def bag(folder: Path, flight: Recorded) -> FlightLog:
    """ROS 1."""
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store: Any = get_typestore(Stores.ROS1_NOETIC)
    place = folder / "f.bag"
    place.unlink(missing_ok=True)
    with Writer(place) as writer:
        links = {topic: writer.add_connection(topic, kind, typestore=store) for topic, kind in KINDS.items()}
        for topic, ns, message in _messages(store, flight, ros1=True):
            writer.write(links[topic], ns, store.serialize_ros1(message, KINDS[topic]))
    (folder / "bag.toml").write_text(BAG)
    return _without_force(sysid.read_log(place, folder / "bag.toml"))


def ardupilot(folder: Path, flight: Recorded) -> FlightLog:
    """Packed by pymavlink: the estimator's messages bear the stamps, gyro and ESCs the right ones."""
    writer = encode_dataflash.Writer()
    position, velocity = (v * NED for v in (flight.position, np.gradient(flight.position, flight.time_s, axis=0)))
    q, rate, rpm = flight.q * [1, 1, -1, -1], flight.rate * NED, flight.rotors * 30.0 / np.pi
    for k, time_s in enumerate(BEGAN_S + flight.time_s):
        stamp, us = round(1e6 * float(flight.stamps_s[k])) % 2**64, round(1e6 * time_s)
        writer.add("XKF1", stamp, 0, 0, 0, 0, *map(float, velocity[k]), 0.0, *map(float, position[k]), 0, 0, 0, 0)
        writer.add("XKQ", stamp, 0, *map(float, q[k]))
        writer.add("IMU", us, 0, *map(float, rate[k]), 0.0, 0.0, -9.8, 0, 0, 40.0, 1, 1, 1000, 1000)
        for i, r in enumerate(encode_dataflash.OURS_OF_MOTOR):
            writer.add("ESC", us, i, float(rpm[k, r]), 0.0, 16.0, 1.0, 40.0, 0.0, 0, 0.0)
    (folder / "f.bin").write_bytes(writer.content)
    log = _without_force(sysid.read_log(folder / "f.bin"))
    order = [encode_dataflash.OURS_OF_MOTOR.index(i) for i in range(4)]
    speeds = log.vector("rotor_speed_rad_s")[:, order]
    named = dict(zip(COLUMNS["rotor_speed_rad_s"], speeds.T, strict=True))
    return FlightLog({**log.columns, **named}, log.metadata)


FORMATS: dict[str, Callable[[Path, Recorded], FlightLog]] = {
    "csv": csv,
    "ulog": ulog,
    "mcap": mcap,
    "bag": bag,
    "ardupilot": ardupilot,
}
"""Each writes a file and reads it back as users do."""
