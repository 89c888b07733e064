"""How much of a residual each variable explains: smooth curves, judged on stretches of flight that were left out."""

from collections.abc import Sequence

import numpy as np

from flight.rotations import FloatArray
from sysid.comparison import SPAN_S, Residual, means_over
from sysid.diagnosis.free_form import VARIABLES, Variable, curves_of
from sysid.flight_data import IndexArray

BLOCK_S = 3.0
"""Stretches of this length are left out together."""
FOLDS = 8


def shares(residuals: Sequence[Residual]) -> tuple[tuple[str, ...], FloatArray]:
    """Variables, and (6, v) the share of each channel's mean square that a curve of the variable predicts unseen.

    Zero where a curve predicts nothing; a share of noise is never explained, so even a whole truth stays below one.
    """
    left = np.concatenate([r.means() for r in residuals])
    fold = _folds(residuals)
    names, columns = [], []
    for variable in VARIABLES:
        values = read(residuals, variable)
        family = curves_of(variable, values)
        if family is not None:
            names.append(variable.name)
            columns.append(_unseen(family.basis(values), left, fold))
    return tuple(names), np.stack(columns, axis=1)


def read(residuals: Sequence[Residual], variable: Variable) -> FloatArray:
    """(m,) the variable at each mean of `Residual.means`, flights one after the other."""
    parts = [means_over(variable.read(r.flight, r.mid)[:, None], r.time_s, SPAN_S)[:, 0] for r in residuals]
    return np.concatenate(parts)


def _folds(residuals: Sequence[Residual]) -> IndexArray:
    blocks, begin = [], 0
    for r in residuals:
        block = begin + (np.arange(len(r.means())) * SPAN_S / BLOCK_S).astype(np.intp)
        begin = int(block[-1]) + 1
        blocks.append(block)
    return np.concatenate(blocks) % FOLDS


def _unseen(basis: FloatArray, left: FloatArray, fold: IndexArray) -> FloatArray:
    """(6,) one less the squared error of predictions by the other folds, over the square itself."""
    wrong = np.zeros(left.shape[1])
    for k in np.unique(fold):
        own = fold == k
        size = np.linalg.lstsq(basis[~own], left[~own], rcond=1e-6)[0]
        wrong += ((left[own] - basis[own] @ size) ** 2).sum(axis=0)
    return np.maximum(0.0, 1.0 - wrong / np.maximum((left**2).sum(axis=0), 1e-300))
