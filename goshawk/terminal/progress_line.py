"""Progress on a terminal: one line for the current stage, with the remaining time."""

import contextlib
import threading
from collections.abc import Generator

from flight import Progress

QUIET_S = 2.0
"""Shorter work shows no line."""


@contextlib.contextmanager
def progress_line(console: object = None) -> Generator[Progress]:
    """A progress callable that draws on stderr.

    Args:
        console: rich's console to draw on; None: stderr.
    """
    from rich.console import Console
    from rich.progress import BarColumn, TaskProgressColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
    from rich.progress import Progress as Bars

    bars = Bars(
        TextColumn("{task.description}"),
        BarColumn(bar_width=24),
        TaskProgressColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(compact=True),
        console=console if isinstance(console, Console) else Console(stderr=True),
        transient=True,  # the line disappears when the work is done: the table shows the result
    )
    task = bars.add_task("working", total=None)
    current = ""
    lock = threading.Lock()
    ended = False

    def begin() -> None:
        with lock:
            if not ended:
                bars.start()

    def show(stage: str, fraction: float) -> None:
        nonlocal current
        if stage != current:
            current = stage
            bars.reset(task, description=stage, total=1.0)
        bars.update(task, completed=min(max(fraction, 0.0), 1.0), description=stage)

    timer = threading.Timer(QUIET_S, begin)
    timer.daemon = True
    timer.start()
    try:
        yield show
    finally:
        timer.cancel()
        with lock:
            ended = True
            bars.stop()
