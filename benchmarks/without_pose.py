"""Identification and diagnosis without a pose: `python benchmarks/without_pose.py --draws 60 --faults 8`.

Simulated twins have truth (`without_pose_flights`; `without_pose_rotorpy` and `without_pose_crazyflow`, which others'
simulators fly): error and 90 % intervals of inertia, lag and thrust by command; what a log is said to suffice for;
right and false names of planted faults. The real flights (`--data FOLDER`) are `log10`, `log15` and `log16` of
github.com/arplaboratory/data-driven-system-identification, with the thrust curve that its authors publish; their
program multiplies the vertical force by 9.18 instead of 9.81.
"""

import argparse
import sys
import time
from collections import defaultdict
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT))

import report  # noqa: E402
import without_pose_crazyflow  # noqa: E402
import without_pose_flights as flights  # noqa: E402
import without_pose_rotorpy  # noqa: E402
from without_pose_rotorpy import Twin  # noqa: E402

import sysid  # noqa: E402
import vehicle  # noqa: E402
from flight import FlightLog  # noqa: E402
from sysid.diagnosis import from_imu  # noqa: E402
from sysid.estimator import prepare  # noqa: E402
from sysid.estimator.flights import clocks  # noqa: E402
from sysid.estimator.flights.flight_data import Flight  # noqa: E402
from sysid.estimator.without_pose import sensing, told  # noqa: E402
from sysid.logs import manoeuvres  # noqa: E402

JUDGED = tuple(name for name in flights.VARIED if name.startswith(("inertia_", "motor_lag.")))
THRUST = "thrust by command"
EFFORTS = ((1.0, 1.0, 1.0), (0.1, 0.1, 0.1), (0.03, 1.0, 1.0), (1.0, 0.03, 1.0), (1.0, 1.0, 0.03))
FAULTS = ("weak rotor", "centre of mass", "unequal motors", "late gyro", "none")
LOSSES = tuple(f"weak_rotor.loss_{i}" for i in range(4))
CENTRE = tuple(f"centre_of_mass.{axis}_m" for axis in "xy")
PUBLISHED_N = (0.0213, -0.0112, 0.1201)
"""Of one rotor by command, constant to quadratic."""
PUBLISHED = {
    "inertia_xx_kg_m2": 1.0286e-5,
    "inertia_yy_kg_m2": 1.1052e-5,
    "inertia_zz_kg_m2": 1.9546e-5,
    "motor_lag.rise_s": 0.0716,
    "motor_lag.fall_s": 0.0716,
}
"""The lag is the one of their 100 candidates that their figure marks."""
TYPED, GRAVITY = 9.18, 9.81
REAL_COMMANDS = np.arange(0.2, 0.91, 0.1)
_STREAMS = tuple(clocks.STREAMS[quantity] for quantity in (clocks.COMMAND, clocks.ACCELEROMETER))


def twins(draws: int, duration_s: float, seed: int) -> list[report.Row]:
    """Errors and intervals over simulated vehicles."""
    rng = np.random.default_rng(seed)
    values, body, start = flights.drawn(draws, rng), flights.body(), flights.start()
    logs = flights.flown(body, values, rng, duration_s=duration_s)
    score, speed = Score(), flights.FULL_RAD_S * flights.COMMANDS
    for i, log in enumerate(logs):
        thrust = values["thrust_quadratic.k_n_s2"][i] * speed**2 + body.value("thrust_affine.slope_n_s") * speed
        true = {name: float(values[name][i]) for name in JUDGED}
        score.add(Twin(log, start, true, flights.COMMANDS, thrust))
    return score.rows("")


def of_rotorpy(draws: int, duration_s: float, seed: int) -> list[report.Row]:
    """The same of vehicles that RotorPy flies: another body, another controller."""
    rows = []
    for name in without_pose_rotorpy.VEHICLES:
        score, rng = Score(), np.random.default_rng(seed + 3)
        for _ in range(draws):
            score.add(without_pose_rotorpy.flown(name, rng, duration_s=duration_s))
        rows += score.rows(f"RotorPy {name}: ")
    return rows


def of_crazyflow(python: str, draws: int, duration_s: float, seed: int) -> list[report.Row]:
    """The same of vehicles that crazyflow flies: their rotors' lag varies with speed, so that it is not judged."""
    score = Score()
    for twin in without_pose_crazyflow.flown(python, draws, np.random.default_rng(seed + 4), duration_s=duration_s):
        score.add(twin)
    return score.rows("crazyflow: ")


