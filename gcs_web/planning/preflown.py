"""Preflights that are kept in `.session/preflights`, each by the hash of what it was flown for."""

import contextlib
import functools
import hashlib
import json
from collections.abc import Iterable
from importlib import metadata
from pathlib import Path

import msgspec

from firmware_bridge import wire
from flight import InputError, TrajectoryFile, file_format, trajectory
from flight.project import Project
from flight.trajectory import fingerprint
from gcs_web.protocol.plan import Preflight
from mapping.free_space import OF_HIDDEN

MOST_KEPT, MOST_PLANS = 20, 50
"""Results, and plans that wait for their preflight; the oldest go first."""
_PLAN = ".plan.json"
_ASKED = ("body_radius_m", "conditions", "asked")
"""Of the plan's check: what the flights are judged by besides the path."""
_OF_MAP = ("report.json", *OF_HIDDEN)
"""What a map says of itself besides its voxels: its scale, its images' places, what it may have missed."""


class Flown(msgspec.Struct, frozen=True):
    """What a preflight was flown for; each is a hash."""

    plan: str
    map: str
    vehicle: str
    simulation: str
    """Version of Goshawk."""

    @staticmethod
    def of(project: Path, item: TrajectoryFile) -> "Flown":
        """Of a plan in the project's map, as both are now.

        Its name does not count; what the vehicle is told of the room beside the path, and what was asked, do.
        """
        asked = json.dumps({name: item.check.get(name) for name in _ASKED}, sort_keys=True)
        told = f"{fingerprint(item.trajectory)} {wire.proved_clearance_m(item):.4f} {asked}"
        said = f"{item.map_hash} {_said_by_map(Project(project, '').map)}"
        plan, of_map = (hashlib.sha256(text.encode()).hexdigest() for text in (told, said))
        return Flown(plan, of_map, item.vehicle_hash, metadata.version("goshawk"))

    @property
    def key(self) -> str:
        return hashlib.sha256(" ".join((self.plan, self.map, self.vehicle, self.simulation)).encode()).hexdigest()[:32]

    def change(self, now: "Flown") -> str:
        """What is another one now: the first of simulation, vehicle, map and plan, which changes with these two."""
        if self.simulation != now.simulation:
            return "the simulation"
        if self.vehicle != now.vehicle:
            return "the vehicle"
        return "the map" if self.map != now.map else "the plan"


def _said_by_map(folder: Path) -> list[str]:
    """A hash of each file, empty where there is none."""
    return [_content(folder / name) for name in _OF_MAP]


def _content(file: Path) -> str:
    try:
        status = file.stat()
        return _hash_of(file, status.st_mtime_ns, status.st_size)
    except FileNotFoundError:
        return ""


@functools.lru_cache(maxsize=64)
def _hash_of(file: Path, _changed_ns: int, _size: int) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()


class _Kept(msgspec.Struct, frozen=True):
    flown: Flown
    found: Preflight


def _folder(project: Path) -> Path:
    return project / ".session" / "preflights"


def _plan_file(project: Path, key: str) -> Path:
    return _folder(project) / f"{key}{_PLAN}"


def put_down(project: Path, item: TrajectoryFile) -> str:
    """Write a plan for a process that flies it; the key by which `taken` has it there."""
    key = Flown.of(project, item).key
    file = _plan_file(project, key)
    file.parent.mkdir(parents=True, exist_ok=True)
    trajectory.save(file, item)
    for old in _newest_first(_folder(project).glob(f"*{_PLAN}"))[MOST_PLANS:]:  # of what was cancelled
        old.unlink(missing_ok=True)
    return key


def taken(project: Path, key: str) -> TrajectoryFile:
    """The plan that was put down.

    Raises:
        InputError: there is none.
        FormatError: it is damaged.
    """
    file = _plan_file(project, key)
    if not key.isalnum() or not file.is_file():
        raise InputError("there is no checked plan to fly; plan on step 2, then start the preflight there")
    return trajectory.load(file)


def save(project: Path, flown: Flown, found: Preflight) -> None:
    """Keep a result, and the newest `MOST_KEPT` at most.

    Args:
        flown: as it was before the first flight: the map may have changed since.
    """
    folder = _folder(project)
    folder.mkdir(parents=True, exist_ok=True)
    file_format.write_bytes(folder / f"{flown.key}.json", msgspec.json.encode(_Kept(flown, found)))
    _plan_file(project, flown.key).unlink(missing_ok=True)
    for old in _newest_first(_results(project))[MOST_KEPT:]:
        old.unlink(missing_ok=True)


def of(project: Path, item: TrajectoryFile) -> Preflight:
    """The preflight of a plan; else the newest of another one, stale and without its paths; else none."""
    now = Flown.of(project, item)
    if (own := _read(_folder(project) / f"{now.key}.json")) is not None and own.flown == now:
        return own.found
    for file in _newest_first(_results(project)):
        if (other := _read(file)) is not None:
            return msgspec.structs.replace(other.found, state="stale", stale=other.flown.change(now), paths=[])
    return Preflight("none")


def _read(file: Path) -> _Kept | None:
    """None where there is none, or it is damaged: it can be flown again."""
    try:
        return msgspec.json.decode(file.read_bytes(), type=_Kept)
    except (OSError, msgspec.DecodeError, UnicodeDecodeError, RecursionError):
        return None


def _results(project: Path) -> list[Path]:
    return [file for file in _folder(project).glob("*.json") if not file.name.endswith(_PLAN)]


def _newest_first(files: Iterable[Path]) -> list[Path]:
    found = []
    for file in files:
        with contextlib.suppress(FileNotFoundError):
            found.append((file.stat().st_mtime_ns, file))
    return [file for _, file in sorted(found, reverse=True)]
