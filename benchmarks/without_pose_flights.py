"""Simulated twins flown by stick: gyro, accelerometer and motor commands from 0 to 1, as a blackbox records them.

The body is our simulator's with drag, inflow, wind and gusts that the fitted model does not have. Commands act late;
gyro and accelerometer are filtered, noisy and shaken. The pilot climbs and drops in steps,
then rolls, pitches and yaws.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

import vehicle
from flight import FlightLog, FloatArray, rotations
from flight.flight_log import COLUMNS
from vehicle import Vehicle
from vehicle.simulation.simulate import Fleet, Wind, hovering

STEP_S = 1e-3
FULL_RAD_S = 2400.0
"""Rotor speed at full throttle; the fit is not told."""
COMMANDS = np.array([0.35, 0.48, 0.65])
"""At which thrust is judged: about the hover's."""
VARIED = {
    "inertia_xx_kg_m2": 0.25,
    "inertia_yy_kg_m2": 0.25,
    "inertia_zz_kg_m2": 0.25,
    "thrust_quadratic.k_n_s2": 0.1,
    "motor_lag.rise_s": 0.4,
    "motor_lag.fall_s": 0.4,
    "rotor_yaw_torque.torque_n_m_s2": 0.2,
}
"""Parameters that are drawn for each twin, and by which share to either side of the usual."""


@dataclass(frozen=True, slots=True)
class Recorder:
    """What lies between the body and its log."""

    rate_hz: float = 500.0
    gyro_cutoff_hz: float = 100.0
    accelerometer_cutoff_hz: float = 60.0
    gyro_rad_s: float = 0.02
    accelerometer_m_s2: float = 0.4
    vibration: float = 1.0
    """Shares of 0.1 rad/s and 3 m/s2 at the rotors' frequency."""
    place_m: tuple[float, float, float] = (0.01, -0.006, 0.008)
    latency_s: float = 4e-3
    gyro_late_s: float = 0.0
    """Beside its low-pass; the pilot's rate loop has the late one, too."""
    command_step: float = 1e-3


def body() -> Vehicle:
    """A quadrotor of 0.65 kg with 5 inch propellers, and all that acts on it."""
    usual = vehicle.example("hummingbird")
    for effect in usual.effects:
        usual = usual.without_effect(effect)
    weight_n = 0.65 * 9.80665
    k = 0.8 * weight_n / 4.0 / (0.48 * FULL_RAD_S) ** 2
    given = {"mass_kg": 0.65, "inertia_xx_kg_m2": 2.6e-3, "inertia_yy_kg_m2": 3.2e-3, "inertia_zz_kg_m2": 4.6e-3}
    for name, value in given.items():
        usual = usual.with_value(name, value)
    usual = usual.with_limits(rotor_speed_min_rad_s=100.0, rotor_speed_max_rad_s=FULL_RAD_S)
    usual = usual.with_effect("motor_lag", rise_s=0.035, fall_s=0.045).with_effect("thrust_quadratic", k_n_s2=k)
    usual = usual.with_effect("rotor_yaw_torque", torque_n_m_s2=0.013 * k)
    usual = usual.with_effect("thrust_affine", constant_n=0.0, slope_n_s=0.2 * weight_n / 4.0 / (0.48 * FULL_RAD_S))
    usual = usual.with_effect("rotor_drag_thrust", drag_s_m=0.03).with_effect("inflow_linear")
    return usual.with_effect("parasitic_drag", drag_xy_kg_m=0.012, drag_z_kg_m=0.02)


def start() -> Vehicle:
    """What a person knows beforehand: mass, arms, propellers."""
    plain = body()
    for effect in ("rotor_drag_thrust", "parasitic_drag", "thrust_affine", "inflow_linear"):
        plain = plain.without_effect(effect)
    for name, factor in zip(VARIED, (1.5, 0.7, 1.4, 1.4, 0.6, 1.5, 0.6), strict=True):
        plain = plain.with_value(name, factor * plain.value(name))
    return plain.with_limits(rotor_speed_max_rad_s=1.25 * FULL_RAD_S)


def drawn(count: int, rng: np.random.Generator) -> dict[str, FloatArray]:
    """Parameter to (count,) values of as many twins."""
    usual = body()
    return {name: usual.value(name) * rng.uniform(1.0 - s, 1.0 + s, count) for name, s in VARIED.items()}


