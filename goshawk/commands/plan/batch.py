"""Many missions planned in one map: in processes or on a Dask cluster, resumable, one bad mission stopping nothing.

Each mission ends as a line of a journal in the output folder, with its trajectory beside it; the tables are made of
the journal at the end. A mission whose line is there, made of the same file, map, vehicle and options, is not planned
again.
"""

import fcntl
import json
import os
import signal
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import vehicle
from flight import FlightError, InputError, Progress, file_format, trajectory
from goshawk.commands.plan import batch_cluster
from goshawk.commands.plan.batch_mission import (
    COLUMNS,
    Job,
    Row,
    inputs_hash,
    key_of,
    plan_one,
    row_of,
    trajectory_path,
)

FORMAT, VERSION = "goshawk-batch", 1
JOURNAL = "journal.jsonl"
RESULTS = "results.json"
_NEWER = ("could_hide_m", "could_hide_share")
"""Columns that a journal of an earlier version is without."""
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
    files: Sequence[Path],
    job: Job,
    *,
    jobs: int = 1,
    scheduler: str | None = None,
    progress: Progress,
) -> list[Row]:
    """Plan every mission that is not done yet; the rows of all, in the order of the files.

    Args:
        jobs: worker processes; 1 plans in this process.
        scheduler: address of a Dask scheduler, instead of processes of our own; its workers must see map, vehicle and
            missions at the same paths.

    Raises:
        InputError: the output folder holds results of other inputs, or another batch is writing to it, or the map or
            vehicle cannot be read, or no scheduler answers, or one of its workers is unlike this process.
        ClusterError: the scheduler was lost, or has no worker.
        KeyboardInterrupt: Ctrl-C. After these two, what was done is in the journal and the tables.
    """
    job.out.mkdir(parents=True, exist_ok=True)
    same = inputs_hash(job)
    job = replace(job, inputs=same)
    listed = {path.stem: path for path in files}
    keys = {name: key_of(path, same) for name, path in listed.items()}
    with open(job.out / JOURNAL, "a") as lines:
        _take_alone(lines.fileno(), job.out)
        done = _done(job, keys)
        todo = [path for path in files if path.stem not in done]
        lines.write("\n" if lines.tell() else "")  # a crash may have cut the last line off

        def record(row: Row) -> None:
            name = row["name"]
            if key_of(listed[name], same) != keys[name]:
                trajectory_path(job.out, name).unlink(missing_ok=True)
                row = row_of(listed[name], "failed", "the mission's file was changed during the batch; run it again")
            entry = row | {"key": keys[name]}
            lines.write(json.dumps(entry, allow_nan=False) + "\n")
            lines.flush()
            os.fsync(lines.fileno())
            done[name] = entry
            progress("missions", len(done) / len(files))

        try:
            if scheduler is not None:
                batch_cluster.plan_all(scheduler, todo, job, record, progress)
            else:
                with _executor(jobs) as executor:
                    _plan_all(executor, todo, job, record)
        except batch_cluster.ClusterError as error:
            so_far = f"{len(done)} of {len(files)} missions are recorded in {job.out}"
            raise batch_cluster.ClusterError(f"{error}; {so_far}, and the same command plans the others") from error
        finally:
            rows = [{k: v for k, v in done[p.stem].items() if k != "key"} for p in files if p.stem in done]
            if rows:
                _write_tables(job, rows)
    return rows


