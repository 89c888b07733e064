"""What an identification found: estimates with errors that can be believed, and how it got there."""

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from flight.frames import GRAVITY_M_S2
from flight.rotations import FloatArray
from sysid.estimator import known_ratio
from sysid.estimator import verdict as verdicts
from sysid.estimator.blocks.catalogue import BLOCKS, acting, places, reported
from sysid.estimator.blocks.gyro import BLOCK as GYRO
from sysid.estimator.blocks.motion import Motion
from sysid.estimator.blocks.noise import Noise
from sysid.estimator.flights import clocks
from sysid.estimator.flights.clocks import Clock
from sysid.estimator.flights.flight_data import Flight, left_out
from sysid.estimator.joint_problem import weight
from sysid.estimator.joint_problem.gusts import left_over
from sysid.estimator.joint_problem.solver import Solution
from sysid.estimator.joint_problem.unknowns import SENSOR_NAMES, Unknowns
from sysid.estimator.motors import motor
from sysid.estimator.options import Options, Reference
from sysid.estimator.uncertainty import mass
from sysid.estimator.uncertainty.agreement import odd_flights
from sysid.estimator.uncertainty.errors import NORMAL_90, Errors, standard_errors
from sysid.estimator.uncertainty.unsettled import CONFOUNDED, Unsettled
from sysid.estimator.verdict import Verdict
from vehicle import Vehicle, purpose, specs

SCHEMA_VERSION = 2
"""Version of `Identification.as_dict`."""
NOT_IDENTIFIABLE = "not identifiable"
"""Status of a parameter that is held because the flights do not determine it."""
NOT_SETTLED = "not settled"
"""... and of one that they tell only together with another, so that the fit did not settle with both free."""


@dataclass(frozen=True, slots=True)
class Estimate:
    """One parameter after the fit."""

    name: str
    value: float
    unit: str
    std: float
    """Standard error if all noise were white and all forms exact."""
    std_robust: float
    """Standard error that allows for errors correlated within a block of time, and for slightly wrong forms."""
    start: float
    """Value before the fit."""
    status: str
    """`free`, `held` (by the user), `not identifiable` (from these flights, and therefore held), or `not settled` (told
    only together with another one, and therefore held)."""
    information: tuple[float, ...]
    """Share of each flight in what is known about it, the other parameters taken out; sums to 1 with the prior."""
    interval90: float
    """Half width of the 90 % interval: `std_robust` times Student's quantile for the blocks of time it rests on."""


@dataclass(frozen=True, slots=True)
class Identification:
    """Result of `identify`."""

    vehicle: Vehicle
    """The vehicle with the new values, robust standard errors and their source."""
    parameters: tuple[Estimate, ...]
    """Every parameter that acts on the motion, and the pose sensor's."""
    correlation: FloatArray
    """(p, p) between the free parameters, in the order of `free_names`."""
    free_names: tuple[str, ...]
    noise: Noise
    gyro_bias_rad_s: FloatArray
    """(logs, 3), zero without a gyro."""
    solution: Solution
    """States, residuals and derivatives at the optimum, for plots and diagnosis."""
    unknowns: Unknowns
    flights: tuple[Flight, ...]
    findings: tuple[str, ...]
    """Sentences the user should read."""
    verdict: Verdict
    """Whether to use the values."""
    given: Vehicle
    """The vehicle as the user gave it: what the values are compared with."""
    clock: Reference
    """Whose clock the others were measured against."""
    clocks: tuple[Clock, ...]
    """Delay of every stream of every flight, log by log."""

    @property
    def converged(self) -> bool:
        return self.solution.converged

    @property
    def leaves_too_much(self) -> bool:
        """Whether so much stays unexplained that the model cannot be called right; the findings say how much."""
        force, torque = _unexplained(self.solution, self.flights)
        return force > LARGE_FORCE_M_S2 or torque > LARGE_TORQUE_RAD_S2

    def estimate(self, name: str) -> Estimate:
        """The estimate of one parameter. Raises `KeyError` if it is not among them."""
        return {e.name: e for e in self.parameters}[name]

    def confounded(self) -> list[tuple[str, str, float]]:
        """Pairs of free parameters with a correlation of at least `CONFOUNDED`, and it, the strongest first."""
        rows, columns = np.triu_indices(len(self.free_names), 1)
        pairs = [(i, j, float(self.correlation[i, j])) for i, j in zip(rows, columns, strict=True)]
        strong = sorted((pair for pair in pairs if abs(pair[2]) >= CONFOUNDED), key=lambda pair: -abs(pair[2]))
        return [(self.free_names[i], self.free_names[j], r) for i, j, r in strong]

    def as_dict(self) -> dict[str, Any]:
        """Everything but states and residuals, as plain JSON values."""
        return {
            "schema": "goshawk-identification",
            "version": SCHEMA_VERSION,
            "verdict": self.verdict.as_dict(),
            "vehicle": self.vehicle.name,
            "effects": list(self.vehicle.effects),
            "flights": [
                {"name": f.name, "duration_s": float(f.time_s[-1] - f.time_s[0]), "nodes": len(f)} for f in self.flights
            ],
            "parameters": {
                e.name: {
                    "value": e.value,
                    "unit": e.unit,
                    "std": e.std,
                    "std_robust": e.std_robust,
                    "interval90": e.interval90,
                    "start": e.start,
                    "status": e.status,
                    "information": list(e.information),
                }
                for e in self.parameters
            },
            "free": list(self.free_names),
            "correlation": self.correlation.tolist(),
            "confounded": [{"names": [a, b], "correlation": r} for a, b, r in self.confounded()],
            "converged": self.converged,
            "iterations": [
                {"cost": i.cost, "step_sigma": i.step_sigma, "damping": i.damping} for i in self.solution.record
            ],
            "noise": reported(self.noise),
            "residuals": residual_statistics(self),
            "gyro_bias_rad_s": self.gyro_bias_rad_s.tolist(),
            "clocks": [asdict(c) for c in self.clocks],
            "findings": list(self.findings),
        }


