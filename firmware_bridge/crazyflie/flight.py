"""One flight of a Crazyflie: upload and read back, check, arm, take off, fly the trajectory, land; and its log."""

import contextlib
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from firmware_bridge.arming import required
from firmware_bridge.controller import State
from firmware_bridge.crazyflie import checks, pieces
from firmware_bridge.crazyflie.client import LOST, Bits, Client
from firmware_bridge.crazyflie.variables import Block, Variables
from flight import FlightLog, FloatArray, LinkError, Progress, Trajectory, rotations, silent
from flight.flight_log import from_vectors

ARM_S, SETTLE_S = 30.0, 2.0
CLIMB_M_S, SHIFT_M_S, SLOWEST_S = 0.4, 0.3, 2.0
SILENT_S, OFF_PLAN_M = 0.5, 0.5
EMPTY_S = 900.0
"""Longer than any battery of it flies: so long it is asked to land."""
LOWEST_TAKE_OFF_M = 0.3
"""A start below this height is approached from above."""
_LATE_S, _PUMP_S, _SETTLED_S, _UNHEARD_S = 3.0, 0.02, 0.3, 5.0
_AGAIN_S = 0.1
"""Between two tries to land by a line that breaks at once."""
ALONE = (
    "without us the Crazyflie flies its trajectory to the end and hovers there until its battery is empty; "
    "only this computer lands it"
)
_STOPPED = "emergency stop, the rotors are off"
_UNSTOPPED = "emergency stop not delivered, the rotors may turn"
_RATE_SIGNS = np.array([1.0, -1.0, 1.0])
"""The firmware counts pitch nose up, in milliradians a second."""
_MOTION, _ATTITUDE, _OUTPUTS, _HEALTH = range(4)


def _blocks() -> list[Block]:
    state = "stateEstimate"
    return [
        Block(tuple(f"{state}.{name}" for name in ("x", "y", "z", "vx", "vy", "vz")), 10),
        Block(
            (*(f"{state}.{name}" for name in ("qw", "qx", "qy", "qz")),
             *(f"stateEstimateZ.rate{axis}" for axis in ("Roll", "Pitch", "Yaw"))),
            10,
        ),
        Block(
            (*(f"motor.m{i}" for i in (1, 2, 3, 4)), "pm.vbat", "pm.state",
             *(f"ctrltarget.{axis}" for axis in "xyz")),
            10,
        ),
        Block((*(f"kalman.varP{axis}" for axis in "XYZ"), "supervisor.info"), 100),
    ]  # fmt: skip


@dataclass(frozen=True, slots=True)
class Seen:
    """What was logged last."""

    state: State
    position_world_m: FloatArray
    velocity_world_m_s: FloatArray
    q_world_body: FloatArray
    battery_v: float
    since_s: float
    """Of `state`."""


