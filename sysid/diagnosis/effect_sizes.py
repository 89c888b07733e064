"""How large an effect is, or may be, with its interval and the smallest size that would have shown."""

from scipy.special import ndtri

from sysid.diagnosis.candidates import Candidate
from sysid.diagnosis.findings import Size
from sysid.diagnosis.score import Score
from sysid.diagnosis.thresholds import THRESHOLDS
from sysid.estimator.result import NORMAL_90, Identification
from vehicle import effects

VISIBLE_SIGMAS = -float(ndtri(THRESHOLDS.chance / 2.0) + ndtri(0.1))
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
    units = {s.name: s.unit for s in effects.find(candidate.effect).parameters}
    return tuple(
        Size(n, units[n.split(".")[1]], float(v), float(sigma), NORMAL_90 * float(sigma), _visible(sigma, usual), usual)
        for n, v, sigma, usual in zip(candidate.parameters, found.size, found.sigma, candidate.usual, strict=True)
    )
