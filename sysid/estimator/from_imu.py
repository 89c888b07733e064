"""Identification of flights without a pose, from gyro, accelerometer and what drives the rotors.

Thrust and torque per command, lag and latency, and inertia show in what the IMU feels; drag against wind and anything
that needs the velocity do not, and are held.
"""

import logging
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from flight import InputError, Progress, rotations, within
from sysid.estimator.flights.clocks import PRIOR_S
from sysid.estimator.flights.flight_data import Flight
from sysid.estimator.joint_problem.problem import Point, with_values
from sysid.estimator.joint_problem.solver import Prior, Solution, robust_covariance
from sysid.estimator.joint_problem.unknowns import Unknowns, chosen_names, sensor_values
from sysid.estimator.motors import rotor_speed
from sysid.estimator.options import Options
from sysid.estimator.result import Identification, conclude
from sysid.estimator.trajectory.states import States, first_guess
from sysid.estimator.uncertainty import identifiable
from sysid.estimator.uncertainty.errors import NORMAL_90
from sysid.estimator.uncertainty.unsettled import Unsettled, not_identifiable
from sysid.estimator.without_pose import airspeed, anchors, anchors_judged, fit, level, sensing, told
from sysid.estimator.without_pose.anchors import Beside
from sysid.estimator.without_pose.excited import require
from sysid.estimator.without_pose.sensing import BIAS, PLACE, PRIOR_STD, delay_names, own_names, with_delays
from vehicle import Vehicle

logger = logging.getLogger(__name__)

AFFINE = "thrust_affine"
INFLOW = "inflow_linear"
REACTION, GYROSCOPIC = "rotor_acceleration_torque", "gyroscopic_torque"
DAMPING = "angular_damping"
SIDEWAYS = (f"{DAMPING}.x_n_m_s", f"{DAMPING}.y_n_m_s")
TRIED = (AFFINE, "centre_of_mass", REACTION, GYROSCOPIC, DAMPING, INFLOW)
"""Effects that commands and propellers of all vehicles have a little of: thrust in the command is a parabola with all
three terms, a lasting moment balances the body, rotors turn it as they speed up and as it tilts them, and inflow damps
its turning. Each is kept if the flights show it; the parabola also where they leave its form open, for inertias go with
its slope. The torque of tilted rotors goes with that of rotors that speed up: left out, it made inertia about z 25 %
too small, which the products of rates tell beside it. Rotor drag damps yaw: left out, lags came out 4 % short and
rotors seemed to have inertia. It is told as a damping of yaw alone, for no drag against wind follows from it, and
inflow tells the other axes'."""
DAMPERS = (DAMPING, "rotor_drag_speed")
"""Effects that damp yaw: where the vehicle has one, none is tried."""
USUAL_SHARE = 0.3
"""Of a rotor's thrust in hover: size of the parabola's lower terms, where the flights hardly tell it."""
SMALL_SHARE = 0.02
"""Of the slope of thrust in hover: lower terms that are surely less change no inertia worth a parameter."""
SURE = 16.0
"""Square of an effect's size in standard errors from which on it counts as shown: one in 3,000 by chance."""
SURE_OF_INFLOW = 10.0
"""Its size in standard errors from which on inflow counts as shown: a lag or filter of another form damps turning a
little, too (8 in a real flight that hardly rolls)."""


def identify(
    flights: Sequence[Flight],
    vehicle: Vehicle,
    options: Options,
    given: Vehicle,
    progress: Progress,
    *,
    effects: Sequence[str] = TRIED,
    near: Identification | None = None,
) -> Identification:
    """Fit a vehicle's parameters to flights without a pose.

    Args:
        given: the vehicle as the user gave it.
        effects: that are added where the flights show them.
        near: the fit of a similar vehicle to the same flights, to start from.

    Raises:
        InputError: the flights show too little, or a name is unknown.
    """
    others = [effect for effect in effects if effect != INFLOW]
    if options.free is not None or INFLOW not in _tried(flights, vehicle, effects):
        return _identified(flights, vehicle, options, given, progress, others, near)
    first, second = (within(progress, "identify", *part) for part in ((0.0, 0.6), (0.6, 1.0)))
    found = _identified(flights, vehicle, options, given, first, others, near)
    try:
        states = found.solution.point.states
        damped = _identified(flights, vehicle.with_effect(INFLOW), options, given, second, others, found, states)
    except InputError as error:
        logger.info("%s could not be fitted: %s", INFLOW, error)
        return found
    return damped if _shows_inflow(damped) else found


