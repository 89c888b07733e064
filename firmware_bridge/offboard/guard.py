"""The guard: a process of its own between planner and flight controller, which lands the vehicle if the other dies.

`python -m firmware_bridge.offboard.guard SETUP FD` for Betaflight: it alone has the line, sends the sticks at a fixed
rate, and hears the poses. Whatever becomes of the planner, the sticks go on (ladder.py).
"""

import contextlib
import signal
import socket
import struct
import sys
from collections.abc import Callable
from typing import Protocol

import numpy as np

from firmware_bridge.offboard import byte_line
from firmware_bridge.offboard.airborne import Airborne
from firmware_bridge.offboard.clock import Clock, SteppedClock, WallClock
from firmware_bridge.offboard.descent import Descent
from firmware_bridge.offboard.firmware import Firmware, FirmwareState
from firmware_bridge.offboard.ladder import POSE_STALE_S, Ladder, Seen, Stage, Wish
from firmware_bridge.offboard.messages import GuardStatus, PlannerCommand, Setup, Target
from firmware_bridge.offboard.pose_watch import PoseWatch
from firmware_bridge.offboard.poses import Pose, Poses, UdpPoses
from firmware_bridge.offboard.prediction import Motion, Predictor
from firmware_bridge.offboard.sticks import Sticks
from flight import FloatArray, LinkError

_HOVER_TICKS = 5
"""Between looks at whether it hovers."""
_MOST_FAILURES = 250
"""Ticks in a row that the guard itself cannot do; after them the firmware's failsafe must."""
_PATIENCE_S = 30.0
"""Of this machine's clock, in which a planner answers while a simulated body waits; a hung one counts as silent."""
_IDLE = PlannerCommand(-np.inf, -np.inf, 0.0, np.zeros(3), Wish.WAIT)


class GuardSetup(Protocol):
    """What a guard must know, whatever firmware flies."""

    @property
    def pose_host(self) -> str: ...
    @property
    def pose_port(self) -> int: ...
    @property
    def pose_delay_s(self) -> float: ...
    @property
    def mass_kg(self) -> float: ...
    @property
    def gravity_m_s2(self) -> float: ...
    @property
    def period_s(self) -> float: ...
    @property
    def clock_port(self) -> int: ...


class InnerLoop(Protocol):
    """Firmware at the other end of a line, which follows force and body rates."""

    pilot_arms: bool
    """Only a pilot's switch arms and disarms it."""

    @property
    def state(self) -> FirmwareState: ...
    @property
    def ours(self) -> bool:
        """Whether it follows us now; a pilot can always take it."""
        ...

    @property
    def said(self) -> str:
        """Why it does not arm, in words."""
        ...

    by_targets: bool
    """Its own position loops fly, by the target sent last; force and rates were not sent."""

    @property
    def apart(self) -> str:
        """Why it cannot be told, or is told no more, where to be; empty where nobody asked for it."""
        ...

    def listen(self, now_s: float) -> None:
        """Take in what has come."""
        ...

    def seen(self, now_s: float, pose: Pose) -> None:
        """A pose that is believed, for a firmware that estimates by it."""
        ...

    def command(
        self, now_s: float, stage: Stage, force_n: float, rate_body_rad_s: FloatArray, target: Target | None = None
    ) -> None:
        """Once a tick: collective force, 0 for rotors at rest, and body rates (3,).

        Args:
            target: the set-point that they follow, where a firmware has loops of its own for it.
        """
        ...


