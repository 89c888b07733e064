"""How much of a residual each variable explains: smooth curves, judged on flights that they were not drawn through."""

from collections.abc import Sequence

import numpy as np

from flight.rotations import FloatArray
from sysid.diagnosis.evidence.free_form import VARIABLES, Curve, Variable, curves_of
from sysid.estimator.flights.flight_data import IndexArray
from sysid.estimator.flights.sampling import means_over
from sysid.estimator.validation.comparison import SPAN_S, Residual

BLOCK_S = 3.0
"""Of a single flight, stretches of this length are left out together."""
FOLDS = 8
GRID = 25
"""Points along a variable's range at which curves are kept from bending."""
STIFFNESS = 1e-2
"""Weight of a curve's bends beside its data: it goes on straight beyond what was flown, and is free within."""


def shares(residuals: Sequence[Residual], unseen: Sequence[Residual] = ()) -> tuple[tuple[str, ...], FloatArray]:
    """Variables, and (6, v) the share of each channel's mean square that a curve of the variable predicts.

    Curves are drawn through `residuals` and judged on the `unseen` flights. Without any, each flight is judged by
    curves through the others; a flight alone by curves through its other stretches. Zero where a curve predicts
    nothing; a share of noise is never explained, so even a whole truth stays below one.
    """
    both = [*residuals, *unseen]
    left = np.concatenate([r.means() for r in both])
    fold = _folds(residuals, unseen)
    names, columns = [], []
    for variable in variables(both):
        values = read(both, variable)
        family = curves_of(variable, values)
        if family is not None:
            names.append(variable.name)
            columns.append(_unseen(family.basis(values), _bends(family), left, fold))
    return tuple(names), np.stack(columns, axis=1)


def variables(residuals: Sequence[Residual]) -> tuple[Variable, ...]:
    """Those that the flights' vehicle has."""
    rotors = residuals[0].flight.rotor_speed_rad_s.shape[1]
    return tuple(v for v in VARIABLES if v.rotor < rotors)


def judged_how(residuals: Sequence[Residual], unseen: Sequence[Residual] = ()) -> str:
    """On what `shares` judges its curves, in words."""
    if unseen:
        return f"on held-out flights ({', '.join(r.flight.name for r in unseen)}) that it was not drawn through"
    return f"on {'flights' if len(residuals) > 1 else 'stretches'} that it was not drawn through"


def read(residuals: Sequence[Residual], variable: Variable) -> FloatArray:
    """(m,) the variable at each mean of `Residual.means`, flights one after the other."""
    parts = [means_over(variable.read(r.flight, r.mid)[:, None], r.time_s, SPAN_S)[:, 0] for r in residuals]
    return np.concatenate(parts)


def _folds(residuals: Sequence[Residual], unseen: Sequence[Residual]) -> IndexArray:
    """Means with the same number are judged by all the others; -1 only teaches."""
    if len(residuals) == 1 and not unseen:
        count = len(residuals[0].means())
        return (np.arange(count) * SPAN_S / BLOCK_S).astype(np.intp) % FOLDS
    numbers = [-1] * len(residuals) + [0] * len(unseen) if unseen else range(len(residuals))
    return np.repeat(np.array(numbers, dtype=np.intp), [len(r.means()) for r in (*residuals, *unseen)])


def _bends(family: Curve) -> FloatArray:
    """(g, functions) second differences of each function along its range; of a straight line they vanish."""
    if family.functions < 3:
        return np.zeros((0, family.functions))
    along = np.linspace(family.knots[0], family.knots[-1], GRID)
    return (GRID / family.functions) ** 2 * np.diff(family.basis(along), 2, axis=0)


def _unseen(basis: FloatArray, bends: FloatArray, left: FloatArray, fold: IndexArray) -> FloatArray:
    """(6,) one less the squared error of predictions by the other folds, over the square itself."""
    wrong, square = np.zeros(left.shape[1]), np.zeros(left.shape[1])
    for k in np.unique(fold[fold >= 0]):
        own = fold == k
        stiff = np.sqrt(STIFFNESS * np.count_nonzero(~own) / GRID) * bends
        right = np.concatenate([left[~own], np.zeros((len(bends), left.shape[1]))])
        size = np.linalg.lstsq(np.concatenate([basis[~own], stiff]), right, rcond=1e-9)[0]
        wrong += ((left[own] - basis[own] @ size) ** 2).sum(axis=0)
        square += (left[own] ** 2).sum(axis=0)
    return np.maximum(0.0, 1.0 - wrong / np.maximum(square, 1e-300))
