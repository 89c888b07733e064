"""Diagnosis of vehicles flown by other simulators, as a stranger would:

    python benchmarks/peer_simulators.py [--crazyflow PYTHON] [--json FILE]

RotorPy and crazyflow fly their own vehicles with their own controllers. The diagnosis has mass, hubs and propellers, as
a data sheet tells them, and the flights. Right are the families of the simulator's terms, and the sizes of its forms.
crazyflow (PyPI, MIT) runs in an interpreter of its own, PYTHON; without one it is left out, and said so.
"""

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

Array = np.ndarray
ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT))

import report  # noqa: E402
import rotorpy_flights  # noqa: E402

import vehicle  # noqa: E402
from flight import FlightLog  # noqa: E402
from sysid.diagnosis import diagnose  # noqa: E402
from sysid.diagnosis.families import family_of  # noqa: E402
from vehicle import draft  # noqa: E402

TRAINING, HELD_OUT = ("vertical", "horizontal", "rotation", "horizontal"), ("horizontal", "rotation")
LENGTH_S = 20.0
LEAST_SHARE = 0.05
"""Of the size that RotorPy has, an error within this or within two standard errors is right."""


@dataclass(frozen=True, slots=True)
class Peer:
    """A vehicle of another simulator, and its flights."""

    name: str
    given: vehicle.Vehicle
    """By the data sheet."""
    truth: Mapping[str, float]
    """The simulator's terms as parameters of our effects."""
    logs: list[FlightLog]
    """Those to learn from, then those held out."""


@dataclass(frozen=True, slots=True)
class OfRotorPy:
    """A vehicle of RotorPy."""

    name: str
    module: str
    rotor_radius_m: float
    share: float
    """Of the size of the paths and of the pose sensor's distance from the centre that suits it."""
    gains: Mapping[str, float]
    """Gains of its attitude, and what else is flown otherwise than RotorPy has it."""

    def flown(self, rng: np.random.Generator) -> Peer:
        from importlib import import_module

        p = {**import_module(f"rotorpy.vehicles.{self.module}").quad_params, **self.gains}
        said = {
            "rotor_drag_speed.drag_kg": p["k_d"],
            "inflow_linear.inflow_kg": p["k_z"],
            "translational_lift.lift_kg_m": p["k_h"],
            **{f"parasitic_drag_speed.drag_{axis}_kg_m": p[f"c_D{axis}"] for axis in "xyz"},
        }
        given = by_data_sheet(
            self.name,
            mass_kg=p["mass"],
            hub_body_m=np.stack(list(p["rotor_pos"].values())),
            spin=-np.asarray(p["rotor_directions"], dtype=float),
            rotor_radius_m=self.rotor_radius_m,
            rotor_speed_max_rad_s=float(p["rotor_speed_max"]),
        )
        fly = rotorpy_flights.fly
        logs = [fly(kind, LENGTH_S, rng, flown=p, share=self.share) for kind in (*TRAINING, *HELD_OUT)]
        return Peer(f"RotorPy {self.name}", given, {name: float(v) for name, v in said.items() if v}, logs)


ROTORPY = (
    OfRotorPy("hummingbird", "hummingbird_params", 0.1, 1.0, {"kp_att": 260.0, "kd_att": 26.0, "tau_m": 0.02}),
    OfRotorPy("crazyflie", "crazyflie_params", 0.0225, 0.25, {"kp_att": 310.0, "kd_att": 30.0}),
)
CRAZYFLOW_SHARE = 0.3
"""Of the size of the paths that suits its Crazyflie."""
SETTLED_S = 1.0
"""Flown before the log starts: it begins at rest."""


def of_crazyflow(python: str, rng: np.random.Generator) -> Peer:
    """Its Crazyflie 2.1 Brushless, flown by the interpreter `python`."""
    with tempfile.TemporaryDirectory() as folder:
        asked, given = Path(folder) / "paths.npz", Path(folder) / "flights.npz"
        paths = np.stack([_asked(kind, rng) for kind in (*TRAINING, *HELD_OUT)])
        np.savez(asked, path=paths, step_ms=5, shares=np.ones((len(paths), 4)))
        script = Path(__file__).with_name("crazyflow_flights.py")
        done = subprocess.run(
            [python, str(script), str(asked), str(given)], capture_output=True, text=True, cwd=folder, check=False
        )
        if done.returncode != 0:
            raise SystemExit(f"{python} could not fly crazyflow:\n{done.stderr[-2000:]}")
        with np.load(given) as kept:
            states, p = kept["state"], json.loads(str(kept["parameters"]))
    roll, pitch, yaw = np.array(p["mixing"])
    hubs = p["arm_m"] * np.stack([-pitch, roll, np.zeros(4)], axis=1)
    rate_hz = rotorpy_flights.RATE_HZ
    rows = states[:, round(SETTLED_S * rate_hz) :]
    time_s = np.arange(rows.shape[1]) / rate_hz
    place = CRAZYFLOW_SHARE * rotorpy_flights.SENSOR_BODY_M
    logs = [
        rotorpy_flights.noisy(kind, time_s, own, place, rng, source="crazyflow")
        for kind, own in zip((*TRAINING, *HELD_OUT), rows, strict=True)
    ]
    truth = {
        **{f"parasitic_drag_linear.drag_{axis}_n_s_m": d for axis, d in zip("xyz", p["drag_n_s_m"], strict=True)},
        "thrust_affine.slope_n_s": p["thrust_n"][1],
        "torque_affine.slope_n_m_s": p["torque_n_m"][1],
        "rotor_acceleration_torque.rotor_inertia_kg_m2": p["rotor_inertia_kg_m2"],
        "gyroscopic_torque.rotor_inertia_kg_m2": p["rotor_inertia_kg_m2"],
    }
    given = by_data_sheet(
        "cf21B_500",
        mass_kg=p["mass_kg"],
        hub_body_m=hubs,
        spin=-yaw,
        rotor_radius_m=0.0255,
        rotor_speed_max_rad_s=float(np.sqrt(p["thrust_max_n"] / p["thrust_n"][2])),
    )
    return Peer("crazyflow cf21B_500", given, {name: v for name, v in truth.items() if v}, logs)


