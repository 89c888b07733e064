"""Maximum-likelihood identification of a vehicle from flights: joint over all states and parameters (Rigter eq. 10)."""

import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from flight import FlightLog, InputError, Progress, silent
from sysid.estimator import from_imu
from sysid.estimator.blocks.catalogue import BLOCKS
from sysid.estimator.blocks.motion import LEAST_PROCESS
from sysid.estimator.blocks.noise import Noise
from sysid.estimator.blocks.pose import BLOCK as POSE
from sysid.estimator.blocks.pose import DELAY, PoseSensor
from sysid.estimator.flights import excitation
from sysid.estimator.flights.clocks import widths_s
from sysid.estimator.flights.flight_data import Flight
from sysid.estimator.joint_problem import driven_band, gusts
from sysid.estimator.joint_problem.problem import Point, with_values
from sysid.estimator.joint_problem.solver import Prior, Solution, solve
from sysid.estimator.joint_problem.unknowns import (
    SENSOR_NAMES,
    Unknowns,
    biases,
    chosen_names,
    nuisances,
    sensor_values,
)
from sysid.estimator.motors import motor, rotor_speed
from sysid.estimator.options import Options, Reference
from sysid.estimator.prepare import gravity_of, prepare_all
from sysid.estimator.result import Identification, conclude
from sysid.estimator.trajectory.model import unexplained
from sysid.estimator.trajectory.states import first_guess
from sysid.estimator.uncertainty import identifiable
from sysid.estimator.uncertainty.unsettled import Unsettled, least_settled
from sysid.logs.checks.payload import PAYLOAD
from vehicle import Vehicle, specs

logger = logging.getLogger(__name__)

UNSETTLED = (
    "lasting disturbances (gusts) were found, but their estimation did not settle. They were taken for white noise, so "
    "inertias and torques may be off by a few of their standard errors; fly in calmer air"
)
PLACE_OF_LOAD = tuple(f"{PAYLOAD}.{axis}_m" for axis in "xyz")
"""Fitted with the catalogue's width as a prior: a load of no weight has no place, and its height hardly ever shows."""


def identify(
    logs: Sequence[FlightLog],
    vehicle: Vehicle,
    options: Options | None = None,
    *,
    near: Identification | None = None,
    given: Vehicle | None = None,
    progress: Progress = silent,
) -> Identification:
    """Fit a vehicle's parameters to flights with measured pose and rotor speed.

    Mass, air density and rotor radius are never estimated: only ratios to them show. Everything else that acts on the
    motion is, unless the options hold it; the pose sensor's place and a gyro bias per log are estimated along.

    Args:
        near: the fit of a similar vehicle to the same logs with the same options; its states and noise levels are
            started from.
        given: the vehicle as the user gave it, to judge the result by, where `vehicle` is an intermediate one;
            None: that of `near`, or else `vehicle`.

    Raises:
        InputError: a log lacks a quantity, has a gap, or shows too little motion; a name is unknown.
    """
    options = options or Options()
    if not logs:
        raise InputError("no flight was given; identification needs at least one log")
    if near:
        gravity_of((near.vehicle, vehicle))  # the flights of `near` keep theirs
    flights = list(near.flights) if near else prepare_all(logs, options, [vehicle], progress)
    if not any(flight.has_pose for flight in flights):
        return from_imu.identify(flights, vehicle, options, given or (near.given if near else vehicle), progress)
    excitation.require(flights, _names(vehicle, flights, options))
    unknowns, clock = _unknowns(vehicle, flights, options)
    point, noise = _beside(near, vehicle, unknowns) if near else start(vehicle, flights, unknowns.model)
    held: list[str] = []
    fit = _Fit(flights, vehicle, options, progress)
    solution, unknowns = fit.solved(point, noise, unknowns, held)
    lasting = (
        _with_gusts(_on_time(flights, solution), solution, unknowns.model) if options.gusts == "estimate" else None
    )
    doubts: tuple[str, ...] = ()
    unsettled: tuple[Unsettled, ...] = ()
    if lasting is not None:
        also_held = list(held)
        carried, free, newly_held = fit.settled(*lasting, unknowns, also_held)
        if carried.converged:
            unknowns, held, unsettled = free, also_held, newly_held
            solution = replace(carried, record=solution.record + carried.record)
        else:
            doubts = (UNSETTLED,)
    progress("identify", 1.0)
    found = conclude(
        vehicle,
        _on_time(flights, solution),
        unknowns,
        solution,
        tuple(held),
        unsettled,
        options,
        given or (near.given if near else vehicle),
        clock,
    )
    return replace(found, findings=(*found.findings, *doubts), verdict=found.verdict.doubted(*doubts))


