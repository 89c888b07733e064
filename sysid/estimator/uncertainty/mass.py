"""Is the mass right? Flights show every force and inertia per mass alone, so a wrong mass scales all of them alike.

One number of the vehicle file that is wrong moves one estimate; the mass moves thrust, torque, drag and inertia by the
same factor. So the factors by which the estimates came out larger than believed are averaged, each with the error that
the file and the fit state for it, and their scatter says how far that average is to be trusted (Birge, The calculation
of errors by the method of least squares, Physical Review 40, 1932).
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from vehicle import Vehicle

LEAST_WITNESSES = 3
"""Estimates with a believed value and its error, before they are said to have a factor in common."""
SIGMAS = 3.0
"""A common factor is told when it is so many standard errors from 1 ..."""
SIGMAS_OF_KIND = 1.5
"""... and when inertias alone, and all else alone, show it by so many: thin air moves no inertia, however many
coefficients it moves, and inertias drawn too heavy move no thrust."""
FORM_ERROR = 0.03
"""Part of each estimate's relative error: no law of the catalogue is more exact than this, and the air's density, which
moves thrust and drag but no inertia, is not known to this."""
THRUST_OFF = 0.1
"""Share by which thrust alone may differ from the vehicle file's before it is worth a sentence."""


@dataclass(frozen=True, slots=True)
class CommonFactor:
    """By how much all that scales with the mass came out larger than the vehicle file has it."""

    value: float
    sigma: float
    """Standard error, of the scatter too."""
    witnesses: int
    """How many estimates it is the mean of."""
    of_all: bool
    """Whether inertias alone, and all other estimates alone, are off to its side of 1."""

    @property
    def sigmas(self) -> float:
        """How many standard errors its logarithm is from zero: 10 % too large and too small show alike."""
        return abs(float(np.log(self.value))) * self.value / self.sigma


def common_factor(given: Vehicle, fitted: Mapping[str, tuple[float, float]]) -> CommonFactor | None:
    """The weighted mean of fitted over believed value.

    None with fewer than `LEAST_WITNESSES`, or without a thrust or an inertia: only the mass scales both.

    Args:
        fitted: value and standard error of what was estimated. Only what has a believed value with an error counts:
            where the file states none, nothing is known of how far it may be off.
    """
    names, logs, variances = [], [], []
    for name, (value, sigma) in fitted.items():
        believed = given.parameters.get(name)
        if believed is None or not believed.unit.startswith(("N", "kg")) or believed.std <= 0.0:
            continue
        if value > 0.0 and believed.value > 0.0:
            names.append(name)
            logs.append(np.log(value / believed.value))
            variances.append((sigma / value) ** 2 + (believed.std / believed.value) ** 2 + FORM_ERROR**2)
    both = all(any(name.startswith(kind) for name in names) for kind in ("thrust_", "inertia_"))
    if len(logs) < LEAST_WITNESSES or not both:
        return None
    weight = 1.0 / np.array(variances)
    mean = float(weight @ logs / weight.sum())
    scatter = float(weight @ (np.array(logs) - mean) ** 2) / (len(logs) - 1)
    factor = float(np.exp(mean))
    inertias = np.array([name.startswith("inertia_") for name in names])
    pulls = np.sign(mean) * weight * np.array(logs)  # of a kind: its mean by the error of that
    of_all = all(pulls[kind].sum() > SIGMAS_OF_KIND * np.sqrt(weight[kind].sum()) for kind in (inertias, ~inertias))
    sigma = factor * float(np.sqrt(max(1.0, scatter) / weight.sum()))
    return CommonFactor(factor, sigma, len(logs), bool(of_all))


def what_is_known(given: Vehicle, fitted: Mapping[str, tuple[float, float]]) -> str:
    """How far flights and vehicle file together tell the mass, in a sentence.

    Args:
        fitted: as in `common_factor`.
    """
    said = (
        f"the mass was given as {given.mass_kg:g} kg and not estimated: only ratios to it are identifiable. "
        "Thrust, drag and inertia are as right as the mass is. "
    )
    common = common_factor(given, fitted)
    if common is None:
        return said + (
            f"Whether it is right does not show: that takes {LEAST_WITNESSES} estimates, a thrust and an inertia among "
            "them, whose errors the vehicle file states"
        )
    agrees_kg, off = given.mass_kg / common.value, np.exp(SIGMAS * common.sigma / common.value)
    return said + (
        f"With the vehicle file's other numbers and their errors masses of {agrees_kg / off:.3g} to "
        f"{agrees_kg * off:.3g} kg agree ({SIGMAS:g} standard errors)"
    )


def sentences(
    given: Vehicle, fitted: Mapping[str, tuple[float, float]], thrust: float, speed_rad_s: float
) -> list[str]:
    """What the estimates say about the mass; empty if they are as believed.

    Args:
        fitted: as in `common_factor`.
        thrust: of all rotors, fitted over believed.
        speed_rad_s: at this rotor speed.
    """
    common = common_factor(given, fitted)
    if common is not None and common.of_all and common.sigmas > SIGMAS:
        agrees_kg = given.mass_kg / common.value
        return [
            f"the {common.witnesses} estimates that scale with the mass came out {common.value:.3f} ± "
            f"{common.sigma:.3f} times the vehicle file's in the mean (thrust {thrust:.2f} times). The mass given "
            f"({given.mass_kg:.4g} kg) is likely wrong; weigh the vehicle. With {agrees_kg:.4g} ± "
            f"{agrees_kg * common.sigma / common.value:.2g} kg the rest of the file would be right. Correct it and fit "
            "again: thrust, drag and inertia all follow it"
        ]
    if thrust <= 0.0 or abs(thrust - 1.0) < THRUST_OFF:
        return []
    return [
        f"thrust at {speed_rad_s:.0f} rad/s came out {thrust:.2f} times the vehicle file's: the mass given "
        f"({given.mass_kg:g} kg) or the file's thrust is wrong, and flights cannot tell which; weigh the vehicle. If "
        "it is the mass, correct it and fit again: thrust, drag and inertia all follow it"
    ]
