"""Draws what one iteration of an identification costs against flight length: `python identification_chart.py FILE.svg`.

Three flights of each length at 200 Hz, three steps each; CPU seconds of one core, the least of two runs.
"""

import sys
from pathlib import Path

import identification
import numpy as np
import report
import rotorpy_flights

import sysid
from sysid.report import drawing

LENGTHS_S = (5.0, 10.0, 20.0, 40.0)
STEPS = 3


def main(path: Path) -> None:
    longest = [
        rotorpy_flights.fly(kind, LENGTHS_S[-1], np.random.default_rng(i))
        for i, kind in enumerate(identification.KINDS)
    ]
    truth = rotorpy_flights.truth()
    options = sysid.Options(max_iterations=STEPS, gusts="white")
    unknowns, seconds = [], []
    for length_s in LENGTHS_S:
        cut = [log.slice(0.0, length_s) for log in longest]
        nodes = sum(len(f) for f in sysid.identify(cut, truth, options).flights)
        spent = report.cpu_seconds(lambda cut=cut: sysid.identify(cut, truth, options), 2)
        unknowns.append(12 * nodes)
        seconds.append(spent / (1 + STEPS))
        print(f"{length_s:4.0f} s  {12 * nodes:7d} unknowns  {seconds[-1]:.3f} CPU s per iteration")
    _draw(path, np.array(unknowns), np.array(seconds))


def _draw(path: Path, unknowns: np.ndarray, seconds: np.ndarray) -> None:
    slope = float((unknowns @ seconds) / (unknowns @ unknowns))
    look = drawing.look()
    figure, ((axes,),) = drawing.figure(1, 1, (5.2, 3.2))
    axes.plot(
        [0.0, unknowns[-1]], [0.0, slope * unknowns[-1]], color=look.pale, label=f"{1e6 * slope:.2f} µs per unknown"
    )
    axes.plot(unknowns, seconds, "o", color=look.colours[1], label="measured")
    for x, y, length_s in zip(unknowns, seconds, LENGTHS_S, strict=True):
        axes.annotate(f"3 x {length_s:g} s", (x, y), xytext=(6, -12), textcoords="offset points", fontsize=8)
    drawing.plain(axes, "", "unknowns", "CPU s per iteration")
    axes.set(xlim=(0.0, None), ylim=(0.0, None))
    axes.legend(frameon=False, fontsize=8)
    drawing.written(figure, path)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
