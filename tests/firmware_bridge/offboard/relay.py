"""A line to the firmware that goes through us, so that it can be cut, and a battery the simulator does not have."""

import contextlib
import select
import socket
import struct
import threading
import time
from types import TracebackType
from typing import Self

from firmware_bridge.betaflight_sitl import process
from firmware_bridge.offboard.firmware import Alert, Function
from firmware_bridge.offboard.msp import ANSWER, Decoder, Frame, encode

_PAUSE_S = 0.002


class Relay:
    """One connection after the other, from a port of ours to the firmware's."""

    def __init__(self) -> None:
        self._server = socket.create_server(("127.0.0.1", 0))
        self._server.setblocking(False)
        self.address = f"betaflight:tcp://127.0.0.1:{self._server.getsockname()[1]}"
        self.cut = False
        """While set, bytes are lost on the way, both ways."""
        self.battery: tuple[float, Alert] | None = None
        """Voltage and alert that the firmware is made to tell."""
        self._guard: socket.socket | None = None
        self._firmware: socket.socket | None = None
        self._decoder = Decoder()
        self._lock, self._ends = threading.Lock(), False
        self._thread = threading.Thread(target=self._run, name="relay", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._ends = True
        self._thread.join()
        self._drop()
        self._server.close()

    def pump(self) -> None:
        """Hand on what has come; a body that steps does so before each step, so that it is in time."""
        with self._lock:
            try:
                self._connect()
                if self._guard is not None and self._firmware is not None:
                    self._on(self._guard, self._firmware, changed=False)
                    self._on(self._firmware, self._guard, changed=True)
            except OSError:
                self._drop()

    def _run(self) -> None:
        while not self._ends:
            self.pump()
            time.sleep(_PAUSE_S)

    def _connect(self) -> None:
        """Take a planner that calls, and call the firmware for it, as often as it takes."""
        with contextlib.suppress(BlockingIOError):
            called, _ = self._server.accept()
            self._drop()
            self._guard, self._decoder = called, Decoder()
        if self._guard is not None and self._firmware is None:
            with contextlib.suppress(ConnectionRefusedError):
                self._firmware = socket.create_connection((process.HOST, process.CLI_PORT))

    def _on(self, from_: socket.socket, to: socket.socket, *, changed: bool) -> None:
        while select.select([from_], [], [], 0.0)[0]:
            if not (data := from_.recv(65536)):
                raise ConnectionError("closed")
            if not self.cut:
                to.sendall(self._with_battery(data) if changed and self.battery is not None else data)

    def _with_battery(self, data: bytes) -> bytes:
        """The frames in some bytes, that of the battery's state changed; they are all answers once it flies."""
        assert self.battery is not None
        volts, alert = self.battery
        told = b""
        for frame in self._decoder.feed(data):
            payload = frame.payload
            if frame.function == Function.BATTERY_STATE and len(payload) >= 11:
                payload = payload[:8] + struct.pack("<BH", alert, round(100.0 * volts)) + payload[11:]
            told += encode(Frame(frame.function, payload, ANSWER))
        return told

    def _drop(self) -> None:
        for end in (self._guard, self._firmware):
            if end is not None:
                end.close()
        self._guard = self._firmware = None
