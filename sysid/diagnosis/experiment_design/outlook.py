"""What would tell: of every effect that is open, the manoeuvre that would show it in this space, or that none would."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from flight import FloatArray, InfeasibleError
from sysid.diagnosis.experiment_design.next_flight import NEEDS_A_CEILING, ask
from sysid.diagnosis.experiment_design.rehearsal import Room, fitted_into, rehearse
from sysid.diagnosis.findings import CandidateFinding, Verdict
from sysid.diagnosis.procedure import NODE_RATE_HZ, Diagnosis
from sysid.diagnosis.thresholds import THRESHOLDS
from vehicle import manoeuvres

LEAST_SPACE_M = 1.0
"""Least edge of the space that is proposed for the next flight."""
MOST_MANOEUVRES = 6
"""So many are rehearsed, those first that show most of what is open: each takes a second or two."""


@dataclass(frozen=True, slots=True)
class Outlook:
    """What the next flight could say of one candidate."""

    name: str
    manoeuvre: str
    """The one that would show the smallest size; empty if none fits into the space."""
    duration_s: float
    smallest_visible: dict[str, float]
    """Parameter to the smallest size that would then show, nine times in ten."""
    would_tell: bool
    """Whether its usual size would show."""

    def as_dict(self) -> dict[str, Any]:
        return {
            "manoeuvre": self.manoeuvre or None,
            "duration_s": self.duration_s,
            "smallest_visible": self.smallest_visible,
            "would_tell": self.would_tell,
            "sentence": self.sentence,
        }

    @property
    def sentence(self) -> str:
        """Advice in a few words."""
        if not self.manoeuvre:
            return "no manoeuvre that shows it fits into the space of these flights"
        flown = f"{self.duration_s:.0f} s of {self.manoeuvre.replace('_', ' ')}"
        if self.would_tell:
            return f"{flown} would show its usual size"
        return f"not even {flown} would show its usual size"


def outlook(found: Diagnosis, *, rng: np.random.Generator) -> dict[str, Outlook]:
    """By candidate that these flights cannot tell of: what a manoeuvre of its own, flown where these were, would show.

    Of one whose whole interval is too small to matter no flight is asked, whatever leaves it open: a flight is judged
    here by the usual size, and that would have shown.

    The simulated flights are those of `next_flight.rank`, so both say the same.
    """
    open_ = [f for f in found.candidates if f.verdict is Verdict.INCONCLUSIVE]
    open_ = [f for f in open_ if not all(size.within(THRESHOLDS.matters) for size in f.sizes)]
    model = found.search.models[-1]
    open_ = [f for f in open_ if f.name in model.scores]
    if not open_:
        return {}
    question = ask(model, [f.name for f in open_])
    size_m, corner_m = space(found)
    room = Room.of((size_m[0], size_m[1], size_m[2]), (corner_m[0], corner_m[1], corner_m[2]))
    after: dict[str, tuple[float, dict[str, float]]] = {}
    for name in _worth_rehearsing(open_):
        try:
            trajectory = fitted_into(manoeuvres.make(name), room, model.fit.vehicle)
            flown = rehearse(model.fit, trajectory, room, NODE_RATE_HZ, rng)
        except InfeasibleError:
            continue
        _, smallest = question.sizes(question.known + question.information(flown))
        after[name] = (trajectory.duration_s, smallest)
    return {f.name: _best(f, after) for f in open_}


def space(found: Diagnosis) -> tuple[FloatArray, FloatArray]:
    """(3,) size of the box that the training flights took up, to 0.1 m, and (3,) its lowest corner."""
    place = np.concatenate([f.position_world_m for f in found.search.models[0].fit.flights])
    low, high = np.nanmin(place, axis=0), np.nanmax(place, axis=0)
    size = np.round(np.maximum(high - low, LEAST_SPACE_M), 1)
    return size, np.round(0.5 * (low + high - size), 1) + 0.0


def _worth_rehearsing(open_: Sequence[CandidateFinding]) -> list[str]:
    wanted = [name for f in open_ for name in f.settled_by if name not in NEEDS_A_CEILING]
    known = [name for name in manoeuvres.LIBRARY if name in wanted]
    return sorted(known, key=lambda name: -wanted.count(name))[:MOST_MANOEUVRES]


def _best(finding: CandidateFinding, after: dict[str, tuple[float, dict[str, float]]]) -> Outlook:
    """The rehearsed manoeuvre that shows the smallest share of the usual size, of the parameter that shows least."""
    usual = {s.parameter: s.usual for s in finding.sizes}

    def least_shown(smallest: dict[str, float]) -> float:
        return max(smallest.get(parameter, np.inf) / size for parameter, size in usual.items())

    shares = {name: least_shown(smallest) for name, (_, smallest) in after.items()}
    name = min(shares, key=lambda n: shares[n], default="")
    if not name or not np.isfinite(shares[name]):
        return Outlook(finding.name, "", 0.0, {}, False)
    duration_s, smallest = after[name]
    return Outlook(
        finding.name, name, duration_s, {p: smallest[p] for p in usual if p in smallest}, shares[name] <= 1.0
    )
