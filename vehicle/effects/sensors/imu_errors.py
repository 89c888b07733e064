"""Errors of an inertial sensor: constant biases, mounting rotation, lever arm."""

import numpy as np

from vehicle.effects.base import Effect, Reading, Spec, Stage, Values, cross


def apply(reading: Reading, p: Values) -> None:
    w, turn = reading.gyroscope_rad_s, reading.angular_acceleration_rad_s2
    arm = _column(p.place_x_m, p.place_y_m, p.place_z_m)
    force = reading.accelerometer_m_s2 + cross(turn, arm) + cross(w, cross(w, arm))
    angle = -_column(p.turn_x_rad, p.turn_y_rad, p.turn_z_rad)
    reading.accelerometer_m_s2 = _turned(force, angle) + _column(p.force_x_m_s2, p.force_y_m_s2, p.force_z_m_s2)
    reading.gyroscope_rad_s = _turned(w, angle) + _column(p.rate_x_rad_s, p.rate_y_rad_s, p.rate_z_rad_s)


def _column(x: float, y: float, z: float) -> np.ndarray:
    return np.array([x, y, z]).reshape(3, 1)


def _turned(v: np.ndarray, rotation_vector: np.ndarray) -> np.ndarray:
    """Rodrigues' formula; the sensor axes are turned by the vector, so what it reads turns by its opposite."""
    angle_squared = (rotation_vector**2).sum()
    angle = np.sqrt(angle_squared)
    sine, cosine = (np.sin(angle) / angle, (1.0 - np.cos(angle)) / angle_squared) if angle else (1.0, 0.5)
    once = cross(rotation_vector, v)
    return v + sine * once + cosine * cross(rotation_vector, once)


def _three(name: str, unit: str, prior: float, bound: float, planted: tuple[float, float, float]) -> list[Spec]:
    return [
        Spec(name.format(axis), unit, prior, (-bound, bound), planted=value)
        for axis, value in zip("xyz", planted, strict=True)
    ]


EFFECT = Effect(
    name="imu_errors",
    number=23,
    stage=Stage.SENSOR,
    apply=apply,
    parameters=(
        *_three("rate_{}_rad_s", "rad/s", 0.02, 1.0, (0.01, -0.02, 0.005)),
        *_three("force_{}_m_s2", "m/s2", 0.2, 5.0, (0.1, 0.05, -0.15)),
        *_three("turn_{}_rad", "rad", 0.02, 3.2, (0.01, 0.02, -0.015)),
        *_three("place_{}_m", "m", 0.03, 1.0, (0.02, -0.01, 0.015)),
    ),
    law="gyro = R_s^T w + b_g;  accel = R_s^T (f + dw x r + w x (w x r)) + b_a",
    source="kinematics of a rigid body; Titterton and Weston, Strapdown Inertial Navigation Technology",
    channel="gyroscope, accelerometer",
    regressor="constant in body axes, w, |w|^2; absent in pose",
    excited_by=("hover", "rotation"),
)
