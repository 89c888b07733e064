"""A minute by stick on the real firmware: a simulated body with known truth, a pilot, and the blackbox log of it.

The pilot arms on the ground, climbs, steps the throttle, rolls and pitches, yaws, lands and disarms. The body has drag,
inflow, wind and gusts that the fitted model does not have; its accelerometer is beside the centre of mass, its
sensors are noisy and shaken by the rotors, and its ESCs are late.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import vehicle
from firmware_bridge.betaflight_sitl import process as sitl
from flight import FloatArray, rotations
from vehicle import Vehicle
from vehicle.simulation.simulate import Plant, State, Wind

STEP_S = 1e-3
FULL_RAD_S = 2400.0
"""Rotor speed at full throttle; the fit is not told."""
HOVER = 0.45
"""Output at which the body hovers."""
MASS_KG, ARM_M, PROPELLER_M = 0.65, 0.125, 0.127
LATE_STEPS = 2
"""From an output to the ESC's answer to it."""
PLACE_M = np.array([0.01, -0.006, 0.008])
"""Of the accelerometer, from the centre of mass."""
GYRO_RAD_S, ACCELEROMETER_M_S2 = 0.02, 0.5
ATTITUDE_RAD = 2e-4
"""Noise of the attitude, which the simulator gives to the firmware: an estimate is never quite at rest."""
SHAKEN_RAD_S, SHAKEN_M_S2, SHAKEN_BY_RAD_S = 0.1, 3.0, 1050.0
LARGEST_RATE_RAD_S = np.deg2rad(1000.0)
SETTINGS = (
    "aux 0 0 0 1700 2100 0 0",  # the first switch arms
    "set blackbox_device = VIRTUAL",
    *(f"set {axis}_{name} = {value}" for axis in ("roll", "pitch", "yaw") for name, value in
      (("rc_rate", 100), ("srate", 100), ("expo", 0))),
)  # fmt: skip
"""Sticks ask for rates in proportion; everything else is as the firmware comes."""
STAGES = ("rest", "arm", "climb", "throttle", "tilt", "yaw", "land", "disarm")
ENDS_S = np.array([6.0, 7.0, 11.0, 27.0, 47.0, 63.0, 75.0, 76.5])
BLOCK_S = 0.35
"""How long the pilot holds a stick."""


@dataclass(frozen=True, slots=True)
class Flown:
    """What is left of the flight."""

    truth: Vehicle
    settings: str
    """`diff all`."""
    log: Path
    position_world_m: FloatArray
    """(n, 3) at each step."""
    rate_body_rad_s: FloatArray
    """(n, 3)."""


def truth() -> Vehicle:
    """A quadrotor with rotors as the firmware's motors 1 to 4: rear right, front right, rear left, front left."""
    body = vehicle.example("hummingbird")
    for effect in body.effects:
        body = body.without_effect(effect)
    hubs = ARM_M / np.sqrt(2.0) * np.array([[-1, -1, 0], [1, -1, 0], [-1, 1, 0], [1, 1, 0]])
    body = replace(body, name="truth", hub_body_m=hubs, spin=np.array([-1.0, 1.0, 1.0, -1.0]))
    weight_n, hover_rad_s = MASS_KG * 9.80665, HOVER * FULL_RAD_S
    k = 0.8 * weight_n / 4.0 / hover_rad_s**2
    given = {"mass_kg": MASS_KG, "inertia_xx_kg_m2": 2.6e-3, "inertia_yy_kg_m2": 3.2e-3, "inertia_zz_kg_m2": 4.6e-3}
    for name, value in given.items():
        body = body.with_value(name, value)
    body = body.with_limits(rotor_speed_min_rad_s=0.0, rotor_speed_max_rad_s=FULL_RAD_S)
    body = body.with_effect("motor_lag", rise_s=0.035, fall_s=0.045).with_effect("thrust_quadratic", k_n_s2=k)
    body = body.with_effect("rotor_yaw_torque", torque_n_m_s2=0.013 * k)
    body = body.with_effect("thrust_affine", constant_n=0.0, slope_n_s=0.2 * weight_n / 4.0 / hover_rad_s)
    body = body.with_effect("rotor_drag_thrust", drag_s_m=0.03).with_effect("inflow_linear")
    return body.with_effect("parasitic_drag", drag_xy_kg_m=0.012, drag_z_kg_m=0.02)