SPAN_S = 0.1
"""What is left unexplained is judged, told and drawn as means over this long."""
LARGE_TORQUE_RAD_S2 = 20.0
"""The same as `LARGE_FORCE_M_S2` for turning."""
LARGE_FORCE_M_S2 = 2.5
"""Unexplained acceleration over 0.1 s from which on a model cannot be called right: a quarter of gravity."""

CHANNELS = tuple(channel.name for channel in Motion.channels)
"""Of force and torque, body axes."""


def residual_statistics(fit: Identification) -> dict[str, dict[str, float]]:
    """Per channel: root mean square of the whitened residual and its correlation with the next one."""
    series: dict[str, list[FloatArray]] = {channel.name: [] for block in BLOCKS for channel in block.channels}
    for flight, (defect, sensor) in zip(fit.flights, fit.solution.residuals, strict=True):
        for between, residual in ((True, defect), (False, sensor)):
            blocks = acting(flight, fit.noise, between=between)
            for block, place in zip(blocks, places(blocks), strict=True):
                for channel in block.channels:
                    series[channel.name] += [residual[:, place][:, row] for row in channel.rows]
    return {channel: _statistics(found) for channel, found in series.items()}


def _statistics(series: list[FloatArray]) -> dict[str, float]:
    square = sum(float(s @ s) for s in series)
    lagged = sum(float(s[1:] @ s[:-1]) for s in series)
    count = sum(len(s) for s in series)
    return {"rms": float(np.sqrt(square / max(count, 1))), "lag_one": lagged / square if square > 0.0 else 0.0}


