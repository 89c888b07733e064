"""ArduPilot logs (DataFlash `.BIN`, or its text form `.log`): position, attitude, IMU, motor outputs and rotor speed.

World north-east-down, body forward-right-down, angles in degrees: https://ardupilot.org/copter/docs/logmessages.html
"""

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from flight import FlightLog, InputError, frames
from flight.rotations import FloatArray
from flight.units import RAD_S_PER_RPM
from sysid.logs.motors import rotor_places
from sysid.logs.readers import dataflash
from sysid.logs.readers.assemble import assembled, columns, in_order
from sysid.logs.readers.dataflash import Table
from sysid.logs.readers.read_csv import from_roll_pitch_yaw
from sysid.logs.readers.streams import Stream, interpolated

ESTIMATES = (("XKF1", "XKQ"), ("NKF1", "NKQ"), ("EKF1", "EKQ"))
"""Position and attitude of the estimators, the newest first; older ones number the cores NKF6, NKQ1."""
_NAMES = ("ATT", "RATE", "IMU", "RCOU", "ESC", "BAT", "CURR", "POS", "PARM", "XKF4", "NKQ1")
WANTED = {*_NAMES, *(name for pair in ESTIMATES for name in pair), *(f"ESC{i}" for i in range(1, 9))}
"""Messages that are read."""
MOTOR_FUNCTIONS = (33, 34, 35, 36, 37, 38, 39, 40)
"""`SERVOn_FUNCTION` of Motor1 to Motor4."""
EARTH_RADIUS_M = 6_378_137.0


def read(path: Path) -> FlightLog:
    """Read an ArduPilot log; rotors are in the order of ArduPilot's motors 1 to 4.

    A log that was cut or damaged is read as far as it goes; the metadata say what is missing.

    Raises:
        InputError: it holds no motion.
        FormatError: it is no ArduPilot log.
    """
    logged = dataflash.read(path, WANTED)
    tables, notes = logged.tables, []
    streams: dict[str, Stream] = {}
    try:
        for name, stream, note in _streams(tables):
            streams[name] = stream
            notes.append(note)
    except KeyError as error:
        raise InputError(f"{path}: a message lacks its field {error.args[0]}; ArduPilot 3.5 or newer is read") from None
    if not streams:
        raise InputError(
            f"{path} has none of XKF1, ATT, IMU; it has {', '.join(logged.names) or 'no messages'}: set LOG_BITMASK to "
            "log attitude, IMU and ESC"
        )
    log = assembled(path, streams, notes, logged.lost)
    frame = _parameters(logged.tables)
    is_x = frame.get("FRAME_CLASS") == frame.get("FRAME_TYPE") == 1.0
    return rotor_places.with_places(log, rotor_places.ARDUPILOT) if is_x else log


def _streams(tables: dict[str, Table]) -> Iterator[tuple[str, Stream, str]]:
    """Quantity, stream and where it came from."""
    core = _core(tables)
    yield from _position(tables, core)
    yield from _attitude(tables, core)
    yield from _inertial(tables)
    motors = _motor_channels(tables)
    yield from _outputs(tables, motors)
    yield from _rotor_speeds(tables, motors)
    for name in ("BAT", "CURR"):
        if name in tables:
            first = _only(tables[name], _instance(tables[name]), 0.0)
            yield "battery_v", {"time_s": _time_s(first), "battery_v": first["Volt"]}, f"battery: {name}"
            return


def _time_s(table: Table) -> FloatArray:
    return table["TimeUS"] * 1e-6 if "TimeUS" in table else table["TimeMS"] * 1e-3


def _three(table: Table, names: tuple[str, str, str], scale: float = 1.0) -> FloatArray:
    """(n, 3) of a vector whose z points down, in our frame."""
    return frames.flip_vector(scale * np.stack([table[name] for name in names], axis=1))


def _instance(table: Table) -> str:
    """The field that numbers sensors or cores alike in one message; empty: none."""
    return next((name for name in ("C", "I", "Inst", "Instance") if name in table), "")


def _only(table: Table, name: str, value: float) -> Table:
    """Rows of one sensor or core; of the first if it has no rows."""
    if not name:
        return table
    rows = table[name] == value
    rows = rows if rows.any() else table[name] == table[name].min()
    return {column: values[rows] for column, values in table.items()}


def _core(tables: dict[str, Table]) -> float:
    """The estimator's core that flew the vehicle most of the time."""
    if "XKF4" in tables and "PI" in tables["XKF4"]:
        values, counts = np.unique(tables["XKF4"]["PI"], return_counts=True)
        return float(values[np.argmax(counts)])
    return 0.0


def _position(tables: dict[str, Table], core: float) -> Iterator[tuple[str, Stream, str]]:
    for name, _ in ESTIMATES:
        if name in tables:
            table = _only(tables[name], _instance(tables[name]), core)
            position = columns("position_world_m", _three(table, ("PN", "PE", "PD")))
            velocity = columns("velocity_world_m_s", _three(table, ("VN", "VE", "VD")))
            note = f"position and velocity: {name}, core {core:.0f}"
            yield "position_world_m", {"time_s": _time_s(table), **position, **velocity}, note
            return
    if "POS" in tables:
        table = tables["POS"]
        north, east = table["Lat"] - table["Lat"][0], table["Lng"] - table["Lng"][0]
        lateral = np.cos(np.deg2rad(table["Lat"]))
        up = table["Alt"] - table["Alt"][0]
        metres = np.stack([np.deg2rad(north), -np.deg2rad(east) * lateral], axis=1) * EARTH_RADIUS_M
        position = columns("position_world_m", np.column_stack([metres, up]))
        yield "position_world_m", {"time_s": _time_s(table), **position}, "position: POS, from its first row"


