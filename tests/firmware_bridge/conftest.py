"""A straight curve and a closed loop: the C controller round the SITL vehicle's plant. The C compiled."""

import shutil
import subprocess
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import vehicle
from firmware_bridge import controller as ctl
from flight import FloatArray, Trajectory, rotations
from goshawk.paper.curves import figure_eight, fitted, general, loop, vertical
from vehicle import simulate

LIBRARY = Path(__file__).parents[2] / "firmware_bridge" / "controller"
INCLUDES = (f"-I{LIBRARY / 'include'}", "-isystem", str(LIBRARY.parent / "dialect" / "generated"))
SANITIZERS = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all")


def straight(to_m: tuple[float, float, float] = (3.0, 0.0, 1.5), duration_s: float = 3.0) -> Trajectory:
    """From (0, 0, 1.5) to a point along a septic, from rest to rest."""
    start = np.array([0.0, 0.0, 1.5])
    coefficients = np.zeros((1, 4, 8))
    for axis in range(3):
        way = to_m[axis] - start[axis]
        coefficients[0, axis, 0] = start[axis]
        coefficients[0, axis, 4:] = way * np.array([35.0, -84.0, 70.0, -20.0]) / duration_s ** np.arange(4, 8)
    return Trajectory(np.array([duration_s]), coefficients)


@dataclass
class Flight:
    """The controller in a loop with a plant; `log` gets one dictionary per tick."""

    truth: vehicle.Vehicle = field(default_factory=lambda: vehicle.example("rigter2019"))
    believed: vehicle.Vehicle | None = None
    overrides: dict[str, float] = field(default_factory=dict)
    """The observer is off unless asked for: it hides what most of these flights measure."""
    step_us: int = 2000
    noise: bool = False
    delay_s: float = 0.0
    seed: int = 0
    start_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    battery: simulate.Battery | None = None
    accelerometer: bool = True

    def __post_init__(self) -> None:
        values = {"observer": 0.0, **self.overrides}
        configuration = ctl.parameters_of(self.believed or self.truth).with_values(**values)
        self.controller = ctl.Controller(configuration)
        start = simulate.State(np.array(self.start_m))
        self.plant = simulate.Plant(self.truth, start, ground_m=self.start_m[2], battery=self.battery)
        self.rng = np.random.default_rng(self.seed)
        self.time_us = 0
        self.past: list[tuple[int, FloatArray]] = []
        self.log: list[dict] = []
        self.gyro_survives = False
        self.spoil: Callable[[FloatArray, int], tuple[FloatArray, int, int]] | None = None
        """Called with (estimate, its time); returns (estimate, position time, attitude time)."""

    def estimate(self) -> tuple[int, FloatArray]:
        p = self.plant
        row = np.concatenate([p.position_world_m, p.velocity_world_m_s, p.q_world_body, p.rate_body_rad_s])
        if self.noise:
            row[:3] += self.rng.normal(0, 0.003, 3)
            row[3:6] += self.rng.normal(0, 0.02, 3)
            row[6:10] = rotations.multiply(row[6:10], rotations.exp(self.rng.normal(0, 0.002, 3)))
            row[10:] += self.rng.normal(0, 0.02, 3)
        self.past.append((self.time_us, row))
        if len(self.past) > 1 + round(self.delay_s * 1e6 / self.step_us):
            self.past.pop(0)
        return self.past[0]

    def tick(self) -> dict:
        at, row = self.estimate()
        position_at = attitude_at = at
        if self.spoil is not None:
            row, position_at, attitude_at = self.spoil(row.copy(), at)
        speed = self.controller.tick(
            self.time_us,
            row,
            position_time_us=position_at,
            attitude_time_us=attitude_at,
            rate_time_us=self.time_us if self.gyro_survives else None,
            battery_v=self.plant.battery_v,
            specific_force_body_m_s2=self.plant.specific_force_body_m_s2 if self.accelerometer else None,
        )
        assert np.isfinite(speed).all()
        self.plant.step(speed, self.step_us * 1e-6)
        self.time_us += self.step_us
        telemetry = self.controller.telemetry
        position = self.plant.position_world_m
        telemetry["error_m"] = float(np.linalg.norm(telemetry["setpoint"]["position_world_m"] - position))
        telemetry["true_position_m"] = position
        self.log.append(telemetry)
        return telemetry

    def run(self, seconds: float, until: ctl.State | None = None) -> bool:
        """Returns whether the state `until` was reached."""
        ticks = range(int(seconds * 1e6 / self.step_us))
        return any(self.tick()["state"] == until for _ in ticks)

    def hover(self, height_m: float = 1.5) -> None:
        self.tick()
        self.controller.command(ctl.Command.ARM)
        self.controller.command(ctl.Command.TAKE_OFF, height_m)
        assert self.run(10.0 + 3.0 * height_m, ctl.State.HOLD)
        self.run(1.0)

    def start(self, trajectory: Trajectory, **options) -> None:
        """Hover, upload, start, and go on until the trajectory itself begins."""
        self.hover()
        self.controller.upload(trajectory, **options)
        self.controller.command(ctl.Command.START)
        assert self.run(10.0, ctl.State.TRAJECTORY)

    def fly(self, trajectory: Trajectory) -> FloatArray:
        """Tracking error (n,) in metres at every tick of the trajectory."""
        self.start(trajectory)
        first = len(self.log)
        assert self.run(trajectory.duration_s + 1.0, ctl.State.HOLD)
        return np.array([row["error_m"] for row in self.log[first:] if row["state"] == ctl.State.TRAJECTORY])


@pytest.fixture(scope="session")
def curves() -> SimpleNamespace:
    """`figure_eight`, `vertical`, `general`, `straight`, `fitted`, `loop`."""
    return SimpleNamespace(
        figure_eight=figure_eight, vertical=vertical, general=general, straight=straight, fitted=fitted, loop=loop
    )


@pytest.fixture
def flight_of() -> type[Flight]:
    """The closed loop; call it with options."""
    return Flight


@dataclass(frozen=True)
class Compiled:
    """The controller's objects, and the flags that sources to be linked with them are compiled with."""

    flags: tuple[str, ...]
    objects: list[Path]


@pytest.fixture(scope="session")
def debug_build(made_once) -> Compiled:
    """Of the library, with sanitizers where the compiler has them: once for all tests of it."""
    if shutil.which("gcc") is None:
        pytest.skip("gcc is not installed")

    def compile_all(folder: Path) -> None:
        sources = sorted((LIBRARY / "src").rglob("*.c"))
        subprocess.run(["gcc", *flags, *INCLUDES, "-c", *sources], cwd=folder, check=True)

    probe = ["gcc", *SANITIZERS, "-x", "c", "-", "-o", "/dev/null"]
    has_sanitizers = subprocess.run(probe, input=b"int main(void) { return 0; }", capture_output=True).returncode == 0
    flags = ("-std=c11", "-g", *(SANITIZERS if has_sanitizers else ()), "-fno-math-errno", "-DTC_MAX_SEGMENTS=32")
    return Compiled(flags, sorted(made_once("debug_build", compile_all).glob("*.o")))


@pytest.fixture(scope="session")
def sanitized(debug_build: Compiled) -> Compiled:
    if not set(SANITIZERS) <= set(debug_build.flags):
        pytest.skip("this gcc has no address and undefined-behaviour sanitizers")
    return debug_build
