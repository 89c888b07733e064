"""The workers of a Dask cluster: a worker, an item or a scheduler that fails costs no other item.

No more items are sent than the workers have threads, so that what was sent has begun.
"""

import asyncio
import hashlib
import logging
import socket
import time
from collections.abc import Callable, Generator, Iterable
from concurrent.futures import CancelledError
from contextlib import contextmanager
from functools import lru_cache
from importlib import metadata
from itertools import islice
from pathlib import Path
from typing import Any, TypeVar

import esdf
import firmware_bridge
import flight
import goshawk
import mapping
import planner
import preflight
import vehicle
from flight import FlightError, InputError, Progress

T = TypeVar("T")

CONNECT_S = 10.0
"""How long a scheduler may take to answer."""
WORKER_S = 60.0
"""How long there may be no worker: a nanny starts another one within some seconds, on a busy machine."""


class ClusterError(FlightError):
    """The scheduler was lost, or there is no worker; what was recorded until then stays."""


class UnlikeWorkerError(FlightError):
    """A worker has another Goshawk, or does not see the same files."""


@contextmanager
def connected(address: str) -> Generator[Any]:
    """A client of the scheduler."""
    from distributed import Client

    for name in ("distributed", "distributed.client"):  # else it prints what our one sentence says
        logging.getLogger(name).setLevel(logging.CRITICAL)
    try:
        kind = asyncio.run(_kind_of(address))
        if kind != "Scheduler":
            raise ValueError(f"it is the address of a {kind.lower()}")
        client = Client(address, timeout=CONNECT_S)
    except (OSError, ValueError, TypeError) as error:
        why = str(error) or "no answer"
        raise InputError(
            f"--scheduler {address}: no Dask scheduler answers there ({why}); give the address that `dask scheduler` "
            "prints, like tcp://192.168.1.10:8786"
        ) from error
    try:
        yield client
    finally:
        client.close(timeout=1.0)  # nothing is under way; a lost scheduler would be waited for


async def _kind_of(address: str) -> str:
    """What a Dask process calls itself, Scheduler or Worker; `Client` waits for ever for a server of another kind."""
    from distributed.core import rpc

    async with rpc(address, timeout=CONNECT_S) as server:
        said: Any = await asyncio.wait_for(server.identity(), CONNECT_S)
    return str(said["type"])


def each(
    client: Any,
    items: Iterable[T],
    submit: Callable[[T], Any],
    take: Callable[[T, Any], None],
    progress: Progress,
) -> list[T]:
    """Submit every item, and take what each gave; those whose workers ended again and again are returned instead.

    After Ctrl-C, or an `InputError` of `items` or `take`, what had begun is waited for and taken.

    Args:
        submit: sends an item with `client.submit`; returns its future.
        take: is given an item and what its future gave.

    Raises:
        InputError: a worker cannot run Goshawk, or `take` raised it.
        ClusterError: the scheduler was lost, or there is no worker.
    """
    todo, running, lost = iter(items), dict[Any, T](), list[T]()
    try:
        while True:
            room = _threads(client, progress) - len(running)
            for item in islice(todo, max(room, 0)):
                future = submit(item)
                running[future] = item  # at once: the next may be interrupted, or bad input
            if not running:
                return lost
            _take_ended(client, running, lost, take)
    except (KeyboardInterrupt, InputError):
        while running:
            _take_ended(client, running, lost, take)
        raise


def _threads(client: Any, progress: Progress) -> int:
    """Items that the workers can do at a time; waits for a worker if there is none."""
    end_s = time.monotonic() + WORKER_S
    while True:
        _require_scheduler(client)
        try:
            threads = sum(client.nthreads().values())
        except (OSError, TypeError) as error:  # the connection ends while it asks
            raise _lost(client) from error
        if threads:
            return threads
        if time.monotonic() > end_s:
            where = client.scheduler.address
            raise ClusterError(f"no worker is connected to {where} since {WORKER_S:.0f} s; start `dask worker {where}`")
        progress("waiting for a worker", 0.0)
        time.sleep(0.2)


def _require_scheduler(client: Any) -> None:
    if client.status != "running":
        raise _lost(client)


def _lost(client: Any) -> ClusterError:
    where = client.scheduler.address if client.scheduler else "its address"
    return ClusterError(f"the Dask scheduler at {where} was lost; start it and its workers again")


def _take_ended(client: Any, running: dict[Any, T], lost: list[T], take: Callable[[T, Any], None]) -> None:
    """Take what has ended out of `running`; waits for a second at the most."""
    from distributed import wait

    _require_scheduler(client)
    try:
        ended: Any = wait(list(running), timeout=1.0, return_when="FIRST_COMPLETED")
    except TimeoutError:
        return
    except CancelledError as error:
        raise _lost(client) from error
    for future in ended.done:
        item = running.pop(future)
        try:
            is_there, answer = _answer(client, future)
        except CancelledError as error:
            raise _lost(client) from error
        if is_there:
            take(item, answer)
        else:
            lost.append(item)


def _answer(client: Any, future: Any) -> tuple[bool, Any]:
    """Whether there is an answer, and it, or the `UnlikeWorkerError` that the worker raised; none if workers ended."""
    from distributed import KilledWorker

    try:
        return True, future.result()
    except KilledWorker:
        return False, None
    except UnlikeWorkerError as error:
        return True, error
    except CancelledError:
        raise
    except Exception as error:  # what is called there lets none through: it could not be called
        _require_scheduler(client)
        said = f"{type(error).__name__}: {error}"
        raise InputError(
            f"scheduler or workers cannot run Goshawk ({said}); install the same version of it on each"
        ) from error


def require_same(installed_here: str) -> None:
    """On a worker: check that it has the Goshawk of the process that asks, which says so.

    Raises:
        UnlikeWorkerError: it has another one.
    """
    if installed() != installed_here:
        raise UnlikeWorkerError(f"the worker on {socket.gethostname()} has Goshawk {installed()}, not {installed_here}")


@lru_cache(maxsize=1)
def installed() -> str:
    """Version of Goshawk and hash of its Python sources: two checkouts may have one version."""
    found = hashlib.sha256()
    for package in (flight, esdf, vehicle, firmware_bridge, mapping, planner, preflight, goshawk):
        folder = Path(str(package.__file__)).parent
        for file in sorted(folder.rglob("*.py")):
            found.update(file.relative_to(folder.parent).as_posix().encode() + b"\0" + file.read_bytes())
    return f"{metadata.version('goshawk')} (sources {found.hexdigest()[:8]})"