def _attitude(tables: dict[str, Table], core: float) -> Iterator[tuple[str, Stream, str]]:
    for name in ("XKQ", "NKQ", "NKQ1", "EKQ"):
        if name in tables:
            table = _only(tables[name], _instance(tables[name]), core)
            q = np.stack([table[f"Q{i}"] for i in range(1, 5)], axis=1)
            stream = {"time_s": _time_s(table), **columns("q_world_body", frames.flip_attitude(q))}
            yield "q_world_body", stream, f"attitude: {name}, core {core:.0f}"
            return
    if "ATT" in tables:
        table = tables["ATT"]
        angles = np.deg2rad(np.stack([table[name] for name in ("Roll", "Pitch", "Yaw")], axis=1))
        q = frames.flip_attitude(from_roll_pitch_yaw(angles))
        yield "q_world_body", {"time_s": _time_s(table), **columns("q_world_body", q)}, "attitude: ATT"


def _inertial(tables: dict[str, Table]) -> Iterator[tuple[str, Stream, str]]:
    if "IMU" in tables:
        table = _only(tables["IMU"], _instance(tables["IMU"]), 0.0)
        rate = columns("rate_body_rad_s", _three(table, ("GyrX", "GyrY", "GyrZ")))
        force = columns("specific_force_body_m_s2", _three(table, ("AccX", "AccY", "AccZ")))
        yield "rate_body_rad_s", {"time_s": _time_s(table), **rate, **force}, "gyro and accelerometer: IMU, the first"
    elif "RATE" in tables:
        table = tables["RATE"]
        rate = columns("rate_body_rad_s", _three(table, ("R", "P", "Y"), np.pi / 180.0))
        yield "rate_body_rad_s", {"time_s": _time_s(table), **rate}, "body rates: RATE"


def _sorted(stream: Stream) -> Stream:
    rows = in_order(stream["time_s"])
    return {name: values[rows] for name, values in stream.items()}


def _parameters(tables: dict[str, Table]) -> dict[str, float]:
    """The last value of each parameter."""
    if "PARM" not in tables:
        return {}
    names = [bytes(name).split(b"\0")[0].decode("ascii", "replace") for name in tables["PARM"]["Name"]]
    values = zip(names, tables["PARM"]["Value"].tolist(), strict=True)
    return {name: value for name, value in values if math.isfinite(value)}


def _motor_channels(tables: dict[str, Table]) -> tuple[int, ...]:
    """Output channels (from 1) of the motors, by the parameters; the first four where they do not say."""
    values = _parameters(tables)
    channel = {int(values[f"SERVO{i}_FUNCTION"]): i for i in range(1, 17) if f"SERVO{i}_FUNCTION" in values}
    if 33 not in channel:
        return (1, 2, 3, 4)
    more = next((i for i in range(4, len(MOTOR_FUNCTIONS)) if MOTOR_FUNCTIONS[i] not in channel), len(MOTOR_FUNCTIONS))
    return tuple(channel.get(function, 0) for function in MOTOR_FUNCTIONS[:more])


def _outputs(tables: dict[str, Table], motors: tuple[int, ...]) -> Iterator[tuple[str, Stream, str]]:
    """Motor outputs as shares of full throttle."""
    if "RCOU" not in tables or not all(f"C{i}" in tables["RCOU"] for i in motors):
        return
    table, values = tables["RCOU"], _parameters(tables)
    low, high = values.get("MOT_PWM_MIN", 1000.0), values.get("MOT_PWM_MAX", 2000.0)
    low, high = (low, high) if high > low > 0.0 else (1000.0, 2000.0)
    ratio = np.clip((np.stack([table[f"C{i}"] for i in motors], axis=1) - low) / (high - low), 0.0, 1.0)
    stream = {f"motor_command_{i}_ratio": column for i, column in enumerate(ratio.T)}
    note = f"motor commands: RCOU {', '.join(f'C{i}' for i in motors)}, 0 to 1 from {low:g} to {high:g} us"
    yield "motor_command", {"time_s": _time_s(table), **stream}, note


def _rotor_speeds(tables: dict[str, Table], motors: tuple[int, ...]) -> Iterator[tuple[str, Stream, str]]:
    """Rotor speeds of the motors' ESCs, at the instants of the first; an ESC's number is that of its output channel."""
    own = {i - 1: tables[f"ESC{i}"] for i in range(1, 9) if f"ESC{i}" in tables}
    if "ESC" in tables and (name := _instance(tables["ESC"])):
        numbers = np.unique(tables["ESC"][name])
        own |= {int(n): _only(tables["ESC"], name, float(n)) for n in numbers}
    chosen = [channel - 1 for channel in motors]
    if not set(chosen) <= set(own):
        chosen = sorted(own)[: len(motors)]
    if len(chosen) < len(motors):
        return
    each = [_sorted({"time_s": _time_s(own[n]), "rpm": np.abs(own[n]["RPM"])}) for n in chosen]
    time_s = each[0]["time_s"]
    speeds = [interpolated(time_s, one)["rpm"] for one in each]
    speed_rad_s = np.stack(speeds, axis=1) * RAD_S_PER_RPM
    known = np.isfinite(speed_rad_s).all(axis=1)
    stream = {"time_s": time_s[known], **columns("rotor_speed_rad_s", speed_rad_s[known])}
    yield "rotor_speed_rad_s", stream, f"rotor speed: ESC {', '.join(map(str, chosen))}, as motors 1 to {len(chosen)}"
