"""One question at a time, asked of the evidence: how much would these columns explain, and can it be chance?"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flight.rotations import FloatArray
from sysid.diagnosis.evidence.evidence import Blocks
from sysid.estimator.flights.flight_data import IndexArray
from sysid.estimator.uncertainty.errors import NORMAL_90

FOLDS = 8
"""Blocks are dealt out to this many folds in turn for cross-validation."""


@dataclass(frozen=True, slots=True)
class Score:
    """What a set of columns would change, were it added to the model."""

    columns: IndexArray
    """Which columns of the blocks were tested."""
    size: FloatArray
    """(q,) one-step estimates."""
    covariance: FloatArray
    """(q, q) that allows for errors correlated within a block and for slightly wrong forms."""
    plain: FloatArray
    """(q,) variances that white noise alone would mean."""
    shown_by: FloatArray
    """(q,) how many blocks show each size in effect: its variance is known no better than from so many samples."""
    gain: float
    """Predicted fall of half the sum of squares on these flights."""
    gain_unseen: float
    """The same on blocks that were left out of the estimate (cross-validation): falls below zero for chance."""
    unseen_by_block: FloatArray
    """(b,) its parts."""
    significance: float
    """Probability that chance alone would explain as much."""
    dispersion: float
    """By how much the sizes vary more than white noise would make them: true over plain variance, at least one."""

    def first(self, count: int) -> "Score":
        """The same, but sizes of the first columns alone."""
        return replace(
            self,
            columns=self.columns[:count],
            size=self.size[:count],
            covariance=self.covariance[:count, :count],
            plain=self.plain[:count],
            shown_by=self.shown_by[:count],
        )

    @property
    def log_odds(self) -> float:
        """What unseen blocks say for these columns, gusts allowed for."""
        return self.gain_unseen / self.dispersion

    @property
    def sigma(self) -> FloatArray:
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))

    @property
    def half90(self) -> FloatArray:
        """(q,) half widths of the 90 % intervals: few blocks may scatter less than the noise alone makes them, by
        chance, and know their own scatter badly.

        Unlike those of a fit (`uncertainty.errors`) they do not see what is wrong for as long as a whole flight: where
        that is as large as a block's noise, "90 %" holds some 60 %.
        """
        from scipy.special import stdtrit

        of_blocks = stdtrit(self.shown_by, 0.95) * self.sigma
        return np.maximum(of_blocks, NORMAL_90 * np.sqrt(self.plain))


@dataclass(frozen=True, slots=True)
class Given:
    """What the columns that are in the model already explain by themselves."""

    columns: IndexArray
    gain: float
    """Fall of half the sum of squares."""
    unseen_by_block: FloatArray
    """(b,) the same on blocks left out of the estimate."""

    @classmethod
    def of(cls, blocks: Blocks, columns: IndexArray) -> "Given":
        part = blocks.only(columns)
        return cls(columns, _fall(part, _solve(part)), _cross_validated(part))


def score(
    blocks: Blocks, given: IndexArray | Given, tested: IndexArray, one_sided: NDArray[np.bool_] | None = None
) -> Score:
    """Test columns on top of others that are in the model already and stay free.

    Args:
        given: those others; with what they explain where many are tested on top of the same.
        one_sided: (q,) true where a size cannot be negative; such columns are dropped when they come out so.
    """
    alone = given if isinstance(given, Given) else Given.of(blocks, given)
    given = alone.columns
    kept = np.ones(len(tested), dtype=bool)
    wide = np.zeros((len(tested), len(tested)))
    white, shown_by = np.zeros(len(tested)), np.ones(len(tested))
    while True:
        columns = np.concatenate([given, tested[kept]])
        part = blocks.only(columns)
        step, covariance, inverse = _robust(part)
        size = step[len(given) :]
        wide[np.ix_(kept, kept)] = covariance[len(given) :, len(given) :]
        white[kept] = np.diag(inverse)[len(given) :]
        shown_by[kept] = _shown_by(part, inverse[:, len(given) :])
        wrong = np.zeros(kept.sum(), dtype=bool) if one_sided is None else one_sided[kept] & (size < 0.0)
        if not wrong.any():
            break
        kept[np.flatnonzero(kept)[wrong]] = False
        if not kept.any():
            nothing = np.zeros(len(tested))
            return Score(tested, nothing, wide, white, shown_by, 0.0, 0.0, np.zeros(len(blocks.score)), 1.0, 1.0)
    gain = _fall(part, step) - alone.gain
    unseen = _cross_validated(part) - alone.unseen_by_block
    q = int(kept.sum())
    covariance = covariance[len(given) :, len(given) :]
    wald = float(size @ _pseudo(covariance) @ size) / q
    freedom = max(len(blocks.score) - len(columns), 4)
    full = np.zeros(len(tested))
    full[kept] = size
    plain = inverse[len(given) :, len(given) :]
    dispersion = max(1.0, float(np.trace(_pseudo(plain) @ covariance)) / q)
    chance = _chance(q, freedom, wald)
    return Score(tested, full, wide, white, shown_by, gain, float(unseen.sum()), unseen, chance, dispersion)


def _robust(blocks: Blocks) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Gauss-Newton step, its sandwich covariance, each block's score freed of its own pull (CR3 jackknife), and the
    covariance that white noise alone would mean."""
    information = blocks.information.sum(axis=0)
    inverse = inverse_of(information)
    step = -inverse @ blocks.score.sum(axis=0)
    left = blocks.score + blocks.information @ step
    count, p = left.shape
    freed = np.linalg.solve(np.eye(p) - blocks.information @ inverse + 1e-9 * np.eye(p), left[:, :, None])[:, :, 0]
    return step, inverse @ (freed.T @ freed) @ inverse * ((count - 1) / count), inverse


