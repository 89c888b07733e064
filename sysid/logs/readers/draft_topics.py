"""A first map of a ROS recording: which topic holds pose, IMU, rotor speed and battery, each with its reason.

As with columns (`draft_columns`) a guess is a proposal to correct; `sysid.check_log` judges the log read with it.
"""

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flight import InputError
from flight.flight_log import MOST_ROTORS
from sysid.logs.readers.draft_columns import Draft, Guess, by_size
from sysid.logs.readers.read_bag import FORMAT, KNOWN, VERSION, sampled

NUMBER = {4: "four", 5: "five", 6: "six", 7: "seven", 8: "eight"}
LOOKED_AT = 400
"""Messages of a topic whose numbers are looked at."""
_MEASURED_POSE = re.compile(r"mocap|motion_?capture|vicon|vrpn|optitrack|qualisys|ground_?truth")
_ASKED = re.compile(r"(^|[/_])(cmd|command|commands|ref|reference|setpoint|sp|desired|target|goal|input)($|[/_])")
_ROTORS = re.compile(r"rotor|motor|esc|rpm|actuator|prop")
_SPEED = re.compile(r"rpm|speed|velocit")
_BATTERY = re.compile(r"batt|vbat|voltage")
IMU = "sensor_msgs/msg/Imu"
JOINTS = "sensor_msgs/msg/JointState"


@dataclass(frozen=True, slots=True)
class Topic:
    """What a topic holds."""

    name: str
    kind: str
    count: int
    messages: list[Any]
    """The first of them."""

    @property
    def asked(self) -> bool:
        """Whether its name says that it was asked for, not measured."""
        return bool(_ASKED.search(self.name.lower()))

    def numbers(self, paths: list[str]) -> np.ndarray:
        """(messages, paths)."""
        rows = [dict(_numbers(message)) for message in self.messages]
        return np.array([[row.get(path, np.nan) for path in paths] for row in rows], dtype=np.float64)


def draft(path: Path) -> Draft:
    """Guess what the topics of a recording hold.

    Raises:
        InputError: no such file, or no topic with a pose or an IMU.
        FormatError: it is no recording.
    """
    topics = [Topic(*found) for found in sampled(Path(path), LOOKED_AT)]
    guesses = [g for g in (_pose(topics), _most("imu", topics, IMU)) if g is not None]
    if not guesses:
        had = ", ".join(f"{t.name} ({t.kind})" for t in topics)
        raise InputError(
            f"{path} has no topic with a pose ({', '.join(KNOWN)}) or an IMU ({IMU}); it has {had or 'none'}"
        )
    for quantity, asked in (("rotor_speed_rad_s", False), ("rotor_speed_command_rad_s", True)):
        guesses += [g for g in [_rotors(quantity, [t for t in topics if t.asked is asked])] if g is not None]
    guesses += [g for g in [_battery(topics)] if g is not None]
    used = {guess.entries["topic"] for guess in guesses}
    unused = tuple(f"{t.name} ({t.kind})" for t in topics if t.name not in used)
    return Draft(_text(Path(path), guesses, unused), tuple(guesses), unused)


def _pose(topics: list[Topic]) -> Guess | None:
    """A topic of motion capture by its name, or else that with most messages."""
    own = [t for t in topics if t.kind in KNOWN and not t.asked]
    if not own:
        return None
    best = max(own, key=lambda t: (bool(_MEASURED_POSE.search(t.name.lower())), t.count))
    reasons = [f"a {best.kind} with {best.count} messages"]
    if len(own) > 1:
        reasons.append(f"others with a pose: {', '.join(t.name for t in own if t is not best)}")
    return Guess("pose", [], {"topic": best.name}, reasons)


def _most(name: str, topics: list[Topic], kind: str) -> Guess | None:
    """The topic of a type with most messages."""
    best = max((t for t in topics if t.kind == kind), key=lambda t: t.count, default=None)
    return best and Guess(name, [], {"topic": best.name}, [f"a {kind} with {best.count} messages"])


