"""Work in a child process: COLMAP can abort the whole program on bad input, and then only the child ends.

The child writes its progress line by line, ends when the parent does, and is killed when the parent is
interrupted. It returns its result as a pickle in a private temporary folder.
"""

import contextlib
import fcntl
import importlib
import json
import os
import pickle
import select
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from flight import FlightError, MapError, Progress, silent

T = TypeVar("T")

_STACK = ("@ ", "*** ", "PC: @")
"""Beginnings of a stack trace's lines, which are left out of the message."""
_CRASHES = (signal.SIGABRT, signal.SIGBUS, signal.SIGFPE, signal.SIGILL, signal.SIGSEGV, signal.SIGTERM)
"""Signals that COLMAP handles by printing a stack trace."""


class CrashError(MapError):
    """The child ended without an answer."""

    def __init__(self, message: str, code: int) -> None:
        super().__init__(message)
        self.signal = signal.Signals(-code) if code < 0 else None
        """That ended it; None: it ended by itself."""


def run(
    work: Callable[..., T],
    *arguments: object,
    within: Path | None = None,
    lock: int | None = None,
    progress: Progress = silent,
) -> T:
    """Call `work(*arguments, progress=...)` in a child process and return its answer.

    Args:
        work: a module-level function; it, its arguments and its answer must be picklable.
        within: where the temporary folder of the call is made; else where the system has such folders.
        lock: file descriptor that the child inherits, so that a lock on what it writes outlives a killed parent.

    Raises:
        CrashError: the child crashed.
        MapError: it raised; the message names the step it was in.
        FlightError: as raised by `work`.
    """
    with tempfile.TemporaryDirectory(prefix="goshawk-", dir=within) as name:
        folder = Path(name)
        (folder / "request").write_bytes(pickle.dumps((work, arguments)))
        with open(folder / "log", "wb") as log:
            step, code = _watch(_start(folder, log, lock), progress)
        if code != 0 or not (folder / "answer").exists():
            raise CrashError(_crash_message(step or work.__name__, code, folder / "log"), code)
        error, answer = pickle.loads((folder / "answer").read_bytes())
    if isinstance(error, FlightError):
        raise error
    if error is not None:
        raise MapError(f"{step or work.__name__} failed: {error}")
    return answer


def _start(folder: Path, log: Any, lock: int | None) -> "subprocess.Popen[bytes]":
    # GLOG prints a line per image otherwise; warnings stay, they explain a crash
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(p for p in sys.path if p),
        "GLOG_minloglevel": "1",
        "OPENBLAS_NUM_THREADS": "1",  # work is divided by image; threads of one product mostly wait for each other
        "TMPDIR": str(folder),  # a killed child's temporary files are removed with the request
    }
    return subprocess.Popen(
        [sys.executable, "-m", "mapping.child", str(folder)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=log,
        env=environment,
        pass_fds=() if lock is None else (lock,),
        start_new_session=True,  # Ctrl-C reaches the parent only, which then ends the child
    )


def _watch(child: "subprocess.Popen[bytes]", progress: Progress) -> tuple[str, int]:
    """Pass progress on until the child ends; returns the last step it named and its exit code."""
    step = ""
    assert child.stdout is not None
    assert child.stdin is not None
    try:
        for line in child.stdout:
            step, fraction = json.loads(line)
            progress(step, fraction)
        return step, child.wait()
    finally:
        if child.poll() is None:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(child.pid, signal.SIGKILL)
            child.wait()
        child.stdin.close()
        child.stdout.close()


def _crash_message(step: str, code: int, log: Path) -> str:
    said = [line.strip() for line in log.read_text(errors="replace").splitlines()]
    said = [line for line in said if line and not line.startswith(_STACK)]
    reason = next((line for line in said if line[:1] == "F" or "Check failed" in line), said[-1] if said else "")
    how = signal.Signals(-code).name if code < 0 else f"exit code {code}"
    return f"{step} crashed ({how}){': ' + reason[:300] if reason else ''}"


def _main(folder: Path) -> None:
    """The child's side."""
    with os.fdopen(os.dup(1), "w") as lines:
        os.dup2(2, 1)  # libraries print to the log, not between the progress lines
        _end_with_parent()
        _restore_signal_handlers()

        def report(stage: str, fraction: float) -> None:
            lines.write(json.dumps([stage, fraction]) + "\n")
            lines.flush()

        work, arguments = pickle.loads((folder / "request").read_bytes())
        error: FlightError | str | None = None
        answer: object = None
        try:
            answer = work(*arguments, progress=report)
        except FlightError as caught:
            error = caught
        except Exception as caught:
            error = f"{type(caught).__name__}: {caught}".splitlines()[0]
        (folder / "answer.part").write_bytes(pickle.dumps((error, answer), protocol=pickle.HIGHEST_PROTOCOL))
        os.rename(folder / "answer.part", folder / "answer")


def _restore_signal_handlers() -> None:
    """Replace COLMAP's crash handlers, each of which prints a stack trace, by the default ones.

    Printing it allocates: after a crash inside the allocator (a damaged heap, say) it would wait for ever, and the
    parent with it.
    """
    importlib.import_module("pycolmap")
    for crash in _CRASHES:
        signal.signal(crash, signal.SIG_DFL)


def _end_with_parent() -> None:
    """Let the kernel end this process when the parent closes its end of standard input, as it does when it is killed.

    A thread that waits for that would have to wait for Python's lock too, which an adjustment holds for minutes.
    """
    signal.signal(signal.SIGIO, signal.SIG_DFL)  # ends the process
    fcntl.fcntl(0, fcntl.F_SETOWN, os.getpid())
    fcntl.fcntl(0, fcntl.F_SETFL, fcntl.fcntl(0, fcntl.F_GETFL) | os.O_ASYNC)
    if select.select([0], [], [], 0.0)[0]:  # it was closed before
        sys.exit(1)


if __name__ == "__main__":
    _main(Path(sys.argv[1]))
