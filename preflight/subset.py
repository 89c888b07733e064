"""The probability of a rare event from far fewer samples than counting takes: subset simulation (Au and Beck 2001).

Level by level the samples that came nearest to the event are multiplied by Markov chains of adaptive conditional
sampling (Papaioannou et al. 2015), until a tenth of a level's are in it; the probability is the product of the levels'.
Groups of chains, nearly independent (one without a seed takes another's), tell how sure that is: by leaving out one at
a time (jackknife), not from the chains' correlation, which is known to be optimistic. No bound holds for an event that
no step of a level leads towards.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from flight import FloatArray, portable
from preflight.luck import Luck
from preflight.statistics import upper_bound

GROUPS = 10
SHARE = 0.1
"""Of a level that the next one starts from; Au and Beck's."""
_ACCEPTANCE = 0.44
"""Of the steps of a chain, towards which their size is adapted; Papaioannou's."""
_FIRST_STEP = 0.6
_RENEWED = 0.5
"""How often a step takes other noise, or other drop-outs."""
_MOST_LEVELS = 12
_CONFIDENCE = 0.975
"""Of each of two bounds, of which the lower is stated with 95 %: that of counting, and the jackknife's."""
_STUDENT = 2.262157162798205
"""Quantile of Student's t for that confidence, of as many degrees of freedom as there are groups but one."""
_FIRST_NUMBER = 1 << 40
"""Of the luck of chains: no flight of the first level has it."""


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """n samples: standard normal numbers, and luck."""

    number: NDArray[np.int64]
    """(n,) in the order in which they were first drawn, from 0 on; seeds of chains keep theirs."""
    normal: FloatArray
    """(n, d)."""
    luck: Luck

    @staticmethod
    def independent(normal: FloatArray) -> "Points":
        """The first of all."""
        number = np.arange(len(normal))
        return Points(number, normal, Luck.of(number))

    @staticmethod
    def joined(parts: "list[Points]") -> "Points":
        return Points(
            np.concatenate([p.number for p in parts]),
            np.concatenate([p.normal for p in parts]),
            Luck.joined([p.luck for p in parts]),
        )

    def __len__(self) -> int:
        return len(self.normal)

    def __getitem__(self, rows: NDArray[np.integer] | slice) -> "Points":
        return Points(self.number[rows], self.normal[rows], self.luck[rows])


Score = Callable[[Points], FloatArray]
"""(n,) of samples: below zero in the event, and the larger the farther from it."""


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """What the levels came to."""

    estimate: float
    """Of the event's probability; where it was not `reached`, of the last level's, which is larger."""
    upper: float
    """Upper bound of the event's, of confidence 95 %: no larger than what counting in the first level shows."""
    reached: bool
    """Whether the estimate is the event's own."""
    levels: int
    samples: int
    """That were drawn, in all."""
    count: int
    """Samples of the last level in the event."""
    points: Points
    """Of the last level."""
    score: FloatArray
    """Theirs."""
    cut_off: bool = False
    """Whether Ctrl-C ended it."""


@dataclass(slots=True)
class _State:
    """A level: samples and scores, the groups one after the other, and the shares of all levels until now."""

    points: Points
    score: FloatArray
    shares: list[FloatArray] = field(default_factory=list)
    samples: int = 0
    step: float = _FIRST_STEP


def run(
    score: Score,
    first: Points,
    first_score: FloatArray,
    *,
    seed: int,
    enough: float = 0.0,
    level: Callable[[int, float], None] = lambda done, probability: None,
) -> Found:
    """Descend from a first level of independent samples.

    Args:
        first: n of them, n a multiple of `GROUPS`; `first_score`, theirs.
        enough: stop as soon as the probability is shown to be at most this.
        level: told after each level how many there were, and the probability of the last.

    Raises:
        KeyboardInterrupt: of `score`, in no level but the first: afterwards the levels that were done are kept.
    """
    rng = np.random.Generator(np.random.Philox(key=np.array([seed, 0x5AB5E7], np.uint64)))
    state = _State(first, first_score, samples=len(first))
    counted = upper_bound(int(np.count_nonzero(first_score < 0.0)), len(first), _CONFIDENCE)
    while True:
        threshold = _next_threshold(state.score)
        within = _within(state.score, threshold)
        shares = [*state.shares, within.reshape(GROUPS, -1).mean(axis=1)]
        estimate, upper = bound(shares, len(first))
        upper = min(upper, counted)
        level(len(shares), estimate)
        if threshold <= 0.0 or upper <= enough or not within.any() or within.all() or len(shares) >= _MOST_LEVELS:
            return _found(state, estimate, upper, threshold <= 0.0, len(shares))
        try:
            state = _next_level(score, state, within, threshold, rng)
        except KeyboardInterrupt:
            return replace(_found(state, estimate, upper, False, len(shares)), cut_off=True)
        state.shares = shares


