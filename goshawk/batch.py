"""Many missions planned in one map: in processes or on a Dask cluster, resumable, one bad mission stopping nothing.

Each mission ends as a line of a journal in the output folder, with its trajectory beside it; the tables are made of
the journal at the end. A mission whose line is there, made of the same file, map, vehicle and options, is not planned
again.
"""

import fcntl
import hashlib
import json
import os
import signal
import time
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import lru_cache
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

import esdf
import mapping
import planner
import vehicle
from flight import FlightError, InfeasibleError, InputError, Progress, Trajectory, file_format, results, trajectory
from flight.mission import KeepIn, Laps, Mission, Yaw
from goshawk import thin_obstacles, waypoints_file
from mapping.free_space import FreeSpace

FORMAT, VERSION = "goshawk-batch", 1
JOURNAL = "journal.jsonl"
RESULTS = "results.json"
_COLUMNS: dict[str, type] = {
    "name": str, "status": str, "reason": str, "segments": int, "duration_s": float, "clearance_m": float,
    "top_speed_m_s": float, "could_hide_m": float, "could_hide_share": float, "method": str,
    "trajectory_hash": str, "cpu_s": float,
}  # fmt: skip
"""Of the tables; after the first three, a row may be without."""
_NEWER = ("could_hide_m", "could_hide_share")
"""Columns that a journal of an earlier version is without."""
SUFFIXES = (".json", ".csv")
Row = dict[str, Any]
"""What is known of a mission: name, status, reason, segments, duration_s, clearance_m, top_speed_m_s, method, cpu_s.

`could_hide_m` is how thick an obstacle could hide near it, None where no image looked, and `could_hide_share` the share
of its length along which more than `mapping.free_space.THRESHOLD_M` could; None where nothing is known of it."""


@dataclass(frozen=True, slots=True)
class Job:
    """All that a worker needs to plan any of the missions."""

    map_folder: Path
    vehicle_file: Path
    options: planner.PlanOptions
    out: Path
    laps: Laps | None = None
    yaw: Yaw | None = None
    keep_in: KeepIn | None = None
    """Asked of every mission, instead of what its file says."""
    thinnest_m: float | None = None
    """Obstacles so thick must not be able to hide within the clearance; None: not asked."""
    overwrite: bool = False
    inputs: bytes = b""
    """Hash of map, vehicle and options: a worker that lives on reads changed files again."""

    def asked(self, mission: Mission) -> Mission:
        """The mission with what is asked of all."""
        return replace(
            mission,
            laps=self.laps or mission.laps,
            yaw=self.yaw or mission.yaw,
            keep_in=self.keep_in or mission.keep_in,
        )


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
        scheduler: address of a Dask scheduler, instead of processes of our own; its workers must see the same files.

    Raises:
        InputError: the output folder holds results of other inputs, or another batch is writing to it, or the map or
            vehicle cannot be read.
        KeyboardInterrupt: Ctrl-C; what was done until then is in the journal and the tables.
    """
    job.out.mkdir(parents=True, exist_ok=True)
    same = _inputs_hash(job)
    job = replace(job, inputs=same)
    listed = {path.stem: path for path in files}
    keys = {name: _key(path, same) for name, path in listed.items()}
    with open(job.out / JOURNAL, "a") as lines:
        _take_alone(lines.fileno(), job.out)
        done = _done(job, keys)
        todo = [path for path in files if path.stem not in done]
        lines.write("\n" if lines.tell() else "")  # a crash may have cut the last line off

        def record(row: Row) -> None:
            name = row["name"]
            if _key(listed[name], same) != keys[name]:
                trajectory_path(job.out, name).unlink(missing_ok=True)
                row = _row(listed[name], "failed", "the mission's file was changed during the batch; run it again")
            entry = row | {"key": keys[name]}
            lines.write(json.dumps(entry, allow_nan=False) + "\n")
            lines.flush()
            os.fsync(lines.fileno())
            done[name] = entry
            progress("missions", len(done) / len(files))

        try:
            with _executor(jobs, scheduler) as executor:
                _plan_all(executor, todo, job, record)
        finally:
            rows = [{k: v for k, v in done[p.stem].items() if k != "key"} for p in files if p.stem in done]
            if rows:
                _write_tables(job.out, rows)
    return rows


def _take_alone(descriptor: int, out: Path) -> None:
    """The kernel lets go of a lock when its process ends, however it ends."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise InputError(f"another batch is writing to {out}; wait until it is done, or give another --out") from None


def _key(path: Path, inputs: bytes) -> str:
    """Hash of a mission's file and all other inputs; of those alone for a file that cannot be read."""
    try:
        content = path.read_bytes()
    except OSError:
        content = b""
    return hashlib.sha256(inputs + content).hexdigest()


