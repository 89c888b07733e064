"""Telemetry logs of ground stations (`.tlog`): MAVLink frames, each after the microsecond at which it came in.

Frames of both versions; only those whose checksum is right are read. https://mavlink.io/en/guide/serialization.html
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from flight import FlightLog, FormatError, frames
from flight.flight_log import columns_of
from flight.rotations import FloatArray
from flight.units import RAD_S_PER_RPM
from sysid.logs.readers.assemble import assembled, columns
from sysid.logs.readers.read_csv import from_roll_pitch_yaw
from sysid.logs.readers.read_ulog import MAV_TYPES
from sysid.logs.readers.streams import Stream

STAMP_BYTES = 8
LAYOUTS = {
    # message: format, and what its checksum adds (its CRC_EXTRA)
    30: ("<I6f", 39),  # ATTITUDE
    31: ("<I7f", 246),  # ATTITUDE_QUATERNION
    32: ("<I6f", 185),  # LOCAL_POSITION_NED
    105: ("<Q6f", 93),  # HIGHRES_IMU
    26: ("<I6h", 170),  # SCALED_IMU
    0: ("<4xB", 50),  # HEARTBEAT: the vehicle's type
    36: ("<I8H", 222),  # SERVO_OUTPUT_RAW
    11030: ("<24x4H", 144),  # ESC_TELEMETRY_1_TO_4: the speeds behind voltage, current and total current
    11031: ("<24x4H", 133),  # ESC_TELEMETRY_5_TO_8
    1: ("<14xH", 124),  # SYS_STATUS: voltage in mV
}


@dataclass(frozen=True, slots=True)
class _Frame:
    kind: int
    sender: int
    payload: bytes
    end: int


def is_tlog(head: bytes) -> bool:
    """Whether two frames follow each other, each after its stamp."""
    first = _frame(head, 0)
    if first is None:
        return False
    return len(head) - first.end < STAMP_BYTES + 12 or _frame(head, first.end) is not None


def read(path: Path) -> FlightLog:
    """Read a telemetry log; times are the vehicle's own where a message has them.

    Raises:
        InputError: it holds no motion.
        FormatError: it is no telemetry log.
    """
    content = path.read_bytes()
    rows, lost = _rows(content)
    if not rows:
        raise FormatError(f"{path} is no telemetry log: no MAVLink frame that is whole and known is in it")
    tables = {kind: np.array(values, dtype=np.float64) for kind, values in rows.items()}
    streams: dict[str, Stream] = {}
    notes = []
    for quantity, stream, note in _streams(tables):
        if quantity not in streams:
            streams[quantity] = stream
            notes.append(note)
    notes.append("telemetry is slow: a log of the vehicle itself (.BIN, .ulg) holds 10 to 100 times as many rows")
    return assembled(path, streams, notes, lost)


def _frame(content: bytes, at: int) -> _Frame | None:
    """The frame behind the stamp at this byte; None where there is none."""
    begin = at + STAMP_BYTES
    if begin + 12 > len(content):
        return None
    magic, size = content[begin], content[begin + 1]
    if magic == 0xFE:
        body, kind, sender, more = begin + 6, content[begin + 5], content[begin + 3], 0
    elif magic == 0xFD:
        body, kind = begin + 10, int.from_bytes(content[begin + 7 : begin + 10], "little")
        sender, more = content[begin + 5], 13 if content[begin + 2] & 1 else 0
    else:
        return None
    end = body + size + 2
    if end + more > len(content):
        return None
    if kind in LAYOUTS and _checksum(content[begin + 1 : body + size], LAYOUTS[kind][1]) != content[end - 2 : end]:
        return None
    return _Frame(kind, sender, content[body : body + size], end + more)


def _checksum(data: bytes, extra: int) -> bytes:
    """CRC-16/MCRF4XX of the frame without its first byte, and of the message's own byte."""
    crc = 0xFFFF
    for byte in (*data, extra):
        byte ^= crc & 0xFF
        byte = (byte ^ (byte << 4)) & 0xFF
        crc = (crc >> 8) ^ (byte << 8) ^ (byte << 3) ^ (byte >> 4)
    return crc.to_bytes(2, "little")


def _rows(content: bytes) -> tuple[dict[int, list[tuple[float, ...]]], str]:
    """By message its rows: stamp of reception in seconds, and the values; and what could not be read.

    Of several vehicles the one that sends the most attitudes is read.
    """
    found: dict[tuple[int, int], list[tuple[float, ...]]] = {}
    at, skipped, first = 0, 0, -1
    while at < len(content):
        frame = _frame(content, at)
        if frame is None:
            first = at if first < 0 else first
            at, skipped = at + 1, skipped + 1
            continue
        if frame.kind in LAYOUTS:
            layout = struct.Struct(LAYOUTS[frame.kind][0])
            values = layout.unpack(frame.payload.ljust(layout.size, b"\0")[: layout.size])
            stamp = int.from_bytes(content[at : at + STAMP_BYTES], "big")
            found.setdefault((frame.sender, frame.kind), []).append((1e-6 * stamp, *values))
        at = frame.end
    lost = (
        f"the file is cut or damaged at byte {first} of {len(content)}: {skipped} bytes are no frames"
        if skipped
        else ""
    )
    senders = {sender for sender, _ in found}
    best = max(senders, key=lambda s: sum(len(found.get((s, kind), ())) for kind in (30, 31, 32)), default=0)
    return {kind: rows for (sender, kind), rows in found.items() if sender == best}, lost