class Score:
    """Errors of parameters and of the thrust by command, and whether their intervals hold the truth."""

    def __init__(self) -> None:
        self._errors: dict[str, list[float]] = defaultdict(list)
        self._held: dict[str, list[bool]] = defaultdict(list)
        self._cpu_s, self._flown_s = 0.0, 0.0

    def add(self, twin: Twin) -> None:
        began = time.process_time()
        found = sysid.identify([twin.log], twin.given)
        self._cpu_s += time.process_time() - began
        self._flown_s += float(twin.log.time_s[-1] - twin.log.time_s[0])
        for name, true in twin.values.items():
            estimate = found.estimate(name)
            self._errors[name].append(estimate.value / true - 1.0)
            self._held[name].append(abs(estimate.value - true) < estimate.interval90)
        value, half = told.thrust_by_command(found.flights, found.solution, found.unknowns, twin.commands)
        self._errors[THRUST] += list(value / twin.thrust_n - 1.0)
        self._held[THRUST] += list(np.abs(value - twin.thrust_n) < half)

    def rows(self, whose: str) -> list[report.Row]:
        rows = []
        for name, errors in self._errors.items():
            within, held = float(np.mean(np.abs(errors) <= 0.05)), float(np.mean(self._held[name]))
            rows.append(report.row(f"{whose}{name}: within 5 %", within, "share", ">= 0.9", within >= 0.9))
            good = 0.85 <= held <= 0.95
            rows.append(report.row(f"{whose}{name}: in its 90 % interval", held, "share", "0.85 to 0.95", good))
        held = float(np.mean(np.concatenate(list(self._held.values()))))
        a_minute = 60.0 * self._cpu_s / self._flown_s
        return [
            *rows,
            report.row(f"{whose}all: in their 90 % intervals", held, "share", "0.85 to 0.95", 0.85 <= held <= 0.95),
            report.row(f"{whose}a fit, for a minute flown", a_minute, "CPU s", "<= 20", a_minute <= 20.0),
        ]


def flown_manoeuvres(draws: int, seed: int) -> list[report.Row]:
    """What a log is said to suffice for, beside what its fit knows: twins flown with and without each manoeuvre."""
    rng, start, body = np.random.default_rng(seed + 2), flights.start(), flights.body()
    enough: list[bool] = []
    over: list[float] = []
    wrongly: list[bool] = []
    for effort in EFFORTS:
        for duration_s in (12.0, 30.0):
            values = flights.drawn(draws, rng)
            for i, log in enumerate(flights.flown(body, values, rng, duration_s=duration_s, effort=effort)):
                throttle, rolls, _ = manoeuvres.found(log)
                expected = float(np.hypot(throttle.error, rolls.error))
                found = sysid.identify([log], start)
                for name in ("inertia_xx_kg_m2", "inertia_yy_kg_m2"):
                    one = found.estimate(name)
                    over.append(expected / (one.std_robust / one.value))
                    within = abs(one.value / values[name][i] - 1.0) <= 0.05
                    (enough if throttle.enough and rolls.enough else wrongly).append(within)
    share, factor = float(np.mean(enough)), float(np.median(over))
    return [
        report.row("enough by the log: inertia x, y within 5 %", share, "share", ">= 0.9", share >= 0.9),
        report.row("logs with enough", len(enough) / (len(enough) + len(wrongly)), "share"),
        report.row("not enough by the log: within 5 % all the same", float(np.mean(wrongly or [0.0])), "share"),
        report.row("error expected by the log over the fit's, median", factor, "", "0.5 to 2.5", 0.5 <= factor <= 2.5),
        report.row("its tenth and ninth tenth", float(np.quantile(over, 0.9) / np.quantile(over, 0.1)), ""),
    ]