@dataclass(frozen=True, slots=True)
class _Fit:
    """What is fitted, and how it is to be."""

    flights: list[Flight]
    vehicle: Vehicle
    options: Options
    progress: Progress

    def solved(self, point: Point, noise: Noise, unknowns: Unknowns, held: list[str]) -> tuple[Solution, Unknowns]:
        """Solve, hold what is not identifiable from these flights (its names are added to `held`), and solve again."""
        while True:
            prior = _prior(self.flights, self.vehicle, unknowns, self.options)
            solution = solve(self.flights, point, noise, unknowns, prior, self.options, self.progress)
            unseen = identifiable.least_seen(solution, self.vehicle, unknowns)
            if unseen is None:
                return solution, unknowns
            if self.options.unseen == "refuse":
                raise InputError(identifiable.message(unseen))
            held.append(unseen)
            logger.info("holding %s: not identifiable from these flights", unseen)
            unknowns = unknowns.without(unseen)
            point, noise = _reset(solution.point, self.vehicle, unseen), solution.noise

    def settled(
        self, point: Point, noise: Noise, unknowns: Unknowns, held: list[str]
    ) -> tuple[Solution, Unknowns, tuple[Unsettled, ...]]:
        """`solved`; where that does not converge and flights tell a parameter only with another one, it is held too.

        The others go on from where they stand. The last result: what was held so.
        """
        solution, unknowns = self.solved(point, noise, unknowns, held)
        unsettled: list[Unsettled] = []
        while not solution.converged and unknowns.model and len(solution.record) > 1:
            found = least_settled(solution, unknowns, self.vehicle)
            if found is None:
                break
            unsettled.append(found)
            logger.info("holding %s: it does not settle beside %s", found.name, found.confounded)
            point = _reset(solution.point, self.vehicle, found.name)
            solution, unknowns = self.solved(point, solution.noise, unknowns.without(found.name), held)
        return solution, unknowns, tuple(unsettled)


def _with_gusts(flights: list[Flight], solution: Solution, names: tuple[str, ...]) -> tuple[Point, Noise] | None:
    """Where to start with disturbances among the states; None when what is unexplained is white or not to be judged."""
    if not all(flight.has_pose for flight in flights):
        return None
    point = solution.point
    usual_s = float(np.median(np.concatenate([f.step_s for f in flights])))
    seen = POSE.row_levels(solution.noise) * np.sqrt(usual_s)  # densities, m and rad root second
    found = gusts.find(flights, point.states, point.vehicle, np.sqrt(solution.noise.process / seen))
    if found is None:
        return None
    lasting, white = found
    logger.info("disturbances last: %s m/s2 and rad/s2 for %s s", lasting.size, lasting.lasts_s)
    process = np.minimum(solution.noise.process, np.maximum(white, LEAST_PROCESS))
    vehicle = driven_band.started(point.vehicle, flights, point.states, names)
    states = tuple(s.with_gust() for s in point.states)
    return replace(point, vehicle=vehicle, states=states), solution.noise.with_process(process).with_gusts(lasting)


def start(vehicle: Vehicle, flights: list[Flight], names: tuple[str, ...] = ()) -> tuple[Point, Noise]:
    """States by smoothing the pose; noise levels from what the vehicle then leaves unexplained.

    Args:
        names: parameters that are estimated, and may start elsewhere than the vehicle has them.
    """
    sensor = PoseSensor.of(vehicle)
    states = tuple(first_guess(flight, sensor.offset_body_m, sensor.q_body_sensor) for flight in flights)
    vehicle = driven_band.started(vehicle, flights, states, names)
    driven = [motor.driven(f, vehicle) for f in flights]
    left = [unexplained(f, s, vehicle) for f, s in zip(driven, states, strict=True)]
    # An unexplained acceleration that lasts about a tenth of a second has the density size x sqrt(0.1 s).
    size = np.sqrt(np.mean(np.concatenate(left) ** 2, axis=0))
    if not all(flight.has_pose for flight in flights):
        size[:3] = np.maximum(size[:3], 2.0)  # a guess that rests at the origin leaves no horizontal force to see
    usual = Noise({block.name: np.array(block.usual) for block in BLOCKS if block.usual})
    return Point(vehicle, sensor_values(vehicle), states), usual.with_process(np.sqrt(0.1) * size + 1e-3)


