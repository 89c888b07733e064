"""Faults planted in recordings, and what the checks say of them: `python benchmarks/recordings.py --flights 4`.

Flights are simulated by the tests' own simulator and faults are made here, with no code that the checks share: as
arrays, then written as CSV, ULog, MCAP, ROS bag and ArduPilot log. An event counts as named if its kind is right, its
time within 0.1 s, its size within 20 %. Good flights, simulated and (with `--data`) real, must have none. Parameters
fitted after the repair are held against those of the clean log (`--fits`).
"""

import argparse
import csv
import gzip
import sys
import tempfile
from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT))

import recordings_files as files  # noqa: E402

import sysid  # noqa: E402
import vehicle  # noqa: E402
from flight import FlightError, FlightLog  # noqa: E402
from sysid.logs.checks import contact, drift, time_unit  # noqa: E402
from sysid.logs.checks.motion import kinematics  # noqa: E402
from sysid.logs.events import recording  # noqa: E402
from sysid.logs.fix import fix  # noqa: E402
from tests.sysid import flying  # noqa: E402

TIME_S, SIZE = 0.1, 0.2
"""A named event is this close to the planted one; its size to this share."""


@dataclass(frozen=True)
class Planted:
    """A fault in a recording."""

    recorded: files.Recorded
    kinds: tuple[str, ...]
    """Any of these names it rightly."""
    at_s: float
    size: float


def turned(q: np.ndarray, deg: float) -> np.ndarray:
    """Quaternions w x y z, turned about the vertical."""
    c, s = np.cos(np.deg2rad(deg) / 2.0), np.sin(np.deg2rad(deg) / 2.0)
    w, x, y, z = q.T
    return np.stack([c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w], axis=1)


def heading(flight: files.Recorded, row: int, size: float) -> Planted:
    q = flight.q.copy()
    q[row:] = turned(q[row:], 6.0 * size)
    return Planted(replace(flight, q=q), ("attitude jump", "reset"), flight.time_s[row], 6.0 * size)


def swapped(flight: files.Recorded, row: int, size: float) -> Planted:
    q = flight.q.copy()
    q[row : row + 30] = turned(q[row : row + 30], 12.0 * size)
    return Planted(replace(flight, q=q), ("attitude excursion",), flight.time_s[row], 12.0 * size)


def shifted(flight: files.Recorded, row: int, size: float) -> Planted:
    position = flight.position.copy()
    position[row:] += 0.1 * size * np.array([0.6, 0.0, 0.8])
    return Planted(replace(flight, position=position), ("position jump",), flight.time_s[row], 0.1 * size)


def dropped(flight: files.Recorded, row: int, size: float) -> Planted:
    position = flight.position.copy()
    position[row : row + 3] += np.array([0.0, 0.1 * size, 0.0])
    return Planted(replace(flight, position=position), ("position excursion",), flight.time_s[row], 0.1 * size)


def frozen(flight: files.Recorded, row: int, size: float) -> Planted:
    q, length = flight.q.copy(), round(30 * size)
    q[row : row + length] = q[row - 1]
    return Planted(replace(flight, q=q), ("frozen",), flight.time_s[row], length * 0.01)


def frozen_gyro(flight: files.Recorded, row: int, size: float) -> Planted:
    rate, length = flight.rate.copy(), round(30 * size)
    rate[row : row + length] = rate[row - 1]
    return Planted(replace(flight, rate=rate), ("frozen",), flight.time_s[row], length * 0.01)


def clock(kind: str, change: Callable[[np.ndarray, int, float], float]) -> Callable[..., Planted]:
    """A fault of the pose's stamps (in CSV of all)."""

    def plant(flight: files.Recorded, row: int, size: float) -> Planted:
        stamps = flight.stamps_s.copy()
        planted = change(stamps, row, size)
        kinds = (kind, "missing stamp") if kind == "zero stamp" else (kind,)
        return Planted(replace(flight, stamps_s=stamps), kinds, flight.time_s[row], planted)

    return plant


def back(stamps: np.ndarray, row: int, size: float) -> float:
    stamps[row:] -= 0.2 * size
    return 0.2 * size


def ahead(stamps: np.ndarray, row: int, size: float) -> float:
    stamps[row:] += 0.3 * size
    return 0.3 * size


def zero(stamps: np.ndarray, row: int, size: float) -> float:
    stamps[row : row + round(size)] = 0.0
    return round(size)