def _next_threshold(score: FloatArray) -> float:
    """The score that the nearest `SHARE` do not exceed; 0 if so many are in the event."""
    return max(float(np.sort(score)[int(SHARE * len(score)) - 1]), 0.0)


def _within(score: FloatArray, threshold: float) -> NDArray[np.bool_]:
    return score < 0.0 if threshold <= 0.0 else score <= threshold


def _found(state: _State, estimate: float, upper: float, reached: bool, levels: int) -> Found:
    inside = int(np.count_nonzero(state.score < 0.0))
    return Found(estimate, upper, reached, levels, state.samples, inside, state.points, state.score)


def bound(shares: list[FloatArray], samples: int) -> tuple[float, float]:
    """Product of the levels' shares, and its upper bound.

    Args:
        shares: of each level, (`GROUPS`,) by group.
        samples: of a level.
    """
    table = np.array(shares)  # (levels, groups)
    mean = np.maximum(table.mean(axis=1), 1.0 / samples)
    left_out = (table.sum(axis=1, keepdims=True) - table) / (GROUPS - 1)
    logs = portable.logarithm(np.maximum(left_out, 0.5 / samples)).sum(axis=0)
    variance = (GROUPS - 1) / GROUPS * float(((logs - logs.mean()) ** 2).sum())
    independent = float(((1.0 - mean) / (mean * samples)).sum())  # of as many samples without any correlation
    width = _STUDENT * np.sqrt(max(variance, independent))
    return float(np.prod(table.mean(axis=1))), min(1.0, float(np.prod(mean) * portable.exponential(width)))


def _next_level(
    score: Score, state: _State, within: NDArray[np.bool_], threshold: float, rng: np.random.Generator
) -> _State:
    """As many samples as before below the threshold: seeds, and what chains from them come to."""
    size = len(within) // GROUPS
    seeds, groups, lengths = _seeds(within, size, rng)
    here, at = state.points[seeds], state.score[seeds]
    parts, scores, belongs, step = [here], [at], [groups], state.step
    drawn = state.samples
    for i in range(1, int(lengths.max())):
        moving = np.flatnonzero(lengths > i)
        proposed = _proposed(here[moving], step, drawn, rng)
        drawn += len(moving)
        reached = score(proposed)
        taken = _within(reached, threshold)
        keep = np.ones(len(here), bool)
        keep[moving[taken]] = False
        order = np.arange(len(here))
        order[moving[taken]] = len(here) + np.flatnonzero(taken)
        here = Points.joined([here, proposed])[order]
        at = np.where(keep, at, 0.0)
        at[moving[taken]] = reached[taken]
        parts.append(here[moving])
        scores.append(at[moving])
        belongs.append(groups[moving])
        step *= float(portable.exponential((taken.mean() - _ACCEPTANCE) / np.sqrt(i)))
        step = min(max(step, 0.05), 1.0)
    by_group = np.argsort(np.concatenate(belongs), kind="stable")
    points, values = Points.joined(parts)[by_group], np.concatenate(scores)[by_group]
    return _State(points, values, samples=drawn, step=step)


def _seeds(
    within: NDArray[np.bool_], size: int, rng: np.random.Generator
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Indices of seeds in random order, the group of each, and the length of its chain: of every group `size` in all.

    A group without any starts from one of the others'.
    """
    rows, groups, lengths = [], [], []
    for group in range(GROUPS):
        own = group * size + np.flatnonzero(within[group * size : (group + 1) * size])
        own = rng.permutation(own if own.size else rng.choice(np.flatnonzero(within), 1))
        rows.append(own)
        groups.append(np.full(len(own), group))
        lengths.append(size // len(own) + (np.arange(len(own)) < size % len(own)))
    return np.concatenate(rows), np.concatenate(groups), np.concatenate(lengths)


def _proposed(here: Points, step: float, first: int, rng: np.random.Generator) -> Points:
    """A conditional sample of each: the normal distribution is kept whatever the step's size.

    One size for all columns: steps as small as the seeds' spread do not leave a number that decides alone.
    """
    normal = np.sqrt(1.0 - step * step) * here.normal + step * rng.standard_normal(here.normal.shape)
    renewed = rng.random((len(here), 2)) < _RENEWED
    number = first + np.arange(len(here))
    return Points(number, normal, here.luck.moved(_FIRST_NUMBER + number, step, renewed))
