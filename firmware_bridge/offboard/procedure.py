"""One flight off board: arm, take off, fly the trajectory, land, and the log of it."""

import contextlib
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from firmware_bridge.controller import Command, LinkLoss, State
from firmware_bridge.offboard import ladder
from firmware_bridge.offboard.firmware import RATE_CHANGING, Alert
from firmware_bridge.offboard.guard_process import GuardProcess
from firmware_bridge.offboard.ladder import POSE_STALE_S, Stage, Wish
from firmware_bridge.offboard.messages import GuardStatus, PlannerCommand
from firmware_bridge.offboard.poses import Pose
from firmware_bridge.offboard.tracker import TARGETS_FROM_M_S, Demand, Tracker
from firmware_bridge.words import reason_text
from flight import FlightLog, FloatArray, LinkError, Progress, Trajectory, rotations, silent
from flight.flight_log import from_vectors

LOWEST_TAKE_OFF_M = 0.3
READY_S, ARM_S, STEP_S, HOVER_S = 20.0, 30.0, 60.0, 2.0
_SILENT_S, _DISARMING_S = 0.5, 1.0
_ON_GROUND_M = 0.3
"""Above where it stood: a controller that gives up higher than this leaves the vehicle in the air."""
_OFF_HEIGHT_M = 0.2
"""Of the hover before the start: one farther off is of another vehicle than the file's."""
_LOG_EVERY = 2
_DOWN = (State.DISARMED, State.FAULT)
_ENDED = (Stage.DOWN, Stage.ENDED)


@dataclass(frozen=True, slots=True)
class Hints:
    """What helps where the firmware does not answer, or does not follow."""

    silent: str = "is its baud rate right, and MSP on in its Ports tab?"
    not_ours: str = "the pilot's override switch is off"
    arm: str = ""
    """What the pilot is told when it may be armed."""


