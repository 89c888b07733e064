"""Twins without a pose that crazyflow flies: its physics, its motors and its controller, which follows steps.

Each is a Crazyflie 2.1 Brushless with other inertias and propellers, flown by an interpreter that has crazyflow
(`crazyflow_flights`). The logs hold what a blackbox holds, through the same filters, noise, latency and vibration as
our own twins (`without_pose_flights.Recorder`).
"""

import json
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from peer_simulators import by_data_sheet
from scipy.signal import lfilter
from without_pose_flights import Recorder, log_of, low_pass_share
from without_pose_rotorpy import Twin

from flight import FloatArray, rotations
from flight.frames import GRAVITY_M_S2

STEP_S, EVERY = 1e-3, 2
"""Of the simulation, and how many steps lie between rows of a log."""
USUAL_KG_M2 = 25e-6, 28e-6, 49e-6
"""Inertias of this vehicle."""
HOLD_S, SETTLED_S = 0.7, 2.0
SHARES = (0.8, 0.8, 0.8, 0.9), (1.25, 1.25, 0.95, 1.2)
"""Drawn between these: of the usual inertias about x and y; of their sum, about z; of the usual thrust."""
JUMPS = 0.12, 0.12, 0.12, 0.8
"""Of place in m and of heading in rad, to either side."""


def flown(python: str, draws: int, rng: np.random.Generator, *, duration_s: float) -> list[Twin]:
    """One flight of each of as many vehicles."""
    count = round((SETTLED_S + duration_s) / STEP_S)
    shares = rng.uniform(*SHARES, (draws, 4))
    x, y, z = USUAL_KG_M2
    shares[:, 2] *= shares[:, :2] @ [x, y] / z
    with tempfile.TemporaryDirectory() as folder:
        asked, found = Path(folder) / "paths.npz", Path(folder) / "flights.npz"
        np.savez(asked, path=np.stack([_steps(count, rng) for _ in shares]), step_ms=1, shares=shares)
        script = Path(__file__).with_name("crazyflow_flights.py")
        command = [python, str(script), str(asked), str(found)]
        done = subprocess.run(command, capture_output=True, text=True, cwd=folder, check=False)
        if done.returncode != 0:
            raise SystemExit(f"{python} could not fly crazyflow:\n{done.stderr[-2000:]}")
        with np.load(found) as kept:
            state, motion, p = kept["state"], kept["motion"], json.loads(str(kept["parameters"]))
    return [_twin(*one, p, rng) for one in zip(state, motion, shares, strict=True)]


def _twin(state: FloatArray, motion: FloatArray, share: FloatArray, p: dict, rng: np.random.Generator) -> Twin:
    full = float(np.sqrt(p["thrust_max_n"] / p["thrust_n"][2]))  # about, so that commands stay below 1
    roll, pitch, yaw = np.array(p["mixing"])
    given = by_data_sheet(
        "cf21B_500",
        mass_kg=p["mass_kg"],
        hub_body_m=p["arm_m"] * np.stack([-pitch, roll, np.zeros(4)], axis=1),
        spin=-yaw,
        rotor_radius_m=0.0255,
        rotor_speed_max_rad_s=full,
    )
    rows = _recorded(state, motion, full, rng)
    log = log_of("crazyflow", np.arange(len(rows[0])) * EVERY * STEP_S, *rows)
    values = {f"inertia_{axis * 2}_kg_m2": share[i] * p["inertia_kg_m2"][i] for i, axis in enumerate("xyz")}
    speed = np.quantile(state[round(SETTLED_S / STEP_S) :, 7:], (0.05, 0.5, 0.95))
    return Twin(log, given, values, speed / full, share[3] * np.polynomial.Polynomial(p["thrust_n"])(speed))


def _recorded(
    state: FloatArray, motion: FloatArray, full: float, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(n, 3) gyro, (n, 3) accelerometer, (n, 4) motor commands as the recorder writes them."""
    recorder = Recorder()
    velocity, rate, speed = motion[:, :3], motion[:, 3:6], motion[:, 6:]
    lift = np.diff(velocity, axis=0, append=velocity[-1:]) / STEP_S + [0.0, 0.0, GRAVITY_M_S2]
    turning = np.diff(rate, axis=0, append=rate[-1:]) / STEP_S
    place = np.broadcast_to(np.array(recorder.place_m), rate.shape)
    felt = rotations.rotate(rotations.conjugate(state[:, 3:7]), lift)
    felt = felt + np.cross(turning, place) + np.cross(rate, np.cross(rate, place))
    shake = recorder.vibration * np.sin(1050.0 * np.arange(len(rate))[:, None] * STEP_S + np.arange(3))
    noise = 2.0 * rng.standard_normal((2, *rate.shape))
    gyro = rate + recorder.gyro_rad_s * noise[0] + 0.1 * shake
    force = felt + recorder.accelerometer_m_s2 * noise[1] + 3.0 * shake
    late = round(recorder.latency_s / STEP_S)
    command = np.concatenate([speed[late:], np.repeat(speed[-1:], late, axis=0)]) / full  # stamped before it acts
    kept = slice(round(SETTLED_S / STEP_S), len(rate) - late, EVERY)
    return (
        _low_passed(gyro, recorder.gyro_cutoff_hz)[kept],
        _low_passed(force, recorder.accelerometer_cutoff_hz)[kept],
        (np.round(command / recorder.command_step) * recorder.command_step)[kept],
    )


def _low_passed(values: FloatArray, cutoff_hz: float) -> FloatArray:
    share = low_pass_share(cutoff_hz, STEP_S)
    return lfilter([share], [1.0, share - 1.0], values, axis=0)


def _steps(count: int, rng: np.random.Generator) -> FloatArray:
    """(count, 13) asked for: hover, then steps of height, of place and of heading, each held `HOLD_S`."""
    settled = round(SETTLED_S / STEP_S)
    blocks = int((count - settled) * STEP_S / HOLD_S) + 1
    third = np.arange(blocks) * 3 // blocks
    jumps = rng.uniform(-1.0, 1.0, (blocks, 4)) * JUMPS
    jumps *= np.where(third[:, None] == np.array([1, 1, 0, 2]), 1.0, 0.1)
    held = np.zeros((count, 4))
    held[settled:] = jumps[((np.arange(count - settled) * STEP_S) / HOLD_S).astype(int)]
    path = np.zeros((count, 13))
    path[:, :3] = held[:, :3] + [0.0, 0.0, 2.0]
    path[:, 11], path[:, 12] = np.sin(held[:, 3] / 2.0), np.cos(held[:, 3] / 2.0)
    return path
