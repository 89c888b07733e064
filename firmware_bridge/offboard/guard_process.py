"""The planner's end of the guard: start it, hear it, answer it."""

import socket
import subprocess
import sys
from types import TracebackType
from typing import Self

from firmware_bridge.offboard.messages import GuardStatus, PlannerCommand
from flight import LinkError

_PATIENCE_S = 60.0


class GuardProcess:
    """A guard that outlives the planner."""

    def __init__(self, setup_json: str, *, module: str = "firmware_bridge.offboard.guard") -> None:
        """
        Args:
            module: whose `main` takes the setup and guards.
        """
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            self.process = subprocess.Popen(
                [sys.executable, "-m", module, setup_json, str(theirs.fileno())],
                pass_fds=(theirs.fileno(),),
                stdin=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                start_new_session=True,  # no signal of the planner's terminal reaches it
            )
        self._socket = ours
        self._socket.settimeout(_PATIENCE_S)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        """The guard notices, and ends when the vehicle is down."""
        self._socket.close()
        self.process.wait()
        if self.process.stderr is not None:
            self.process.stderr.close()

    def hear(self) -> GuardStatus:
        """The next status.

        Raises:
            LinkError: the guard ended, or is silent.
        """
        try:
            data = self._socket.recv(8192)
        except OSError as error:
            raise LinkError(f"the guard is silent: {error}") from error
        if not data:
            raise LinkError(self._last_words())
        return GuardStatus.unpack(data)

    def _last_words(self) -> str:
        self.process.wait()
        said = self.process.stderr.read().decode("utf-8", "replace").strip() if self.process.stderr else ""
        return said.splitlines()[-1] if said else "the guard ended"

    def answer(self, command: PlannerCommand) -> None:
        try:
            self._socket.send(command.pack())
        except OSError as error:
            raise LinkError(self._last_words()) from error