def _asked(kind: str, rng: np.random.Generator) -> Array:
    """(n, 13) position, velocity, acceleration and quaternion (x, y, z, w) of a path 2 m above ground."""
    waves = rotorpy_flights.waves(kind, rng)
    waves[:3, :, 0] *= CRAZYFLOW_SHARE
    rate_hz = rotorpy_flights.RATE_HZ
    count = round((LENGTH_S + SETTLED_S) * rate_hz) + 1
    path = [rotorpy_flights.flat(waves, i / rate_hz) for i in range(count)]
    turned = Rotation.from_euler("z", [[p["yaw"]] for p in path]).as_quat()
    above = np.stack([p["x"] + [0.0, 0.0, 2.0] for p in path])
    return np.concatenate([above, [p["x_dot"] for p in path], [p["x_ddot"] for p in path], turned], axis=1)


def by_data_sheet(
    name: str, *, mass_kg: float, hub_body_m: Array, spin: Array, rotor_radius_m: float, rotor_speed_max_rad_s: float
) -> vehicle.Vehicle:
    known = draft.Known(
        name=name,
        mass_kg=vehicle.Parameter(mass_kg, 0.01 * mass_kg, "kg", "data sheet"),
        hub_body_m=hub_body_m,
        spin=spin,
        rotor_radius_m=vehicle.Parameter(rotor_radius_m, 0.0, "m", "data sheet"),
        rotor_speed_max_rad_s=rotor_speed_max_rad_s,
    )
    return draft.draft(known)


def judged(peer: Peer) -> list[report.Row]:
    began = time.process_time()
    found = diagnose(peer.logs[: len(TRAINING)], peer.given, held_out=peer.logs[len(TRAINING) :], auto=True)
    cpu_s = time.process_time() - began
    print(f"{peer.name}: {found.verdict}")
    for one in found.families:
        print(f"  {one.sentence}")
    right = peer.truth
    wanted = {family_of(name.partition(".")[0]) for name in right}
    named = {family_of(name) for name in found.additions}
    sizes = [_size_is_right(found.vehicle, name, value) for name, value in right.items() if _has(found.vehicle, name)]
    return [
        report.row(f"{peer.name}: families named, of {len(wanted)}", len(named & wanted), "", "all", named >= wanted),
        report.row(f"{peer.name}: other families named", len(named - wanted), "", "0", not named - wanted),
        report.row(f"{peer.name}: sizes right, of {len(sizes)}", sum(sizes), "", "all", all(sizes)),
        report.row(f"{peer.name}: diagnosis", cpu_s, "CPU s", "<= 60", cpu_s <= 60.0),
    ]


def _has(fitted: vehicle.Vehicle, name: str) -> bool:
    return name.partition(".")[0] in fitted.effects


def _size_is_right(fitted: vehicle.Vehicle, name: str, value: float) -> bool:
    found = fitted.parameter(name)
    right = abs(found.value - value) <= max(LEAST_SHARE * abs(value), 2.0 * found.std)
    print(f"  {name}: {found.value:.4g} +- {found.std:.2g}, there {value:.4g}{'' if right else ' WRONG'}")
    return right


def rows(*, seed: int, crazyflow: str) -> list[report.Row]:
    """Diagnoses of vehicles that RotorPy and crazyflow fly: families, sizes and CPU time.

    crazyflow is flown by the interpreter that --crazyflow names.
    """
    peers = [own.flown(np.random.default_rng(seed)) for own in ROTORPY]
    if crazyflow:
        peers.append(of_crazyflow(crazyflow, np.random.default_rng(seed)))
    else:
        print("crazyflow: not flown, for --crazyflow names no interpreter that has it")
    return [row for peer in peers for row in judged(peer)]


if __name__ == "__main__":
    report.main(rows, seed=11, crazyflow="")
