"""A flight written as PX4 writes it (ULog), each topic with stamps of its own."""

import struct
from collections.abc import Mapping

import numpy as np

from flight import FlightLog
from flight.frames import flip_attitude, flip_vector

BOOT_US = 60_000_000
FIELDS = {
    "vehicle_local_position": "float x;float y;float z;float vx;float vy;float vz;",
    "vehicle_attitude": "float[4] q;float quat_reset_counter;",
    "vehicle_angular_velocity": "float[3] xyz;",
    "esc_status": "esc_report[4] esc;",
}


def stamps_us(log: FlightLog) -> np.ndarray:
    return BOOT_US + np.round(1e6 * log.time_s).astype(np.int64)


def ulog(
    log: FlightLog,
    stamps: Mapping[str, np.ndarray] | None = None,
    resets: np.ndarray | None = None,
    outputs: np.ndarray | None = None,
    parameters: Mapping[str, int] | None = None,
) -> bytes:
    """The file.

    Args:
        stamps: (n,) us, of topics whose clock is not right.
        resets: (n,) counter of the attitude.
        outputs: (n, k) of the motors and what else has one, logged instead of the ESCs' speeds.
        parameters: of the firmware, by name.
    """
    counter = np.zeros(len(log)) if resets is None else resets
    position, velocity = log.vector("position_world_m"), np.gradient(log.vector("position_world_m"), log.time_s, axis=0)
    rows = {
        "vehicle_local_position": np.hstack([flip_vector(position), flip_vector(velocity)]),
        "vehicle_attitude": np.column_stack([flip_attitude(log.vector("q_world_body")), counter]),
        "vehicle_angular_velocity": flip_vector(log.vector("rate_body_rad_s")),
        "esc_status": log.vector("rotor_speed_rad_s") * 30.0 / np.pi,
    }
    if outputs is not None:
        rows = {**{name: values for name, values in rows.items() if name != "esc_status"}, "actuator_outputs": outputs}
    own = {name: stamps_us(log) for name in rows} | dict(stamps or {})
    data = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0) + _message(b"B", bytes(40))
    for name, value in (parameters or {}).items():
        key = f"int32_t {name}".encode()
        data += _message(b"P", bytes([len(key)]) + key + struct.pack("<i", value))
    fields = FIELDS if outputs is None else {**FIELDS, "actuator_outputs": f"float[{outputs.shape[1]}] output;"}
    data += _message(b"F", b"esc_report:float esc_rpm;")
    data += b"".join(_message(b"F", f"{name}:uint64_t timestamp;{fields[name]}".encode()) for name in rows)
    data += b"".join(_message(b"A", struct.pack("<BH", 0, i) + name.encode()) for i, name in enumerate(rows))
    for k in range(len(log)):
        for i, (name, values) in enumerate(rows.items()):
            packed = struct.pack(f"<HQ{values.shape[1]}f", i, int(own[name][k]), *values[k])
            data += _message(b"D", packed)
    return data


def _message(kind: bytes, body: bytes) -> bytes:
    return struct.pack("<HB", len(body), kind[0]) + body
