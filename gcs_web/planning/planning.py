"""Plans in a process of its own, so that the page never waits and a crash of the planner takes nothing with it.

The newest request wins: what is worked on is told to stop, and if that takes longer than `PATIENCE_S` it is ended with
its process. Drafts are answered meanwhile. The process ends by itself when its parent is gone, however that died.
"""

import itertools
import logging
import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from multiprocessing import connection
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

import planner
import vehicle
from flight import FlightError, FloatArray, TrajectoryFile
from gcs_web.document import missions
from gcs_web.document.document import Content
from gcs_web.planning import inputs, page_values, replanning, saved
from gcs_web.protocol import plan as plan_messages
from gcs_web.protocol.plan import Plan, Problem
from mapping import Map
from mapping.free_space import FreeSpace
from planner.gate import could_hide

logger = logging.getLogger(__name__)

PATIENCE_S = 1.0
PAUSE_S = 0.2
"""Without another draft asked for, the waypoint is held still: its plan is worked out."""
PAUSE_S = 0.2
"""Without another draft being asked for, the waypoint is held still: its plan is worked out."""
_DRAWN = 500
"""Points of a path that is foreseen."""
_SAVED_STEP_S = 0.01
"""A saved trajectory's waypoints need not be where two of its segments join."""


@dataclass(frozen=True, slots=True)
class Request:
    """What to plan."""

    revision: int
    content: Content
    inputs: inputs.Signature
    """Of the map and the vehicle that it is to be checked against."""
    afresh: bool = False
    """Whether to plan from scratch, and not on from the last plan."""
    saved: TrajectoryFile | None = None
    """A trajectory through these waypoints that is checked as it is, in place of a plan."""
    id: int = field(default_factory=itertools.count().__next__)
    """Of this request: one revision may be planned again, with other inputs."""


@dataclass(frozen=True, slots=True, eq=False)
class Draft:
    """What the path would look like with one waypoint elsewhere; not checked, and no trajectory."""

    waypoint: int
    """Its id."""
    position_world_m: FloatArray
    """(3,) where it is dragged."""
    path_world_m: FloatArray | None = None
    """(m, 3); None in a question, and where no draft can be made."""
    shown: plan_messages.Draft | None = None
    """None in a question, and where there is nothing to draw along."""


@dataclass(frozen=True, slots=True)
class _Taken:
    """The process has begun to work on a request."""

    request: int
    """Its id."""


@dataclass(frozen=True, slots=True)
class Answer:
    """What came of it."""

    request: Request
    file: TrajectoryFile | None
    """The checked trajectory, or None."""
    shown: Plan


