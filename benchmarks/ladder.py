"""The ladder of Rigter et al. (2019) on their vehicle, in simulation: what each compensation does for tracking.

The same C controller, step by step: PD with feed-forward, + drag, + thrust, on a level figure of eight (8.5 m/s,
10.8 m/s2) and on a vertical flight (3.1 m/s). Estimator noise, 10 ms of delay, gusts; several runs. The paper's figures
were flown. `--figure FILE` draws it.
"""

import argparse
import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import controller as curves
import numpy as np
import report

import vehicle
from firmware_bridge import Sensors, closed_loop
from firmware_bridge.controller import ThrustModel, Velocity, parameters_of
from flight import FloatArray, Trajectory
from sysid.report import drawing
from vehicle import Vehicle, simulate

SEEDS = range(1, 9)
GUSTS = simulate.Wind(gust_std_m_s=0.3)

_PAPER = {"airflow_velocity": 1.0, "attitude_mode": 1.0, "feed_torque": 0.0, "rotor_lag_s": 0.0}
"""Lee et al.'s attitude loop without feed-forward of torque, and no lead for the motors."""


@dataclass(frozen=True, slots=True)
class Rung:
    name: str
    overrides: dict[str, float]
    wrong: bool = False
    """Whether the controller's drag numbers are 20 % off and its thrust numbers 1 % (standard deviations)."""
    motor_lag_s: float | None = None
    """Of the vehicle that flies, if not the example's 30 ms, which are assumed: the paper gives none."""


_AS_PAPER = _PAPER | {"thrust_model": ThrustModel.BEM_AXIAL}
RUNGS = (
    Rung("PD + FF", _PAPER | {"thrust_model": ThrustModel.QUADRATIC, "drag_velocity": Velocity.NONE}),
    Rung("+ drag", _PAPER | {"thrust_model": ThrustModel.QUADRATIC}),
    Rung("+ drag + thrust", _AS_PAPER),
    Rung("the same, drag 20 %, thrust 1 % off", _AS_PAPER, wrong=True),
    Rung("the same, motors of 20 ms", _AS_PAPER, motor_lag_s=0.02),
    Rung("+ air speed across the rotors", dict(_PAPER)),
    Rung("as delivered", {}),
)
"""The paper's three, then three questions of ours, then what is flown by default."""


@dataclass(frozen=True, slots=True)
class Course:
    name: str
    trajectory: Trajectory
    flown_cm: tuple[float, float, float]
    """What the paper measured on its three rungs."""


@cache
def courses() -> tuple[Course, ...]:
    level = curves.FLIGHTS.figure_eight(speed_m_s=8.5, size_m=7.1, turns=2)  # 10.8 m/s2 at the most
    return Course("level", level, (10.5, 6.5, 5.1)), Course("vertical", curves.FLIGHTS.vertical(), (2.76, 1.84, 1.32))


def tracking_cm(course: Course, rung: Rung, seed: int) -> float:
    """Mean distance from the set-point in one flight."""
    truth, rng = vehicle.example("rigter2019"), np.random.default_rng(seed)
    if rung.motor_lag_s is not None:
        truth = truth.with_value("motor_lag.rise_s", rung.motor_lag_s).with_value("motor_lag.fall_s", rung.motor_lag_s)
    configuration = parameters_of(_with_wrong_parameters(truth, seed) if rung.wrong else truth).with_values(
        **rung.overrides
    )
    start = simulate.State(course.trajectory.position([0.0])[0] * [1.0, 1.0, 0.0])
    plant = simulate.Plant(truth, start, rng=rng, wind=GUSTS, ground_m=0.0)
    flown = closed_loop.fly(plant, configuration, course.trajectory, sensors=Sensors.typical(), seed=seed)
    return 100.0 * float(flown.error_m.mean())


def _with_wrong_parameters(truth: Vehicle, seed: int) -> Vehicle:
    rng = np.random.default_rng(1000 + seed)
    for name in ("rotor_drag_thrust.drag_s_m", "parasitic_drag.drag_xy_kg_m", "parasitic_drag.drag_z_kg_m"):
        truth = truth.with_value(name, truth.value(name) * rng.normal(1.0, 0.2))
    for name in ("thrust_bem.k1_n_s2", "thrust_bem.k2_n_s2_m"):
        truth = truth.with_value(name, truth.value(name) * rng.normal(1.0, 0.01))
    return truth


@cache
def measured() -> dict[tuple[str, str], FloatArray]:
    """(course, rung): tracking error in cm of each run."""
    return {
        (course.name, rung.name): np.array([tracking_cm(course, rung, seed) for seed in SEEDS])
        for course in courses()
        for rung in RUNGS
    }


def rows() -> list[report.Row]:
    found = []
    for course in courses():
        for i, rung in enumerate(RUNGS):
            runs = measured()[course.name, rung.name]
            peers = {"std of the runs": float(runs.std(ddof=1))}
            bar = course.flown_cm[i] if i < 3 else None
            if bar is not None:
                peers["Rigter et al., in flight"] = bar
            last = f"<= {bar}" if i == 2 else None
            good = bool(runs.mean() <= bar) if i == 2 and bar is not None else None
            found.append(report.row(f"{course.name}: {rung.name}", runs.mean(), "cm", last, good, peers))
    return found


def draw(path: Path) -> None:
    """Every run as a dot, their mean as a bar, the paper's figure as a diamond."""
    look = drawing.look()
    figure, (panels,) = drawing.figure(1, 2, (10.0, 3.4))
    titles = {"level": "level figure of eight, 8.5 m/s, 10.8 m/s²", "vertical": "vertical, 3.1 m/s"}
    for axes, course in zip(panels, courses(), strict=True):
        for i, rung in enumerate(RUNGS):
            runs = measured()[course.name, rung.name]
            axes.bar(i, runs.mean(), width=0.62, color=look.colours[1] if i < 3 else look.pale)
            axes.plot(i + np.linspace(-0.18, 0.18, len(runs)), runs, "o", ms=2.5, color=look.ink)
            ink = look.paper if i < 3 else look.ink
            axes.annotate(f"{runs.mean():.1f}", (i, 0.0), (0, 5), textcoords="offset points", ha="center", color=ink)
        axes.plot(range(3), course.flown_cm, "D", ms=7, mfc="none", mec=look.colours[0], mew=1.6, label="paper, flown")
        axes.plot([], [], "o", ms=2.5, color=look.ink, label="simulated runs")
        axes.set_xticks(range(len(RUNGS)), [_folded(r.name) for r in RUNGS], fontsize=7)
        drawing.plain(axes, titles[course.name], "", "mean tracking error (cm)")
        axes.grid(False, axis="x")
        axes.legend(frameon=False)
    path.parent.mkdir(parents=True, exist_ok=True)
    drawing.written(figure, path)


def _folded(name: str) -> str:
    """A label in lines of about ten characters."""
    lines = [""]
    for word in name.split():
        if len(lines[-1]) + len(word) > 11:
            lines.append("")
        lines[-1] = f"{lines[-1]} {word}".strip()
    return "\n".join(lines)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(add_help=False)
    parser.add_argument("--figure", type=Path, metavar="FILE")
    chosen, sys.argv[1:] = parser.parse_known_args()
    report.main(rows)
    if chosen.figure:
        draw(chosen.figure)
