"""Columns whose names say what they hold and in which unit: Crazyflie's, Betaflight's, north-east-down."""

from collections.abc import Collection
from typing import Any

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
    ("rate_body_rad_s", tuple(f"gyroADC[{i}]" for i in range(3)), {"unit": "deg/s"}),
    ("specific_force_body_m_s2", tuple(f"accSmooth[{i}]" for i in range(3)), {"unit": "g", "scale": 1.0 / 2048.0}),
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
