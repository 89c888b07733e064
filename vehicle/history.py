"""Versions of a vehicle file, kept beside it, so that any change can be undone.

`vehicle.toml` has its history in the folder `vehicle.history`: `history.json` lists the steps, and each version is
there byte for byte. A step records which version it was made from, so undone versions are kept too.
"""

import hashlib
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from flight import FormatError, InputError, file_format
from vehicle.files import load, save, vehicle_hash
from vehicle.model import Vehicle

FORMAT = "goshawk-vehicle-history"
VERSION = 1

START, EDIT = "start", "edited by hand"


@dataclass(frozen=True, slots=True)
class HeldOut:
    """Prediction errors on flights that were not used for fitting."""

    flights: Mapping[str, str]
    """Name of each flight to the SHA-256 of its file."""
    before: Mapping[str, float]
    """Quantity with its unit to its error after half a second, under the model the step started from."""
    after: Mapping[str, float]
    """The same under the model the step made."""
    verdict: str = ""
    """Whether the error fell, as text."""


@dataclass(frozen=True, slots=True)
class Step:
    """One version of the file, and the action that made it."""

    number: int
    parent: int | None
    """The version it was made from; None for the first."""
    action: str
    """`start`, `add-effect`, `remove-effect`, `edited by hand`, ..."""
    effect: str
    """The effect added or removed; empty for none."""
    when_utc: str
    """ISO 8601; of a file that was there before, or was edited by hand, when it was last changed."""
    file_sha256: str
    """Of the file, byte for byte."""
    vehicle_hash: str
    """Hash of the vehicle's behaviour (`vehicle_hash`); plans record it."""
    effects: tuple[str, ...]
    held_out: HeldOut | None = None

    @property
    def snapshot(self) -> str:
        return f"{self.number:04d}.toml"


@dataclass(frozen=True, slots=True)
class History:
    """All steps in the order they were taken, and which one the file is at."""

    steps: tuple[Step, ...] = field(default_factory=tuple)
    current: int = -1

    def line(self) -> tuple[Step, ...]:
        """From the first version to the current one, without undone steps."""
        found: list[Step] = []
        at = self.current if self.steps else None
        while at is not None:
            found.append(self.steps[at])
            at = self.steps[at].parent
        return tuple(reversed(found))

    def as_dicts(self) -> list[dict[str, Any]]:
        """The steps as plain JSON values."""
        return [asdict(step) for step in self.steps]


def folder(path: Path) -> Path:
    """Where the history of a vehicle file lies."""
    return Path(path).with_name(Path(path).stem + ".history")


def read(path: Path) -> History:
    """The history of a vehicle file; without a history, or after an edit by hand, the present file is its last step.

    Nothing is written.

    Raises:
        InputError: there is no such vehicle file.
        FormatError: the history is damaged.
    """
    history, _ = _with_present(Path(path))
    return history


def differences(old: Vehicle, new: Vehicle) -> list[str]:
    """One line per effect and number that differs, gravity and limits included."""
    lines = [f"+ effect {name}" for name in new.effects if name not in old.effects]
    lines += [f"- effect {name}" for name in old.effects if name not in new.effects]
    for name in dict.fromkeys([*old.parameters, *new.parameters]):
        both = old.parameters.get(name), new.parameters.get(name)
        if len({p.value if p else None for p in both}) == 2:
            first, second = (f"{p.value:.5g}" if p else "none" for p in both)
            lines.append(f"  {name}: {first} -> {second} {next(p.unit for p in both if p)}")
    if old.gravity_m_s2 != new.gravity_m_s2:
        lines.append(f"  gravity_m_s2: {old.gravity_m_s2:.6g} -> {new.gravity_m_s2:.6g} m/s2")
    were, will_be = old.limits.as_dict(), new.limits.as_dict()
    for name in dict.fromkeys([*were, *will_be]):
        if were.get(name) != will_be.get(name):
            first, second = (f"{limits[name]:.5g}" if name in limits else "none" for limits in (were, will_be))
            lines.append(f"  limits.{name}: {first} -> {second}")
    return lines


def record(path: Path, vehicle: Vehicle, action: str, *, effect: str = "", held_out: HeldOut | None = None) -> Step:
    """Replace a vehicle file by a new version and keep the old one. If interrupted, the file is one or the other."""
    path = Path(path)
    history = _kept(path)
    temporary = path.with_name(f".{path.stem}.next.toml")  # beside the file: its paths are relative to it
    try:
        save(temporary, vehicle)
        data = temporary.read_bytes()
    finally:
        temporary.unlink(missing_ok=True)
    step = _step(len(history.steps), history.current, action, data, vehicle)
    step = replace(step, effect=effect, held_out=held_out)
    _write(path, replace(history, steps=(*history.steps, step), current=step.number), step, data)
    file_format.write_bytes(path, data)
    return step


