"""A line of bytes to a flight controller, by TCP or a serial port, which never blocks for long."""

import contextlib
import os
import select
import socket
import time
from pathlib import Path
from typing import Protocol
from urllib.parse import urlsplit

from flight import InputError, LinkError

_PREFIX = "betaflight:"


class ByteLine(Protocol):
    """What carries MSP."""

    def write(self, data: bytes) -> None: ...
    def read(self, wait_s: float = 0.0) -> bytes:
        """What has come; nothing after `wait_s` is empty."""
        ...

    def close(self) -> None: ...


def connect(address: str, *, patience_s: float = 10.0) -> ByteLine:
    """A line to `betaflight:tcp://HOST:PORT` or `betaflight:serial:///dev/ttyACM0?baud=115200`.

    Raises:
        InputError: the address is none of those.
        LinkError: nothing answers there.
    """
    parts = urlsplit(address.removeprefix(_PREFIX))
    if not address.startswith(_PREFIX) or parts.scheme not in ("tcp", "serial"):
        raise InputError(
            f"{address!r} is no vehicle that this can fly; give betaflight:tcp://HOST:PORT or "
            "betaflight:serial:///dev/ttyACM0"
        )
    if parts.scheme == "serial":
        return SerialLine(Path(parts.path), int(parts.query.removeprefix("baud=") or 115200))
    if not parts.hostname or not parts.port:
        raise InputError(
            f"{address!r} has no host or port; Betaflight's SITL listens at betaflight:tcp://127.0.0.1:5761"
        )
    end_s = time.monotonic() + patience_s
    while True:
        try:
            return TcpLine(socket.create_connection((parts.hostname, parts.port), timeout=patience_s))
        except OSError as error:
            if time.monotonic() > end_s:
                raise LinkError(f"nothing answers at {address}: {error}") from error
            time.sleep(0.2)


class TcpLine:
    """Of a simulator, or a serial port that a network box serves."""

    def __init__(self, connected: socket.socket) -> None:
        connected.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        connected.setblocking(False)
        self._socket = connected

    def write(self, data: bytes) -> None:
        try:
            self._socket.sendall(data)
        except OSError as error:
            raise LinkError(f"the line to the flight controller broke: {error}") from error

    def read(self, wait_s: float = 0.0) -> bytes:
        if not select.select([self._socket], [], [], wait_s)[0]:
            return b""
        with contextlib.suppress(BlockingIOError, ConnectionError):
            if data := self._socket.recv(65536):
                return data
        raise LinkError("the flight controller closed the line")

    def close(self) -> None:
        self._socket.close()


class SerialLine:
    """A port as the operating system has it, raw, without a library."""

    def __init__(self, device: Path, baud: int) -> None:
        """
        Raises:
            InputError: the operating system knows no such rate.
            LinkError: the device cannot be opened.
        """
        import termios
        import tty

        speed = getattr(termios, f"B{baud}", None)
        if speed is None:
            raise InputError(f"{baud} baud is no rate of a serial port here; use 115200, 230400, 460800 or 921600")
        try:
            self._fd = os.open(device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
            tty.setraw(self._fd)
            settings = termios.tcgetattr(self._fd)
            settings[4] = settings[5] = speed
            termios.tcsetattr(self._fd, termios.TCSANOW, settings)
        except (OSError, termios.error) as error:
            raise LinkError(f"{device} cannot be opened as a serial port: {error}") from error

    def write(self, data: bytes) -> None:
        try:
            if os.write(self._fd, data) != len(data):
                raise LinkError(f"the serial port is full: {len(data)} bytes a message are more than its rate allows")
        except OSError as error:
            raise LinkError(f"the line to the flight controller broke: {error}") from error

    def read(self, wait_s: float = 0.0) -> bytes:
        if not select.select([self._fd], [], [], wait_s)[0]:
            return b""
        try:
            return os.read(self._fd, 65536)
        except OSError as error:
            raise LinkError(f"the line to the flight controller broke: {error}") from error

    def close(self) -> None:
        os.close(self._fd)
