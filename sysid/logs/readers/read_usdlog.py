"""Logs of the Crazyflie's SD card (`usdlog`): a list of events with named variables, then records of them.

`0xBC`, version, count of events; an event is its number, its name, and its variables as `name(type)`; a record is the
number, a stamp (version 1: milliseconds, 2: microseconds), and the values; a CRC-32 ends the file.
https://www.bitcraze.io/documentation/repository/crazyflie-firmware/master/functional-areas/
"""

import math
import struct
import zlib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from flight import FlightLog, FormatError, frames
from flight.flight_log import COLUMNS
from flight.rotations import FloatArray
from sysid.logs.motors import rotor_places
from sysid.logs.readers import known_names
from sysid.logs.readers.assemble import assembled
from sysid.logs.readers.read_csv import UNITS, from_roll_pitch_yaw
from sysid.logs.readers.streams import Stream
from sysid.logs.sensors.low_pass import LowPass

MAGIC = 0xBC
VERSIONS = {1: ("<HI", 1e-3), 2: ("<HQ", 1e-6)}
TYPES = frozenset("bBhHiIqQfd")
MOST_EVENTS = 1000
LONGEST_PAUSE_S = 60.0
"""A stamp that is further from the one before is damage."""
CRC_BYTES = 4
FORCE = "specific_force_body_m_s2"
ACCELEROMETER_LOW_PASS = LowPass(2.0 * math.pi * 30.0, math.sqrt(0.5))
"""Of the firmware (ACCEL_LPF_CUTOFF_FREQ), before it is logged."""


@dataclass(slots=True)
class _Event:
    name: str
    variables: list[str]
    packed: struct.Struct
    rows: list[tuple[float, ...]] = field(default_factory=list)
    """Stamp in seconds, and the values."""


def is_usdlog(head: bytes) -> bool:
    if len(head) < 8 or head[0] != MAGIC:
        return False
    version, count = struct.unpack_from("<HH", head, 1)
    return version in VERSIONS and 0 < count <= MOST_EVENTS


def read(path: Path) -> FlightLog:
    """Read an SD card log; rotors are the Crazyflie's motors 1 to 4.

    Raises:
        InputError: none of its variables shows motion.
        FormatError: it is no such log, or its list of variables is damaged.
    """
    content = path.read_bytes()
    if not is_usdlog(content[:16]):
        raise FormatError(f"{path} is no log of a Crazyflie's SD card of version 1 or 2")
    version, count = struct.unpack_from("<HH", content, 1)
    try:
        events, at = _events(content, count)
    except (IndexError, struct.error, ValueError):
        raise FormatError(f"{path}: its list of variables is cut or damaged; copy it from the card again") from None
    end, lost = _records(content, events, at, *VERSIONS[version])
    whole = end == len(content) - CRC_BYTES and _crc(content) == zlib.crc32(content[:-CRC_BYTES])
    if not whole and not lost:
        lost = f"the checksum at the end of {len(content)} bytes is missing or another: the file was cut or damaged"
    streams: dict[str, Stream] = {}
    notes = [f"motors 1 to 4 of the Crazyflie: {', '.join(rotor_places.CRAZYFLIE)}"]
    for event in events.values():
        for quantity, stream, note in _streams(event):
            if quantity not in streams:
                streams[quantity] = stream
                notes.append(note)
    if FORCE in streams:
        notes.append("accelerometer: behind the Crazyflie's low-pass of 30 Hz, which a fit allows for")
    log = rotor_places.with_places(assembled(path, streams, notes, lost), rotor_places.CRAZYFLIE)
    told = ACCELEROMETER_LOW_PASS.metadata() if FORCE in streams else {}
    return FlightLog(log.columns, {**log.metadata, **told})


def _crc(content: bytes) -> int:
    return int.from_bytes(content[-CRC_BYTES:], "little")


def _word(content: bytes, at: int) -> tuple[str, int]:
    """Text up to a zero, and what follows it."""
    stop = content.index(b"\0", at, at + 200)
    return content[at:stop].decode("ascii"), stop + 1


def _events(content: bytes, count: int) -> tuple[dict[int, _Event], int]:
    found: dict[int, _Event] = {}
    at = 5
    for _ in range(count):
        (number,) = struct.unpack_from("<H", content, at)
        name, at = _word(content, at + 2)
        (variables,) = struct.unpack_from("<H", content, at)
        at += 2
        names, letters = [], "<"
        for _ in range(variables):
            word, at = _word(content, at)
            if word[-1:] != ")" or word[-2:-1] not in TYPES:
                raise ValueError(word)
            names.append(word[:-3])
            letters += word[-2]
        found[number] = _Event(name, names, struct.Struct(letters))
    return found, at


def _records(content: bytes, events: dict[int, _Event], at: int, head: str, unit_s: float) -> tuple[int, str]:
    """Where the records end, and what could not be read."""
    stamped = struct.Struct(head)
    end = len(content)
    last = int.from_bytes(content[at + 2 : at + stamped.size], "little")
    skipped, first = 0, -1
    while at + stamped.size <= end - CRC_BYTES:
        number, stamp = stamped.unpack_from(content, at)
        event = events.get(number)
        after = at + stamped.size + event.packed.size if event is not None else end + 1
        if event is None or after > end or not 0 <= stamp - last < LONGEST_PAUSE_S / unit_s:
            first = at if first < 0 else first
            at, skipped = at + 1, skipped + 1  # until a known number is followed by a stamp that goes on
            continue
        last = stamp
        event.rows.append((stamp * unit_s, *event.packed.unpack_from(content, at + stamped.size)))
        at = after
    if not skipped:
        return at, ""
    where = f"of {end}, at {last * unit_s:.3f} s" if at >= end - stamped.size - CRC_BYTES else f"of {end}"
    return at, f"the file is cut or damaged at byte {first} {where}: {skipped} bytes are no records"


def _streams(event: _Event) -> list[tuple[str, Stream, str]]:
    if not event.rows:
        return []
    table = np.array(event.rows, dtype=np.float64)
    by_name = dict(zip(event.variables, table[:, 1:].T, strict=True))
    found = []
    for quantity, (columns, keys) in known_names.found(by_name).items():
        values = _in_ours(np.stack([by_name[name] for name in columns], axis=1), keys)
        stream: Stream = {"time_s": table[:, 0]}
        stream |= dict(zip(COLUMNS.get(quantity, (quantity,)), values.T, strict=True))
        found.append((quantity, stream, f"{quantity}: {', '.join(columns)} of {event.name}"))
    return found


def _in_ours(values: FloatArray, keys: dict[str, Any]) -> FloatArray:
    """As the column map's keys say."""
    scale = UNITS[str(keys.get("unit", "1"))] * np.float64(keys.get("scale", 1.0))
    values = values * scale * np.asarray(keys.get("sign", 1.0), dtype=np.float64)
    if keys.get("order") == "roll pitch yaw":
        return from_roll_pitch_yaw(values)
    return frames.flip_vector(values) if keys.get("frame") == "z down" else values
