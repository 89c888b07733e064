"""Where overlap was lost: runs of instants without a place, and the verified matches between them and their neighbours.

A map grows by images that share enough verified matches with it. Those beyond a gap in the overlap find no place; they
may make another map among themselves, but the largest alone is kept (see `growth`).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mapping import connected
from mapping.input.images import ImageSet

_MANY = 100
"""Verified matches between two instants that overlap well: what a map is first tried to be started with."""
_LEAST_PIECE = 3
"""Instants of a piece; two alone are no map."""
_NAMED = 3
"""Runs that a sentence names."""


@dataclass(frozen=True, slots=True)
class UnplacedRun:
    """Consecutive instants that found no place, and how they overlap with the instants before and after."""

    first: str
    """Name of the first instant."""
    last: str
    """Name of the last one."""
    count: int
    """Instants."""
    before: str | None
    """The placed instant before the first; None if there is none."""
    after: str | None
    """The placed instant after the last; None if there is none."""
    matches_before: int
    """Verified matches between `before` and `first`, of all cameras; 0 if there is nothing before."""
    matches_after: int
    """The same between `last` and `after`."""
    pieces: list[list[str]]
    """First and last instant of each part of the run that overlaps well in itself, but with no placed instant."""

    @property
    def span(self) -> str:
        """The names of its instants."""
        return self.first if self.count == 1 else f"{self.first} to {self.last}"

    def __str__(self) -> str:
        borders = [
            f"{matches or 'none'} between {one} and {other}"
            for matches, one, other in (
                (self.matches_before, self.before, self.first),
                (self.matches_after, self.last, self.after),
            )
            if one is not None and other is not None
        ]
        pieces = [
            f"{'they' if (one, other) == (self.first, self.last) else f'{one} to {other}'} form a piece of their own"
            for one, other in self.pieces
        ]
        return f"{self.span} (verified matches: {', '.join(borders)}{'; ' if pieces else ''}{', '.join(pieces)})"


def of_instants(database: Path, images: ImageSet) -> np.ndarray:
    """(p, 3) int: two instants, the earlier first, and the number of verified matches between their images.

    Args:
        database: COLMAP's, with verified matches.
    """
    import pycolmap

    total: dict[tuple[int, int], int] = {}
    instant_of = {images.relative(i, c): i for i, c in images.pairs()}
    with pycolmap.Database.open(database) as opened:
        instants = {row.image_id: instant_of[row.name] for row in opened.read_all_images()}
        for pair_id, matches in zip(*opened.read_two_view_geometry_num_inliers(), strict=True):
            a, b = sorted(instants[k] for k in pycolmap.pair_id_to_image_pair(pair_id))
            if a != b:
                total[a, b] = total.get((a, b), 0) + matches
    return np.array([(a, b, n) for (a, b), n in sorted(total.items())], dtype=np.int64).reshape(-1, 3)


def unplaced_runs(names: Sequence[str], placed: np.ndarray, overlaps: np.ndarray) -> list[UnplacedRun]:
    """Every run of consecutive instants without a place, in order.

    Args:
        names: of all instants; placed: (instants,) bool; overlaps: as of `of_instants`.
    """
    matches = {(int(a), int(b)): int(n) for a, b, n in overlaps}
    pieces = _pieces(placed, overlaps)
    ends = np.flatnonzero(np.diff(np.concatenate([[True], placed, [True]]).astype(int)))
    found = []
    for start, stop in ends.reshape(-1, 2).tolist():
        own = [piece[(start <= piece) & (piece < stop)] for piece in pieces]
        found.append(
            UnplacedRun(
                first=names[start],
                last=names[stop - 1],
                count=stop - start,
                before=names[start - 1] if start > 0 else None,
                after=names[stop] if stop < len(names) else None,
                matches_before=matches.get((start - 1, start), 0),
                matches_after=matches.get((stop - 1, stop), 0),
                pieces=[[names[int(piece[0])], names[int(piece[-1])]] for piece in own if len(piece) >= _LEAST_PIECE],
            )
        )
    return found


def summary(runs: Sequence[UnplacedRun]) -> str:
    """The longest runs in one line, in order; empty without any."""
    longest = sorted(runs, key=lambda run: -run.count)[:_NAMED]
    more = [f"and {len(runs) - _NAMED} shorter"] if len(runs) > _NAMED else []
    return ", ".join([str(run) for run in runs if run in longest] + more)


def _pieces(placed: np.ndarray, overlaps: np.ndarray) -> list[np.ndarray]:
    """Instants of each set that overlaps well in itself and in which none is placed; single ones too."""
    first, second = overlaps[overlaps[:, 2] >= _MANY, :2].T
    label = connected.groups(first, second, len(placed))
    return [np.flatnonzero(label == k) for k in np.unique(label) if not placed[label == k].any()]
