"""A batch by the workers of a Dask cluster: a worker, an item or a scheduler that fails costs no other row.

No more items are sent than the workers have threads, so that what was sent has begun. The workers read the files, and
send back what they make of them: only this process writes to the output folder.
"""

import asyncio
import hashlib
import logging
import pickle
import socket
import tempfile
import time
from collections import deque
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import CancelledError
from contextlib import contextmanager
from functools import lru_cache
from importlib import metadata
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
from flight import FlightError, InputError, Progress, results
from goshawk.commands.plan.batch_work import Item, Row, Work

T = TypeVar("T", bound=Item)

CONNECT_S = 10.0
"""How long a scheduler may take to answer."""
WORKER_S = 60.0
"""How long there may be no worker: a nanny starts another one within some seconds, on a busy machine."""


class ClusterError(FlightError):
    """The scheduler was lost, or there is no worker; what was recorded until then stays."""


class UnlikeWorkerError(FlightError):
    """A worker has another Goshawk, or does not see the same files."""


def work_on_all(
    address: str, items: Sequence[T], job: Work[T], record: Callable[[Row], None], progress: Progress
) -> None:
    """Record a row for each item as it is finished; after Ctrl-C, for those that had begun.

    Raises:
        InputError: no scheduler answers at the address, or a worker is unlike this process.
        ClusterError: the scheduler was lost, or there is no worker.
    """
    with _connected(address) as client:
        lost = _work(client, items, job, record, progress)
        for item in lost:  # alone: an item that was only beside the one that ends its worker is done
            if _work(client, [item], job, record, progress):
                record(job.kind.row(item.stem, "crashed", "the workers that worked on it ended without an answer"))


@contextmanager
def _connected(address: str) -> Generator[Any]:
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


def _work(client: Any, items: Sequence[T], job: Work[T], record: Callable[[Row], None], progress: Progress) -> list[T]:
    """Record a row for each item; those whose workers ended again and again are returned instead."""
    sent = pickle.dumps(job.absolute())
    todo, running, lost = deque(items), dict[Any, tuple[T, str]](), list[T]()
    try:
        while todo or running:
            threads = _threads(client, progress)
            while todo and len(running) < threads:
                item = todo.popleft()
                key = job.key_of(item)
                future = client.submit(work_there, installed(), sent, item.absolute(), key, pure=False)
                running[future] = item, key
            _record_ended(client, running, lost, job, record)
    except (KeyboardInterrupt, InputError):
        while running:
            _record_ended(client, running, lost, job, record)
        raise
    return lost


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


def _record_ended(
    client: Any, running: dict[Any, tuple[T, str]], lost: list[T], job: Work[T], record: Callable[[Row], None]
) -> None:
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
        item, key = running.pop(future)
        try:
            row = _answer(client, future, item, key, job)
        except CancelledError as error:
            raise _lost(client) from error
        if row is None:
            lost.append(item)
        else:
            record(row)


def _answer(client: Any, future: Any, item: T, key: str, job: Work[T]) -> Row | None:
    """The row of an item, its file written; None if its workers ended.

    Raises:
        InputError: its worker is unlike this process.
    """
    from distributed import KilledWorker

    try:
        row, content = future.result()
    except KilledWorker:
        return None
    except UnlikeWorkerError as error:
        if job.key_of(item) != key:  # changed here, too, since it was sent
            return job.kind.row(item.stem, "failed", str(error))
        raise InputError(f"{error}; the workers need the same Goshawk and the same files at the same paths") from error
    except CancelledError:
        raise
    except Exception as error:  # work_there lets none through: it could not be called
        _require_scheduler(client)
        said = f"{type(error).__name__}: {error}"
        raise InputError(
            f"scheduler or workers cannot run Goshawk ({said}); install the same version of it on each"
        ) from error
    written = job.file_of(item.stem)
    written.unlink(missing_ok=True)
    if content is not None:
        written.parent.mkdir(exist_ok=True)
        with results.new_file(written, overwrite=True) as placing:
            placing.temporary.write_bytes(content)
    return row


def work_there(installed_here: str, sent: bytes, item: Any, key: str) -> tuple[Row, bytes | None]:
    """On a worker: do one item; its row, and the content of its file.

    Args:
        installed_here: what `installed` says in the process that asks.
        sent: the pickled job.
        key: hash of the item's files and all else, as that process sees them.

    Raises:
        UnlikeWorkerError: Goshawk or a file differs from that of the process that asks.
    """
    from distributed import get_worker

    if installed() != installed_here:
        raise UnlikeWorkerError(f"the worker on {socket.gethostname()} has Goshawk {installed()}, not {installed_here}")
    job = _same_job(sent)
    if (missing := job.missing(item)) is not None:
        raise UnlikeWorkerError(f"the worker on {socket.gethostname()} sees no {missing}")
    if job.key_of(item) != key:
        raise UnlikeWorkerError(f"the worker on {socket.gethostname()} sees another content of {item}")
    with tempfile.TemporaryDirectory(dir=get_worker().local_directory) as folder:
        here = job.into(Path(folder))
        row = here.work_on(item)
        written = here.file_of(item.stem)
        return row, written.read_bytes() if written.is_file() else None


@lru_cache(maxsize=1)
def _same_job(sent: bytes) -> Work[Any]:
    """The job, once what all items share was found to be that of the process that asks."""
    job: Work[Any] = pickle.loads(sent)
    try:
        inputs = job.inputs_hash()
    except FlightError as error:
        raise UnlikeWorkerError(f"the worker on {socket.gethostname()}: {error}") from error
    if inputs != job.inputs:
        where = job.shared_files()
        raise UnlikeWorkerError(f"the worker on {socket.gethostname()} sees another content of {where}")
    return job


@lru_cache(maxsize=1)
def installed() -> str:
    """Version of Goshawk and hash of its Python sources: two checkouts may have one version."""
    found = hashlib.sha256()
    for package in (flight, esdf, vehicle, firmware_bridge, mapping, planner, preflight, goshawk):
        folder = Path(str(package.__file__)).parent
        for file in sorted(folder.rglob("*.py")):
            found.update(file.relative_to(folder.parent).as_posix().encode() + b"\0" + file.read_bytes())
    return f"{metadata.version('goshawk')} (sources {found.hexdigest()[:8]})"
