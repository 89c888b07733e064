"""The vehicle model: simulation against real time, wrench and derivative throughput, agreement with RotorPy.

python benchmarks/vehicle_model.py [--json FILE]
"""

from dataclasses import replace

import numpy as np
import report

import vehicle
from flight import Trajectory
from vehicle import dynamics, forces, manoeuvres, simulate

SAMPLES = 20_000


def rows() -> list[report.Row]:
    v = vehicle.example("rigter2019")
    return [*_simulation(v), *_throughput(v), *_planning(v), *_agreement()]


def _simulation(v: vehicle.Vehicle) -> list[report.Row]:
    plant = simulate.Plant(v)
    command = plant.rotor_speed_rad_s
    seconds = report.cpu_seconds(lambda: [plant.step(command, 1e-3) for _ in range(2000)])
    factor = 2.0 / seconds
    fleet = simulate.Fleet(v, [simulate.hovering(v, np.zeros(3))] * 500)
    fleet_seconds = report.cpu_seconds(lambda: [fleet.step(command, 5e-3) for _ in range(20)])
    own = simulate.Plant(v.with_effect(_own_effect(), drag_kg=3e-5))
    own_seconds = report.cpu_seconds(lambda: [own.step(command, 1e-3) for _ in range(100)])
    return [
        report.row(
            "one vehicle at 1 kHz, stepped from Python", factor, "x real time", ">= 20", factor >= 20, _rotorpy_speed()
        ),
        report.row("with an effect of the user's own, in Python", 0.1 / own_seconds, "x real time"),
        report.row("500 vehicles at once, 1 kHz", 500 * 0.1 / fleet_seconds, "vehicle s per CPU s"),
    ]


def _own_effect() -> str:
    """Hub drag of the catalogue under another name: it has no compiled form, so the kernel calls it back."""
    effect = replace(vehicle.effects.find("rotor_drag_speed"), name="own_drag", number=0)
    return vehicle.effects.register(effect).name


def _throughput(v: vehicle.Vehicle) -> list[report.Row]:
    rng = np.random.default_rng(0)
    velocity, rate = rng.normal(0, 3, (SAMPLES, 3)), rng.normal(0, 2, (SAMPLES, 3))
    speed = rng.uniform(700, 1200, (SAMPLES, 4))
    names = [p for p in v.parameters if not p.startswith(("pose_sensor", "motor_lag"))]
    motion = np.hstack([velocity, rate, speed])
    force, torque = vehicle.wrench(v, velocity, rate, speed)
    each = 1e6 / SAMPLES
    wrench = each * report.cpu_seconds(lambda: vehicle.wrench(v, velocity, rate, speed))
    plain = each * report.cpu_seconds(lambda: forces.wrench_numpy(v, velocity, rate, speed))
    slopes = each * report.cpu_seconds(
        lambda: vehicle.acceleration_jacobian(v, velocity, rate, speed, parameters=names)
    )
    complex_steps = each * report.cpu_seconds(
        lambda: dynamics._complex_steps(v, motion, names, forces.NOTHING_KNOWN, True), repeats=1
    )
    inverse = each * report.cpu_seconds(lambda: vehicle.invert.rotor_speeds(v, force[:, 2], torque, velocity, rate))
    return [
        report.row("wrench", wrench, "us each", peers={"NumPy": plain} | _rotorpy_wrench()),
        report.row(
            f"accelerations and slopes by {10 + len(names)}", slopes, "us each", peers={"complex steps": complex_steps}
        ),
        report.row("rotor speeds from thrust and torque", inverse, "us each"),
    ]


def _planning(v: vehicle.Vehicle) -> list[report.Row]:
    path: Trajectory = manoeuvres.make("oblique")
    times = np.linspace(0.0, path.duration_s, 10_000)
    seconds = report.cpu_seconds(lambda: vehicle.flatness.state(v, path, times), repeats=2)
    return [report.row("flatness with drag, 10,000 instants", seconds, "s")]


def _rotorpy_pair():
    try:
        from rotorpy.vehicles.hummingbird_params import quad_params
        from rotorpy.vehicles.multirotor import Multirotor
    except ImportError:
        return None
    return vehicle.example("hummingbird"), Multirotor(dict(quad_params), aero=True)


def _rotorpy_speed() -> dict[str, float]:
    pair = _rotorpy_pair()
    if pair is None:
        return {}
    _, theirs = pair
    state = {**theirs.initial_state, "wind": np.zeros(3)}
    control = {"cmd_motor_speeds": np.full(4, 469.0)}

    def fly() -> None:
        now = state
        for _ in range(100):
            now = theirs.step(now, control, 1e-3)

    theirs.control_abstraction = "cmd_motor_speeds"
    return {"RotorPy": 0.1 / report.cpu_seconds(fly)}


def _rotorpy_wrench() -> dict[str, float]:
    pair = _rotorpy_pair()
    if pair is None:
        return {}
    _, theirs = pair
    rate, speed, velocity = np.zeros(3), np.full(4, 469.0), np.array([3.0, 1.0, 0.0])
    seconds = report.cpu_seconds(lambda: [theirs.compute_body_wrench(rate, speed, velocity) for _ in range(500)])
    return {"RotorPy": 1e6 * seconds / 500}


def _agreement() -> list[report.Row]:
    pair = _rotorpy_pair()
    if pair is None:
        return []
    ours, theirs = pair
    rng, worst = np.random.default_rng(0), 0.0
    for _ in range(200):
        velocity, rate, speed = rng.normal(0, 6, 3), rng.normal(0, 5, 3), rng.uniform(0, 1500, 4)
        force, torque = theirs.compute_body_wrench(rate, speed[[0, 3, 2, 1]], velocity)
        our_force, our_torque = vehicle.wrench(ours, velocity, rate, speed)
        worst = max(worst, np.abs(our_force[0] - force).max(), np.abs(our_torque[0] - torque).max())
    return [report.row("largest difference to RotorPy's wrench", worst, "N, N m", "<= 1e-12", worst <= 1e-12)]


if __name__ == "__main__":
    report.main(rows)
