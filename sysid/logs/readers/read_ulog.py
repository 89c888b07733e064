"""PX4 logs (ULog): pose, rates, motor commands, ESC speed and battery, turned into our frames and units."""

import contextlib
import io
from pathlib import Path
from typing import Any

import numpy as np

from flight import FlightLog, FormatError, InputError, frames, rotations
from flight.flight_log import COLUMNS
from flight.rotations import FloatArray
from flight.units import RAD_S_PER_RPM
from sysid.logs.readers.streams import interpolated, joined

LOST = "lost"
"""Key of a log's metadata: a sentence on what of the file could not be read."""
_HEADER_BYTES = 16
_MESSAGE_TYPES = b"ABCDFILMOPQRS"  # https://docs.px4.io/main/en/dev_log/ulog_file_format


def read(path: Path) -> FlightLog:
    """Read a ULog file.

    Rows are the instants of `vehicle_local_position`, with the faster attitude and rates interpolated there, and those
    of the ESCs (NaN elsewhere). Motor commands (0 to 1) become `motor_command_0_ratio` and so on.

    A file that was cut or damaged is read as far as it goes; the metadata then say under `LOST` what is missing.

    Raises:
        InputError: there is no such file, or it lacks position or attitude.
        FormatError: it is not a ULog file.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path} does not exist or is not a file")
    from pyulog import ULog

    try:
        with contextlib.redirect_stdout(io.StringIO()):  # pyulog prints what `_lost` says with the place
            ulog = ULog(str(path))
        topics = {d.name: d.data for d in ulog.data_list if d.multi_id == 0}
    except Exception as error:  # pyulog raises whatever its parser stumbles over
        raise FormatError(f"{path} is not a readable ULog file: {error}") from error
    for name in ("vehicle_local_position", "vehicle_attitude"):
        if name not in topics:
            raise InputError(f"{path} has no {name}; it has {', '.join(sorted(topics)) or 'no messages'}")
    columns = _pose(topics)
    for part in (_rates(topics), _accelerations(topics), _motors(topics), _battery(topics)):
        columns |= interpolated(columns["time_s"], part)
    columns = joined(columns, _rotor_speeds(topics))
    if not len(columns["time_s"]):
        raise InputError(f"{path}: no position falls within the time of the attitude; record both for 10 s or more")
    begin_s = columns["time_s"][0]
    columns["time_s"] = columns["time_s"] - begin_s
    lost = _lost(path.read_bytes(), 1e-6 * ulog.last_timestamp - begin_s, damaged=ulog.file_corruption)
    return FlightLog(columns, {"name": path.stem, "source": path.name} | ({LOST: lost} if lost else {}))


def _lost(content: bytes, last_s: float, *, damaged: bool) -> str:
    """Which bytes of a ULog file are no whole messages, in one sentence; empty: none.

    A file that was cut between two messages looks whole: the format has no mark of the end.

    Args:
        last_s: time of the last message that was read, in the log's own time.
        damaged: whether pyulog skipped messages.
    """
    at, end = _HEADER_BYTES, len(content)
    while at < end:
        head = content[at : at + 3]  # size of the body (16 bits), type
        if len(head) == 3 and head[2] not in _MESSAGE_TYPES:
            return (
                f"the file is damaged at byte {at} of {end}: messages from there on are missing; the last one that "
                f"could be read is at {last_s:.3f} s"
            )
        size = 3 + int.from_bytes(head[:2], "little") if len(head) == 3 else 3
        if at + size > end:
            return (
                f"the file was cut: it ends at byte {end}, {at + size - end} bytes before the end of a message, and "
                f"nothing after {last_s:.3f} s is in it"
            )
        at += size
    return f"the file is damaged: messages before {last_s:.3f} s could not be read" if damaged else ""


def _time(data: dict[str, Any]) -> FloatArray:
    stamp = data.get("timestamp_sample", data["timestamp"])
    return np.asarray(stamp if np.any(stamp) else data["timestamp"], dtype=np.float64) * 1e-6


def _three(data: dict[str, Any], names: tuple[str, ...]) -> FloatArray:
    return frames.flip_vector(np.stack([np.asarray(data[n], dtype=np.float64) for n in names], axis=1))


def _columns(quantity: str, values: FloatArray) -> dict[str, FloatArray]:
    return dict(zip(COLUMNS[quantity], values.T, strict=True))


def _pose(topics: dict[str, Any]) -> dict[str, FloatArray]:
    local, attitude = topics["vehicle_local_position"], topics["vehicle_attitude"]
    time_s, attitude_s = _time(local), _time(attitude)
    rows = (time_s >= attitude_s[0]) & (time_s <= attitude_s[-1])
    rows[1:] &= np.diff(time_s) > 0.0
    q = np.stack([np.asarray(attitude[f"q[{i}]"], dtype=np.float64) for i in range(4)], axis=1)
    after = np.clip(np.searchsorted(attitude_s, time_s[rows]), 1, len(attitude_s) - 1)
    span = np.maximum(attitude_s[after] - attitude_s[after - 1], 1e-9)
    share = (time_s[rows] - attitude_s[after - 1]) / span
    at = rotations.slerp(rotations.normalise(q[after - 1]), rotations.normalise(q[after]), share)
    return {
        "time_s": time_s[rows],
        **_columns("position_world_m", _three(local, ("x", "y", "z"))[rows]),
        **_columns("velocity_world_m_s", _three(local, ("vx", "vy", "vz"))[rows]),
        **_columns("q_world_body", frames.flip_attitude(at)),
    }


def _rates(topics: dict[str, Any]) -> dict[str, FloatArray]:
    if "vehicle_angular_velocity" in topics:
        data = topics["vehicle_angular_velocity"]
        return {"time_s": _time(data), **_columns("rate_body_rad_s", _three(data, ("xyz[0]", "xyz[1]", "xyz[2]")))}
    if "sensor_combined" in topics:
        data = topics["sensor_combined"]
        names = ("gyro_rad[0]", "gyro_rad[1]", "gyro_rad[2]")
        return {"time_s": _time(data), **_columns("rate_body_rad_s", _three(data, names))}
    return {}


def _accelerations(topics: dict[str, Any]) -> dict[str, FloatArray]:
    if "vehicle_acceleration" in topics:
        data, names = topics["vehicle_acceleration"], ("xyz[0]", "xyz[1]", "xyz[2]")
    elif "sensor_combined" in topics:
        data, names = topics["sensor_combined"], tuple(f"accelerometer_m_s2[{i}]" for i in range(3))
    else:
        return {}
    return {"time_s": _time(data), **_columns("specific_force_body_m_s2", _three(data, names))}


def _motors(topics: dict[str, Any]) -> dict[str, FloatArray]:
    if "actuator_motors" not in topics:
        return {}
    data = topics["actuator_motors"]
    commands = {f"motor_command_{i}_ratio": np.asarray(data[f"control[{i}]"], dtype=np.float64) for i in range(4)}
    return {"time_s": _time(data), **commands}


def _battery(topics: dict[str, Any]) -> dict[str, FloatArray]:
    if "battery_status" not in topics:
        return {}
    data = topics["battery_status"]
    return {"time_s": _time(data), "battery_v": np.asarray(data["voltage_v"], dtype=np.float64)}


def _rotor_speeds(topics: dict[str, Any]) -> dict[str, FloatArray]:
    """Speeds in the order of PX4's motors 1 to 4, sizes only."""
    if "esc_status" not in topics:
        return {}
    data = topics["esc_status"]
    speeds = np.stack([np.asarray(data[f"esc[{i}].esc_rpm"], dtype=np.float64) for i in range(4)], axis=1)
    return {"time_s": _time(data), **_columns("rotor_speed_rad_s", np.abs(speeds) * RAD_S_PER_RPM)}
