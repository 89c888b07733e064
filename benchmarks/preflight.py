"""A preflight measured: throughput, memory, coverage of the tube, and contact probabilities.

Who is named: preflight_causes.py.

    python benchmarks/preflight.py --json build/bench/preflight.json
    python benchmarks/preflight.py --flights 1000 --brute 20000 --truths 300 --scenes 100   # the whole bar
    ... --brute 200000   # also a contact of 1e-4

Every flight is simulated. CPU seconds are of all threads; wall time needs an otherwise idle machine.
"""

import os
import resource
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import report

import preflight
from firmware_bridge import controller
from flight import FloatArray, Trajectory
from preflight import core, draws, statistics, study
from preflight.draws import Uncertainty
from preflight.record import OVERTURNED_RAD, Record
from tests.preflight import conftest, test_exam

PATH_S = 20.0
RADIUS_M = 0.2
CRAZYFLOW_STEPS_PER_CPU_S = 0.10e6
"""Of crazyflow with 1,024 worlds, as the bar was set on a machine of two cores; not measured here."""
WEATHER = Uncertainty(wind_m_s=2.0, gust_std_m_s=1.0)


def long_path() -> Trajectory:
    """There and back five times, 20 s."""
    one = conftest.there_and_back(4.0, 2.0)
    return Trajectory(np.full(10, 2.0), np.tile(one.coefficients, (5, 1, 1)))


class Wall(conftest.Wall):
    """A wall beside the way, and a floor."""

    def distance(self, points_world_m):
        points = np.asarray(points_world_m)
        return np.minimum(super().distance(points), points[:, 2])


def throughput(flights: int) -> list[report.Row]:
    drone, path = conftest.exact_vehicle(), long_path()
    options = preflight.Options(flights=flights, uncertainty=WEATHER, explain=False)
    cpu_s, wall_s = time.process_time(), time.perf_counter()
    found = preflight.fly(
        preflight.Scenario(preflight.Scenario(drone, path, Wall(0.5), radius_m=RADIUS_M, clearance_m=1.0), options)
    )
    cpu_s, wall_s = time.process_time() - cpu_s, time.perf_counter() - wall_s
    scale = 1000.0 / flights
    rate = found.steps / cpu_s
    memory_gib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    least = 2.0 * CRAZYFLOW_STEPS_PER_CPU_S
    peer = {"crazyflow, from the bar": CRAZYFLOW_STEPS_PER_CPU_S}
    return [
        report.row("flights of 20 s, flown", flights, ""),
        report.row("1,000 flights of 20 s, wall", wall_s * scale, "s", "<= 40", wall_s * scale <= 40.0),
        report.row("1,000 flights of 20 s, CPU", cpu_s * scale, "s"),
        report.row("closed-loop steps per CPU second", rate, "1/s", f">= {least:g}", rate >= least, peer),
        report.row("memory, whole process", memory_gib, "GiB", "<= 1", memory_gib <= 1.0),
    ]


def same_bits() -> list[report.Row]:
    drone = draws.flown_form(conftest.exact_vehicle())
    loop = core.Loop(drone, long_path(), controller.parameters_of(drone), clearance_m=1.0)
    drawn = draws.draw(drone, loop.names, WEATHER, 8, 1)
    one, many = (loop.fly(drawn.values, drawn.rows, seed=1, threads=n) for n in (1, os.cpu_count() or 2))
    equal = np.array_equal(one.position_world_m, many.position_world_m, equal_nan=True)
    return [report.row("bits equal on 1 and all threads", equal, "", "1", equal)]


def coverage(truths: int, flights: int) -> list[report.Row]:
    ninety, ninety_nine = test_exam.held(truths, flights)
    rows = [
        report.row(f"90 % tube holds in {truths} flights of another loop", 100.0 * ninety, "%", "87-93",
                   0.87 <= ninety <= 0.93),
        report.row("99 % tube holds", 100.0 * ninety_nine, "%"),
    ]  # fmt: skip
    for expected, seen in test_exam.frequencies(truths, flights):
        rows.append(report.row(f"contact, predicted {expected:.2f}: seen by another loop", seen, ""))
    return rows


def contacts(flights: int, brute: int) -> list[report.Row]:
    """Walls that a tenth and a hundredth of many flights touch, and what fewer with another seed say of them."""
    drone, path = conftest.exact_vehicle(), conftest.there_and_back()

    def clearance(count: int, seed: int) -> FloatArray:
        options = preflight.Options(flights=count, seed=seed, uncertainty=WEATHER, explain=False)
        return preflight.fly(
            preflight.Scenario(preflight.Scenario(drone, path, conftest.Wall(0.0), radius_m=0.0), options)
        ).record.clearance_m

    many, few = clearance(brute, 1), clearance(flights, 2)
    rows = []
    for probability in (1e-1, 1e-2):
        wall_m = float(np.quantile(many, probability))
        count = int(np.count_nonzero(few < wall_m))
        ratio = max(count / flights / probability, probability * flights / max(count, 1))
        rows.append(
            report.row(f"contact {probability:g} of {brute} flights, {flights} others: off by", ratio, "x", "<= 1.5",
                       ratio <= 1.5)
        )  # fmt: skip
        bound = statistics.upper_bound(count, flights)
        rows.append(report.row("... their upper bound holds", bound >= probability, "", "1", bound >= probability))
    return rows


