"""How large an effect is, or may be, with its interval and the smallest size that would have shown; does it matter?"""

from statistics import NormalDist

import numpy as np

from sysid.diagnosis.evidence.candidates import Candidate
from sysid.diagnosis.evidence.score import Score
from sysid.diagnosis.findings import Size
from sysid.diagnosis.thresholds import THRESHOLDS
from sysid.estimator.result import Identification
from vehicle import effects
from vehicle.model import ROTORS

VISIBLE_SIGMAS = -(NormalDist().inv_cdf(THRESHOLDS.chance / 2.0) + NormalDist().inv_cdf(0.1))
"""A size of so many standard errors is called present nine times in ten."""


def _visible(sigma: float, usual: float) -> float:
    """Smallest size that would have been called present nine times in ten; what is of no consequence is never.

    Zero where nothing was flown that would show any size.
    """
    return max(VISIBLE_SIGMAS * float(sigma), THRESHOLDS.least_size * usual) if sigma > 0.0 else 0.0


def fitted(candidate: Candidate, found: Score, fit: Identification) -> tuple[Size, ...]:
    """Of an effect that is part of the model: with the interval of the fit, which knows how few blocks there are."""
    sizes = []
    for name, sigma, usual in zip(candidate.parameters, found.sigma, candidate.usual, strict=True):
        p, half = fit.vehicle.parameter(name), fit.estimate(name).interval90
        sizes.append(Size(name, p.unit, p.value, p.std, half, _visible(sigma, usual), usual))
    return tuple(sizes)


def scored(candidate: Candidate, found: Score) -> tuple[Size, ...]:
    """Of one that is not, to first order."""
    units = {s.name: s.unit for s in effects.find(candidate.effect, ROTORS[1]).parameters}
    return tuple(
        Size(n, units[n.split(".")[1]], float(v), float(sigma), float(half), _visible(sigma, usual), usual)
        for n, v, sigma, half, usual in zip(
            candidate.parameters, found.size, found.sigma, found.half90, candidate.usual, strict=True
        )
    )


def matters(fit: Identification, candidate: Candidate) -> bool:
    """Whether its fitted size is of any consequence."""
    own = [abs(fit.vehicle.value(n)) for n in candidate.parameters]
    return bool((np.array(own) > THRESHOLDS.least_size * np.array(candidate.usual)).any())


def shows(fit: Identification, candidate: Candidate) -> bool:
    """Whether the interval of any size is apart from zero: of a lag, other clocks may leave nothing."""
    estimates = [fit.estimate(name) for name in candidate.parameters]
    return any(e.status == "free" and abs(e.value) > e.interval90 for e in estimates)


def may_matter(fit: Identification, candidate: Candidate) -> bool:
    """Whether the interval of any size reaches what would matter, or is not known."""
    estimates = [fit.estimate(name) for name in candidate.parameters]
    return any(
        e.status != "free" or not abs(e.value) + e.interval90 <= THRESHOLDS.matters * usual
        for e, usual in zip(estimates, candidate.usual, strict=True)
    )
