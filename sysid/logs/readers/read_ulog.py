"""PX4 logs (ULog): pose, rates, motor commands, ESC speed and battery, turned into our frames and units."""

import contextlib
import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from flight import FlightError, FlightLog, FormatError, InputError, errors, frames, rotations
from flight.flight_log import COLUMNS, MOST_ROTORS, columns_of
from flight.rotations import FloatArray
from flight.units import RAD_S_PER_RPM
from sysid.logs.events import clock, resets
from sysid.logs.events.event import Event, noted
from sysid.logs.events.stamps import longest_pause_s
from sysid.logs.readers.streams import Stream, interpolated, joined

LOST = "lost"
"""Key of a log's metadata: a sentence on what of the file could not be read."""
POSITION, ATTITUDE = "vehicle_local_position", "vehicle_attitude"
RESETS = (
    ("position_world_m", POSITION, "xy_reset_counter", ("delta_xy[0]", "delta_xy[1]"), "m"),
    ("position_world_m", POSITION, "z_reset_counter", ("delta_z",), "m"),
    ("velocity_world_m_s", POSITION, "vxy_reset_counter", ("delta_vxy[0]", "delta_vxy[1]"), "m/s"),
    ("velocity_world_m_s", POSITION, "vz_reset_counter", ("delta_vz",), "m/s"),
    ("q_world_body", ATTITUDE, "quat_reset_counter", (), "deg"),
)
"""What the estimator resets, the topic that says so, its counter, by how much it moved, and the unit of that."""
_COUNTED = tuple(name for _, _, counter, deltas, _ in RESETS for name in (counter, *deltas))
PULSES_US = (800.0, 2200.0)
"""Outputs beyond are no pulses: of DShot or of a bus."""
FULL_PULSES_US = (1000.0, 2000.0)
"""From no to full throttle."""
MAV_TYPES = {2: 4, 13: 6, 14: 8}
"""MAVLink's type of a vehicle to its rotors: quadrotor, hexarotor, octorotor."""
_XYZ = ("xyz[0]", "xyz[1]", "xyz[2]")
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
        raise errors.missing(path)
    from pyulog import ULog

    try:
        with contextlib.redirect_stdout(io.StringIO()):  # pyulog prints what `_lost` says with the place
            ulog = ULog(str(path))
        topics = {d.name: d.data for d in ulog.data_list if d.multi_id == 0}
    except Exception as error:  # pyulog raises whatever its parser stumbles over
        way_out = "it may be another kind of log, or damaged at its start"
        raise FormatError(f"{path} is not a readable ULog file ({error}); {way_out}") from error
    for name in (POSITION, ATTITUDE):
        if name not in topics:
            raise InputError(f"{path} has no {name}; it has {', '.join(sorted(topics)) or 'no messages'}")
    try:
        streams, events = clock.examined(_streams(topics, ulog.initial_parameters), not_motion=_COUNTED)
    except FlightError as error:
        raise type(error)(f"{path}: {error}") from None
    except KeyError as error:
        raise FormatError(f"{path}: one of its topics lacks the field {error}; copy the file again") from None
    events += tuple(_resets(streams))
    columns = _pose(streams.pop(POSITION), streams.pop(ATTITUDE))
    speeds = streams.pop("esc_status", {})
    for stream in streams.values():
        columns |= interpolated(columns["time_s"], stream)
    if not len(columns["time_s"]):
        raise InputError(f"{path}: no position falls within the time of the attitude; record both for 10 s or more")
    columns = joined(columns, speeds)
    begin_s = columns["time_s"][0]
    columns["time_s"] = columns["time_s"] - begin_s
    lost = _lost(path.read_bytes(), 1e-6 * ulog.last_timestamp - begin_s, damaged=ulog.file_corruption)
    found = noted(events, begin_s=begin_s)
    return FlightLog(columns, {"name": path.stem, "source": path.name, **found} | ({LOST: lost} if lost else {}))


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
    return columns_of(quantity, values)


def _streams(topics: dict[str, Any], parameters: Mapping[str, float]) -> dict[str, Stream]:
    """Each topic's columns with its own times, in the order of the file."""
    count = _rotor_count(parameters)
    found = {POSITION: _position(topics[POSITION]), ATTITUDE: _attitude(topics[ATTITUDE])}
    parts = [part(topics) for part in (_rates, _accelerations, _battery, _rotor_speeds)]
    for name, stream in (*parts, _motors(topics, count)):
        if stream:
            found[name] = found.get(name, {}) | stream
    return found


def _position(local: dict[str, Any]) -> Stream:
    stream = {
        "time_s": _time(local),
        **_columns("position_world_m", _three(local, ("x", "y", "z"))),
        **_columns("velocity_world_m_s", _three(local, ("vx", "vy", "vz"))),
    }
    return stream | {name: np.asarray(local[name], dtype=np.float64) for name in _COUNTED if name in local}


def _attitude(attitude: dict[str, Any]) -> Stream:
    q = np.stack([np.asarray(attitude[f"q[{i}]"], dtype=np.float64) for i in range(4)], axis=1)
    stream = {"time_s": _time(attitude), **_columns("q_world_body", frames.flip_attitude(q))}
    return stream | {name: np.asarray(attitude[name], dtype=np.float64) for name in _COUNTED if name in attitude}


