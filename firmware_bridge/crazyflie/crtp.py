"""CRTP packets to a Crazyflie, one a datagram, on this machine.

That is the form of `udp://` in Bitcraze's library and simulators: a header of port and channel, then up to 30 bytes.
"""

import contextlib
import select
import socket
import time
from dataclasses import dataclass
from typing import Protocol
from urllib.parse import urlsplit

from firmware_bridge.port import is_loopback
from flight import InputError, LinkError

PREFIX = "crazyflie:"
MOST_BYTES = 30
_HELLO = bytes([0xFF])
"""The null packet: it tells the other side where we are."""
_FORM = "crazyflie:udp://127.0.0.1:19850"


@dataclass(frozen=True, slots=True)
class Packet:
    """One."""

    port: int
    channel: int
    data: bytes = b""

    def pack(self) -> bytes:
        """
        Raises:
            ValueError: it is too long, an error of the caller's.
        """
        if len(self.data) > MOST_BYTES:
            raise ValueError(f"{len(self.data)} bytes in a packet of at most {MOST_BYTES}")
        return bytes([self.port << 4 | 0x0C | self.channel]) + self.data

    @staticmethod
    def unpack(raw: bytes) -> "Packet | None":
        """None for the null packet and what is none."""
        if not 1 <= len(raw) <= 1 + MOST_BYTES or raw[0] & 0xF3 == 0xF3:
            return None
        return Packet(raw[0] >> 4, raw[0] & 3, raw[1:])


class Transport(Protocol):
    """What carries packets, and the time by which they come."""

    def send(self, packet: Packet) -> None: ...
    def receive(self, wait_s: float) -> list[Packet]:
        """What has come; nothing after `wait_s` is empty."""
        ...

    def rest(self, wait_s: float) -> None:
        """Let time pass, also where nothing can be received."""
        ...

    def now_s(self) -> float: ...
    def close(self) -> None: ...


def endpoint(address: str) -> tuple[str, int]:
    """Of `crazyflie:udp://HOST:PORT`.

    Raises:
        InputError: it is none, or not on this machine.
    """
    parts = urlsplit(address.removeprefix(PREFIX))
    if parts.scheme == "radio":
        raise InputError(
            f"{address!r}: the radio is not driven here, as the Crazyflie bridge has flown only a simulated one; "
            f"give {_FORM}, of a simulator"
        )
    try:
        if parts.scheme != "udp" or not parts.hostname or not parts.port or parts.hostname == "::1":
            raise ValueError
    except ValueError:
        raise InputError(f"{address!r} is no Crazyflie's address; give {_FORM}") from None
    if not is_loopback(parts.hostname):
        raise InputError(
            f"the Crazyflie bridge has flown only a simulated one, and {address!r} is not this machine: give {_FORM}"
        )
    return parts.hostname, parts.port


class UdpTransport:
    """Packets as datagrams."""

    def __init__(self, host: str, port: int) -> None:
        self._to = host, port
        self._socket = self._opened()
        self._write(_HELLO)

    def _opened(self) -> socket.socket:
        opened = socket.socket(type=socket.SOCK_DGRAM)
        opened.connect(self._to)
        opened.setblocking(False)
        return opened

    def _broke(self, error: Exception) -> LinkError:
        """What is said of it; the next packet goes by a new socket, if this machine gives one."""
        self._socket.close()
        with contextlib.suppress(OSError):
            self._socket = self._opened()
        return LinkError(f"the line to the Crazyflie broke: {error}")

    def send(self, packet: Packet) -> None:
        """What nobody takes is lost; a request is sent again.

        Raises:
            LinkError: the line is gone.
        """
        self._write(packet.pack())

    def _write(self, data: bytes) -> None:
        try:
            self._socket.send(data)
        except (BlockingIOError, ConnectionRefusedError):
            return
        except OSError as error:
            raise self._broke(error) from error

    def rest(self, wait_s: float) -> None:
        time.sleep(wait_s)

    def receive(self, wait_s: float) -> list[Packet]:
        try:
            select.select([self._socket], [], [], max(wait_s, 0.0))
        except (OSError, ValueError) as error:  # a closed socket has no number
            raise self._broke(error) from error
        found: list[Packet] = []
        while True:
            try:
                packet = Packet.unpack(self._socket.recv(64))
            except ConnectionRefusedError:
                continue
            except BlockingIOError:
                return found
            except OSError as error:
                raise self._broke(error) from error
            if packet is not None:
                found.append(packet)

    def now_s(self) -> float:
        return time.monotonic()

    def close(self) -> None:
        self._socket.close()
