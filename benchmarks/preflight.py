"""A preflight measured: throughput, memory, coverage of the tube, and contact probabilities.

Who is named: preflight_causes.py.

    python benchmarks/preflight.py --json build/bench/preflight.json
    python benchmarks/preflight.py --truths 300 --scenes 100 --peer PYTHON   # the whole bar, crazyflow beside it
    python benchmarks/preflight.py --flights 0 --truths 0 --scenes 0 --brute 200000 --seeds 5  # also a contact of 1e-4

Every flight is simulated. CPU seconds are of all threads; wall time needs an otherwise idle machine.
"""

import hashlib
import os
import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import report

import preflight
import vehicle
from firmware_bridge import controller
from flight import FloatArray, Trajectory
from preflight import _preflight, core, draws, statistics, study
from preflight.draws import Uncertainty
from preflight.record import OVERTURNED_RAD, Record
from tests.preflight import conftest, test_exam, test_exam_of_other_physics

PATH_S = 20.0
RADIUS_M = 0.2
CRAZYFLOW_STEPS_PER_CPU_S, CRAZYFLOW_WORLDS = 0.10e6, 1024
"""Of crazyflow, as the bar was set on a machine of two cores; for want of a `--peer`."""
CHUNK, FIRST_SEED = 1000, 10000
SHORT = (1.0, 1.0)
"""Length in m and duration in s of a short plan, one way."""
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


def throughput(flights: int, peer: str) -> list[report.Row]:
    drone, path = conftest.exact_vehicle(), long_path()
    options = preflight.Options(flights=flights, uncertainty=WEATHER, rate_hz=500, explain=False)
    cpu_s, wall_s = time.process_time(), time.perf_counter()
    found = preflight.fly(preflight.Scenario(drone, path, Wall(0.5), radius_m=RADIUS_M, clearance_m=1.0), options)
    cpu_s, wall_s = time.process_time() - cpu_s, time.perf_counter() - wall_s
    scale = 1000.0 / flights
    rate = found.steps / cpu_s
    memory_gib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    name, theirs = ("crazyflow", crazyflow(peer)) if peer else ("crazyflow, from the bar", CRAZYFLOW_STEPS_PER_CPU_S)
    return [
        report.row("flights of 20 s, flown", flights, ""),
        report.row("1,000 flights of 20 s, wall", wall_s * scale, "s", "<= 40", wall_s * scale <= 40.0),
        report.row("1,000 flights of 20 s, CPU", cpu_s * scale, "s"),
        report.row("closed-loop steps per CPU second", rate, "1/s", f">= {2.0 * theirs:.3g}", rate >= 2.0 * theirs,
                   {name: theirs}),
        report.row("memory, whole process", memory_gib, "GiB", "<= 1", memory_gib <= 1.0),
    ]  # fmt: skip


def crazyflow(interpreter: str) -> float:
    """Its steps per CPU second, here and now."""
    script = Path(__file__).with_name("crazyflow_steps.py")
    done = subprocess.run(
        [interpreter, script, str(CRAZYFLOW_WORLDS), "200"], cwd=tempfile.gettempdir(), capture_output=True, text=True
    )
    if done.returncode:
        raise SystemExit(f"{interpreter} could not fly crazyflow:\n{done.stderr[-2000:]}")
    return float(done.stdout.split()[-1])  # after warnings


def same_bits() -> list[report.Row]:
    drone = draws.flown_form(conftest.exact_vehicle())
    loop = core.Loop(drone, long_path(), controller.parameters_of(drone), clearance_m=1.0, rate_hz=500)
    drawn = draws.draw(drone, loop.names, WEATHER, 8, 1)
    one, many = (loop.fly(drawn.values, drawn.rows, seed=1, threads=n) for n in (1, os.cpu_count() or 2))
    equal = np.array_equal(one.position_world_m, many.position_world_m, equal_nan=True)
    return [report.row("bits equal on 1 and all threads", equal, "", "1", equal)]


def coverage(truths: int, flights: int, kinds: int) -> list[report.Row]:
    ninety, ninety_nine = test_exam.held(truths, flights)
    rows = [
        report.row(f"90 % tube holds in {truths} flights of another loop", 100.0 * ninety, "%", "87-93",
                   0.87 <= ninety <= 0.93),
        report.row("99 % tube holds", 100.0 * ninety_nine, "%"),
    ]  # fmt: skip
    for expected, seen in test_exam.frequencies(truths, flights):
        rows.append(report.row(f"contact, predicted {expected:.2f}: seen by another loop", seen, ""))
    return rows + [
        row for of in list(test_exam_of_other_physics.SUBJECTS)[:kinds] for row in of_other_physics(truths, of)
    ]


