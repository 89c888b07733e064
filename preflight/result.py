"""What the flights of a preflight came to: risk, tube, reserves, where it is narrow, what dominates, go or no-go."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from firmware_bridge import _controller
from flight import FloatArray, Trajectory
from preflight import core, remedies, statistics
from preflight.hidden import Hidden, forbids, left_of, together
from preflight.rare import MOST_FLIGHTS, Rare
from preflight.record import BINS, Record
from preflight.statistics import LEAST_SHARE, QUANTILES, Probability

SCHEMA = "goshawk-preflight"
SCHEMA_VERSION = 1
LEAST_FINISHED = 0.9
"""A trajectory that the controller gives up more often than the rest of this is a no-go at any risk."""
_NEAREST_SHARE = 0.05


@dataclass(frozen=True, slots=True)
class Place:
    """Where flights touch, or come closest."""

    segment: int
    time_s: float
    point_world_m: tuple[float, float, float]
    share: float
    """Of the flights that are looked at, how many do so in this segment."""
    touching: bool
    """Whether those are the ones that touch; else the nearest twentieth."""

    def as_dict(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in self.__slots__}


@dataclass(frozen=True, slots=True)
class Removed:
    """The same flights with the dominating uncertainty removed."""

    factor: str
    risk: Probability


@dataclass(frozen=True, slots=True, eq=False)
class Result:
    """A preflight."""

    record: Record
    trajectory: Trajectory
    wanted: int
    """Flights that were asked for; fewer were flown if it was interrupted."""
    risk: float
    """That is accepted."""
    shares: Mapping[str, float]
    """Of the variance of the least clearance (of the largest error without a map) by factor, the largest first.

    Empty after Ctrl-C, and where the flights are too few."""
    loss_shares: Mapping[str, float]
    """The same of whether a flight is lost; empty where too few were."""
    assumed: tuple[str, ...]
    removed: Removed | None = None
    steps: int = 0
    rare: Rare | None = None
    """What was found beyond these flights by levels of ever nearer ones; None where they were counted."""
    unexplained: bool = False
    """Whether Ctrl-C ended it before it was told what decides."""
    hidden: Hidden | None = None
    """What the map may have missed in the plan's way, which no flight meets; None: not known."""

    @property
    def flights(self) -> int:
        return len(self.record)

    @property
    def cut_off(self) -> bool:
        """Whether Ctrl-C ended it before all was flown."""
        return self.flights < self.wanted or (self.rare is not None and self.rare.cut_off)

    @property
    def lost(self) -> Probability:
        """Of the flights: to touch, to leave the map, to fall, or to come down without a position."""
        return Probability.of(self.record.lost) if self.rare is None else self.rare.risk

    @property
    def touched(self) -> Probability:
        return Probability.of(self.record.touched)

    @property
    def left_map(self) -> Probability:
        return Probability.of(self.record.left_map)

    @property
    def finished(self) -> float:
        """Share of flights that came to the trajectory's end."""
        return float(np.mean(self.record.ending == core.FINISHED))

    @property
    def upper(self) -> float:
        """Bound of the risk: of being lost, or meeting what the map has missed."""
        return together(self.lost.upper, self.hidden)

    @property
    def go(self) -> bool:
        return self.upper <= self.risk and self.finished >= LEAST_FINISHED

    @property
    def dominating(self) -> tuple[str, float] | None:
        """What decides most whether flights are lost, or where that cannot be told, how close they come; its share.

        None if these flights do not tell it.
        """
        for shares in (self.loss_shares, self.shares):
            if shares and (first := max(shares, key=lambda name: shares[name])) and shares[first] > LEAST_SHARE:
                return first, shares[first]
        return None

    def endings(self) -> dict[str, Probability]:
        """Every ending but the trajectory's own, in the controller's words."""
        r = self.record
        other = r.ending != core.FINISHED
        kinds = sorted({(int(s), int(w), int(e)) for s, w, e in zip(r.end_state[other], r.reason[other],
                                                                    r.ending[other], strict=True)})  # fmt: skip
        return {
            _ending_words(*kind): Probability.of(
                (r.end_state == kind[0]) & (r.reason == kind[1]) & (r.ending == kind[2])
            )
            for kind in kinds
        }

    def tube_m(self) -> FloatArray:
        """(3, `BINS`) tracking error that 50, 90 and 99 % of flights keep at each time; fewer keep it all along."""
        seen = np.isfinite(self.record.error_m)
        filled = np.where(seen, self.record.error_m, np.inf)
        return np.quantile(filled, QUANTILES, axis=0, method="higher")

    def place(self) -> Place | None:
        """Where flights touch most often, or else come closest; None without a map."""
        r = self.record if self.rare is None else self.rare.worst
        if not np.isfinite(r.clearance_m).any():
            return None
        chosen = r.touched
        touching = bool(chosen.any())
        if not touching:
            chosen = r.clearance_m <= np.quantile(r.clearance_m, _NEAREST_SHARE)
        times = np.nan_to_num(r.path_s[chosen])
        segments = self.trajectory.segment_at(times)[0]
        values, counts = np.unique(segments, return_counts=True)
        mine = segments == values[counts.argmax()]
        point = np.median(r.point_world_m[chosen][mine], axis=0)
        x, y, z = (float(c) for c in point)
        return Place(
            int(values[counts.argmax()]), float(np.median(times[mine])), (x, y, z), float(mine.mean()), touching
        )

    def reason(self) -> str:
        """Why it is a go or not, in a sentence."""
        if self.go:
            return f"the risk is at most {self.upper:.1e}{self._of_hidden()}, and {self.risk:g} is accepted"
        if self.finished < LEAST_FINISHED:
            return f"only {100 * self.finished:.0f} % of the flights come to the end"
        if self.hidden is not None and self.hides:
            met = self.hidden.probability
            left = "" if met > self.risk else ", which leaves the flights too little to show"
            return f"a thing hidden in the map is met by {met:.1e}{left}; {self.risk:g} is accepted"
        if self.rare is not None:
            return self._rare_reason(self.rare)
        if self.lost.count / self.flights <= self._left:
            need = statistics.flights_for(self._left, self.lost.count)
            again = " with another --seed" if self.lost.count else ""  # a second look at the same flights proves less
            return f"{self.lost}, which does not show a risk below {self._left:.3g}: fly at least {need}{again}"
        about = together(self.lost.estimate, self.hidden)
        return f"the risk is about {about:.1e}, at most {self.upper:.1e}{self._of_hidden()}; {self.risk:g} is accepted"

    @property
    def hides(self) -> bool:
        """Whether what the map may have missed alone forbids a go."""
        return forbids(self.risk, self.hidden)

    @property
    def _left(self) -> float:
        return left_of(self.risk, self.hidden)

    def _of_hidden(self) -> str:
        chance = 0.0 if self.hidden is None else self.hidden.probability
        return f" ({chance:.1e} of it hidden things)" if chance else ""

    @property
    def beside_flights(self) -> str:
        """What the flights do not show, in a sentence."""
        if self.hidden is None:
            return "What the map may have missed is not counted."
        return f"With what the map may have missed ({self.hidden.probability:.1e}): at most {self.upper:.1e}."

    def _rare_reason(self, rare: Rare) -> str:
        more = f"; {self.risk:g} is accepted"
        if not rare.risk.reached:
            again = "" if self.cut_off else self._more_by_levels()
            return (
                f"after {rare.risk.levels} levels the risk is at most {self.upper:.1e}{self._of_hidden()}{more}{again}"
            )
        if rare.risk.estimate <= self._left:
            more = f", which does not show {self._left:.3g}{self._more_by_levels()}"
        in_all = f", in all at most {self.upper:.1e}{self._of_hidden()}" if self._of_hidden() else ""
        return f"the risk is {rare.risk}{in_all}{more}"

    def _more_by_levels(self) -> str:
        """What would show more: larger levels, or where there are none, counting."""
        more = 2 * self.flights
        by = f"--rare --flights {more}" if more <= MOST_FLIGHTS else f"--flights {statistics.flights_for(self._left)}"
        return f": fly {by} with another --seed"

    def _risk(self) -> dict[str, Any]:
        """As JSON values: by levels beside what counting alone shows in the first."""
        first = {} if self.rare is None else {"counted": Probability.of(self.record.lost).as_dict()}
        return self.lost.as_dict() | first

    def as_dict(self) -> dict[str, Any]:
        """As plain JSON values."""
        r, place, first = self.record, self.place(), self.dominating
        return {
            "schema": SCHEMA,
            "version": SCHEMA_VERSION,
            "go": self.go,
            "reason": self.reason(),
            "risk_accepted": self.risk,
            "method": "counting" if self.rare is None else "subset simulation",
            "flights": self.flights,
            "flights_wanted": self.wanted,
            "risk": self._risk(),
            "hidden": None if self.hidden is None else self.hidden.as_dict(),
            "risk_with_hidden": None
            if self.hidden is None
            else {"estimate": together(self.lost.estimate, self.hidden), "upper95": self.upper},
            "touched": self.touched.as_dict(),
            "left_map": self.left_map.as_dict(),
            "finished": self.finished,
            "endings": {words: p.as_dict() for words, p in self.endings().items()},
            "clearance_m": statistics.quantiles(r.clearance_m),
            "error_m": statistics.quantiles(_largest(r.error_m)),
            "tilt_rad": statistics.quantiles(r.tilt_rad),
            "rotor_reserve": statistics.quantiles(r.rotor_reserve),
            "energy_j": statistics.quantiles(r.energy_j),
            "duration_s": statistics.quantiles(r.duration_s),
            "tube": {
                "time_s": ((np.arange(BINS) + 0.5) * self.trajectory.duration_s / BINS).tolist(),
                **{f"q{100 * q:.0f}_m": _plain(row) for q, row in zip(QUANTILES, self.tube_m(), strict=True)},
            },
            "where": None if place is None else place.as_dict(),
            "dominating": first and {"factor": first[0], "share": first[1], "remedy": remedies.words(first[0])},
            "shares": dict(self.shares),
            "loss_shares": dict(self.loss_shares),
            "without_it": None if self.removed is None else self.removed.risk.as_dict(),
            "assumed": list(self.assumed),
        }