def fly(folder: Path, rng: np.random.Generator) -> Flown:
    """One flight; the firmware's files stay in `folder`."""
    body = truth()
    with sitl.alone():
        settings = sitl.configure(folder, SETTINGS)
        plant = Plant(body, State(), rng=rng, wind=Wind((1.0, -0.5, 0.0), gust_std_m_s=0.5), ground_m=0.0)
        with sitl.flying(folder) as firmware:
            way, rate = _flown(plant, firmware, _Pilot(rng), rng)
    (log,) = folder.glob("LOG*.BF*")
    return Flown(body, settings, log, way, rate)


def _flown(
    plant: Plant, firmware: sitl.Sitl, pilot: "_Pilot", rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Position and body rate at each step."""
    waiting = [np.zeros(4)] * LATE_STEPS
    before, (way, rates) = np.zeros(3), np.empty((2, round(ENDS_S[-1] / STEP_S), 3))
    for k in range(len(way)):
        time_s, rate = 1.0 + k * STEP_S, plant.rate_body_rad_s
        turning, before = (rate - before) / STEP_S, rate
        felt = plant.specific_force_body_m_s2 + np.cross(turning, PLACE_M) + np.cross(rate, np.cross(rate, PLACE_M))
        shake = np.sin(SHAKEN_BY_RAD_S * time_s + np.arange(3)) * min(1.0, plant.rotor_speed_rad_s[0] / 300.0)
        if k % 10 == 0:
            firmware.sticks(time_s, pilot.sticks(plant, k * STEP_S))
        firmware.step(
            time_s,
            rate_body_rad_s=rate + GYRO_RAD_S * rng.standard_normal(3) + SHAKEN_RAD_S * shake,
            specific_force_body_m_s2=felt + ACCELEROMETER_M_S2 * rng.standard_normal(3) + SHAKEN_M_S2 * shake,
            q_world_body=rotations.multiply(plant.q_world_body, rotations.exp(ATTITUDE_RAD * rng.standard_normal(3))),
            position_world_m=plant.position_world_m,
            velocity_world_m_s=plant.velocity_world_m_s,
        )
        way[k], rates[k] = plant.position_world_m, rate
        waiting.append(firmware.outputs)
        plant.step(FULL_RAD_S * waiting.pop(0), STEP_S)
    return way, rates


class _Pilot:
    """Sees attitude, height and drift, and moves four sticks."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._missing_m_s = 0.0
        self._stick = rng.uniform(-1.0, 1.0, (int(ENDS_S[-1] / BLOCK_S) + 1, 4))

    def sticks(self, plant: Plant, time_s: float) -> list[float]:
        """Pulses of roll, pitch, throttle, yaw and the switch that arms."""
        stage = STAGES[int(np.searchsorted(ENDS_S, time_s, "right"))]
        if stage in ("rest", "arm", "disarm"):
            return [1500.0, 1500.0, 1000.0, 1500.0, 2000.0 if stage == "arm" else 1000.0]
        stick = self._stick[int(time_s / BLOCK_S)]
        rate = self._level(plant)
        rate[:2] += {"tilt": 5.0, "throttle": 0.4, "yaw": 0.4}.get(stage, 0.0) * stick[:2]
        rate[2] = {"yaw": 2.0, "throttle": 0.3, "tilt": 0.3}.get(stage, 0.0) * stick[2]
        height, climb = plant.position_world_m[2], plant.velocity_world_m_s[2]
        wanted = 25.0 if stage != "land" else max(-1.0, 25.0 * (1.0 - (time_s - ENDS_S[5]) / 10.0))
        slower = float(np.clip(0.8 * (wanted - height), -3.0, 4.0)) - climb
        self._missing_m_s = float(np.clip(self._missing_m_s + 0.01 * slower, -2.0, 2.0))
        lift = HOVER + 0.08 * slower + 0.1 * self._missing_m_s
        lift += {"throttle": 0.22, "tilt": 0.05, "yaw": 0.05}.get(stage, 0.0) * stick[3]
        roll, pitch, yaw = np.clip(rate / LARGEST_RATE_RAD_S, -1.0, 1.0)
        throttle = 1000.0 + 1000.0 * float(np.clip(lift, 0.06, 1.0))
        return [1500.0 + 500.0 * roll, 1500.0 + 500.0 * pitch, throttle, 1500.0 - 500.0 * yaw, 2000.0]

    @staticmethod
    def _level(plant: Plant) -> FloatArray:
        """Rates that bring the body level, and against its drift."""
        R = rotations.matrix(plant.q_world_body)
        up, drift = R[2], R.T @ plant.velocity_world_m_s
        turn = -7.0 * np.array([up[1], -up[0]]) + 0.35 * np.array([drift[1], -drift[0]])
        return np.array([turn[0], turn[1], 0.0])
