"""Results of long work (identification, diagnosis, comparison), kept with the flights: the next verb reads them.

A result is a JSON file in the folder `learned`, of the project or beside the flights, and the fitted vehicle beside it.
Its name ends with the hash of all that it was made from: other flights, another vehicle or other options make another.
"""

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path
from typing import Any

import vehicle
from flight import FlightError, file_format
from goshawk.terminal import console
from goshawk.terminal.screen import Screen
from vehicle import Vehicle

FOLDER = "learned"
FORMAT, VERSION = "goshawk-kept-result", 4


@dataclass(frozen=True, slots=True)
class Kept:
    """A result."""

    document: Mapping[str, Any]
    """What `--json` prints, without the files that a call writes."""
    screen: Screen
    vehicle: Vehicle | None = None
    """The fitted vehicle."""
    more: Mapping[str, Any] = field(default_factory=dict[str, Any])
    """What the next verbs need besides."""
    details: Screen = field(default_factory=Screen)
    """What is printed on request."""


def key(flights: Sequence[Iterable[Path]], columns: Path | None, vehicles: Iterable[Path], options: object) -> str:
    """Hash of what a result is made from.

    Args:
        flights: the flights of each use, as training and held out.
        options: all else, with a `repr` that says it.
    """
    files = [[_content(path) for path in group] for group in (*flights, [columns] if columns else [], vehicles)]
    effects = [vehicle.vehicle_hash(vehicle.load(path)) for path in vehicles]  # with the text of effects of one's own
    said = repr((VERSION, metadata.version("goshawk"), files, effects, options))
    return hashlib.sha256(said.encode()).hexdigest()


def _content(path: Path) -> str:
    """Hash of a file; of a recording that is a folder, of its files' names, sizes and times."""
    if path.is_file():
        return file_format.file_hash(path)
    inside = sorted(p for p in path.rglob("*") if p.is_file())
    return repr([(str(p), p.stat().st_size, p.stat().st_mtime_ns) for p in inside])


def folder(flight: Path) -> Path:
    """Where results about a flight are kept."""
    beside = flight.absolute().parent
    return (beside.parent if (beside.parent / "project.toml").is_file() else beside) / FOLDER


def place(kind: str, flight: Path, key: str) -> Path:
    """The file of a result."""
    return folder(flight) / f"{kind}-{key[:12]}.json"


def newest(kind: str, flights: Sequence[Path], vehicle_file: Path | None = None) -> Kept | None:
    """The newest result about these flights, whatever its options, and of this vehicle file if one is given."""
    files = sorted(folder(flights[0]).glob(f"{kind}-*.json"), key=lambda file: file.stat().st_mtime, reverse=True)
    wanted = about(flights, vehicle_file)
    for file in files:
        found = read(file)
        if found is not None and all(found[1].more.get(name) == value for name, value in wanted.items()):
            console.note(f"read from {file}")
            return found[1]
    return None


def about(flights: Sequence[Path], vehicle_file: Path | None) -> dict[str, Any]:
    """What a result says of what it is about, for `newest`."""
    vehicle_hash = {} if vehicle_file is None else {"vehicle_file": file_format.file_hash(vehicle_file)}
    return {"flights": sorted(_content(path) for path in flights), **vehicle_hash}


def find(kind: str, flight: Path, key: str) -> Kept | None:
    """The result that was kept, if it was; says where it is read from."""
    file = place(kind, flight, key)
    found = read(file) if file.is_file() else None
    if found is None or found[0] != key:
        return None
    console.note(f"read from {file}, made of the same flights, vehicle and options; delete it to do the work anew")
    return found[1]


def read(file: Path) -> tuple[str, Kept] | None:
    """A result and the key of what it was made from; None if it cannot be read."""
    try:
        body = file_format.read_json(file, format=FORMAT, version=VERSION)
        learned = file.with_suffix(".toml")
        parts, details = Screen(body["screen"]), Screen(body["details"])
        fitted = vehicle.load(learned) if body["vehicle"] else None
        if fitted is not None and vehicle.vehicle_hash(fitted) != body["vehicle"]:
            return None  # somebody changed the file: it is no result of these flights any more
        return body["key"], Kept(body["document"], parts, fitted, body["more"], details)
    except (FlightError, OSError, KeyError, TypeError):
        return None


def keep(kind: str, flight: Path, key: str, result: Kept) -> None:
    """Keep a result; where its folder cannot be written, say so and go on."""
    file = place(kind, flight, key)
    body = {
        "key": key,
        "document": result.document,
        "screen": result.screen.parts,
        "vehicle": None if result.vehicle is None else vehicle.vehicle_hash(result.vehicle),
        "more": result.more,
        "details": result.details.parts,
    }
    try:
        if result.vehicle is not None:
            vehicle.save(file.with_suffix(".toml"), result.vehicle)
        file_format.write_json(file, format=FORMAT, version=VERSION, body=json.loads(file_format.json_text(body)))
    except OSError as error:
        console.note(f"{file} is not kept: {error.strerror or error}")
        return
    console.note(f"kept: {file}")