def conclude(
    vehicle: Vehicle,
    flights: list[Flight],
    unknowns: Unknowns,
    solution: Solution,
    unseen: tuple[str, ...],
    not_settled: Sequence[Unsettled],
    options: Options,
    given: Vehicle,
    clock: Reference,
) -> Identification:
    """Estimates, errors, sentences and the verdict from a solved problem.

    Args:
        vehicle: what the fit started from.
        unseen: parameters that are held because these flights do not identify them.
        not_settled: parameters that are held because the fit did not settle with them free.
        given: what the user gave; another one where stages or a search came before.
        clock: whose clock the others were measured against.
    """
    names = (*unknowns.model, *unknowns.sensor)
    errors = standard_errors(flights, unknowns, solution, not_settled)
    held = dict.fromkeys(sorted({"mass_kg", *options.held} - {*names}), "held")
    status = {**dict.fromkeys(unseen, NOT_IDENTIFIABLE), **{one.name: NOT_SETTLED for one in not_settled}, **held}
    estimates = _estimates(vehicle, names, solution, errors)
    estimates += [_held(vehicle, name, why) for name, why in status.items()]
    delays = _clocks(flights, unknowns, solution, errors.robust, clock)
    disagreement = _disagreement(vehicle, unknowns, solution, flights)
    unsettled = [one.sentence for one in not_settled]
    lasting = [name for name, so in zip(names, errors.correlated[: len(names)], strict=True) if so]
    verdict = verdicts.of_fit(given, solution.point.vehicle, flights, unknowns.model, _against(solution, flights))
    correlation = errors.correlation[: len(names), : len(names)]
    verdict = verdict.doubted(
        *_held_up(flights, solution, unknowns),
        *unsettled,
        *_at_bounds(vehicle, estimates, but=0.0),
        *unpredicted_turning(solution, flights, unknowns.model),
        *disagreement,
    )
    mark = known_ratio.doubtful(verdict, names, _free(estimates), correlation)
    return Identification(
        vehicle=purpose.marked(_updated(vehicle, estimates, flights, correlation), mark),
        parameters=tuple(estimates),
        correlation=correlation,
        free_names=names,
        noise=solution.noise,
        gyro_bias_rad_s=_gyro_bias(flights, solution),
        solution=solution,
        unknowns=unknowns,
        flights=tuple(flights),
        findings=(
            mass.what_is_known(given, _free(estimates)),
            *_findings(vehicle, estimates, solution, flights, lasting),
            *clocks.sentences(delays),
            *errors.by_command.sentences(unknowns, flights),
            *_against_belief(given, estimates, solution, flights),
            *disagreement,
            *unsettled,
        ),
        verdict=verdict,
        given=given,
        clock=clock,
        clocks=delays,
    )


def _estimates(vehicle: Vehicle, names: Sequence[str], solution: Solution, errors: Errors) -> list[Estimate]:
    """Of the parameters that were free, the first of the unknowns."""
    plain, shares = errors.plain, _information_shares(solution)
    return [
        Estimate(
            name=name,
            value=solution.point.value(name),
            unit=vehicle.parameter(name).unit,
            std=float(plain[i]),
            std_robust=float(errors.robust[i]),
            start=vehicle.value(name),
            status="free",
            information=tuple(shares[:, i].tolist()),
            interval90=float(errors.interval90[i]),
        )
        for i, name in enumerate(names)
    ]


def _gyro_bias(flights: list[Flight], solution: Solution) -> FloatArray:
    logs = 1 + max(flight.log_index for flight in flights)
    sensors = solution.point.sensors
    return np.array([[sensors.get(name, 0.0) for name in GYRO.bias_names(log)] for log in range(logs)])


def _clocks(
    flights: list[Flight], unknowns: Unknowns, solution: Solution, std: FloatArray, reference: Reference
) -> tuple[Clock, ...]:
    """Args: std: (p,) robust standard errors of all shared parameters."""
    found, seen = [], clocks.held(flights)
    for flight in flights:
        against = clocks.STREAMS.get(clocks.reference_of(flight, reference), "pose")
        for quantity, stream in clocks.STREAMS.items():
            name = clocks.delay_name(quantity, flight.log_index)
            if name in unknowns.delay and name not in seen:
                seen.add(name)
                sigma = float(std[unknowns.names.index(name)])
                found.append(Clock(stream, against, flight.name, solution.point.sensors[name], sigma))
    return tuple(found)


def _held(vehicle: Vehicle, name: str, status: str) -> Estimate:
    p = vehicle.parameter(name)
    return Estimate(name, p.value, p.unit, p.std, p.std, p.value, status, (), NORMAL_90 * p.std)


def _information_shares(solution: Solution) -> FloatArray:
    """(flights, p): the flight's part of sum_f c^T I_f c, c the direction in which each parameter varies alone."""
    covariance = solution.covariance()
    if not len(covariance):
        return np.zeros((len(solution.information), 0))
    parts = np.stack([np.einsum("ip,ij,jp->p", covariance, info, covariance) for info in solution.information])
    return parts / np.diag(covariance)