def _inputs_hash(job: Job) -> bytes:
    """Of the map, the vehicle and the options."""
    area = mapping.open_map(job.map_folder)
    drone = vehicle.vehicle_hash(vehicle.load(job.vehicle_file))
    asked = (area.field.hash, drone, job.options, job.laps, job.yaw, job.keep_in)
    asked = asked if job.thinnest_m is None else (*asked, job.thinnest_m)  # else as in journals of earlier versions
    return hashlib.sha256(repr(asked).encode()).digest()


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
    if not isinstance(row, dict) or set(row) != {*_COLUMNS, "key"}:  # pyright: ignore[reportUnknownArgumentType]
        return False
    required = all(isinstance(row[name], str) for name in ("name", "status", "reason", "key"))
    return required and all(row[name] is None or type(row[name]) is kind for name, kind in _COLUMNS.items())


def _is_that_of(row: Row, path: Path) -> bool:
    """Whether a file holds, unchanged, the trajectory that a row of the journal is about."""
    try:
        item = trajectory.load(path)
    except FlightError:
        return False
    return item.checked and item.as_checked and item.check["trajectory_hash"] == row.get("trajectory_hash")


def trajectory_path(out: Path, name: str) -> Path:
    """Where a mission's trajectory is written."""
    return out / "trajectories" / f"{name}.json"


@contextmanager
def _executor(jobs: int, scheduler: str | None) -> Generator[Executor | None]:
    """Dask's, processes of our own, or None for this process."""
    if scheduler is not None:
        try:
            from dask.distributed import Client
        except ImportError:
            raise InputError("--scheduler needs Dask: install the package `distributed`") from None
        try:
            client = Client(scheduler)
        except (OSError, ValueError) as error:
            raise InputError(f"--scheduler {scheduler}: no Dask scheduler answers there ({error})") from error
        with client:
            yield client.get_executor()
        return
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
                record(_row(path, "crashed", "the planning process ended without an answer"))


def _record_answer(future: Future[Row], path: Path, record: Callable[[Row], None], lost: list[Path]) -> None:
    try:
        record(future.result())
    except BrokenProcessPool:
        lost.append(path)


def plan_one(path: Path, job: Job) -> Row:
    """Plan one mission and write its trajectory; a mission that fails is a row that says why."""
    began = time.process_time()
    trajectory_path(job.out, path.stem).unlink(missing_ok=True)  # of an earlier run with other inputs
    try:
        asked = waypoints_file.load_mission(path)
        area, drone, free, field = _world(job.map_folder, job.vehicle_file, job.thinnest_m, job.inputs)
        plan = thin_obstacles.plan(job.asked(asked), area, field, drone, job.options, free, job.thinnest_m)
        trajectory_path(job.out, path.stem).parent.mkdir(exist_ok=True)
        with results.new_file(trajectory_path(job.out, path.stem), overwrite=True) as placing:
            planner.save_plan(placing.temporary, plan, name=path.stem)
    except InfeasibleError as error:
        return _row(path, "infeasible", str(error), cpu_s=time.process_time() - began)
    except FlightError as error:
        return _row(path, "refused", str(error), cpu_s=time.process_time() - began)
    except Exception as error:  # an error of ours is one mission's, too
        return _row(path, "failed", f"{type(error).__name__}: {error}", cpu_s=time.process_time() - began)
    hidden = plan.gate.could_hide
    return _row(
        path,
        "planned",
        "",
        segments=len(plan.trajectory.durations_s),
        duration_s=plan.trajectory.duration_s,
        clearance_m=plan.gate.clearance_m,
        top_speed_m_s=top_speed_m_s(plan.trajectory),
        could_hide_m=None if hidden is None or hidden.unobserved else hidden.thickness_m,
        could_hide_share=None if hidden is None else hidden.length_share,
        method=plan.method,
        trajectory_hash=plan.gate.trajectory_hash,
        cpu_s=time.process_time() - began,
    )


def top_speed_m_s(flown: Trajectory) -> float:
    """Largest speed at samples 10 ms apart."""
    return float(np.linalg.norm(flown.position(flown.sample(0.01), 1), axis=1).max())


def _row(path: Path, status: str, reason: str, **facts: Any) -> Row:
    return dict.fromkeys(_COLUMNS) | {"name": path.stem, "status": status, "reason": reason} | facts


@lru_cache(maxsize=1)
def _world(
    map_folder: Path, vehicle_file: Path, thinnest_m: float | None, _inputs: bytes
) -> tuple[mapping.Map, vehicle.Vehicle, FreeSpace | None, esdf.Field]:
    """Map, vehicle, free space and the field to plan in: read once in each process, and again when the inputs' hash is
    another one."""
    area = mapping.open_map(map_folder)
    free = area.free_space()
    return area, vehicle.load(vehicle_file), free, thin_obstacles.field_to_plan_in(area, free, thinnest_m)


def _write_tables(out: Path, rows: list[Row]) -> None:
    """The same rows as JSON and as Parquet."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    file_format.write_json(out / RESULTS, format=FORMAT, version=VERSION, body={"missions": rows})
    types = {str: pa.string(), int: pa.int64(), float: pa.float64()}
    schema = pa.schema([(name, types[kind]) for name, kind in _COLUMNS.items()])
    with file_format.atomic_file(out / "results.parquet") as temporary:
        pq.write_table(pa.Table.from_pylist(rows, schema=schema), temporary)
