"""A line of bytes to a flight controller, by TCP, which never blocks for long."""

import select
import socket
import time
from collections.abc import Callable
from typing import Protocol
from urllib.parse import urlsplit

from firmware_bridge.port import is_loopback
from flight import InputError, LinkError

_PREFIX = "betaflight:"
_REOPEN_S, _LEAST_S = 0.2, 0.05


class ByteLine(Protocol):
    """What carries MSP."""

    def write(self, data: bytes) -> None: ...
    def read(self, wait_s: float = 0.0) -> bytes:
        """What has come; nothing after `wait_s` is empty."""
        ...

    def close(self) -> None: ...


def connect(address: str, *, patience_s: float = 10.0) -> ByteLine:
    """A line to `betaflight:tcp://HOST:PORT`.

    Raises:
        InputError: as `parsed`.
        LinkError: nothing answers there.
    """
    where = parsed(address)
    end_s = time.monotonic() + patience_s
    while True:
        try:
            return TcpLine(socket.create_connection(where, timeout=max(patience_s, _LEAST_S)))
        except OSError as error:
            if time.monotonic() > end_s:
                raise LinkError(f"nothing answers at {address}: {error}") from error
            time.sleep(0.2)


def parsed(address: str) -> tuple[str, int]:
    """Host and port of `betaflight:tcp://HOST:PORT`.

    Raises:
        InputError: the address is none of those, or not on this machine.
    """
    parts = urlsplit(address.removeprefix(_PREFIX))
    if not address.startswith(_PREFIX) or parts.scheme not in ("tcp", "serial"):
        raise InputError(f"{address!r} is no vehicle that this can fly; give betaflight:tcp://HOST:PORT")
    if parts.scheme == "serial":
        _require_this_machine(address, "")
    try:
        port = parts.port
    except ValueError:  # no number, or too large
        port = None
    if not parts.hostname or not port:
        raise InputError(
            f"{address!r} has no host or port; Betaflight's SITL listens at betaflight:tcp://127.0.0.1:5761"
        )
    _require_this_machine(address, parts.hostname)
    return parts.hostname, port


def _require_this_machine(address: str, host: str) -> None:
    """A serial port has no host, and may be a vehicle."""
    if not is_loopback(host):
        raise InputError(
            "the Betaflight bridge has flown only the SITL; it arms nothing that may be a real vehicle, and "
            f"{address!r} is not this machine: give betaflight:tcp://127.0.0.1:5761, or --rehearse"
        )


class _Outbox:
    """What goes out through a buffer that may be full: a message is sent whole or not at all."""

    def __init__(self, send: Callable[[bytes], int]) -> None:
        """
        Args:
            send: takes bytes and says how many of them went; raises BlockingIOError when none can.
        """
        self._send, self._rest = send, b""
        self.dropped = 0
        """Messages that found the buffer full."""

    def write(self, data: bytes) -> None:
        """
        Raises:
            LinkError: the line is gone.
        """
        self._flush()
        if self._rest:
            self.dropped += 1
            return
        self._rest = data
        self._flush()

    def _flush(self) -> None:
        try:
            while self._rest:
                self._rest = self._rest[self._send(self._rest) :]
        except BlockingIOError:
            return
        except OSError as error:
            raise LinkError(f"the line to the flight controller broke: {error}") from error


class TcpLine:
    """Of a simulator, or a serial port that a network box serves."""

    def __init__(self, connected: socket.socket) -> None:
        connected.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        connected.setblocking(False)
        self._socket = connected
        self._outbox = _Outbox(connected.send)

    def write(self, data: bytes) -> None:
        self._outbox.write(data)

    def read(self, wait_s: float = 0.0) -> bytes:
        if not select.select([self._socket], [], [], wait_s)[0]:
            return b""
        try:
            data = self._socket.recv(65536)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise LinkError(f"the line to the flight controller broke: {error}") from error
        if not data:
            raise LinkError("the flight controller closed the line")
        return data

    def close(self) -> None:
        self._socket.close()


class LastingLine:
    """A line that is opened again when it breaks; meanwhile it takes what is written and reads nothing."""

    def __init__(self, line: ByteLine, again: Callable[[], ByteLine], clock: Callable[[], float] = time.monotonic):
        """
        Args:
            again: opens it, or raises LinkError; it must not take long.
        """
        self._line: ByteLine | None = line
        self._opened, self._clock = again, clock
        self._tried_s = -float("inf")
        self.broke = 0
        """How often."""

    def write(self, data: bytes) -> None:
        try:
            if line := self._now():
                line.write(data)
        except LinkError:
            self._lost()

    def read(self, wait_s: float = 0.0) -> bytes:
        try:
            line = self._now()
            return line.read(wait_s) if line else b""
        except LinkError:
            self._lost()
            return b""

    def close(self) -> None:
        if self._line is not None:
            self._line.close()

    def _now(self) -> ByteLine | None:
        if self._line is None and self._clock() - self._tried_s >= _REOPEN_S:
            self._tried_s = self._clock()
            self._line = self._opened()
        return self._line

    def _lost(self) -> None:
        self.broke += self._line is not None
        self.close()
        self._line = None
