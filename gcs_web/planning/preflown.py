"""Preflights that are kept in `.session/preflights`, each by the hash of the plan, map and vehicle it was flown for."""

import contextlib
import hashlib
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import msgspec

from flight import InputError, TrajectoryFile, file_format, trajectory
from flight.trajectory import fingerprint
from gcs_web.planning import page_values
from gcs_web.protocol.plan import Preflight

MOST_KEPT, MOST_PLANS = 20, 50
"""Results, and plans that wait for their preflight; the oldest go first."""
_PLAN = ".plan.json"


class Flown(msgspec.Struct, frozen=True):
    """What a preflight was flown for; each is a hash."""

    plan: str
    map: str
    vehicle: str

    @staticmethod
    def of(item: TrajectoryFile) -> "Flown":
        """Its name does not count; what the vehicle is told of the room beside the path does."""
        told = f"{fingerprint(item.trajectory)} {page_values.crc32(replace(item, name='plan'))}"
        return Flown(hashlib.sha256(told.encode()).hexdigest(), item.map_hash, item.vehicle_hash)

    @property
    def key(self) -> str:
        return hashlib.sha256(" ".join((self.plan, self.map, self.vehicle)).encode()).hexdigest()[:32]

    def change(self, now: "Flown") -> str:
        """What is another one now: the first of vehicle, map and plan, which changes with either of the two."""
        if self.vehicle != now.vehicle:
            return "the vehicle"
        return "the map" if self.map != now.map else "the plan"


class _Kept(msgspec.Struct, frozen=True):
    flown: Flown
    found: Preflight


def _folder(project: Path) -> Path:
    return project / ".session" / "preflights"


def _plan_file(project: Path, key: str) -> Path:
    return _folder(project) / f"{key}{_PLAN}"


def put_down(project: Path, item: TrajectoryFile) -> str:
    """Write a plan for a process that flies it; the key by which `taken` has it there."""
    key = Flown.of(item).key
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


def save(project: Path, item: TrajectoryFile, found: Preflight) -> None:
    """Keep a result, and the newest `MOST_KEPT` at most."""
    flown, folder = Flown.of(item), _folder(project)
    folder.mkdir(parents=True, exist_ok=True)
    file_format.write_bytes(folder / f"{flown.key}.json", msgspec.json.encode(_Kept(flown, found)))
    _plan_file(project, flown.key).unlink(missing_ok=True)
    for old in _newest_first(_results(project))[MOST_KEPT:]:
        old.unlink(missing_ok=True)


def of(project: Path, item: TrajectoryFile) -> Preflight:
    """The preflight of a plan; else the newest of another one, stale and without its paths; else none."""
    now = Flown.of(item)
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