def target(path: Path, number: int | None = None) -> tuple[Step, Step]:
    """The present version, and the one that `restore` would return to.

    Raises:
        InputError: there is nothing to undo, or no version of that number.
    """
    history = read(path)
    present = history.steps[history.current]
    if number is None:
        if present.parent is None:
            raise InputError(f"{path} is at its first version; there is nothing to undo")
        return present, history.steps[present.parent]
    if not 0 <= number < len(history.steps):
        raise InputError(f"{path} has no version {number}; it has 0 to {len(history.steps) - 1}")
    return present, history.steps[number]


def restore(path: Path, number: int | None = None) -> tuple[Step, Step]:
    """Restore a version, byte for byte: the one before the last step, or any. All versions stay in the history.

    Returns:
        The version that was left, and the one that is there now.
    """
    path = Path(path)
    left, restored = target(path, number)
    data = path.read_bytes() if restored is left else _snapshot_bytes(path, restored)
    history = _kept(path)
    _write(path, replace(history, current=restored.number))
    file_format.write_bytes(path, data)
    return left, restored


def version(path: Path, step: Step) -> Vehicle:
    """The vehicle as it was at a step."""
    path = Path(path)
    kept = folder(path) / step.snapshot
    if not kept.exists() and hashlib.sha256(path.read_bytes()).hexdigest() == step.file_sha256:
        return load(path)  # the present file, not yet kept
    _snapshot_bytes(path, step)
    return load(kept, relative_to=path.parent)


def _snapshot_bytes(path: Path, step: Step) -> bytes:
    kept = folder(path) / step.snapshot
    if not kept.exists():
        raise FormatError(f"{kept} is missing; version {step.number} of {path.name} is lost")
    data = kept.read_bytes()
    if hashlib.sha256(data).hexdigest() != step.file_sha256:
        raise FormatError(f"{kept} does not match its hash in the history; version {step.number} is lost")
    return data


def _with_present(path: Path) -> tuple[History, bytes]:
    """The history with the present file as its current step, and that file's bytes."""
    vehicle = load(path)
    data = path.read_bytes()
    digest = hashlib.sha256(data).hexdigest()
    history = _stored(path)
    if history.steps and history.steps[history.current].file_sha256 == digest:
        return history, data
    same = [step.number for step in history.steps if step.file_sha256 == digest]
    if same:  # a step was interrupted, or a version was copied back by hand
        return replace(history, current=same[-1]), data
    parent = history.current if history.steps else None
    step = _step(len(history.steps), parent, EDIT if history.steps else START, data, vehicle)
    step = replace(step, when_utc=_utc(path.stat().st_mtime))
    return History((*history.steps, step), step.number), data


def _kept(path: Path) -> History:
    """As `read`, with the present file safely in the history."""
    history, data = _with_present(path)
    if history != _stored(path):
        _write(path, history, history.steps[history.current], data)
    return history


def _step(number: int, parent: int | None, action: str, data: bytes, vehicle: Vehicle) -> Step:
    return Step(
        number=number,
        parent=parent,
        action=action,
        effect="",
        when_utc=_utc(time.time()),
        file_sha256=hashlib.sha256(data).hexdigest(),
        vehicle_hash=vehicle_hash(vehicle),
        effects=vehicle.effects,
    )


def _utc(time_s: float) -> str:
    return datetime.fromtimestamp(time_s, UTC).isoformat(timespec="seconds")


def _stored(path: Path) -> History:
    file = folder(path) / "history.json"
    if not file.exists():
        return History()
    document = file_format.read_json(file, format=FORMAT, version=VERSION)
    try:
        steps = tuple(_step_from(entry) for entry in document["steps"])
        current = int(document["current"])
        sound = 0 <= current < len(steps) and all(_sound(step, i) for i, step in enumerate(steps))
    except (KeyError, TypeError, ValueError) as error:
        raise FormatError(f"{file} is damaged: {type(error).__name__} {error}") from error
    if not sound:
        raise FormatError(f"{file} is damaged: its versions are not numbered in order, each made from an earlier one")
    return History(steps, current)


def _sound(step: Step, place: int) -> bool:
    """Numbered in order, and made from an earlier one."""
    return step.number == place and (step.parent is None if place == 0 else 0 <= (step.parent or 0) < place)


def _step_from(entry: Mapping[str, Any]) -> Step:
    held_out = HeldOut(**entry["held_out"]) if entry.get("held_out") else None
    return Step(**{**entry, "effects": tuple(entry["effects"]), "held_out": held_out})


def _write(path: Path, history: History, new: Step | None = None, data: bytes = b"") -> None:
    """The snapshot first, then the list that names it: an interruption leaves a list whose files are all there."""
    if new is not None:
        file_format.write_bytes(folder(path) / new.snapshot, data)
    body = {"current": history.current, "steps": history.as_dicts()}
    file_format.write_json(folder(path) / "history.json", format=FORMAT, version=VERSION, body=body)
