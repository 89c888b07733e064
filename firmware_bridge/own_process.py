"""A process of its own for what must not end, or wait, with whoever began it."""

import contextlib
import multiprocessing
import os
import select
import signal
from collections.abc import Callable, Iterator
from multiprocessing.connection import Connection


@contextlib.contextmanager
def begun(main: Callable[..., None], first: object, *, name: str) -> Iterator[Connection]:
    """The line to a new process that runs `main(first, its end of the line)`; at the end, waits until it is over."""
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=main, args=(first, theirs), name=name)
    process.start()
    theirs.close()
    try:
        yield ours
    finally:
        ours.close()
        process.join()


def outlive_the_terminal() -> None:
    """No signal of the terminal that started this process ends it."""
    with contextlib.suppress(OSError):
        os.setsid()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)


def has_room(line: Connection) -> bool:
    """Whether a short message can be sent without waiting for whoever reads."""
    try:
        return bool(select.select([], [line.fileno()], [], 0.0)[1])
    except (OSError, ValueError):
        return False  # closed
