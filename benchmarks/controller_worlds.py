"""Tracking where the world differs from the model: a demo-like path at 5 m/s in a body that shares no code.

    python benchmarks/controller_worlds.py                      # every world, observer on and off
    python benchmarks/controller_worlds.py --only wind --set observer=0
    python benchmarks/controller_worlds.py --picture docs/pictures/disturbances.svg

500 Hz, pose at 100 Hz and 10 ms old with its noise, the learned model compensated. Errors are true position less
set-point, over the path; a flight that gives its path up has none.
"""

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "firmware_bridge" / "failsafe"))

import harness
from scenario import FROM_START, TAKE_OFF, Command, Curve, Fault, Kind, Order, Scenario, State, land

CLEARANCE_M = 0.21
SPEED_M_S = 5.0
LEARNED = {"rotor_lag_s": 0.03}
"""What identification adds to the preset vehicle, which is the body's own."""


def path() -> Curve:
    """Slalom, climb, turn and return, at 5 m/s at most and 6 m/s2; septic fits of a smooth curve from rest to rest."""
    count, duration_s = 30, 17.0
    edges = np.linspace(0.0, duration_s, count + 1)
    nodes = np.cos(np.pi * (np.arange(40) + 0.5) / 40)
    coefficients = np.zeros((count, 4, 12))
    for i in range(count):
        t = edges[i] + 0.5 * (edges[i + 1] - edges[i]) * (nodes + 1)
        for axis, values in enumerate(_curve(_phase(t, duration_s))):
            fit = np.polynomial.chebyshev.cheb2poly(np.polynomial.chebyshev.chebfit(nodes, values, 11))
            coefficients[i, axis, : len(fit)] = fit
    durations = np.diff(np.round(edges * 1e6)).astype(np.uint32)
    return Curve(durations, coefficients.astype(np.float32), CLEARANCE_M)


def _phase(t: NDArray[np.float64], duration_s: float) -> NDArray[np.float64]:
    """Two rounds: from rest to a steady rate and back to rest."""
    rise_s = 3.0

    def ramp(u: NDArray[np.float64]) -> NDArray[np.float64]:
        v = np.clip(u, 0, 1)
        return 7 * v**5 - 14 * v**6 + 10 * v**7 - 2.5 * v**8 + np.clip(u - 1, 0, None)

    cruise_s = duration_s - rise_s
    return 4 * np.pi * rise_s / cruise_s * (ramp(t / rise_s) - ramp((t - cruise_s) / rise_s))


