"""Public real flights, checked and fitted: `python benchmarks/real_logs.py SET`.

SET is nanodrone, torque or staircase (of the nano-drone flights), motor_lag, or controller.
The logs are not part of this repository; `--data` is the folder that holds the sets. Each set has a page in docs
(`real_logs_*.md`) with these numbers and what to make of them.
"""

import argparse
import csv
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import nanodrone_staircase
import nanodrone_torque
import numpy as np
from scipy.interpolate import CubicSpline

import sysid
import vehicle
from flight import FlightError, FlightLog, rotations
from sysid.logs.checks import gyro_clock
from sysid.logs.checks.clocks import rotors_after_gyro
from sysid.logs.checks.motion import kinematics

MAPS = Path(__file__).parent / "column_maps"
SPIN = np.array([1.0, -1.0, 1.0, -1.0])


def small_quadrotor(name: str, arm_m: float, mass_kg: float, thrust_n_s2: float, torque: float, **values: float):
    """A Crazyflie: rotors front right, rear right, rear left, front left; thrust by the square of rotor speed."""
    hubs = arm_m * np.array([[1, -1, 0], [-1, -1, 0], [-1, 1, 0], [1, 1, 0]])
    model = vehicle.example("hummingbird")
    for effect in model.effects:
        if effect not in ("thrust_quadratic", "rotor_yaw_torque", "motor_lag"):
            model = model.without_effect(effect)
    model = replace(model, name=name, hub_body_m=hubs, spin=SPIN)
    values |= {"mass_kg": mass_kg, "rotor_radius_m": 0.023}
    for parameter, value in values.items():
        model = model.with_value(parameter, value)
    model = model.with_value("thrust_quadratic.k_n_s2", thrust_n_s2)
    return model.with_value("rotor_yaw_torque.torque_n_m_s2", torque * thrust_n_s2)


def with_lag(model: vehicle.Vehicle, lag_s: float) -> vehicle.Vehicle:
    return model.with_value("motor_lag.rise_s", lag_s).with_value("motor_lag.fall_s", lag_s)


def show(result: sysid.Identification, seconds: float) -> None:
    state = "converged" if result.converged else "NOT converged"
    print(f"  {state} in {len(result.solution.record)} steps, {seconds:.1f} CPU s")
    for e in result.parameters:
        if e.status == "free" and not e.name.startswith("pose_sensor"):
            print(f"  {e.name:32s} {e.value:11.4g} +- {e.std_robust:8.2g} (plain {e.std:8.2g}) {e.unit}")


def fit(logs: Sequence[FlightLog], model: vehicle.Vehicle, options: sysid.Options) -> sysid.Identification:
    begun = time.process_time()
    result = sysid.identify(logs, model, options)
    show(result, time.process_time() - begun)
    return result


def nanodrone(folder: Path, chosen: argparse.Namespace) -> None:
    """Measured rotor speed: thrust, inflow, rotor drag; battery sag from command to speed."""
    logs, model = nanodrone_logs(folder), nanodrone_model()
    print("findings of the checks, with the spins as the source prints them first")
    for log in logs.values():
        found = sysid.check_log(log, replace(model, spin=-SPIN)).findings
        print(f"  {log.metadata['name']}: " + ("; ".join(f.sentence for f in found) or "nothing"))
    print("streams brought to the attitude's clock: rotor speed after the gyro, gyro after the attitude (ms)")
    one_clock = {name: aligned(log, model) for name, log in logs.items()}
    for name, these in (("as logged", logs), ("on one clock", one_clock)):
        print(f"three random flights, {name}")
        fit(_named(these, "random"), with_drag(model), NANODRONE)
    fitted = {}
    for name, candidate in {
        "base": model,
        "+ inflow": model.with_effect("inflow_linear", inflow_kg=0.0),
        "+ inflow + rotor drag": with_drag(model),
    }.items():
        print(f"three random flights, on one clock, {name}")
        fitted[name] = fit(_named(one_clock, "random"), candidate, NANODRONE).vehicle
    others = _named(one_clock, "square", "multisine_20251017_run2")
    compared = sysid.compare(others, fitted, sysid.Options(gaps="split"))
    print("prediction on the flights not used, after 0.1, 0.2, 0.5, 1 s")
    for name, errors in compared.errors.items():
        for quantity in ("position", "velocity", "attitude"):
            print(f"  {name:24s} {quantity:9s} " + " ".join(f"{e:8.4f}" for e in errors[quantity]))
    _battery_sag(list(logs.values()))


NANODRONE = sysid.Options(gaps="split", held=("inertia_zz_kg_m2",), max_iterations=60)


