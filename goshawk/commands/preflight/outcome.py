"""What came out of a preflight: the result, what it asks of the next plan, and the worst flights."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

import preflight
import vehicle
from goshawk.commands.plan.preflown import PLAN_AGAIN
from goshawk.commands.preflight.inputs import Subject
from preflight import margins

_SAMPLES = 50
"""Of a segment, for the room that the plan has in it."""


@dataclass(frozen=True, eq=False)
class Outcome:
    """A result, beside what it is about."""

    subject: Subject
    result: preflight.Result
    replay: preflight.Replay | None = None
    """None: not flown again."""
    advice: preflight.Advice | None = None
    """None: not asked for, or not found before Ctrl-C."""

    @cached_property
    def plan_again(self) -> dict[str, Any] | None:
        """The margin to plan with so that fewer flights are lost; None if more room is not what is missing.

        Where flights touch it is the room that the plan has in that segment, and what they are short of; where they
        are given up the plan's margin, which the controller allows them, and more.
        """
        segments = margins.needed(self.result)
        if not segments:
            return None
        of, asked = self.subject, list[dict[str, Any]]()
        for each in segments:
            positions = of.item.trajectory.position(np.linspace(each.from_s, each.to_s, _SAMPLES))
            room_m = float(np.min(of.area.field.distance(positions))) - of.radius_m if each.touching else of.margin_m
            asked.append(each.as_dict() | {"margin_m": math.ceil(1e3 * (room_m + each.extra_m)) / 1e3})
        return {"margin_m": max(each["margin_m"] for each in asked), "segments": asked}

    def as_dict(self) -> dict[str, Any]:
        """The whole outcome."""
        of, replay = self.subject, self.replay
        found = self.result.as_dict() | {
            "trajectory": of.item.name,
            "map_hash": of.area.hash,
            "vehicle": of.vehicle.name,
            "vehicle_hash": vehicle.vehicle_hash(of.vehicle),
            "seed": of.options.seed,
            PLAN_AGAIN: self.plan_again,
            "worst": [] if replay is None else [track.as_dict(of.item.trajectory) for track in replay.worst],
        }
        return found if self.advice is None else found | {"advice": self.advice.as_dict()}
