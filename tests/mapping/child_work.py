"""Work functions that the tests of `mapping.child` run in a child process."""

import ctypes
import itertools
import os
import signal
import time
from pathlib import Path

from flight import InputError, Progress


def add(a: int, b: int, *, progress: Progress) -> int:
    print("a library that talks on standard output")
    progress("adding", 0.5)
    progress("adding", 1.0)
    return a + b


def abort(*, progress: Progress) -> None:
    progress("matching features", 0.2)
    os.abort()


def segfault(*, progress: Progress) -> None:
    progress("placing images", 0.2)
    ctypes.string_at(0)


def free_twice(*, progress: Progress) -> None:
    """Crash inside the allocator; should nobody end this within 20 s, the alarm does."""
    progress("placing images", 0.2)
    signal.alarm(20)
    c = ctypes.CDLL(None)
    c.malloc.restype = ctypes.c_void_p
    c.free.argtypes = [ctypes.c_void_p]
    block, _beside = c.malloc(5000), c.malloc(5000)
    c.free(block)
    c.free(block)


def vanish(*, progress: Progress) -> None:
    os._exit(0)


def refuse(*, progress: Progress) -> None:
    raise InputError("too dark")


def stumble(*, progress: Progress) -> None:
    progress("refining", 0.0)
    raise ValueError("first line\nsecond line")


def linger(mark: str, *, progress: Progress) -> None:
    Path(mark).write_text(str(os.getpid()))
    progress("waiting", 0.0)
    time.sleep(3600.0)  # longer than any test waits for its end


def compute(mark: str, *, progress: Progress) -> None:
    """As `linger`, but without a moment in which another thread of this process could run."""
    Path(mark).write_text(str(os.getpid()))
    progress("waiting", 0.0)
    sum(itertools.repeat(1, 10**12))