def _beside(near: Identification, vehicle: Vehicle, unknowns: Unknowns) -> tuple[Point, Noise]:
    """States, biases, delays and noise levels of another fit, under this vehicle; a clock that is the reference now
    has no delay."""
    point = near.solution.point
    kept = {name: value for name, value in point.sensors.items() if name in unknowns.names}
    return Point(vehicle, {**kept, **sensor_values(vehicle)}, point.states), near.noise


def _on_time(flights: list[Flight], solution: Solution) -> list[Flight]:
    """The flights with rotor speeds as late as was found."""
    return [rotor_speed.aligned(flight, solution.point.sensors) for flight in flights]


def _unknowns(vehicle: Vehicle, flights: list[Flight], options: Options) -> tuple[Unknowns, Reference]:
    """What is estimated, and against whose clock delays are."""
    with_pose = any(f.has_pose for f in flights)
    wanted = SENSOR_NAMES if options.pose_sensor and with_pose else ()
    sensor = tuple(n for n in wanted if n in vehicle.parameters and n not in options.held)
    clock = "rotor speed" if DELAY in sensor else options.clock
    own, _ = nuisances(flights, clock, vehicle)
    return replace(own, model=_names(vehicle, flights, options), sensor=sensor), clock


def _names(vehicle: Vehicle, flights: list[Flight], options: Options) -> tuple[str, ...]:
    by_command = any(f.driven_by_command for f in flights)
    return chosen_names(vehicle, options.free, options.held, by_command)


def _reset(point: Point, vehicle: Vehicle, name: str) -> Point:
    """The point with one parameter back at the vehicle's value."""
    if name not in SENSOR_NAMES:
        return replace(point, vehicle=with_values(point.vehicle, (name,), np.array([vehicle.value(name)])))
    return replace(point, sensors={**point.sensors, name: vehicle.value(name)})


def _prior(flights: list[Flight], vehicle: Vehicle, unknowns: Unknowns, options: Options) -> Prior:
    for name in options.prior_std:
        vehicle.parameter(name)
    named = (*unknowns.model, *unknowns.sensor)
    width = [*biases(flights).values(), *widths_s(flights, unknowns.delay)]
    mean = [vehicle.value(name) for name in named] + [0.0] * len(width)
    believed = {name: specs(vehicle)[name].prior for name in PLACE_OF_LOAD if name in vehicle.parameters}
    std = [(believed | dict(options.prior_std)).get(name, np.inf) for name in named]
    return Prior(np.array(mean), np.array([*std, *width]))


def not_settled(name: str, smoothed: Solution) -> list[str]:
    """A sentence on the model of this name if the states under it did not converge; else none."""
    if smoothed.converged:
        return []
    return [
        f"the states under {name} did not converge in {len(smoothed.record)} steps (--steps): its errors may be off"
    ]


def smooth(
    flights: list[Flight],
    vehicle: Vehicle,
    options: Options | None = None,
    *,
    process_scale: float = 1.0,
    near: Solution | None = None,
    progress: Progress = silent,
) -> Solution:
    """The states of flights under a vehicle whose parameters stay as they are; noise levels are estimated.

    Args:
        options: robust loss and most steps; the rest has no part in it. None: plain squares, 20 steps.
        process_scale: more than 1 trusts the model less, so that the measurements decide.
        near: the same of a similar vehicle; its states and noise levels are started from.
    """
    unknowns, width = nuisances(flights, "pose", vehicle)
    point, noise = start(vehicle, flights)
    if near is not None:
        point = Point(vehicle, {**near.point.sensors, **point.sensors}, near.point.states)
        noise = near.noise
    prior = Prior(np.zeros(unknowns.size), width)
    options = options or Options(max_iterations=20)

    solution = solve(flights, point, noise, unknowns, prior, options, progress)
    if process_scale <= 1.0:
        return solution
    noise = solution.noise.with_process(process_scale * solution.noise.process)
    return solve(flights, solution.point, noise, unknowns, prior, replace(options, max_iterations=1), progress)
