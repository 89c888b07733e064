"""Many items of work in one map: in processes or on a Dask cluster, resumable, one bad item stopping nothing.

Each item ends as a line of a journal in the output folder, with its file beside it; the tables are made of the journal
at the end. An item whose line is there, made of the same files and options, is not done again.
"""

import fcntl
import json
import os
import signal
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import get_context
from pathlib import Path
from typing import Any, TypeVar

from flight import InputError, Progress, file_format
from goshawk.commands.plan import batch_cluster, cluster
from goshawk.commands.plan.batch_work import JOURNAL, RESULTS, Item, Kind, Row, Work

VERSION = 1
T = TypeVar("T", bound=Item)
SUFFIXES = (".json", ".csv")


def mission_files(folder: Path) -> list[Path]:
    """The waypoint files in a folder, in the order of their names.

    Raises:
        InputError: there is no such folder, no such file in it, or two have one name.
    """
    if not folder.is_dir():
        raise InputError(f"{folder} is not a folder of waypoint files")
    found = sorted(path for path in folder.iterdir() if path.suffix.lower() in SUFFIXES and path.is_file())
    if not found:
        raise InputError(f"{folder} holds no waypoint files ({', '.join(SUFFIXES)})")
    names = [path.stem for path in found]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise InputError(f"{folder} holds two missions named {twice[0]}; rename one of them")
    return found


def run(
    items: Sequence[T],
    job: Work[T],
    *,
    jobs: int = 1,
    scheduler: str | None = None,
    progress: Progress,
) -> list[Row]:
    """Do every item that is not done yet; the rows of all, in their order.

    Args:
        jobs: worker processes; 1 works in this process.
        scheduler: address of a Dask scheduler, instead of processes of our own; its workers must see all files at
            the same paths.

    Raises:
        InputError: the output folder holds results of other inputs or of a batch of another kind, or another batch is
            writing to it, or what all items share cannot be read, or no scheduler answers, or one of its workers is
            unlike this process.
        ClusterError: the scheduler was lost, or has no worker.
        KeyboardInterrupt: Ctrl-C. After these two, what was done is in the journal and the tables.
    """
    job.out.mkdir(parents=True, exist_ok=True)
    job = job.with_inputs(job.inputs_hash())
    listed = {item.stem: item for item in items}
    keys = {name: job.key_of(item) for name, item in listed.items()}
    with open(job.out / JOURNAL, "a") as lines:
        _take_alone(lines.fileno(), job.out)
        _refuse_other_kind(job)
        done = _done(job, keys)
        todo = [item for item in items if item.stem not in done]
        lines.write("\n" if lines.tell() else "")  # a crash may have cut the last line off

        def record(row: Row) -> None:
            name = row["name"]
            if job.key_of(listed[name]) != keys[name]:
                job.file_of(name).unlink(missing_ok=True)
                row = job.kind.row(name, "failed", f"{job.kind.file} was changed during the batch; run it again")
            entry = row | {"key": keys[name]}
            lines.write(json.dumps(entry, allow_nan=False) + "\n")
            lines.flush()
            os.fsync(lines.fileno())
            done[name] = entry
            progress(job.kind.noun, len(done) / len(items))

        try:
            if scheduler is not None:
                batch_cluster.work_on_all(scheduler, todo, job, record, progress)
            else:
                with _executor(jobs) as executor:
                    _work_on_all(executor, todo, job, record)
        except cluster.ClusterError as error:
            so_far = f"{len(done)} of {len(items)} {job.kind.noun} are recorded in {job.out}"
            goes_on = f"the same command {job.kind.does} the others"
            raise cluster.ClusterError(f"{error}; {so_far}, and {goes_on}") from error
        finally:
            rows = [{k: v for k, v in done[p.stem].items() if k != "key"} for p in items if p.stem in done]
            if rows:
                _write_tables(job, rows)
    return rows