def spread(record: Record) -> FloatArray:
    """(n,) what the variance is decomposed of: the least clearance, or without a map the largest error.

    NaN for flights that were given up on the way, which did not come to the narrow places. The farthest hundredth on
    either side counts as the rest's farthest, so that a few wild flights do not hide what moves the others.
    """
    known = np.isfinite(record.clearance_m).any()
    value = np.where(record.lost | (record.ending == core.FINISHED), record.clearance_m, np.nan)
    value = value if known else np.where(np.isnan(value), np.nan, -_largest(record.error_m))
    return np.clip(value, *np.nanquantile(value, (0.01, 0.99))) if np.isfinite(value).any() else value


def _largest(error_m: np.ndarray) -> FloatArray:
    found = np.where(np.isfinite(error_m), error_m, -np.inf).max(axis=1).astype(np.float64)
    return np.where(np.isfinite(found), found, np.nan)


def _plain(row: FloatArray) -> list[float | None]:
    return [float(value) if np.isfinite(value) else None for value in row]


def _ending_words(state: int, reason: int, ending: int) -> str:
    kinds = {core.NOT_STARTED: "not started", core.TIMED_OUT: "did not come to the end in time", core.DIVERGED: "lost"}
    first = kinds.get(ending, _controller.state_text(state))
    return first if ending == core.TIMED_OUT else f"{first}: {_controller.reason_text(reason)}"
