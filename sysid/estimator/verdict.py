"""Whether a fit may be used: one verdict with its reasons, from the fit itself and from what physics allows."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any

import numpy as np

from flight.rotations import FloatArray
from flight.units import RAD_S_PER_RPM
from sysid.estimator.flights.flight_data import Flight
from sysid.estimator.predicts import Predicts
from sysid.logs.check import LogReport
from vehicle import Vehicle, wrench
from vehicle.forces import open_air

THRUST_UNUSUAL, THRUST_ABSURD = 2.0, 5.0
"""Factors between the fitted thrust and the vehicle file's: a poor data sheet, and no error of a data sheet."""
COEFFICIENT_USUAL, COEFFICIENT_POSSIBLE = (2e-3, 0.1), (4e-4, 0.4)
"""Thrust over density, disc area and tip speed squared; propellers of all sizes have 0.005 to 0.04."""
INERTIA_USUAL, INERTIA_POSSIBLE = (0.02, 1.0), (2e-3, 5.0)
"""Inertia over mass times the square of the largest hub distance; multirotors have 0.05 to 0.5."""
INERTIA_OFF = 3.0
"""Factor above the vehicle file's from which an inertia beyond mass times arm squared is no error of the file: it would
need all the mass farther out than the rotors."""
TRIANGLE = 1.1
"""No body's inertia about one axis exceeds the sum of the other two; fits may by this factor, from noise."""
WRONG_KINDS = ("time unit", "unit", "frame", "rotor order", "rotor spin")
"""Errors of the log check that forbid the use of numbers, whatever the fit says.

On real flights (docs/evidence/studies/real_logs_nanodrone.md) the check found none in logs that were read rightly, and
a fit to positions read with z down converged and stayed within every limit.
"""


class Use(StrEnum):
    """What may be done with a fit."""

    USABLE = "usable"
    DOUBTFUL = "doubtful"
    PREDICTION = "for prediction, not for design"
    """It predicts clearly better than the model that was given, and something forbids to design by its values."""
    REJECTED = "do not use"


@dataclass(frozen=True, slots=True)
class Verdict:
    """Whether a fit may be used, and why not."""

    against: tuple[str, ...] = ()
    """Sentences that forbid its use."""
    doubts: tuple[str, ...] = ()
    """Sentences that call for a second look."""
    unphysical: tuple[str, ...] = ()
    """Names of parameters that came out at values no vehicle of this mass and size has."""
    misread: bool = False
    """Whether the logs contradict themselves or the vehicle file: then no prediction speaks for the fit."""
    predicts: Predicts | None = None
    """How far its predictions are off; None where that was not asked."""

    @property
    def use(self) -> Use:
        if self.against:
            helps = self.predicts is not None and self.predicts.better and not self.misread
            return Use.PREDICTION if helps else Use.REJECTED
        return Use.DOUBTFUL if self.doubts else Use.USABLE

    @property
    def physical(self) -> bool:
        """Whether every estimated parameter is one that a vehicle can have."""
        return not self.unphysical

    def doubted(self, *sentences: str) -> "Verdict":
        """The same with more doubts."""
        return replace(self, doubts=(*self.doubts, *sentences))

    def beside(self, other: "Verdict") -> "Verdict":
        """Of two fits that are used together."""
        pairs = ((self.against, other.against), (self.doubts, other.doubts), (self.unphysical, other.unphysical))
        against, doubts, unphysical = (tuple(dict.fromkeys((*a, *b))) for a, b in pairs)
        misread, judged = self.misread or other.misread, other.predicts or self.predicts
        return Verdict(against, doubts, unphysical, misread, judged)

    @property
    def reasons(self) -> tuple[str, ...]:
        """All sentences, the weightier first."""
        return (*self.against, *self.doubts)

    @property
    def sentence(self) -> str:
        """The verdict with its first reason."""
        reasons = self.reasons
        more = f" (and {len(reasons) - 1} more)" if len(reasons) > 1 else ""
        return f"{self.use}: {reasons[0]}{more}" if reasons else str(self.use)

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return {
            "use": str(self.use),
            "reasons": list(self.reasons),
            "physical": self.physical,
            "unphysical": list(self.unphysical),
            "predicts": self.predicts and self.predicts.as_dict(),
        }