def _curve(phase: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """A figure of eight that climbs on one side and wavers in height, beginning at the hover point."""
    x, y = 4.2 * np.sin(phase), 1.8 * np.sin(2 * phase)
    return [x, y, 1.5 + 0.5 * np.sin(phase) ** 2 * np.cos(phase), np.zeros_like(phase)]


@dataclass(frozen=True, slots=True)
class World:
    """What differs from the model."""

    name: str
    bar_mm: float | None = None
    today_mm: str = ""
    """As the observer's issue found it on another path of the same kind."""
    wind_m_s: float = 0.0
    gusts_m_s: float = 0.0
    vehicle: Mapping[str, float | Sequence[float]] = field(default_factory=dict)
    rotors: tuple[float, ...] = (1.0, 1.0, 1.0, 1.0)
    """Thrust and torque of each over the model's."""
    late_s: float = 0.0
    """Pose later than its stamps say."""
    sensors: Mapping[str, float | Sequence[float]] = field(default_factory=dict)


OFF_CENTRE = {"centre_of_mass_m": (0.0014 + 0.005, 0.00018)}
WEAK = (1.0, 1.0, 0.85, 1.0)
VIBRATION = {"vibration_m_s2": 3.0, "gyro_noise_rad_s": 0.05}
WORLDS = (
    World("calm", 8, "7.7"),
    World("wind 3 m/s", 15, "80", wind_m_s=3.0),
    World("wind 5 m/s", 35, "gives up", wind_m_s=5.0),
    World("wind 7 m/s", 35, "gives up", wind_m_s=7.0),
    World("wind 9 m/s", 35, "gives up", wind_m_s=9.0),
    World("gusts 1 m/s", 15, "39", gusts_m_s=1.0),
    World("mass +5 %", 15, "38", vehicle={"mass_kg": 0.735}),
    World("thrust -5 %", 15, "50", rotors=(0.95,) * 4),
    World("thrust +5 %", 15, "49", rotors=(1.05,) * 4),
    World("thrust -10 %", None, "100", rotors=(0.9,) * 4),
    World("one rotor at 85 %", 15, "64", rotors=WEAK),
    World("centre of mass 5 mm off", 15, "52", vehicle=OFF_CENTRE),
    World("pose late by 10 ms, untold", 25, "37", late_s=0.01),
    World("pose late by 20 ms, untold", 25, "70", late_s=0.02),
    World("pose late by 40 ms, untold", 25, "134", late_s=0.04),
    World("accelerometer bias .2 m/s2", None, "", sensors={"accelerometer_bias_m_s2": (0.2, -0.2, 0.2)}),
    World("vibration 3 m/s2", None, "", sensors=VIBRATION),
    World(
        "all together", 22, "102",
        wind_m_s=3.0, gusts_m_s=1.0, rotors=WEAK, vehicle={"mass_kg": 0.735, **OFF_CENTRE}, sensors=VIBRATION,
    ),
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Flown:
    """What became of it."""

    mean_mm: float
    """nan: the path was given up."""
    worst_mm: float
    command_noise_rad_s: float
    """Deviation of the speed commands' differences from tick to tick, over the square root of two."""
    touch_m_s: float


def scenario(world: World, seed: int, parameters: Mapping[str, float]) -> Scenario:
    faults: list[Fault] = []
    if world.late_s:
        faults.append(Fault(Kind.STAMP_OFFSET, (world.late_s,), since=FROM_START))
    for rotor, health in enumerate(world.rotors):
        if health != 1.0:
            faults.append(Fault(Kind.ROTOR_HEALTH, (rotor, health), since=FROM_START))
    angle = 0.7 + seed
    wind = (world.wind_m_s * np.cos(angle), world.wind_m_s * np.sin(angle), 0.0)
    return Scenario(
        orders=(*TAKE_OFF, Order(Command.START, after_s=2.0), land(27.0)),
        faults=tuple(faults),
        path=path(),
        parameters={**LEARNED, **parameters},
        vehicle=world.vehicle,
        world={"wind_m_s": wind, "gust_std_m_s": world.gusts_m_s},
        sensors={"delay_s": 0.01 + world.late_s, **world.sensors},
        seed=seed,
        limit_s=60.0,
    )


def fly(world: World, seed: int, parameters: Mapping[str, float]) -> Flown:
    result = harness.load().fly(scenario(world, seed, parameters), trace_every=1)
    trace = result.trace
    on_path = trace["state"] == State.TRAJECTORY
    gap = np.stack([trace[axis] - trace[f"setpoint_{axis}"] for axis in "xyz"])[:, on_path]
    error = 1e3 * np.linalg.norm(gap, axis=0)
    finished = result.path_end_s > 16.99 and result.upload_reason == 0
    commands = np.stack([trace[f"command{i}"] for i in range(4)])[:, on_path]
    noise = float(np.diff(commands).std() / np.sqrt(2.0)) if on_path.any() else float("nan")
    return Flown(
        float(error.mean()) if finished else float("nan"),
        float(error.max()) if on_path.any() else float("nan"),
        noise,
        result.hardest_touchdown_m_s,
    )


def summary(world: World, seeds: int, parameters: Mapping[str, float]) -> Flown:
    flown = [fly(world, seed, parameters) for seed in range(1, seeds + 1)]
    return Flown(
        float(np.mean([f.mean_mm for f in flown])),
        max(f.worst_mm for f in flown),
        float(np.mean([f.command_noise_rad_s for f in flown])),
        max(f.touch_m_s for f in flown),
    )


def draw(path: Path, seeds: int) -> None:
    """Mean error of every world with the observer off and on; a path given up is a bar to the edge."""
    import matplotlib.pyplot as plt  # only here: a plain table needs none

    edge_mm, rows = 125.0, np.arange(len(WORLDS))
    figure, axes = plt.subplots(figsize=(8.0, 5.5), layout="constrained")
    for offset, name, colour, values in ((-0.2, "off", "0.7", {"observer": 0.0}), (0.2, "on", "tab:blue", {})):
        mean = [summary(world, seeds, values).mean_mm for world in WORLDS]
        axes.barh(rows + offset, np.nan_to_num(mean, nan=edge_mm), 0.4, color=colour, label=f"observer {name}")
        for row, value in zip(rows, mean, strict=True):
            text = "gives up" if np.isnan(value) else f"{value:.0f}"
            axes.text(
                min(np.nan_to_num(value, nan=edge_mm), edge_mm) + 1.0, row + offset, text, va="center", fontsize=7
            )
    axes.set(
        yticks=rows, yticklabels=[w.name for w in WORLDS], xlabel="mean tracking error, mm", xlim=(0, edge_mm + 15)
    )
    axes.invert_yaxis()
    axes.legend()
    figure.savefig(path, metadata={"Date": None})


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default="", help="worlds whose name has this in it")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help="a controller parameter")
    parser.add_argument("--picture", type=Path, metavar="SVG", help="draw observer off and on instead")
    args = parser.parse_args()
    if args.picture:
        draw(args.picture, args.seeds)
        return
    values = {name: float(value) for name, value in (entry.split("=") for entry in args.set)}
    print(f"{'':30}{'bar':>6}{'mean':>8}{'worst':>8}{'commands':>10}{'touch':>7}")
    for world in WORLDS:
        if args.only in world.name:
            f = summary(world, args.seeds, values)
            bar = "" if world.bar_mm is None else f"{world.bar_mm:.0f}"
            print(
                f"{world.name:30}{bar:>6}{f.mean_mm:8.1f}{f.worst_mm:8.1f}{f.command_noise_rad_s:10.1f}{f.touch_m_s:7.2f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
