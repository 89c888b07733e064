"""Each anchor beside what flights and the other anchors say of it, and which of them contradict each other."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from flight.rotations import FloatArray
from sysid.estimator.joint_problem.solver import Solution, robust_covariance
from sysid.estimator.joint_problem.unknowns import Unknowns
from sysid.estimator.options import HoverCommand
from sysid.estimator.without_pose.anchors import Beside, nudged, rotor_thrust_n
from vehicle import Vehicle

CONTRADICTS = 3.0
"""Standard errors between an anchor and all the rest from which on one of them is called wrong."""


@dataclass(frozen=True, slots=True)
class Judged:
    """One anchor."""

    sentence: str
    sigmas: float
    """How many standard errors it is from the rest."""

    @property
    def contradicts(self) -> bool:
        return self.sigmas > CONTRADICTS


@dataclass(frozen=True, slots=True, eq=False)
class _Rest:
    """What is known of an anchor without it."""

    apart: float
    """The rest less the anchor, in the anchor's unit."""
    std: float
    """Of the rest."""

    def sigmas(self, std: float) -> float:
        return abs(self.apart) / float(np.hypot(self.std, std))


def judge(known: Beside, solution: Solution, unknowns: Unknowns) -> list[Judged]:
    """Of every anchor that bears on the fit, and of the mass where a thrust measures it."""
    vehicle, only = solution.point.vehicle, replace(known, flat=False, spinning=False)
    count = len(known.hovers) + len(known.thrusts)
    if not count:
        return []
    factor, _ = known.mass_factor(vehicle)
    own, std = _rows(only, vehicle, unknowns, factor)
    plain, belief = _without_anchors(only, solution, unknowns)
    left = _left(only, vehicle, factor)
    said: list[Judged] = []
    for i in range(count):
        others = [j for j in range(count) if j != i]
        more = own[others].T @ (own[others] / std[others, None] ** 2)
        fitted = np.linalg.inv(_with_mass(plain, known) + more + np.outer(own[i], own[i]) / std[i] ** 2)
        leverage = float(own[i] @ fitted @ own[i]) / std[i] ** 2
        covariance = np.linalg.inv(_with_mass(belief, known) + more)
        found = _Rest(left[i] / (1.0 - leverage), float(np.sqrt(own[i] @ covariance @ own[i])))
        said.append(_hover(known, i, found) if i < len(known.hovers) else _thrust(known, i, found))
    if known.weighs:
        said.append(_mass(only, vehicle, own[len(known.hovers) :, :-1], belief))
    return said


def _rows(known: Beside, vehicle: Vehicle, unknowns: Unknowns, factor: float) -> tuple[FloatArray, FloatArray]:
    """(r, p + 1) derivatives of commands and thrusts by the unknowns and by the mass factor, and (r,) deviations."""
    rows, std = [], []
    for hover in known.hovers:
        lone = replace(known, hovers=(hover,), thrusts=())
        rows.append(np.append(hover.std * lone.slopes(vehicle, unknowns.model)[0], 0.0))
        std.append(hover.std)
    for thrust in known.thrusts:
        speed = np.array([known.full_rad_s * thrust.command])
        made = rotor_thrust_n(vehicle, speed)[0]
        by = [_slope(vehicle, name, speed) for name in unknowns.model]
        rows.append(np.array([*by, made / factor]))
        std.append(thrust.std_n)
    full = np.zeros((len(rows), unknowns.size + 1))
    full[:, : len(unknowns.model)] = [row[:-1] for row in rows]
    full[:, -1] = [row[-1] for row in rows]
    return full, np.array(std)


def _slope(vehicle: Vehicle, name: str, speed: FloatArray) -> float:
    there, step = nudged(vehicle, name)
    return float(rotor_thrust_n(there, speed)[0] - rotor_thrust_n(vehicle, speed)[0]) / step


def _left(known: Beside, vehicle: Vehicle, factor: float) -> list[float]:
    """What the fit says of each anchor less what was measured, as a command and as a thrust."""
    left = [known.hovers_at(vehicle, hover) - hover.command for hover in known.hovers]
    for thrust in known.thrusts:
        made = rotor_thrust_n(vehicle, np.array([known.full_rad_s * thrust.command]))[0]
        left.append(float(made) - thrust.thrust_n)
    return left


def _without_anchors(known: Beside, solution: Solution, unknowns: Unknowns) -> tuple[FloatArray, FloatArray]:
    """(p, p) information on the unknowns by flights and priors, as the fit weighs it, and with errors correlated in
    time allowed for."""
    slopes = np.zeros((len(known.hovers) + len(known.thrusts), unknowns.size))
    slopes[:, : len(unknowns.model)] = known.slopes(solution.point.vehicle, unknowns.model)
    plain = solution.covariance()
    robust = robust_covariance(solution, len(unknowns.bias) + len(unknowns.delay))[0]
    wider = np.sqrt(np.maximum(np.diag(robust) / np.diag(plain), 1.0))
    information = solution.hessian - slopes.T @ slopes
    return information, information / np.outer(wider, wider)