def faults(draws: int, duration_s: float, seed: int) -> list[report.Row]:
    """Right and false names over simulated vehicles with one fault each, and without any."""
    rng, start = np.random.default_rng(seed + 1), flights.start()
    plain = flights.body().with_effect("weak_rotor").with_effect("centre_of_mass")
    right: list[bool] = []
    false: list[bool] = []
    used_s = 0.0
    for kind in FAULTS:
        values = flights.drawn(draws, rng)
        recorder = flights.Recorder(gyro_late_s=3e-3 if kind == "late gyro" else 0.0)
        expected = [_planted(kind, i, values, rng) for i in range(draws)]
        logs = flights.flown(plain, values, rng, duration_s=duration_s, recorder=recorder)
        for log, wanted in zip(logs, expected, strict=True):
            began = time.process_time()
            found = from_imu.diagnose([log], start)
            used_s += time.process_time() - began
            named = {*found.additions} | ({"late gyro"} if found.late_gyro is not None else set())
            named |= {"bent rotor"} if found.bent is not None else set()
            right.append(named >= wanted and not found.undecided)
            false.append(bool(named - wanted))
            if named != wanted:
                print(f"{kind}: {found.verdict}")
    share, wrong = float(np.mean(right)), float(np.mean(false))
    return [
        report.row("planted faults named, none where there is none", share, "share", ">= 0.9", share >= 0.9),
        report.row("false names", wrong, "share", "<= 0.03", wrong <= 0.03),
        report.row(f"a diagnosis of {duration_s:g} s", used_s / len(right), "CPU s"),
    ]


def _planted(kind: str, i: int, values: dict[str, np.ndarray], rng: np.random.Generator) -> set[str]:
    """Plant a fault in twin i; returns what should be named."""
    for name in (*LOSSES, *CENTRE):
        values.setdefault(name, np.zeros(len(values["inertia_xx_kg_m2"])))
    if kind == "weak rotor":
        rotor = int(rng.integers(4))
        values[LOSSES[rotor]][i] = 0.05
        return {f"weak_rotor[{rotor}]"}
    if kind == "centre of mass":
        angle = rng.uniform(0.0, 2.0 * np.pi)
        values[CENTRE[0]][i], values[CENTRE[1]][i] = 3e-3 * np.cos(angle), 3e-3 * np.sin(angle)
        return {"centre_of_mass"}
    if kind == "unequal motors":
        for name in LOSSES:
            values[name][i] = rng.uniform(-0.05, 0.05)
        return {from_imu.UNEQUAL}
    return {kind} if kind == "late gyro" else set()


def crazyflie() -> vehicle.Vehicle:
    """Mass and hubs as published; the rest estimated from them, as `goshawk vehicle new` does."""
    from vehicle import draft

    arm = 0.028
    hubs = arm * np.array([[1.0, -1.0, 0.0], [-1.0, -1.0, 0.0], [-1.0, 1.0, 0.0], [1.0, 1.0, 0.0]])
    known = draft.Known(
        name="crazyflie",
        mass_kg=vehicle.Parameter(0.027, 2.7e-4, "kg", "published"),
        hub_body_m=hubs,
        spin=np.array([1.0, -1.0, 1.0, -1.0]),
        rotor_radius_m=vehicle.Parameter(0.023, 0.0, "m", "published"),
    )
    return draft.draft(known)


def published() -> vehicle.Vehicle:
    """The same vehicle with what the authors' program prints."""
    body = crazyflie()
    full = body.limits.rotor_speed_max_rad_s
    constant, slope, square = (c / full**i for i, c in enumerate(PUBLISHED_N))
    body = body.with_value("thrust_quadratic.k_n_s2", square)
    body = body.with_effect("thrust_affine", constant_n=constant, slope_n_s=slope)
    for name, value in PUBLISHED.items():
        body = body.with_value(name, value)
    return body


def real(folder: Path) -> list[report.Row]:
    """The published flights of a Crazyflie: two fitted and one held out, the other way round, and all."""
    rows: list[report.Row] = []
    start, logs = crazyflie(), {n: sysid.read_log(folder / n) for n in ("log10", "log15", "log16")}
    for names in (("log10", "log15"), ("log16",), ("log10", "log15", "log16")):
        found = sysid.identify([logs[n] for n in names], start, sysid.Options(gaps="split"))
        said = ", ".join(names)
        rows += _beside_the_published(found, said)
        held_out = [log for n, log in logs.items() if n not in names]
        rows += _held_out(found, held_out, said) if held_out else []
    return rows