class Guard:
    """One flight; `tick` until it returns False."""

    def __init__(
        self, setup: GuardSetup, firmware: InnerLoop, poses: Poses, planner: socket.socket, *,
        other_clock: Callable[[], bool] = lambda: False,
    ) -> None:  # fmt: skip
        """
        Args:
            other_clock: whether the poses are stamped by one that is not ours.
        """
        self._setup, self._firmware, self._poses, self._planner = setup, firmware, poses, planner
        self._other_clock = other_clock
        self._ladder, self._command, self._gone, self._hung = Ladder(), _IDLE, False, False
        self._predictor = Predictor(setup.mass_kg, setup.gravity_m_s2)
        self._airborne, self._watch = Airborne(setup.mass_kg, setup.gravity_m_s2), PoseWatch()
        self._descent: Descent | None = None
        self._new_poses: list[Pose] = []
        self._ticks = self._failures = 0
        self._crippled = False
        """By an error of its own: it hears neither planner nor poses any more."""

    def tick(self, now_s: float) -> bool:
        """Hear, judge, send, tell. False when the flight is over.

        An error of the guard's own ends no flight in the air: it comes down, without planner and poses.
        """
        try:
            goes_on = self._tick(now_s)
        except Exception as error:
            self._failed(now_s, error)
            return True
        self._failures = 0
        return goes_on

    def _failed(self, now_s: float, error: Exception) -> None:
        self._failures += 1
        if self._failures > _MOST_FAILURES:
            raise error
        if not self._crippled:
            print(f"guard: {type(error).__name__}: {error}", file=sys.stderr)
        self._crippled = self._watch.lying = True
        self._ladder.fail(now_s, lifted=self._airborne.lifted)

    def _tick(self, now_s: float) -> bool:
        self._hear(now_s)
        state = self._firmware.state
        ours = self._firmware.ours
        seen = Seen(
            self._command.wish, self._gone, self._command.time_s,
            -np.inf if self._watch.lying else self._command.pose_s, state.armed, ours,
            self._descent is not None and self._descent.landed, self._airborne.lifted, bool(state.other_modes),
            self._firmware.pilot_arms, state.heard_s, state.arming_told, state.left,
        )  # fmt: skip
        stage = self._ladder.step(now_s, seen)
        force_n, rate = self._demand(now_s, stage)
        self._predictor.on_ground = force_n <= 0.0
        followed = stage is Stage.FOLLOWING and self._command.wish is Wish.FLY
        self._firmware.command(now_s, stage, force_n, rate, self._command.target if followed else None)
        self._sent(now_s, force_n, rate, armed=state.armed and ours, followed=followed)
        self._tell(now_s, stage, seen)
        self._ticks += 1
        return stage is not Stage.ENDED

    def _sent(self, now_s: float, force_n: float, rate: FloatArray, *, armed: bool, followed: bool) -> None:
        """Nothing is learnt from a force that was not sent."""
        if self._firmware.by_targets:
            self._predictor.unknown(now_s)
            return
        if followed:
            self._learn_hover(now_s, force_n)
        self._predictor.command(now_s, force_n, rate)
        self._airborne.commanded(self._setup.period_s, force_n, armed=armed)

    def _hear(self, now_s: float) -> None:
        self._firmware.listen(now_s)
        state = self._firmware.state
        up_body = state.up_body(now_s)
        if up_body is not None:
            self._watch.attitude(state.attitude_s, up_body)
        if self._crippled:
            self._new_poses = []
            return
        self._new_poses = self._poses(now_s)
        for pose in self._new_poses:
            self._watch.pose(pose, flying=self._airborne.lifted and state.armed)
            if not self._watch.lying:
                self._airborne.pose(pose, armed=state.armed)
                self._predictor.pose(pose)
                self._firmware.seen(now_s, pose)
        while not self._gone:
            try:
                self._take(self._planner.recv(256))
            except BlockingIOError:
                return
            except OSError:
                self._gone = True

    def wait_for_planner(self) -> None:
        """While a simulated body waits: until the planner has answered, died, or hangs."""
        if self._gone or self._hung:
            return
        self._planner.settimeout(_PATIENCE_S)
        try:
            self._take(self._planner.recv(256))
        except TimeoutError:
            self._hung = True
        except OSError:
            self._gone = True
        finally:
            self._planner.setblocking(False)

    def _take(self, data: bytes) -> None:
        self._gone = not data
        self._command = PlannerCommand.unpack(data) or self._command

    def _demand(self, now_s: float, stage: Stage) -> tuple[float, FloatArray]:
        if stage is Stage.FOLLOWING:
            flies = self._command.wish is Wish.FLY
            return (self._command.force_n, self._command.rate_body_rad_s) if flies else (0.0, np.zeros(3))
        if stage is Stage.PILOT:
            self._descent = None
            self._predictor.reset()
            self._airborne.piloted(now_s)
            return self._airborne.hover_n, np.zeros(3)
        if stage is not Stage.DESCENDING:
            return 0.0, np.zeros(3)
        state = self._firmware.state
        if self._descent is None:
            height_m = self._airborne.height_m(now_s, state, lying=self._watch.lying)
            self._descent = Descent(now_s, self._airborne.hover_n, height_m, self._setup.gravity_m_s2)
        return self._descent.force_and_rate(now_s, state, self._motion(now_s))

    def _learn_hover(self, now_s: float, force_n: float) -> None:
        """From every few ticks of a planner's flight."""
        if not (self._airborne.lifted and self._ticks % _HOVER_TICKS == 0):
            return
        motion, up_body = self._motion(now_s), self._firmware.state.up_body(now_s)
        if motion is not None and up_body is not None:
            climbing = float(self._predictor.acceleration_world_m_s2(motion, motion.q_world_body)[2])
            self._airborne.hovers(_HOVER_TICKS * self._setup.period_s, force_n, float(up_body[2]), climbing)

    def _motion(self, now_s: float) -> Motion | None:
        """By poses that can be believed, stamped with that of the last."""
        if self._watch.lying or not self._predictor.pose_time_s >= now_s - POSE_STALE_S:
            return None
        motion = self._predictor.at(now_s)
        motion.time_s = self._predictor.pose_time_s
        return motion

    def _tell(self, now_s: float, stage: Stage, seen: Seen) -> None:
        state = self._firmware.state
        status = GuardStatus(
            stage, self._ladder.reason, state.armed, seen.sticks_ours, now_s, state.heard_s, state.battery_v,
            state.motors, state.arming_flags, tuple(self._new_poses), next(iter(state.other_modes), 0),
            state.battery_alert, self._firmware.said, self._firmware.by_targets, self._firmware.apart,
            self._other_clock(),
        )  # fmt: skip
        with contextlib.suppress(OSError, struct.error):  # a full or closed socket is the planner's loss
            self._planner.send(status.pack())


