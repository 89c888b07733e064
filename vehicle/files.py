"""Vehicle files: format `goshawk-vehicle`, TOML, one `{value, std, unit, source}` per parameter."""

import hashlib
import os
from dataclasses import asdict, fields
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from flight import FormatError, InputError, file_format
from flight.frames import GRAVITY_M_S2
from vehicle import effects as registry
from vehicle.model import BODY, Vehicle, body_parameters, specs
from vehicle.parameters import Limits, Parameter

FORMAT = "goshawk-vehicle"
VERSION = 1
AXES = "thrust_axis_body"
"""Of the rotors: in a file of tilted ones only."""
_ROTORS = ("position_body_m", "spin", AXES)


def save(path: Path, vehicle: Vehicle) -> None:
    """Write a vehicle file. Paths of the user's effect files are kept relative to it."""
    path = Path(path)
    body_names = [s.name for s in BODY]
    body = {
        "name": vehicle.name,
        "effects": list(vehicle.effects),
        "gravity_m_s2": vehicle.gravity_m_s2,
        "effect_files": [_relative(file, path.parent) for file in vehicle.effect_files],
        "rotors": _rotors(vehicle),
        "body": {name: asdict(vehicle.parameters[name]) for name in body_names},
        "effect": {
            name: {s.name: asdict(vehicle.parameters[f"{name}.{s.name}"]) for s in vehicle.effect(name).parameters}
            for name in vehicle.effects
        },
        "limits": vehicle.limits.as_dict(),
        "provenance": dict(vehicle.provenance),
    }
    file_format.write_toml(path, format=FORMAT, version=VERSION, body=body)


def _rotors(vehicle: Vehicle) -> dict[str, Any]:
    rotors: dict[str, Any] = {
        "position_body_m": vehicle.hub_body_m.tolist(), "spin": vehicle.spin.astype(int).tolist()
    }  # fmt: skip
    return rotors if vehicle.axis_body is None else rotors | {AXES: vehicle.axis_body.tolist()}


def load(path: Path, *, relative_to: Path | None = None) -> Vehicle:
    """Read a vehicle file, and with it the user's own effects it names.

    Args:
        relative_to: the folder that the paths of effect files start from; None: the file's own.

    Raises:
        InputError: there is no such file.
        FormatError: it is not a vehicle file, is damaged, or newer than this version; the message names the place.
    """
    path = Path(path)
    document = file_format.read_toml(path, format=FORMAT, version=VERSION)
    start = path.parent if relative_to is None else relative_to
    try:
        files = _effect_files(document, start)
        for file in files:
            registry.load_file(file)
        return _from_document(document, files)
    except (InputError, FormatError) as error:
        raise FormatError(f"{path}: {error}") from error


def effect_files(path: Path) -> tuple[Path, ...]:
    """The effect files of the user's own that a vehicle file names; none of them is run.

    Raises:
        InputError, FormatError: as `load`.
    """
    path = Path(path)
    document = file_format.read_toml(path, format=FORMAT, version=VERSION)
    try:
        return _effect_files(document, path.parent)
    except InputError as error:
        raise FormatError(f"{path}: {error}") from error


_EXAMPLES = resources.files("vehicle") / "examples"


def examples() -> list[str]:
    """Names of the vehicles that come with the package."""
    names = [entry.name for entry in _EXAMPLES.iterdir()]
    return sorted(name.removesuffix(".toml") for name in names if name.endswith(".toml"))


def example(name: str = "rigter2019") -> Vehicle:
    """A vehicle that comes with the package: `rigter2019` (Table I of the paper, in SI) or `hummingbird`."""
    if name not in examples():
        raise InputError(f"there is no example vehicle {name!r}; there are {', '.join(examples())}")
    with resources.as_file(_EXAMPLES / f"{name}.toml") as path:
        return load(path)


def vehicle_hash(vehicle: Vehicle) -> str:
    """SHA-256 over what changes its behaviour: names, values, geometry, limits, the text of effects of the user's own;
    not over notes."""
    facts: list[object] = [
        vehicle.name,
        vehicle.effects,
        [(name, vehicle.parameters[name].value) for name in specs(vehicle)],
        vehicle.hub_body_m.tolist(),
        vehicle.spin.tolist(),
        vehicle.limits.as_dict(),
    ]
    if vehicle.axis_body is not None:
        facts.append(vehicle.axis_body.tolist())
    if vehicle.gravity_m_s2 != GRAVITY_M_S2:  # plans of before, made at standard gravity, keep their vehicle's hash
        facts.append(vehicle.gravity_m_s2)
    if texts := [digest for name in vehicle.effects if (digest := registry.text_hash(name))]:
        facts.append(texts)
    return hashlib.sha256(repr(facts).encode()).hexdigest()