def _resets(streams: dict[str, Stream]) -> list[Event]:
    """What the estimator says of itself."""
    events: list[Event] = []
    for quantity, topic, name, deltas, unit in RESETS:
        stream = streams[topic]
        if name not in stream:
            continue
        moved = np.full(len(stream["time_s"]), np.nan)
        if topic == ATTITUDE:
            q = rotations.normalise(np.stack([stream[column] for column in COLUMNS["q_world_body"]], axis=1))
            moved[1:] = np.rad2deg(rotations.angle_between(q[:-1], q[1:]))
        elif all(delta in stream for delta in deltas):
            moved = np.linalg.norm([stream[delta] for delta in deltas], axis=0)
        events += resets.of_counter(quantity, stream["time_s"], stream[name], moved, name=name, unit=unit)
    return events


def _pose(position: Stream, attitude: Stream) -> Stream:
    """The rows of the position within the time of the attitude, less its pauses, and the attitude there."""
    time_s, attitude_s = position["time_s"], attitude["time_s"]
    after = np.clip(np.searchsorted(attitude_s, time_s), 1, len(attitude_s) - 1)
    span_s = attitude_s[after] - attitude_s[after - 1]
    rows = (time_s >= attitude_s[0]) & (time_s <= attitude_s[-1]) & (span_s <= longest_pause_s(np.diff(attitude_s)))
    time_s, after, span_s = time_s[rows], after[rows], span_s[rows]
    q = rotations.normalise(np.stack([attitude[name] for name in COLUMNS["q_world_body"]], axis=1))
    at = rotations.slerp(q[after - 1], q[after], (time_s - attitude_s[after - 1]) / span_s)
    kept = ("time_s", *COLUMNS["position_world_m"], *COLUMNS["velocity_world_m_s"])
    return {name: position[name][rows] for name in kept} | _columns("q_world_body", at)


Named = tuple[str, Stream]
"""A topic's name and its columns; none where the log has no such topic."""


def _first_of(topics: dict[str, Any], wanted: dict[str, tuple[str, ...]], quantity: str) -> Named:
    for topic, names in wanted.items():
        if topic in topics:
            data = topics[topic]
            return topic, {"time_s": _time(data), **_columns(quantity, _three(data, names))}
    return "", {}


def _rates(topics: dict[str, Any]) -> Named:
    wanted = {"vehicle_angular_velocity": _XYZ, "sensor_combined": tuple(f"gyro_rad[{i}]" for i in range(3))}
    return _first_of(topics, wanted, "rate_body_rad_s")


def _accelerations(topics: dict[str, Any]) -> Named:
    wanted = {"vehicle_acceleration": _XYZ, "sensor_combined": tuple(f"accelerometer_m_s2[{i}]" for i in range(3))}
    return _first_of(topics, wanted, "specific_force_body_m_s2")


def _rotor_count(parameters: Mapping[str, float]) -> int | None:
    """As many rotors as the file's parameters say, 4 to 8; None where they do not.

    CA_ROTOR_COUNT is the allocation's since PX4 1.13 (0: not set), MAV_TYPE the MAVLink type that was set before.
    """
    count = int(parameters.get("CA_ROTOR_COUNT", 0)) or MAV_TYPES.get(int(parameters.get("MAV_TYPE", 0)), 0)
    return count if 4 <= count <= MOST_ROTORS else None


def _motors(topics: dict[str, Any], count: int | None) -> Named:
    """Of `actuator_motors`; where it was not logged, as before PX4 1.13, of outputs that are pulses in us.

    Args:
        count: of rotors; None where parameters do not say: then the first four outputs count, as further ones may be
            pulses of servos, a gimbal or a camera.
    """
    if "actuator_motors" in topics:
        data = topics["actuator_motors"]
        return "actuator_motors", {"time_s": _time(data), **_ratios(_motor_values(data, "control"))}
    if "actuator_outputs" not in topics:
        return "", {}
    data = topics["actuator_outputs"]
    pulse_us = _motor_values(data, "output", count or 4)
    on = pulse_us[pulse_us > 0.0]
    if not len(on) or on.min() < PULSES_US[0] or on.max() > PULSES_US[1]:
        return "", {}
    low_us, high_us = FULL_PULSES_US
    ratio = np.clip((pulse_us - low_us) / (high_us - low_us), 0.0, 1.0)
    return "actuator_outputs", {"time_s": _time(data), **_ratios(ratio)}


def _motor_values(data: dict[str, Any], name: str, count: int | None = None) -> FloatArray:
    """(n, r) of so many motors; without `count` of 1 to 4 and as many more as ever have a value, neither NaN nor 0."""
    every = (np.asarray(data.get(f"{name}[{i}]", np.nan), dtype=np.float64) for i in range(MOST_ROTORS))
    return _used([np.broadcast_to(values, len(data["timestamp"])) for values in every], count)


def _used(each: list[FloatArray], count: int | None = None) -> FloatArray:
    more = next((i for i in range(4, len(each)) if not np.nan_to_num(each[i]).any()), len(each))
    return np.stack(each[: more if count is None else count], axis=1)


def _ratios(values: FloatArray) -> Stream:
    return {f"motor_command_{i}_ratio": column for i, column in enumerate(values.T)}


def _battery(topics: dict[str, Any]) -> Named:
    if "battery_status" not in topics:
        return "", {}
    data = topics["battery_status"]
    return "battery_status", {"time_s": _time(data), "battery_v": np.asarray(data["voltage_v"], dtype=np.float64)}


def _rotor_speeds(topics: dict[str, Any]) -> Named:
    """Speeds in the order of PX4's motors, sizes only."""
    if "esc_status" not in topics:
        return "", {}
    data = topics["esc_status"]
    names = [name for i in range(MOST_ROTORS) if (name := f"esc[{i}].esc_rpm") in data]
    speeds = _used([np.asarray(data[name], dtype=np.float64) for name in names])
    return "esc_status", {"time_s": _time(data), **_columns("rotor_speed_rad_s", np.abs(speeds) * RAD_S_PER_RPM)}