def _shows_inflow(found: Identification) -> bool:
    """Whether it is beyond what a wrong lag explains; and no propeller gains thrust in a climb."""
    name = f"{INFLOW}.inflow_kg"
    if found.estimate(name).status != "free":
        return False
    solution, place = found.solution, found.unknowns.names.index(name)
    both = solution.covariance(), robust_covariance(solution, len(found.unknowns.bias + found.unknowns.delay))[0]
    return found.estimate(name).value > SURE_OF_INFLOW * max(float(np.sqrt(c[place, place])) for c in both)


def _identified(
    flights: Sequence[Flight],
    vehicle: Vehicle,
    options: Options,
    given: Vehicle,
    progress: Progress,
    effects: Sequence[str],
    near: Identification | None,
    states: tuple[States, ...] | None = None,
) -> Identification:
    """One fit, in which those of `effects` are added that the flights show.

    Args:
        states: what the IMU alone shows of these flights, where that is known already.
    """
    flights = [with_delays(flight) for flight in flights]
    tried = [] if options.free is not None else _tried(flights, vehicle, effects)
    started = vehicle
    for effect in tried:
        started = started.with_effect(effect)
    if DAMPING in tried:
        started = with_values(started, SIDEWAYS, np.zeros(2))
    known = anchors.beside(options.anchors, flights, started, (), options.prior_std)
    started = anchors.with_sag(started, known)
    by_command = any(flight.driven_by_command for flight in flights)
    names = chosen_names(started, options.free, options.held, by_command)
    require(flights)
    names = tuple(name for name in names if DAMPING not in tried or name not in SIDEWAYS)
    mute = _mute(flights, started, names)
    unknowns = _unknowns(flights, tuple(name for name in names if name not in mute))
    states = states or tuple(first_guess(f, np.zeros(3), rotations.IDENTITY) for f in flights)
    flights = [airspeed.with_climb(flight, s) for flight, s in zip(flights, states, strict=True)]
    sensors = near.solution.point.sensors if near else sensor_values(started)
    point, held, close = Point(started, sensors, states), list(mute), near is not None
    unsettled: list[Unsettled] = []
    known, weighed = anchors.beside(options.anchors, flights, started, unknowns.model, options.prior_std), False
    while True:
        prior = _prior(flights, point, unknowns, options, started, given)
        solution = fit.solve(flights, point, unknowns, prior, options, progress, known, near=close)
        close = True
        surplus = [effect for effect in tried if _is_surplus(effect, flights, solution, unknowns)][:1]
        if surplus == [REACTION] and GYROSCOPIC in tried:
            surplus = [REACTION, GYROSCOPIC]
        if surplus:
            tried = [effect for effect in tried if effect not in surplus]
            started, unknowns = _without(started, unknowns, surplus)
            point = replace(solution.point, vehicle=_without(solution.point.vehicle, unknowns, surplus)[0])
            continue
        unseen = identifiable.least_seen(solution, started, unknowns, but=_open_curve(started, given, unknowns))
        if unseen is None and known.weighs and not weighed:
            factor, std = known.mass_factor(solution.point.vehicle)
            started = anchors.scaled(started, factor, std)
            point = replace(solution.point, vehicle=anchors.scaled(solution.point.vehicle, factor, std))
            weighed = True
            continue
        if unseen is None:
            break
        if options.unseen == "refuse":
            raise InputError(identifiable.message(unseen))
        together = not_identifiable(solution, unknowns, started, unseen)
        unsettled += [together] if together else []
        held.append(unseen)
        logger.info("holding %s: not identifiable from these flights", unseen)
        unknowns = unknowns.without(unseen)
        both = all(name in unknowns.model for name in anchors.SPINNING)
        known = replace(known, flat=known.flat and anchors.Z in unknowns.model, spinning=known.spinning and both)
        back = with_values(solution.point.vehicle, (unseen,), np.array([started.value(unseen)]))
        point = replace(solution.point, vehicle=back)
    progress("identify", 1.0)
    return _concluded(flights, started, unknowns, solution, tuple(held), unsettled, options, given, known)