def _streams(tables: dict[int, FloatArray]) -> Iterator[tuple[str, Stream, str]]:
    """Quantity, stream and note, the better source first."""
    late_s = _lateness_s(tables)
    if 32 in tables:
        table = tables[32]
        position, velocity = frames.flip_vector(table[:, 2:5]), frames.flip_vector(table[:, 5:8])
        stream = columns("position_world_m", position) | columns("velocity_world_m_s", velocity)
        yield "position_world_m", {"time_s": 1e-3 * table[:, 1], **stream}, "position: LOCAL_POSITION_NED"
    if 31 in tables:
        q = frames.flip_attitude(tables[31][:, 2:6])
        stream = {"time_s": 1e-3 * tables[31][:, 1], **columns("q_world_body", q)}
        yield "q_world_body", stream, "attitude: ATTITUDE_QUATERNION"
    if 30 in tables:
        q = frames.flip_attitude(from_roll_pitch_yaw(tables[30][:, 2:5]))
        stream = {"time_s": 1e-3 * tables[30][:, 1], **columns("q_world_body", q)}
        yield "q_world_body", stream, "attitude: ATTITUDE"
    yield from _inertial(tables, late_s)
    yield from _rotors(tables, late_s)
    if 1 in tables:
        stream = {"time_s": tables[1][:, 0] - late_s, "battery_v": 1e-3 * tables[1][:, 1]}
        yield "battery_v", stream, "battery: SYS_STATUS"


def _rotors(tables: dict[int, FloatArray], late_s: float) -> Iterator[tuple[str, Stream, str]]:
    """Of as many rotors as the heartbeat's type has; four where it does not say, as further outputs may be servos'."""
    types = tables[0][:, 1].tolist() if 0 in tables else []  # of cameras and gimbals, too
    count = next((MAV_TYPES[kind] for kind in types if kind in MAV_TYPES), 4)
    if 11030 in tables and (count == 4 or 11031 in tables):
        stamp_s, speed = tables[11030][:, 0], tables[11030][:, 1:5]
        if count > 4:
            others = tables[11031]
            more = [np.interp(stamp_s, others[:, 0], column) for column in others[:, 1:5].T]
            speed = np.column_stack([speed, *more])[:, :count]
        stream = {"time_s": stamp_s - late_s, **columns_of("rotor_speed_rad_s", speed * RAD_S_PER_RPM)}
        note = f"rotor speed: ESC_TELEMETRY of {count} rotors, at the time of reception"
        yield "rotor_speed_rad_s", stream, note
    if 36 in tables:
        ratio = np.clip((tables[36][:, 2 : 2 + count] - 1000.0) / 1000.0, 0.0, 1.0)
        stream = {f"motor_command_{i}_ratio": ratio[:, i] for i in range(count)}
        note = f"motor commands: SERVO_OUTPUT_RAW 1 to {count}"
        yield "motor_command", {"time_s": tables[36][:, 0] - late_s, **stream}, note


def _inertial(tables: dict[int, FloatArray], late_s: float) -> Iterator[tuple[str, Stream, str]]:
    if 105 in tables:
        table = tables[105]
        time_s = 1e-6 * table[:, 1]
        if abs(float(np.median(table[:, 0] - late_s - time_s))) > 10.0:  # stamped in another time than the others
            time_s = table[:, 0] - late_s
        force, rate = frames.flip_vector(table[:, 2:5]), frames.flip_vector(table[:, 5:8])
        stream = columns("rate_body_rad_s", rate) | columns("specific_force_body_m_s2", force)
        yield "rate_body_rad_s", {"time_s": time_s, **stream}, "gyro and accelerometer: HIGHRES_IMU"
    if 26 in tables:
        table = tables[26]
        force = frames.flip_vector(1e-3 * frames.GRAVITY_M_S2 * table[:, 2:5])
        stream = columns("rate_body_rad_s", frames.flip_vector(1e-3 * table[:, 5:8]))
        stream |= columns("specific_force_body_m_s2", force)
        yield "rate_body_rad_s", {"time_s": 1e-3 * table[:, 1], **stream}, "gyro and accelerometer: SCALED_IMU"
    for kind, first in ((31, 6), (30, 5)):
        if kind in tables:
            rate = frames.flip_vector(tables[kind][:, first : first + 3])
            stream = {"time_s": 1e-3 * tables[kind][:, 1], **columns("rate_body_rad_s", rate)}
            yield "rate_body_rad_s", stream, "body rates: of the attitude message"


def _lateness_s(tables: dict[int, FloatArray]) -> float:
    """From the vehicle's clock to that of the receiver: the least delay of the messages that have both."""
    for kind in (31, 30, 32):
        if kind in tables:
            return float(np.min(tables[kind][:, 0] - 1e-3 * tables[kind][:, 1]))
    return 0.0
