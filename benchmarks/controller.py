"""The embedded controller: speed, exactness, tracking, and (with the ARM tools) what it costs on a Cortex-M4F."""

import importlib.util
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from types import ModuleType

import numpy as np
import report

import vehicle
from firmware_bridge import _controller, controller, wire
from vehicle import forces

ROOT = Path(__file__).resolve().parents[1]
LIBRARY = ROOT / "firmware_bridge" / "controller"
TEST = LIBRARY / "test" / "driver"
NOISE = {"noise": True, "delay_s": 0.01, "seed": 1}


def _module(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module
    spec.loader.exec_module(module)
    return module


FLIGHTS = _module(ROOT / "tests" / "firmware_bridge" / "conftest.py")


def _throughput() -> report.Row:
    """Controller ticks per CPU second on a trajectory of 12 coefficients, closed loop, nominal plant."""
    flight = FLIGHTS.Flight(step_us=1000)
    flight.start(FLIGHTS.figure_eight())
    p, n = flight.plant, 200_000
    state = np.concatenate([p.position_world_m, p.velocity_world_m_s, p.q_world_body, p.rate_body_rad_s])
    start = time.process_time()
    flight.controller.raw.run_nominal(state, flight.time_us, 100, n, 0)  # 20 s, all of it on the trajectory
    rate = n / (time.process_time() - start)
    return report.row("closed loop from Python, run(n)", rate / 1e6, "M ticks/s", ">= 1", rate >= 1e6)


def _mixer() -> list[report.Row]:
    """Inverse against eqs. (1)-(3) for random speeds and flows.

    Left out: saturated demands (counted), and windmilling rotors below 2 mN, for which eq. (2) has no inverse.
    """
    model = vehicle.example("rigter2019")
    rotors = model.without_effect("parasitic_drag")
    table = controller.vector(controller.parameters_of(model).parameters)
    rng, n = np.random.default_rng(0), 50_000
    speed = rng.uniform(300, 1750, (n, 4))
    air, rate = rng.uniform([-12, -12, -3], [12, 12, 6], (n, 3)), rng.uniform(-6, 6, (n, 3))
    force, torque = vehicle.wrench(rotors, air, rate, speed)
    wrench = np.column_stack([force[:, 2], torque]).astype(np.float32)
    rows, _ = _controller.mixer(table, wrench, air.astype(np.float32), rate.astype(np.float32))
    free = rows[:, 4] == 0
    pushing = forces.evaluate(rotors, air.T, rate.T, speed.T).thrust_n.min(axis=0) > 2e-3
    error = (np.abs(rows[:, :4] - speed).max(axis=1) / 1800.0)[free & pushing]
    return [
        report.row("mixer error, of full speed, worst", error.max(), "1", "<= 1e-5", error.max() <= 1e-5),
        report.row("mixer: feasible demands called saturated", 1.0 - free.mean(), "1"),
    ]


def _evaluator() -> list[report.Row]:
    worst = np.zeros(2)
    for trajectory in (FLIGHTS.figure_eight(), FLIGHTS.vertical(), FLIGHTS.general()):
        plan = wire.plan_from_trajectory(trajectory)
        times_us = np.linspace(0, trajectory.duration_s * 1e6, 20_001).astype(np.uint32)
        rows = _controller.evaluate(plan.durations_us, plan.coefficients, times_us)
        times_s = np.minimum(times_us * 1e-6, trajectory.duration_s)
        for order in (0, 1):
            truth = trajectory.position(times_s, order)
            worst[order] = max(worst[order], np.abs(rows[:, 3 * order : 3 * order + 3] - truth).max())
    return [
        report.row("float32 reference, position", worst[0] * 1e3, "mm", "<= 0.1", worst[0] <= 1e-4),
        report.row("float32 reference, velocity", worst[1] * 1e3, "mm/s", "<= 1", worst[1] <= 1e-3),
    ]


def _tracking() -> list[report.Row]:
    """Mean error with estimator noise and 10 ms delay; peers: without either, and the paper's flights."""
    rows = []
    for name, trajectory, bar_cm in (
        ("level 8.5 m/s", FLIGHTS.figure_eight(), 5.1),
        ("vertical 3.1 m/s", FLIGHTS.vertical(), 1.32),
        ("general, yaw 5.3 rad/s", FLIGHTS.general(), 4.9),
    ):
        noisy = FLIGHTS.Flight(**NOISE).fly(trajectory).mean() * 100
        clean = FLIGHTS.Flight().fly(trajectory).mean() * 100
        peers = {"no noise, no delay": clean, "Rigter et al., in flight": bar_cm}
        rows.append(report.row(f"tracking, {name}", noisy, "cm", f"<= {bar_cm}", noisy <= bar_cm, peers))
    return rows


def _ladder() -> list[report.Row]:
    """The paper's controller variants, in the same plant, on the level figure of eight."""
    rows = []
    for name, overrides in controller.VARIANTS.items():
        error = FLIGHTS.Flight(**NOISE, overrides=overrides).fly(FLIGHTS.figure_eight(turns=2))
        rows.append(report.row(f"ladder: {name}", error.mean() * 100, "cm"))
    return rows


FEATURES = {
    "plain thrust law": "parameters.thrust_model = 0.0f;",
    "no drag": "parameters.drag_velocity = 0.0f;",
    "air speed of the estimate": "parameters.airflow_velocity = 2.0f;",
    "rotor lag and battery": "parameters.rotor_lag_s = 0.03f; parameters.battery_gain_1_v = 0.02f;",
    "integrator": "parameters.ki_xy_1_s3 = 1.0f; parameters.ki_z_1_s3 = 1.0f;",
    "moments of flapping and damping": "parameters.flapping_kg_m = 1e-6f; parameters.damping_n_m_s[2] = 1e-3f;",
    "attitude after Lee et al.": "parameters.attitude_mode = 1.0f;",
}
"""What differs from the preset vehicle (exact inverse, drag of eqs. (4) and (5)), as assignments in C."""
SCRIPT = ("-DTICKS=3100", "-DSTEP_US=10000u", "-DPAINTED_WORDS=0u")
"""A flight from take-off to touchdown, with a pause, another time scale, demands beyond the rotors."""
ASSURE = _module(ROOT / "tools" / "assure.py")


def _target() -> list[report.Row]:
    """Instructions, stack, memory and flash on a Cortex-M4F, all of one build; nothing when the tools are missing.

    Instructions, not cycles: QEMU models no pipeline and no wait states. All functions: docs/firmware/cost.md.
    """
    if not (shutil.which("arm-none-eabi-gcc") and shutil.which("qemu-system-arm") and shutil.which("cmake")):
        print("no arm-none-eabi-gcc, qemu-system-arm or cmake: the Cortex-M rows are left out")
        return []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        library = ASSURE.vehicle_library(folder / "library")
        counts = ASSURE.cost(folder, library)
        flight = _instructions(folder, library, *SCRIPT)
        taken = ASSURE.flash(folder, library)
        size = ASSURE.size(folder)
        nominal = _on_path(folder, library, "-DADJUST=")
        features = {name: _on_path(folder, library, f"-DADJUST={code}") for name, code in FEATURES.items()}
        features["all of these"] = _on_path(folder, library, f"-DADJUST={' '.join(list(FEATURES.values())[2:])}")
    worst, stack = ASSURE.worst_tick(counts), max(needed for needed, _ in size.stack.values())
    memory, both = sum(size.ram.values()), taken["controller and link"]
    return [
        report.row(
            "worst tick in any situation", worst, "instructions", f"<= {ASSURE.TICK_BAR}", worst <= ASSURE.TICK_BAR
        ),
        report.row("nominal tick on a path, preset vehicle", nominal, "instructions"),
        report.row("mean tick in flight", flight.mean(), "instructions"),
        report.row("95 % of ticks at most", float(np.quantile(flight, 0.95)), "instructions"),
        report.row("stack of the deepest call", stack, "B", f"<= {ASSURE.STACK_BAR}", stack <= ASSURE.STACK_BAR),
        report.row(
            "memory besides trajectory slots", memory, "B", f"<= {ASSURE.MEMORY_BAR}", memory <= ASSURE.MEMORY_BAR
        ),
        report.row("flash without the link", taken["controller"] / 1024, "kB"),
        report.row("flash with the link", both / 1024, "kB", "<= 52", both <= ASSURE.FLASH_BAR),
        *(report.row(f"nominal tick on a path: {name}", count, "instructions") for name, count in features.items()),
        *(report.row(f"worst call, {name}", count, "instructions") for name, count in sorted(counts.items())),
    ]


TICKS = 100_000
"""Of the scripted mission, compared bit by bit."""


def _bit_equality() -> list[report.Row]:
    """The same bits from every compiler and level: CRC-32 of speeds, references and set-points of all ticks."""
    builds = [(c, level) for c in ("gcc", "clang", "clang-19") if shutil.which(c) for level in ("-O0", "-O2", "-O3")]
    results = set()
    with tempfile.TemporaryDirectory() as folder:
        for compiler, level in builds:
            program = Path(folder) / f"driver_{compiler}{level}"
            files = [TEST / "driver.c", TEST / "host_main.c", *ASSURE.sources()]
            _shell(compiler, "-std=c11", level, "-ffp-contract=off", "-fno-math-errno", *ASSURE.INCLUDES, *files, "-lm",
                   "-o", program)  # fmt: skip
            results.add(_shell(program, TICKS))
    return [
        report.row(
            f"different bits over {TICKS:,} ticks, {len(builds)} builds", len(results) - 1, "1", "0", len(results) == 1
        )
    ]


def _instructions(folder: Path, library: Path, *flags: str) -> np.ndarray:
    """Of every tick in flight."""
    counts = _module(TEST / "count_instructions.py").count(str(_link(folder, library, *flags)), "mps2-an386")
    flight = np.array(counts[2:])  # the first ticks rest on the ground
    return flight[flight > 0.5 * flight.max()]


def _on_path(folder: Path, library: Path, adjust: str) -> float:
    """Of a nominal tick on a path, of a vehicle adjusted like this."""
    return float(_instructions(folder, library, "-DTICKS=720", *SCRIPT[1:], adjust)[-2:].max())


def _link(folder: Path, library: Path, *flags: str) -> Path:
    """The scripted mission with the library as it is built for a vehicle. The driver that counts stays apart."""
    out = folder / "mission.elf"
    driver = [folder / f"{name}.o" for name in ("driver", "target_main")]
    for file in driver:
        include = f"-I{LIBRARY / 'include'}"
        _shell("arm-none-eabi-gcc", *ASSURE.ARM, "-std=c11", "-O2", *flags, include, "-c", TEST / f"{file.stem}.c",
               "-o", file)  # fmt: skip
    link = ["-nostartfiles", "--specs=nosys.specs", "-Wl,--gc-sections", "-T", TEST / "target.ld"]
    _shell("arm-none-eabi-gcc", *ASSURE.ARM, *driver, library, *link, "-o", out)
    return out


def _shell(*command: object) -> str:
    done = subprocess.run([str(word) for word in command], check=True, capture_output=True, text=True)
    return done.stdout or done.stderr


def rows() -> list[report.Row]:
    return [_throughput(), *_mixer(), *_evaluator(), *_tracking(), *_ladder(), *_bit_equality(), *_target()]


if __name__ == "__main__":
    report.main(rows)
