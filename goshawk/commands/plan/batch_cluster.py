"""A batch by the workers of a Dask cluster (`cluster`).

The workers read the files, and send back what they make of them: only this process writes to the output folder.
"""

import pickle
import socket
import tempfile
from collections.abc import Callable, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar

from flight import FlightError, InputError, Progress, results
from goshawk.commands.plan import cluster
from goshawk.commands.plan.batch_work import Item, Row, Work
from goshawk.commands.plan.cluster import UnlikeWorkerError

T = TypeVar("T", bound=Item)


def work_on_all(
    address: str, items: Sequence[T], job: Work[T], record: Callable[[Row], None], progress: Progress
) -> None:
    """Record a row for each item as it is finished; after Ctrl-C, for those that had begun.

    Raises:
        InputError: no scheduler answers at the address, or a worker is unlike this process.
        ClusterError: the scheduler was lost, or there is no worker.
    """
    with cluster.connected(address) as client:
        lost = _work(client, items, job, record, progress)
        for item in lost:  # alone: an item that was only beside the one that ends its worker is done
            if _work(client, [item], job, record, progress):
                record(job.kind.row(item.stem, "crashed", "the workers that worked on it ended without an answer"))


def _work(client: Any, items: Sequence[T], job: Work[T], record: Callable[[Row], None], progress: Progress) -> list[T]:
    """Record a row for each item; those whose workers ended again and again are returned instead."""
    sent, keys = pickle.dumps(job.absolute()), dict[str, str]()

    def submit(item: T) -> Any:
        key = keys[item.stem] = job.key_of(item)
        return client.submit(work_there, cluster.installed(), sent, item.absolute(), key, pure=False)

    def take(item: T, answer: Any) -> None:
        record(_row(answer, item, keys[item.stem], job))

    return cluster.each(client, items, submit, take, progress)


def _row(answer: Any, item: T, key: str, job: Work[T]) -> Row:
    """The row of an item, its file written.

    Raises:
        InputError: its worker is unlike this process.
    """
    if isinstance(answer, UnlikeWorkerError):
        if job.key_of(item) != key:  # changed here, too, since it was sent
            return job.kind.row(item.stem, "failed", str(answer))
        raise InputError(f"{answer}; the workers need the same Goshawk and the same files at the same paths")
    row, content = answer
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

    cluster.require_same(installed_here)
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
