"""The descents of the optimiser through the whole state of every knot, gently to begin with.

Their iterations are compiled: `planner/src/refine.cpp` and `newton.hpp`. A part of a path can be optimised for itself:
the rest stays as it is, and the joins keep their state through jerk.

At low prices on exceeded limits the way to the fastest path is less steep, and starts that differ end in the same path:
of 24 walks in the open, from eight starts each, all end within 0.3 % of the best. Among obstacles the best path of
least snap comes first.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

import esdf
from planner._planner import StopFlag
from planner.curve import minimum_snap
from planner.curve.minimum_snap import Spline
from planner.optimise import time_allocation
from planner.optimise.time_allocation import Problem, Solution

_FIRST, _NEW, _MOST = 350, 200, 250
"""Iterations of the descent among paths of least snap, of that from new knots of an edited path, and the most of each
descent through whole states, which commonly ends before. With 150 at first, a flight through a maze took 1.2 % more
than the best of eight starts, with 300 and more .3 %."""
_COARSE = 8
"""Samples per segment in the first of them, which is then a third cheaper; the others see to what lies between."""
_OPEN, _AMONG = (1.0, 8.0, 60.0), (1.0, 20.0, 100.0)
"""Prices on exceeded limits, before the full one, with which a descent begins, in open space and among obstacles. At
the full price alone the path stays where the limits meet it first: in the open it ends 17 % later."""
_OTHERS = (10.0, 60.0), (8.0, 60.0), (0.1, 1.0, 8.0, 60.0)
_SLOWER = 1.4
"""Prices with which other starts begin; the second half of them also from times so much longer."""
_SHORT = 60
"""Segments up to which an open path descends in two more ways, by the first two of these prices, the second from slower
times, and the fastest is kept. Of 120 walks one took .5 % more than the best of eight starts with one way, .3 % with
two and .2 % with three; over longer paths such differences even out."""
_PRECISION, _KINKED, _LOWEST, _GENTLE, _STEEP = 1e-5, 1e-4, 1e-5, 1e-4, 5e-4
"""Share of the cost that four steps together gain where a descent ends: the one before the vehicle's own model is
asked, in the open and among obstacles, whose distance has kinks; those that lead to it in the open, at the lowest price
and the others; and those among obstacles. Among them 1e-5 takes twice the steps, for flights .02 % longer in 50 scenes;
while whole paths are corrected, `_STEEP` takes 21 % fewer, for flights .03 % shorter in 50 others.
What path it becomes is settled at the lowest price: ended there at 1e-4, one of 120 walks took .95 % more than the best
of eight starts, and .5 % at 1e-5, for 13 % more work; a walk of 50 waypoints took 46 % more."""
_HOLD = 0.05
"""Price, in s/m^2, of leaving the path that the vehicle's own model was asked along last: many paths take nearly the
same time, and what was measured holds for one of them. Without it a path near free fall took 40 rounds, with it 14."""
_SOUND = 1.5
"""Cost over flight time above which a path is not one to go on from: it is flown upside down, say."""


@dataclass(frozen=True, slots=True, eq=False)
class Descended:
    """A path after a descent in some of its segments."""

    spline: Spline
    converged: bool
    """Whether every part of it did."""
    residual: float
    """The largest share of the cost that the descents would still gain."""


def least_snap(problem: Problem, spline: Spline, stop: StopFlag | None) -> Solution:
    """Where the descent among paths of least snap ends, from the durations of a spline."""
    return time_allocation.optimise(problem, spline.durations_s, iterations=_FIRST, samples=_COARSE, stop=stop)


def starts(
    problem: Problem,
    spline: Spline,
    clearance_m: float,
    stop: StopFlag | None,
    number: int = 0,
    first: Solution | None = None,
) -> Iterator[Solution]:
    """Paths to measure with the vehicle's own model, in the order to try them in; each is worked out when asked for.

    Args:
        spline: the durations to start from.
        clearance_m: what the gate will ask for; with twice as much the path is in the open.
        number: which start, from 0 to `options.MOST_STARTS` - 1; those above 0 differ in times and prices.
        first: `least_snap` of them, where that is known.

    Raises:
        PlanCancelledError: `stop` was set.
    """
    slow, way = divmod(number, 1 + len(_OTHERS))
    slower = problem.spline(problem.knots, _SLOWER * spline.durations_s)
    spline = slower if slow else spline
    apart, among = (_OTHERS[way - 1],) * 2 if way else (_OPEN, _AMONG)
    clear = in_the_open(problem, spline, clearance_m)
    if clear:
        ways = [(spline, apart)]
        if number == 0 and len(spline.durations_s) <= _SHORT:
            ways += zip((spline, slower), _OTHERS[:2], strict=True)
        found = min((_gently(problem, begin, prices, True, stop) for begin, prices in ways), key=_flight_s)
        if _sound(found):
            yield found
    first = least_snap(problem, spline, stop) if first is None or slow else first
    problem = replace(problem, knots=first.knots)
    if not clear and _sound(found := _gently(problem, first.spline, among, False, stop)):
        yield found
    yield first


def precision(in_open: bool) -> tuple[float, float]:
    """At which share of the cost descents end, of which the vehicle's own model is asked: of the whole path at first,
    and later ones."""
    return (_PRECISION, _PRECISION) if in_open else (_STEEP, _KINKED)


def in_the_open(problem: Problem, spline: Spline, clearance_m: float) -> bool:
    """Whether the path keeps twice the required clearance from everything."""
    return esdf.certify(problem.field, minimum_snap.trajectory(spline), 2.0 * clearance_m).passed


def _flight_s(found: Solution) -> float:
    return float(found.durations_s.sum())


def _sound(found: Solution) -> bool:
    return found.cost < _SOUND * _flight_s(found)


def _gently(
    problem: Problem, spline: Spline, prices: tuple[float, ...], clear: bool, stop: StopFlag | None
) -> Solution:
    """Where the descent comes to at rising prices on limits and clearance: the way from there is less steep."""
    full, precision = problem.weights, _LOWEST if clear else _STEEP
    for price in (*prices, full.limits):
        clearance = full.clearance * np.sqrt(price / full.limits)
        weights = replace(full, limits=price, clearance=float(clearance))
        part = replace(problem, knots=spline.states[:, 0], weights=weights)
        found = time_allocation.refine(part, spline, iterations=_MOST, precision=precision, stop=stop)
        spline, precision = found.spline, max(precision, _GENTLE)
    return found


def refined(
    problem: Problem, spline: Spline, touched: np.ndarray, precision: float, stop: StopFlag | None, *, near: bool
) -> Descended:
    """The path after a descent through the whole states of the knots between touched segments (k,), near the last."""
    hold = _HOLD if near else 0.0

    def descend(part: Problem, there: Spline) -> Solution:
        return time_allocation.refine(part, there, iterations=_MOST, precision=precision, hold=hold, stop=stop)

    return in_parts(problem, spline, touched, descend)


def redrawn(problem: Problem, spline: Spline, touched: np.ndarray, stop: StopFlag | None) -> Spline:
    """A path through touched segments (k,) of whose knots only the places are known: of least snap, then gently."""

    def descend(part: Problem, there: Spline) -> Solution:
        first = time_allocation.optimise(part, there.durations_s, iterations=_NEW, stop=stop)
        return _gently(replace(part, knots=first.knots), first.spline, _AMONG, False, stop)

    return in_parts(problem, spline, touched, descend).spline


def in_parts(
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


def grown(segments: np.ndarray, reach: int) -> np.ndarray:
    """(k,) bool: the segments and their neighbours up to `reach` away."""
    around = np.ones(2 * reach + 1)
    return np.convolve(segments.astype(float), around)[reach : reach + len(segments)] > 0.5


def runs(segments: np.ndarray) -> list[tuple[int, int]]:
    """First and last knot of each run of chosen segments (k,) bool."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], segments, [False]]).astype(int)))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]
