"""A part of a path optimised for itself: the rest stays as it is, and the joins keep their state through jerk."""

import numpy as np

from planner import minimum_snap, time_allocation
from planner._planner import StopFlag
from planner.minimum_snap import Spline
from planner.time_allocation import Problem


def grown(segments: np.ndarray, reach: int) -> np.ndarray:
    """(k,) bool: the segments and their neighbours up to `reach` away."""
    around = np.ones(2 * reach + 1)
    return np.convolve(segments.astype(float), around)[reach : reach + len(segments)] > 0.5


def runs(segments: np.ndarray) -> list[tuple[int, int]]:
    """First and last knot of each run of chosen segments (k,) bool."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], segments, [False]]).astype(int)))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


def optimise(
    problem: Problem, spline: Spline, segments: np.ndarray, *, iterations: int, stop: StopFlag | None
) -> Spline:
    """Each run of the chosen segments (k,) optimised for itself, the knots on either side of it held.

    Raises:
        PlanCancelledError: `stop` was set.
    """
    durations, states = spline.durations_s.copy(), spline.states.copy()
    for first, last in runs(segments):
        part = problem.part(first, last, spline)
        found = time_allocation.optimise(part, durations[first:last], iterations=iterations, stop=stop)
        durations[first:last] = found.durations_s
        states[first : last + 1] = found.spline.states
    return minimum_snap.Spline(durations, states)