class PlanningProcess:
    """`request` and `draft` return at once; `on_answer` and `on_draft` are called from a thread of this object."""

    def __init__(
        self,
        folder: Path,
        base: planner.PlanOptions,
        on_answer: Callable[[Answer], None],
        on_draft: Callable[[Draft], None] = lambda _: None,
    ) -> None:
        self._folder, self._base = folder, base
        self._on_answer, self._on_draft = on_answer, on_draft
        self._lock = threading.RLock()
        self._newest: Request | None = None
        """Not answered yet."""
        self._waits_since_s: float | None = None
        """Since when it waits for the process to begin with it."""
        self._closed = False
        self._outdated = False
        """Whether the process must be replaced."""
        self._woken, self._wake = multiprocessing.Pipe(duplex=False)
        self._start()
        self._thread = threading.Thread(target=self._serve, name="planning", daemon=True)
        self._thread.start()

    def request(self, request: Request) -> None:
        with self._lock:
            self._newest, self._waits_since_s = request, time.monotonic()
            self._send(request)
            self._wake.send_bytes(b"1")

    def draft(self, waypoint: int, position_world_m: FloatArray) -> None:
        """Ask for a path with this waypoint (id) moved there."""
        with self._lock:
            self._send(Draft(waypoint, position_world_m))

    def restart(self) -> None:
        """From the next request on with a new process, which has this one's environment as it is now."""
        with self._lock:
            self._outdated = True
            self._wake.send_bytes(b"1")

    def close(self) -> None:
        with self._lock:
            self._closed = True
            self._wake.send_bytes(b"1")
        self._thread.join(timeout=5.0)
        self._end()

    def _send(self, message: Request | Draft) -> None:
        try:
            self._pipe.send(message)
        except OSError:  # the process is gone, as whoever reads its answers finds out
            logger.info("the planner's process does not listen")

    def _serve(self) -> None:
        while not self._closed:
            ready = connection.wait([self._pipe, self._woken], self._patience_s())
            if self._woken in ready:
                self._woken.recv_bytes()
            try:
                if self._outdated:  # before its answer to a request that came later is taken
                    self._outdated = False
                    self._restart()
                elif self._pipe in ready:
                    self._take(self._pipe.recv())
                elif self._patience_s() == 0.0:
                    self._restart()
            except (EOFError, OSError):
                self._died()

    def _patience_s(self) -> float | None:
        """How long the process may still take to begin with the newest request; None: as long as it likes."""
        with self._lock:
            if self._waits_since_s is None or not self._ready:
                return None
            return max(self._waits_since_s + PATIENCE_S - time.monotonic(), 0.0)

    def _take(self, message: Answer | Draft | _Taken | None) -> None:
        with self._lock:
            self._ready = True
            newest = self._newest
            if isinstance(message, _Taken) and newest is not None and message.request == newest.id:
                self._waits_since_s = None
            if isinstance(message, Answer) and newest is not None and message.request.id == newest.id:
                self._newest = None
        try:
            if isinstance(message, Answer):
                self._on_answer(message)
            elif isinstance(message, Draft):
                self._on_draft(message)
        except Exception:  # the next request must still be answered
            logger.exception("the plan could not be shown")

    def _died(self) -> None:
        with self._lock:
            request, self._newest = self._newest, None
            self._restart()
        if request is not None and not self._closed:
            reason = "the planner's process ended unexpectedly"
            problem = Problem(reason, "try again, or change the waypoints", None)
            shown = Plan(request.revision, "refused", reason, problem=problem)
            self._take(Answer(request, None, shown))

    def _start(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._ready = False
        """Whether the process has said anything yet."""
        self._process: Any = context.Process(
            target=_serve_requests, args=(theirs, self._folder, self._base), daemon=True
        )
        self._process.start()
        theirs.close()

    def _restart(self) -> None:
        with self._lock:
            self._end()
            if self._closed:
                return
            self._start()
            self._waits_since_s = None
            if self._newest is not None:
                self.request(self._newest)

    def _end(self) -> None:
        self._process.kill()
        self._process.join()
        self._pipe.close()


# --- in the planning process ---


def _serve_requests(pipe: connection.Connection, folder: Path, base: planner.PlanOptions) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the parent, which ends this process
    newest: list[Request | Draft] = []
    foreseen: list[Draft] = []  # what is worked out while a waypoint is held still
    arrived, sending = threading.Condition(), threading.Lock()
    replanner = replanning.Replanner()

    def send(message: Answer | Draft | _Taken | None) -> None:
        with sending:
            try:
                pipe.send(message)
            except OSError:  # the parent is gone
                os._exit(0)

    def receive() -> None:
        while True:
            try:
                message = pipe.recv()
            except (EOFError, OSError):  # the parent is gone
                os._exit(0)
            if isinstance(message, Draft):
                with arrived:
                    if foreseen:
                        replanner.cancel()
                    foreseen.clear()
                    newest[:] = [each for each in newest if isinstance(each, Request)]
                if pipe.poll():
                    continue  # a newer one has come, or the drag is over
                found = drafted(message, replanner)
                send(found)
                if found.path_world_m is not None and not pipe.poll(PAUSE_S):
                    with arrived:
                        newest[:] = newest or [message]
                        arrived.notify()
                continue
            with arrived:
                foreseen.clear()
                newest[:] = [message]
                replanner.cancel()
                arrived.notify()

    threading.Thread(target=receive, daemon=True).start()
    send(None)  # from now on requests are taken at once
    parts = inputs.Parts(folder)
    while True:
        with arrived:
            arrived.wait_for(lambda: bool(newest))
            request = newest.pop()
            foreseen[:] = [request] if isinstance(request, Draft) else []
            replanner.begin()
        try:
            if isinstance(request, Request):
                send(_Taken(request.id))
                send(answer(request, parts, base, replanner))
                continue
            found = foreseen_at(request, replanner)
        except planner.PlanCancelledError:
            continue  # for a newer one, which is taken next
        with arrived:
            if foreseen:  # still held there
                send(found)
            foreseen.clear()


def drafted(asked: Draft, replanner: replanning.Replanner) -> Draft:
    """The path to draw, and its figures or why there is none in words."""
    try:
        found = replanner.draft(asked.waypoint, asked.position_world_m)
    except FlightError as error:
        return replace(asked, shown=plan_messages.Draft(asked.waypoint, _sentence(str(error)), "refused"))
    if found is None:
        return asked
    name, share = max(found.shares.items(), key=lambda item: item[1])
    said = (
        f"About {found.duration_s:.2f} s, closest {found.clearance_m:.2f} m; {found.required_clearance_m:.2f} m is "
        f"needed. Up to {100.0 * share:.0f} % of the limit on {name}. Not checked: let go to plan and check."
    )
    shown = plan_messages.Draft(asked.waypoint, said, "clear" if found.is_clear else "too close")
    return replace(asked, path_world_m=found.position_world_m, shown=shown)


def foreseen_at(asked: Draft, replanner: replanning.Replanner) -> Draft:
    """As `drafted`, of the checked plan.

    Raises:
        PlanCancelledError: the waypoint was dragged on, or let go.
    """
    try:
        plan = replanner.foresee(asked.waypoint, asked.position_world_m)
    except planner.PlanCancelledError:
        raise
    except FlightError as error:
        return replace(asked, shown=plan_messages.Draft(asked.waypoint, _sentence(str(error)), "refused"))
    if plan is None:
        return asked
    path = plan.trajectory
    said = (
        f"{path.duration_s:.2f} s, closest {plan.gate.clearance_m:.2f} m; {plan.gate.required_clearance_m:.2f} m is "
        "needed. Planned and checked: let go here to take it."
    )
    drawn = path.position(np.linspace(0.0, path.duration_s, _DRAWN))
    return replace(asked, path_world_m=drawn, shown=plan_messages.Draft(asked.waypoint, said, "checked"))


def _sentence(text: str) -> str:
    return f"{text[:1].upper()}{text[1:]}."


def answer(request: Request, parts: inputs.Parts, base: planner.PlanOptions, replanner: replanning.Replanner) -> Answer:
    """Plan, check and describe, on from what `replanner` planned last.

    Raises:
        PlanCancelledError: `replanner.cancel` was called.
    """
    begun_s = time.perf_counter()
    try:
        file, shown = _planned(request, parts, base, replanner)
    except planner.PlanCancelledError:
        raise
    except FlightError as error:
        where, remedy = getattr(error, "segment", None), getattr(error, "remedy", "")
        reason = getattr(error, "reason", str(error))
        flown = [name for name in missions.flown(request.content) if name is not None]
        waypoint = None if where is None else flown[min(where, len(flown) - 1)]
        problem = Problem(reason, remedy, waypoint)
        return Answer(request, None, Plan(request.revision, "refused", str(error), problem=problem))
    elapsed_ms = 1000.0 * (time.perf_counter() - begun_s)
    return Answer(request, file, shown(elapsed_ms))


@dataclass(frozen=True, slots=True, eq=False)
class _Passed:
    """A trajectory that passed the gate."""

    file: TrajectoryFile
    gate: planner.GateReport
    limits: vehicle.Limits
    join_s: FloatArray
    """Instants of which each waypoint is passed at one."""
    how: str = ""
    """Said before everything else."""
    unfinished: str = ""
    """Said of a plan whose optimiser did not converge."""


def _planned(
    request: Request, parts: inputs.Parts, base: planner.PlanOptions, replanner: replanning.Replanner
) -> tuple[TrajectoryFile, Callable[[float], Plan]]:
    content = request.content
    area, believed = parts.map(request.inputs), parts.vehicle(request.inputs)
    asked = options(content, believed, base)
    required_m = asked.sized(believed).clearance_m
    free = parts.free_space(request.inputs)
    found = "" if request.saved is None else _as_saved(request.saved, area, free, believed, required_m)
    if isinstance(found, str):
        plan = replanner.plan(content, replanning.Known(area.field, believed, asked), afresh=request.afresh)
        plan = replace(plan, gate=could_hide.add(plan.gate, plan.trajectory, free))
        file = planner.trajectory_file(plan, name="plan")
        unfinished = "" if plan.converged else "The optimiser did not converge: a faster flight may exist. "
        found = _Passed(file, plan.gate, asked.limits_for(believed), plan.trajectory.starts_s, found, unfinished)
    file, report = found.file, found.gate
    page_values.crc32(file)  # a plan that the vehicle cannot store is refused here, in words
    series = page_values.series(file.trajectory, believed, area.field, found.limits)
    hidden_mm = page_values.could_hide_mm(series, free, report.required_clearance_m)
    series = msgspec.structs.replace(series, could_hide_mm=hidden_mm)
    judged_m = page_values.judged_clearance(file.trajectory, area.field, report, series)
    bounds = page_values.limits(report, series, judged_m)
    radii_m = {point.id: point.fly_by_m for point in content.points}
    passed = page_values.passings(file, found.join_s, missions.flown(content), radii_m, area.field)
    doubt = " ".join(said for said in (inputs.doubt(area), inputs.model_doubt(believed)) if said)

    def shown(planning_ms: float) -> Plan:
        top = max(series.speed_m_s)
        return Plan(
            revision=request.revision,
            state="checked",
            sentence=(
                f"{found.how}{file.trajectory.duration_s:.2f} s, {_counted(content)}, top speed "
                f"{top:.2f} m/s. Closest {report.clearance_m:.2f} m; "
                f"{report.required_clearance_m:.2f} m is needed. {found.unfinished}{_hidden(report)}"
                + (f" {doubt}" if doubt else "")
            ),
            duration_s=file.trajectory.duration_s,
            top_speed_m_s=top,
            clearance_m=report.clearance_m,
            required_clearance_m=report.required_clearance_m,
            closest=report.clearance_point_world_m,
            planning_ms=planning_ms,
            limits=bounds,
            segments=page_values.segments(passed, bounds, series, judged_m, file.trajectory),
            passings=passed,
            series=series,
        )

    return file, shown


def _hidden(report: planner.GateReport) -> str:
    """A sentence on how thin an obstacle could hide, and what to do about it if that is worth a warning."""
    sentence = could_hide.describe(report)
    advice = f"; {_against_hiding(report)}" if could_hide.worth_a_warning(report) else ""
    return f"{sentence[0].upper()}{sentence[1:]}{advice}."


def _against_hiding(report: planner.GateReport) -> str:
    """What `could_hide.advice` says, for people who have the page and not the command line."""
    if report.could_hide is None:
        return could_hide.advice(report)
    bound_m = report.could_hide.threshold_m
    return (
        f"a map made again (Import images) with {bound_m:g} m as the thinnest obstacle has no free space where "
        f"{1e3 * bound_m:.0f} mm could hide"
    )


def _as_saved(
    item: TrajectoryFile, area: Map, free: FreeSpace | None, believed: vehicle.Vehicle, required_m: float
) -> _Passed | str:
    """A saved trajectory under the gate, for the map and the vehicle as they are now; why not if it does not pass.

    Args:
        required_m: clearance that is asked for now; a file may have been planned for a smaller vehicle or margin.
    """
    judged = saved.judge(item, area, free, believed)
    if not judged.report.passed:
        failed = ", ".join(check.name for check in judged.report.failures)
        return f"{item.name} as it was saved does not pass any more ({failed}): planned again through its waypoints. "
    if not judged.report.clearance_m >= required_m:
        return (
            f"{item.name} as it was saved comes within {judged.report.clearance_m:.2f} m of obstacles, and "
            f"{required_m:.2f} m is asked for now: planned again through its waypoints. "
        )
    duration_s = item.trajectory.duration_s
    at_s = np.union1d(item.trajectory.starts_s, np.arange(0.0, duration_s, _SAVED_STEP_S))
    return _Passed(item, judged.report, judged.limits, at_s, f"{item.name} as it was saved. ")


def _counted(content: Content) -> str:
    laps = content.settings.laps
    return f"{len(content.points)} waypoints" + (f", {laps} lap{'s' if laps > 1 else ''}" if laps else "")


def options(content: Content, believed: vehicle.Vehicle, base: planner.PlanOptions) -> planner.PlanOptions:
    """What the document asks for, within the vehicle's own limits."""
    asked, own = content.settings, believed.limits
    limits = replace(
        own,
        speed_m_s=min(asked.speed_m_s, own.speed_m_s),
        acceleration_m_s2=min(asked.acceleration_m_s2, own.acceleration_m_s2),
        jerk_m_s3=own.jerk_m_s3 if asked.jerk_m_s3 is None else min(asked.jerk_m_s3, own.largest_jerk_m_s3),
    )
    return replace(
        base,
        margin_m=asked.margin_m,
        yaw=asked.yaw,
        heading_rad=asked.heading_rad,
        look_at_world_m=asked.look_at_world_m,
        method=asked.method,
        limits=limits,
    )
