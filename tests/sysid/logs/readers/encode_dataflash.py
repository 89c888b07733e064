"""Flights as ArduPilot logs, packed by pymavlink's own message classes; shares no code with the reader."""

import struct
from typing import Any

import numpy as np
from pymavlink.DFReader import DFFormat, DFMessage

from flight import FlightLog, rotations

FORMATS = {
    # name: type, letters, fields
    "FMT": (128, "BBnNZ", "Type,Length,Name,Format,Columns"),
    "PARM": (64, "QNf", "TimeUS,Name,Value"),
    "ATT": (65, "QccccCCCCB", "TimeUS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw,ErrRP,ErrYaw,AEKF"),
    "XKF1": (66, "QBccCfffffffccce", "TimeUS,C,Roll,Pitch,Yaw,VN,VE,VD,dPD,PN,PE,PD,GX,GY,GZ,OH"),
    "XKQ": (67, "QBffff", "TimeUS,C,Q1,Q2,Q3,Q4"),
    "IMU": (68, "QBffffffIIfBBHH", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,EG,EA,T,GH,AH,GHz,AHz"),
    "RCOU": (69, "QHHHH", "TimeUS,C1,C2,C3,C4"),
    "ESC": (70, "QBffffcfcf", "TimeUS,Instance,RPM,RawRPM,Volt,Curr,Temp,CTot,MotTemp,Err"),
    "BAT": (71, "QBff", "TimeUS,Inst,Volt,VoltR"),
}
FROM_OURS = np.array([1.0, -1.0, -1.0])
OURS_OF_MOTOR = (3, 1, 0, 2)
"""Our rotor (front left, rear left, rear right, front right) of ArduPilot's motors 1 to 4: FR, RL, FL, RR."""


class Writer:
    """One log, message by message."""

    def __init__(self) -> None:
        self.content = b""
        self._formats = {
            name: DFFormat(kind, name, 3 + struct.calcsize("<" + _struct(letters)), letters, fields)
            for name, (kind, letters, fields) in FORMATS.items()
        }
        for name, (kind, letters, fields) in FORMATS.items():
            self.add("FMT", kind, self._formats[name].len, name.encode(), letters.encode(), fields.encode())

    def add(self, name: str, *values: Any) -> None:
        packed = DFMessage(self._formats[name], list(values), False, None).get_msgbuf()
        assert packed is not None, (name, values)
        self.content += packed


def _struct(letters: str) -> str:
    kinds = {"n": "4s", "N": "16s", "Z": "64s", "c": "h", "C": "H", "e": "i", "E": "I", "L": "i", "M": "B"}
    return "".join(kinds.get(letter, letter) for letter in letters)


def encode(log: FlightLog, *, start_us: int = 31_000_000, frame_type: int = 1) -> bytes:
    """The log as ArduPilot would have recorded it, rotors in ArduPilot's order."""
    writer = Writer()
    for name, value in (("FRAME_CLASS", 1), ("FRAME_TYPE", frame_type)):
        writer.add("PARM", start_us, name.encode(), float(value))
    for i, motor in enumerate((33, 34, 35, 36), 1):
        writer.add("PARM", start_us, f"SERVO{i}_FUNCTION".encode(), float(motor))
    q = log.vector("q_world_body") * [1.0, 1.0, -1.0, -1.0]
    position, velocity = (log.vector(f"{n}") * FROM_OURS for n in ("position_world_m", "velocity_world_m_s"))
    rate = log.vector("rate_body_rad_s") * FROM_OURS
    force = log.vector("specific_force_body_m_s2") * FROM_OURS if log.has("specific_force_body_m_s2") else 0.0 * rate
    rpm = log.vector("rotor_speed_rad_s") * 30.0 / np.pi
    angles = np.rad2deg(_angles(q))
    for k, time_s in enumerate(log.time_s):
        us = start_us + round(1e6 * time_s)
        roll, pitch, yaw = angles[k]
        heading = min(yaw % 360.0, 359.99)
        writer.add("ATT", us, 0, roll, 0, pitch, 0, heading, 0, 0, 3)
        for core, off in ((0, 0.0), (1, 5.0)):
            place = [float(v) for v in position[k] + off]
            speed = [float(v) for v in velocity[k]]
            writer.add("XKF1", us, core, roll, pitch, heading, *speed, 0.0, *place, 0, 0, 0, 0)
            writer.add("XKQ", us, core, *map(float, q[k]))
        writer.add("IMU", us, 0, *map(float, rate[k]), *map(float, force[k]), 0, 0, 40.0, 1, 1, 1000, 1000)
        writer.add("IMU", us, 1, *[9.0] * 6, 0, 0, 40.0, 1, 1, 1000, 1000)
        writer.add("RCOU", us, *(round(1000 + rpm[k, r] / 20.0) for r in OURS_OF_MOTOR))
        for i, r in enumerate(OURS_OF_MOTOR):
            writer.add("ESC", us, i, float(rpm[k, r]), 0.0, 16.0, 1.0, 40.0, 0.0, 0, 0.0)
        writer.add("BAT", us, 0, 16.0 - 0.01 * time_s, 16.0)
    return writer.content


def _angles(q: np.ndarray) -> np.ndarray:
    """(n, 3) roll, pitch, yaw, R = Rz Ry Rx."""
    R = rotations.matrix(q)
    return np.stack(
        [np.arctan2(R[:, 2, 1], R[:, 2, 2]), -np.arcsin(R[:, 2, 0]), np.arctan2(R[:, 1, 0], R[:, 0, 0])], axis=1
    )
