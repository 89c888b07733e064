"""Betaflight's SITL as a program of its own: its settings by CLI, then a body's state in and motors out by UDP.

It runs in lock step (`lockstep_clock.c`): each step it gets one packet of what its sensors feel, runs to the end of
the step, and answers with the motors' outputs.
"""

import contextlib
import fcntl
import os
import signal
import socket
import struct
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from firmware_bridge.betaflight_sitl import firmware
from flight import FloatArray, InputError, LinkError

HOST = "127.0.0.1"
CLI_PORT, MOTOR_PORT, STATE_PORT, RC_PORT = 5761, 9002, 9003, 9004
STATE, CHANNELS, OUTPUTS = struct.Struct("<18d"), struct.Struct("<d16H"), struct.Struct("<4f")
IN_PACKET = (3, 0, 1, 2)
"""Where motors 1 to 4 are in a packet of outputs."""
NORMAL_PRESSURE_PA, SCALE_HEIGHT_M = 101325.0, 8434.0
PATIENCE_S = 600.0
"""Of this machine's clock; a loaded one may take a hundred times as long as an idle one."""
STEP_PATIENCE_S, BEGIN_PATIENCE_S = 30.0, 10.0
"""Of one step, which takes a millisecond on an idle machine; the lock step may stall, rarely, as it begins."""
FIRST_S = (0.4, *(0.5 + 2e-3 * i for i in range(25)))
"""Stamps of the packets that begin the lock step. From packets less than 20 ms apart the firmware takes the rate of its
clock, and of the first one it knows no time: the second comes later, and a flight begins later than the last."""
FLU_TO_FRD = np.array([1.0, -1.0, -1.0])
AT_REST = {
    "rate_body_rad_s": np.zeros(3),
    "specific_force_body_m_s2": np.array([0.0, 0.0, 9.80665]),
    "q_world_body": np.array([1.0, 0.0, 0.0, 0.0]),
    "position_world_m": np.zeros(3),
    "velocity_world_m_s": np.zeros(3),
}


