"""How tests wait: for a condition, never for a time to pass. The limit ends a test that hangs; it judges nothing."""

import subprocess
import sys
import time
from collections.abc import Callable

PATIENCE_S = 600.0
"""A machine with many other things to do may take a hundred times as long as an idle one."""


def until(condition: Callable[[], object], what: str = "what it waits for", *, pause_s: float = 0.05) -> None:
    """Return as soon as the condition holds; fail, saying what did not come, when patience ends."""
    end_s = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < end_s, f"{what} did not come within {PATIENCE_S:.0f} s"
        time.sleep(pause_s)


def within(patience_s: float, condition: Callable[[], object], *, pause_s: float = 0.05) -> bool:
    """Whether the condition came to hold; then what should bring it about is tried again."""
    end_s = time.monotonic() + patience_s
    while not (holds := bool(condition())) and time.monotonic() < end_s:
        time.sleep(pause_s)
    return holds


def goshawk(*arguments: object) -> subprocess.CompletedProcess[str]:
    """Run the command line as a program of its own, to its end."""
    command = [sys.executable, "-m", "goshawk", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S, check=False)
