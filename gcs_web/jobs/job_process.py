"""One job in a process of its own: it reports its progress, and ends with the station, however that died.

The process leads a session of its own, so that it and all that it started can be ended together. Asked to stop, it may
clean up for `GRACE_S`; then it is killed.
"""

import contextlib
import logging
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing import connection
from pathlib import Path
from typing import Any

from flight import FlightError, Progress, extras

logger = logging.getLogger(__name__)

GRACE_S = 0.5
BEHIND_THE_PAGE = 10
"""Niceness: plans and drafts of the page go first."""

Work = Callable[[Path, Any, Progress], Any]
"""Does a job: the project's folder, the arguments, progress. A module-level function; its result can be pickled."""


@dataclass(frozen=True, slots=True)
class Failed:
    """A job that came to no result."""

    reason: str


@dataclass(frozen=True, slots=True)
class Done:
    result: Any


class JobProcess:
    """Starts at once; `outcome` waits for the end."""

    def __init__(
        self, work: Work, folder: Path, arguments: object, log: Path, *, niceness: int = BEHIND_THE_PAGE
    ) -> None:
        """
        Args:
            log: file for what the work and its libraries print; an earlier one is replaced.
            niceness: of the process.
        """
        context = multiprocessing.get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._lock = threading.Lock()
        self._cancelled = threading.Event()
        self._ended = False
        self._log = log
        # not a daemon, which may have no children of its own
        self._process: Any = context.Process(
            target=_main, args=(theirs, work, folder, arguments, log, niceness), daemon=False
        )
        self._process.start()
        theirs.close()

    def outcome(self, progress: Progress) -> Done | Failed:
        """Wait for the end, passing progress on; nothing that the job started is left when it returns."""
        last: Done | Failed | None = None
        try:
            while last is None:
                message = self._pipe.recv()
                if isinstance(message, Done | Failed):
                    last = message
                else:
                    progress(*message)
        except (EOFError, OSError):
            logger.info("the job's process ended without an answer")
        finally:  # Ctrl-C too
            with self._lock:
                self._end()
                self._process.join()
                self._ended = True
            self._pipe.close()
        if self._cancelled.is_set():
            return Failed("cancelled")
        return last or Failed(f"its process ended unexpectedly ({_how(self._process.exitcode)}); see {self._log.name}")

    def cancel(self) -> None:
        """End it within about `GRACE_S`, from any thread; returns at once."""
        self._cancelled.set()
        with self._lock:
            if not self._ended:
                self._process.terminate()
        timer = threading.Timer(GRACE_S, self._kill)
        timer.daemon = True
        timer.start()

    def kill(self) -> None:
        """End it now."""
        self._cancelled.set()
        self._kill()

    def _kill(self) -> None:
        with self._lock:
            if not self._ended:
                self._end()

    def _end(self) -> None:
        with contextlib.suppress(ProcessLookupError):  # it has not come to lead a group yet, or all of it is gone
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.kill()


def _how(code: int) -> str:
    return signal.Signals(-code).name if code < 0 else f"exit code {code}"


# --- in the job's process ---


def _main(pipe: connection.Connection, work: Work, folder: Path, arguments: object, log: Path, niceness: int) -> None:
    os.setsid()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # as Ctrl-C: temporary files are removed on the way out
    threading.Thread(target=_end_with_station, args=(pipe,), daemon=True).start()
    os.nice(niceness)
    log.parent.mkdir(parents=True, exist_ok=True)
    with open(log, "wb") as written:
        os.dup2(written.fileno(), 1)
        os.dup2(written.fileno(), 2)
    logging.basicConfig(stream=sys.stderr)

    def report(stage: str, fraction: float) -> None:
        pipe.send((stage, float(fraction)))

    try:
        pipe.send(Done(work(folder, arguments, report)))
    except FlightError as error:
        pipe.send(Failed(str(error)))
    except Exception as error:
        logger.exception("the job failed")
        needed = extras.missing(error)
        fault = f"internal error: {type(error).__name__}: {error}; see {log.name}"
        pipe.send(Failed(f"this needs {needed}" if needed else fault))


def _end_with_station(pipe: connection.Connection) -> None:
    """The station sends nothing: the pipe wakes this thread only when the station is gone, or has closed it."""
    with contextlib.suppress(EOFError, OSError):
        pipe.recv_bytes()
    os.killpg(0, signal.SIGKILL)
