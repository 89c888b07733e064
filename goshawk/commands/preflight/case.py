"""One case of many preflights: a plan, the vehicle that it was checked for, and a wind; its row, and its result."""

import hashlib
import json
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, ClassVar

import mapping
import preflight
import vehicle
from flight import FlightError, InputError, file_format, results, trajectory
from goshawk.commands.plan.batch_work import JOURNAL, RESULTS, Kind, Row
from goshawk.commands.preflight import inputs
from goshawk.commands.preflight.like import Like
from goshawk.commands.preflight.outcome import Outcome
from mapping.free_space import OF_HIDDEN
from preflight.result import SCHEMA, SCHEMA_VERSION

COLUMNS: dict[str, type] = {
    "name": str, "status": str, "reason": str, "plan": str, "vehicle": str, "wind": str, "flights": int, "lost": int,
    "risk_upper95": float, "hidden": float, "finished": float, "clearance_q01_m": float, "clearance_least_m": float,
    "error_q99_m": float, "tilt_q99_rad": float, "rotor_reserve_q01": float, "segment": int, "time_s": float,
    "x_m": float, "y_m": float, "z_m": float, "dominating": str, "dominating_share": float, "document_hash": str,
    "cpu_s": float,
}  # fmt: skip
"""Of the tables; segment, time and place are where it is narrowest. `lost` is None by levels: its flights are no sample
of all. `hidden` is of what the map may have missed, and part of `risk_upper95`; None where the map does not say."""
GO, NO_GO = "go", "no-go"
KIND = Kind(
    "goshawk-preflight-batch", "preflights", "fly", "flies", "flown", "a file of the preflight",
    "plan, map, vehicle or options", COLUMNS, (GO, NO_GO), ("refused",),
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Case:
    """A plan, a vehicle and a wind as `--wind` takes it."""

    trajectory_file: Path
    vehicle_file: Path
    wind: str

    def __str__(self) -> str:
        """Its files, in words."""
        return f"{self.trajectory_file} or {self.vehicle_file}"

    @property
    def stem(self) -> str:
        return f"{self.trajectory_file.stem}_{self.vehicle_file.stem}_wind{self.wind.replace(',', '_')}"

    def absolute(self) -> "Case":
        return replace(self, trajectory_file=self.trajectory_file.absolute(), vehicle_file=self.vehicle_file.absolute())


@dataclass(frozen=True, slots=True)
class Job:
    """All that a worker needs to fly any of the cases."""

    map_folder: Path
    options: preflight.Options
    """Of all; the wind is the case's."""
    out: Path
    overwrite: bool = False
    inputs: bytes = b""
    like: Like = field(default_factory=Like)
    """What the options have from flights."""
    kind: ClassVar[Kind] = KIND

    def inputs_hash(self) -> bytes:
        """Of the map, what it says of itself and may have missed, and the options; no result depends on the threads."""
        area = mapping.open_map(self.map_folder)
        uncertainty = inputs.of_map(area, self.options.uncertainty)
        may_hide = [area.folder / name for name in OF_HIDDEN]
        hidden = [_hash_of(path) if path.is_file() else "" for path in may_hide]
        asked = (area.hash, hidden, replace(self.options, threads=None, uncertainty=uncertainty))
        return hashlib.sha256(repr(asked).encode()).digest()

    def with_inputs(self, inputs: bytes) -> "Job":
        return replace(self, inputs=inputs)

    def into(self, out: Path) -> "Job":
        return replace(self, out=out)

    def absolute(self) -> "Job":
        return replace(self, map_folder=self.map_folder.absolute())

    def shared_files(self) -> str:
        return str(self.map_folder)

    def key_of(self, item: Case) -> str:
        """Hash of the case's files, the wind and all other inputs; without the files where they cannot be read."""
        digest = hashlib.sha256(self.inputs + item.wind.encode())
        try:
            effects = vehicle.effect_files(item.vehicle_file)
        except (OSError, FlightError):
            effects = ()
        for path in (item.trajectory_file, item.vehicle_file, *effects):
            try:
                content = path.read_bytes()
            except OSError:
                content = b""
            digest.update(hashlib.sha256(content).digest())
        return digest.hexdigest()

    def missing(self, item: Case) -> Path | None:
        return next((path for path in (item.trajectory_file, item.vehicle_file) if not path.is_file()), None)

    def work_on(self, item: Case) -> Row:
        return fly_one(item, self)

    def file_of(self, name: str) -> Path:
        return self.out / "preflights" / f"{name}.json"

    def is_that_of(self, row: Row, path: Path) -> bool:
        return _hash_of(path) == row.get("document_hash")

    def beside(self) -> dict[str, Any]:
        """What was flown."""
        return {"flights": self.options.count, "risk_accepted": self.options.risk, "seed": self.options.seed}


def cases_of(folders: Sequence[Path], vehicles: Sequence[Path], winds: Sequence[str]) -> list[Case]:
    """Every plan in the folders with each vehicle that it was checked for, in each wind.

    A plan that was checked for none of them, or cannot be read, is a case of the first vehicle, and refused with the
    reason.

    Raises:
        InputError: no plan is there, two cases have one name, a wind or a vehicle cannot be read, or a vehicle is one
            that no plan was checked for.
    """
    for wind in winds:
        inputs.blowing(wind)
    hashes = {path: vehicle.vehicle_hash(vehicle.load(path)) for path in vehicles}
    found: list[Case] = []
    for plan in (plan for folder in folders for plan in _plans(folder)):
        fitting = [path for path, its in hashes.items() if _vehicle_of(plan) == its] or list(vehicles[:1])
        found += [Case(plan, path, wind) for path in fitting for wind in winds]
    flown = {case.vehicle_file for case in found}
    if idle := next((path for path in vehicles if path not in flown), None):
        raise InputError(f"no plan was checked for {idle}; leave it out, or plan for it with `goshawk plan batch`")
    names = [case.stem for case in found]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise InputError(
            f"two preflights are named {twice[0]}; rename one of the plans or vehicle files that have one name"
        )
    return found


def _plans(folder: Path) -> list[Path]:
    """Trajectory files in a folder, or in one that `goshawk plan batch` wrote.

    Raises:
        InputError: there are none, or the batch did not come to its end.
    """
    inner = folder / "trajectories"
    where = inner if inner.is_dir() else folder
    of_batch = (folder / JOURNAL).is_file()
    if not where.is_dir():
        raise InputError(f"{folder} is not a folder of plans")
    found = sorted(path for path in where.glob("*.json") if path.is_file() and path != folder / RESULTS)
    if of_batch and (left := _unfinished(folder, found)):
        instead = f", or give {inner} for the plans that are there" if found and where is inner else ""
        raise InputError(f"{folder} is a batch of plans that was cut off ({left}): run its command again{instead}")
    if of_batch and where is folder:
        raise InputError(f"{folder} is a batch without a plan; its {RESULTS} gives the reason of each")
    if not found:
        raise InputError(f"{where} holds no plans (.json); make some with `goshawk plan batch`")
    return found


def _unfinished(folder: Path, plans: Sequence[Path]) -> str:
    """What shows that a batch of plans was killed before it wrote its tables; empty if nothing does."""
    try:
        told: Any = json.loads((folder / RESULTS).read_bytes())
        names = {str(row["name"]) for row in told.get("missions", ())}
    except FileNotFoundError:
        return f"it has no {RESULTS}"
    except (ValueError, RecursionError, KeyError, TypeError, AttributeError):
        return f"its {RESULTS} is damaged"
    unknown = next((path.name for path in plans if path.stem not in names), None)
    return "" if unknown is None else f"its {RESULTS} does not tell of {unknown}"


def _vehicle_of(plan: Path) -> str | None:
    """Hash of the vehicle that a plan was checked for; None where that cannot be read."""
    try:
        return trajectory.load(plan).vehicle_hash
    except FlightError:
        return None


def fly_one(case: Case, job: Job) -> Row:
    """Fly one case and write its result; one that fails is a row that says why."""
    began = time.process_time()
    facts: dict[str, Any] = {
        "plan": case.trajectory_file.stem, "vehicle": case.vehicle_file.stem, "wind": case.wind
    }  # fmt: skip
    path = job.file_of(case.stem)
    path.unlink(missing_ok=True)  # of an earlier run with other inputs
    try:
        document = _flown(case, job)
        path.parent.mkdir(exist_ok=True)
        with results.new_file(path, overwrite=True) as placing:
            file_format.write_json(placing.temporary, format=SCHEMA, version=SCHEMA_VERSION, body=document)
    except FlightError as error:
        return KIND.row(case.stem, "refused", str(error), **facts, cpu_s=time.process_time() - began)
    except Exception as error:  # an error of ours is one case's, too
        said = f"{type(error).__name__}: {error}"
        return KIND.row(case.stem, "failed", said, **facts, cpu_s=time.process_time() - began)
    facts |= _columns(document) | {"document_hash": _hash_of(path), "cpu_s": time.process_time() - began}
    return KIND.row(case.stem, GO if document["go"] else NO_GO, document["reason"], **facts)


def _flown(case: Case, job: Job) -> dict[str, Any]:
    """The case's result as plain JSON values.

    Raises:
        KeyboardInterrupt: Ctrl-C, whatever was flown of it.
    """
    wind = inputs.blowing(case.wind)
    blown = replace(job.options.uncertainty, wind_m_s=wind.wind_m_s, wind_direction=wind.wind_direction)
    flown = inputs.subject(
        trajectory.load(case.trajectory_file),
        _map(job.map_folder, job.inputs),
        vehicle.load(case.vehicle_file),
        replace(job.options, uncertainty=blown),
        job.like,
    )
    result = preflight.fly(flown.scenario, flown.options)
    if result.cut_off or result.unexplained:
        raise KeyboardInterrupt  # it is flown again, wholly
    replay = preflight.replay(flown.scenario, result, flown.options, bundle=0)
    return Outcome(flown, result, replay).as_dict()


def _columns(document: dict[str, Any]) -> dict[str, Any]:
    """What the tables say of a result."""
    place, first = document["where"], document["dominating"]
    x, y, z = (None, None, None) if place is None else place["point_world_m"]
    return {
        "flights": document["risk"]["flights"],
        "lost": None if "levels" in document["risk"] else document["risk"]["count"],
        "risk_upper95": (document["risk_with_hidden"] or document["risk"])["upper95"],
        "hidden": document["hidden"] and document["hidden"]["probability"],
        "finished": document["finished"],
        "clearance_q01_m": document["clearance_m"].get("q01"),
        "clearance_least_m": document["clearance_m"].get("least"),
        "error_q99_m": document["error_m"].get("q99"),
        "tilt_q99_rad": document["tilt_rad"].get("q99"),
        "rotor_reserve_q01": document["rotor_reserve"].get("q01"),
        "segment": None if place is None else place["segment"],
        "time_s": None if place is None else place["time_s"],
        "x_m": x,
        "y_m": y,
        "z_m": z,
        "dominating": None if first is None else first["factor"],
        "dominating_share": None if first is None else first["share"],
    }


def _hash_of(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


@lru_cache(maxsize=1)
def _map(folder: Path, _inputs: bytes) -> mapping.Map:
    """Read once in each process, and again when the inputs' hash is another one."""
    return mapping.open_map(folder)
