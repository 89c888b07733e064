"""A simulated Crazyflie: not its firmware, but what its sources say at the line, flying a point that follows its plans.

It shares no code with the bridge: trajectory memory, planner, supervisor and log blocks are written here once more.
Time is simulated, or by UDP that of the machine.
"""

import math
import random
import socket
import struct
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field

TICK_S = 0.01
EBUSY, ENOENT, ENOEXEC, EIO = 16, 2, 8, 5
U8, U16, I8, I16, FLOAT = 1, 2, 4, 5, 7
TYPES = {
    "stateEstimate.x": FLOAT, "stateEstimate.y": FLOAT, "stateEstimate.z": FLOAT, "stateEstimate.vx": FLOAT,
    "stateEstimate.vy": FLOAT, "stateEstimate.vz": FLOAT, "stateEstimate.qw": FLOAT, "stateEstimate.qx": FLOAT,
    "stateEstimate.qy": FLOAT, "stateEstimate.qz": FLOAT, "stateEstimateZ.rateRoll": I16,
    "stateEstimateZ.ratePitch": I16, "stateEstimateZ.rateYaw": I16, "radio.rssi": U8, "motor.m1": U16,
    "motor.m2": U16, "motor.m3": U16, "motor.m4": U16, "pm.vbat": FLOAT, "pm.state": I8, "ctrltarget.x": FLOAT,
    "ctrltarget.y": FLOAT, "ctrltarget.z": FLOAT, "kalman.varPX": FLOAT, "kalman.varPY": FLOAT, "kalman.varPZ": FLOAT,
    "supervisor.info": U16,
}  # fmt: skip
CODES = {U8: "B", U16: "H", I8: "b", I16: "h", FLOAT: "f"}


@dataclass
class Piece:
    """Where a plan is at a time."""

    begin_s: float
    pieces: list[tuple[float, list[list[float]]]]
    """Durations and coefficients of x, y, z, yaw, ascending."""
    ends: str = "hover"

    def at(self, time_s: float) -> list[float]:
        left_s = max(time_s - self.begin_s, 0.0)
        for duration_s, axes in self.pieces:
            if left_s <= duration_s or (duration_s, axes) == self.pieces[-1]:
                u = min(left_s, duration_s)
                return [sum(c * u**i for i, c in enumerate(axis)) for axis in axes]
            left_s -= duration_s
        raise AssertionError

    def over(self, time_s: float) -> bool:
        return time_s - self.begin_s > sum(duration_s for duration_s, _ in self.pieces)


def smooth(begin: list[float], end: list[float], duration_s: float) -> list[tuple[float, list[list[float]]]]:
    """From rest to rest, of degree 5."""
    T = duration_s
    return [
        (T, [[a, 0, 0, 10 * (b - a) / T**3, -15 * (b - a) / T**4, 6 * (b - a) / T**5]
             for a, b in zip(begin, end, strict=True)])
    ]  # fmt: skip


