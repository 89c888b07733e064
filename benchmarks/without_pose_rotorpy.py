"""Twins without a pose that RotorPy flies: its physics, its motors and its controller, which follows steps of a stick.

Each is a vehicle of RotorPy with other inertias, motors and propellers. The logs hold what a blackbox holds, through
the same filters, noise, latency and vibration as our own twins (`without_pose_flights.Recorder`).
"""

from dataclasses import dataclass
from importlib import import_module

import numpy as np
from peer_simulators import by_data_sheet
from rotorpy_flights import flat
from without_pose_flights import COMMANDS, Recorder, log_of, low_pass_share

from flight import FlightLog, FloatArray, rotations
from flight.frames import GRAVITY_M_S2
from vehicle import Vehicle

STEP_S = 2e-3
HOLD_S = 0.7
VARIED = ("Ixx", "Iyy", "Izz", "k_eta", "tau_m")
VEHICLES = {"hummingbird": ({"kp_att": 260.0, "kd_att": 26.0}, 0.1), "crazyflie": ({"kd_att": 30.0}, 0.0225)}
"""Gains of the attitude, and the rotors' radius in m."""


@dataclass(frozen=True, slots=True)
class Twin:
    """A log, what a person knows of the vehicle, and its truth."""

    log: FlightLog
    given: Vehicle
    values: dict[str, float]
    """By the name of our parameter, in SI."""
    commands: FloatArray
    """(n,) that the rotors followed."""
    thrust_n: FloatArray
    """(n,) of one rotor at these."""


def flown(name: str, rng: np.random.Generator, *, duration_s: float) -> Twin:
    """One flight of one twin of a vehicle of `VEHICLES`."""
    from rotorpy.controllers.quadrotor_control import SE3Control
    from rotorpy.vehicles.multirotor import Multirotor

    gains, radius_m = VEHICLES[name]
    usual = {**import_module(f"rotorpy.vehicles.{name}_params").quad_params, **gains}
    p = {**usual, **{one: usual[one] * rng.uniform(0.8, 1.25) for one in VARIED}}
    p["Izz"] = min(p["Izz"], 0.95 * (p["Ixx"] + p["Iyy"]))  # no body has more than the sum
    if name == "hummingbird":
        p["tau_m"] = 0.035 * rng.uniform(0.7, 1.3)  # RotorPy's follows within 5 ms: no motor does
    full = 2.0 * float(np.sqrt(p["mass"] * GRAVITY_M_S2 / (4.0 * p["k_eta"])))
    p |= {"rotor_speed_max": full, "rotor_speed_min": 0.05 * full}
    body = Multirotor(p, control_abstraction="cmd_motor_speeds", integrator_kwargs={"rtol": 1e-5, "atol": 1e-7})
    columns = _recorded(body, SE3Control(p), p, rng, duration_s, full)
    place = np.stack(list(p["rotor_pos"].values()))
    given = by_data_sheet(
        name,
        mass_kg=p["mass"],
        hub_body_m=place,
        spin=-np.asarray(p["rotor_directions"], dtype=float),
        rotor_radius_m=radius_m,
        rotor_speed_max_rad_s=full,
    )
    log = log_of(f"RotorPy {name}", np.arange(len(columns[0])) * STEP_S, *columns)
    values = {f"inertia_{axis * 2}_kg_m2": p[f"I{axis * 2}"] for axis in "xyz"}
    values |= {"motor_lag.rise_s": p["tau_m"], "motor_lag.fall_s": p["tau_m"]}
    return Twin(log, given, values, COMMANDS, p["k_eta"] * (full * COMMANDS) ** 2)


def _recorded(
    body, control, p: dict, rng: np.random.Generator, duration_s: float, full: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(n, 3) gyro, (n, 3) accelerometer, (n, 4) motor commands as the recorder writes them, `STEP_S` apart."""
    recorder = Recorder()
    body.g = GRAVITY_M_S2
    body.weight = np.array([0.0, 0.0, -p["mass"] * GRAVITY_M_S2])
    state = {
        **{key: np.zeros(3) for key in ("x", "v", "w", "wind")},
        "q": np.array([0.0, 0.0, 0.0, 1.0]),
        "rotor_speeds": np.full(4, 0.5 * full),
    }
    count = round(duration_s / STEP_S)
    asked = steps(count, rng, 0.3 if p["mass"] > 0.1 else 0.12)
    waiting = [{"cmd_motor_speeds": np.full(4, 0.5 * full)}] * (1 + round(recorder.latency_s / STEP_S))
    gyro, force, commands = np.zeros((count, 3)), np.zeros((count, 3)), np.empty((count, 4))
    turned, felt = np.zeros(3), np.array([0.0, 0.0, GRAVITY_M_S2])
    place = np.array(recorder.place_m)
    for i in range(count):
        wanted = control.update(i * STEP_S, state, asked[i])["cmd_motor_speeds"]
        commands[i] = np.round(np.clip(wanted / full, 0.05, 1.0) / recorder.command_step) * recorder.command_step
        waiting = [*waiting[1:], {"cmd_motor_speeds": full * commands[i]}]
        slope = body.statedot(state, waiting[0], STEP_S)
        lift = rotations.rotate(
            rotations.conjugate(np.roll(state["q"], 1)), slope["vdot"] + np.array([0.0, 0.0, GRAVITY_M_S2])
        )
        w = state["w"]
        lift = lift + np.cross(slope["wdot"], place) + np.cross(w, np.cross(w, place))
        shake = recorder.vibration * np.sin(1050.0 * i * STEP_S + np.arange(3))
        noise = rng.standard_normal((2, 3)) * np.sqrt(2.0)
        turned = turned + low_pass_share(recorder.gyro_cutoff_hz, STEP_S) * (
            w + recorder.gyro_rad_s * noise[0] + 0.1 * shake - turned
        )
        felt = felt + low_pass_share(recorder.accelerometer_cutoff_hz, STEP_S) * (
            lift + recorder.accelerometer_m_s2 * noise[1] + 3.0 * shake - felt
        )
        gyro[i], force[i] = turned, felt
        state = body.step(state, waiting[0], STEP_S)
    return gyro, force, commands


def steps(count: int, rng: np.random.Generator, size_m: float) -> list[dict]:
    """What the controller is asked for: steps of height, then of place, then of heading, each held `HOLD_S`."""
    blocks = int(count * STEP_S / HOLD_S) + 1
    jumps = rng.uniform(-1.0, 1.0, (blocks, 4)) * [size_m, size_m, size_m, 0.8]
    third = np.arange(blocks) * 3 // blocks
    jumps *= np.where(third[:, None] == np.array([1, 1, 0, 2]), 1.0, 0.1)
    still = flat(np.zeros((4, 2, 3)), 0.0)
    held = [{**still, "x": jump[:3], "yaw": float(jump[3])} for jump in jumps]
    return [held[int(i * STEP_S / HOLD_S)] for i in range(count)]