def of_other_physics(truths: int, of: str = test_exam_of_other_physics.OWN) -> list[report.Row]:
    """A truth whose plant and gusts share no line with a preflight, identified from its logs, preflown and flown.

    Shared are the controller and its rate, the sensors' noise (`Sensors.typical`), the gusts' size and length, the
    forms of the laws of thrust and drag, and how far the truths' lags spread: as far as the model says.
    """
    (fifty, ninety, ninety_nine), seen = test_exam_of_other_physics.beside(truths, 1000, of)
    rows = [
        report.row(f"90 % tube holds in {truths} flights of other physics ({of})", 100.0 * ninety, "%", "87-93",
                   0.87 <= ninety <= 0.93),
        report.row("50 % tube holds", 100.0 * fifty, "%"),
        report.row("99 % tube holds", 100.0 * ninety_nine, "%"),
    ]  # fmt: skip
    return rows + [report.row(f"contact, predicted {each:.2f}: seen", share, "") for each, share in seen]


def short(
    flights: int, seed: int, uncertainty: Uncertainty, wall_m: float = 0.0, by_levels: bool = False
) -> preflight.Result:
    """Flights of a plan of 2 s, 1 m there and back, beside a wall on the right."""
    options = replace(asked(flights, seed, uncertainty), rare=by_levels, decide_only=by_levels)
    return preflight.fly(beside(wall_m), options)


def asked(flights: int, seed: int, uncertainty: Uncertainty) -> preflight.Options:
    return preflight.Options(
        flights=flights, seed=seed, uncertainty=uncertainty, rate_hz=400, rare=False, risk=study.LEAST_RISK,
        explain=False,
    )  # fmt: skip


def beside(wall_m: float) -> preflight.Scenario:
    path = conftest.there_and_back(*SHORT)
    return preflight.Scenario(conftest.exact_vehicle(), path, conftest.Wall(0.0), radius_m=-wall_m)


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


