"""Is a diagnosis ever confidently wrong because its input is? The same flights, each time with one fault:

    python benchmarks/robustness.py [--cells TEXT ...] [--results FILE] [--json FILE]

Three vehicles, flown by RotorPy's equations in gusts (`blind_campaigns`): one hides a force and a moment, one a weaker
pair, one nothing. Their flights, four to learn from and two held out, are diagnosed as they are and then with one fault
at a time. A diagnosis must name what is hidden or say that it cannot tell; false names, "nothing is missing" where
something is, and sizes far from the truth count as confidently wrong if stated with more than even odds. Results are
kept one a line, so that a run that was cut off goes on where it stopped; `--cells` runs only those whose name, as in
"nothing: 50 Hz", holds one of the texts.
"""

import argparse
import json
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import blind_campaigns
import numpy as np
import report
from blind_draw import Conditions, Truth, draw
from blind_flight import Array
from diagnosis_run import MASSLESS, effect_of
from scipy.interpolate import CubicSpline

import vehicle
from flight import FlightError, FlightLog, frames, rotations
from flight.flight_log import COLUMNS
from sysid import Options
from sysid.diagnosis import Diagnosis, diagnose

VEHICLES: dict[str, tuple[str, ...]] = {
    "drag and damping": ("rotor_drag_speed", "angular_damping"),
    "inflow and flapping": ("inflow_linear", "flapping_moment"),
    "nothing": (),
}
"""Effects that the vehicle file lacks, by the name of the row."""
SEED = 515
DURATION_S = 24.0
FLOWN_HZ, LOGGED_HZ = 400, 200
EVEN = 0.5
FAR_SIGMAS = 4.0
"""A size farther from the truth than so many of its standard errors is wrong: 1 in 16,000 by chance."""
LATE_S = 0.005
GAP_S, GAPS = 0.3, 4


@dataclass(frozen=True, slots=True)
class Input:
    """What a diagnosis is given."""

    logs: tuple[FlightLog, ...]
    """At `FLOWN_HZ`; the held-out flights come last."""
    vehicle: vehicle.Vehicle
    truth: Truth
    rate_hz: int = LOGGED_HZ
    options: Options | None = None

    def changed(self, change: Callable[[FlightLog], FlightLog]) -> "Input":
        """The same with another form of each log."""
        return replace(self, logs=tuple(change(log) for log in self.logs))


def _columns(log: FlightLog, quantity: str, values: Array) -> FlightLog:
    return FlightLog({**log.columns, **dict(zip(COLUMNS[quantity], values.T, strict=True))}, log.metadata)


def _late(quantities: tuple[str, ...], late_s: float) -> Callable[[Input], Input]:
    """Streams whose stamps are too late."""

    def change(log: FlightLog) -> FlightLog:
        seen = np.clip(log.time_s - late_s, log.time_s[0], log.time_s[-1])
        for quantity in quantities:
            values = CubicSpline(log.time_s, log.vector(quantity))(seen)
            log = _columns(log, quantity, rotations.normalise(values) if "q_" in quantity else values)
        return log

    return lambda given: given.changed(change)


def _with_gaps(given: Input) -> Input:
    """Rows that were never written, at the same places in each log."""

    def change(log: FlightLog) -> FlightLog:
        begins = log.time_s[-1] * (np.arange(GAPS) + 1.0) / (GAPS + 1.0)
        kept = ~((log.time_s[:, None] > begins) & (log.time_s[:, None] < begins + GAP_S)).any(axis=1)
        return FlightLog({name: values[kept] for name, values in log.columns.items()}, log.metadata)

    return replace(given.changed(change), options=Options(gusts="white", gaps="split"))


def _half(given: Input) -> Input:
    return given.changed(lambda log: log.slice(0.0, 0.5 * float(log.time_s[-1])))


def _mass(factor: float) -> Callable[[Input], Input]:
    """The vehicle file's mass is wrong."""
    return lambda given: replace(
        given, vehicle=given.vehicle.with_value("mass_kg", factor * given.vehicle.mass_kg, std=0.0, source="guessed")
    )


def _spin(given: Input) -> Input:
    return replace(given, vehicle=replace(given.vehicle, spin=-given.vehicle.spin))


def _rotors_swapped(given: Input) -> Input:
    """The columns of two rotors change places."""
    quantity = "rotor_speed_rad_s"
    return given.changed(lambda log: _columns(log, quantity, log.vector(quantity)[:, [1, 0, 2, 3]]))


