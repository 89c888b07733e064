"""Blackbox logs of Betaflight and INAV: gyro, accelerometer, attitude, set-points, motors and rotor speed.

Betaflight's body axes are ours (x forward, y left, z up); its attitude is that of the body in north-west-up. It records
no position; INAV's `navPos` is north-east-up.
"""

import math
import re
import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flight import FlightLog, FormatError, frames, rotations
from flight.flight_log import MOST_ROTORS
from flight.rotations import FloatArray
from flight.units import RAD_S_PER_RPM
from sysid.logs.motors import full_throttle, rotor_places
from sysid.logs.readers import blackbox
from sysid.logs.readers.assemble import assembled, columns
from sysid.logs.readers.blackbox import Recorded
from sysid.logs.readers.streams import Stream
from sysid.logs.sensors.low_pass import LowPass

LARGEST_NUMBER = 32767.0
"""One, in the log's quaternions."""
TWO_LAGS_SINCE = (4, 3)
"""Betaflight's version from which on its accelerometer has them."""
DIGITAL_FROM, ANALOGUE_FROM = 48.0, 1000.0
"""Outputs at which a rotor stands."""
NO_POSITION = "no position in it: body rates and torques can be identified, drag and the thrust's size in flight cannot"


def read(path: Path) -> FlightLog:
    """Read a blackbox log; of several flights in one file, the longest. Rotors are the firmware's motors 1 to 4.

    Raises:
        InputError: it holds no motion.
        FormatError: it is no blackbox log, or its header is damaged.
    """
    content = path.read_bytes()
    places = blackbox.flights(content)
    if not places:
        raise FormatError(f"{path} is no blackbox log: no line of it is {blackbox.START.decode()!r}")
    begin, end = max(places, key=lambda place: place[1] - place[0])
    recorded = blackbox.read(path, content, begin, end)
    if not len(recorded.fields["time"]):
        raise FormatError(f"{path}: no frame of the flight at byte {begin} is whole; copy it from the vehicle again")
    notes = [f"{recorded.header.get('Firmware revision', 'unknown firmware')}, motors 1 to 4 of it"]
    if len(places) > 1:
        notes.append(f"the longest of {len(places)} flights, bytes {begin} to {end}; cut the file there for the others")
    streams: dict[str, Stream] = {}
    time_s = _unwrapped(recorded.fields["time"]) * 1e-6
    for name, stream, note in _streams(recorded):
        streams[name] = {"time_s": time_s, **stream}
        notes.append(note)
    if "position_world_m" not in streams:
        notes.append(NO_POSITION)
    through = _accelerometer_low_pass(recorded)
    if through is not None:
        cutoff_hz = 0.01 * _setting(recorded, "acc_lpf_hz", 0.0)
        notes.append(f"accelerometer: behind a low-pass of {cutoff_hz:g} Hz, which a fit allows for")
    log = assembled(path, streams, notes, recorded.lost)
    if "motor[4]" not in recorded.fields:  # else it is of another mixer
        log = rotor_places.with_places(log, rotor_places.BETAFLIGHT)
    told = {full_throttle.IDLE: _idle(*_range(recorded))} | (through.metadata() if through is not None else {})
    return FlightLog(log.columns, {**log.metadata, **told})


def _unwrapped(stamp_us: NDArray[np.int64]) -> FloatArray:
    """Microseconds of 32 bits, counted on where they begin again."""
    steps = np.diff(stamp_us)
    return (stamp_us + np.concatenate([[0], np.cumsum((steps < -(2**31)) * 2**32)])).astype(np.float64)


def _group(recorded: Recorded, name: str, count: int) -> FloatArray | None:
    """(n, count) of `name[0]`, `name[1]`, ...; None if one is missing."""
    names = [f"{name}[{i}]" for i in range(count)]
    if not set(names) <= set(recorded.fields):
        return None
    return np.stack([recorded.fields[n] for n in names], axis=1).astype(np.float64)


def _motor_group(recorded: Recorded, name: str) -> FloatArray | None:
    """(n, r) of as many motors as the firmware had, four or more; None if there are fewer."""
    count = next((i for i in range(MOST_ROTORS) if f"{name}[{i}]" not in recorded.fields), MOST_ROTORS)
    return _group(recorded, name, max(count, 4))


def _setting(recorded: Recorded, name: str, otherwise: float) -> float:
    """The first number of a line of the header."""
    try:
        return float(recorded.header[name].split(",")[0])
    except (KeyError, ValueError):
        return otherwise


def _streams(recorded: Recorded) -> Iterator[tuple[str, Stream, str]]:
    """Quantity, its columns, and what it was read from."""
    fine = 10.0 if _setting(recorded, "blackbox_high_resolution", 0.0) > 0.0 else 1.0
    yield from _inertial(recorded, fine)
    yield from _attitude(recorded)
    yield from _position(recorded)
    if (asked := _group(recorded, "setpoint", 3)) is not None:
        rates = np.deg2rad(asked / fine)
        yield "setpoint", {f"setpoint_rate_body_{a}_rad_s": rates[:, i] for i, a in enumerate("xyz")}, "setpoint[0..2]"
    yield from _motors(recorded)
    yield from _battery(recorded)


