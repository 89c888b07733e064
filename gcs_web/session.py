"""The project a pilot works on: waypoints with undo, the plan they give, and nothing of how it is shown.

Every change is saved at once (`waypoints.json`, whole or not at all), so a crash loses nothing. Planning runs in a
process of its own; a plan that was overtaken by a newer change is dropped when it arrives.
"""

import multiprocessing
import threading
from collections.abc import Callable
from concurrent.futures import Future, ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import mapping
import planner
import vehicle
from flight import FlightError, FloatArray, InputError, TrajectoryFile, project, results, trajectory
from flight.project import Project, Waypoints


@dataclass(frozen=True, slots=True)
class PlanResult:
    """What came of a planning request."""

    revision: int
    """Which change of the waypoints it answers."""
    file: TrajectoryFile | None
    """The checked trajectory, or None."""
    clearance_m: FloatArray
    """(m,) clearance at the samples of `positions_world_m`; empty without a plan."""
    positions_world_m: FloatArray
    """(m, 3) samples along the path."""
    problem: str
    """Why there is no plan, in one sentence; empty with a plan."""


@dataclass(frozen=True, slots=True)
class Saved:
    """A trajectory in the project."""

    path: Path
    kept: Path | None = None
    """Where the one of the same name that it replaced is now."""


Listener = Callable[[], None]


