"""One flight from the ground: arm, take off, fly the active trajectory, land, fetch the log."""

import contextlib
import queue
import time
from collections.abc import Callable, Sequence
from typing import Any, Protocol

from firmware_bridge import arming, parameters, transfer, wire
from firmware_bridge.dialect.generated.messages import (
    Command,
    LinkReason,
    LogInfo,
    LogRecord,
    LogRequest,
    MissionState,
    MissionStatus,
    State,
)
from firmware_bridge.port import Port
from firmware_bridge.telemetry_log import flight_log, lost_ratio
from firmware_bridge.transfer import Cancel, CancelledError
from firmware_bridge.words import reason_text
from flight import FlightLog, FloatArray, LinkError, Progress, TrajectoryFile, silent

_STEP_S = 60.0
"""Vehicle time that arming, climbing, approaching or landing may take."""
_DOWN_S = 90.0
"""How long a flight that ended early is waited for, until its rotors stand; a lost link may come back within it."""
_END_S = 0.5
"""The last telemetry on the path may be lost: this close to its end counts as the end."""
_RESTART_S = 5.0
"""A clock that steps back by more than this has been started anew; by less, a message was overtaken by a later one."""
_ON_PATH = (MissionState.APPROACH, MissionState.TRAJECTORY, MissionState.PAUSING, MissionState.PAUSED)
_GROUND = (MissionState.DISARMED, MissionState.ARMED)
_ROTORS_STAND = (MissionState.DISARMED, MissionState.FAULT)
KeepLog = Callable[[FlightLog], None]


class Pilot(Protocol):
    """Whose orders the vehicle follows: the link."""

    def command(self, command: Command, value: float = 0.0, *, plan: wire.WirePlan | None = None) -> None:
        """Give an order; an error if it is refused."""
        ...

    def try_command(self, command: Command, value: float = 0.0) -> int:
        """The same; returns why it was refused, 0 when it was not."""
        ...


class _Watch:
    """Follows the mission through telemetry, and keeps the telemetry."""

    def __init__(self, port: Port, inbox: "queue.SimpleQueue[Any]", cancel: Cancel) -> None:
        self.port, self.inbox, self.cancel = port, inbox, cancel
        self.states: list[State] = []
        self.mission = MissionState.DISARMED
        self.reason = 0
        self.time_s = 0.0

    def listen(self) -> None:
        """Take in what came; wait a moment if nothing did."""
        if self.cancel():
            raise CancelledError("flight cancelled")
        if self.port.control_lost:
            raise LinkError(f"{self.port.control_lost} during the flight, which is theirs now: {self.words()}")
        try:
            message = self.inbox.get(timeout=0.05)
        except queue.Empty:
            if time.monotonic() - self.port.last_heard_s > self.port.timeout_s:
                raise self.port.silence() from None
            return
        if isinstance(message, State):
            self.states.append(message)
        time_s = message.time_us * 1e-6
        if self.time_s - _RESTART_S < time_s < self.time_s:
            return  # overtaken on the way: its mission state is out of date
        self.time_s = time_s
        self.mission = MissionState(message.mission_state)
        if not isinstance(message, State):
            self.reason = message.reason

    def until(self, wanted: Sequence[MissionState], allowed: Sequence[MissionState], limit_s: float, what: str) -> None:
        """Wait for one of the wanted states, while the mission stays within the allowed ones.

        Every message is looked at in its order, so that a state cannot be missed however far behind we are.
        """
        start_s = self.time_s
        while self.mission not in wanted:
            if self.mission not in allowed:
                raise self.early(what)
            if self.time_s - start_s > limit_s:
                raise LinkError(f"{what}: still {self.words()} after {limit_s:.0f} s of vehicle time")
            self.listen()

    def first(self) -> None:
        """Wait for the first message of the vehicle's state."""
        while not self.states:
            self.listen()

    def state(self) -> State:
        """The newest one."""
        return self.states[-1]

    @property
    def left_the_ground(self) -> bool:
        return any(state.mission_state not in _GROUND for state in self.states)

    def until_rotors_stand(self) -> None:
        """Wait, also for a link that comes back, until the rotors stand or `_DOWN_S` of our time have passed."""
        end_s = time.monotonic() + _DOWN_S
        while self.mission not in _ROTORS_STAND and time.monotonic() < end_s:
            with contextlib.suppress(LinkError):
                self.listen()

    def words(self) -> str:
        return self.mission.name.lower().replace("_", " ")

    def early(self, what: str) -> LinkError:
        """The error for a mission that went elsewhere."""
        status = self.port.latest.get(MissionStatus)
        reason = status.reason if isinstance(status, MissionStatus) else self.reason
        return LinkError(f"{what}: the vehicle went to {self.words()} because {reason_text(reason)}")


