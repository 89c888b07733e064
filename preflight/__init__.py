"""A trajectory flown a thousand times in simulation before it is flown once: how likely it touches anything, why."""

from preflight.advice import Advice
from preflight.draws import Uncertainty
from preflight.hidden import Hidden
from preflight.result import Result
from preflight.scenario import Scenario
from preflight.study import Options, advised, fly
from preflight.worst import Replay, replay

__all__ = ["Advice", "Hidden", "Options", "Replay", "Result", "Scenario", "Uncertainty", "advised", "fly", "replay"]