def nanodrone_logs(folder: Path) -> dict[str, FlightLog]:
    return {p.name.split(".")[0]: sysid.read_log(p, MAPS / "nanodrone.toml") for p in sorted(folder.glob("*.csv.gz"))}


def nanodrone_model() -> vehicle.Vehicle:
    sizes = dict.fromkeys(("inertia_xx_kg_m2", "inertia_yy_kg_m2"), 2.3951e-5) | {"inertia_zz_kg_m2": 3.2e-5}
    model = small_quadrotor("cf21bl", 0.0353, 0.045, 3.72e-8, 3e-10 / 3.72e-8, **sizes).without_effect("motor_lag")
    return model.with_effect("centre_of_mass", x_m=0.0, y_m=0.0)


def with_drag(model: vehicle.Vehicle) -> vehicle.Vehicle:
    return model.with_effect("inflow_linear", inflow_kg=0.0).with_effect("rotor_drag_speed", drag_kg=0.0)


def _named(logs: Mapping[str, FlightLog], *beginnings: str) -> list[FlightLog]:
    return [log for name, log in logs.items() if name.startswith(beginnings)]


def aligned(log: FlightLog, model: vehicle.Vehicle) -> FlightLog:
    """The log with gyro and rotor speed on the clock of the attitude, without jumps of the position, ends dropped."""
    return without_jumps(on_one_clock(log, model))


def on_one_clock(log: FlightLog, model: vehicle.Vehicle) -> FlightLog:
    """The log with gyro and rotor speed on the clock of the attitude, ends dropped."""
    motion = kinematics(log)
    assert motion is not None
    # instrumental variables (gyro_clock.after_attitude) are inconclusive on five of these flights
    gyro_s = gyro_clock.compared_plainly(log, motion).delay_s
    rotors_s = rotors_after_gyro(log, motion, model).delay_s
    print(f"  {log.metadata['name']}: {1000.0 * rotors_s:+.1f}, {1000.0 * gyro_s:+.1f}")
    columns = dict(log.columns)
    for stream, late_s in (("rate_body_", gyro_s), ("rotor_speed_", gyro_s + rotors_s)):
        at_s = np.clip(log.time_s + late_s, log.time_s[0], log.time_s[-1])
        columns |= {n: CubicSpline(log.time_s, v)(at_s) for n, v in columns.items() if n.startswith(stream)}
    return FlightLog(columns, log.metadata).slice(log.time_s[0] + 0.1, log.time_s[-1] - 0.1)


def without_jumps(log: FlightLog) -> FlightLog:
    """The log without its pose where the position jumps."""
    pose = {n: v for n, v in log.columns.items() if n.startswith(("position_", "q_"))}
    cut = {n: np.where(_near_jump(log), np.nan, v) for n, v in pose.items()}
    return FlightLog({**log.columns, **cut}, log.metadata)


def _near_jump(log: FlightLog) -> np.ndarray:
    """Rows within half a second of where the position leaves its course by 5 cm from one sample to the next."""
    off = np.linalg.norm(np.diff(log.vector("position_world_m"), 2, axis=0), axis=1)
    at_s = log.time_s[1:-1][off > 0.05]
    return np.abs(log.time_s[:, None] - at_s).min(axis=1, initial=np.inf) < 0.5


def staircase(folder: Path, chosen: argparse.Namespace) -> None:
    """Every flight of the nano-drone left out in turn, the model diagnosed from the others evaluated on it."""
    model = nanodrone_model()
    logs = {name: aligned(log, model) for name, log in nanodrone_logs(folder).items()}
    nanodrone_staircase.run(logs, chosen.logs, model, NANODRONE, chosen.out, chosen.same_kind)


def torque(folder: Path, chosen: argparse.Namespace) -> None:
    """What balances the rotors' torque: shares explained on kinds of flight held out, then fits with that moment."""
    model = nanodrone_model()
    logs = {name: aligned(log, model) for name, log in nanodrone_logs(folder).items()}
    nanodrone_torque.run(logs, model)
    randoms = [nanodrone_torque.flown(log) for log in _named(logs, "random")]
    for name, candidate in {
        "without": with_drag(model),
        "with": with_drag(model).with_effect("wake_skew_moment"),
    }.items():
        print(f"three random flights, on one clock, {name} the moment of the wakes")
        fit(randoms, candidate, NANODRONE)
    print("one random flight, the source's inertias held, white disturbances")
    held = (*NANODRONE.held, "inertia_xx_kg_m2", "inertia_yy_kg_m2")
    fit(randoms[:1], model, replace(NANODRONE, held=held, gusts="white"))


