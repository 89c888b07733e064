"""A model predicts a flight badly: diagnose the missing effect, add it, compare the errors.

You will see: the verdict beside the truth, and the held-out error before and after in `error_falls.svg`. Set
OPENBLAS_NUM_THREADS=1: it is four times as fast.
"""

import sys
from pathlib import Path

import numpy as np

import vehicle
from flight import FlightLog
from sysid.diagnosis import diagnose
from sysid.diagnosis.procedure import Diagnosis
from sysid.report import diagnosis_figures, drawing
from vehicle import flights, manoeuvres
from vehicle.simulation.simulate import Wind

OUT = Path(sys.argv[1] if len(sys.argv) > 1 else "example-out")
HIDDEN = {"x_n_m_s": 0.0012, "y_n_m_s": 0.0012, "z_n_m_s": 0.0008}

known = vehicle.example()
truth = known.with_effect("angular_damping", source="hidden", **HIDDEN)


def fly(name: str, seed: int) -> FlightLog:
    """One manoeuvre in light gusts, as the sensors would record it."""
    rng = np.random.default_rng(seed)
    trajectory = manoeuvres.scaled(manoeuvres.make(name), 0.6)
    ride = flights.fly_trajectory(truth, trajectory, believed=known, wind=Wind(gust_std_m_s=0.1), rng=rng)
    log = flights.measure(ride, rng=rng)
    return FlightLog(log.columns, {**log.metadata, "name": name})


def diagnosis() -> Diagnosis:
    """Three flights to learn from, two that only judge."""
    learned_from = [fly(name, seed) for seed, name in enumerate(("rotation", "yaw_doublets", "oblique"))]
    return diagnose(learned_from, known, held_out=[fly("doublets", 9), fly("yaw_sweep", 10)], auto=True)


def main() -> None:
    found = diagnosis()
    print(f"verdict: {found.verdict} (confidence {found.confidence:.0%})")
    for candidate in found.candidates:
        if candidate.verdict == "present":
            for size in candidate.sizes:
                true = HIDDEN.get(size.parameter.split(".")[1], 0.0)
                print(f"  {size.parameter}: {size.value:.5f} ± {size.sigma:.5f} {size.unit}, the truth is {true:g}")
    for step in found.staircase:
        error_mm = 1e3 * step.position_m["0.5 s"]
        print(f"  {step.model}: {error_mm:.1f} mm off after 0.5 s, on held-out flights")
    OUT.mkdir(parents=True, exist_ok=True)
    print(f"figure: {drawing.written(diagnosis_figures.staircase(found), OUT / 'error_falls.svg')}")


if __name__ == "__main__":
    main()
