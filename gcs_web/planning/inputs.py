"""The map and the vehicle that plans are checked against, and whether their files have changed since."""

import functools
import logging
import os
import threading
from collections.abc import Callable
from pathlib import Path

import mapping
import vehicle
from flight import FlightError, project
from mapping.free_space import FreeSpace
from mapping.verdict import Standing

logger = logging.getLogger(__name__)

_PERIOD_S = 0.5

Signature = tuple[tuple[str, int, int], ...]
"""Name, time of the last change (ns) and size of every file that a plan depends on."""


def signature(folder: Path) -> Signature:
    """Of a project's map and vehicle, effect files of its own included, as they are on disk now; what is missing is
    left out."""
    opened = project.Project(folder, "")
    watched = [opened.vehicle, *_effect_files(opened), *sorted(p for p in opened.map.rglob("*") if p.is_file())]
    found = []
    for path in watched:
        try:
            status = path.stat()
        except FileNotFoundError:
            continue
        found.append((os.path.relpath(path, folder), status.st_mtime_ns, status.st_size))
    return tuple(found)


def _effect_files(opened: project.Project) -> tuple[Path, ...]:
    try:
        status = opened.vehicle.stat()
        return _named_in(opened.vehicle, status.st_mtime_ns, status.st_size)
    except (FlightError, OSError):  # said where the vehicle is read
        return ()


@functools.lru_cache(maxsize=8)
def _named_in(vehicle_file: Path, _changed_ns: int, _size: int) -> tuple[Path, ...]:
    return vehicle.effect_files(vehicle_file)


def doubt(area: mapping.Map) -> str:
    """What people must know who plan in a map: that it is doubtful, and why; empty for nothing."""
    if area.standing is not Standing.DOUBTFUL:
        return ""
    return f"The map is doubtful: {'; '.join(area.reasons)}."


def model_doubt(model: vehicle.Vehicle) -> str:
    """What people must know of the rotor margins: that the model is not for design, and why; empty for nothing."""
    mark = vehicle.purpose.mark_sentence(model)
    return f"The rotor margins rest on a model {mark}." if mark else ""


class Parts:
    """Map and vehicle of a project, read again when asked for with another signature."""

    def __init__(self, folder: Path) -> None:
        self._project = project.Project(folder, "")
        self._maps: tuple[Signature, mapping.Map] | None = None
        self._free_spaces: tuple[Signature, FreeSpace | None] | None = None
        self._vehicles: tuple[Signature, vehicle.Vehicle] | None = None

    def map(self, wanted: Signature) -> mapping.Map:
        """Raises `FlightError` if it cannot be read, or its verdict forbids to plan in it."""
        if self._maps is None or self._maps[0] != wanted:
            opened = mapping.open_map(self._project.map)
            opened.require_not_refused()
            self._maps = (wanted, opened)
        return self._maps[1]

    def free_space(self, wanted: Signature) -> FreeSpace | None:
        """Of the map; None where nothing is known of it. Raises as `map`."""
        if self._free_spaces is None or self._free_spaces[0] != wanted:
            self._free_spaces = (wanted, self.map(wanted).free_space())
        return self._free_spaces[1]

    def vehicle(self, wanted: Signature) -> vehicle.Vehicle:
        """Raises `FlightError` if it cannot be read."""
        if self._vehicles is None or self._vehicles[0] != wanted:
            self._vehicles = (wanted, vehicle.load(self._project.vehicle))
        return self._vehicles[1]


class Watch:
    """Looks at the files twice a second and calls `on_change` once they have come to rest in a new state."""

    def __init__(self, folder: Path, extra: Path, on_change: Callable[[], None]) -> None:
        """`extra`: one more file, `waypoints.json`."""
        self._folder, self._extra, self._on_change = folder, extra, on_change
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="watch of the project's files", daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._stop.set()
        self._thread.join(timeout=5.0)

    def _state(self) -> tuple[Signature, int]:
        try:
            return signature(self._folder), self._extra.stat().st_mtime_ns
        except FileNotFoundError:
            return signature(self._folder), 0

    def _run(self) -> None:
        told = last = self._state()
        while not self._stop.wait(_PERIOD_S):
            try:
                now = self._state()
                if now == last != told:
                    self._on_change()
                    told = now
                last = now
            except Exception:  # tried again: a change must not stay unseen
                logger.exception("the project's files could not be read")