def wild(stamps: np.ndarray, row: int, size: float) -> float:
    count = min(round(size), 3)
    stamps[row : row + count] += 1000.0
    return count


def wrapped(stamps: np.ndarray, row: int, size: float) -> float:
    period_s = {1: 2**32 * 1e-6, 3: 2**31 * 1e-6, 10: 2**16 * 1e-3}[round(size)]
    stamps[row:] -= period_s
    return period_s


def repeated(stamps: np.ndarray, row: int, size: float) -> float:
    stamps[row : row + round(size)] = stamps[row - 1]
    return round(size)


FAULTS: dict[str, Callable[[files.Recorded, int, float], Planted]] = {
    "heading jump": heading,
    "swapped markers": swapped,
    "position jump": shifted,
    "position dropout": dropped,
    "frozen attitude": frozen,
    "frozen gyro": frozen_gyro,
    "clock back": clock("clock back", back),
    "clock ahead": clock("clock ahead", ahead),
    "zero stamp": clock("zero stamp", zero),
    "wild stamp": clock("wild stamp", wild),
    "counter wraps": clock("clock wrap", wrapped),
    "repeated stamp": clock("repeated stamp", repeated),
}
NEVER = {("counter wraps", "ulog"), ("counter wraps", "ardupilot")}
"""What cannot happen: they count with 64 bits."""
SIZES = (1.0, 3.0, 10.0)
"""In multiples of the stated detectable size."""


AT_ONCE = 12
"""Campaigns of three flights that are simulated together."""