def _shown_by(blocks: Blocks, columns: FloatArray) -> FloatArray:
    """(q,) how many blocks each variance rests on in effect (Satterthwaite), one at least.

    Args:
        columns: (p, q) of the inverse of the information.
    """
    shares = np.einsum("pq,bpq->bq", columns, blocks.information @ columns)
    return np.maximum(shares.sum(axis=0) ** 2 / np.maximum(np.square(shares).sum(axis=0), 1e-300), 1.0)


def inverse_of(information: FloatArray) -> FloatArray:
    """Inverse of an information matrix with rows of any size; directions without information are left out."""
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    inverse = np.where(values > 1e-9, 1.0 / np.maximum(values, 1e-9), 0.0)
    return (vectors * inverse) @ vectors.T / np.outer(scale, scale)


def _pseudo(covariance: FloatArray) -> FloatArray:
    """Pseudo-inverse of a covariance with rows of any size."""
    std = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    return np.linalg.pinv(covariance / np.outer(std, std), hermitian=True) / np.outer(std, std)


@dataclass(frozen=True, slots=True)
class Loss:
    """What would be lost if parts of the model were taken out again."""

    gain: float
    """Rise of half the sum of squares."""
    significance: float
    """Probability that chance alone would make them as needed."""


def loss_without(blocks: Blocks, kept: IndexArray, dropped: IndexArray, values: FloatArray) -> Loss:
    """Set parameters that stand at `values` to zero, all the others in `kept` at their best before and after."""
    part = blocks.only(np.concatenate([kept, dropped]))
    step, covariance, _ = _robust(part)
    q = len(dropped)
    rest = blocks.only(kept)
    cross = part.information[:, :-q, -q:]
    forced = Blocks(rest.score - np.einsum("bij,j->bi", cross, values), rest.information)
    without = np.concatenate([_solve(forced), -values])
    size, wide = values + step[-q:], covariance[-q:, -q:]
    wald = float(size @ _pseudo(wide) @ size) / q
    freedom = max(len(blocks.score) - part.score.shape[1], 4)
    return Loss(_fall(part, step) - _fall(part, without), _chance(q, freedom, wald))


def _chance(q: int, freedom: int, wald: float) -> float:
    """Probability that a Wald statistic of `q` parameters comes out so large by chance."""
    from scipy.special import fdtrc

    return float(fdtrc(q, freedom, max(wald, 0.0)))


def _solve(blocks: Blocks) -> FloatArray:
    return -inverse_of(blocks.information.sum(axis=0)) @ blocks.score.sum(axis=0)


def _fall(blocks: Blocks, step: FloatArray) -> float:
    """How much the cost falls by a step, over all blocks."""
    return float(fall_by_block(blocks, step).sum())


def fall_by_block(blocks: Blocks, step: FloatArray) -> FloatArray:
    """(b,) how much each block's cost falls by a step."""
    return -(blocks.score @ step) - 0.5 * np.einsum("i,bij,j->b", step, blocks.information, step)


def _cross_validated(blocks: Blocks) -> FloatArray:
    """(b,) fall of each block's cost by the step that the other folds call for."""
    fold = np.arange(len(blocks.score)) % FOLDS
    score, information = blocks.score.sum(axis=0), blocks.information.sum(axis=0)
    fall = np.zeros(len(blocks.score))
    for k in np.unique(fold):
        own = fold == k
        out = inverse_of(information - blocks.information[own].sum(axis=0)) @ (score - blocks.score[own].sum(axis=0))
        fall[own] = fall_by_block(Blocks(blocks.score[own], blocks.information[own]), -out)
    return fall