def flown(
    truth: Vehicle,
    values: Mapping[str, FloatArray],
    rng: np.random.Generator,
    *,
    duration_s: float = 40.0,
    recorder: Recorder | None = None,
    gust_m_s: float = 0.5,
    effort: tuple[float, float, float] = (1.0, 1.0, 1.0),
) -> list[FlightLog]:
    """Logs of one flight of each twin.

    Args:
        values: parameter to (m,) values where twins differ from `truth`.
        effort: of throttle steps, rolls and pitches, and yaws: shares of the usual sticks.
    """
    recorder = recorder or Recorder()
    m = len(next(iter(values.values())))
    states = [hovering(truth, np.array([0.0, 0.0, 30.0]))] * m
    wind = Wind((1.0, -0.5, 0.0), gust_std_m_s=gust_m_s)
    fleet = Fleet(truth, states, values=values, rng=rng, wind=wind, step_s=STEP_S)
    pilot = _Pilot(m, rng, duration_s, effort)
    late = max(0, round(recorder.latency_s / STEP_S))
    waiting = [np.full((m, 4), 0.48)] * (late + 1)
    filtered, force = np.zeros((m, 3)), np.tile([0.0, 0.0, 9.8], (m, 1))
    gyros, gyro_late = [filtered], round(recorder.gyro_late_s / STEP_S)
    turn_before = np.zeros((m, 3))
    rows: list[tuple[FloatArray, ...]] = []
    every = round(1.0 / (recorder.rate_hz * STEP_S))
    count = round(duration_s / STEP_S)
    for k in range(count):
        rate = fleet.rate_body_rad_s
        turning = (rate - turn_before) / STEP_S if k else np.zeros((m, 3))
        turn_before = rate
        here = np.array(recorder.place_m)
        felt = fleet.specific_force_body_m_s2 + rotations.cross(turning, here)
        felt = felt + rotations.cross(rate, rotations.cross(rate, here))
        shake = np.sin(1050.0 * k * STEP_S + np.arange(3)) * recorder.vibration
        noisy = rate + recorder.gyro_rad_s * rng.standard_normal((m, 3)) * 2.0 + 0.1 * shake
        filtered = filtered + low_pass_share(recorder.gyro_cutoff_hz) * (noisy - filtered)
        gyros = [*gyros[-gyro_late:], filtered] if gyro_late else [filtered]
        gyro = gyros[0]
        felt = felt + recorder.accelerometer_m_s2 * rng.standard_normal((m, 3)) * 2.0 + 3.0 * shake
        force = force + low_pass_share(recorder.accelerometer_cutoff_hz) * (felt - force)
        command = pilot.command(fleet, gyro)
        command = np.round(command / recorder.command_step) * recorder.command_step
        waiting = [*waiting[1:], command]
        if k % every == 0:
            rows.append((gyro, force, command))
        fleet.step(FULL_RAD_S * waiting[0], STEP_S)
    columns = [np.stack(parts, axis=1) for parts in zip(*rows, strict=True)]
    time_s = np.arange(len(rows), dtype=np.float64) * every * STEP_S
    return [log_of(f"twin {i + 1}", time_s, *(part[i] for part in columns)) for i in range(m)]


def low_pass_share(cutoff_hz: float, step_s: float = STEP_S) -> float:
    """Of what changes, that a first-order low-pass takes up in one step."""
    return float(1.0 - np.exp(-2.0 * np.pi * cutoff_hz * step_s))


def log_of(name: str, time_s: FloatArray, gyro: FloatArray, force: FloatArray, command: FloatArray) -> FlightLog:
    columns = dict(zip(COLUMNS["rate_body_rad_s"], gyro.T, strict=True))
    columns |= dict(zip(COLUMNS["specific_force_body_m_s2"], force.T, strict=True))
    columns |= {f"motor_command_{i}_ratio": command[:, i] for i in range(4)}
    return FlightLog({"time_s": time_s, **columns}, {"name": name})


class _Pilot:
    """Throttle steps, then rolls, pitches and yaws to and fro; the vehicle is held near its place.

    A stick moves at any step of the loop. Moved at logged steps alone, as no stick is, sudden commands are known in
    time and gradual ones are not: lags came out 1 to 2 % long and inertias .4 % small in every twin.
    """

    def __init__(self, m: int, rng: np.random.Generator, duration_s: float, effort: tuple[float, float, float]) -> None:
        self._effort = effort
        blocks = int(duration_s / 0.35) + 2
        self._kind = (np.arange(blocks) * 0.35 / duration_s * 3.0).astype(int)  # thirds: throttle, tilt, yaw
        self._stick = rng.uniform(-1.0, 1.0, (blocks, m, 4))
        self._later_s = rng.spawn(1)[0].uniform(0.0, 0.1, blocks)
        self._sum = np.zeros((m, 3))
        self._mix = np.stack([np.sign(body().hub_body_m[:, 1]), -np.sign(body().hub_body_m[:, 0]), -body().spin])

    def command(self, fleet: Fleet, gyro: FloatArray) -> FloatArray:
        """(m, 4) from 0 to 1, by a rate loop on the filtered gyro."""
        block = int(fleet.time_s / 0.35)
        block -= int(block > 0 and fleet.time_s < 0.35 * block + self._later_s[block])
        kind, stick = self._kind[block], self._stick[block]
        up = rotations.matrix(fleet.q_world_body)[:, 2]  # world z in body axes
        level = np.stack([up[:, 1], -up[:, 0]], axis=1)
        drift = np.einsum("mij,mi->mj", rotations.matrix(fleet.q_world_body), fleet.velocity_world_m_s)
        wanted = np.zeros_like(gyro)
        wanted[:, :2] = -7.0 * level + 0.35 * np.stack([drift[:, 1], -drift[:, 0]], axis=1)
        wanted[:, :2] += (5.0 * self._effort[1] if kind == 1 else 0.4 * min(self._effort)) * stick[:, :2]
        wanted[:, 2] = (5.0 * self._effort[2] if kind == 2 else 0.3 * min(self._effort)) * stick[:, 2]
        error = wanted - gyro
        self._sum = np.clip(self._sum + STEP_S * error, -0.5, 0.5)
        height = fleet.position_world_m[:, 2] - 30.0
        lift = 0.48 - 0.01 * height - 0.03 * fleet.velocity_world_m_s[:, 2]
        lift += (0.22 * self._effort[0] if kind == 0 else 0.06 * min(self._effort)) * stick[:, 3]
        turn = np.clip(error * [0.02, 0.02, 0.05] + self._sum * [0.05, 0.05, 0.08], -0.2, 0.2)
        return np.clip(lift[:, None] + turn @ self._mix, 0.05, 1.0)
