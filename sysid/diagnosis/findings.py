"""What a diagnosis says: candidates with verdicts, additions with what they brought, a curve when no name fits.

These types know nothing of flights: a camera model can be diagnosed in the same words (candidate, evidence, addition,
error before and after).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from flight.rotations import FloatArray
from sysid.diagnosis.evidence.free_form import unit

SCHEMA_VERSION = 2
"""Version of `Diagnosis.as_dict` of `sysid.diagnosis.diagnose`."""


class Verdict(StrEnum):
    """What the measurements say about an effect."""

    PRESENT = "present"
    PROXY = "useful proxy"
    """Not the law that is missing, yet it lowers the error of held-out flights: part of the model, and said so."""
    INCONCLUSIVE = "inconclusive"
    EXCLUDED = "excluded"


class Outcome(StrEnum):
    """How an attempt to add an effect ended."""

    ADDED = "added"
    UNDECIDED = "undecided"
    """A confounded effect explains as much."""
    PROXY = "proxy"
    """A free curve explains more."""
    USEFUL_PROXY = "useful proxy"
    """A free curve explains more, and the effect was added all the same, for it lowers the held-out error."""
    NOT_CONFIRMED = "not confirmed"
    REMOVED = "removed"
    """A later addition made it unnecessary."""


class JudgedBy(StrEnum):
    """Which flights confirmed or refused an attempt."""

    HELD_OUT = "held-out flights"
    TRAINING = "the training flights"
    LEFT_OUT = "stretches of the training flights, each judged by the rest"


@dataclass(frozen=True, slots=True)
class Size:
    """One parameter of a candidate."""

    parameter: str
    unit: str
    value: float
    sigma: float
    """Standard error that allows for gusts and for slightly wrong forms."""
    half90: float
    """Half of the interval that holds the true size with 90 %."""
    smallest_visible: float
    """A size of this much would have been called present nine times in ten; zero: no size would have shown."""
    usual: float
    """How large it typically is on a vehicle of this mass, arm and rotor speed."""

    @property
    def interval90(self) -> tuple[float, float]:
        """Holds the true size with 90 %."""
        return self.value - self.half90, self.value + self.half90

    @property
    def excluded_above(self) -> float:
        """Sizes above this can be excluded with 95 %: the farther end of the interval."""
        return abs(self.value) + self.half90

    def within(self, share: float) -> bool:
        """Whether its whole interval lies within this share of the usual size; a size that was not flown does not."""
        return self.sigma > 0.0 and self.excluded_above <= share * self.usual

    def as_dict(self) -> dict[str, Any]:
        return {
            "unit": self.unit,
            "value": self.value,
            "sigma": self.sigma,
            "interval90": list(self.interval90) if self.sigma > 0.0 else None,
            "excluded_above": self.excluded_above,
            "smallest_visible": self.smallest_visible,
            "usual": self.usual,
        }


@dataclass(frozen=True, slots=True)
class CandidateFinding:
    """What the measurements say about one candidate."""

    name: str
    verdict: Verdict
    reason: str
    """The verdict in a sentence."""
    sizes: tuple[Size, ...]
    gain: float
    """Predicted fall of half the sum of squares, judged on blocks left out of the estimate."""
    significance: float
    """Probability that chance alone would explain as much."""
    error_m: float
    """Root mean square position error after 0.5 s that this effect makes, at the estimated size."""
    confidence: float
    """Probability that this effect is really missing (of those added: that this is the right name)."""
    confounded: tuple[tuple[str, float], ...]
    """Others that leave nearly the same traces on these flights: name, and share of the trace (0 to 1)."""
    settled_by: tuple[str, ...]
    """Manoeuvres that show it best."""
    channels: tuple[str, ...]
    regressor: str

    @property
    def size(self) -> dict[str, float]:
        """Parameter to value."""
        return {s.parameter: s.value for s in self.sizes}

    @property
    def sigma(self) -> dict[str, float]:
        """Parameter to standard error."""
        return {s.parameter: s.sigma for s in self.sizes}

    @property
    def smallest_visible(self) -> dict[str, float]:
        """Parameter to the smallest size these flights could have shown."""
        return {s.parameter: s.smallest_visible for s in self.sizes}

    def reaches(self, share: float) -> bool:
        """Whether the interval of any size that shows at all holds more than this share of the usual one."""
        return any(s.sigma > 0.0 and not s.within(share) for s in self.sizes)

    def as_dict(self) -> dict[str, Any]:
        return {
            "name": self.name,
            "verdict": str(self.verdict),
            "reason": self.reason,
            "sizes": {s.parameter: s.as_dict() for s in self.sizes},
            "evidence": {"gain": self.gain, "chance": self.significance, "error_0.5_s_m": self.error_m},
            "confidence": self.confidence,
            "confounded_with": [{"name": name, "share": share} for name, share in self.confounded],
            "settled_by": list(self.settled_by),
            "channels": list(self.channels),
            "regressor": self.regressor,
        }


@dataclass(frozen=True, slots=True)
class OutsideFinding:
    """Something is missing that no known effect is: which channel, against what, and the curve."""

    channel: str
    variable: str
    variable_unit: str
    at: FloatArray
    """(m,) values of the variable over the range flown."""
    acceleration: FloatArray
    """(m,) mean residual there: m/s2 for a force channel, rad/s2 for a torque channel, of thrust the share of it."""
    band: FloatArray
    """(m,) one standard error of it."""
    force_or_torque: float
    """What to multiply the acceleration by: mass (kg) or moment of inertia (kg m2), 1 for a share of the thrust."""
    gain: float
    significance: float
    confidence: float
    nearest: tuple[tuple[str, float], ...] = ()
    """Known effects of the same physics, none of which is this law, with the share each has in explaining it."""

    def as_dict(self) -> dict[str, Any]:
        return {
            "channel": self.channel,
            "variable": self.variable,
            "variable_unit": self.variable_unit,
            "at": self.at.tolist(),
            "residual": (self.acceleration * self.force_or_torque).tolist(),
            "residual_sigma": (self.band * self.force_or_torque).tolist(),
            "residual_unit": unit(self.channel),
            "evidence": {"gain": self.gain, "chance": self.significance},
            "confidence": self.confidence,
            "nearest": [{"name": name, "probability": share} for name, share in self.nearest],
        }


@dataclass(frozen=True, slots=True)
class Attempt:
    """One candidate that was tried, and how it ended."""

    name: str
    outcome: Outcome
    sentence: str
    """In words, `helped` or `did not help` with the numbers."""
    confidence: float
    rivals: tuple[tuple[str, float], ...]
    reduction: float
    """Reduction of the cost on the flights that judged."""
    reduction_sigma: float
    judged_on: str

    def as_dict(self) -> dict[str, Any]:
        return {
            "name": self.name,
            "outcome": str(self.outcome),
            "sentence": self.sentence,
            "confidence": self.confidence,
            "rivals": [{"name": name, "probability": p} for name, p in self.rivals],
            "evidence": {"cost_reduction": self.reduction, "sigma": self.reduction_sigma, "judged_on": self.judged_on},
        }


@dataclass(frozen=True, slots=True)
class Stair:
    """One step of the error staircase: a model of the history and its prediction errors."""

    model: str
    """`as given`, `fitted`, `+ effect` or `- effect`."""
    position_m: Mapping[str, float]
    """Horizon in words (`0.5 s`) to root mean square position error."""

    def as_dict(self) -> dict[str, Any]:
        return {"model": self.model, "position_error_m": dict(self.position_m)}