def _from_document(document: dict[str, Any], files: tuple[Path, ...]) -> Vehicle:
    units = {s.name: s.unit for s in BODY}
    parameters = {n: _parameter(f"body.{n}", entry, units.get(n)) for n, entry in _table(document, "body").items()}
    if "mass_kg" not in parameters:
        raise InputError('the body has no mass_kg; weigh the vehicle and add mass_kg = { value = 0.7, unit = "kg" }')
    complete = body_parameters(**parameters) | parameters
    rotors = _table(document, "rotors")
    if surplus := sorted(set(rotors) - set(_ROTORS)):
        way_out = registry.hint(surplus[0], _ROTORS, "goshawk vehicle schema")
        raise InputError(f"rotors has {', '.join(surplus)}, which is not known; {way_out}")
    hubs = _numbers(rotors, "rotors", "position_body_m", (None, 3))
    effects = _strings(document, "effects")
    for effect, entries in _table(document, "effect", {}).items():
        known = registry.find(effect, len(hubs)).parameters
        units = {s.name: s.unit for s in known}
        complete |= {f"{effect}.{s.name}": Parameter(s.default, 0.0, s.unit, "default") for s in known if s.optional}
        for name, entry in _is_table(f"effect.{effect}", entries).items():
            complete[f"{effect}.{name}"] = _parameter(f"effect.{effect}.{name}", entry, units.get(name))
    return Vehicle(
        name=str(_there(document, "name")),
        parameters=complete,
        hub_body_m=hubs,
        spin=_numbers(rotors, "rotors", "spin", (len(hubs),)),
        axis_body=_unit(_numbers(rotors, "rotors", AXES, (len(hubs), 3))) if AXES in rotors else None,
        effects=tuple(effects),
        limits=_limits(_table(document, "limits", {})),
        provenance=_table(document, "provenance", {}),
        effect_files=files,
        gravity_m_s2=_number("gravity_m_s2", document.get("gravity_m_s2", GRAVITY_M_S2)),
    )


def _effect_files(document: dict[str, Any], start: Path) -> tuple[Path, ...]:
    names = _strings(document, "effect_files") if "effect_files" in document else []
    return tuple((start / name).resolve() for name in names)


def _limits(given: dict[str, Any]) -> Limits:
    known = [f.name for f in fields(Limits)]
    if surplus := set(given) - set(known):
        raise InputError(f"unknown limits {', '.join(sorted(surplus))}; known are {', '.join(sorted(known))}")
    return Limits(**{name: _number(f"limits.{name}", value) for name, value in given.items()})


def _parameter(name: str, entry: Any, unit: str | None) -> Parameter:
    """One parameter of the file; `unit` is the one it must have, None where no such parameter is known."""
    example = f'{name.split(".")[-1]} = {{ value = 0.1, std = 0.01, unit = "{unit or "1"}", source = "..." }}'
    if not isinstance(entry, dict):
        raise InputError(f"{name} is {entry!r}, not a table; write {example}")
    found: dict[str, Any] = entry  # pyright: ignore[reportUnknownVariableType]
    if unknown := set(found) - {"value", "std", "unit", "source"}:
        raise InputError(f"{name} has {', '.join(sorted(unknown))}; only value, std, unit, source are known")
    for key in ("value", "unit"):
        if key not in found:
            raise InputError(f"{name} has no {key}; write {example}")
    if unit is not None and found["unit"] != unit:
        raise InputError(f"{name} is given in {found['unit']!r}; it must be in {unit!r}")
    value, std = _number(f"{name}.value", found["value"]), _number(f"{name}.std", found.get("std", 0.0))
    try:
        return Parameter(value, std, str(found["unit"]), str(found.get("source", "")))
    except InputError as error:
        raise InputError(f"{name}: {error}") from None


def _number(name: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"{name} is {value!r}, not a number")
    return float(value)


def _unit(vectors: np.ndarray) -> np.ndarray:
    """Of length one, as a hand writes them with few digits; a vector of no length stays, for the model to refuse."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return vectors / np.where((length > 0.5) & (length < 2.0), length, 1.0)


def _numbers(table: dict[str, Any], where: str, key: str, shape: tuple[int | None, ...]) -> np.ndarray:
    """An array of numbers of a certain shape; None: any length."""
    expected = " rows of ".join("4 to 8" if n is None else str(n) for n in shape) + " numbers"
    if key not in table:
        raise InputError(f"{where} has no {key}; expected {expected}")
    try:
        values = np.array(table[key], dtype=np.float64)
    except (TypeError, ValueError):
        values = np.empty(0)
    if values.ndim != len(shape) or any(n not in (None, size) for n, size in zip(shape, values.shape, strict=True)):
        raise InputError(f"{where}.{key} is {str(table[key])[:60]}; expected {expected}")
    return values


def _there(document: dict[str, Any], key: str) -> Any:
    if key not in document:
        raise InputError(f"it has no {key}; `goshawk vehicle new` writes a complete vehicle file to compare with")
    return document[key]


def _table(document: dict[str, Any], key: str, instead: dict[str, Any] | None = None) -> dict[str, Any]:
    if key not in document and instead is not None:
        return instead
    return _is_table(key, _there(document, key))


def _is_table(name: str, value: Any) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise InputError(f"{name} is {str(value)[:60]!r}, not a table; write [{name}] above its lines")
    return value  # pyright: ignore[reportUnknownVariableType]


def _strings(document: dict[str, Any], key: str) -> list[str]:
    value = _there(document, key)
    if not isinstance(value, list) or not all(isinstance(item, str) for item in value):  # pyright: ignore[reportUnknownVariableType]
        raise InputError(f"{key} is {str(value)[:60]!r}, not a list of names")  # pyright: ignore[reportUnknownArgumentType]
    return value  # pyright: ignore[reportUnknownVariableType]


def _relative(file: Path, folder: Path) -> str:
    try:
        return os.path.relpath(file, folder.resolve())
    except ValueError:  # another drive
        return str(file)