def _battery_sag(logs: list[FlightLog]) -> None:
    """Mean rotor speed on mean command, without and with a slope that follows the voltage."""
    speed = np.concatenate([log.vector("rotor_speed_rad_s").mean(axis=1) for log in logs])
    command = np.concatenate([_mean_command(log) for log in logs])
    volt = np.concatenate([log.columns["battery_v"] for log in logs])
    rows = np.isfinite(speed + command + volt) & (command > 0.3)
    speed, command, volt = speed[rows], command[rows], volt[rows]
    columns = np.stack([np.ones_like(command), command, command * (volt - 3.7)], axis=1)
    found = np.linalg.lstsq(columns, speed, rcond=None)[0]
    without = speed - columns[:, :2] @ np.linalg.lstsq(columns[:, :2], speed, rcond=None)[0]
    left = speed - columns @ found
    print(
        f"battery {volt.min():.2f} to {volt.max():.2f} V: speed per command changes {found[2] / found[1]:.2%} per volt;"
    )
    print(f"  scatter {without.std():.1f} rad/s without that term, {left.std():.1f} with it")


def _mean_command(log: FlightLog) -> np.ndarray:
    return np.mean([log.columns[f"motor_command_{i}_ratio"] for i in range(4)], axis=0)


def motor_lag(folder: Path, chosen: argparse.Namespace) -> None:
    """IMU and commands only: motor lag, thrust per command; twice, for the two ways to read a command."""
    raw = [sysid.read_log(p, MAPS / "motor_lag.toml") for p in sorted(folder.glob("*.csv.gz"))]
    sizes = {"inertia_xx_kg_m2": 1.5e-5, "inertia_yy_kg_m2": 1.5e-5, "inertia_zz_kg_m2": 1.955e-5}
    for name, offset in (
        ("speed = 380.8 + 0.0408 command (Foerster 2015)", 0.0),
        ("speed = 0.0408 command", -380.8359),
    ):
        logs = [piece for log in raw for piece in _in_flight(_shifted(log, offset))]
        hover = np.median(np.concatenate([log.vector("rotor_speed_command_rad_s") for log in logs]))
        model = small_quadrotor("cf2", 0.028, 0.027, 0.027 * 9.80665 / 4.0 / hover**2, 0.006, **sizes)
        model = with_lag(model, 0.03).with_effect("centre_of_mass", x_m=0.0, y_m=0.0)
        for rate_hz in (200.0, 500.0):
            print(f"{name}; {len(logs)} stretches of flight, {rate_hz:g} nodes a second")
            fit(logs, model, sysid.Options(held=("inertia_zz_kg_m2",), node_rate_hz=rate_hz, gaps="split"))


def _shifted(log: FlightLog, offset: float) -> FlightLog:
    commands = {n: v + offset for n, v in log.columns.items() if n.startswith("rotor_speed_command")}
    return FlightLog({**log.columns, **commands}, log.metadata)


