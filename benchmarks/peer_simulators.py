"""Diagnosis of vehicles flown by another simulator, as a stranger would: `python benchmarks/peer_simulators.py`.

RotorPy flies its own vehicles with its own controller. The diagnosis has their mass, hubs and propellers, as a data
sheet tells them, and the flights. Right are the families of RotorPy's terms, and the sizes of its forms.
"""

import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT))

import report  # noqa: E402
import rotorpy_flights  # noqa: E402

import vehicle  # noqa: E402
from sysid.diagnosis import diagnose  # noqa: E402
from sysid.diagnosis.families import family_of  # noqa: E402
from vehicle import draft  # noqa: E402

TRAINING, HELD_OUT = ("vertical", "horizontal", "rotation", "horizontal"), ("horizontal", "rotation")
LENGTH_S = 20.0
LEAST_SHARE = 0.05
"""Of the size that RotorPy has, an error within this or within two standard errors is right."""


@dataclass(frozen=True, slots=True)
class Peer:
    """A vehicle of RotorPy."""

    name: str
    module: str
    rotor_radius_m: float
    share: float
    """Of the size of the paths and of the pose sensor's distance from the centre that suits it."""
    gains: Mapping[str, float]
    """Gains of its attitude, and what else is flown otherwise than RotorPy has it."""

    def flown(self) -> dict[str, Any]:
        from importlib import import_module

        return {**import_module(f"rotorpy.vehicles.{self.module}").quad_params, **self.gains}


PEERS = (
    Peer("hummingbird", "hummingbird_params", 0.1, 1.0, {"kp_att": 260.0, "kd_att": 26.0, "tau_m": 0.02}),
    Peer("crazyflie", "crazyflie_params", 0.0225, 0.25, {"kp_att": 310.0, "kd_att": 30.0}),
)


def truth(p: Mapping[str, Any]) -> dict[str, float]:
    """RotorPy's terms as parameters of our effects; those that are zero are not there."""
    said = {
        "rotor_drag_speed.drag_kg": p["k_d"],
        "inflow_linear.inflow_kg": p["k_z"],
        "translational_lift.lift_kg_m": p["k_h"],
        **{f"parasitic_drag_speed.drag_{axis}_kg_m": p[f"c_D{axis}"] for axis in "xyz"},
    }
    return {name: float(value) for name, value in said.items() if value}


def start(peer: Peer) -> vehicle.Vehicle:
    """By the data sheet."""
    p = peer.flown()
    known = draft.Known(
        name=peer.name,
        mass_kg=vehicle.Parameter(p["mass"], 0.01 * p["mass"], "kg", "RotorPy"),
        hub_body_m=np.stack(list(p["rotor_pos"].values())),
        spin=-np.asarray(p["rotor_directions"], dtype=float),
        rotor_radius_m=vehicle.Parameter(peer.rotor_radius_m, 0.0, "m", "RotorPy"),
        rotor_speed_max_rad_s=float(p["rotor_speed_max"]),
    )
    return draft.draft(known)


def judged(peer: Peer, seed: int) -> list[report.Row]:
    rng, p = np.random.default_rng(seed), peer.flown()
    logs = [rotorpy_flights.fly(kind, LENGTH_S, rng, flown=p, share=peer.share) for kind in (*TRAINING, *HELD_OUT)]
    began = time.process_time()
    found = diagnose(logs[: len(TRAINING)], start(peer), held_out=logs[len(TRAINING) :], auto=True)
    cpu_s = time.process_time() - began
    print(f"{peer.name}: {found.verdict}")
    for one in found.families:
        print(f"  {one.sentence}")
    right = truth(p)
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
    print(f"  {name}: {found.value:.4g} +- {found.std:.2g}, RotorPy {value:.4g}{'' if right else ' WRONG'}")
    return right


def rows(*, seed: int) -> list[report.Row]:
    """Diagnoses of RotorPy's vehicles: families, sizes and CPU time."""
    return [row for peer in PEERS for row in judged(peer, seed)]


if __name__ == "__main__":
    report.main(rows, seed=11)