@contextlib.contextmanager
def alone() -> Iterator[None]:
    """Its ports are fixed: one firmware at a time on a machine."""
    firmware.cache().mkdir(parents=True, exist_ok=True)
    with open(firmware.cache() / "ports", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def configure(folder: Path, settings: Sequence[str]) -> str:
    """Write settings into the firmware's memory, a file in `folder`; what `diff all` says of them.

    Raises:
        InputError: the firmware refuses a line.
        LinkError: it does not answer.
        UnavailableError: there is no firmware here.
    """
    with _running(folder) as process, _connected(process) as line:
        said = _answer(line, "#")
        if "Entering CLI" not in said:
            raise LinkError(f"Betaflight's command line did not open; it said {said.strip()!r}")
        line.sendall(b"\n")  # the first command is lost
        for setting in settings:
            said = _answer(line, f"{setting}\n")
            if "###ERROR" in said or "INVALID" in said.upper():
                raise InputError(f"Betaflight refuses `{setting}`: {said.strip()}")
        listed = _answer(line, "diff all\n")
        line.sendall(b"save\n")  # it restarts, which here is its end
        process.wait(PATIENCE_S)
    return listed.partition("\n")[2].rpartition("\n")[0].replace("\r", "")


class StalledError(LinkError):
    """The firmware lives and answers no more."""


class Sitl:
    """The firmware in flight; `step` is one step of its body's clock."""

    def __init__(self, motors: socket.socket, out: socket.socket, process: subprocess.Popen[bytes]) -> None:
        self._motors, self._out, self._process, self._begun = motors, out, process, False
        self.outputs = np.zeros(4)
        """Of motors 1 to 4, 0 to 1."""

    @property
    def runs(self) -> bool:
        """Whether its process lives."""
        return self._process.poll() is None

    def begins(self) -> bool:
        """Begin the lock step, at rest. False: it has stalled, and only another firmware helps.

        Raises:
            LinkError: the firmware ended.
        """
        self._begun = True
        self._motors.settimeout(BEGIN_PATIENCE_S)
        try:
            for stamp_s in FIRST_S:
                self.step(stamp_s, **AT_REST)
        except StalledError:
            return False
        finally:
            self._motors.settimeout(STEP_PATIENCE_S)
        return True

    def step(
        self,
        time_s: float,
        *,
        rate_body_rad_s: FloatArray,
        specific_force_body_m_s2: FloatArray,
        q_world_body: FloatArray,
        position_world_m: FloatArray,
        velocity_world_m_s: FloatArray,
    ) -> None:
        """Feel this until the next step, and set the motors. The first one begins the lock step.

        Raises:
            LinkError: the firmware ended.
            StalledError: it answers no more.
        """
        if not self._begun and not self.begins():
            raise StalledError("the lock step of Betaflight's SITL stalled as it began: fly it again")
        pressure_pa = NORMAL_PRESSURE_PA * float(np.exp(-position_world_m[2] / SCALE_HEIGHT_M))
        motion = (*q_world_body, *velocity_world_m_s, *position_world_m, pressure_pa)
        packet = STATE.pack(time_s, *(rate_body_rad_s * FLU_TO_FRD), *(-specific_force_body_m_s2), *motion)
        self._out.sendto(packet, (HOST, STATE_PORT))
        try:
            values = OUTPUTS.unpack(self._motors.recv(64))
        except TimeoutError:
            if (ended := self._process.poll()) is not None:
                raise LinkError(f"no motor outputs at {time_s:.3f} s; Betaflight's SITL ended with {ended}") from None
            raise StalledError(f"no motor outputs at {time_s:.3f} s; its lock step stalled: fly it again") from None
        self.outputs = np.clip([values[i] for i in IN_PACKET], 0.0, 1.0)

    def sticks(self, time_s: float, channels: Sequence[float]) -> None:
        """Receiver's pulses in microseconds: roll, pitch, throttle, yaw, switches; those not given rest at 1000."""
        pulses = [*(round(c) for c in channels), *[1000] * (16 - len(channels))]
        self._out.sendto(CHANNELS.pack(time_s, *pulses), (HOST, RC_PORT))


@contextlib.contextmanager
def flying(folder: Path) -> Iterator[Sitl]:
    """The firmware with the settings in `folder`, where it also writes its logs."""
    with socket.socket(type=socket.SOCK_DGRAM) as motors, socket.socket(type=socket.SOCK_DGRAM) as out:
        motors.bind((HOST, MOTOR_PORT))
        motors.settimeout(STEP_PATIENCE_S)
        said = (folder / "said.txt").stat().st_size
        with _running(folder) as process:
            _until(lambda: b"[lock step] ready" in (folder / "said.txt").read_bytes()[said:], process)
            yield Sitl(motors, out, process)


@contextlib.contextmanager
def _running(folder: Path) -> Iterator[subprocess.Popen[bytes]]:
    program, environment = firmware.program(), {**os.environ, "LD_PRELOAD": str(firmware.clock())}
    with open(folder / "said.txt", "ab") as said:
        process = subprocess.Popen([program], cwd=folder, stdout=said, stderr=said, env=environment)
        try:
            yield process
        finally:
            process.send_signal(signal.SIGKILL)
            process.wait()


@contextlib.contextmanager
def _connected(process: subprocess.Popen[bytes]) -> Iterator[socket.socket]:
    """A connection to the CLI, as soon as it listens."""
    line: list[socket.socket] = []

    def tried() -> bool:
        with contextlib.suppress(OSError):
            line.append(socket.create_connection((HOST, CLI_PORT), timeout=30.0))
        return bool(line)

    _until(tried, process)
    with line[0]:
        yield line[0]


def _until(condition: Callable[[], bool], process: subprocess.Popen[bytes]) -> None:
    """Return as soon as the condition holds.

    Raises:
        LinkError: the firmware ended, or patience did.
    """
    end_s = time.monotonic() + PATIENCE_S
    while not condition():
        if process.poll() is not None or time.monotonic() > end_s:
            raise LinkError(f"Betaflight's SITL did not start (exit {process.poll()}); is another one running?")
        time.sleep(0.05)


def _answer(line: socket.socket, command: str) -> str:
    """What the CLI says until it asks for more."""
    line.sendall(command.encode())
    said, end_s = b"", time.monotonic() + PATIENCE_S
    while not said.endswith(b"\n# ") and time.monotonic() < end_s:
        said += line.recv(1 << 16)
    return said.decode("ascii", "replace")