@dataclass
class SimulatedCrazyflie:
    """One; `take` packets, `tick` time."""

    position_m: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    yaw_rad: float = 0.0
    auto_arms: bool = False
    can_be_armed: bool = True
    battery_v: float = 4.1
    power: int = 0
    variance_m2: float = 1e-5
    extra_bits: int = 0
    damaged_write: int | None = None
    """Address of a byte that its memory does not keep."""
    missing: frozenset[str] = frozenset()
    time_s: float = 100.0
    each_tick: Callable[["SimulatedCrazyflie"], None] | None = None
    deaf: bool = False
    refuses: dict[int, int] = field(default_factory=dict)
    """Answers of the commander, by command."""
    armed: bool = False
    emergency: bool = False
    commands: list[int] = field(default_factory=list)
    memory: bytearray = field(default_factory=lambda: bytearray(4096))
    definitions: dict[int, tuple[int, int]] = field(default_factory=dict)
    plan: Piece | None = None
    off_m: float = 0.0
    """Pushed aside."""
    way: list[tuple[float, tuple[float, float, float]]] = field(default_factory=list)
    dropped: bool = False
    """The rotors stopped in the air."""
    fastest_down_m_s: float = 0.0

    def __post_init__(self) -> None:
        self.names = [name for name in TYPES if name not in self.missing]
        self.blocks: dict[int, tuple[list[int], int]] = {}
        self.target = list(self.position_m)
        self.velocity = [0.0, 0.0, 0.0]
        self._noise = random.Random(1)
        self._log: list[bytes] = []

    @property
    def bits(self) -> int:
        flying = self.plan is not None
        return (
            (1 if self.can_be_armed else 0) | (2 if self.armed else 0) | (4 if self.auto_arms else 0)
            | (8 if self.armed or self.auto_arms else 0) | (16 if flying else 0) | self.extra_bits
        )  # fmt: skip

    # packets

    def take(self, raw: bytes) -> list[bytes]:
        """The answers."""
        if self.deaf:
            return []
        if raw == b"\xff":
            return [b"\xff"]
        port, channel, data = raw[0] >> 4, raw[0] & 3, raw[1:]
        handler = {4: self._memory, 5: self._logging, 8: self._commander, 9: self._supervisor}.get(port)
        answer = handler(channel, data) if handler else None
        return [bytes([port << 4 | 0x0C | channel]) + answer] if answer is not None else []

    def _memory(self, channel: int, data: bytes) -> bytes | None:
        if channel == 0 and data[0] == 1:
            return bytes([1, 3])
        if channel == 0 and data[0] == 2:
            kind, size = ((0, 112), (0x10, 24), (0x12, 4096))[data[1]]
            return bytes([2, data[1], kind]) + struct.pack("<I", size) + bytes(8)
        memory, at = struct.unpack_from("<BI", data)
        if channel == 1:
            size = data[5]
            if memory != 2 or at + size > len(self.memory):
                return data[:5] + bytes([EIO])
            return data[:5] + b"\0" + bytes(self.memory[at : at + size])
        content = data[5:]
        if memory != 2 or at + len(content) > len(self.memory):
            return data[:5] + bytes([EIO])
        self.memory[at : at + len(content)] = content
        if self.damaged_write is not None and at <= self.damaged_write < at + len(content):
            self.memory[self.damaged_write] ^= 0x10
        return data[:5] + b"\0"

    def _logging(self, channel: int, data: bytes) -> bytes | None:
        if channel == 0 and data[0] == 3:
            return struct.pack("<BHIBB", 3, len(self.names), 0x1234, 16, 128)
        if channel == 0 and data[0] == 2:
            (index,) = struct.unpack_from("<H", data, 1)
            if index >= len(self.names):
                return bytes([2])
            group, name = self.names[index].split(".")
            kind = bytes([TYPES[self.names[index]]])
            return data[:3] + kind + group.encode() + b"\0" + name.encode() + b"\0"
        done = 0
        if data[0] == 5:
            self.blocks.clear()
        elif data[0] == 6:
            variables = [struct.unpack_from("<BH", data, i)[1] for i in range(2, len(data), 3)]
            size = sum(struct.calcsize(CODES[TYPES[self.names[v]]]) for v in variables)
            done = 7 if size > 26 else 0
            self.blocks[data[1]] = (variables, 0)
        elif data[0] == 8:
            self.blocks[data[1]] = (self.blocks[data[1]][0], struct.unpack_from("<H", data, 2)[0])
        return data[:1] + data[1:2].ljust(1, b"\0") + bytes([done])

    def _supervisor(self, channel: int, data: bytes) -> bytes | None:
        if channel == 0:
            return bytes([0x80 | data[0]]) + struct.pack("<H", self.bits) if data[0] == 0x0C else None
        if data[0] == 1:
            self.armed = bool(data[1]) and self.can_be_armed
            return bytes([0x81, self.armed == bool(data[1]), self.armed])
        if data[0] == 3:
            self._stop()
            self.emergency = True
            self.extra_bits |= 64
        return None

    def _stop(self) -> None:
        self.dropped |= self.plan is not None and self.position_m[2] > 0.15
        self.plan = None

    def _commander(self, channel: int, data: bytes) -> bytes:
        command = data[0]
        self.commands.append(command)
        done = self.refuses.get(command, 0)
        if not done:
            done = self._commanded(command, data[1:])
        return data[:3].ljust(3, b"\0") + bytes([done])

    def _commanded(self, command: int, data: bytes) -> int:
        here = [*self.target, self.yaw_rad] if self.plan else [*self.position_m, self.yaw_rad]
        if command in (7, 8, 12, 13) and not (self.armed or self.auto_arms):
            return EBUSY
        if command in (7, 8):
            _, height_m, yaw, keep, duration_s = struct.unpack("<BffBf", data)
            end = [here[0], here[1], height_m, here[3] if keep else yaw]
            self.plan = Piece(self.time_s, smooth(here, end, duration_s), "hover" if command == 7 else "stop")
        elif command == 12:
            _, relative, _, *end, duration_s = struct.unpack("<BBB5f", data)
            assert not relative
            self.plan = Piece(self.time_s, smooth(here, end, duration_s))
        elif command == 6:
            number, place, kind, offset, count = struct.unpack("<BBBIB", data)
            if number >= 10 or place != 1 or kind != 0:
                return ENOEXEC
            self.definitions[number] = (offset, count)
        elif command == 13:
            _, _, _, _, number, scale = struct.unpack("<5Bf", data)
            if number not in self.definitions or scale != 1.0:
                return ENOENT
            self.plan = Piece(self.time_s, self._stored(*self.definitions[number]))
        elif command == 3:
            self._stop()
        return 0

    def _stored(self, offset: int, count: int) -> list[tuple[float, list[list[float]]]]:
        found = []
        for i in range(count):
            values = struct.unpack_from("<33f", self.memory, offset + 132 * i)
            found.append((values[32], [list(values[8 * axis : 8 * axis + 8]) for axis in range(4)]))
        return found

    # time

    def tick(self) -> list[bytes]:
        """A hundredth of a second; the log blocks that are due."""
        self.time_s += TICK_S
        if self.each_tick is not None:
            self.each_tick(self)
        before = list(self.position_m)
        if self.plan is not None:
            *self.target, self.yaw_rad = self.plan.at(self.time_s)
            share = 1.0 - math.exp(-TICK_S / 0.03)
            for i in range(3):
                aim = self.target[i] + (self.off_m if i == 0 else 0.0)
                self.position_m[i] += share * (aim - self.position_m[i])
            if self.plan.ends == "stop" and self.plan.over(self.time_s):
                self._stop()
        else:
            self.position_m[2] = max(self.position_m[2] - 9.81 * 0.02 * (self.position_m[2] > 0.0), 0.0)
            self.target = [0.0, 0.0, 0.0]
        self.velocity = [(b - a) / TICK_S for a, b in zip(before, self.position_m, strict=True)]
        if self.position_m[2] < 0.02:
            self.fastest_down_m_s = max(self.fastest_down_m_s, -self.velocity[2])
        self.way.append((self.time_s, (self.position_m[0], self.position_m[1], self.position_m[2])))
        return [] if self.deaf else self._logged()

    def _logged(self) -> list[bytes]:
        found, now_ms = [], round(1e3 * self.time_s)
        for number, (variables, period_ms) in self.blocks.items():
            if period_ms and now_ms % period_ms < 1e3 * TICK_S:
                stamp = (now_ms & 0xFFFFFF).to_bytes(3, "little")
                values = b"".join(
                    struct.pack("<" + CODES[TYPES[self.names[v]]], self._value(self.names[v])) for v in variables
                )
                found.append(bytes([5 << 4 | 0x0C | 2, number]) + stamp + values)
        return found

    def _value(self, name: str) -> float | int:
        group, _, field_name = name.partition(".")
        axis = {"x": 0, "y": 1, "z": 2}.get(field_name[-1], 0)
        if group == "stateEstimate" and field_name in "xyz":
            return self.position_m[axis] + self._noise.gauss(0.0, 0.001)
        if group == "stateEstimate" and field_name[0] == "v":
            return self.velocity[axis]
        if group == "stateEstimate":
            half = 0.5 * self.yaw_rad
            return {"qw": math.cos(half), "qz": math.sin(half)}.get(field_name, 0.0)
        if group == "ctrltarget":
            return self.target[axis]
        if group == "kalman":
            return self.variance_m2
        fixed = {"pm.vbat": self.battery_v, "pm.state": self.power, "supervisor.info": self.bits}
        if group == "motor":
            return 30000 + int(field_name[1]) if self.plan else 0
        return fixed.get(name, 0)


