"""Two other ways to the same numbers: the paper's three stages, and a regression that takes a second."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from flight import FlightLog, InputError, Progress, silent
from sysid.estimator.blocks.pose import PoseSensor
from sysid.estimator.flights.sampling import means_over
from sysid.estimator.identification import identify
from sysid.estimator.joint_problem.problem import with_values
from sysid.estimator.joint_problem.unknowns import chosen_names, model_parameters
from sysid.estimator.motors import motor
from sysid.estimator.options import Options
from sysid.estimator.prepare import prepare_all
from sysid.estimator.result import Identification
from sysid.estimator.trajectory.midpoint import middle
from sysid.estimator.trajectory.model import slopes_along, unexplained
from sysid.estimator.trajectory.states import first_guess
from vehicle import Vehicle, effects, specs

STAGES = ("vertical", "horizontal", "rotation")
"""The paper's flights in order; each fixes what the next ones need."""


def identify_in_stages(
    logs: Mapping[str, Sequence[FlightLog]],
    vehicle: Vehicle,
    options: Options | None = None,
    *,
    progress: Progress = silent,
) -> dict[str, Identification]:
    """The scheme of Rigter et al.: thrust from vertical flights, then drag from horizontal, then torques from rotation.

    The joint fit (`identify`) uses every flight for every parameter and is better; this one shows which flight says
    what. The vehicle of the last stage carries all results.

    Args:
        logs: flights for each of `STAGES`.
    """
    missing = [stage for stage in STAGES if not logs.get(stage)]
    if missing:
        raise InputError(f"no flight for {', '.join(missing)}; the three stages are {', '.join(STAGES)}")
    results: dict[str, Identification] = {}
    given = vehicle
    for stage in STAGES:
        free = tuple(name for name in model_parameters(vehicle) if stage_of(name) == stage)
        staged = replace(options or Options(), free=free)
        results[stage] = identify(logs[stage], vehicle, staged, given=given, progress=progress)
        vehicle = results[stage].vehicle
    return results


def stage_of(name: str) -> str:
    """Which stage a parameter belongs to, by the channel its effect shows in."""
    if "." not in name:
        return "rotation"
    effect = effects.find(name.split(".")[0])
    if effect.channel.startswith("F_z") or "_z_" in name:
        return "vertical"
    return "horizontal" if effect.channel.startswith("F") else "rotation"


def regress(logs: Sequence[FlightLog], vehicle: Vehicle, options: Options | None = None) -> Vehicle:
    """A start value in a second: smooth the pose, differentiate, regress. Never the answer, for it is biased.

    Differentiation passes what noise it likes and hides fast motion; inertias come out some per cent off.
    """
    options = options or Options()
    flights = prepare_all(logs, options, [vehicle])
    names = chosen_names(vehicle, options.free, options.held)
    bounds = np.array([specs(vehicle)[name].bounds for name in names]).reshape(-1, 2)
    sensor = PoseSensor.of(vehicle)
    states = [first_guess(f, sensor.offset_body_m, sensor.q_body_sensor) for f in flights]
    for _ in range(4):
        columns, left = [], []
        for flight, state in zip((motor.driven(f, vehicle) for f in flights), states, strict=True):
            mid = middle(flight, state)
            time_s = flight.time_s[:-1]
            slopes = slopes_along(vehicle, names, flight, mid).parameters
            flat = means_over(slopes.reshape(len(slopes), -1), time_s, 0.1)
            columns.append(flat.reshape(len(flat), 6, len(names)))
            left.append(means_over(unexplained(flight, state, vehicle), time_s, 0.1))
        x, y = np.concatenate(columns), np.concatenate(left)
        scale = y.std(axis=0) + 1e-9
        size = np.abs(x).max(axis=(0, 1)) + 1e-300
        step = np.linalg.lstsq((x / scale[:, None] / size).reshape(-1, len(names)), (y / scale).ravel(), rcond=1e-8)[0]
        values = np.array([vehicle.value(name) for name in names])
        low = np.where([name.startswith("inertia_") for name in names], values / 3.0, bounds[:, 0])
        vehicle = with_values(vehicle, names, np.clip(values + step / size, low, bounds[:, 1]))
    return vehicle