@dataclass(frozen=True)
class Kept:
    """Many flights of one world, `CHUNK` by `CHUNK`, each in a file: what was flown is not flown again, unless its file
    is damaged."""

    folder: Path
    world: Uncertainty
    flights: int

    @cached_property
    def clearance(self) -> FloatArray:
        """(flights,) as `nearest`."""
        chunks = -(-self.flights // CHUNK)
        return np.concatenate([self._chunk(i, chunks) for i in range(chunks)])[: self.flights]

    @cached_property
    def _stem(self) -> str:
        """Of the files: other code, another world, plan, vehicle, wall or other options have others."""
        code = [Path(_preflight.__file__), *sorted(Path(preflight.__file__).parent.glob("*.py"))]
        digest, flown = hashlib.sha256(), beside(0.0)
        told = (asked(CHUNK, 0, self.world), vehicle.vehicle_hash(flown.vehicle), vars(flown.field), flown.size_m)
        path = flown.trajectory.durations_s.tobytes() + flown.trajectory.coefficients.tobytes()
        for part in (repr(told).encode(), path, *(file.read_bytes() for file in code)):
            digest.update(hashlib.sha256(part).digest())
        return f"{digest.hexdigest()[:16]}_{CHUNK}"

    def _chunk(self, number: int, chunks: int) -> FloatArray:
        seed = FIRST_SEED + number
        file = self.folder / f"{self._stem}_{seed}.npy"
        if (kept := _read(file)) is not None:
            return kept
        print(f"flights {CHUNK * number} of {CHUNK * chunks}", file=sys.stderr, flush=True)
        self.folder.mkdir(parents=True, exist_ok=True)
        found, part = short(CHUNK, seed, self.world), file.with_suffix(".part")
        if found.cut_off:
            raise KeyboardInterrupt
        flown = nearest(found.record)
        with part.open("wb") as out:
            np.save(out, flown)
        part.replace(file)
        return flown


def _read(file: Path) -> FloatArray | None:
    """(`CHUNK`,) of a file; None where there is none, or it is damaged."""
    try:
        kept = np.load(file)
    except (OSError, ValueError, EOFError):
        return None
    return kept if kept.shape == (CHUNK,) and kept.dtype == np.float64 else None


def contacts(kept: Kept, flights: int) -> list[report.Row]:
    """Walls that a tenth and a hundredth of many flights touch, and what fewer with another seed say of them."""
    many, few = kept.clearance, nearest(short(flights, 2, GUSTY).record)
    rows = []
    for probability in (1e-1, 1e-2):
        wall_m, chance = wall(many, probability)
        count = int(np.count_nonzero(few < -wall_m))
        ratio = max(count / flights / chance, chance * flights / max(count, 1))
        rows.append(
            report.row(f"contact {probability:g} of {len(many)} flights, {flights} others: off by", ratio, "x",
                       "<= 1.5", ratio <= 1.5)
        )  # fmt: skip
        bound = statistics.upper_bound(count, flights)
        rows.append(report.row("... their upper bound holds", bound >= chance, "", "1", bound >= chance))
    return rows


def bounds(clearance: FloatArray, scenes: int = 100) -> list[report.Row]:
    """Scenes of unlike risk made of the same flights: another set of them each time."""
    rng, held, flights = np.random.default_rng(4), 0, len(clearance) // scenes
    for scene in range(scenes):
        mine = slice(scene * flights, (scene + 1) * flights)
        wall_m, _ = wall(clearance, float(rng.uniform(0.002, 0.2)))
        truth = np.mean(np.delete(clearance, mine) < -wall_m)
        bound = statistics.upper_bound(int(np.count_nonzero(clearance[mine] < -wall_m)), flights)
        held += int(bound >= float(truth))
    name = f"stated 95 % bound holds, of {scenes} scenes of {flights} flights"
    return [report.row(name, held, "", f">= {0.93 * scenes:g}", held >= 0.93 * scenes)]


def rare_contacts(clearance: FloatArray, seeds: int = 1) -> list[report.Row]:
    """Walls that a tenth to a ten-thousandth of many flights touch, and what levels say of them: the worst seed's.

    Where a twentieth of the many is the most, levels take what that allows.
    """
    brute, rows = len(clearance), []
    for probability in (p for p in (1e-1, 1e-2, 1e-3, 1e-4) if p * brute >= 20):
        wall_m, chance = wall(clearance, probability)
        most, few, level = (1.5, brute, 1000) if probability >= 1e-3 else (2.0, brute / 20, 2000)
        found = [short(level, 2 + seed, GUSTY, wall_m, True) for seed in range(seeds)]
        estimates = [each.lost.estimate for each in found]
        ratio = max(max(estimate / chance, chance / estimate) for estimate in estimates)
        held = all(each.lost.upper >= chance for each in found)
        flown = max(each.rare.risk.flights for each in found if each.rare is not None)
        rows += [
            report.row(f"by levels, contact {probability:g} of {brute} flights: off by", ratio, "x", f"<= {most:g}",
                       ratio <= most),
            report.row("... in flights", flown, "", f"<= {few:g}", flown <= few),
            report.row("... its upper bound holds", held, "", "1", held),
        ]  # fmt: skip
        told = ", ".join(f"{estimate:.2e}" for estimate in estimates)
        print(f"contact {probability:g}: {chance:.2e} of {brute}, {told} by levels", file=sys.stderr)
    return rows


def rare_bounds(scenes: int, many: list[FloatArray]) -> list[report.Row]:
    """Walls at unlike distances in the `WORLDS`, each by levels of 200 flights, beside what many flights say."""
    rng, held = np.random.default_rng(5), 0
    for scene in range(scenes):
        at = scene % len(WORLDS)
        chance = float(np.exp(rng.uniform(np.log(0.003), np.log(0.1))))
        wall_m, truth = wall(many[at], chance)
        found = short(200, 100 + scene, WORLDS[at], wall_m, True)
        held += int(found.lost.upper >= truth)
        print(f"{held} of {scene + 1} bounds hold", file=sys.stderr, flush=True)
    least = 0.93 * scenes
    return [
        report.row(f"by levels, stated 95 % bound holds, of {scenes} scenes", held, "", f">= {least:g}", held >= least)
    ]


def rows(
    flights: int, brute: int, truths: int, scenes: int, peer: str, keep: str, seeds: int, kinds: int
) -> list[report.Row]:
    """Measure a preflight; defaults take about twenty minutes of processor time. 0 flights, brute flights, truths or
    scenes: without these rows.

    What was flown of the brute flights stays in the folder `keep`: after an interruption the same command goes on.
    `peer`: an interpreter that has crazyflow. `seeds`: of the levels. `kinds`: of other physics, at most 3.
    """
    measured = [*throughput(flights, peer), *same_bits()] if flights else []
    measured += coverage(truths, 2000, kinds) if truths else []
    if not brute:
        return measured
    kept = Kept(Path(keep), GUSTY, brute)
    measured += [*contacts(kept, max(min(brute // 8, 2500), 1000)), *bounds(kept.clearance[:20000])]
    measured += rare_contacts(kept.clearance, seeds)
    if scenes:
        many = [Kept(Path(keep), world, min(brute, 5000)).clearance for world in WORLDS]
        measured += rare_bounds(scenes, many)
    return measured


if __name__ == "__main__":
    report.main(
        rows, flights=1000, brute=20000, truths=100, scenes=40, peer="", keep="build/bench/preflight", seeds=1, kinds=3
    )