def _world_turned(rotation_vector: tuple[float, float, float]) -> Callable[[Input], Input]:
    """The frame of the pose is turned in the world: another heading, or not level."""
    turn = rotations.exp(np.array(rotation_vector))

    def change(log: FlightLog) -> FlightLog:
        log = _columns(log, "position_world_m", rotations.rotate(turn, log.vector("position_world_m")))
        return _columns(log, "q_world_body", rotations.multiply(turn, log.vector("q_world_body")))

    return lambda given: given.changed(change)


def _body_turned(rotation_vector: tuple[float, float, float]) -> Callable[[Input], Input]:
    """The markers are mounted turned on the body."""
    turn = rotations.exp(np.array(rotation_vector))

    def change(log: FlightLog) -> FlightLog:
        return _columns(log, "q_world_body", rotations.multiply(log.vector("q_world_body"), turn))

    return lambda given: given.changed(change)


def _z_down(given: Input) -> Input:
    """Positions and attitude are NED and FRD, and nobody said so."""

    def change(log: FlightLog) -> FlightLog:
        log = _columns(log, "position_world_m", frames.flip_vector(log.vector("position_world_m")))
        return _columns(log, "q_world_body", frames.flip_attitude(log.vector("q_world_body")))

    return given.changed(change)


POSE, GYRO, ROTORS = ("position_world_m", "q_world_body"), ("rate_body_rad_s",), ("rotor_speed_rad_s",)
FAULTS: dict[str, Callable[[Input], Input]] = {
    "as flown": lambda given: given,
    "rotor speed 5 ms late": _late(ROTORS, LATE_S),
    "rotor speed 5 ms early": _late(ROTORS, -LATE_S),
    "gyro 5 ms late": _late(GYRO, LATE_S),
    "50 Hz": lambda given: replace(given, rate_hz=50),
    "100 Hz": lambda given: replace(given, rate_hz=100),
    "400 Hz": lambda given: replace(given, rate_hz=400),
    "4 gaps of 0.3 s in each flight": _with_gaps,
    "half the length": _half,
    "mass 10 % too large": _mass(1.1),
    "mass 10 % too small": _mass(0.9),
    "spins reversed": _spin,
    "two rotors swapped": _rotors_swapped,
    "pose: heading turned by 90 deg": _world_turned((0.0, 0.0, 0.5 * np.pi)),
    "pose: world tilted by 2 deg": _world_turned((np.deg2rad(2.0), 0.0, 0.0)),
    "pose: body turned by 20 deg": _body_turned((0.0, 0.0, np.deg2rad(20.0))),
    "pose: z down": _z_down,
}
TOLERATED = {"pose: world tilted by 2 deg": {"F_x_world against constant", "F_y_world against constant"}}
"""A tilted frame shows as a level force that is constant in the world."""


def flown(name: str, hidden: tuple[str, ...]) -> Input:
    """The flights of a vehicle, logged at `FLOWN_HZ`, and its file."""
    seed = [SEED, list(VEHICLES).index(name)]
    for attempt in range(blind_campaigns.ATTEMPTS):
        rng = np.random.default_rng([*seed, attempt])
        truth = draw("pair" if hidden else "none", rng, Conditions(), hidden)
        (made,) = blind_campaigns.fly([truth], [rng], DURATION_S, every=1)
        if all(blind_campaigns.sound(r.check(truth.body["rotor_speed_max"])) for r in made):
            logs = tuple(blind_campaigns.measure(r, truth, False, rng) for r in made)
            return Input(logs, blind_campaigns.vehicle_file(truth, name, rng), truth)
    raise SystemExit(f"{name}: no sound flights in {blind_campaigns.ATTEMPTS} draws")


def _thinned(log: FlightLog, rate_hz: int) -> FlightLog:
    every = FLOWN_HZ // rate_hz
    return FlightLog({name: values[::every] for name, values in log.columns.items()}, log.metadata)


def diagnosed(given: Input) -> dict[str, Any]:
    """What a diagnosis says, as plain values; a refusal is one, too."""
    logs, learn = [_thinned(log, given.rate_hz) for log in given.logs], len(blind_campaigns.TRAINING)
    cpu = time.process_time()
    try:
        found = diagnose(logs[:learn], given.vehicle, held_out=logs[learn:], auto=True, options=given.options)
    except FlightError as refused:
        return {"refused": str(refused), "cpu_s": time.process_time() - cpu}
    outside = found.outside and f"{found.outside.channel} against {found.outside.variable}"
    return {
        "names": sorted({effect_of(n) for n in found.additions} - {"imu_errors"}),
        "undecided": [effect_of(n) for n in found.undecided],
        "curve": outside,
        "confidence": float(found.confidence),
        "verdict": found.verdict,
        "fit": found.fit_verdict.sentence,
        "findings": list(found.findings),
        "sigmas_off": _sigmas_off(found, given),
        "cpu_s": time.process_time() - cpu,
    }


