"""From a route to the fastest of several optimised paths: other starts of the descent, other uses of the heading."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from flight import Progress, Trajectory, Waypoints, silent
from planner import descents, fastest, limits, routes, space
from planner._planner import StopFlag
from planner.conditions import Conditions
from planner.corrections import Corrections
from planner.fastest import Path
from planner.gate import GateReport
from planner.minimum_snap import Spline
from planner.options import PlanOptions
from planner.time_allocation import Problem
from vehicle import Vehicle

AskGate = Callable[[Trajectory, limits.Known], GateReport]


class Attempts:
    """What all attempts have in common: the route, what is asked for, and the gate."""

    def __init__(
        self,
        route: routes.Route,
        obstacles: space.DistanceField,
        waypoints: Waypoints,
        field: space.DistanceField,
        vehicle: Vehicle,
        options: PlanOptions,
        asked: Conditions,
        ask_gate: AskGate,
        stop: StopFlag | None,
        *,
        clearance_price: float,
        progress: Progress = silent,
    ) -> None:
        """Finds the path with few knots that all begin with.

        Args:
            obstacles: what the optimiser keeps away from; the gate looks at `field`.
            clearance_price: as `Weights.clearance`.

        Raises:
            PlanCancelledError: `stop` was set.
        """
        self._waypoints, self._field, self._vehicle, self._options = waypoints, field, vehicle, options
        self._asked, self._ask_gate, self._stop, self._progress = asked, ask_gate, stop, progress
        self._clearance_price, self._route = clearance_price, route
        self._rough, self.start = fastest.rough(route, obstacles, vehicle, options, asked, stop)

    def best(self) -> Path | None:
        """The fastest path that passes the gate, or the last one that does not; None if all stay too close.

        A free heading is not only tried for itself, but also from the answers with one that is bound, so that it never
        costs time.
        """
        found = self._from_starts(self._options)
        if self._options.yaw != "free":
            return found
        given = int(np.isfinite(self._waypoints.yaw_rad).sum())
        for mode in ("along_path", "steady") if given < 2 else ("along_path",):
            bound = self._from_starts(replace(self._options, yaw=mode))
            if bound is None or not bound.report.passed:
                continue
            found = bound if found is None or not found.report.passed else fastest.faster(found, bound)
        if found is None or found.kept is None:
            return found
        freed = self._freed(found)
        return found if freed is None else fastest.faster(found, freed)

    def _from_starts(self, options: PlanOptions) -> Path | None:
        """The path from the best start that comes through the gate."""
        problem, durations, index = fastest.whole_vehicle(
            self._rough,
            self.start,
            self._route.waypoint,
            self._waypoints.yaw_rad,
            options,
            self._asked,
            self._clearance_price,
        )
        problem = replace(problem, **self._asked.planned_on_legs(index, options.limits_for(self._vehicle)))
        begin, path = problem.spline(problem.knots, durations), None
        for there in descents.starts(problem, begin, options.clearance_m, self._stop):
            found = self._until_flyable(replace(problem, knots=there.knots), there.spline, index, options)
            path = path if found is None else found
            if path is not None and path.report.passed:
                break
        return path

    def _freed(self, bound: Path) -> Path | None:
        assert bound.kept is not None
        problem = fastest.with_free_heading(bound.kept.problem, bound.waypoint, self._waypoints.yaw_rad)
        corrections = bound.kept.corrections.unpressed()
        return self._until_flyable(problem, bound.kept.spline, bound.waypoint, self._options, corrections=corrections)

    def _until_flyable(
        self,
        problem: Problem,
        spline: Spline,
        index: np.ndarray,
        options: PlanOptions,
        corrections: Corrections | None = None,
    ) -> Path | None:
        return fastest.until_flyable(
            problem,
            spline,
            index,
            self._vehicle,
            options,
            self._field,
            self._asked,
            self._ask_gate,
            self._stop,
            corrections=corrections,
            progress=self._progress,
        )
