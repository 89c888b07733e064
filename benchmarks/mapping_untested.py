"""Is the true scale within what a map states, whatever may be wrong with its camera file, with and without times?

    python benchmarks/mapping_untested.py --draws 12               every form of error, timed and untimed

The matches are made by formula from a true rig (see `mapping.tracks`): images are 0.1 s apart, a late camera is 20 ms
late, a rolling shutter takes 10 ms, a rig is turned by 1 deg, a lens is off by .5 to 1.5 % and k1 by .003 to .008.
"""

import argparse
import dataclasses
import importlib.util
import time
from pathlib import Path
from types import ModuleType

import numpy as np
import report
from report import Row, row

from flight import FloatArray
from goshawk.rendered import world as rendered_world
from mapping.camera import trial as trials
from mapping.camera.adjustment import Observations
from mapping.camera.trial import Trial

FORMS = ("none", "late", "shutter", "rig", "lens")
INSTANTS, POINTS_PER_M = 24, 250.0
LATE_S = 0.020
SIGMAS95 = 1.96
LEAST_WITHIN, MOST_FALSE = 0.93, 0.02


def _blind_draws() -> ModuleType:
    """The benchmark beside this one: its name is that of our package."""
    spec = importlib.util.spec_from_file_location("mapping_benchmark", Path(__file__).with_name("mapping.py"))
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def extent(T_world_body: FloatArray) -> float:
    positions = T_world_body[:, :3, 3]
    return float(np.linalg.norm(positions - positions.mean(axis=0)))


def seen(blind: ModuleType, form: str, number: int, seed: int) -> tuple[Observations, FloatArray]:
    """What a rig with this error saw, and the true poses."""
    drawn = blind.draw("offset" if form == "late" else form, np.random.default_rng([seed, number]))
    if form == "late":
        drawn = dataclasses.replace(drawn, offset_s=LATE_S * np.sign(drawn.offset_s))
    return blind.tracks(
        drawn,
        rendered_world.default_rig(0.75),
        instants=INSTANTS,
        points_per_m=POINTS_PER_M,
        rng=np.random.default_rng([seed, number, 1]),
    )


def line(form: str, way: str, found: Trial, T_true: FloatArray) -> float:
    """Prints one trial; returns the scale's error over its stated standard deviation."""
    off = extent(found.T_world_body) / extent(T_true) - 1.0
    print(
        f"{form:8s} {way:8s} scale off {100.0 * off:6.2f} %, stated {100.0 * found.scale_std:5.2f} %; "
        f"{', '.join(str(f.candidate) for f in found.present) or 'nothing found'}",
        flush=True,
    )
    return abs(off) / found.scale_std


def campaign(draws: int, seed: int) -> list[Row]:
    blind = _blind_draws()
    off: dict[str, list[float]] = {"timed": [], "untimed": []}
    false = 0
    started_s = time.process_time()
    for number in range(draws):
        for form in FORMS:
            timed, T_true = seen(blind, form, number, seed)
            for way in off:
                times_s = timed.time_s if way == "timed" else np.full(INSTANTS, np.nan)
                found = trials.hold(dataclasses.replace(timed, time_s=times_s))
                off[way].append(line(form, way, found, T_true))
                false += form == "none" and bool(found.present)
    within = {way: float(np.mean(np.array(sigmas) < SIGMAS95)) for way, sigmas in off.items()}
    rows = [
        row(
            f"{way}: scale within the stated 95 % ({len(off[way])})",
            share,
            "share",
            f">= {LEAST_WITHIN}",
            share >= LEAST_WITHIN,
        )
        for way, share in within.items()
    ]
    wrong = false / (2 * draws)
    rows.append(row(f"right files corrected ({2 * draws})", wrong, "share", f"<= {MOST_FALSE}", wrong <= MOST_FALSE))
    return [*rows, row("CPU a trial", (time.process_time() - started_s) / (2 * draws * len(FORMS)), "s")]


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--draws", type=int, default=12)
    arguments.add_argument("--seed", type=int, default=21)
    arguments.add_argument("--json", type=Path)
    given = arguments.parse_args()
    rows = campaign(given.draws, given.seed)
    report.print_table(rows)
    if given.json:
        report.write(rows, given.json)


if __name__ == "__main__":
    main()
