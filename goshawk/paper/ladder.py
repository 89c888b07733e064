"""Their ladder on their vehicle, in simulation: what each compensation of the controller does for tracking.

The same C controller, step by step: PD with feed-forward, + drag, + thrust, on a level figure of eight (8.5 m/s,
10.8 m/s2) and on a vertical flight (3.1 m/s). Estimator noise, 10 ms of delay, gusts. The paper's figures were flown.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from firmware_bridge import Sensors, closed_loop
from firmware_bridge.controller import ThrustModel, Velocity, parameters_of
from flight import FloatArray, Progress, Trajectory, silent
from goshawk.paper import curves, theirs
from sysid.report import drawing
from vehicle import Vehicle, simulate

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PICTURE = "ladder.svg"
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
THEIRS = (
    Rung("PD + FF", _PAPER | {"thrust_model": ThrustModel.QUADRATIC, "drag_velocity": Velocity.NONE}),
    Rung("+ drag", _PAPER | {"thrust_model": ThrustModel.QUADRATIC}),
    Rung("+ drag + thrust", _AS_PAPER),
)
DELIVERED = Rung("as delivered", {})
"""What is flown by default."""
RUNGS = (
    *THEIRS,
    Rung("the same, drag 20 %, thrust 1 % off", _AS_PAPER, wrong=True),
    Rung("the same, motors of 20 ms", _AS_PAPER, motor_lag_s=0.02),
    Rung("+ air speed across the rotors", dict(_PAPER)),
    DELIVERED,
)
"""The paper's three, then three questions of ours, then what is flown by default."""


@dataclass(frozen=True, slots=True)
class Course:
    name: str
    title: str
    trajectory: Trajectory
    flown_cm: Mapping[str, float]
    """What the paper measured, by rung."""


Measured = dict[tuple[str, str], FloatArray]
"""(course, rung): tracking error in cm of each run."""


def _by_rung(flown_cm: tuple[float, ...]) -> dict[str, float]:
    return {rung.name: mean_cm for rung, mean_cm in zip(THEIRS, flown_cm, strict=True)}


@cache
def courses() -> tuple[Course, ...]:
    level = curves.figure_eight(speed_m_s=8.5, size_m=7.1, turns=2)  # 10.8 m/s2 at the most
    return (
        Course("level", "level figure of eight, 8.5 m/s, 10.8 m/s²", level, _by_rung(theirs.LEVEL_CM)),
        Course("vertical", "vertical, 3.1 m/s", curves.vertical(), _by_rung(theirs.VERTICAL_CM)),
    )


@cache
def general() -> Course:
    """All axes and yaw at once, of which one figure of theirs is known; not its controller, taken to be their last."""
    return Course("general", "all axes with yaw", curves.general(), {THEIRS[-1].name: theirs.GENERAL_CM})


def tracking_cm(path: Trajectory, rung: Rung, seed: int) -> float:
    """Mean distance from the set-point in one flight."""
    truth, rng = theirs.drone(), np.random.default_rng(seed)
    if rung.motor_lag_s is not None:
        truth = truth.with_value("motor_lag.rise_s", rung.motor_lag_s).with_value("motor_lag.fall_s", rung.motor_lag_s)
    configuration = parameters_of(_with_wrong_parameters(truth, seed) if rung.wrong else truth).with_values(
        **rung.overrides
    )
    plant = simulate.Plant(truth, below(path), rng=rng, wind=GUSTS, ground_m=0.0)
    flown = closed_loop.fly(plant, configuration, path, sensors=Sensors.typical(), seed=seed)
    return 100.0 * float(flown.error_m.mean())


def below(path: Trajectory) -> simulate.State:
    """At rest on the ground below a trajectory's start."""
    return simulate.State(path.position([0.0])[0] * [1.0, 1.0, 0.0])


def _with_wrong_parameters(truth: Vehicle, seed: int) -> Vehicle:
    rng = np.random.default_rng(1000 + seed)
    for name in ("rotor_drag_thrust.drag_s_m", "parasitic_drag.drag_xy_kg_m", "parasitic_drag.drag_z_kg_m"):
        truth = truth.with_value(name, truth.value(name) * rng.normal(1.0, 0.2))
    for name in ("thrust_bem.k1_n_s2", "thrust_bem.k2_n_s2_m"):
        truth = truth.with_value(name, truth.value(name) * rng.normal(1.0, 0.01))
    return truth


def measured(flown: Sequence[Course], rungs: Sequence[Rung], runs: int, progress: Progress = silent) -> Measured:
    """Fly every course on every rung, `runs` times each."""
    found: dict[tuple[str, str], FloatArray] = {}
    every = [(course, rung) for course in flown for rung in rungs]
    for i, (course, rung) in enumerate(every):
        errors_cm = []
        for seed in range(1, runs + 1):
            progress(f"fly the ladder: {course.name}, {rung.name}", (i + (seed - 1) / runs) / len(every))
            errors_cm.append(tracking_cm(course.trajectory, rung, seed))
        found[course.name, rung.name] = np.array(errors_cm)
    return found


def drawn(shown: Measured, rungs: Sequence[Rung]) -> "Figure":
    """Every run as a dot, their mean as a bar, the paper's figure as a diamond, where it has that rung."""
    look = drawing.look()
    figure, (panels,) = drawing.figure(1, 2, (10.0, 3.4))
    for axes, course in zip(panels, courses(), strict=True):
        for i, rung in enumerate(rungs):
            runs = shown[course.name, rung.name]
            flown = rung.name in course.flown_cm
            axes.bar(i, runs.mean(), width=0.62, color=look.colours[1] if flown else look.pale)
            axes.plot(i + np.linspace(-0.18, 0.18, len(runs)), runs, "o", ms=2.5, color=look.ink)
            ink = look.paper if flown else look.ink
            axes.annotate(f"{runs.mean():.1f}", (i, 0.0), (0, 5), textcoords="offset points", ha="center", color=ink)
        theirs_cm = [(i, course.flown_cm[rung.name]) for i, rung in enumerate(rungs) if rung.name in course.flown_cm]
        places = np.array(theirs_cm).reshape(-1, 2).T
        axes.plot(*places, "D", ms=7, mfc="none", mec=look.colours[0], mew=1.6, label="paper, flown")
        axes.plot([], [], "o", ms=2.5, color=look.ink, label="simulated runs")
        axes.set_xticks(range(len(rungs)), [_folded(r.name) for r in rungs], fontsize=7)
        drawing.plain(axes, course.title, "", "mean tracking error (cm)")
        axes.grid(False, axis="x")
        axes.legend(frameon=False)
    return figure


def _folded(name: str) -> str:
    """A label in lines of about ten characters."""
    lines = [""]
    for word in name.split():
        if len(lines[-1]) + len(word) > 11:
            lines.append("")
        lines[-1] = f"{lines[-1]} {word}".strip()
    return "\n".join(lines)