def bounds(flights: int, scenes: int = 100) -> list[report.Row]:
    """Scenes of unlike risk made of the same flights: another set of them each time."""
    drone, path, rng = conftest.exact_vehicle(), conftest.there_and_back(), np.random.default_rng(4)
    options = preflight.Options(flights=scenes * flights, uncertainty=WEATHER, explain=False)
    clearance = preflight.fly(
        preflight.Scenario(preflight.Scenario(drone, path, conftest.Wall(0.0), radius_m=0.0), options)
    ).record.clearance_m
    held = 0
    for scene in range(scenes):
        mine = slice(scene * flights, (scene + 1) * flights)
        wall_m = np.quantile(clearance, rng.uniform(0.002, 0.2))
        truth = np.mean(np.delete(clearance, mine) < wall_m)
        bound = statistics.upper_bound(int(np.count_nonzero(clearance[mine] < wall_m)), flights)
        held += int(bound >= float(truth))
    return [report.row(f"stated 95 % bound holds, of {scenes} scenes", held, "", ">= 93", held >= 93)]


def short(
    flights: int, seed: int, uncertainty: Uncertainty, wall_m: float = 0.0, by_levels: bool = False
) -> preflight.Result:
    """Flights of a plan of 2 s, 1 m there and back, beside a wall on the right."""
    options = preflight.Options(
        flights=flights, seed=seed, uncertainty=uncertainty, rate_hz=400, rare=by_levels, risk=study.LEAST_RISK,
        explain=False, decide_only=by_levels,
    )  # fmt: skip
    path = conftest.there_and_back(1.0, 1.0)
    return preflight.fly(
        preflight.Scenario(
            preflight.Scenario(conftest.exact_vehicle(), path, conftest.Wall(0.0), radius_m=-wall_m), options
        )
    )


def nearest(record: Record) -> FloatArray:
    """Clearance from a wall of no distance; of flights that are lost in another way, below that of any."""
    other = record.left_map | record.fell | (record.tilt_rad > OVERTURNED_RAD)
    return np.where(other, -np.inf, record.clearance_m)


def wall(clearance: FloatArray, probability: float) -> tuple[float, float]:
    """How far a wall is that so many flights touch, and how many are lost beside it, the others included."""
    away_m = -float(np.quantile(clearance[np.isfinite(clearance)], probability))
    return away_m, float(np.mean(clearance < -away_m))


GUSTY = Uncertainty(wind_m_s=2.0, gust_std_m_s=1.5, start_std_m=0.02)
WORLDS = (GUSTY, Uncertainty(), replace(GUSTY, localization_std_m=0.05), Uncertainty(drop_outs_per_s=0.5, wind_m_s=4.0))


def rare_contacts(brute: int) -> list[report.Row]:
    """Walls that a tenth to a ten-thousandth of many flights touch, and what levels of a thousand say of them."""
    clearance = nearest(short(brute, 1, GUSTY).record)
    rows = []
    for probability in (p for p in (1e-1, 1e-2, 1e-3, 1e-4) if p * brute >= 20):
        wall_m, chance = wall(clearance, probability)
        found = short(1000, 2, GUSTY, wall_m, True)
        ratio = max(found.lost.estimate / chance, chance / found.lost.estimate)
        most = 1.5 if probability >= 1e-3 else 2.0
        held = found.lost.upper >= chance
        rows += [
            report.row(f"by levels, contact {probability:g} of {brute} flights: off by", ratio, "x", f"<= {most:g}",
                       ratio <= most),
            report.row("... flights", found.lost.flights, ""),
            report.row("... its upper bound holds", held, "", "1", held),
        ]  # fmt: skip
    return rows


def rare_bounds(scenes: int, brute: int) -> list[report.Row]:
    """Walls at unlike distances in unlike worlds, each by levels of 200 flights, beside what many flights say."""
    rng, held = np.random.default_rng(5), 0
    many = [nearest(short(brute, 1, world).record) for world in WORLDS]
    for scene in range(scenes):
        at = scene % len(WORLDS)
        chance = float(np.exp(rng.uniform(np.log(0.003), np.log(0.1))))
        wall_m, truth = wall(many[at], chance)
        found = short(200, 100 + scene, WORLDS[at], wall_m, True)
        held += int(found.lost.upper >= truth)
    least = 0.93 * scenes
    return [
        report.row(f"by levels, stated 95 % bound holds, of {scenes} scenes", held, "", f">= {least:g}", held >= least)
    ]


def rows(flights: int, brute: int, truths: int, scenes: int) -> list[report.Row]:
    """Measure a preflight; defaults take about twenty minutes of processor time."""
    return [
        *throughput(flights), *same_bits(), *coverage(truths, 2000), *contacts(max(brute // 8, 1000), brute),
        *bounds(brute // 200), *rare_contacts(brute), *rare_bounds(scenes, min(brute, 5000)),
    ]  # fmt: skip


if __name__ == "__main__":
    report.main(rows, flights=1000, brute=20000, truths=100, scenes=40)