def flown(count: int) -> Iterator[FlightLog]:
    """Simulated flights, quick ones, with noise and gusts."""
    for seed in range(-(-count // (3 * AT_ONCE))):
        rng = np.random.default_rng(1000 + seed)
        truth = replace(flying.Truth(), gust=(0.0, 0.5, 1.5)[seed % 3], gust_torque=rng.choice([0.0, 1.0]))
        noise = float(rng.choice([0.005, 0.02, 0.1]))
        paths = flying.paper_flights(rng, AT_ONCE, 0.3)
        yield from flying.fly(
            truth, paths, 3 * AT_ONCE, duration_s=12.0, rng=rng, rate_hz=100.0, gyro_noise_rad_s=noise
        )


def detection(flights: list[FlightLog], folder: Path) -> None:
    """Share of planted events that are named, by kind, format and size."""
    named, planted, extra = defaultdict(int), defaultdict(int), defaultdict(int)
    for k, log in enumerate(flights):
        base = files.recorded(log)
        row = 300 + 53 * k % 500
        for name, fault in FAULTS.items():
            for size in SIZES:
                one = fault(base, row, size)
                for form, write in files.FORMATS.items():
                    if (name, form) in NEVER:
                        continue
                    key = (name, form, size)
                    planted[key] += 1
                    try:
                        read = write(folder, one.recorded)
                        found = recording.find(read, contact.spans(read))
                    except FlightError as error:
                        print(f"{key}: {error}")
                        continue
                    right = [e for e in found if _is(e, one, read)]
                    named[key] += bool(right)
                    extra[key] += len(found) - len(right)
                    if not right:
                        print(f"missed {key} {one.size:.3g} at {one.at_s:.2f}: {[e.sentence for e in found][:3]}")
    _table(named, planted, extra)


def _is(event: recording.Event, one: Planted, read: FlightLog) -> bool:
    begin_s, end_s = event.span
    offset_s = read.metadata.get("began_s", 0.0)
    near = begin_s - TIME_S <= one.at_s - offset_s <= end_s + TIME_S
    return event.kind in one.kinds and near and abs(event.size - one.size) <= SIZE * one.size


def _table(named: dict, planted: dict, extra: dict) -> None:
    print(f"{'fault':18s} " + " ".join(f"{form:>14s}" for form in files.FORMATS))
    for name in FAULTS:
        cells = [
            "/".join(f"{100 * named[name, f, s] / planted[name, f, s]:.0f}" for s in SIZES if planted[name, f, s])
            for f in files.FORMATS
        ]
        print(f"{name:18s} " + " ".join(f"{cell:>14s}" for cell in cells))
    total = sum(planted.values())
    print(f"named {100 * sum(named.values()) / max(total, 1):.1f} % of {total}; other events {sum(extra.values())}")


def false_events(flights: list[FlightLog], data: Path | None) -> None:
    """Events in flights that are good."""
    wrong = 0
    for log in flights:
        motion = kinematics(log)
        found = [*recording.find(log, contact.spans(log)), *time_unit.check(log)]
        found += drift.check(log, motion, None) if motion is not None else []
        wrong += bool(found)
        for event in found:
            print(f"  simulated: {event.sentence}")
    print(f"simulated: {wrong} of {len(flights)} good flights with a false event")
    if data is None:
        return
    maps = ROOT / "benchmarks" / "column_maps"
    sets = {"crazyflie_lee_imrclab/logs": "controller.toml", "crazyflie_motor_lag_arpl": "motor_lag.toml"}
    sets |= {"nanodrone_cf21bl": "nanodrone.toml"}
    for name, columns in sets.items():
        paths = sorted((data / name).glob("*.csv*"))
        found = {}
        for path in paths:
            log = sysid.read_log(path, maps / columns)
            found[path.name] = recording.find(log, contact.spans(log))
        with_some = {path: events for path, events in found.items() if events}
        print(f"{name}: {len(with_some)} of {len(paths)} logs with an event")
        for path, events in with_some.items():
            print(f"  {path}: {len(events)}, {_shown(data / name / path, events)}; the first: {events[0].sentence}")


STILL = 0.4
"""An estimate jumped if the motion capture beside it moved by at most this share."""


def _shown(path: Path, events: list[recording.Event]) -> str:
    """How many of the position's events are faults of the estimate, by the motion capture recorded beside it."""
    with gzip.open(path, "rt") as file:
        rows = list(csv.DictReader(file))
    judged = [event for event in events if event.stream == "position_world_m"]
    if not rows or "mocap_x_m" not in rows[0] or not judged:
        return "no second measurement of the position"
    time_s = np.array([float(row["t_s"]) for row in rows])
    captured, estimate = (
        np.array([[float(row[f"{source}{axis}_m"] or "nan") for axis in "xyz"] for row in rows])
        for source in ("mocap_", "")
    )
    real = 0
    for event in judged:
        before, after = np.searchsorted(time_s - time_s[0], np.array(event.span) - 1e-3)
        if event.kind.endswith("excursion"):  # the leap there
            before, after = before - 1, before
        by = [np.linalg.norm(values[after] - values[before]) for values in (captured, estimate)]
        real += bool(by[0] <= STILL * max(by[1], event.size))
    return f"{real} of {len(judged)} of the position contradicted by the motion capture"


def fits(flights: list[FlightLog], folder: Path) -> None:
    """Parameters after the repair against those of the clean log, in stated standard errors of the clean fit."""
    model, off = vehicle.example("rigter2019"), []
    options = sysid.Options(gusts="white", gaps="split")
    for log in flights:
        base = files.recorded(log)
        clean = sysid.identify([files.FORMATS["ulog"](folder, base)], model, options)
        for name in FAULTS:
            if (name, "ulog") in NEVER:
                continue
            one = FAULTS[name](base, 500, 5.0)
            mended = fix(files.FORMATS["ulog"](folder, one.recorded), model).log
            again = sysid.identify([mended], model, options)
            for e in clean.parameters:
                if e.status == "free" and not e.name.startswith("pose_sensor"):
                    other = again.estimate(e.name)
                    sigmas = abs(other.value - e.value) / max(other.std_robust, e.std_robust)
                    off.append(sigmas)
                    if sigmas > 1.5:
                        print(f"  {name}: {e.name} off by {sigmas:.1f} standard errors")
    print(f"within 1.5 standard errors: {100 * np.mean(np.array(off) <= 1.5):.1f} % of {len(off)}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--flights", type=int, default=6, help="simulated flights that faults are planted in")
    parser.add_argument("--good", type=int, default=216, help="simulated flights without a fault")
    parser.add_argument("--fits", type=int, default=1, help="flights that are fitted clean and repaired")
    parser.add_argument("--data", type=Path, help="folder of the public flights")
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        count = max(chosen.good, chosen.flights, 3 * chosen.fits)
        flights = [log for log, _ in zip(flown(count), range(count), strict=False)]
        detection(flights[: chosen.flights], Path(folder))
        false_events(flights[: chosen.good], chosen.data)
        fits(flights[2 : 2 + 3 * chosen.fits : 3], Path(folder))


if __name__ == "__main__":
    main()