def _take_alone(descriptor: int, out: Path) -> None:
    """The kernel lets go of a lock when its process ends, however it ends."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise InputError(f"another batch is writing to {out}; wait until it is done, or give another --out") from None


def _done(job: Job, keys: dict[str, str]) -> dict[str, Row]:
    """The rows of the journal that belong to these inputs; what a line that is cut off or damaged is about is not done.

    Raises:
        InputError: what is there was planned with other inputs, or was changed since.
    """
    found: dict[str, Row] = {}
    journal = job.out / JOURNAL
    for line in journal.read_bytes().splitlines():
        try:
            row = json.loads(line)
        except (ValueError, RecursionError):
            continue
        row = {**dict.fromkeys(_NEWER), **row} if isinstance(row, dict) else row
        if _is_row(row):
            found[str(row["name"])] = row
    found = {name: row for name, row in found.items() if row["status"] in ("planned", "infeasible", "refused")}
    changed = sorted(name for name, row in found.items() if name in keys and row.get("key") != keys[name])
    if changed and not job.overwrite:
        raise InputError(
            f"{job.out} holds results of other inputs (first: {changed[0]}): mission, map, vehicle or options changed; "
            "give another --out, or --overwrite to plan these again"
        )
    kept = {name: row for name, row in found.items() if name in keys and name not in changed}
    lasting = {name: row for name, row in kept.items() if row["status"] in ("infeasible", "refused")}
    planned = {name: row for name, row in kept.items() if trajectory_path(job.out, name).is_file()}
    other = sorted(name for name, row in planned.items() if not _is_that_of(row, trajectory_path(job.out, name)))
    if other and not job.overwrite:
        raise InputError(
            f"{trajectory_path(job.out, other[0])} was changed since it was planned; move it away, or --overwrite to "
            "plan it again"
        )
    return lasting | {name: row for name, row in planned.items() if name not in other}


def _is_row(row: Any) -> bool:
    """Whether a line of the journal has a row's columns, each of its kind, and a key."""
    if not isinstance(row, dict) or set(row) != {*COLUMNS, "key"}:  # pyright: ignore[reportUnknownArgumentType]
        return False
    required = all(isinstance(row[name], str) for name in ("name", "status", "reason", "key"))
    return required and all(row[name] is None or type(row[name]) is kind for name, kind in COLUMNS.items())


def _is_that_of(row: Row, path: Path) -> bool:
    """Whether a file holds, unchanged, the trajectory that a row of the journal is about."""
    try:
        item = trajectory.load(path)
    except FlightError:
        return False
    return item.checked and item.as_checked and item.check["trajectory_hash"] == row.get("trajectory_hash")


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


def _plan_all(executor: Executor | None, files: Sequence[Path], job: Job, record: Callable[[Row], None]) -> None:
    """Record a row for each file, as they are finished; after Ctrl-C, for those that had begun."""
    if executor is None:
        for path in files:
            record(plan_one(path, job))
        return
    futures: dict[Future[Row], Path] = {executor.submit(plan_one, path, job): path for path in files}
    lost: list[Path] = []
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
    # A process died and took the pool with it: each of the missions that were left gets a process of its own.
    for path in sorted(lost):
        with ProcessPoolExecutor(1, mp_context=get_context("spawn"), initializer=_ignore_ctrl_c) as alone:
            try:
                record(alone.submit(plan_one, path, job).result())
            except BrokenProcessPool:
                record(row_of(path, "crashed", "the planning process ended without an answer"))


def _record_answer(future: Future[Row], path: Path, record: Callable[[Row], None], lost: list[Path]) -> None:
    try:
        record(future.result())
    except BrokenProcessPool:
        lost.append(path)


def _write_tables(job: Job, rows: list[Row]) -> None:
    """The same rows as JSON, beside what the vehicle's model is not for, and as Parquet."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    mark = {vehicle.purpose.KEY: vehicle.purpose.not_for_design(vehicle.load(job.vehicle_file))}
    file_format.write_json(job.out / RESULTS, format=FORMAT, version=VERSION, body={"missions": rows, **mark})
    types = {str: pa.string(), int: pa.int64(), float: pa.float64()}
    schema = pa.schema([(name, types[kind]) for name, kind in COLUMNS.items()])
    with file_format.atomic_file(job.out / "results.parquet") as temporary:
        pq.write_table(pa.Table.from_pylist(rows, schema=schema), temporary)