def _rotors(quantity: str, topics: list[Topic]) -> Guess | None:
    """The first list of four to eight numbers whose name says rotors; one that says speed goes first."""
    found = [(True, *joints) for joints in map(_joints, topics) if joints is not None]
    for topic in topics:
        for paths in _lists(topic):
            text = f"{topic.name} {paths[0]}".lower()
            values = topic.numbers(paths)
            if _ROTORS.search(text) and np.nanmax(np.abs(values), initial=0.0) > 1.0:  # else a ratio from 0 to 1
                found.append((bool(_SPEED.search(text)), topic, paths, values))
    if not found:
        return None
    _, topic, paths, values = max(found, key=lambda one: one[0])
    unit, reason = by_size(quantity, np.abs(values))
    reasons = [
        f"by its name, and {NUMBER[len(paths)]} numbers: {topic.name}",
        reason,
        "in the order of your vehicle's rotors: CHECK",
    ]
    entries: dict[str, Any] = {"topic": topic.name, "unit": unit}
    signs = np.sign(np.nanmedian(values, axis=0))
    if abs(signs.sum()) < len(signs) and signs.all():
        entries["scale"] = signs.tolist()
        reasons.append("speeds bear the sign of their spin, which is taken out")
    return Guess(quantity, paths, entries, reasons)


def _joints(topic: Topic) -> tuple[Topic, list[str], np.ndarray] | None:
    """Speeds of a JointState's four to eight joints whose names say rotors."""
    first = topic.messages[0]
    names = [str(name).lower() for name in getattr(first, "name", ())] if topic.kind == JOINTS else []
    paths = [f"velocity[{i}]" for i, name in enumerate(names) if _ROTORS.search(name)]
    if not 4 <= len(paths) <= MOST_ROTORS or len(getattr(first, "velocity", ())) != len(names):
        return None
    return topic, paths, topic.numbers(paths)


def _battery(topics: list[Topic]) -> Guess | None:
    for topic in topics:
        paths = [path for path, _ in _numbers(topic.messages[0])]
        path = "voltage" if "voltage" in paths else "data" if "data" in paths else ""
        if path and (topic.kind.endswith("BatteryState") or _BATTERY.search(topic.name.lower())):
            unit, usual = "V", float(np.nanmedian(topic.numbers([path])))
            return Guess(
                "battery_v",
                [path],
                {"topic": topic.name, "unit": unit},
                [f"battery by its name: {usual:.3g} as a rule"],
            )
    return None


def _lists(topic: Topic) -> Iterator[list[str]]:
    """Paths of every list of four to eight numbers in a topic's messages, less those behind that are always 0."""
    lists: dict[str, list[str]] = {}
    for path, _ in _numbers(topic.messages[0]):
        if "[" in path:
            lists.setdefault(re.sub(r"\[\d+\]", "[]", path), []).append(path)
    for paths in lists.values():
        if 4 <= len(paths) <= MOST_ROTORS:
            used = np.flatnonzero(np.nan_to_num(topic.numbers(paths)).any(axis=0))
            yield paths[: max(4, int(used[-1]) + 1 if len(used) else 0)]


def _numbers(message: Any, path: str = "") -> Iterator[tuple[str, float]]:
    """Every number of a message with its path, headers left out."""
    if isinstance(message, bool | str | bytes) or message is None:
        return
    if isinstance(message, int | float | np.number):
        yield path, float(message)
    elif isinstance(message, list | tuple | np.ndarray):
        for i, part in enumerate(message[:8]):
            yield from _numbers(part, f"{path}[{i}]")
    else:
        names = [n for n in getattr(message, "__dataclass_fields__", ()) if n not in ("header", "layout")]
        for name in names:
            yield from _numbers(getattr(message, name), f"{path}.{name}" if path else name)


def _text(path: Path, guesses: list[Guess], unused: tuple[str, ...]) -> str:
    """The map, with each guess's reasons above it."""
    lines = [
        f"# Map of {path.name}, drafted from topics, types and numbers. Each entry is a guess with its reason: check.",
        f"# Then see what looks wrong: goshawk log check {path.name} --columns THIS_FILE --vehicle VEHICLE",
        '# Keys: topic, frame ("z up", "z down"), fields, unit, scale.',
        f"format = {json.dumps(FORMAT)}",
        f"version = {VERSION}",
    ]
    for guess in guesses:
        kind = "scalar." if guess.name == "battery_v" else "" if guess.name in ("pose", "imu") else "quantity."
        lines += ["", *(f"# {reason}" for reason in guess.reasons), f"[{kind}{guess.name}]"]
        lines += [f"{key} = {json.dumps(value, ensure_ascii=False)}" for key, value in guess.entries.items()]
        if guess.columns:
            lines.append(f"fields = {json.dumps(guess.columns)}")
    if unused:
        lines += ["", f"# Not used: {', '.join(unused)}"]
    return "\n".join(lines) + "\n"
