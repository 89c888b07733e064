"""Whose time a loop runs on: the machine's, or that of a simulated body which waits for it."""

import socket
import struct
import time
from typing import Protocol

from flight import LinkError

_TIME = struct.Struct("<d")


class Clock(Protocol):
    """Seconds that never go back."""

    stepped: bool
    """Whether time stands until every part has done its work."""

    def sleep_until(self, time_s: float) -> float:
        """Wait; the time it is then."""
        ...

    def now_s(self) -> float: ...


class WallClock:
    """Unix time at the start, and from there the monotonic clock: what senders of poses stamp with."""

    stepped = False

    def __init__(self) -> None:
        self._offset_s = time.time() - time.monotonic()

    def now_s(self) -> float:
        return time.monotonic() + self._offset_s

    def sleep_until(self, time_s: float) -> float:
        time.sleep(max(0.0, time_s - self.now_s()))
        return self.now_s()


class SteppedClock:
    """That of a simulated body: it says when it wakes, and the body goes on no further."""

    stepped = True

    def __init__(self, port: int, *, introduction: bytes = b"") -> None:
        """
        Args:
            port: TCP, on this machine.
            introduction: what the body is told first.

        Raises:
            LinkError: nothing keeps a clock there.
        """
        try:
            self._socket = socket.create_connection(("127.0.0.1", port), timeout=600.0)
        except OSError as error:
            raise LinkError(f"no simulated body keeps a clock at port {port}: {error}") from error
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket.sendall(introduction)
        self._now_s = 0.0

    def now_s(self) -> float:
        return self._now_s

    def sleep_until(self, time_s: float) -> float:
        """
        Raises:
            LinkError: the body is gone.
        """
        self._socket.sendall(_TIME.pack(time_s))
        answer = self._socket.recv(_TIME.size, socket.MSG_WAITALL)
        if len(answer) < _TIME.size:
            raise LinkError("the simulated body has ended")
        (self._now_s,) = _TIME.unpack(answer)
        return self._now_s


def asked_until(connection: socket.socket) -> float | None:
    """The body's end: until when the other sleeps; None when it is gone."""
    try:
        asked = connection.recv(_TIME.size, socket.MSG_WAITALL)
    except OSError:
        return None
    return _TIME.unpack(asked)[0] if len(asked) == _TIME.size else None


def wake(connection: socket.socket, now_s: float) -> None:
    """The body's end: it is this time now."""
    connection.sendall(_TIME.pack(now_s))
