"""Vehicle files: format `goshawk-vehicle`, TOML, one `{value, std, unit, source}` per parameter."""

import hashlib
import os
from dataclasses import asdict, fields
from importlib import resources
from pathlib import Path
from typing import Any

from flight import FormatError, InputError, file_format
from vehicle import effects as registry
from vehicle.model import BODY, Vehicle, body_parameters, specs
from vehicle.parameters import Limits, Parameter

FORMAT = "goshawk-vehicle"
VERSION = 1


def save(path: Path, vehicle: Vehicle) -> None:
    """Write a vehicle file. Paths of the user's effect files are kept relative to it."""
    path = Path(path)
    body_names = [s.name for s in BODY]
    body = {
        "name": vehicle.name,
        "effects": list(vehicle.effects),
        "effect_files": [_relative(file, path.parent) for file in vehicle.effect_files],
        "rotors": {"position_body_m": vehicle.hub_body_m.tolist(), "spin": vehicle.spin.astype(int).tolist()},
        "body": {name: asdict(vehicle.parameters[name]) for name in body_names},
        "effect": {
            name: {s.name: asdict(vehicle.parameters[f"{name}.{s.name}"]) for s in registry.find(name).parameters}
            for name in vehicle.effects
        },
        "limits": asdict(vehicle.limits),
        "provenance": dict(vehicle.provenance),
    }
    file_format.write_toml(path, format=FORMAT, version=VERSION, body=body)


def load(path: Path, *, relative_to: Path | None = None) -> Vehicle:
    """Read a vehicle file, and with it the user's own effects it names.

    Args:
        relative_to: the folder that the paths of effect files start from; None: the file's own.

    Raises:
        InputError: there is no such file.
        FormatError: it is not a vehicle file, is damaged, or newer than this version; the message says where.
    """
    path = Path(path)
    document = file_format.read_toml(path, format=FORMAT, version=VERSION)
    start = path.parent if relative_to is None else relative_to
    files = tuple((start / name).resolve() for name in document.get("effect_files", []))
    for file in files:
        registry.load_file(file)
    try:
        return _from_document(document, files)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise FormatError(f"{path} is a damaged vehicle file: {type(error).__name__} {error}") from error
    except InputError as error:
        raise FormatError(f"{path}: {error}") from error


def example(name: str = "rigter2019") -> Vehicle:
    """A vehicle that comes with the package: `rigter2019` (Table I of the paper, in SI) or `hummingbird`."""
    folder = resources.files("vehicle") / "examples"
    known = sorted(entry.name.removesuffix(".toml") for entry in folder.iterdir() if entry.name.endswith(".toml"))
    if name not in known:
        raise InputError(f"there is no example vehicle {name!r}; there are {', '.join(known)}")
    with resources.as_file(folder / f"{name}.toml") as path:
        return load(path)


def vehicle_hash(vehicle: Vehicle) -> str:
    """SHA-256 over what changes its behaviour: names, values, geometry, effects and limits; not over notes."""
    facts = [
        vehicle.name,
        vehicle.effects,
        [(name, vehicle.parameters[name].value) for name in specs(vehicle)],
        vehicle.hub_body_m.tolist(),
        vehicle.spin.tolist(),
        asdict(vehicle.limits),
    ]
    return hashlib.sha256(repr(facts).encode()).hexdigest()


def _from_document(document: dict[str, Any], files: tuple[Path, ...]) -> Vehicle:
    parameters = {name: _parameter(entry) for name, entry in document["body"].items()}
    complete = body_parameters(**parameters) | parameters
    for effect, entries in document.get("effect", {}).items():
        complete |= {f"{effect}.{name}": _parameter(entry) for name, entry in entries.items()}
    known_limits = {f.name for f in fields(Limits)}
    if surplus := set(document.get("limits", {})) - known_limits:
        raise InputError(f"unknown limits {', '.join(sorted(surplus))}; known are {', '.join(sorted(known_limits))}")
    if "mass_kg" not in parameters:
        raise InputError("the body has no mass_kg")
    return Vehicle(
        name=str(document["name"]),
        parameters=complete,
        hub_body_m=document["rotors"]["position_body_m"],
        spin=document["rotors"]["spin"],
        effects=tuple(document["effects"]),
        limits=Limits(**document.get("limits", {})),
        provenance=document.get("provenance", {}),
        effect_files=files,
    )


def _parameter(entry: dict[str, Any]) -> Parameter:
    unknown = set(entry) - {"value", "std", "unit", "source"}
    if unknown:
        raise InputError(f"a parameter has {', '.join(sorted(unknown))}; only value, std, unit, source are known")
    return Parameter(float(entry["value"]), float(entry.get("std", 0.0)), entry["unit"], entry.get("source", ""))


def _relative(file: Path, folder: Path) -> str:
    try:
        return os.path.relpath(file, folder.resolve())
    except ValueError:  # another drive
        return str(file)
