"""A flight by stick, simulated by the benchmark without poses, as the blackbox of a Betaflight vehicle records it."""

import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from flight.flight_log import COLUMNS
from tests.sysid.logs.readers import encode_blackbox
from vehicle import Vehicle

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
DURATION_S, RATE_HZ = 40.0, 500.0
G_M_S2, PER_G = 9.80665, 2048
LOW, HIGH = (int(end) for end in encode_blackbox.HEADER["motorOutput"].split(","))


@dataclass(frozen=True, slots=True)
class StickFlight:
    """What a pilot has after it."""

    vehicle: Vehicle
    """As a data sheet describes it."""
    blackbox: bytes
    """Gyro, accelerometer and motor commands."""


@cache
def simulated_stick_flight() -> StickFlight:
    sys.path.insert(0, str(BENCHMARKS))
    import without_pose_flights as by_stick

    sys.path.remove(str(BENCHMARKS))
    rng = np.random.default_rng(4)
    recorder = by_stick.Recorder(rate_hz=RATE_HZ)
    (log,) = by_stick.flown(by_stick.body(), by_stick.drawn(1, rng), rng, duration_s=DURATION_S, recorder=recorder)
    columns = {"time": 1e6 * log.time_s + 5e6, "loopIteration": np.arange(len(log))}
    for i in range(3):
        columns[f"gyroADC[{i}]"] = np.rad2deg(log.columns[COLUMNS["rate_body_rad_s"][i]])
        columns[f"accSmooth[{i}]"] = log.columns[COLUMNS["specific_force_body_m_s2"][i]] * PER_G / G_M_S2
    for i in range(4):
        columns[f"motor[{i}]"] = LOW + (HIGH - LOW) * log.columns[f"motor_command_{i}_ratio"]
    fields = encode_blackbox.without("imuQuaternion", "eRPM", "axisI", "setpoint", "debug", "vbat", "amperage", "rssi")
    table = np.rint(np.stack([columns[field[0]] for field in fields], axis=1)).astype(int).tolist()
    content = encode_blackbox.header(fields) + encode_blackbox.frames(table, fields=fields)
    return StickFlight(by_stick.start(), content)
