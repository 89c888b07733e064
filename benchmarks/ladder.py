"""The ladder of Rigter et al. (2019) on their vehicle, in simulation, and questions of ours: goshawk/paper/ladder.py.

Eight runs each. The paper's figures were flown. `--figure FILE` draws it.
"""

import argparse
import sys
from functools import cache
from pathlib import Path

import report

from goshawk.paper import ladder
from sysid.report import drawing

RUNS = 8


@cache
def measured() -> ladder.Measured:
    return ladder.measured(ladder.courses(), ladder.RUNGS, RUNS)


def rows() -> list[report.Row]:
    found = []
    for course in ladder.courses():
        for i, rung in enumerate(ladder.RUNGS):
            runs = measured()[course.name, rung.name]
            peers = {"std of the runs": float(runs.std(ddof=1))}
            bar = course.flown_cm.get(rung.name)
            if bar is not None:
                peers["Rigter et al., in flight"] = bar
            last = f"<= {bar}" if i == 2 else None
            good = bool(runs.mean() <= bar) if i == 2 and bar is not None else None
            found.append(report.row(f"{course.name}: {rung.name}", runs.mean(), "cm", last, good, peers))
    return found


if __name__ == "__main__":
    parser = argparse.ArgumentParser(add_help=False)
    parser.add_argument("--figure", type=Path, metavar="FILE")
    chosen, sys.argv[1:] = parser.parse_known_args()
    report.main(rows)
    if chosen.figure:
        chosen.figure.parent.mkdir(parents=True, exist_ok=True)
        drawing.written(ladder.drawn(measured(), ladder.RUNGS), chosen.figure)
