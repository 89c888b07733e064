"""A simulated body for Betaflight's real firmware: it keeps the clock, feels the motors, and sends its poses."""

import contextlib
import select
import socket
import struct
import tempfile
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from firmware_bridge.betaflight_sitl import process
from firmware_bridge.betaflight_sitl.process import Sitl, StalledError
from firmware_bridge.offboard import clock
from firmware_bridge.offboard.poses import Pose, tum_line
from firmware_bridge.sitl_vehicle import PlantLike
from flight import FloatArray, LinkError, rotations

STEP_S = 2e-3
BEGIN_S = 1.0
"""The body's clock at the start."""
MOST_STALLS = 3
"""Of the lock step as it begins, in one flight."""
ESC_STEPS = 1
"""From an output to the rotors' answer."""
NED_FRD = np.array([1.0, 1.0, -1.0, -1.0])
"""The simulator's firmware mirrors the attitude that it is given before it levels by it: with a quaternion in our axes
its own angle mode, its failsafe and MSP_ATTITUDE have pitch and yaw turned round. Only its log wants ours."""
_GYRO_RAD_S, _ACCELEROMETER_M_S2 = 0.01, 0.1
ADDRESS = f"betaflight:tcp://{process.HOST}:{process.CLI_PORT}"
SETTINGS = (
    "aux 0 0 0 1700 2100 0 0",  # the first switch arms
    "set rates_type = ACTUAL",
    *(f"set {axis}_{name} = {value}" for axis in ("roll", "pitch", "yaw") for name, value in
      (("rc_rate", 100), ("srate", 100), ("expo", 0))),
    "set thr_expo = 0", "set throttle_boost = 0", "set rc_smoothing = OFF", "set serial_update_rate_hz = 1000",
    "set failsafe_procedure = AUTO-LAND", "set failsafe_delay = 3",
)  # fmt: skip
"""What the how-to page tells the user to set."""


class GivenUpError(LinkError):
    """The flight was given up before it began: why, another knows."""


@dataclass(frozen=True, slots=True)
class Tracking:
    """The motion capture of the simulated body."""

    period_s: float = 0.01
    delay_s: float = 0.01
    position_std_m: float = 0.0005
    attitude_std_rad: float = 0.001