def of_fit(
    given: Vehicle, fitted: Vehicle, flights: Sequence[Flight], free: Iterable[str], against: Iterable[str]
) -> Verdict:
    """The verdict of one fit.

    Args:
        given: the vehicle as the user gave it.
        free: names that were estimated; what was held is not judged.
        against: what forbids its use already: it did not converge, or leaves too much unexplained.
    """
    free = set(free)
    verdict = Verdict(tuple(against))
    if any(name.startswith("thrust_") for name in free):
        verdict = verdict.beside(_thrust(given, fitted, flights))
    if any(name.startswith("inertia_") for name in free):
        verdict = verdict.beside(_inertia(given, fitted, free))
    return verdict


def too_large_inertias(given: Vehicle, fitted: Vehicle, free: Iterable[str]) -> tuple[str, ...]:
    """Names of the estimated inertias that neither mass and size nor the vehicle file allows.

    None where all hubs are at the origin: then size says nothing.
    """
    bound = _mass_at_rotors(fitted)
    if not bound > 0.0:
        return ()
    inertias = (name for name in sorted(free) if name.startswith("inertia_"))
    return tuple(n for n in inertias if fitted.value(n) > max(bound, INERTIA_OFF * given.value(n)))


def _mass_at_rotors(vehicle: Vehicle) -> float:
    """Mass times the square of the largest hub distance, kg m2: no part of a multirotor is much farther out."""
    return vehicle.mass_kg * float(np.square(vehicle.hub_body_m[:, :2]).sum(axis=1).max())


def of_logs(reports: Iterable[LogReport]) -> Verdict:
    """What the checks of the logs mean for a fit to them."""
    against = tuple(
        f"{report.name}: {finding.sentence}; {finding.fix}"
        for report in reports
        for finding in report.findings
        if finding.level == "error" and finding.what in WRONG_KINDS
    )
    return Verdict(against=against, misread=bool(against))


THRUST = "thrust"
"""Stands among the parameters for those of the thrust curve."""


def usual_rotor_speed(flights: Sequence[Flight]) -> FloatArray:
    """(r,) median over the flights."""
    return np.median(np.concatenate([f.rotor_speed_rad_s for f in flights]), axis=0)


def by_nominal_speed(flights: Sequence[Flight]) -> bool:
    """Whether rotor speeds are commands from 0 to 1 times a speed that nobody measured: their size says nothing."""
    return any(flight.full_throttle_rad_s is not None for flight in flights)


def thrust_n(vehicle: Vehicle, speed_rad_s: FloatArray) -> float:
    """Of all rotors, in still air."""
    still = np.zeros((1, 3))
    return float(wrench(vehicle, still, still, speed_rad_s[None], open_air(1, vehicle.rotors))[0][0, 2])