def run(setup: GuardSetup, opened: Callable[[], tuple[InnerLoop, Callable[[], None]]], planner: socket.socket) -> None:
    """Guard one flight to its end.

    Args:
        opened: the line to the firmware: its inner loop, and what closes it.
    """
    poses = UdpPoses(setup.pose_host, setup.pose_port, delay_s=setup.pose_delay_s)
    firmware, close = opened()
    poses.drop()
    clock: Clock = WallClock()
    if setup.clock_port:
        clock = SteppedClock(setup.clock_port, introduction=struct.pack("<H", poses.address[1]))
    planner.setblocking(False)
    guard = Guard(setup, firmware, poses, planner, other_clock=lambda: poses.other_clock)
    due_s = now_s = clock.now_s()
    try:
        while guard.tick(now_s):
            if clock.stepped:
                guard.wait_for_planner()
            due_s = max(due_s + setup.period_s, now_s)
            now_s = clock.sleep_until(due_s)
    finally:
        close()
        poses.close()


def process(setup: GuardSetup, opened: Callable[[], tuple[InnerLoop, Callable[[], None]]], planner_fd: int) -> None:
    """`run`, as the whole of a process that no signal of the planner's terminal ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the planner, which lands
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    with socket.socket(fileno=planner_fd) as planner:
        try:
            run(setup, opened, planner)
        except LinkError as error:
            sys.exit(f"guard: {error}")


def main() -> None:
    """Of a Betaflight."""
    setup = Setup.from_json(sys.argv[1])

    def opened() -> tuple[InnerLoop, Callable[[], None]]:
        line = byte_line.LastingLine(
            byte_line.connect(setup.address), lambda: byte_line.connect(setup.address, patience_s=0.0)
        )
        return Sticks(setup, Firmware(line)), line.close

    process(setup, opened, int(sys.argv[2]))


if __name__ == "__main__":
    main()