class Session:
    """One open project. Thread-safe: the page calls it from several threads."""

    def __init__(self, opened: Project, *, options: planner.PlanOptions | None = None) -> None:
        """Raises `FlightError` if the project's map or vehicle cannot be read."""
        self.project = opened
        self.map = mapping.open_map(opened.map)
        self.vehicle = vehicle.load(opened.vehicle)
        self._lock = threading.RLock()
        self._undo: list[FloatArray] = []
        self._redo: list[FloatArray] = []
        self._positions = _saved_positions(opened)
        self._revision = 0
        self._plan: PlanResult | None = None
        self._planning = False
        self._saved: dict[Path, int] = {}  # trajectories of this session: the revision each was planned for
        self._listeners: list[Listener] = []
        context = multiprocessing.get_context("spawn")
        self._pool = ProcessPoolExecutor(
            1, mp_context=context, initializer=_open_planner, initargs=(opened.folder, options)
        )

    def on_change(self, listener: Listener) -> None:
        """Call `listener` after every change of waypoints or plan, from whichever thread made it."""
        self._listeners.append(listener)

    @property
    def positions_world_m(self) -> FloatArray:
        return self._positions.copy()

    @property
    def plan(self) -> PlanResult | None:
        """The newest plan, if it answers the waypoints as they are now."""
        with self._lock:
            return self._plan if self._plan and self._plan.revision == self._revision else None

    def move(self, index: int, position_world_m: FloatArray) -> None:
        positions = self.positions_world_m
        positions[index] = position_world_m
        self._change(positions)

    def insert(self, index: int, position_world_m: FloatArray) -> None:
        self._change(np.insert(self._positions, index, position_world_m, axis=0))

    def delete(self, index: int) -> None:
        """Raises `InputError` when two waypoints are left: a path needs a start and an end."""
        if len(self._positions) <= 2:
            raise InputError("two waypoints are the least a path can have; move them instead")
        self._change(np.delete(self._positions, index, axis=0))

    def undo(self) -> bool:
        return self._step(self._undo, self._redo)

    def redo(self) -> bool:
        return self._step(self._redo, self._undo)

    def request_plan(self) -> None:
        """Plan through the waypoints as they are now; the answer comes through `on_change`."""
        with self._lock:
            revision, positions = self._revision, self.positions_world_m
            self._planning = True
        if len(positions) < 2:
            self._receive(PlanResult(revision, None, np.empty(0), np.empty((0, 3)), "add at least two waypoints"))
            return
        self._notify()
        future = self._pool.submit(_plan, revision, positions)
        future.add_done_callback(self._finished)

    def save_trajectory(self, name: str, *, overwrite: bool = False) -> Saved:
        """Write the current plan into the project.

        Args:
            overwrite: replace another trajectory of this name; it is kept beside.

        Raises:
            InputError: there is no plan for the waypoints as they are now, the name cannot be one, or another
                trajectory has it and `overwrite` was not given.
        """
        plan = self.plan
        if plan is None or plan.file is None:
            raise InputError("there is no checked plan for these waypoints; wait for it, or mend what it complains of")
        path = self.project.trajectory(name)
        if self._saved.get(path) == plan.revision and path.exists():
            return Saved(path)
        results.require_free(path, overwrite=overwrite)
        with results.new_file(path, overwrite=overwrite) as placing:
            trajectory.save(placing.temporary, replace(plan.file, name=name))
        self._saved[path] = plan.revision
        return Saved(path, placing.kept)

    def would_replace(self, name: str) -> Path | None:
        """The file of another trajectory that has this name.

        Raises:
            InputError: the name cannot be one.
        """
        path = self.project.trajectory(name)
        return path if path.exists() and self._saved.get(path) != self._revision else None

    def state(self) -> dict[str, Any]:
        """Everything a test or another view wants to know, as JSON-able values."""
        with self._lock:
            plan = self.plan
            return {
                "project": self.project.name,
                "map_hash": self.map.hash,
                "waypoints_world_m": self._positions.tolist(),
                "revision": self._revision,
                "planning": self._planning,
                "can_undo": bool(self._undo),
                "can_redo": bool(self._redo),
                "problem": plan.problem if plan else "",
                "plan": None
                if plan is None or plan.file is None
                else {
                    "duration_s": plan.file.trajectory.duration_s,
                    "clearance_m": float(np.min(plan.clearance_m)),
                    "checked": plan.file.checked,
                },
            }

    def close(self) -> None:
        self._pool.shutdown(wait=False, cancel_futures=True)

    def _step(self, source: list[FloatArray], sink: list[FloatArray]) -> bool:
        with self._lock:
            if not source:
                return False
            sink.append(self._positions)
            self._set(source.pop())
        self.request_plan()
        return True

    def _change(self, positions: FloatArray) -> None:
        with self._lock:
            if np.array_equal(positions, self._positions):
                return
            previous = self._positions
            self._set(positions)
            self._undo.append(previous)
            self._redo.clear()
        self.request_plan()

    def _set(self, positions: FloatArray) -> None:
        """Save first: what cannot be saved (a coordinate that is not finite) is not taken over either."""
        waypoints = Waypoints(positions, np.full(len(positions), np.nan))
        if self._revision == 0 and self.project.waypoints.exists():
            results.keep(self.project.waypoints)  # undo ends with the session; what it began with stays
        project.save_waypoints(self.project.waypoints, waypoints)
        self._positions = waypoints.positions_world_m
        self._revision += 1

    def _finished(self, future: "Future[PlanResult]") -> None:
        if future.cancelled():
            return
        error = future.exception()
        if error is None:
            self._receive(future.result())
        else:
            problem = f"the planner stopped: {error}"
            self._receive(PlanResult(self._revision, None, np.empty(0), np.empty((0, 3)), problem))

    def _receive(self, result: PlanResult) -> None:
        with self._lock:
            if result.revision != self._revision:
                return
            self._plan = result
            self._planning = False
        self._notify()

    def _notify(self) -> None:
        for listener in self._listeners:
            listener()


def _saved_positions(opened: Project) -> FloatArray:
    if not opened.waypoints.exists():
        return np.empty((0, 3))
    return project.load_waypoints(opened.waypoints).positions_world_m


# What follows runs in the planning process. Its map is opened once, when the process starts.

_planner_state: dict[str, Any] = {}


def _open_planner(folder: Path, options: planner.PlanOptions | None) -> None:
    opened = project.open_project(folder)
    _planner_state["map"] = mapping.open_map(opened.map)
    _planner_state["vehicle"] = vehicle.load(opened.vehicle)
    _planner_state["options"] = options or planner.PlanOptions()


def _plan(revision: int, positions_world_m: FloatArray) -> PlanResult:
    area, options = _planner_state["map"], _planner_state["options"]
    waypoints = Waypoints(positions_world_m, np.full(len(positions_world_m), np.nan))
    try:
        plan = planner.plan(waypoints, area.field, _planner_state["vehicle"], options)
    except FlightError as error:
        return PlanResult(revision, None, np.empty(0), np.empty((0, 3)), str(error))
    path = plan.trajectory.position(plan.trajectory.sample(0.03))
    return PlanResult(revision, planner.trajectory_file(plan, name="plan"), area.field.distance(path), path, "")