def _updated(vehicle: Vehicle, estimates: list[Estimate], flights: list[Flight], correlation: FloatArray) -> Vehicle:
    source = "identified from " + ", ".join(dict.fromkeys(f.name for f in flights))
    bounds = specs(vehicle)
    for e in estimates:
        if e.status == "free":
            value = float(np.clip(e.value, *bounds[e.name].bounds))
            vehicle = vehicle.with_value(e.name, value, std=e.std_robust, source=source)
    free = [e.name for e in estimates if e.status == "free"]  # the first of the estimates, as of the correlation
    together = {"names": free, "matrix": correlation.round(4).tolist()}
    return replace(
        vehicle,
        provenance={**vehicle.provenance, "identified_from": [f.name for f in flights], "correlation": together},
    )


LONG_S = 1.0
"""Of disturbances that last longer only size squared over time is known: the process may be of any size."""


def _unexplained_axes(solution: Solution, flights: Sequence[Flight]) -> FloatArray:
    """(6,) unexplained acceleration of each axis over 0.1 s: m/s2 and rad/s2.

    A smooth disturbance, such as a drag that is missing, fits a process that lasts for long and is far larger than the
    disturbance: there what the model leaves along the states is taken, if that is less.
    """
    gusts = solution.noise.gusts
    white = solution.noise.process**2 / SPAN_S
    if gusts is None:
        return np.sqrt(white)
    size = np.sqrt(white + gusts.size**2)
    point = solution.point
    left = [left_over(f, s, point.vehicle) for f, s in zip(flights, point.states, strict=True)]
    measured = np.sqrt((np.concatenate(left) ** 2).mean(axis=0))
    return np.where(gusts.lasts_s > LONG_S, np.minimum(size, measured), size)


def _unexplained(solution: Solution, flights: Sequence[Flight]) -> tuple[float, float]:
    """The largest of `_unexplained_axes`: m/s2 and rad/s2."""
    size = _unexplained_axes(solution, flights)
    known = slice(0, 3) if any(flight.has_pose for flight in flights) else slice(2, 3)  # without a pose no drag shows
    return float(size[known].max()), float(size[3:].max())


def _turning_rad_s2(solution: Solution, flights: Sequence[Flight]) -> FloatArray:
    """(3,) root mean square of the body's angular acceleration, in means over 0.1 s; NaN if no flight lasts that."""
    parts = []
    for flight, states in zip(flights, solution.point.states, strict=True):
        later = np.searchsorted(flight.time_s, flight.time_s + SPAN_S)
        first = np.flatnonzero(later < len(flight.time_s))
        rate, last = states.rate_body_rad_s, later[first]
        parts.append((rate[last] - rate[first]) / (flight.time_s[last] - flight.time_s[first])[:, None])
    turned = np.concatenate(parts)
    return np.sqrt((turned**2).mean(axis=0)) if len(turned) else np.full(3, np.nan)


def unpredicted_turning(solution: Solution, flights: Sequence[Flight], free: Iterable[str]) -> tuple[str, ...]:
    """A sentence for each axis about which the model with its inertia leaves more than the vehicle turned."""
    left, turned = _unexplained_axes(solution, flights)[3:], _turning_rad_s2(solution, flights)
    return tuple(
        f"about {axis} the model leaves {left[i]:.3g} rad/s2 unexplained (over 0.1 s) where the body turned with "
        f"{turned[i]:.3g}: it does not predict how the vehicle turns. Check the clocks of gyro and rotor speed and the "
        "rotor order, fly quicker turns, or hold the inertias"
        for i, axis in enumerate("xyz")
        if f"inertia_{2 * axis}_kg_m2" in free and left[i] > turned[i]
    )


def _findings(
    vehicle: Vehicle,
    estimates: list[Estimate],
    solution: Solution,
    flights: Sequence[Flight],
    lasting: Sequence[str],
) -> list[str]:
    """Args: lasting: names of parameters whose errors are strongly correlated in time."""
    found: list[str] = []
    gravity_m_s2 = flights[0].gravity_m_s2
    if gravity_m_s2 != GRAVITY_M_S2:
        found.append(
            f"gravity is {gravity_m_s2:g} m/s2, not the standard {GRAVITY_M_S2:g}: the vehicle file keeps it, and "
            "predictions, plans and controller use it"
        )
    noise = solution.noise
    if noise.gusts is not None:
        (force, torque), lasts_s = _unexplained(solution, flights), np.median(noise.gusts.lasts_s)
        found.append(
            f"up to {force:.2g} m/s2 and {torque:.2g} rad/s2 stay unexplained for about {lasts_s:.1f} s (gusts, a "
            "swinging load, or an effect that the model lacks); the fit allows for it"
        )
    found += left_out(flights)
    if any(e.name in (motor.RISE, motor.FALL) and e.status == "free" for e in estimates):
        found += clocks.commands_on_time(flights)
    found += _against(solution, flights) + _at_bounds(vehicle, estimates)
    for e in estimates:
        if e.status == NOT_IDENTIFIABLE:
            found.append(f"{e.name} was held at {e.value:g} {e.unit}: not identifiable from these flights")
        elif e.name in lasting and e.name not in SENSOR_NAMES:
            found.append(
                f"{e.name}: errors are strongly correlated in time (robust standard error "
                f"{e.std_robust / e.std:.0f} times the plain one); the model may lack an effect"
            )
    return found


