"""What comes anew in every flight, by number: noise, drop-outs, and gusts as a weighted sum of several numbers'."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flight import FloatArray

_KEPT = 2
"""Columns of numbers before those of the gusts: of the noise and of the drop-outs."""


@dataclass(frozen=True, slots=True, eq=False)
class Luck:
    """Of n flights."""

    numbers: NDArray[np.uint64]
    """(n, 2 + k): of the noise, of the drop-outs, and of each of k parts of the gusts."""
    weights: FloatArray
    """(n, k) of the gusts' parts; their squares add to one, so that the sum is as likely as each part."""

    @staticmethod
    def of(numbers: NDArray[np.integer]) -> "Luck":
        """Every flight its own (n,) number's."""
        column = numbers.astype(np.uint64)[:, None]
        return Luck(np.repeat(column, _KEPT + 1, axis=1), np.ones((len(column), 1)))

    @staticmethod
    def joined(parts: "list[Luck]") -> "Luck":
        most = max(part.weights.shape[1] for part in parts)
        wide = [part._wider(most) for part in parts]
        return Luck(np.concatenate([w.numbers for w in wide]), np.concatenate([w.weights for w in wide]))

    def __len__(self) -> int:
        return len(self.numbers)

    def __getitem__(self, rows: NDArray[np.integer] | slice) -> "Luck":
        return Luck(self.numbers[rows], self.weights[rows])

    def moved(self, numbers: NDArray[np.integer], step: float, renewed: NDArray[np.bool_]) -> "Luck":
        """A step to other luck that leaves the distribution as it is.

        Args:
            numbers: (n,) that no other flight has.
            step: 0 to 1, of the gusts: the new part's weight.
            renewed: (n, 2) whether noise and drop-outs become those of the new number.
        """
        new = numbers.astype(np.uint64)[:, None]
        kept = np.where(renewed, new, self.numbers[:, :_KEPT])
        weights = np.column_stack([self.weights * np.sqrt(1.0 - step * step), np.full(len(self), step)])
        return Luck(np.concatenate([kept, self.numbers[:, _KEPT:], new], axis=1), weights)._narrower()

    def _wider(self, parts: int) -> "Luck":
        lacking = ((0, 0), (0, parts - self.weights.shape[1]))
        return Luck(np.pad(self.numbers, lacking), np.pad(self.weights, lacking))

    def _narrower(self) -> "Luck":
        """Without columns of gusts that no flight has."""
        used = self.weights.any(axis=0)
        return Luck(self.numbers[:, np.concatenate([np.ones(_KEPT, bool), used])], self.weights[:, used])