def _with_mass(information: FloatArray, known: Beside) -> FloatArray:
    """(p + 1, p + 1) with what is known of the mass factor."""
    both = np.zeros((len(information) + 1, len(information) + 1))
    both[:-1, :-1] = information
    both[-1, -1] = max(known.mass.std / known.mass.value, 1e-9) ** -2.0
    return both


def _hover(known: Beside, i: int, rest: _Rest) -> Judged:
    hover = known.hovers[i]
    volts = "" if hover.battery_v is None else f" at {hover.battery_v:.3g} V"
    said = f"{hover.command + rest.apart:.3g} ± {rest.std:.1g}"
    what = f"hover command {hover.command:.3g} ± {hover.std:.1g}{volts}"
    if (sigmas := rest.sigmas(hover.std)) <= CONTRADICTS:
        return Judged(f"{what} (given): without it flights and the rest say {said}", sigmas)
    share = (hover.command / (hover.command + rest.apart)) ** 2 - 1.0
    return Judged(
        f"{what} contradicts flights and the rest, which say {said}, {sigmas:.0f} standard errors away. Measure it "
        f"again with a battery as full as in the flights, or the accelerometer's scale is off by {share:+.0%}",
        sigmas,
    )


def _thrust(known: Beside, i: int, rest: _Rest) -> Judged:
    thrust = known.thrusts[i - len(known.hovers)]
    said = f"{thrust.thrust_n + rest.apart:.3g} ± {rest.std:.1g} N"
    what = f"a rotor's thrust of {thrust.thrust_n:.3g} ± {thrust.std_n:.1g} N at {thrust.command:.3g}"
    if (sigmas := rest.sigmas(thrust.std_n)) <= CONTRADICTS:
        return Judged(f"{what} (given): without it flights, mass and the rest say {said}", sigmas)
    agrees_kg = known.mass.value * thrust.thrust_n / (thrust.thrust_n + rest.apart)
    return Judged(
        f"{what} contradicts flights, mass and the rest, which say {said}, {sigmas:.0f} standard errors away: measure "
        f"it again, or weigh the vehicle: {agrees_kg:.3g} kg in place of {known.mass.value:.3g} kg would agree",
        sigmas,
    )


def _mass(known: Beside, vehicle: Vehicle, slopes: FloatArray, belief: FloatArray) -> Judged:
    """Args: slopes: (r, p) of the thrusts by the unknowns; belief: information on these."""
    made = np.array([t.thrust_n for t in known.thrusts]) + _left(replace(known, hovers=()), vehicle, 1.0)
    made *= known.mass.value / vehicle.mass_kg
    of_flights = slopes @ np.linalg.solve(belief, slopes.T)
    error = np.diag([t.std_n**2 for t in known.thrusts]) + of_flights
    weight = np.linalg.solve(error, made)
    alone = float(weight @ [t.thrust_n for t in known.thrusts]) / float(weight @ made)
    alone_std = float(weight @ made) ** -0.5
    factor, std = known.mass_factor(vehicle)
    kg, given = known.mass.value, known.mass.std / known.mass.value
    sigmas = abs(alone - 1.0) / float(np.hypot(alone_std, given))
    return Judged(
        f"mass {kg:.4g} ± {known.mass.std:.1g} kg (given), {alone * kg:.4g} ± {alone_std * kg:.1g} kg by the thrust "
        f"of a rotor and the flights; together {factor * kg:.4g} ± {std * kg:.1g} kg, which the vehicle file has now",
        sigmas,
    )


def sag(known: Beside, vehicle: Vehicle) -> tuple[Vehicle, str] | None:
    """The vehicle with what hover commands at two or more voltages say of the battery, in words too.

    Where the flights' voltage was not logged the curve of thrust is that of a voltage in between, which follows.
    """
    hovers = known.at_voltages
    if not hovers or "battery_sag" in vehicle.effects:
        return None
    flown = known.hovers_at(vehicle, None)
    share = np.array([flown / h.command for h in hovers])
    std = share * [h.std / h.command for h in hovers]
    volts = np.array([float(h.battery_v or 0.0) for h in hovers])
    middle = float(np.average(volts, weights=std**-2.0))
    design = np.stack([np.ones_like(volts), volts - middle], axis=1) / std[:, None]
    (level, slope), covariance = np.linalg.lstsq(design, share / std, rcond=None)[0], np.linalg.inv(design.T @ design)
    slope_std = float(np.sqrt(covariance[1, 1]))
    listed = " and ".join(f"{h.command:.3g} at {h.battery_v:.3g} V" for h in _by_voltage(hovers))
    if slope <= 0.0:
        return vehicle, f"hover commands of {listed} contradict a battery: less voltage needs more command"
    reference_v = middle + (1.0 - level) / slope
    found = vehicle.with_effect("battery_sag", sag_per_v=slope, reference_v=reference_v, source=f"hover at {listed}")
    return found, (
        f"battery: by hover commands of {listed} rotors turn {100.0 * slope:.2g} ± {100.0 * slope_std:.1g} % slower "
        f"per volt less; the flights, whose voltage was not logged, were at {reference_v:.3g} V in the mean"
    )


def _by_voltage(hovers: Sequence[HoverCommand]) -> list[HoverCommand]:
    return sorted(hovers, key=lambda hover: -(hover.battery_v or 0.0))