class SimulatedTime:
    """A transport to it in the same process: waiting lets its time pass."""

    def __init__(self, simulation: SimulatedCrazyflie) -> None:
        self._simulation, self._waiting = simulation, list[bytes]()

    def send(self, packet) -> None:
        self._waiting += self._simulation.take(packet.pack())

    def receive(self, wait_s: float):
        from firmware_bridge.crazyflie.crtp import Packet

        end_s = self._simulation.time_s + wait_s
        while not self._waiting and self._simulation.time_s < end_s - 1e-9:
            self._waiting += self._simulation.tick()
        if not self._waiting:
            self._simulation.time_s = max(self._simulation.time_s, end_s)
        raws, self._waiting = self._waiting, []
        return [packet for raw in raws if (packet := Packet.unpack(raw)) is not None]

    def rest(self, wait_s: float) -> None:
        end_s = self._simulation.time_s + wait_s
        while self._simulation.time_s < end_s - 1e-9:
            self._waiting += self._simulation.tick()

    def now_s(self) -> float:
        return self._simulation.time_s

    def close(self) -> None: ...


class UdpServer(threading.Thread):
    """It by UDP, in the machine's time."""

    def __init__(self, simulation: SimulatedCrazyflie) -> None:
        super().__init__(daemon=True)
        self.simulation, self._socket = simulation, socket.socket(type=socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.settimeout(0.002)
        self.port = self._socket.getsockname()[1]
        self.ends = False

    def run(self) -> None:
        peer, base_s, begun_s = None, self.simulation.time_s, time.monotonic()
        while not self.ends:
            try:
                raw, peer = self._socket.recvfrom(64)
                for answer in self.simulation.take(raw):
                    self._socket.sendto(answer, peer)
            except (TimeoutError, ConnectionRefusedError):
                pass
            while self.simulation.time_s - base_s < time.monotonic() - begun_s:
                for block in self.simulation.tick():
                    if peer is not None:
                        self._socket.sendto(block, peer)
        self._socket.close()