def _tried(flights: Sequence[Flight], vehicle: Vehicle, wanted: Sequence[str]) -> list[str]:
    """Effects to be tried: of commands that were shares of full throttle, all; of measured rotor speeds, the parabola.

    The lower terms are tried where the thrust is quadratic so far.
    """
    if not any(flight.full_throttle_rad_s is not None for flight in flights):
        wanted = [effect for effect in wanted if effect == AFFINE and not all(f.driven_by_command for f in flights)]
    quadratic = "thrust_quadratic" in vehicle.effects
    damped = any(effect in vehicle.effects for effect in DAMPERS)
    usable = [e for e in wanted if (quadratic or e != AFFINE) and not (damped and e == DAMPING)]
    return [e for e in usable if e not in vehicle.effects]


def _is_surplus(effect: str, flights: Sequence[Flight], solution: Solution, unknowns: Unknowns) -> bool:
    """Whether its parameters together may be zero, and it is not the curve of thrust that the flights leave open.

    Wald's test, by the noise and by the scatter of blocks of time, which a few blocks make too small by chance.
    """
    own = [i for i, name in enumerate(unknowns.model) if name.startswith(f"{effect}.")]
    if not own or (effect == GYROSCOPIC and any(name.startswith(f"{REACTION}.") for name in unknowns.model)):
        return False  # it goes with the other
    value = solution.point.shared(unknowns)[own]
    both = solution.covariance(), robust_covariance(solution, unknowns.size)[0]
    squares = [float(value @ np.linalg.pinv(c[np.ix_(own, own)], hermitian=True) @ value) for c in both]
    if min(squares) > SURE * len(own):
        return False
    slope = f"{AFFINE}.slope_n_s"
    if effect != AFFINE or slope not in unknowns.model:
        return True
    std = float(np.sqrt(solution.covariance()[(place := unknowns.names.index(slope)), place]))
    vehicle = solution.point.vehicle
    off = abs(vehicle.value(slope)) + NORMAL_90 * std
    return off < SMALL_SHARE * 2.0 * _hover_n(vehicle) / _usual_rad_s(flights)


def _open_curve(vehicle: Vehicle, given: Vehicle, unknowns: Unknowns) -> tuple[str, ...]:
    """The terms of a parabola that was given no lower terms: a prior holds what the flights do not tell of each."""
    if AFFINE in given.effects or AFFINE not in vehicle.effects:
        return ()
    return tuple(name for name in unknowns.model if name.startswith("thrust_"))


def _hover_n(vehicle: Vehicle) -> float:
    """Thrust of a rotor in hover."""
    return vehicle.mass_kg * vehicle.gravity_m_s2 / vehicle.rotors


def _usual_rad_s(flights: Sequence[Flight]) -> float:
    """Speed in the middle of all: commanded, or measured where that is."""
    driving = [f.rotor_command_rad_s if f.driven_by_command else f.rotor_speed_rad_s for f in flights]
    return float(np.median(np.concatenate([speed.ravel() for speed in driving])))


def _without(vehicle: Vehicle, unknowns: Unknowns, effects: Sequence[str]) -> tuple[Vehicle, Unknowns]:
    for effect in effects:
        vehicle = vehicle.without_effect(effect)
    return vehicle, replace(unknowns, model=tuple(n for n in unknowns.model if n.partition(".")[0] not in effects))


