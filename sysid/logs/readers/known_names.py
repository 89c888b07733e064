"""Columns whose names say what they hold and in which unit: Crazyflie's, Betaflight's, north-east-down."""

import re
from collections.abc import Collection, Iterator, Mapping
from typing import Any

import numpy as np

from flight.rotations import FloatArray

_PITCH_INVERTED = [1.0, -1.0, 1.0]
"""Crazyflie's Euler angles have the nose up at negative pitch, and so has its compressed rate."""


def _group(group: str, names: str) -> tuple[str, ...]:
    return tuple(f"{group}.{name}" for name in names.split())


KNOWN: tuple[tuple[str, tuple[str, ...], dict[str, Any]], ...] = (
    # quantity, its columns, keys of a column map; of one quantity the first that is there counts
    ("position_world_m", _group("stateEstimate", "x y z"), {"unit": "m"}),
    ("position_world_m", _group("kalman", "stateX stateY stateZ"), {"unit": "m"}),
    ("position_world_m", _group("stateEstimateZ", "x y z"), {"unit": "mm"}),
    ("position_world_m", _group("locSrv", "x y z"), {"unit": "m"}),
    ("position_world_m", ("PN", "PE", "PD"), {"unit": "m", "frame": "z down"}),
    ("velocity_world_m_s", _group("stateEstimate", "vx vy vz"), {"unit": "m/s"}),
    ("velocity_world_m_s", _group("stateEstimateZ", "vx vy vz"), {"unit": "mm/s"}),
    ("velocity_world_m_s", ("VN", "VE", "VD"), {"unit": "m/s", "frame": "z down"}),
    ("q_world_body", _group("stateEstimate", "qw qx qy qz"), {"order": "w x y z"}),
    ("q_world_body", _group("kalman", "q0 q1 q2 q3"), {"order": "w x y z"}),
    ("q_world_body", _group("locSrv", "qw qx qy qz"), {"order": "w x y z"}),
    (
        "q_world_body",
        _group("stateEstimate", "roll pitch yaw"),
        {"order": "roll pitch yaw", "unit": "deg", "sign": _PITCH_INVERTED},
    ),
    (
        "q_world_body",
        _group("stabilizer", "roll pitch yaw"),
        {"order": "roll pitch yaw", "unit": "deg", "sign": _PITCH_INVERTED},
    ),
    ("rate_body_rad_s", _group("gyro", "x y z"), {"unit": "deg/s"}),
    (
        "rate_body_rad_s",
        _group("stateEstimateZ", "rateRoll ratePitch rateYaw"),
        {"unit": "rad/s", "scale": 1e-3, "sign": _PITCH_INVERTED},
    ),
    ("specific_force_body_m_s2", _group("acc", "x y z"), {"unit": "g"}),
    ("rotor_speed_rad_s", _group("rpm", "m1 m2 m3 m4"), {"unit": "rpm"}),
    *((f"motor_command_{i}_ratio", (f"motor.m{i + 1}",), {"scale": 1.0 / 65535.0}) for i in range(4)),
    ("battery_v", ("pm.vbat",), {"unit": "V"}),
    ("battery_v", ("pm.vbatMV",), {"unit": "mV"}),
)


def found(names: Collection[str]) -> dict[str, tuple[tuple[str, ...], dict[str, Any]]]:
    """Quantity to columns and keys, of those that are all there."""
    chosen: dict[str, tuple[tuple[str, ...], dict[str, Any]]] = {}
    for quantity, columns, keys in KNOWN:
        if quantity not in chosen and all(column in names for column in columns):
            chosen[quantity] = columns, keys
    return chosen


BETAFLIGHT_LOW_PASS = (
    "CHECK: it is logged behind a low-pass of acc_lpf_hz (10 Hz in older firmware, 25 later).",
    "Inertias come out too small unless that is named. At the end of this file write, of 25 Hz",
    "(2 pi acc_lpf_hz / 0.6436; before Betaflight 4.3: 2 pi acc_lpf_hz, damping 0.707):",
    "    [metadata.accelerometer_low_pass]",
    "    natural_rad_s = 244.1",
    "    damping = 1.0",
)
_ONE_G = (512.0, 1024.0, 2048.0, 4096.0)
"""Readings of 1 g of Betaflight's accelerometers (acc_1G)."""
_BATTERY_V = (2.5, 70.0)


def of_betaflight(table: Mapping[str, FloatArray]) -> Iterator[tuple[str, tuple[str, ...], dict[str, Any], list[str]]]:
    """Quantity, columns, keys and reasons of what Betaflight's tools write, with a unit in brackets or raw."""
    for stem in ("gyroUnfilt", "gyroADC"):
        columns, unit = _with_unit(table, [f"{stem}[{i}]" for i in range(3)])
        if columns and unit in ("", "deg/s", "rad/s"):
            said = "its name says the unit" if unit else "deg/s, or tenths if blackbox_high_resolution is on: CHECK"
            yield "rate_body_rad_s", columns, {"unit": unit or "deg/s"}, [f"Betaflight's gyro: {said}"]
            break
    columns, unit = _with_unit(table, [f"accSmooth[{i}]" for i in range(3)])
    if columns and unit in ("", "g", "m/s2"):
        keys, said = ({"unit": unit}, "its name says the unit") if unit else _by_one_g(table, columns)
        yield "specific_force_body_m_s2", columns, keys, [f"Betaflight's accelerometer: {said}", *BETAFLIGHT_LOW_PASS]
    columns, unit = _with_unit(table, ["vbatLatest"])
    if columns and unit in ("", "V", "mV"):
        usual = float(np.nanmedian(table[columns[0]])) if np.isfinite(table[columns[0]]).any() else np.nan
        hundredths = not unit and _BATTERY_V[0] < 0.01 * usual < _BATTERY_V[1]
        if unit or hundredths:
            keys = {"unit": unit} if unit else {"unit": "V", "scale": 0.01}
            said = "its name says the unit" if unit else f"hundredths of a volt, median {usual:g}"
            yield "battery_v", columns, keys, [f"Betaflight's battery: {said}"]


def _with_unit(names: Collection[str], stems: list[str]) -> tuple[tuple[str, ...], str]:
    """The columns of these names, with or without a unit in brackets, and the unit; no columns if one is missing."""
    chosen, unit = [], ""
    for stem in stems:
        match = next((m for n in names if (m := re.fullmatch(rf"{re.escape(stem)}(?: \((.*)\))?", n))), None)
        if match is None:
            return (), ""
        chosen.append(match[0])
        unit = match[1] or ""
    return tuple(chosen), re.sub(r"m/s/s|m/s\^2|m/s²", "m/s2", unit)


def _by_one_g(table: Mapping[str, FloatArray], columns: tuple[str, ...]) -> tuple[dict[str, Any], str]:
    """What 1 g reads, by the usual length."""
    length = np.linalg.norm(np.stack([table[name] for name in columns], axis=1), axis=1)
    usual = max(float(np.median(length[np.isfinite(length)])), 1.0) if np.isfinite(length).any() else _ONE_G[2]
    one_g = min(_ONE_G, key=lambda reading: abs(np.log(reading / usual)))
    return {
        "unit": "g",
        "scale": 1.0 / one_g,
    }, f"its length is {usual:.0f} (median), so {one_g:.0f} is 1 g: CHECK acc_1G"
