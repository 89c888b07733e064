"""Plan, preflight, plan: rounds until the risk is met, and how long that plan takes beside the best found by search.

    python benchmarks/preflight_rounds.py --json build/bench/preflight_rounds.json

Every flight is simulated, in a room with two pillars made from solids. Each round has luck of its own (--seed), and the
last plan is flown once more with luck that no round met. Searched by halving, with the last round's luck: the least
slowing down of the first plan as a whole that is a go, and the least margin everywhere whose plan is one.
"""

import json
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from math import isnan
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import report
from numpy import fmin

import mapping
import preflight
import vehicle
from flight import trajectory
from goshawk.commands.preflight import inputs
from tests import conftest
from tests.goshawk.running import answer

RISK, FIRST_MARGIN_M, GUST_STD_M_S, RATE_HZ = 0.01, 0.05, 1.0, 500
MOST_ROUNDS, SLOWEST, HALVINGS, LARGEST_M = 5, 4.0, 4, 0.4
FRESH_SEED, FRESH_FLIGHTS = 1000, 1000
WAYS = {
    "between the pillars": "0.8,0.8,1.0\n3.0,2.0,1.3\n5.2,0.8,1.0\n",
    "round the room": "0.8,0.8,1.0\n3.0,2.0,1.3\n5.2,0.8,1.0\n5.0,3.4,1.6\n1.0,3.2,1.2\n",
    "along a wall": "0.8,0.6,1.2\n5.2,0.6,1.2\n",
}


def rounds(folder: Path, name: str, way: str, flights: int) -> tuple[int, float, float, float, float]:
    """Rounds until a go; durations in seconds of that plan, and of the best scaling and margin; and the share of
    flights that it loses with other luck. NaN where there is none."""
    points, found = folder / f"{name}.csv", folder / f"{name} found.json"
    points.write_text(f"x,y,z\n{way}")
    first, plan = folder / f"{name} first.json", folder / f"{name} plan.json"
    met = False
    for turn in range(1, MOST_ROUNDS + 1):
        _plan(folder, points, plan, *(("--margin", FIRST_MARGIN_M) if turn == 1 else ("--preflown", found)))
        if turn == 1:
            first.write_bytes(plan.read_bytes())
        met = _preflown(folder, plan, found, flights, turn)
        if met or json.loads(found.read_text())["plan_again"] is None:
            break
    if not met:
        return turn, float("nan"), float("nan"), float("nan"), float("nan")
    taken_s = trajectory.load(plan).trajectory.duration_s
    _preflown(folder, plan, found, FRESH_FLIGHTS, FRESH_SEED)
    lost = json.loads(found.read_text())["risk"]["estimate"]
    if turn == 1:  # the first plan is a go: nothing to search
        return turn, taken_s, taken_s, taken_s, lost
    best_s = _least_margin(folder, points, flights, turn)
    return turn, taken_s, _scaled(folder, first, flights, turn), best_s, lost


def _plan(folder: Path, points: Path, plan: Path, *asked: object) -> None:
    world = ("--map", folder / "map", "--vehicle", folder / "vehicle.toml")
    planned = answer("plan", points, *world, *asked, "--out", plan, "-q", "--overwrite")
    if planned.returncode:
        raise RuntimeError(planned.stderr)


def _preflown(folder: Path, plan: Path, found: Path, flights: int, seed: int) -> bool:
    world = ("--map", folder / "map", "--vehicle", folder / "vehicle.toml")
    flown = ("--flights", flights, "--risk", RISK, "--gust-std", GUST_STD_M_S, "--seed", seed, "--rate", RATE_HZ)
    return answer("preflight", plan, *world, *flown, "--out", found, "-q", "--overwrite").returncode == 0


def _least_margin(folder: Path, points: Path, flights: int, seed: int) -> float:
    """Least duration found of a plan with one margin that is a go; NaN if none up to `LARGEST_M` is."""
    plan, best_s = folder / "tried.json", float("nan")
    low_m, high_m, halved = FIRST_MARGIN_M, FIRST_MARGIN_M, 0
    while halved < HALVINGS and low_m < LARGEST_M:
        tried_m = 1.5 * low_m if isnan(best_s) else 0.5 * (low_m + high_m)
        _plan(folder, points, plan, "--margin", tried_m)
        if _flown(folder, plan, flights, seed)(1.0):
            high_m, best_s = tried_m, fmin(best_s, trajectory.load(plan).trajectory.duration_s)
        else:
            low_m = tried_m
        halved += not isnan(best_s)
    return float(best_s)


def _scaled(folder: Path, first: Path, flights: int, seed: int) -> float:
    """Duration of the least uniform slowing down of a plan that is a go; NaN if none up to `SLOWEST` is."""
    is_go = _flown(folder, first, flights, seed)
    if not is_go(SLOWEST):
        return float("nan")
    low, high = 1.0, 1.0 if is_go(1.0) else SLOWEST
    while high / low > 1.02:
        middle = (low * high) ** 0.5
        low, high = (low, middle) if is_go(middle) else (middle, high)
    return high * trajectory.load(first).trajectory.duration_s


def _flown(folder: Path, plan: Path, flights: int, seed: int) -> Callable[[float], bool]:
    """Whether a plan, so many times slower, is a go."""
    item, drone, area = trajectory.load(plan), vehicle.load(folder / "vehicle.toml"), mapping.open_map(folder / "map")
    weather = preflight.Uncertainty(gust_std_m_s=GUST_STD_M_S)
    options = preflight.Options(flights, RISK, seed, weather, rate_hz=RATE_HZ, decide_only=True)
    subject = inputs.subject(item, area, drone, options)

    def is_go(factor: float) -> bool:
        scaled = replace(subject.scenario, trajectory=item.trajectory.scale_time(factor))
        return preflight.fly(scaled, subject.options).go

    return is_go


def _ratios(taken_s: float, scaled_s: float, best_s: float) -> list[report.Row]:
    margin = "... over that of the best margin searched"
    said = "... over that of the best uniform scaling"
    return [
        report.row(margin, taken_s / best_s, "x", "<= 1.05", taken_s <= 1.05 * best_s),
        report.row(f"{said}: none up to {SLOWEST:g} is a go", 0.0, "")
        if isnan(scaled_s)
        else report.row(said, taken_s / scaled_s, "x", "<= 1.05", taken_s <= 1.05 * scaled_s),
    ]


def rows(flights: int = 1000) -> list[report.Row]:
    """Measure all ways; the default takes some five minutes of processor time."""
    found: list[report.Row] = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "map").mkdir()
        conftest._make_pillar_map(folder / "map")
        vehicle.save(folder / "vehicle.toml", vehicle.example())
        for name, way in WAYS.items():
            turns, taken_s, scaled_s, best_s, lost = rounds(folder, name, way, flights)
            met = not isnan(taken_s)
            found += [
                report.row(f"{name}: rounds until a go", turns, "", "<= 3", met and turns <= 3),
                *([report.row("... the plan's duration", taken_s, "s")] if met else []),
                *([report.row("... lost with luck of no round", 100.0 * lost, "%")] if met else []),
            ]
            if met and turns > 1:
                found += _ratios(taken_s, scaled_s, best_s)
    return found


if __name__ == "__main__":
    report.main(rows, flights=1000)