class Flight:
    """The planner's side of one flight."""

    def __init__(
        self,
        guard: GuardProcess,
        tracker_of: Callable[[Callable[[float], list[Pose]]], Tracker],
        trajectory: Trajectory,
        *,
        progress: Progress = silent,
        cancel: Callable[[], bool] = lambda: False,
        motor_of_rotor: tuple[int, ...] = (0, 1, 2, 3),
        hints: Hints | None = None,
    ) -> None:
        """
        Args:
            motor_of_rotor: the firmware's motor, from 0, that turns each rotor of the log.
            hints: None: Betaflight's.
        """
        self._hints = hints or Hints()
        self._guard, self._trajectory, self._progress, self._cancel = guard, trajectory, progress, cancel
        self._motor_of_rotor = list(motor_of_rotor)
        self._inbox: list[Pose] = []
        self.tracker = tracker_of(self._taken)
        self._wish = Wish.WAIT
        self._ticks = 0
        self._rows: list[dict[str, FloatArray]] = []
        self._stood_m: float | None = None
        self._told_bound = self._told_clock = self._by_targets = self._asked_targets = False
        self._apart = ""
        self.status: GuardStatus | None = None
        self.ended_early = ""

    def _taken(self, now_s: float) -> list[Pose]:
        poses, self._inbox = self._inbox, []
        return poses

    def fly(self) -> FlightLog:
        """The whole flight. Its log tells by `ended_early` of one that did not end at the end of the plan.

        Raises:
            RefusedError: the controller's own checks refuse the trajectory.
            LinkError: it never left the ground.
        """
        controller = self.tracker.controller
        controller.upload(self._trajectory, link_loss=LinkLoss.FINISH)
        self._until(self._ready, READY_S, "the vehicle is not ready to arm", watch=self._not_cancelled)
        begin_m = float(self._trajectory.position([0.0])[0, 2])
        motion = self.tracker.motion
        assert motion is not None
        self._stood_m = float(motion.position_world_m[2])
        controller.command(Command.ARM)
        self._wish = Wish.FLY
        if self._hints.arm:
            self._progress(self._hints.arm, 0.0)
        armed = "the firmware does not arm"
        self._until(lambda: self._heard().armed and self._heard().sticks_ours, ARM_S, armed, watch=self._arms)
        self._not_cancelled(armed)
        try:
            rise_m = max(begin_m - self._stood_m, LOWEST_TAKE_OFF_M)
            controller.command(Command.TAKE_OFF, rise_m)
            self._reach(State.HOLD, STEP_S, "take-off")
            self._for(HOVER_S)
            self._require_height(self._stood_m + rise_m)
            controller.command(Command.START)
            self._reach(State.TRAJECTORY, STEP_S, "the way to the start")
            self._reach(State.HOLD, self._trajectory.duration_s + STEP_S, "the trajectory")
            self._for(0.5)
        except Exception as early:  # whatever it is, it is in the air, and its log is kept
            self.ended_early = _words(early)
        self._land()
        return self._log()

    def _require_height(self, wanted_m: float) -> None:
        motion = self.tracker.motion
        assert motion is not None
        off_m = float(motion.position_world_m[2]) - wanted_m
        if abs(off_m) > _OFF_HEIGHT_M:
            share = self.tracker.effectiveness.share
            raise LinkError(
                f"the hover is {off_m:+.2f} m off the height asked for, at most {_OFF_HEIGHT_M}; its rotors give "
                f"{share:.0%} of the vehicle file's thrust: check mass and thrust"
            )

    def _land(self) -> None:
        """Down by the controller; where it or the guard has begun to come down already, until it is."""
        controller = self.tracker.controller
        if controller.state not in (State.LANDING, State.DISARMED, State.FAULT) and self._following():
            controller.command(Command.LAND)
        try:
            self._until(lambda: controller.state in _DOWN or not self._following(), STEP_S, "landing")
            self._wish = self._wish_at_end() if self._following() else self._wish
            self._until(lambda: self._heard().stage in _ENDED, STEP_S, "disarming")
        except Exception as error:
            self.ended_early = self.ended_early or _words(error)
        self._ask_pilot_to_disarm()

    def _ask_pilot_to_disarm(self) -> None:
        """Where only a pilot's switch disarms: until then the guard holds the throttle low."""
        with contextlib.suppress(Exception):
            self._until(self._ended_or_disarmed, _DISARMING_S, "disarming")
        if self._heard().armed and self._heard().stage is Stage.DOWN:
            self._progress("landed: disarm now", 1.0)

    def _ended_or_disarmed(self) -> bool:
        return self._heard().stage is Stage.ENDED or not self._heard().armed

    def _wish_at_end(self) -> Wish:
        """The controller's end: it has landed, or it gives up in the air, where the guard still can bring it down."""
        motion = self.tracker.motion
        high = motion is not None and motion.position_world_m[2] > (self._stood_m or 0.0) + _ON_GROUND_M
        return Wish.DESCEND if self.tracker.state is State.FAULT and high else Wish.STOP

    def _ready(self) -> bool:
        status = self._heard()
        flags = status.arming_flags
        at_rest = not (flags or status.armed or status.other_mode or status.battery_alert or status.apart)
        heard = status.time_s - status.heard_s < _SILENT_S and self._pose_is_fresh(status)
        return at_rest and heard and self.tracker.ready and self._ticks > 250

    def _pose_is_fresh(self, status: GuardStatus) -> bool:
        return status.time_s - self.tracker.predictor.pose_time_s < POSE_STALE_S

    def _not_cancelled(self, what: str) -> None:
        if self._cancel():
            raise LinkError(f"{what}: cancelled")

    def _arms(self, what: str) -> None:
        """While the firmware is to arm: nobody has thought better of it, and the guard not either."""
        self._not_cancelled(what)
        if not self._following():
            raise LinkError(f"{what}: {ladder.WORDS[self._heard().reason] or 'the guard ended the flight'}")

    def _heard(self) -> GuardStatus:
        assert self.status is not None
        return self.status

    def _following(self) -> bool:
        return self._heard().stage in (Stage.WAITING, Stage.FOLLOWING)

    def _for(self, seconds: float) -> None:
        end_s = self._heard().time_s + seconds
        self._until(lambda: self._heard().time_s >= end_s, seconds + 1.0, "hovering", watch=self._watch)

    def _reach(self, state: State, limit_s: float, what: str) -> None:
        self._until(lambda: self.tracker.state is state, limit_s, what, watch=self._watch)

    def _until(
        self, done: Callable[[], bool], limit_s: float, what: str, *, watch: Callable[[str], None] | None = None
    ) -> None:
        """Tick until it is so.

        Args:
            watch: called meanwhile with what is waited for; raises where that is not to be.
        """
        begin_s: float | None = None
        while True:
            self._tick()
            status = self._heard()
            begin_s = status.time_s if begin_s is None else begin_s
            if done():
                return
            if watch is not None:
                watch(what)
            if status.time_s - begin_s > limit_s:
                raise LinkError(f"{what} within {limit_s:.0f} s: {self._why_not(status)}")

    def _watch(self, what: str) -> None:
        status, controller = self._heard(), self.tracker.controller
        if not self._following():
            raise LinkError(f"{what}: {ladder.WORDS[status.reason] or 'the guard ended the flight'}")
        if controller.state in (State.LANDING, State.EMERGENCY, State.FAULT, State.DISARMED):
            raise LinkError(f"{what}: the controller ended it because {reason_text(controller.telemetry['reason'])}")
        if status.time_s - status.heard_s > _SILENT_S:
            raise LinkError(f"{what}: the firmware has not answered for {_SILENT_S} s")
        if status.battery_alert is Alert.CRITICAL:
            raise LinkError(f"{what}: the battery is at {status.battery_v:.1f} V, critical to the firmware; it lands")
        self._not_cancelled(what)

    def _why_not(self, status: GuardStatus) -> str:
        if status.time_s - status.heard_s > _SILENT_S:
            return f"the firmware does not answer; {self._hints.silent}"
        if self.tracker.motion is None:
            return "no pose has come; is the tracking system sending TUM lines to the address of --pose-stream?"
        if not self._pose_is_fresh(status):
            return f"the last pose is older than {POSE_STALE_S} s, or its clock is not ours"
        if not self.tracker.ready:
            return self.tracker.unready
        if status.armed and self._wish is Wish.WAIT:
            return "it is armed already; disarm, switch the override on, and arm when told"
        if status.other_mode:
            return f"mode {RATE_CHANGING[status.other_mode]} is on, in which sticks are no body rates; switch it off"
        if status.battery_alert and self._wish is Wish.WAIT:
            return f"the battery is low to the firmware, at {status.battery_v:.1f} V; charge or change it"
        if status.apart and self._wish is Wish.WAIT:
            return status.apart
        if status.said:
            return f"the firmware says: {status.said}"
        if not status.sticks_ours:
            return self._hints.not_ours
        return f"the vehicle is {self.tracker.state.name.lower()}, the guard {status.stage.name.lower()}"

    def _tick(self) -> None:
        self.status = status = self._guard.hear()
        self._inbox += status.poses
        demand = self.tracker.tick(status.time_s, battery_v=status.battery_v, by_targets=status.by_targets)
        rest = demand or Demand(status.time_s, 0.0, np.zeros(3), -np.inf)
        given_up = self._wish is Wish.FLY and self.tracker.state is State.FAULT
        wish = self._wish_at_end() if given_up else self._wish
        command = PlannerCommand(rest.time_s, rest.pose_time_s, rest.force_n, rest.rate_body_rad_s, wish, rest.target)
        if status.stage is not Stage.ENDED:
            self._guard.answer(command)
        self._ticks += 1
        self._asked_targets |= rest.target is not None
        self._tell_of_bound()
        self._tell_of_clock(status)
        self._tell_of_targets(status)
        if demand is not None and self._ticks % _LOG_EVERY == 0:
            self._keep(status, demand)

    def _tell_of_bound(self) -> None:
        """Once: what the observer does not take up is an error of height."""
        learnt = self.tracker.effectiveness
        if learnt.at_bound and not self._told_bound:
            self._told_bound = True
            self._progress(f"warning: rotors of {learnt.share:.0%} of the vehicle file's thrust or beyond", 0.0)

    def _tell_of_clock(self, status: GuardStatus) -> None:
        if status.other_clock and not self._told_clock:
            self._told_clock = True
            self._progress(
                "the poses are stamped by another clock: taken to be as old as ?delay= says, 0 s without", 0.0
            )

    def _tell_of_targets(self, status: GuardStatus) -> None:
        apart = status.apart if status.armed else ""
        if (status.by_targets, apart or self._apart) == (self._by_targets, self._apart):
            return
        self._by_targets, self._apart = status.by_targets, apart or self._apart
        theirs = "its own position loops fly; our prediction and thrust learning rest"
        ours = f"flown by rates and thrust{_because(self._apart)}"
        self._progress(theirs if status.by_targets else ours, 0.0)

    def _keep(self, status: GuardStatus, demand: Demand) -> None:
        motion, telemetry = self.tracker.motion, self.tracker.controller.telemetry
        assert motion is not None
        sent = np.nan if status.by_targets else 1.0
        self._rows.append(
            {
                "time_s": np.array(status.time_s),
                "position_world_m": motion.position_world_m,
                "velocity_world_m_s": motion.velocity_world_m_s,
                "q_world_body": motion.q_world_body,
                "rate_body_rad_s": motion.rate_body_rad_s,
                "setpoint_position_world_m": np.asarray(telemetry["setpoint"]["position_world_m"], np.float64),
                **{
                    f"setpoint_rate_body_{a}_rad_s": np.array(sent * w)
                    for a, w in zip("xyz", demand.rate_body_rad_s, strict=True)
                },
                "collective_force_n": np.array(sent * demand.force_n),
                "felt_force_n": np.array(self._felt_n()),
                "mission_state": np.array(float(self.tracker.state)),
                "battery_v": np.array(status.battery_v),
                **{
                    f"motor_command_{i}_ratio": np.array(float(v))
                    for i, v in enumerate(status.motors[self._motor_of_rotor])
                },
            }
        )

    def _felt_n(self) -> float:
        """Collective force by the poses, as in air at rest: mass times specific force along body z over `in_motion`."""
        tracker, motion = self.tracker, self.tracker.motion
        assert motion is not None
        felt = tracker.predictor.acceleration_world_m_s2(motion, motion.q_world_body)
        felt[2] += tracker.gravity_m_s2
        return float(tracker.mass_kg / tracker.in_motion * felt @ rotations.matrix(motion.q_world_body)[:, 2])

    def _log(self) -> FlightLog:
        columns = {name: np.array([row[name] for row in self._rows]) for name in self._rows[0]}
        time_s = columns.pop("time_s")
        scalars = {name: values for name, values in columns.items() if values.ndim == 1}
        vectors = {name: values for name, values in columns.items() if values.ndim == 2}
        share = self.tracker.effectiveness.share
        told = {"ended_early": self.ended_early, "targets": self._targets_flown(columns)}
        metadata = {"source": "off board", "thrust_share": f"{share:.3f}"}
        metadata["inner_loop_lag"] = self.tracker.inner_lag.words(other_clock=self._told_clock)
        metadata |= {name: text for name, text in told.items() if text}
        return from_vectors(time_s, vectors, scalars=scalars, metadata=metadata)

    def _targets_flown(self, columns: dict[str, FloatArray]) -> str:
        """How much of the path its own position loops flew, in words; empty where they were not to."""
        if not self.tracker.gives_targets:
            return ""
        on_path = columns["mission_state"] == State.TRAJECTORY
        share = float(np.isnan(columns["collective_force_n"][on_path]).mean()) if on_path.any() else 0.0
        return f"{share:.0%} of the path by position targets{_because(self._apart or self._never(share))}"

    def _never(self, share: float) -> str:
        """What was missing where none was flown."""
        if share > 0.0:
            return ""
        return "no metre of way that agreed" if self._asked_targets else f"never above {TARGETS_FROM_M_S} m/s"


def _because(reason: str) -> str:
    return f": {reason}" if reason else ""


def _words(error: Exception) -> str:
    return str(error) if isinstance(error, LinkError) else f"{type(error).__name__}: {error}"
