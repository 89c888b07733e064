"""Requests to a Crazyflie and their answers: its supervisor, its high-level commander, its trajectory memory.

Numbers and layouts are the firmware's (modules crtp_supervisor, crtp_commander_high_level, crtp_mem); no code of it or
of its library, both GPL-3, is used.
"""

import os
import struct
from collections.abc import Callable, Iterator
from enum import IntFlag

from firmware_bridge.crazyflie.crtp import Packet, Transport
from flight import LinkError

MEMORY, LOG, COMMANDER, SUPERVISOR = 4, 5, 8, 9
"""Ports."""
_TRAJECTORY_MEMORY = 0x12
_CHUNK = 24
"""Bytes of memory in a packet."""
_ANSWER_S, _TRIES = 0.25, 8
_ARM, _EMERGENCY_STOP, _STATE = 0x01, 0x03, 0x0C
_ANSWERS = 0x80
_STOP, _DEFINE, _TAKE_OFF, _LAND, _GO_TO, _START = 3, 6, 7, 8, 12, 13
TRAJECTORY = 1
"""Id under which ours is defined."""


class Bits(IntFlag):
    """Of the supervisor."""

    CAN_BE_ARMED = 1
    ARMED = 2
    AUTO_ARMED = 4
    CAN_FLY = 8
    FLYING = 16
    TUMBLED = 32
    LOCKED = 64
    CRASHED = 128
    COMMANDER_ACTIVE = 256
    TRAJECTORY_FINISHED = 512
    COMMANDER_DISABLED = 1024
    DECK_FAULT = 2048


LOST = Bits.TUMBLED | Bits.LOCKED | Bits.CRASHED


