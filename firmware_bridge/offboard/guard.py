"""The guard: a process of its own between planner and flight controller, which lands the vehicle if the other dies.

`python -m firmware_bridge.offboard.guard SETUP FD`: it alone has the line, sends the sticks at a fixed rate, and hears
the poses. Whatever becomes of the planner, the sticks go on (ladder.py).
"""

import contextlib
import signal
import socket
import struct
import sys

import numpy as np

from firmware_bridge.offboard import byte_line
from firmware_bridge.offboard.clock import Clock, SteppedClock, WallClock
from firmware_bridge.offboard.descent import Descent
from firmware_bridge.offboard.firmware import Firmware
from firmware_bridge.offboard.ladder import Ladder, Seen, Stage, Wish
from firmware_bridge.offboard.messages import GuardStatus, PlannerCommand, Setup
from firmware_bridge.offboard.poses import Pose, UdpPoses
from firmware_bridge.offboard.prediction import Predictor
from flight import FloatArray, LinkError

CHANNELS = 8
_DISARM_US = 1000
_HOVER_S = 2.0
"""Over which the force that hovers is averaged."""
_LEAST_HOVER, _MOST_HOVER = 0.7, 1.4
"""Of the weight: a force beyond is no hover's."""
_PATIENCE_S = 30.0
"""Of this machine's clock, in which a planner answers while a simulated body waits; a hung one counts as silent."""
_IDLE = PlannerCommand(-np.inf, -np.inf, 0.0, np.zeros(3), Wish.WAIT)


class Guard:
    """One flight; `tick` until it returns False."""

    def __init__(self, setup: Setup, firmware: Firmware, poses: UdpPoses, planner: socket.socket) -> None:
        self._setup, self._firmware, self._poses, self._planner = setup, firmware, poses, planner
        self._ladder, self._command, self._gone, self._hung = Ladder(), _IDLE, False, False
        self._predictor = Predictor(setup.mass_kg, setup.gravity_m_s2)
        self._hover_n = setup.mass_kg * setup.gravity_m_s2
        self._ground_m: float | None = None
        self._descent: Descent | None = None
        self._new_poses: list[Pose] = []

    def tick(self, now_s: float) -> bool:
        """Hear, judge, send, tell. False when the flight is over."""
        self._hear(now_s)
        state = self._firmware.state
        seen = Seen(
            self._command.wish, self._gone, self._command.time_s, self._command.pose_s, state.armed,
            self._setup.by_msp_alone or state.overriding, self._descent is not None and self._descent.landed,
        )  # fmt: skip
        stage = self._ladder.step(now_s, seen)
        force_n, rate = self._demand(now_s, stage)
        self._predictor.on_ground = force_n <= 0.0
        self._predictor.command(now_s, force_n, rate)
        self._send(stage, force_n, rate)
        self._tell(now_s, stage, seen)
        return stage is not Stage.ENDED

    def _hear(self, now_s: float) -> None:
        self._firmware.listen(now_s)
        self._new_poses = self._poses(now_s)
        for pose in self._new_poses:
            if self._ground_m is None:
                self._ground_m = float(pose.position_world_m[2])
            self._predictor.pose(pose)
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
            if self._command.wish is not Wish.FLY:
                return 0.0, np.zeros(3)
            weight_n = self._setup.mass_kg * self._setup.gravity_m_s2
            if _LEAST_HOVER < self._command.force_n / weight_n < _MOST_HOVER:
                self._hover_n += self._setup.period_s / _HOVER_S * (self._command.force_n - self._hover_n)
            return self._command.force_n, self._command.rate_body_rad_s
        if stage not in (Stage.DESCENDING, Stage.PILOT):
            return 0.0, np.zeros(3)
        motion = self._predictor.at(now_s) if self._predictor.pose_time_s > now_s - 1.0 else None
        if motion is not None:
            motion.time_s = self._predictor.pose_time_s
        if self._descent is None:
            height_m = 0.0 if motion is None else float(motion.position_world_m[2]) - (self._ground_m or 0.0)
            self._descent = Descent(now_s, self._hover_n, height_m, self._setup.gravity_m_s2)
        return self._descent.force_and_rate(now_s, self._firmware.state, motion)

    def _send(self, stage: Stage, force_n: float, rate_body_rad_s: FloatArray) -> None:
        setup = self._setup
        throttle = setup.thrust.throttle(force_n, self._firmware.state.battery_v) if force_n > 0.0 else 0.0
        channels = [*setup.profile.pulses_us(rate_body_rad_s, throttle), *[_DISARM_US] * (CHANNELS - 4)]
        if setup.by_msp_alone and stage in (Stage.FOLLOWING, Stage.DESCENDING):
            channels[setup.arm_channel] = setup.arm_us
        self._firmware.sticks(tuple(channels))
        self._firmware.ask()

    def _tell(self, now_s: float, stage: Stage, seen: Seen) -> None:
        state = self._firmware.state
        status = GuardStatus(
            stage, self._ladder.reason, state.armed, seen.sticks_ours, now_s, state.heard_s, state.battery_v,
            state.motors, state.arming_flags, tuple(self._new_poses),
        )  # fmt: skip
        with contextlib.suppress(OSError):  # a full or closed socket is the planner's loss
            self._planner.send(status.pack())


def run(setup: Setup, planner: socket.socket) -> None:
    """Guard one flight to its end."""
    poses = UdpPoses(setup.pose_host, setup.pose_port, delay_s=setup.pose_delay_s)
    line = byte_line.connect(setup.address)
    clock: Clock = WallClock()
    if setup.clock_port:
        clock = SteppedClock(setup.clock_port, introduction=struct.pack("<H", poses.address[1]))
    planner.setblocking(False)
    guard = Guard(setup, Firmware(line), poses, planner)
    due_s = now_s = clock.now_s()
    try:
        while guard.tick(now_s):
            if clock.stepped:
                guard.wait_for_planner()
            due_s = max(due_s + setup.period_s, now_s)
            now_s = clock.sleep_until(due_s)
    finally:
        line.close()
        poses.close()


def main() -> None:
    """The process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the planner, which lands
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    setup = Setup.from_json(sys.argv[1])
    with socket.socket(fileno=int(sys.argv[2])) as planner:
        try:
            run(setup, planner)
        except LinkError as error:
            sys.exit(f"guard: {error}")


if __name__ == "__main__":
    main()