class Flight:
    """One flight."""

    def __init__(
        self, client: Client, plan: Trajectory, *, arms: bool, progress: Progress = silent,
        cancel: Callable[[], bool] = lambda: False, stop: Callable[[], bool] = lambda: False,
        motor_of_rotor: tuple[int, ...] = (0, 1, 2, 3),
    ) -> None:  # fmt: skip
        """
        Args:
            motor_of_rotor: the firmware's motor, from 0, that turns each rotor of the log.
            plan: of at most 31 pieces of degree 7.
            cancel: land now.
            stop: rotors off now, wherever it is.
        """
        self._client, self._plan, self._progress, self._cancel, self._stop = client, plan, progress, cancel, stop
        self._arms, self._motor_of_rotor = arms, motor_of_rotor
        self._variables: Variables | None = None
        self._phases: list[tuple[float, State]] = []
        self._ground_m = 0.0
        self._up_s = -float("inf")
        self._armed_here = self._off = False
        self.ended_early = ""
        self.held: Trajectory | None = None
        """The trajectory as read back from its memory."""

    def upload(self) -> Trajectory:
        """Write the pieces, read them back, and compare every byte.

        Raises:
            LinkError: it does not answer, or holds other bytes.
        """
        content = pieces.packed(self._plan)
        held = self._client.upload(content)
        if len(held) != len(content):
            raise LinkError(f"the Crazyflie read back {len(held)} of {len(content)} bytes: upload it again")
        if held != content:
            at = next(i for i, (a, b) in enumerate(zip(held, content, strict=True)) if a != b)
            raise LinkError(
                f"the Crazyflie's memory holds other bytes than were written, from {at} on: upload it again"
            )
        self._client.define(len(self._plan.durations_s))
        self.held = pieces.unpacked(held)
        return self.held

    def fly(self) -> FlightLog:
        """Upload and fly. Its log tells by `ended_early` of a flight that did not end at the end of the plan.

        Raises:
            LinkError: it never left the ground.
        """
        self.upload()
        self._variables = Variables(self._client, _blocks())
        start = self._plan.position([0.0])[0]
        self._ready(start)
        self._client.on_pump = self._obey_stop
        try:
            self._arm()
        except Exception:
            self._disarm()
            raise
        try:
            self._climb(start)
            self._track()
        except Exception as early:  # whatever it is, it is in the air
            self.ended_early = _words(early)
        self._land()
        return self._log()

    def seen(self) -> Seen | None:
        """None before it is logged."""
        if self._variables is None or not all(block.rows for block in self._blocks()):
            return None
        motion, attitude, outputs, _ = self._blocks()
        begun_s, state = self._phases[-1] if self._phases else (motion.time_s[-1], State.DISARMED)
        x_v, q = np.array(motion.rows[-1]), np.array(attitude.rows[-1][:4])
        since_s = motion.time_s[-1] - begun_s
        return Seen(state, x_v[:3], x_v[3:6], q / np.linalg.norm(q), outputs.last("pm.vbat"), since_s)

    # before it flies

    def _ready(self, start: FloatArray) -> None:
        self._for(SETTLE_S)
        if not all(block.rows for block in self._blocks()):
            raise LinkError("the Crazyflie's log blocks do not arrive; is another program connected to it?")
        motion = self._blocks()[_MOTION]
        recent = motion.time_s[-1] - np.array(motion.time_s) <= 1.0
        rows = np.array(motion.rows)[recent][:, :3]
        self._ground_m = float(np.median(rows[:, 2]))
        outputs, health = self._blocks()[_OUTPUTS], self._blocks()[_HEALTH]
        required(
            checks.checks(
                self._client.bits(), battery_v=outputs.last("pm.vbat"), power=int(outputs.last("pm.state")),
                variance_m2=np.array(health.rows[-1][:3]), position_world_m=rows, up_z=self._up_z(),
                start_world_m=start,
            )
        )  # fmt: skip

    def _arm(self) -> None:
        armed = Bits.ARMED | Bits.AUTO_ARMED
        self._not_cancelled("arming")
        if self._client.bits() & armed:
            return
        if self._arms:
            self._armed_here = True
            if not self._client.arm(on=True):
                raise LinkError("the Crazyflie does not arm; its console says why")
            return
        self._progress("arm now", 0.0)
        end_s = self._client.now_s + ARM_S
        while not self._client.bits() & armed:
            self._not_cancelled("arming")
            if self._client.now_s > end_s:
                raise LinkError(f"the Crazyflie was not armed within {ARM_S:.0f} s")
            self._for(0.1)

    # in flight

    def _climb(self, start: FloatArray) -> None:
        self._phase(State.TAKE_OFF)
        top_m = max(float(start[2]), self._ground_m + LOWEST_TAKE_OFF_M)
        duration_s = max((top_m - self._ground_m) / CLIMB_M_S, SLOWEST_S)
        self._not_cancelled("take-off")
        self._up_s = self._client.now_s
        try:
            self._client.take_off(top_m, duration_s)
        finally:
            self._up_s = self._client.now_s  # when it was asked last
        self._while("take-off", duration_s)
        self._phase(State.APPROACH)
        far_m = float(np.linalg.norm(start - self._position()))
        shift_s = max(far_m / SHIFT_M_S, SLOWEST_S)
        x, y, z, yaw = self._plan.evaluate(np.array([0.0]), 0)[0]
        self._client.go_to(float(x), float(y), float(z), float(yaw), shift_s)
        self._while("the way to the start", shift_s + 0.5)
        far_m = float(np.linalg.norm(start - self._position()))
        if far_m > 0.5 * checks.NEAR_M:
            raise LinkError(f"the way to the start: it hovers {far_m:.2f} m from there; is its estimate right?")

    def _track(self) -> None:
        self._phase(State.TRAJECTORY)
        self._client.start()
        self._while("the trajectory", self._plan.duration_s)
        self._phase(State.HOLD)
        self._while("the hover at the end", 0.5)

    def _land(self) -> None:
        """Down where it is; asked for until it is, or its rotors are off, or no battery lasts any longer."""
        self._phase(State.LANDING)
        end_s, told = self._client.now_s + EMPTY_S, False
        while not self._down_or_stopped():
            try:
                self._obey_stop()  # a line that breaks at once waits for nothing
                self._settle(self._ask_to_land() + _LATE_S)
                break
            except Exception as error:  # also one of ours: nothing else lands it
                if self._off:
                    break
                if self._client.now_s > end_s:
                    self.ended_early = f"{self.ended_early or _words(error)}; it does not answer: {ALONE}"
                    return
                if not told:
                    self._progress(f"it is asked to land until it does, or Ctrl-C stops its rotors: {ALONE}", 0.0)
                    told = True
                self._client.rest(_AGAIN_S)
        with contextlib.suppress(LinkError):
            if not self._stopped():
                self._client.stop()
        self._disarm()
        self._phase(State.DISARMED)
        with contextlib.suppress(LinkError):
            self._for(0.2)

    def _ask_to_land(self) -> float:
        """How long it takes: from where it is, or from the top of the plan where that is not known."""
        height_m = float(self._position()[2])
        if not self._heard(_MOTION):
            height_m = max(height_m, float(self._plan.position(np.arange(0.0, self._plan.duration_s, 0.1))[:, 2].max()))
        duration_s = max((height_m - self._ground_m) / CLIMB_M_S, SLOWEST_S)
        self._client.land(self._ground_m, duration_s)
        return duration_s

    def _disarm(self) -> None:
        if self._armed_here:
            with contextlib.suppress(LinkError):
                self._client.arm(on=False)

    def _settle(self, limit_s: float) -> None:
        """Until it is down, which the supervisor judges by its rotors, or the landing's time is over."""
        end_s = self._client.now_s + limit_s
        while self._client.now_s < end_s and not self._down_or_stopped():
            self._for(0.1)

    def _down_or_stopped(self) -> bool:
        """By what is logged now: what was logged before a take-off would say it is down."""
        low = self._position()[2] < self._ground_m + 0.05
        told = self._heard(_MOTION) and self._heard(_HEALTH)
        return self._stopped() or (told and low and Bits.FLYING not in self._bits())

    def _heard(self, block: int) -> bool:
        """Of late, and of what a take-off has changed."""
        heard_s = self._blocks()[block].heard_s
        return self._client.now_s - heard_s < SILENT_S and heard_s > self._up_s + _SETTLED_S

    def _stopped(self) -> bool:
        return self._off or bool(self._bits() & LOST)

    def _while(self, what: str, seconds: float) -> None:
        """Watch it fly.

        Raises:
            LinkError: it is to land, or has ended its flight itself.
        """
        begin_s = self._client.now_s
        while self._client.now_s < begin_s + seconds:
            self._for(_PUMP_S)
            self._watch(what, settled=self._client.now_s - begin_s > _SETTLED_S)

    def _watch(self, what: str, *, settled: bool) -> None:
        """
        Args:
            settled: its target is that of the last command.
        """
        if lost := LOST & self._bits():
            self._rotors_off()
            raise LinkError(f"{what}: the supervisor says {', '.join(bit.name or '' for bit in lost).lower()}")
        self._not_cancelled(what)
        if self._client.now_s - self._client.heard_s > SILENT_S:
            raise LinkError(f"{what}: nothing was heard for {SILENT_S} s")
        outputs = self._blocks()[_OUTPUTS]
        if int(outputs.last("pm.state")) in (checks.POWER_LOW, checks.POWER_OFF):
            raise LinkError(f"{what}: the battery is low to the firmware, at {outputs.last('pm.vbat'):.2f} V")
        off_m = self._off_m()
        if settled and off_m > OFF_PLAN_M:
            raise LinkError(f"{what}: it is {off_m:.2f} m from where it is to be, at most {OFF_PLAN_M} m")

    def _rotors_off(self) -> bool:
        """Said until it is locked: a packet may be lost, or the line may break and be opened anew.

        Returns:
            Whether it was sent, and is locked; else no battery lasts any longer.
        """
        self._off = True
        begin_s, sent, told = self._client.now_s, False, False
        while self._client.now_s < begin_s + EMPTY_S:
            try:
                self._client.emergency_stop()
                sent = True
                self._for(0.1)
            except Exception:  # whatever it is, it is to be sent again
                self._client.rest(_AGAIN_S)
            if sent and Bits.LOCKED in self._bits():
                return True
            if not told and self._client.now_s > begin_s + _UNHEARD_S:
                self._progress("the emergency stop was not heard; it is sent until it is", 0.0)
                told = True
        return False

    def _obey_stop(self) -> None:
        """
        Raises:
            LinkError: the rotors are off, or it did not hear of it.
        """
        if not self._off and self._stop():
            words = _STOPPED if self._rotors_off() else _UNSTOPPED
            self.ended_early = "; ".join([*filter(None, [self.ended_early]), words])
            raise LinkError(words)

    def _not_cancelled(self, what: str) -> None:
        if self._cancel():
            raise LinkError(f"{what}: cancelled")

    def _for(self, seconds: float) -> None:
        end_s = self._client.now_s + seconds
        while (left_s := end_s - self._client.now_s) > 0.0:
            self._client.pump(left_s)

    # what is logged

    def _blocks(self) -> list[Block]:
        assert self._variables is not None
        return self._variables.blocks

    def _position(self) -> FloatArray:
        rows = self._blocks()[_MOTION].rows
        return np.array(rows[-1][:3]) if rows else np.zeros(3)

    def _off_m(self) -> float:
        target = np.array([self._blocks()[_OUTPUTS].last(f"ctrltarget.{axis}") for axis in "xyz"])
        return float(np.linalg.norm(target - self._position()))

    def _up_z(self) -> float:
        q = np.array(self._blocks()[_ATTITUDE].rows[-1][:4])
        return float(rotations.matrix(q / np.linalg.norm(q))[2, 2])

    def _bits(self) -> Bits:
        info = self._blocks()[_HEALTH].last("supervisor.info")
        return Bits(0 if math.isnan(info) else int(info))

    def _phase(self, state: State) -> None:
        motion = self._blocks()[_MOTION]
        self._phases.append((motion.time_s[-1] if motion.time_s else 0.0, state))

    def _log(self) -> FlightLog:
        """At the times of positions, the other blocks in between."""
        motion, attitude, outputs, _ = self._blocks()
        t, first = np.array(motion.time_s), motion.columns()
        turned = np.array(attitude.rows)
        signs = np.cumprod([1.0, *np.sign(np.sum(turned[1:, :4] * turned[:-1, :4], axis=1) + 1e-12)])
        turned[:, :4] *= signs[:, None]
        q, rate = np.split(_between(t, attitude, turned), [4], axis=1)
        rest = _between(t, outputs, np.array(outputs.rows))
        vectors = {
            "position_world_m": np.column_stack([first[f"stateEstimate.{a}"] for a in ("x", "y", "z")]),
            "velocity_world_m_s": np.column_stack([first[f"stateEstimate.{a}"] for a in ("vx", "vy", "vz")]),
            "q_world_body": q / np.linalg.norm(q, axis=1, keepdims=True),
            "rate_body_rad_s": 1e-3 * rate * _RATE_SIGNS,
            "setpoint_position_world_m": rest[:, 6:9],
        }
        begins_s = np.array([begin_s for begin_s, _ in self._phases])
        states = np.array([float(State.DISARMED), *(float(state) for _, state in self._phases)])
        motors = [rest[:, motor] / 65535.0 for motor in self._motor_of_rotor]
        scalars = {f"motor_command_{i}_ratio": values for i, values in enumerate(motors)}
        scalars |= {"battery_v": rest[:, 4], "mission_state": states[np.searchsorted(begins_s, t, side="right")]}
        metadata = {"source": "Crazyflie"} | ({"ended_early": self.ended_early} if self.ended_early else {})
        return from_vectors(t, vectors, scalars=scalars, metadata=metadata)


def _words(error: Exception) -> str:
    return str(error) if isinstance(error, LinkError) else f"{type(error).__name__}: {error}"


def _between(time_s: FloatArray, block: Block, rows: FloatArray) -> FloatArray:
    own_s = np.array(block.time_s)
    return np.column_stack([np.interp(time_s, own_s, rows[:, i]) for i in range(rows.shape[1])])