def _inertial(recorded: Recorded, fine: float) -> Iterator[tuple[str, Stream, str]]:
    gyro = _group(recorded, "gyroUnfilt", 3)
    name = "gyroADC" if gyro is None else "gyroUnfilt"
    gyro = _group(recorded, "gyroADC", 3) if gyro is None else gyro
    if gyro is not None:
        rate = np.deg2rad(gyro * _gyro_scale(recorded) / fine)
        yield "rate_body_rad_s", columns("rate_body_rad_s", rate), f"gyro: {name}"
    force = _group(recorded, "accSmooth", 3)
    one_g = _setting(recorded, "acc_1G", 0.0)
    if force is not None and one_g > 0.0:
        values = force * frames.GRAVITY_M_S2 / one_g
        yield "specific_force_body_m_s2", columns("specific_force_body_m_s2", values), "accelerometer: accSmooth"


def _accelerometer_low_pass(recorded: Recorded) -> LowPass | None:
    """Of Betaflight: two first-order lags whose cut-off together is the one set; before 4.3 Butterworth."""
    cutoff_hz = 0.01 * _setting(recorded, "acc_lpf_hz", 0.0)
    found = re.match(r"Betaflight (\d+)\.(\d+)", recorded.header.get("Firmware revision", ""))
    if found is None or not cutoff_hz > 0.0:
        return None
    cutoff_rad_s = 2.0 * math.pi * cutoff_hz
    if (int(found[1]), int(found[2])) < TWO_LAGS_SINCE:
        return LowPass(cutoff_rad_s, math.sqrt(0.5))
    return LowPass(cutoff_rad_s / math.sqrt(math.sqrt(2.0) - 1.0), 1.0)


def _gyro_scale(recorded: Recorded) -> float:
    """deg/s of one unit, which the header holds as the bits of a float."""
    try:
        (scale,) = struct.unpack("<f", int(recorded.header["gyro_scale"], 16).to_bytes(4, "little"))
    except (KeyError, ValueError, OverflowError):
        return 1.0
    return float(scale) if 1e-4 < scale < 1e3 else 1.0


def _attitude(recorded: Recorded) -> Iterator[tuple[str, Stream, str]]:
    xyz = _group(recorded, "imuQuaternion", 3)
    if xyz is not None:
        xyz = xyz / LARGEST_NUMBER
        w = np.sqrt(np.maximum(0.0, 1.0 - (xyz**2).sum(axis=1)))  # the firmware keeps w positive
        q = rotations.normalise(np.column_stack([w, xyz]))
        yield "q_world_body", columns("q_world_body", rotations.continuous(q)), "attitude: imuQuaternion"
        return
    quaternion = _group(recorded, "quaternion", 4)
    if quaternion is not None:
        q = rotations.normalise(np.where(np.any(quaternion, axis=1, keepdims=True), quaternion, [1.0, 0.0, 0.0, 0.0]))
        yield "q_world_body", columns("q_world_body", rotations.continuous(q)), "attitude: quaternion"


def _position(recorded: Recorded) -> Iterator[tuple[str, Stream, str]]:
    """INAV's estimate, in centimetres north-east-up."""
    position, velocity = _group(recorded, "navPos", 3), _group(recorded, "navVel", 3)
    if position is None:
        return
    turned = np.array([0.01, -0.01, 0.01])
    stream = columns("position_world_m", position * turned)
    if velocity is not None:
        stream |= columns("velocity_world_m_s", velocity * turned)
    yield "position_world_m", stream, "position: navPos"


def _motors(recorded: Recorded) -> Iterator[tuple[str, Stream, str]]:
    """Commands as shares of full throttle, and speeds by the ESCs' electrical revolutions."""
    output = _motor_group(recorded, "motor")
    low, high = _range(recorded)
    if output is not None and high > low:
        ratio = np.clip((output - low) / (high - low), 0.0, 1.0)
        stream = {f"motor_command_{i}_ratio": column for i, column in enumerate(ratio.T)}
        yield (
            "motor_command",
            stream,
            f"motor commands: motor[0..{output.shape[1] - 1}], 0 to 1 from {low:g} to {high:g}",
        )
    turns = _motor_group(recorded, "eRPM")
    poles = _setting(recorded, "motor_poles", 14.0)
    if turns is not None and turns.any() and poles >= 2.0:
        speed = turns * 100.0 / (0.5 * poles) * RAD_S_PER_RPM
        yield (
            "rotor_speed_rad_s",
            columns("rotor_speed_rad_s", speed),
            f"rotor speed: eRPM[0..{turns.shape[1] - 1}], {poles:g} poles",
        )


def _range(recorded: Recorded) -> tuple[float, float]:
    """Outputs of idle and of full throttle."""
    words = recorded.header.get("motorOutput", "").split(",")
    try:
        return float(words[0]), float(words[1])
    except (ValueError, IndexError):
        return _setting(recorded, "minthrottle", 1000.0), _setting(recorded, "maxthrottle", 2000.0)


def _idle(low: float, high: float) -> float:
    """Share of full output at idle; DShot counts from 48, pulses from 1000 us."""
    least = ANALOGUE_FROM if low >= ANALOGUE_FROM else DIGITAL_FROM
    return max(low - least, 0.0) / (high - least) if high > max(low, least) else 0.0


def _battery(recorded: Recorded) -> Iterator[tuple[str, Stream, str]]:
    """Hundredths of a volt; older firmware writes a reading that cannot be converted, which is left out."""
    name = next((n for n in ("vbatLatest", "vbat") if n in recorded.fields), "")
    volt = 0.01 * recorded.fields[name].astype(np.float64) if name else np.empty(0)
    if len(volt) and 2.5 < float(np.median(volt)) < 70.0:
        yield "battery_v", {"battery_v": volt}, f"battery: {name}"