def _in_flight(log: FlightLog) -> list[FlightLog]:
    """Stretches of 6 s or more with every command above 12 %, ends dropped."""
    command = log.vector("rotor_speed_command_rad_s")
    floor = command.min() + 0.12 * 65535 * 0.04076521
    flying = (command > floor).all(axis=1).astype(int)
    edges = np.flatnonzero(np.diff(flying, prepend=0, append=0))
    times = [(log.time_s[a], log.time_s[b - 1]) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    return [log.slice(float(a) + 1.5, float(b) - 1.0) for a, b in times if b - a > 6.0]


def controller(folder: Path, chosen: argparse.Namespace) -> None:
    """Commanded wrench: the gain between commanded and true thrust, one fit a flight; and as a plain ratio of means."""
    arm, k = 0.046 / np.sqrt(2.0), 2.5e-8
    sizes = {"inertia_xx_kg_m2": 1.66e-5, "inertia_yy_kg_m2": 1.67e-5, "inertia_zz_kg_m2": 2.93e-5}
    with open(folder / "index.csv", newline="") as file:
        index = [row for row in csv.DictReader(file) if not chosen.logs or row["log"] in chosen.logs]
    groups: dict[str, list[tuple[float, float]]] = {}
    held = ("inertia_zz_kg_m2", "motor_lag.*", "rotor_yaw_torque.torque_n_m_s2")
    for row in index:
        mass_kg, payload = float(row["mass_kg"]), row["has_acc"] == "True"
        model = with_lag(small_quadrotor("cf", arm, mass_kg, k, 0.006, **sizes), 0.05)
        names = tuple(n for n in model.parameters for h in held if n == h or (h[-1] == "*" and n.startswith(h[:-1])))
        options = sysid.Options(gaps="split", pose_sensor=False, max_iterations=60, held=names)
        try:
            log = _equivalent_speeds(folder / "logs" / f"{row['log']}.csv.gz", model, k)
            result = sysid.identify([log], model, options)
        except FlightError as error:
            print(f"{row['log']:8s} refused: {error}", flush=True)
            continue
        e = result.estimate("thrust_quadratic.k_n_s2")
        group = f"{row['motors']}, {mass_kg:g} kg" + (", payload" if payload else "")
        gain = f"gain {e.value / k:.3f} +- {e.std_robust / k:.3f}"
        print(f"{row['log']:8s} {group:32s} {gain}, {result.verdict.use}", flush=True)
        if not result.verdict.against:
            groups.setdefault(group, []).append((e.value / k, e.std_robust / k))
    for group, found in groups.items():
        gains = np.array([gain for gain, _ in found])
        low, middle, high = np.percentile(gains, [0.0, 50.0, 100.0])
        print(f"{group}: {len(gains)} logs, mean {gains.mean():.3f}, median {middle:.3f}, {low:.3f} to {high:.3f}")


def plain_gains(folder: Path) -> None:
    """Mean specific force along body z over mean commanded thrust per mass, all logs, by group."""
    groups: dict[str, list[float]] = {}
    with open(folder / "index.csv", newline="") as file:
        for row in csv.DictReader(file):
            log = sysid.read_log(folder / "logs" / f"{row['log']}.csv.gz", MAPS / "controller.toml")
            motion = kinematics(_flying(log, log.columns))
            assert motion is not None
            axis = rotations.rotate(motion.q, np.array([0.0, 0.0, 1.0]))
            pull = (motion.specific_force_world_m_s2 * axis).sum(axis=1).mean()
            asked = _flying(log, log.columns).columns["thrust_n"].mean() / float(row["mass_kg"])
            payload = ", payload" if row["has_acc"] == "True" else ""
            groups.setdefault(f"{row['motors']}, {row['mass_kg']} kg{payload}", []).append(float(pull / asked))
    for group, found in groups.items():
        print(f"{group:32s} {len(found):3d} logs, mean {np.mean(found):.3f}, {min(found):.3f} to {max(found):.3f}")


def _flying(log: FlightLog, columns: Mapping[str, np.ndarray]) -> FlightLog:
    """Take-off and landing dropped."""
    rows = np.flatnonzero((log.columns["thrust_n"] > 0.15) & (log.columns["position_world_z_m"] > 0.3))
    kept = slice(rows[0] + 100, rows[-1] - 100)
    return FlightLog({n: v[kept] for n, v in columns.items()}, log.metadata)


def _equivalent_speeds(path: Path, model: vehicle.Vehicle, k: float) -> FlightLog:
    """The commanded wrench as four rotor speeds that would make it."""
    log = sysid.read_log(path, MAPS / "controller.toml")
    thrust, arm = log.columns["thrust_n"], abs(model.hub_body_m[0, 0])
    each = thrust[:, None] / 4.0 + np.outer(log.columns["torque_x_n_m"], np.sign(model.hub_body_m[:, 1])) / (4.0 * arm)
    each -= np.outer(log.columns["torque_y_n_m"], np.sign(model.hub_body_m[:, 0])) / (4.0 * arm)
    each -= np.outer(log.columns["torque_z_n_m"], model.spin) / (4.0 * 0.006)
    speed = np.sqrt(np.clip(each, 1e-4, None) / k)
    columns = {n: v for n, v in log.columns.items() if not n.startswith(("thrust", "torque"))}
    columns |= {f"rotor_speed_command_{i}_rad_s": speed[:, i] for i in range(4)}
    return _flying(log, columns)


SETS = {
    "nanodrone": ("nanodrone_cf21bl", nanodrone),
    "torque": ("nanodrone_cf21bl", torque),
    "staircase": ("nanodrone_cf21bl", staircase),
    "motor_lag": ("crazyflie_motor_lag_arpl", motor_lag),
    "controller": ("crazyflie_lee_imrclab", controller),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("set", choices=SETS)
    parser.add_argument("--data", type=Path, default=Path("../shared/data/flight"), help="folder of the sets")
    parser.add_argument("--no-fit", action="store_true", help="only the plain ratio of the controller set: seconds")
    parser.add_argument("--logs", nargs="+", default=[], help="only these logs (controller, staircase)")
    parser.add_argument("--same-kind", action="store_true", help="staircase: learn from flights of the same kind only")
    parser.add_argument("--out", type=Path, default=Path("staircase"), help="folder for the facts of the staircase")
    chosen = parser.parse_args()
    name, work = SETS[chosen.set]
    folder = chosen.data / name
    if not folder.is_dir():
        sys.exit(
            f"{folder} does not exist; give the folder of the logs with --data (docs/evidence/studies/real_logs_*.md)"
        )
    if chosen.no_fit:
        plain_gains(folder)
        return
    work(folder, chosen)


if __name__ == "__main__":
    main()
