"""A trajectory flown a thousand times in simulation before it is flown once: how likely it touches anything, why."""

from preflight.draws import Uncertainty
from preflight.result import Result
from preflight.study import Options, fly

__all__ = ["Options", "Result", "Uncertainty", "fly"]