def _against(solution: Solution, flights: Sequence[Flight]) -> list[str]:
    """What forbids the use of a solution, whatever it is a solution of."""
    found = []
    if not solution.converged:
        found.append(f"not converged after {len(solution.record)} iterations")
    worst, turning = _unexplained(solution, flights)
    if worst > LARGE_FORCE_M_S2:
        found.append(
            f"the model leaves {worst:.1f} m/s2 unexplained (over 0.1 s): a held parameter may be wrong (a wrong "
            "inertia spoils the thrust), or units, frames or rotor order"
        )
    if turning > LARGE_TORQUE_RAD_S2:
        found.append(
            f"the model leaves {turning:.0f} rad/s2 unexplained (over 0.1 s): a held inertia may be far off, or units, "
            "rotor order or spin"
        )
    return found


def _free(estimates: Iterable[Estimate]) -> dict[str, tuple[float, float]]:
    """Value and standard error of what was estimated."""
    return {e.name: (e.value, e.std_robust) for e in estimates if e.status == "free"}


def _at_bounds(vehicle: Vehicle, estimates: list[Estimate], *, but: float | None = None) -> list[str]:
    """Estimates that left their range, but for the bound `but`: a drag of nil is no cause for doubt."""
    bounds = specs(vehicle)
    return [
        f"{e.name} came out at its bound, {e.value:.3g} ± {e.std_robust:.2g} {e.unit}"
        for e in estimates
        if e.status == "free"
        and not bounds[e.name].bounds[0] < e.value < bounds[e.name].bounds[1]
        and float(np.clip(e.value, *bounds[e.name].bounds)) != but
    ]


def _against_belief(given: Vehicle, estimates: list[Estimate], solution: Solution, flights: list[Flight]) -> list[str]:
    """What a wrong mass looks like, if the estimates do."""
    if verdicts.by_nominal_speed(flights):
        return []
    speed = verdicts.usual_rotor_speed(flights)
    fitted, believed = (verdicts.thrust_n(v, speed) for v in (solution.point.vehicle, given))
    return mass.sentences(given, _free(estimates), fitted / believed if believed > 0.0 else 1.0, float(speed.mean()))


def _held_up(flights: list[Flight], solution: Solution, unknowns: Unknowns) -> list[str]:
    """Thrust that only the weight balance keeps from being traded for torque."""
    lacking_m_s2 = weight.held_m_s2(flights, solution.point, unknowns)
    if lacking_m_s2 is None:
        return []
    share = 1.0 - lacking_m_s2 / flights[0].gravity_m_s2
    return [
        f"the turning asks for {'less' if lacking_m_s2 > 0.0 else 'more'} thrust than carries the weight; it was held "
        f"at {share:.0%} of that. A held inertia, an arm or the rotor order may be wrong, or a large moment is missing"
    ]


def _disagreement(vehicle: Vehicle, unknowns: Unknowns, solution: Solution, flights: list[Flight]) -> list[str]:
    sizes = np.array([max(abs(solution.point.value(n)), specs(vehicle)[n].prior) for n in unknowns.model])
    odd = odd_flights(solution, flights, unknowns.model, sizes)
    return [
        f"{o.flight} does not fit the other flights: without it {o.name} would be {o.others:.4g} instead of "
        f"{solution.point.value(o.name):.4g} ({o.sigma:.0f} standard errors). If another vehicle, load or set of "
        "propellers was flown, fit it by itself; else an effect may be missing (`goshawk diagnose`)"
        for o in odd[:2]
    ]
