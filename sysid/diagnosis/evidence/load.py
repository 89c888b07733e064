"""A load carried on some flights only: which they are, told by what each weighs beside the others.

With the states eliminated every block of the evidence belongs to one flight, so the payload's column can be asked of
each flight by itself. A load makes two groups of flights; thrust that sinks from flight to flight does not.
"""

import logging
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flight import FlightLog
from flight.rotations import FloatArray
from sysid.diagnosis.evidence.evidence import Blocks, Evidence
from sysid.diagnosis.evidence.score import Score, score
from sysid.diagnosis.thresholds import THRESHOLDS
from sysid.estimator.flights.flight_data import Flight, IndexArray
from sysid.logs.checks.payload import PAYLOAD_CARRIED

logger = logging.getLogger(__name__)

COLUMNS = tuple(f"payload.{name}" for name in ("added_kg", "x_m", "y_m", "z_m"))
THRUST = "thrust_bem.k1_n_s2", "thrust_quadratic.k_n_s2"
"""Of the base parameters, the one that makes all thrust, and with it all torque, larger or smaller."""


@dataclass(frozen=True, slots=True)
class Load:
    """Which logs carry a load, as far as the evidence tells."""

    carriers: frozenset[int]
    """Indices of the logs, by `Flight.log_index`."""
    score: Score
    """Of the load on these flights, the choice among all sets of flights paid for."""
    doubt: str
    """Why what shows is no load; empty if it may be one, or nothing shows."""

    def marked(self, flights: Iterable[Flight]) -> tuple[Flight, ...]:
        """The flights with what they carry."""
        return tuple(replace(f, carries_payload=f.log_index in self.carriers) for f in flights)


def find(evidence: Evidence, flights: Sequence[Flight]) -> Load:
    """Weigh each log, all else free, and part them where the gap is widest; weight that all share hardly shows.

    The evidence's payload is masked on the flights that do not carry it.
    """
    log_of_block = np.array([f.log_index for f in flights])[evidence.flight_of_block]
    logs = np.unique(log_of_block)
    given, places = evidence.base, evidence.place(COLUMNS)
    apart = _apart(evidence.named, given, places, [log_of_block == log for log in logs])
    weighed = score(apart, given, len(given) + np.arange(len(places) * len(logs))).first(len(logs))
    added = weighed.size - weighed.size.min()
    order = np.argsort(added)
    cut = int(np.argmax(np.diff(added[order]))) + 1
    carriers = frozenset(int(logs[i]) for i in order[cut:])
    loaded = np.isin(log_of_block, list(carriers))
    evidence.mask(COLUMNS, ~loaded)
    found = score(evidence.named, given, places).first(1)
    chance = min(1.0, (2 ** len(logs) - 2) * found.significance)  # of so many sets the likeliest was chosen
    doubt = ""
    if chance < THRESHOLDS.load_chance:
        uneven = _not_two_groups(added, order, cut, _between(weighed.covariance))
        doubt = uneven or _thrust_instead(evidence, loaded, found)
    if doubt:
        nothing = replace(found, gain_unseen=0.0, unseen_by_block=0.0 * found.unseen_by_block)
        return Load(carriers, replace(nothing, significance=1.0), doubt)
    return Load(carriers, replace(found, significance=chance), "")


def _apart(blocks: Blocks, given: IndexArray, places: IndexArray, where: Sequence[NDArray[np.bool_]]) -> Blocks:
    """The given columns, and each of some others once per set of blocks: itself there, nothing elsewhere."""
    repeated = blocks.only(np.concatenate([given, np.repeat(places, len(where))]))
    for i, here in enumerate(where):
        repeated = repeated.masked(np.arange(len(given) + i, repeated.score.shape[1], len(where)), ~here)
    return repeated


def _not_two_groups(added: FloatArray, order: IndexArray, cut: int, sigma: float) -> str:
    light, heavy = added[order[:cut]], added[order[cut:]]
    most = THRESHOLDS.load_spread * (heavy[0] - light[-1]) + THRESHOLDS.load_spread_sigmas * sigma
    if max(np.ptp(light), np.ptp(heavy)) <= most:
        return ""
    grams = ", ".join(f"{1000.0 * kg:.0f}" for kg in added)
    return f"the flights differ in weight or thrust by {grams} g, but not in two groups, with and without a load"


def _between(covariance: FloatArray) -> float:
    """Usual standard error of the difference between two sizes."""
    own = np.diag(covariance)
    pairs = np.triu_indices(len(own), 1)
    return float(np.sqrt(max(0.0, np.median((own[:, None] + own - 2.0 * covariance)[pairs]))))


def _thrust_instead(evidence: Evidence, loaded: NDArray[np.bool_], load: Score) -> str:
    thrust = [name for name in THRUST if name in evidence.names[: len(evidence.base)]]
    if not thrust:
        return ""
    apart = _apart(evidence.named, evidence.base, evidence.place(thrust), [loaded])
    weaker = score(apart, evidence.base, np.array([len(evidence.base)], dtype=np.intp))
    logger.info("load %.1f, weaker thrust instead %.1f", load.log_odds, weaker.log_odds)
    if weaker.log_odds - load.log_odds < THRESHOLDS.clear_lead:
        return ""
    return "some flights have less thrust, and with it less torque, which explains more than a load: see the propellers"


def marked(logs: Sequence[FlightLog], flights: Iterable[Flight]) -> list[FlightLog]:
    """Logs that say of themselves what their flights were found to carry."""
    said = {f.log_index: f.carries_payload for f in flights if f.carries_payload is not None}
    return [
        FlightLog(log.columns, {**log.metadata, PAYLOAD_CARRIED: said[i]}) if i in said else log
        for i, log in enumerate(logs)
    ]
