"""From few knots to the fastest of several paths of the whole vehicle: other starts, other uses of the heading."""

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from flight import FloatArray, Progress, portable, silent
from planner._planner import StopFlag
from planner.curve import heading, minimum_snap
from planner.curve.minimum_snap import Spline
from planner.gate.gate import AskGate
from planner.optimise import descents, fastest
from planner.optimise.fastest import Path
from planner.optimise.time_allocation import Problem, Solution, Weights
from planner.request import conditions
from planner.request.inputs import Request
from planner.request.options import PlanInfeasibleError

_SHORTEST_S = 0.2
"""Segments are not cut into shorter pieces: the vehicle could make nothing of them."""
_SMOOTHING_S = 0.5
"""Turns of the heading are smoothed out over this time to begin with."""
_LOWER = 0.997
"""Share of a route's cost, after the first descent, below which a higher one is gone on with instead. In offices that
picks out what ends 6.2, 2.9 and .6 % earlier; nearer ones end up to .4 % later."""
_YAW_PRICES = {
    "along_path": (0.4, 1e-4),
    "look_at": (5.0, 1e-4),
    "smooth": (0.0, 0.01),
    "steady": (0.0, 0.0),
    "fixed": (0.0, 0.0),
    "free": (0.0, 1e-5),
}
"""Price of not looking where one should, and of turning, for each yaw mode."""


@dataclass(frozen=True, slots=True, eq=False)
class _Begun:
    """A problem of the whole vehicle and what its descent begins with."""

    problem: Problem
    spline: Spline
    waypoint: np.ndarray
    """(k + 1,) which waypoint each knot is, -1 for none."""
    first: Solution | None
    """`descents.least_snap` from there, where it is known."""


@dataclass(frozen=True, slots=True, eq=False)
class Attempts:
    """What all attempts have in common: the problem with few knots that all begin with, what is asked, and the gate."""

    waypoint: np.ndarray
    """(k + 1,) which waypoint each of the few knots is, -1 for none."""
    request: Request
    ask_gate: AskGate
    rough: Problem
    """Its field is what the optimiser keeps away from; paths must keep clear in the request's."""
    start: Solution
    """Where it ended with few knots (`methods.rough`)."""
    higher: Solution | None
    """The same from a higher route, if there is one with more room."""
    clearance_price: float
    """As `Weights.clearance`."""
    progress: Progress

    def best(self) -> Path | None:
        """The fastest path that passes the gate, or the last one that does not; None if all stay too close.

        A free heading is not only tried for itself, but also from the answers with one that is bound, so that it never
        costs time.
        """
        options, yaw_rad = self.request.options, self.request.waypoints.yaw_rad
        found = self._from_starts(self.request)
        if options.yaw != "free":
            return found
        given = int(np.isfinite(yaw_rad).sum())
        for mode in ("along_path", "steady") if given < 2 else ("along_path",):
            bound = self._from_starts(replace(self.request, options=replace(options, yaw=mode)))
            if bound is None or not bound.report.passed:
                continue
            found = bound if found is None or not found.report.passed else fastest.faster(found, bound)
        if found is None or found.kept is None:
            return found
        freed = self._freed(found)
        return found if freed is None else fastest.faster(found, freed)

    def _from_starts(self, request: Request) -> Path | None:
        """The fastest path from as many starts of the descent as are asked for, the first of equals."""
        begun = self._begun(request)
        if request.options.starts == 1:
            return self._from_start(0, begun, request)
        stop = StopFlag() if request.stop is None else request.stop
        request = replace(request, stop=stop)

        def attempt(number: int) -> Path | PlanInfeasibleError | None:
            try:
                return self._from_start(number, begun, request)
            except PlanInfeasibleError as error:
                return error

        with ThreadPoolExecutor(os.cpu_count()) as pool:
            try:
                return _fastest(list(pool.map(attempt, range(request.options.starts))))
            except KeyboardInterrupt:
                stop.set()  # or those that work would be waited for
                raise

    def _begun(self, request: Request) -> _Begun:
        """What a descent begins with: the higher route, where it then comes to a lower cost."""
        given = self.waypoint, request, self.clearance_price
        here = whole_vehicle(self.rough, self.start, *given)
        if self.higher is None:
            return _Begun(*here, None)
        there = whole_vehicle(self.rough, self.higher, *given)
        low, high = (descents.least_snap(problem, spline, request.stop) for problem, spline, _ in (here, there))
        return _Begun(*there, high) if high.cost < _LOWER * low.cost else _Begun(*here, low)

    def _from_start(self, number: int, begun: _Begun, request: Request) -> Path | None:
        """The path from one start of the descent: the first on its way that comes through the gate."""
        path, index, progress = None, begun.waypoint, self.progress if number == 0 else silent
        clearance_m = request.options.clearance_m
        for there in descents.starts(begun.problem, begun.spline, clearance_m, request.stop, number, begun.first):
            problem = replace(begun.problem, knots=there.knots)
            found = fastest.until_flyable(problem, there.spline, index, request, self.ask_gate, progress=progress)
            path = path if found is None else found
            if path is not None and path.report.passed:
                break
        return path

    def _freed(self, bound: Path) -> Path | None:
        assert bound.kept is not None
        problem = with_free_heading(bound.kept.problem, bound.waypoint, self.request.waypoints.yaw_rad)
        corrections = bound.kept.corrections.unpressed()
        freed = fastest.until_flyable(
            problem,
            bound.kept.spline,
            bound.waypoint,
            self.request,
            self.ask_gate,
            corrections=corrections,
            progress=self.progress,
        )
        return freed and replace(freed, optimum=replace(freed.optimum, spread=bound.optimum.spread))