def fly(
    pilot: Pilot,
    port: Port,
    file: TrajectoryFile | None,
    *,
    rate_hz: float,
    progress: Progress,
    cancel: Cancel,
    ended_early: KeepLog | None,
) -> FlightLog:
    """See `Link.fly`."""
    plan = transfer.read_back(port, progress=silent, cancel=cancel)
    if plan is None:
        raise LinkError("the vehicle holds no trajectory; upload one first")
    if file is not None and plan.crc32 != wire.plan_from_file(file, on_link_loss=plan.on_link_loss).crc32:
        raise LinkError(f"the vehicle holds {plan.name} (crc {plan.crc32:08x}), not {file.name}; upload it first")
    pilot.command(Command.STATE_RATE, rate_hz)
    metadata = {
        "source": "telemetry",
        "trajectory": plan.name,
        "trajectory_crc32": f"{plan.crc32:08x}",
        "map_hash": plan.map_hash.hex(),
        "vehicle_hash": plan.vehicle_hash.hex(),
    }
    with port.inbox(State, MissionStatus) as inbox:
        watch = _Watch(port, inbox, cancel)
        start_world_m = plan.trajectory().position([0.0])[0]
        watch.first()
        if watch.mission in _GROUND:
            arming.required(arming.checks(watch.state(), parameters.read(port), start_world_m))
        has_log = pilot.try_command(Command.LOG_START) != LinkReason.NO_LOG_MEMORY  # empties the last flight's
        try:
            _mission(pilot, watch, plan, start_world_m, progress)
        except KeyboardInterrupt:
            _land(pilot)
            raise
        except LinkError as error:
            if isinstance(error, CancelledError):
                error = CancelledError(f"flight cancelled; {_land(pilot)}")
            if ended_early is not None and watch.left_the_ground:
                _keep(pilot, watch, metadata | {"ended_early": str(error)}, has_log, ended_early)
            raise error from None
        return _recorded(pilot, watch, metadata, has_log, progress)


def _recorded(pilot: Pilot, watch: _Watch, metadata: dict[str, Any], has_log: bool, progress: Progress) -> FlightLog:
    """The on-board log; of a vehicle without log memory the telemetry."""
    if not has_log:
        return flight_log(watch.states, metadata | {"telemetry_lost_ratio": round(lost_ratio(watch.states), 6)})
    pilot.command(Command.LOG_STOP)
    log = download_log(watch.port, progress=progress, cancel=watch.cancel)
    return FlightLog(log.columns, metadata | dict(log.metadata))


def _keep(pilot: Pilot, watch: _Watch, metadata: dict[str, Any], has_log: bool, keep: KeepLog) -> None:
    """Wait until the rotors stand, then hand over the log; where the vehicle does not give it, what was heard of it."""
    watch.cancel = _never
    theirs = bool(watch.port.control_lost)  # the log of what another station flies on is not ours to stop
    if not theirs:
        watch.until_rotors_stand()
    try:
        log = _recorded(pilot, watch, metadata, has_log and not theirs, silent)
    except LinkError:
        log = _recorded(pilot, watch, metadata, False, silent)
    keep(log)


def _mission(pilot: Pilot, watch: _Watch, plan: wire.WirePlan, start_world_m: FloatArray, progress: Progress) -> None:
    """The flight itself, one step per line."""
    S = MissionState
    duration_s = float(plan.durations_us.sum()) * 1e-6
    if watch.mission is S.DISARMED:
        pilot.command(Command.ARM)
        watch.until([S.ARMED], [S.DISARMED], _STEP_S, "arming")
    if watch.mission is S.ARMED:
        progress("take-off", 0.0)
        pilot.command(Command.TAKE_OFF, arming.take_off_height_m(watch.state(), start_world_m))
        watch.until([S.HOLD], [S.ARMED, S.TAKE_OFF], _STEP_S, "take-off")
    pilot.command(Command.START, plan=plan)
    along_s = _follow(watch, duration_s, progress)
    if watch.mission is not S.HOLD or along_s < duration_s - _END_S:
        raise watch.early("the trajectory was not finished")
    pilot.command(Command.LAND)
    progress("landing", 0.0)
    watch.until(_GROUND, [S.HOLD, S.LANDING], _STEP_S, "landing")
    if watch.mission is S.ARMED:
        pilot.command(Command.DISARM)


def _follow(watch: _Watch, duration_s: float, progress: Progress) -> float:
    """Wait until the trajectory is left, paused time included; how far along it the vehicle was last seen."""
    watch.until(_ON_PATH, [MissionState.HOLD], _STEP_S, "start")
    furthest_s = 0.0
    while watch.mission in _ON_PATH:
        watch.listen()
        along_s = watch.states[-1].trajectory_time_s if watch.states else 0.0
        furthest_s = max(furthest_s, along_s)
        progress("flight", min(furthest_s / duration_s, 1.0))
    return furthest_s


def _never() -> bool:
    return False


def _land(pilot: Pilot) -> str:
    """Order the landing of a flight that is being given up; in words, what the vehicle does now."""
    try:
        if not pilot.try_command(Command.LAND):
            return "the vehicle brakes along its path and lands"
        refused = pilot.try_command(Command.DISARM)
    except LinkError as error:
        return f"the order to land was not answered ({error}): the vehicle does what its parameters say for a lost link"
    return f"it refused to land and to disarm: {reason_text(refused)}" if refused else "the vehicle is disarmed"


def download_log(port: Port, *, progress: Progress, cancel: Cancel) -> FlightLog:
    """See `Link.download_log`."""
    info = port.ask(LogRequest(), LogInfo, lambda _: True)
    if not info.records:
        raise LinkError("the vehicle has no log of a flight")
    records = transfer.collect(
        port,
        info.records,
        lambda first, wanted: LogRequest(first=first, wanted=wanted),
        LogRecord,
        lambda record: record.index if record.log_id == info.log_id else None,
        stage="log",
        progress=progress,
        cancel=cancel,
    )
    states = [State.unpack(bytes(records[i].record)) for i in range(info.records)]
    metadata = {
        "source": "on-board log",
        "period_s": info.period_us * 1e-6,
        "records_not_stored": info.not_stored,
    }
    return flight_log(states, metadata)