def _take_alone(descriptor: int, out: Path) -> None:
    """The kernel lets go of a lock when its process ends, however it ends."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise InputError(f"another batch is writing to {out}; wait until it is done, or give another --out") from None


def _refuse_other_kind(job: Work[Any]) -> None:
    """Its tables would be replaced, whatever `--overwrite` says of results."""
    try:
        found: Any = json.loads((job.out / RESULTS).read_bytes())["format"]
    except (OSError, ValueError, RecursionError, KeyError, TypeError):
        return
    if found != job.kind.format:
        raise InputError(f"{job.out} holds a {found}, not a {job.kind.format}; give another --out")


def _done(job: Work[Any], keys: dict[str, str]) -> dict[str, Row]:
    """The rows of the journal that belong to these inputs; what a line that is cut off or damaged is about is not done.

    Raises:
        InputError: what is there was made with other inputs, or was changed since.
    """
    kind, found = job.kind, dict[str, Row]()
    journal = job.out / JOURNAL
    for line in journal.read_bytes().splitlines():
        try:
            row = json.loads(line)
        except (ValueError, RecursionError):
            continue
        row = {**dict.fromkeys(kind.newer), **row} if isinstance(row, dict) else row
        if _is_row(row, kind):
            found[str(row["name"])] = row
    found = {name: row for name, row in found.items() if row["status"] in (*kind.made, *kind.lasting)}
    changed = sorted(name for name, row in found.items() if name in keys and row.get("key") != keys[name])
    if changed and not job.overwrite:
        raise InputError(
            f"{job.out} holds results of other inputs (first: {changed[0]}): {kind.inputs} changed; "
            f"give another --out, or --overwrite to {kind.do} these again"
        )
    kept = {name: row for name, row in found.items() if name in keys and name not in changed}
    lasting = {name: row for name, row in kept.items() if row["status"] in kind.lasting}
    made = {name: row for name, row in kept.items() if row["status"] in kind.made and job.file_of(name).is_file()}
    other = sorted(name for name, row in made.items() if not job.is_that_of(row, job.file_of(name)))
    if other and not job.overwrite:
        raise InputError(
            f"{job.file_of(other[0])} was changed since it was {kind.done}; move it away, or --overwrite to "
            f"{kind.do} it again"
        )
    return lasting | {name: row for name, row in made.items() if name not in other}


def _is_row(row: Any, kind: Kind) -> bool:
    """Whether a line of the journal has a row's columns, each of its kind, and a key."""
    if not isinstance(row, dict) or set(row) != {*kind.columns, "key"}:  # pyright: ignore[reportUnknownArgumentType]
        return False
    required = all(isinstance(row[name], str) for name in ("name", "status", "reason", "key"))
    return required and all(row[name] is None or type(row[name]) is wanted for name, wanted in kind.columns.items())


@contextmanager
def _executor(jobs: int) -> Generator[Executor | None]:
    """Processes of our own, or None for this process."""
    if jobs == 1:
        yield None
        return
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn"), initializer=_ignore_ctrl_c) as pool:
        yield pool


def _ignore_ctrl_c() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _work_on_all(executor: Executor | None, items: Sequence[T], job: Work[T], record: Callable[[Row], None]) -> None:
    """Record a row for each item, as they are finished; after Ctrl-C, for those that had begun."""
    if executor is None:
        for item in items:
            record(job.work_on(item))
        return
    futures: dict[Future[Row], T] = {executor.submit(job.work_on, item): item for item in items}
    lost: list[T] = []
    waiting = set(futures)
    try:
        for future in as_completed(futures):
            _record_answer(future, futures[future], record, lost)
            waiting.remove(future)
    except KeyboardInterrupt:
        begun = [future for future in waiting if not future.cancel()]
        for future in as_completed(begun):
            _record_answer(future, futures[future], record, lost)
        raise
    # A process died and took the pool with it: each of the items that were left gets a process of its own.
    for item in sorted(lost, key=lambda item: item.stem):
        with ProcessPoolExecutor(1, mp_context=get_context("spawn"), initializer=_ignore_ctrl_c) as alone:
            try:
                record(alone.submit(job.work_on, item).result())
            except BrokenProcessPool:
                record(job.kind.row(item.stem, "crashed", "the process that worked on it ended without an answer"))


def _record_answer(future: Future[Row], item: T, record: Callable[[Row], None], lost: list[T]) -> None:
    try:
        record(future.result())
    except BrokenProcessPool:
        lost.append(item)


def _write_tables(job: Work[Any], rows: list[Row]) -> None:
    """The same rows as JSON, beside what the job says of them all, and as Parquet."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    kind = job.kind
    body = {kind.noun: rows, **job.beside()}
    file_format.write_json(job.out / RESULTS, format=kind.format, version=VERSION, body=body)
    types = {str: pa.string(), int: pa.int64(), float: pa.float64()}
    schema = pa.schema([(name, types[wanted]) for name, wanted in kind.columns.items()])
    with file_format.atomic_file(job.out / "results.parquet") as temporary:
        pq.write_table(pa.Table.from_pylist(rows, schema=schema), temporary)