def _concluded(
    flights: Sequence[Flight],
    vehicle: Vehicle,
    unknowns: Unknowns,
    solution: Solution,
    held: tuple[str, ...],
    unsettled: Sequence[Unsettled],
    options: Options,
    given: Vehicle,
    known: Beside,
) -> Identification:
    on_time = [rotor_speed.aligned(flight, solution.point.sensors) for flight in flights]
    found = conclude(vehicle, on_time, unknowns, solution, held, unsettled, options, given, options.clock)
    against, behind = told.unanswered(flights, solution), told.unnamed_low_pass(flights, found.clocks)
    judged = anchors_judged.judge(known, solution, unknowns)
    verdict = replace(found.verdict, against=(*found.verdict.against, *against))
    verdict = verdict.doubted(*behind, *(one.sentence for one in judged if one.contradicts))
    findings = found.findings[1:] if known.weighs else found.findings  # the first: the mass was not estimated
    said = [one.sentence for one in judged]
    if (sagging := anchors_judged.sag(known, found.vehicle)) is not None:
        found, said = replace(found, vehicle=sagging[0]), [*said, sagging[1]]
    findings = (*against, *behind, *said, *findings, *told.sentences(on_time, solution, unknowns))
    return replace(found, findings=findings, verdict=verdict)


def _unknowns(flights: Sequence[Flight], model: tuple[str, ...]) -> Unknowns:
    logs = sorted({flight.log_index for flight in flights})
    bias = (*PLACE, *(name for log in logs for name in own_names(log)))
    delay = dict.fromkeys(name for flight in flights for name in delay_names(flight))
    return Unknowns(model, (), bias, tuple(delay))


def _mute(flights: Sequence[Flight], vehicle: Vehicle, names: tuple[str, ...]) -> tuple[str, ...]:
    """Names that nothing measured depends on: drag, and whatever else needs the velocity."""
    unknowns = _unknowns(flights, names)
    size = np.zeros(len(names))
    for flight in flights:
        still = replace(flight, climb_m_s=None)
        by = sensing.shown(still, vehicle, unknowns.names, names, {}).by[:, :, : len(names)]
        size = np.maximum(size, np.abs(by).max(axis=(0, 1)))
    return tuple(name for name, largest in zip(names, size, strict=True) if not largest > 0.0)


def _prior(
    flights: Sequence[Flight],
    point: Point,
    unknowns: Unknowns,
    options: Options,
    vehicle: Vehicle,
    given: Vehicle,
) -> Prior:
    for name in options.prior_std:
        vehicle.parameter(name)
    mean, std = dict.fromkeys(unknowns.names, 0.0), dict.fromkeys(unknowns.names, np.inf)
    for name in unknowns.model:
        mean[name], std[name] = vehicle.value(name), dict(options.prior_std).get(name, np.inf)
    if lower := [name for name in _open_curve(vehicle, given, unknowns) if name.startswith(AFFINE)]:
        share_n = USUAL_SHARE * _hover_n(vehicle)
        usual = {f"{AFFINE}.constant_n": share_n, f"{AFFINE}.slope_n_s": share_n / _usual_rad_s(flights)}
        mean |= dict.fromkeys(lower, 0.0)
        std |= {name: min(std[name], usual[name]) for name in lower}
    std |= {name: PRIOR_STD[name.split("[")[0]] for name in unknowns.bias}
    std |= dict.fromkeys(unknowns.delay, PRIOR_S)
    for log in {flight.log_index for flight in flights}:
        pieces = [one for one in zip(flights, point.states, strict=True) if one[0].log_index == log]
        name = f"{BIAS[2]}[{log}]"
        mean[name], std[name] = _both(level.bias(pieces), (0.0, std[name]))
    return Prior(np.array(list(mean.values())), np.array(list(std.values())))


def _both(one: tuple[float, float], other: tuple[float, float]) -> tuple[float, float]:
    """Mean and standard deviation of two Gaussian beliefs together."""
    weights = np.array([one[1], other[1]]) ** -2.0
    return float(np.average([one[0], other[0]], weights=weights)), float(weights.sum() ** -0.5)