def _fastest(found: Sequence[Path | PlanInfeasibleError | None]) -> Path | None:
    """The fastest path that passes the gate, with the spread of all that do; else the first one.

    Raises:
        PlanInfeasibleError: as the first start, where none led to a path.
    """
    paths = [path for path in found if isinstance(path, Path)]
    passed = [path for path in paths if path.report.passed]
    if not paths and isinstance(found[0], PlanInfeasibleError):
        raise found[0]
    if not passed:
        return paths[0] if paths else None
    best = min(passed, key=lambda path: path.trajectory.duration_s)
    longest_s = max(path.trajectory.duration_s for path in passed)
    return replace(best, optimum=replace(best.optimum, spread=longest_s / best.trajectory.duration_s - 1.0))


def whole_vehicle(
    problem: Problem, start: Solution, waypoint: np.ndarray, request: Request, clearance_price: float
) -> tuple[Problem, Spline, np.ndarray]:
    """The problem with more knots, the heading and hardly any price on snap; a path to begin with; which waypoint each
    knot is.

    Args:
        clearance_price: as `Weights.clearance`.
    """
    options, waypoints = request.options, request.waypoints
    knots, durations, waypoint = _split(start.spline, waypoint, options.pieces)
    asked = np.where(waypoint >= 0, waypoints.yaw_rad[waypoint], np.nan)
    at_knots = request.conditions.at_knots(waypoints.positions_world_m, waypoint, request.limits)
    problem = replace(problem, **at_knots)
    first = Spline(durations, problem.spline(knots, durations).states[..., :3])
    held = heading.constant(first, asked, options)
    if held is None:
        looking = options.yaw in ("along_path", "look_at")
        target = options.target_world_m
        turned = heading.solve(first, asked, smoothing_s=_SMOOTHING_S, along_path=looking, target_world_m=target)
        knots[:, 3] = turned[:, 0]
    else:
        knots[:, 3] = held
    free = np.repeat(((waypoint < 0) | conditions.may_move(at_knots, len(knots)))[:, None], 4, axis=1)
    free[:, 3] = np.isnan(asked) & (held is None)
    price, turning = _YAW_PRICES[options.yaw]
    weights = Weights(snap=2e-7, limits=400.0, clearance=clearance_price, heading=price, turning=turning)
    problem = replace(problem, knots=knots, free=free, weights=weights, heading_held=held is not None)
    return problem, problem.spline(knots, durations), waypoint


def with_free_heading(problem: Problem, waypoint: np.ndarray, asked_rad: FloatArray) -> Problem:
    """The same problem with the heading free, but at waypoints that ask for one (NaN: they do not)."""
    free = problem.free.copy()
    free[:, 3] = (waypoint < 0) | np.isnan(asked_rad[waypoint])
    price, turning = _YAW_PRICES["free"]
    weights = replace(problem.weights, heading=price, turning=turning)
    return replace(problem, free=free, weights=weights, heading_held=False)


def _split(spline: Spline, waypoint: np.ndarray, most: int) -> tuple[FloatArray, FloatArray, np.ndarray]:
    """Segments cut into equal times, `most` pieces at most: knots, durations, and which waypoint each knot is."""
    T = spline.durations_s
    pieces = np.clip(np.floor(T / _SHORTEST_S), 1, most).astype(int)
    of = np.repeat(np.arange(len(T)), pieces)
    number = np.arange(len(of)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    scaled = minimum_snap.segment_states(spline.states) * minimum_snap.time_powers(T)[..., None]
    rows = portable.product(minimum_snap.basis(number / pieces[of], 0), minimum_snap.monomials_from_states())
    knots = np.concatenate([np.einsum("na,nax->nx", rows, scaled[of]), spline.states[-1:, 0]])
    index = np.append(np.where(number == 0, waypoint[of], -1), waypoint[-1])
    knots[np.append(number == 0, True)] = spline.states[:, 0]
    return knots, (T / pieces)[of], index