def _thrust(given: Vehicle, fitted: Vehicle, flights: Sequence[Flight]) -> Verdict:
    """Against the vehicle file, and against what a propeller of this size can do."""
    speed = usual_rotor_speed(flights)
    found, believed = thrust_n(fitted, speed), thrust_n(given, speed)
    verdict = Verdict()
    if by_nominal_speed(flights) and found > 0.0:
        return verdict
    if believed > 0.0 and found > 0.0:
        ratio = found / believed
        said = f"thrust at {speed.mean():.0f} rad/s came out {ratio:.3g} times the vehicle file's"
        if not 1.0 / THRUST_ABSURD < ratio < THRUST_ABSURD:
            verdict = verdict.beside(_no_vehicle(f"{said}: {_cause(ratio)}", THRUST))
        elif not 1.0 / THRUST_UNUSUAL < ratio < THRUST_UNUSUAL:
            verdict = verdict.doubted(f"{said}; weigh the vehicle, and check mass_kg and the thrust in its file")
    else:
        verdict = _no_vehicle(f"thrust at {speed.mean():.0f} rad/s came out {found:.3g} N", THRUST)
    radius_m, density = fitted.value("rotor_radius_m"), fitted.value("air_density_kg_m3")
    coefficient = found / (density * np.pi * radius_m**4 * float((speed**2).sum())) if density > 0.0 else np.nan
    if np.isfinite(coefficient) and not COEFFICIENT_USUAL[0] < coefficient < COEFFICIENT_USUAL[1]:
        said = (
            f"the thrust coefficient of a rotor of {radius_m:.3g} m came out {coefficient:.2g} (thrust over density, "
            "disc area and tip speed squared), where propellers have 0.005 to 0.04. Check the unit of rotor speed "
            "(rpm or rad/s), rotor_radius_m and mass_kg"
        )
        possible = COEFFICIENT_POSSIBLE[0] < coefficient < COEFFICIENT_POSSIBLE[1]
        verdict = verdict.doubted(said) if possible else verdict.beside(_no_vehicle(said, THRUST))
    return verdict


def _cause(ratio: float) -> str:
    """The likely reason of a thrust that is off by a large factor."""
    if 0.4 < ratio * RAD_S_PER_RPM**2 < 2.5:
        return "rotor speed in rad/s was read as rpm, or the vehicle file's thrust is per rpm; correct the unit"
    if 0.4 < ratio / RAD_S_PER_RPM**2 < 2.5:
        return "rotor speed in rpm was read as rad/s; multiply it by 2 pi / 60, or say unit = 'rpm' in the column map"
    return "check the unit of rotor speed, mass_kg, and the thrust in the vehicle file"


def _inertia(given: Vehicle, fitted: Vehicle, free: Iterable[str]) -> Verdict:
    """Against mass and size, the vehicle file, and what any body can have."""
    too_large = too_large_inertias(given, fitted, free)
    scale = _mass_at_rotors(fitted)
    inertia = {axis: fitted.value(f"inertia_{axis}_kg_m2") for axis in ("xx", "yy", "zz")}
    verdict = Verdict()
    for axis, value in inertia.items():
        name, share = f"inertia_{axis}_kg_m2", value / scale if scale > 0.0 else np.nan
        if np.isfinite(share) and not INERTIA_USUAL[0] < share < INERTIA_USUAL[1]:
            said = (
                f"{name} came out {value:.3g}, {share:.2g} times mass times arm squared ({scale:.3g} kg m2), where "
                "multirotors have 0.05 to 0.5: check mass_kg, the rotors' positions, their order and units"
            )
            if name in too_large:
                said += (
                    f"; the vehicle file has less than a third of it ({given.value(name):.3g}). Rotors that answer "
                    "disturbances look like a heavy body: fit with gusts='estimate' (the default), fly quicker turns "
                    "in calm air, leave out take-off and landing, or hold the inertias"
                )
            possible = name not in too_large and INERTIA_POSSIBLE[0] < share < INERTIA_POSSIBLE[1]
            verdict = verdict.doubted(said) if possible else verdict.beside(_no_vehicle(said, name))
    total = sum(inertia.values())
    for axis, value in inertia.items():
        if value > TRIANGLE * (total - value):
            verdict = verdict.doubted(
                f"inertia_{axis}_kg_m2 of {value:.3g} exceeds the sum of the other two ({total - value:.3g}), which no "
                "body's does: these flights turn too little about some axis"
            ).beside(Verdict(unphysical=(f"inertia_{axis}_kg_m2",)))
    return verdict


def _no_vehicle(sentence: str, parameter: str) -> Verdict:
    """Against a value that no vehicle has."""
    return Verdict(against=(sentence,), unphysical=(parameter,))