@dataclass(slots=True)
class Body:
    """One flight of one body; `run` until its other side is gone and it lies on the ground."""

    plant: PlantLike
    full_rad_s: float
    """Rotor speed at full output."""
    rotor_of_motor: tuple[int, int, int, int] = (0, 1, 2, 3)
    """Which of the plant's rotors motors 1 to 4 turn."""
    tracking: Tracking = field(default_factory=Tracking)
    seed: int = 0
    each_step: Callable[["Body", Sitl], None] | None = None
    """Called before every step, e.g. for a pilot's sticks or a fault."""
    change_pose: Callable[[float, Pose], Pose | None] | None = None
    """What becomes of a pose that is sent; None: it is lost."""
    on_ready: Callable[[], None] | None = None
    """Called when settings can be read and the clock's port answers."""
    time_s: float = BEGIN_S
    settings: Sequence[str] = SETTINGS
    clock_port: int = 0
    """Once it runs."""
    given_up: bool = False
    """Set while nobody keeps time with it yet: nobody will."""
    way: list[tuple[float, FloatArray]] = field(default_factory=list)
    """Time and true position, (3,) of the world, at every step."""
    sent: list[Pose] = field(default_factory=list)
    """Every pose, as a recorder beside the tracking system has them."""
    fastest_down_m_s: float = 0.0
    """Sink of the last instant above the ground."""

    def run(self, *, folder: Path | None = None, longest_s: float = 600.0, after_s: float = 0.5) -> None:
        """
        Raises:
            LinkError: the firmware ended, or the flight was given up before it began.
            UnavailableError: there is no firmware here.
        """
        with contextlib.ExitStack() as stack:
            stack.enter_context(process.alone())
            own = folder or Path(stack.enter_context(tempfile.TemporaryDirectory()))
            process.configure(own, self.settings)
            server = stack.enter_context(socket.create_server(("127.0.0.1", self.clock_port)))
            self.clock_port = server.getsockname()[1]
            firmware, guard = self._met(stack, own, server)
            self._fly(firmware, guard, longest_s, after_s)

    def _met(self, stack: contextlib.ExitStack, folder: Path, server: socket.socket) -> tuple[Sitl, socket.socket]:
        """The firmware, started again as often as its command line is left, and who keeps time with it.

        One that stalls as its lock step begins is started again too: the guard's line finds the next one.

        Raises:
            StalledError: it stalled so `MOST_STALLS` times.
            LinkError: it was given up, or who keeps time with it is gone.
        """
        guard: socket.socket | None = None
        stalls = 0
        while not self.given_up and stalls < MOST_STALLS:
            if guard is not None and _gone(guard):
                raise LinkError("the guard was gone before Betaflight's lock step began")
            with contextlib.ExitStack() as once:
                firmware = once.enter_context(process.flying(folder))
                if self.on_ready is not None and guard is None:
                    self.on_ready()
                while firmware.runs and not self.given_up and guard is None:
                    if select.select([server], [], [], 0.05)[0]:
                        guard = stack.enter_context(server.accept()[0])
                if guard is not None and firmware.begins():
                    stack.push(once.pop_all())
                    return firmware, guard
                stalls += guard is not None
        if stalls == MOST_STALLS:
            raise StalledError(f"the lock step of Betaflight's SITL stalled {stalls} times as it began: fly it again")
        raise GivenUpError("given up before it began")

    def _fly(self, firmware: Sitl, guard: socket.socket, longest_s: float, after_s: float) -> None:
        rng = np.random.default_rng(self.seed)
        (pose_port,) = struct.unpack("<H", guard.recv(2, socket.MSG_WAITALL))
        out = socket.socket(type=socket.SOCK_DGRAM)
        late: deque[tuple[float, Pose]] = deque()
        outputs = deque([np.zeros(4)] * ESC_STEPS)
        wakes_s: float | None = clock.asked_until(guard)
        gone_s, steps = 0.0, 0
        with out:
            while self.time_s < longest_s and not (wakes_s is None and gone_s > after_s):
                if self.each_step is not None:
                    self.each_step(self, firmware)
                self._see(late, steps, rng)
                while late and late[0][0] <= self.time_s:
                    out.sendto(tum_line(late.popleft()[1]), ("127.0.0.1", pose_port))
                while wakes_s is not None and wakes_s <= self.time_s + 1e-9:
                    clock.wake(guard, self.time_s)
                    wakes_s = clock.asked_until(guard)
                gone_s += STEP_S if wakes_s is None else 0.0
                self._step(firmware, outputs, rng)
                steps += 1

    def _see(self, late: deque[tuple[float, Pose]], steps: int, rng: np.random.Generator) -> None:
        tracking = self.tracking
        due, before = (int(count * STEP_S / tracking.period_s + 1e-9) for count in (steps, steps - 1))
        if steps and due == before:
            return
        turned = rotations.exp(tracking.attitude_std_rad * rng.standard_normal(3))
        position = self.plant.position_world_m + tracking.position_std_m * rng.standard_normal(3)
        pose = Pose(self.time_s, position, rotations.multiply(self.plant.q_world_body, turned))
        changed = self.change_pose(self.time_s, pose) if self.change_pose is not None else pose
        if changed is not None:
            self.sent.append(changed)
            late.append((self.time_s + tracking.delay_s, changed))

    def _step(self, firmware: Sitl, outputs: deque[FloatArray], rng: np.random.Generator) -> None:
        plant = self.plant
        firmware.step(
            self.time_s,
            rate_body_rad_s=plant.rate_body_rad_s + _GYRO_RAD_S * rng.standard_normal(3),
            specific_force_body_m_s2=plant.specific_force_body_m_s2 + _ACCELEROMETER_M_S2 * rng.standard_normal(3),
            q_world_body=plant.q_world_body * NED_FRD,
            position_world_m=plant.position_world_m,
            velocity_world_m_s=plant.velocity_world_m_s,
        )
        command = np.zeros(4)
        command[list(self.rotor_of_motor)] = self.full_rad_s * outputs.popleft()
        outputs.append(firmware.outputs)
        before_m_s = float(plant.velocity_world_m_s[2])
        plant.step(command, STEP_S)
        if before_m_s < -0.05 and float(plant.velocity_world_m_s[2]) > 0.5 * before_m_s:  # stopped within a step
            self.fastest_down_m_s = max(self.fastest_down_m_s, -before_m_s)
        self.time_s += STEP_S
        self.way.append((self.time_s, plant.position_world_m.copy()))


def _gone(line: socket.socket) -> bool:
    """Whether its other side has closed it."""
    readable, _, _ = select.select([line], [], [], 0.0)
    with contextlib.suppress(ConnectionError):
        return bool(readable) and not line.recv(1, socket.MSG_PEEK)
    return True
