"""Their vehicle identified from simulated flights, trial by trial: Table I, and parameters over the trials (Fig. 8).

The simulator shares its laws with the model that is fitted; noise, delay of the pose, gusts, motor lag and the pose
sensor's place are what an estimator has to get over here. The fit begins with what a drawing and a guess would give.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

import sysid
from firmware_bridge import Sensors, closed_loop
from firmware_bridge.controller import parameters_of
from flight import FlightLog, FloatArray, Progress, Trajectory, flight_log, rotations
from goshawk.paper import curves, ladder, theirs
from sysid.report import plots
from vehicle import Vehicle, simulate

TRIALS = 6
GUESS_RATIO = 0.3
"""Standard deviation of a first guess, over the true value, of what no drawing tells."""
_EVERY = 2
"""Instants of a log: 100 a second are kept."""
PICTURE = "trials.svg"


def begun_with(seed: int) -> Vehicle:
    """Inertias of the drawing, a pose sensor at the centre, and everything else of Table I guessed."""
    rng, drone = np.random.default_rng(seed), theirs.drone()
    for row in theirs.table():
        if row.cad is not None:
            drone = drone.with_value(row.name, row.cad)
        elif row.name.startswith(("pose_sensor", "centre_of_mass")):
            drone = drone.with_value(row.name, 0.0)
        else:
            drone = drone.with_value(row.name, row.value * float(np.exp(GUESS_RATIO * rng.standard_normal())))
    return drone


def flown(seed: int) -> list[FlightLog]:
    """One trial: a vertical flight, a fast level one and one on all axes, of a size of their own."""
    rng = np.random.default_rng(seed)
    faster = rng.uniform(0.85, 1.0, 3)
    paths = (
        curves.vertical(3.1 * faster[0], turns=3), curves.figure_eight(8.5 * faster[1], turns=2),
        curves.general(1.4 * faster[2], turns=2),
    )  # fmt: skip
    return [_log(path, 10 * seed + i, rng) for i, path in enumerate(paths)]


def _log(path: Trajectory, seed: int, rng: np.random.Generator) -> FlightLog:
    truth = theirs.drone()
    plant = simulate.Plant(truth, ladder.below(path), rng=rng, wind=ladder.GUSTS, ground_m=0.0)
    log = closed_loop.fly(plant, parameters_of(truth), path, sensors=Sensors.typical(), seed=seed).log
    return seen_by_sensor(log, np.array([truth.value(f"pose_sensor_{axis}_m") for axis in "xyz"]))


def seen_by_sensor(log: FlightLog, place_body_m: FloatArray) -> FlightLog:
    """Pose of a sensor that does not sit at the centre, turning rates and rotor speeds: every other instant."""
    q = log.vector("q_world_body")
    kept = {
        "position_world_m": log.vector("position_world_m") + rotations.rotate(q, place_body_m),
        "q_world_body": q,
        **{name: log.vector(name) for name in ("rate_body_rad_s", "rotor_speed_rad_s")},
    }
    thinned = {name: values[::_EVERY] for name, values in kept.items()}
    return flight_log.from_vectors(log.time_s[::_EVERY], thinned, metadata={"source": "simulated"})


def found(trials: int, progress: Progress) -> list[sysid.Identification]:
    """Fly and fit every trial."""
    fits = []
    for trial in range(1, trials + 1):
        progress(f"fly trial {trial} of {trials}", (trial - 1) / trials)
        logs = flown(trial)
        progress(f"identify trial {trial} of {trials}", (trial - 0.5) / trials)
        fits.append(sysid.identify(logs, begun_with(trial)))
    return fits


def facts(trials: Sequence[sysid.Identification]) -> list[dict[str, Any]]:
    """Rows of Table I: theirs, of their drawing, ours with standard errors, each of one trial."""
    return [_row(row, trials) for row in theirs.table()]


def _row(printed: theirs.Printed, trials: Sequence[sysid.Identification]) -> dict[str, Any]:
    each = [fit.estimate(printed.name) for fit in trials]
    values = np.array([estimate.value for estimate in each])
    error = float(np.sqrt(np.mean([estimate.std_robust**2 for estimate in each])))
    return {
        "name": printed.name, "unit": printed.unit, "theirs": printed.value, "their_cad": printed.cad,
        "their_standard_error": theirs.NOT_KNOWN, "ours": float(values.mean()), "standard_error_of_one_trial": error,
        "spread": float(values.std(ddof=1)) if len(values) > 1 else None, "trials": values.tolist(),
        "begun_with": float(np.mean([estimate.start for estimate in each])),
    }  # fmt: skip


def draw(trials: Sequence[sysid.Identification], folder: Path) -> Path:
    """One parameter of Table I a panel, over the trials."""
    names = [row.name for row in theirs.table()]
    return plots.repeated(trials, names, folder / PICTURE)
