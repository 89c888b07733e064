"""A SITL vehicle in a process of its own, for the demo and the examples: started, used, stopped."""

import contextlib
import subprocess
import sys
from collections.abc import Generator
from pathlib import Path

from flight import LinkError


@contextlib.contextmanager
def sitl_vehicle(*options: object, key_file: Path) -> Generator[str]:
    """Run `goshawk sitl` with these options on a free port; yields its address.

    Raises:
        LinkError: it did not start; the message is its own.
    """
    command = [sys.executable, "-m", "goshawk", "sitl", "--port", "0", "--key", str(key_file)]
    process = subprocess.Popen(
        [*command, *map(str, options)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert process.stderr is not None
    try:
        url = process.stdout.readline().strip()
        if not url.startswith("udp://"):
            raise LinkError(f"the SITL vehicle did not start: {process.stderr.read().strip()}")
        yield url
    finally:
        process.terminate()
        try:
            process.communicate(timeout=20)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()