def _beside_the_published(found: sysid.Identification, said: str) -> list[report.Row]:
    rows = []
    thrust, _ = told.thrust_by_command(found.flights, found.solution, found.unknowns, REAL_COMMANDS)
    published_n = sum(c * REAL_COMMANDS**i for i, c in enumerate(PUBLISHED_N))
    off = float(np.abs(thrust / published_n - 1.0).max())
    rows.append(report.row(f"{said}: thrust from the published", off, "share", "<= 0.05", off <= 0.05))
    lag_s = float(np.mean([found.estimate(f"motor_lag.{which}_s").value for which in ("rise", "fall")]))
    rows.append(report.row(f"{said}: motor lag", lag_s, "s", "0.06 to 0.09", bool(0.06 <= lag_s <= 0.09)))
    for axis in ("xx", "yy"):
        name = f"inertia_{axis}_kg_m2"
        one, value = found.estimate(name), PUBLISHED[name]
        inside = bool(abs(one.value - value) < one.interval90)
        rows.append(report.row(f"{said}: inertia {axis}", one.value, "kg m2", f"holds {value:.3g}", inside))
        rows.append(report.row(f"{said}: inertia {axis}, 90 % interval", one.interval90, "kg m2"))
    return rows


def _held_out(found: sysid.Identification, logs: list[FlightLog], said: str) -> list[report.Row]:
    """Prediction of flights that were not fitted, by this fit and by the published parameters, by one function.

    Each with and without the delays that the fit found, so that nobody is beaten by a clock.
    """
    delays = {stream: np.mean([c.delay_s for c in found.clocks if c.stream == stream]) for stream in _STREAMS}
    flights = [
        sensing.with_delays(flight)
        for log in logs
        for flight in prepare.prepare_all([log], sysid.Options(gaps="split"), [crazyflie()])
    ]
    rows = []
    errors = {
        (model, late): _errors(flights, body, delays if late else {})
        for model, body in (("fitted", found.vehicle), ("published", published()))
        for late in (False, True)
    }
    names = ", ".join(str(log.metadata["name"]) for log in logs)
    for i, (what, unit) in enumerate((("vertical force, 50 ms", "m/s2"), ("roll and pitch rate after 0.1 s", "rad/s"))):
        ours, theirs = (min(errors[model, late][i] for late in (False, True)) for model in ("fitted", "published"))
        still = _errors(flights, None, {})[i]
        peers = {"published": theirs, "nothing moves": still}
        name = f"{said} predict {names}: {what}"
        rows.append(report.row(name, ours, unit, "below the published", ours < theirs, peers))
    return rows


def _errors(flights: list[Flight], body: vehicle.Vehicle | None, delays: dict[str, float]) -> tuple[float, float]:
    """Root mean squares: of the vertical specific force over 50 ms, and of the rate about x and y gained in 0.1 s.

    Args:
        body: None: a vehicle that hangs still.
        delays: by stream.
    """
    force, rate = [], []
    for flight in flights:
        if body is None:
            left = sensing.measured(flight) - np.array([0.0, 0.0, GRAVITY, 0.0, 0.0, 0.0])
        else:
            values = {
                name: delays[stream]
                for name, stream in zip(sensing.delay_names(flight), _STREAMS, strict=True)
                if stream in delays
            }
            left = sensing.left(flight, body, values)
        step_s = float(np.median(flight.step_s))
        for found, part, length_s, scale in ((force, left[:, 2:3], 0.05, 1.0), (rate, left[:, 3:5], 0.1, 0.1)):
            width = round(length_s / step_s)
            means = part[: len(part) // width * width].reshape(-1, width, part.shape[1]).mean(axis=1)
            found.append(scale * means.ravel())
    return tuple(float(np.sqrt((np.concatenate(f) ** 2).mean())) for f in (force, rate))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=60)
    parser.add_argument("--rotorpy", type=int, default=6, help="twins of each vehicle that RotorPy flies")
    parser.add_argument("--crazyflow", metavar="PYTHON", help="an interpreter that has crazyflow, to fly 20 twins")
    parser.add_argument("--faults", type=int, default=8, help="flights of each kind of fault")
    parser.add_argument("--manoeuvres", type=int, default=2, help="twins of each effort")
    parser.add_argument("--duration", type=float, default=30.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--data", type=Path, help="folder with log10, log15 and log16")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the rows here")
    given = parser.parse_args()
    rows = twins(given.draws, given.duration, given.seed) if given.draws else []
    rows += of_rotorpy(given.rotorpy, given.duration, given.seed) if given.rotorpy else []
    rows += of_crazyflow(given.crazyflow, 20, given.duration, given.seed) if given.crazyflow else []
    rows += faults(given.faults, given.duration, given.seed) if given.faults else []
    rows += flown_manoeuvres(given.manoeuvres, given.seed) if given.manoeuvres else []
    rows += real(given.data) if given.data else []
    report.print_table(rows)
    if given.json:
        report.write(rows, given.json)


if __name__ == "__main__":
    main()