def _sigmas_off(found: Diagnosis, given: Input) -> dict[str, float]:
    """Of the sizes of each effect rightly named: the distance from the truth in standard errors."""
    off = {}
    for candidate in found.candidates:
        hidden = given.truth.hidden.get(candidate.name)
        if candidate.name not in found.additions or hidden is None:
            continue
        # forces are known per mass: with a wrong mass in the file all sizes scale with it
        scale = 1.0 if candidate.name in MASSLESS else given.vehicle.mass_kg / given.truth.body["mass"]
        for size in candidate.sizes:
            error = size.value - scale * hidden.get(size.parameter.split(".")[1], 0.0)
            off[size.parameter] = float(error / size.sigma) if size.sigma > 0.0 else 0.0
    return off


def judged(found: dict[str, Any], hidden: tuple[str, ...], tolerated: set[str]) -> str:
    """`same names`, `refused`, `cannot tell`, `unsure` (wrong, at no better than even odds), or `confidently wrong`."""
    if "refused" in found:
        return "refused"
    said = set(found["names"])
    wrong = said - set(hidden)
    missing = set(hidden) - said - set(found["undecided"])
    curve_is_wrong = found["curve"] is not None and found["curve"] not in tolerated
    far = any(abs(sigmas) > FAR_SIGMAS for sigmas in found["sigmas_off"].values())
    if not (wrong or missing or curve_is_wrong or far or found["undecided"]):
        return "same names"
    if found["confidence"] > EVEN and (wrong or missing or curve_is_wrong or far):
        return "confidently wrong"
    return "unsure" if wrong else "cannot tell"


def chosen(texts: list[str]) -> list[tuple[str, str]]:
    """Vehicle and fault of the cells whose name holds one of the texts; of all if there are none."""
    cells = [(name, fault) for name in VEHICLES for fault in FAULTS]
    for text in texts:
        if not any(text in f"{name}: {fault}" for name, fault in cells):
            raise SystemExit(f"no cell's name holds {text!r}; the first is '{cells[0][0]}: {cells[0][1]}'")
    return [(name, fault) for name, fault in cells if not texts or any(t in f"{name}: {fault}" for t in texts)]


def measured(results_file: Path, cells: list[tuple[str, str]]) -> list[dict[str, Any]]:
    """These cells, and those that the file has already, which are not run again."""
    lines = results_file.read_text().splitlines() if results_file.exists() else []
    results = [json.loads(line) for line in lines]
    done = {(r["vehicle"], r["fault"]) for r in results}
    for name, hidden in VEHICLES.items():
        waiting = [fault for vehicle_name, fault in cells if vehicle_name == name and (name, fault) not in done]
        given = flown(name, hidden) if waiting else None
        for fault in waiting:
            assert given is not None
            found = diagnosed(FAULTS[fault](given))
            found["judged"] = judged(found, hidden, TOLERATED.get(fault, set()))
            results.append({"vehicle": name, "fault": fault, **found})
            with results_file.open("a") as file:
                file.write(json.dumps(results[-1]) + "\n")
            print(f"{name}, {fault}: {found['judged']}; {found.get('verdict', found.get('refused'))}", flush=True)
    return results


def rows(results: list[dict[str, Any]]) -> list[report.Row]:
    """By fault: how many diagnoses are confidently wrong, and how many give the same names."""
    table = []
    for fault in FAULTS:
        own = [r["judged"] for r in results if r["fault"] == fault]
        if not own:
            continue
        wrong = own.count("confidently wrong")
        peers = {kind: float(own.count(kind)) for kind in ("same names", "cannot tell", "unsure", "refused")}
        table.append(report.row(f"{fault}: confidently wrong (of {len(own)})", wrong, "", "0", wrong == 0, peers))
    return table


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cells", nargs="+", default=[], metavar="TEXT", help="only cells that hold one of these")
    parser.add_argument(
        "--results", type=Path, default=Path("build/bench/robustness.jsonl"), help="one line per cell; those are kept"
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the rows here")
    a = parser.parse_args()
    a.results.parent.mkdir(parents=True, exist_ok=True)
    table = rows(measured(a.results, chosen(a.cells)))
    report.print_table(table)
    if a.json:
        body = {"machine": report.machine(), "rows": [asdict(r) for r in table]}
        a.json.write_text(json.dumps(body, indent=1) + "\n")


if __name__ == "__main__":
    main()
