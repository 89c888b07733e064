"""Plans in a process of its own, so that the page never waits and a crash of the planner takes nothing with it.

The newest request wins: one that waits is replaced, and one that runs for longer than `PATIENCE_S` while a newer one
waits is ended with its process. The process ends by itself when its parent is gone, however that died.
"""

import logging
import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import planner
import vehicle
from flight import FlightError, TrajectoryFile
from gcs_web import inputs, page_values, protocol
from gcs_web.document import Content

logger = logging.getLogger(__name__)

PATIENCE_S = 1.0


@dataclass(frozen=True, slots=True)
class Request:
    """What to plan."""

    revision: int
    content: Content
    inputs: inputs.Signature
    """Of the map and the vehicle that it is to be checked against."""


@dataclass(frozen=True, slots=True)
class Answer:
    """What came of it."""

    request: Request
    file: TrajectoryFile | None
    """The checked trajectory, or None."""
    shown: protocol.Plan


class PlanningProcess:
    """`request` returns at once; `on_answer` is called from a thread of this object."""

    def __init__(self, folder: Path, base: planner.PlanOptions, on_answer: Callable[[Answer], None]) -> None:
        self._folder, self._base, self._on_answer = folder, base, on_answer
        self._waiting: Request | None = None
        self._wake = threading.Condition()
        self._closed = False
        self._process: Any = None
        self._pipe: Connection | None = None
        self._thread = threading.Thread(target=self._serve, name="planning", daemon=True)
        self._start()
        self._thread.start()

    def request(self, request: Request) -> None:
        with self._wake:
            self._waiting = request
            self._wake.notify()

    def close(self) -> None:
        with self._wake:
            self._closed = True
            self._wake.notify()
        self._thread.join(timeout=5.0)
        self._end()

    def _serve(self) -> None:
        while True:
            with self._wake:
                self._wake.wait_for(lambda: self._waiting is not None or self._closed)
                if self._closed:
                    return
                request, self._waiting = self._waiting, None
            assert request is not None
            answer = self._ask(request)
            if answer is not None:
                try:
                    self._on_answer(answer)
                except Exception:  # the next request must still be answered
                    logger.exception("the plan could not be shown")

    def _ask(self, request: Request) -> Answer | None:
        """The answer of the process; None if a newer request ended it."""
        assert self._pipe is not None
        begun_s = time.monotonic()
        try:
            self._pipe.send(request)
            while not self._pipe.poll(0.02):
                overdue = time.monotonic() - begun_s > PATIENCE_S
                if self._closed or (overdue and self._waiting is not None):
                    self._restart()
                    return None
            return self._pipe.recv()
        except (EOFError, OSError):
            self._restart()
            reason = "the planner's process ended unexpectedly"
            problem = protocol.Problem(reason, "try again, or change the waypoints", None)
            return Answer(request, None, protocol.Plan(request.revision, "refused", reason, problem=problem))

    def _start(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=_serve_requests, args=(theirs, self._folder, self._base), daemon=True)
        self._process.start()
        theirs.close()

    def _restart(self) -> None:
        self._end()
        if not self._closed:
            self._start()

    def _end(self) -> None:
        assert self._pipe is not None
        self._process.kill()
        self._process.join()
        self._pipe.close()


# --- in the planning process ---


def _serve_requests(pipe: Connection, folder: Path, base: planner.PlanOptions) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the parent, which ends this process
    waiting: list[Request] = []
    arrived = threading.Condition()

    def receive() -> None:
        while True:
            try:
                request = pipe.recv()
            except (EOFError, OSError):  # the parent is gone
                os._exit(0)
            with arrived:
                waiting.append(request)
                arrived.notify()

    threading.Thread(target=receive, daemon=True).start()
    parts = inputs.Parts(folder)
    while True:
        with arrived:
            arrived.wait_for(lambda: bool(waiting))
            request = waiting.pop(0)
        pipe.send(_answer(request, parts, base))


def _answer(request: Request, parts: inputs.Parts, base: planner.PlanOptions) -> Answer:
    begun_s = time.perf_counter()
    try:
        file, shown = _planned(request, parts, base)
    except FlightError as error:
        where, remedy = getattr(error, "segment", None), getattr(error, "remedy", "")
        reason = getattr(error, "reason", str(error))
        waypoint = None if where is None else request.content.points[where].id
        problem = protocol.Problem(reason, remedy, waypoint)
        return Answer(request, None, protocol.Plan(request.revision, "refused", str(error), problem=problem))
    elapsed_ms = 1000.0 * (time.perf_counter() - begun_s)
    return Answer(request, file, shown(elapsed_ms))


def _planned(
    request: Request, parts: inputs.Parts, base: planner.PlanOptions
) -> tuple[TrajectoryFile, Callable[[float], protocol.Plan]]:
    area, believed = parts.map(request.inputs), parts.vehicle(request.inputs)
    waypoints = request.content.waypoints()
    plan = planner.plan(waypoints, area.field, believed, options(request.content, believed, base))
    file = planner.trajectory_file(plan, name="plan")
    page_values.crc32(file)  # a plan that the vehicle cannot store is refused here, in words
    series = page_values.series(plan.trajectory, believed, area.field)
    bounds = page_values.limits(plan.gate, series)
    passed = page_values.passings(request.content.points, plan.trajectory, series)

    def shown(planning_ms: float) -> protocol.Plan:
        top = max(series.speed_m_s)
        return protocol.Plan(
            revision=request.revision,
            state="checked",
            sentence=(
                f"{plan.trajectory.duration_s:.2f} s, {len(waypoints.positions_world_m)} waypoints, top speed "
                f"{top:.2f} m/s. Closest {plan.gate.clearance_m:.2f} m; "
                f"{plan.gate.required_clearance_m:.2f} m is needed."
            ),
            duration_s=plan.trajectory.duration_s,
            top_speed_m_s=top,
            clearance_m=plan.gate.clearance_m,
            required_clearance_m=plan.gate.required_clearance_m,
            closest=plan.gate.clearance_point_world_m,
            planning_ms=planning_ms,
            limits=bounds,
            segments=page_values.segments(passed, bounds, series),
            passings=passed,
            series=series,
        )

    return file, shown


def options(content: Content, believed: vehicle.Vehicle, base: planner.PlanOptions) -> planner.PlanOptions:
    """What the document asks for, within the vehicle's own limits."""
    asked, own = content.settings, believed.limits
    limits = replace(
        own,
        speed_m_s=min(asked.speed_m_s, own.speed_m_s),
        acceleration_m_s2=min(asked.acceleration_m_s2, own.acceleration_m_s2),
    )
    return replace(base, margin_m=asked.margin_m, yaw=asked.yaw, method=asked.method, limits=limits)
