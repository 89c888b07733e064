"""A SITL vehicle in a process of its own, for the demo and the examples: started, used, stopped."""

import contextlib
import subprocess
import sys
from collections.abc import Callable, Generator
from pathlib import Path
from typing import TypeVar

import click

from firmware_bridge import CancelledError
from flight import LinkError

Result = TypeVar("Result")
TRIES = 3


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


def again_if_link_dies(work: Callable[[], Result], what: str) -> Result:
    """Do work that starts a SITL vehicle of its own; on a link error say so and do it anew.

    Raises:
        LinkError: it failed in each of `TRIES` tries; the error is the last one's.
    """
    for number in range(1, TRIES):
        try:
            return work()
        except CancelledError:
            raise
        except LinkError as error:
            click.echo(f"{what}, try {number} of {TRIES}: {error}; starting it again", err=True)
    return work()