class Client:
    """One Crazyflie."""

    def __init__(self, transport: Transport) -> None:
        self._transport = transport
        self.on_log: Callable[[bytes], None] = lambda _: None
        """Takes every block of logged values."""
        self.on_pump: Callable[[], None] = lambda: None
        """Called at every wait; what it raises ends the wait."""
        self.heard_s = -float("inf")
        """When it was last heard."""

    @property
    def now_s(self) -> float:
        return self._transport.now_s()

    def pump(self, wait_s: float) -> list[Packet]:
        """What has come within a time, the logged values apart."""
        self.on_pump()
        found: list[Packet] = []
        for packet in self._transport.receive(wait_s):
            self.heard_s = self.now_s
            if (packet.port, packet.channel) == (LOG, 2):
                self.on_log(packet.data)
            else:
                found.append(packet)
        return found

    def rest(self, wait_s: float) -> None:
        """Wait, also on a line that is broken; without a new try."""
        self._transport.rest(wait_s)

    def ask(self, port: int, channel: int, data: bytes, *, answer: bytes, what: str) -> bytes:
        """Send until it answers.

        Args:
            answer: how the answer begins.

        Raises:
            LinkError: it does not.
        """
        for _ in range(_TRIES):
            self._transport.send(Packet(port, channel, data))
            end_s = self.now_s + _ANSWER_S
            while (left_s := end_s - self.now_s) > 0.0:
                for packet in self.pump(left_s):
                    if (packet.port, packet.channel) == (port, channel) and packet.data.startswith(answer):
                        return packet.data
        raise LinkError(f"the Crazyflie does not answer: {what}")

    # supervisor

    def bits(self) -> Bits:
        """
        Raises:
            LinkError: it does not answer: a firmware before 2025 has no such port.
        """
        request = bytes([_STATE])
        data = self.ask(SUPERVISOR, 0, request, answer=bytes([_ANSWERS | _STATE]), what="its state; is it updated?")
        return Bits(int.from_bytes(data[1:3], "little"))

    def arm(self, *, on: bool) -> bool:
        """Arm or disarm; whether it did."""
        data = self.ask(
            SUPERVISOR, 1, bytes([_ARM, on]), answer=bytes([_ANSWERS | _ARM]), what="arming" if on else "disarming"
        )
        return data[2:3] == bytes([on])

    def emergency_stop(self) -> None:
        """Rotors off, at once; it is locked until it is switched off. Sent several times, as it is not answered."""
        for _ in range(5):
            self._transport.send(Packet(SUPERVISOR, 1, bytes([_EMERGENCY_STOP])))

    # high-level commander

    def take_off(self, height_m: float, duration_s: float) -> None:
        """To a height of the world, its yaw kept."""
        self._command("take-off", _TAKE_OFF, struct.pack("<BffBf", 0, height_m, 0.0, 1, duration_s))

    def land(self, height_m: float, duration_s: float) -> None:
        self._command("landing", _LAND, struct.pack("<BffBf", 0, height_m, 0.0, 1, duration_s))

    def go_to(self, x_m: float, y_m: float, z_m: float, yaw_rad: float, duration_s: float) -> None:
        self._command(
            "the way to the start", _GO_TO, struct.pack("<BBB5f", 0, 0, 0, x_m, y_m, z_m, yaw_rad, duration_s)
        )

    def define(self, pieces: int) -> None:
        """The polynomials at the beginning of its memory are the trajectory."""
        self._command("the trajectory", _DEFINE, struct.pack("<BBBIB", TRAJECTORY, 1, 0, 0, pieces))

    def start(self) -> None:
        """The trajectory as it is, in the world."""
        self._command("the trajectory's start", _START, struct.pack("<5Bf", 0, 0, 0, 0, TRAJECTORY, 1.0))

    def stop(self) -> None:
        """Rotors off, on the ground."""
        self._command("the stop", _STOP, bytes([0]))

    def _command(self, what: str, command: int, payload: bytes) -> None:
        """
        Raises:
            LinkError: it refuses, or does not answer.
        """
        sent = bytes([command]) + payload
        data = self.ask(COMMANDER, 0, sent, answer=sent[:3], what=what)
        if len(data) >= 4 and data[3]:
            raise LinkError(f"the Crazyflie refuses {what}: {os.strerror(data[3])} ({data[3]})")

    # trajectory memory

    def upload(self, content: bytes) -> bytes:
        """Write the trajectory memory, and read it back.

        Raises:
            LinkError: there is none, it is too small, or a piece of it is refused.
        """
        memory, size = self._trajectory_memory()
        if len(content) > size:
            raise LinkError(f"the Crazyflie's trajectory memory has {size} bytes; {len(content)} are needed")
        for at, piece in _chunks(content):
            head = struct.pack("<BI", memory, at)
            done = self.ask(MEMORY, 2, head + piece, answer=head, what=f"writing {len(piece)} bytes at {at}")
            if done[5:6] != b"\0":
                raise LinkError(f"the Crazyflie refuses to write {len(piece)} bytes at {at} of its trajectory memory")
        held = b""
        for at, piece in _chunks(content):
            head = struct.pack("<BI", memory, at)
            data = self.ask(MEMORY, 1, head + bytes([len(piece)]), answer=head, what=f"reading {len(piece)} bytes")
            if data[5:6] != b"\0":
                raise LinkError(f"the Crazyflie refuses to read {len(piece)} bytes at {at} of its trajectory memory")
            held += data[6 : 6 + len(piece)]
        return held

    def _trajectory_memory(self) -> tuple[int, int]:
        count = self.ask(MEMORY, 0, b"\x01", answer=b"\x01", what="its memories")[1]
        for memory in range(count):
            info = self.ask(MEMORY, 0, bytes([2, memory]), answer=bytes([2, memory]), what=f"memory {memory}")
            if len(info) >= 7 and info[2] == _TRAJECTORY_MEMORY:
                return memory, int.from_bytes(info[3:7], "little")
        raise LinkError(
            "the Crazyflie has no trajectory memory; its firmware is built without the high-level commander"
        )


def _chunks(content: bytes) -> Iterator[tuple[int, bytes]]:
    return ((at, content[at : at + _CHUNK]) for at in range(0, len(content), _CHUNK))
