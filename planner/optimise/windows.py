"""A part of a path optimised for itself: the rest stays as it is, and the joins keep their state through jerk."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from planner.curve.minimum_snap import Spline
from planner.optimise.time_allocation import Problem, Solution


def grown(segments: np.ndarray, reach: int) -> np.ndarray:
    """(k,) bool: the segments and their neighbours up to `reach` away."""
    around = np.ones(2 * reach + 1)
    return np.convolve(segments.astype(float), around)[reach : reach + len(segments)] > 0.5


def runs(segments: np.ndarray) -> list[tuple[int, int]]:
    """First and last knot of each run of chosen segments (k,) bool."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], segments, [False]]).astype(int)))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


@dataclass(frozen=True, slots=True, eq=False)
class Descended:
    """A path after a descent in some of its segments."""

    spline: Spline
    converged: bool
    """Whether every part of it did."""
    residual: float
    """The largest share of the cost that the descents would still gain."""


def optimise(
    problem: Problem, spline: Spline, segments: np.ndarray, descend: Callable[[Problem, Spline], Solution]
) -> Descended:
    """Each run of the chosen segments (k,) optimised for itself, the knots on either side of it held.

    Args:
        descend: from a problem and the spline to start from to where its descent ends.
    """
    if segments.all():
        found = descend(problem, spline)
        return Descended(found.spline, found.converged, found.residual)
    durations, states, converged, residual = spline.durations_s.copy(), spline.states.copy(), True, 0.0
    for first, last in runs(segments):
        before = Spline(durations[first:last], states[first : last + 1])
        found = descend(problem.part(first, last, Spline(durations, states)), before)
        durations[first:last] = found.durations_s
        states[first : last + 1] = found.spline.states
        converged, residual = converged and found.converged, float(np.fmax(residual, found.residual))
    return Descended(Spline(durations, states), converged, residual)
