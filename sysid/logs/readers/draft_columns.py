"""A first column map of a foreign CSV log: separator, names and units guessed, each guess with its reason beside it.

A guess is a proposal to read and correct, not a measurement; `sysid.check_log` judges the log read with it.
"""

import gzip
import json
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from flight import FormatError, InputError, errors
from flight.flight_log import COLUMNS, MOST_ROTORS, ROTOR_QUANTITIES
from flight.rotations import FloatArray
from sysid.logs.motors import outputs, rotor_places
from sysid.logs.motors.outputs import Outputs
from sysid.logs.readers import known_names
from sysid.logs.readers.read_csv import FORMAT, SEPARATORS, VERSION, header_names

ROWS = 20_000
"""Rows that are looked at."""

_UNITS = {
    # how names spell it (without _ and /): unit of a column map
    "mps": "m/s", "ms1": "m/s", "cmps": "cm/s", "mmps": "mm/s", "radps": "rad/s", "rads": "rad/s", "degps": "deg/s",
    "degs": "deg/s", "dps": "deg/s", "rpm": "rpm", "mps2": "m/s2", "ms2": "m/s2", "mss": "m/s2", "mm": "mm",
    "cm": "cm", "deg": "deg", "rad": "rad", "us": "us", "ns": "ns", "ms": "ms", "sec": "s", "seconds": "s", "s": "s",
    "rads1": "rad/s", "m": "m", "g": "g", "mv": "mV", "v": "V", "volt": "V", "volts": "V",
}  # fmt: skip
_TIME = re.compile(r"(time|timestamp|stamp|t|time_boot|timestamp_sample|clock)$")
_OF = r"(?:_[a-z]{2}(?:_[a-z])?)?_?"
"""Of which frames, as EuRoC writes (`p_RS_R_x`)."""
_BIAS = re.compile(r"(^|_)(b|bias)_")
_ASKED = r"(?P<asked>(?:ref|sp|setpoint|set|des|desired|target|cmd|command)_)?"
_PATTERNS = (
    # quantity, its name with component c
    ("q_world_body", _ASKED + r"(?:q|quat|quaternion|orientation|attitude|att|rot)" + _OF + r"(?P<c>[wxyz0-3])$"),
    ("q_world_body", _ASKED + r"(?P<c>roll|pitch|yaw|phi|theta|psi)$"),
    ("velocity_world_m_s", _ASKED + r"(?:v|vel|velocity)" + _OF + r"(?P<c>[xyz])$"),
    (
        "rate_body_rad_s",
        r"(?:gyro|gyr|w|omega|rate|rates|ang_?vel|angular_?velocity|body_?rate)" + _OF + r"(?P<c>[xyz])$",
    ),
    ("rate_body_rad_s", r"(?P<c>[pqr])$"),
    ("specific_force_body_m_s2", r"(?:a|acc|accel|accelerometer|acceleration|specific_force)" + _OF + r"(?P<c>[xyz])$"),
    ("rotor_speed_command_rad_s", r"(?:rotor_speed|motor_speed|rotor|motor|rpm)_?(?:cmd|command|ref)_?(?P<c>[0-8])$"),
    (
        "rotor_speed_rad_s",
        r"(?:m|mot|motor|rotor|prop|esc|rpm|erpm|rotor_?speed|motor_?speed|motor_?rpm)_?(?P<c>[0-8])(?:_?e?rpm)?$",
    ),
    ("position_world_m", _ASKED + r"(?:p|pos|position)?" + _OF + r"(?P<c>[xyz])$"),
)
_ORDER = {"roll": 0, "phi": 0, "pitch": 1, "theta": 1, "yaw": 2, "psi": 2, "w": -1, "p": 0, "q": 1, "r": 2}
_PWM = re.compile(r"(^|_)(pwm|motor_m)")
"""Duty cycles (Crazyflie's `motor.m1` is one) look like rotor speeds in rpm."""
_LARGEST_MICROSECONDS, _MOST_PWM16 = 2500.0, 65535.0
"""A larger motor command is no servo pulse; the largest of 16 bits."""
COMMANDS = {f"motor_command_{i}_ratio" for i in range(MOST_ROTORS)}
_TURNS = re.compile(r"(^|_)e_?rpm(_|\d|$)")
POLES, MOST_HUNDREDS = 14.0, 10_000.0
"""Of a usual motor; electrical revolutions a minute beyond are no hundreds."""


@dataclass(slots=True)
class Guess:
    """One entry of the map."""

    name: str
    """`time`, a quantity, or a scalar."""
    columns: list[str]
    entries: dict[str, Any] = field(default_factory=dict)
    """Further keys, as unit."""
    reasons: list[str] = field(default_factory=list)

    @property
    def sentence(self) -> str:
        """What was taken for what, without the reasons."""
        keys = [f"{key} {value}" if key != "order" else value for key, value in self.entries.items() if key != "topic"]
        return f"{self.name}: {', '.join([*(self.columns or [self.entries.get('topic', '')]), *keys])}"


@dataclass(frozen=True, slots=True)
class Draft:
    """A column map, and what was guessed."""

    text: str
    guesses: tuple[Guess, ...]
    unused: tuple[str, ...]
    """Columns that the map leaves out."""


def draft(path: Path) -> Draft:
    """Guess what the columns of a CSV file are.

    Raises:
        InputError: no such file, no column that could be the time, or numbers with decimal commas.
        FormatError: it is not a table of numbers.
    """
    separator, why, table = _table(Path(path))
    time = _time(table, path)
    known = [
        Guess(quantity, list(columns), dict(keys), [f"by their names, {', '.join(columns)}, which say the unit"])
        for quantity, (columns, keys) in known_names.found(table).items()
    ]
    of_betaflight = outputs.is_betaflight(table)
    if of_betaflight:
        known += [Guess(q, list(c), keys, reasons) for q, c, keys, reasons in known_names.of_betaflight(table)]
    driven = outputs.found(table, _base)
    commands = [] if COMMANDS & {g.name for g in known} else _outputs(driven)
    used = {time.columns[0], *driven.left_out} | {name for guess in (*known, *commands) for name in guess.columns}
    groups = _groups([name for name in table if name not in used])
    groups = {
        quantity: columns
        for quantity, columns in groups.items()
        if quantity not in {g.name for g in known} and not ("rotor" in quantity and _are_shares(table, columns))
    }
    guesses = []
    for quantity, columns in groups.items():
        guess = Guess(quantity, list(columns.values()))
        _describe(guess, list(columns), table)
        guesses.append(guess)
    _frames(guesses, table, down=any(guess.entries.get("frame") == "z down" for guess in known))
    guesses = [time, *known, *guesses]
    guesses += commands
    guesses += _scalars(table, {name for guess in guesses for name in guess.columns}, {g.name for g in guesses})
    used = {name for guess in guesses for name in guess.columns}
    keep = next((n for n in table if n not in used and _is_flag(n, table[n])), None)
    unused = tuple(name for name in table if name not in used and name != keep)
    text = _text(Path(path), (separator, why), guesses, keep, unused)
    if of_betaflight and len(driven.columns) == len(rotor_places.BETAFLIGHT):
        text += _PLACES
    return Draft(text, tuple(guesses), unused)


_PLACES = (
    "\n# Betaflight's motors 1 to 4 of QUADX: CHECK your mixer. `goshawk log check` compares them with the vehicle."
    f"\n[metadata]\nrotor_places = {json.dumps(rotor_places.BETAFLIGHT)}\n"
)


def _lines(path: Path) -> list[str]:
    if not path.is_file():
        raise errors.missing(path)
    opener = gzip.open if path.name.endswith(".gz") else open
    try:
        with opener(path, "rt", newline="", encoding="utf-8-sig") as file:
            lines = [line.rstrip("\r\n") for _, line in zip(range(ROWS), file, strict=False) if line.strip()]
    except (OSError, UnicodeDecodeError, EOFError) as error:
        raise FormatError(f"{path} is not a readable CSV file: {error}") from None
    if len(lines) < 12:
        raise FormatError(f"{path} has {len(lines)} lines; a log has a line of names and at least 10 rows")
    return lines


def _table(path: Path) -> tuple[str, str, dict[str, FloatArray]]:
    """Separator, why, and columns by name."""
    lines = _lines(path)
    _no_lines_above(path, lines)
    some = lines[1:21]
    counts = {s: {len(line.split(None if s == " " else s)) for line in some} for s in SEPARATORS}
    fit = [s for s in SEPARATORS if len(counts[s]) == 1 and max(counts[s]) > 1]
    if ";" in fit and any("," in line for line in some):
        raise InputError(
            f"{path} has decimal commas between semicolons; replace them by points (tr ',' '.' < OLD > NEW)"
        )
    if not fit:
        raise FormatError(
            f"{path}: no separator of {', '.join(map(repr, SEPARATORS))} splits its rows into two or more values, the "
            "same number in each"
        )
    separator = max(fit, key=lambda s: max(counts[s]))
    why = f"splits each of the first {len(some)} rows into {max(counts[separator])} values"
    names = header_names(iter(lines[:1]), separator)
    try:
        values = np.genfromtxt(lines[1:], delimiter=None if separator == " " else separator, dtype=np.float64, ndmin=2)
    except ValueError as error:
        raise FormatError(f"{path}: its rows are not equally long: {str(error).splitlines()[0]}") from None
    if values.shape[1:] != (len(names),):
        raise FormatError(f"{path} has {len(names)} names in its first line and {values.shape[1]} values in its rows")
    if all(_is_number(name) for name in names):
        raise FormatError(f"{path}: its first line holds numbers; write the names of the columns above them")
    if len(set(names)) < len(names):
        raise FormatError(f"{path}: two columns have the same name; rename one")
    return separator, why, dict(zip(names, values.T, strict=True))


def _no_lines_above(path: Path, lines: list[str]) -> None:
    """
    Raises:
        FormatError: lines of another length, as the settings that tools export, stand above the names.
    """
    for separator in (",", ";", "\t"):
        counts = [line.count(separator) for line in lines]
        above = next((len(lines) - i for i, count in enumerate(reversed(counts)) if count != counts[-1]), 0)
        names = lines[above].split(separator) if above < len(lines) - 10 else [""]
        if above > 1 and len(names) > 2 and not any(_is_number(name.strip('"')) for name in names):
            raise FormatError(
                f"{path} has {above} lines above the names of its columns ({', '.join(names[:2])}, ...); delete them: "
                f"tail -n +{above + 1} OLD > NEW"
            )


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _base(name: str) -> tuple[str, str]:
    """A column's name in small letters without its unit, and the unit it names (empty: none)."""
    plain = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name.replace("(/100)", "")).lower()
    if found := re.search(r"[\[(]\s*([a-z0-9/^ .°-]*?)\s*[\])]$", plain):
        unit = _UNITS.get(re.sub(r"[^a-z0-9]", "", found[1].replace("°", "deg")), "")
        if unit or not found[1]:
            return _joined(plain[: found.start()]), unit
    plain = _joined(plain)
    for words in (2, 1):  # `_m_s` before `_s`
        parts = plain.rsplit("_", words)
        unit = _UNITS.get("".join(parts[1:]), "") if len(parts) == words + 1 else ""
        if words == 2 and unit and "".join(parts[1:]) not in ("ms", "rads", "degs", "ms2"):
            unit = ""
        if words == 2 and "".join(parts[1:]) == "ms":
            unit = "m/s"
        if unit:
            return parts[0], unit
    return plain, ""


def _joined(name: str) -> str:
    return re.sub(r"[^a-z0-9]+", "_", name).strip("_")


def _time(table: dict[str, FloatArray], path: Path) -> Guess:
    rising = [n for n, v in table.items() if np.isfinite(v).all() and (np.diff(v) > 0.0).mean() > 0.95]
    named = [n for n in rising if _TIME.search(_base(n)[0])] or rising[:1]
    if not named:
        raise InputError(
            f"{path} has no column that rises from row to row and could be the time; it has {', '.join(table)}"
        )
    name, step = named[0], float(np.median(np.diff(table[named[0]])))
    by_step = "s" if step < 0.3 else "ms" if step < 300.0 else "us" if step < 3e5 else "ns"
    told = "us" if name == "time" and outputs.is_betaflight(table) else _base(name)[1]
    likely = told in _SECONDS and FEWEST_ROWS <= 1.0 / (step * _SECONDS[told]) <= MOST_ROWS
    unit = told if likely else by_step
    reason = f"rises by {step:g} from row to row: {1.0 / (step * _SECONDS[unit]):.0f} rows a second if in {unit}"
    if likely:
        reason += ", as its name says"
    elif told in _SECONDS and told != unit:
        reason += f" (its name says {told}: check)"
    return Guess("time", [name], {"unit": unit}, [reason])


FEWEST_ROWS, MOST_ROWS = 10.0, 10_000.0
"""Of a log in a second: within them the name tells the time's unit."""
_SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}


def _groups(names: list[str]) -> dict[str, dict[str, str]]:
    """Quantity to {component: column}, of complete groups only; the first group of a quantity wins."""
    found: dict[tuple[str, str, int], dict[str, str]] = {}
    for name in names:
        base = _base(name)[0]
        for number, (quantity, pattern) in enumerate(_PATTERNS):
            match = re.search(r"(?:^|_)" + pattern, base)
            if match is None or ("rotor" in quantity and _PWM.search(base)) or _BIAS.search(base):
                continue
            groups = match.groupdict()
            if groups.get("asked"):
                quantity = f"setpoint_{quantity}"
            prefix = base[: match.start()] + base[match.start() : match.start("c")]
            found.setdefault((quantity, prefix, number), {})[groups["c"]] = name
            break
    chosen: dict[str, dict[str, str]] = {}
    for (quantity, _, _), columns in found.items():
        ordered = dict(sorted(columns.items(), key=lambda item: (_ORDER.get(item[0], 0), item[0])))
        if quantity not in COLUMNS or quantity in chosen:
            continue
        rotors = quantity in ROTOR_QUANTITIES and 4 < len(ordered) <= MOST_ROTORS
        complete = (
            rotors or len(ordered) == len(COLUMNS[quantity]) or (set(ordered) & {"roll", "phi"} and len(ordered) == 3)
        )
        if complete:
            chosen[quantity] = ordered
    return chosen


def _are_shares(table: dict[str, FloatArray], columns: dict[str, str]) -> bool:
    """Whether nothing exceeds 1, which is too slow for a rotor."""
    return not any((table[name] > 1.0).any() for name in columns.values())


def _describe(guess: Guess, components: list[str], table: dict[str, FloatArray]) -> None:
    """Unit, and the order of a quaternion."""
    values = np.stack([table[name] for name in guess.columns], axis=1)
    told = _base(guess.columns[0])[1]
    guess.reasons.append(f"by their names, {', '.join(guess.columns)}")
    if guess.name.endswith("q_world_body"):
        _attitude(guess, components, values, told)
        return
    unit, reason = (told, f"unit {told} by the name") if told else by_size(guess.name, values)
    if _TURNS.search(_base(guess.columns[0])[0]):
        turning = values[values > 0.0]
        hundreds = 100.0 if not len(turning) or np.percentile(turning, 95.0) < MOST_HUNDREDS else 1.0
        unit, guess.entries["scale"] = "rpm", hundreds / (0.5 * POLES)
        reason = f"electrical revolutions{' in hundreds' if hundreds > 1.0 else ''}, {POLES:g} poles: CHECK"
    guess.entries["unit"] = unit
    guess.reasons.append(reason)
    if "rotor" in guess.name:
        guess.reasons.append("in the order of the rotors that `goshawk vehicle show` lists: CHECK")


def by_size(quantity: str, values: FloatArray) -> tuple[str, str]:
    """A unit that makes the numbers likely for a small vehicle."""
    finite = values[np.isfinite(values).all(axis=1)]
    if not len(finite):
        return COLUMN_UNITS[quantity][0], "unit not known: no finite values"
    most, usual = float(np.abs(finite).max()), float(np.median(np.linalg.norm(finite, axis=1)))
    si, other, bound = COLUMN_UNITS[quantity]
    if quantity.startswith("specific_force"):
        likely = other if 0.6 < usual < 1.6 else si
        return likely, f"its length is {usual:.2f} (median): {likely}"
    if "rotor" in quantity:
        usual = float(np.median(finite))
        most = usual
    if most > bound:
        return other, f"unit {other}: {most:g} is too much for {si}"
    return si, f"unit {si}: values up to {most:g} are plausible"


COLUMN_UNITS = {
    # quantity: SI unit, the other likely one, and the size from which the other is likelier
    "position_world_m": ("m", "mm", 200.0),
    "velocity_world_m_s": ("m/s", "mm/s", 60.0),
    "rate_body_rad_s": ("rad/s", "deg/s", 25.0),
    "specific_force_body_m_s2": ("m/s2", "g", 0.0),
    "rotor_speed_rad_s": ("rad/s", "rpm", 3000.0),
    "rotor_speed_command_rad_s": ("rad/s", "rpm", 3000.0),
    "setpoint_position_world_m": ("m", "mm", 200.0),
    "setpoint_velocity_world_m_s": ("m/s", "mm/s", 60.0),
}


def _attitude(guess: Guess, components: list[str], values: FloatArray, told: str) -> None:
    if len(components) == 3:
        guess.entries["order"] = "roll pitch yaw"
        most = float(np.nanmax(np.abs(values)))
        unit = told or ("deg" if most > 6.4 else "rad")
        guess.entries["unit"] = unit
        guess.reasons.append(f"unit {unit} " + ("by the name" if told else f"as values reach {most:.2f}"))
        return
    if "w" in components:
        guess.entries["order"] = "w x y z"
        guess.reasons.append("order by the names")
        return
    size = np.nanmedian(np.abs(values), axis=0)
    last = size[3] > size[0]
    guess.entries["order"] = "x y z w" if last else "w x y z"
    where = "fourth" if last else "first"
    guess.reasons.append(
        f"the {where} is usually the largest ({max(size[0], size[3]):.2f}): it is w of a level vehicle"
    )


def _frames(guesses: list[Guess], table: dict[str, FloatArray], *, down: bool) -> None:
    """z up, or z down where the vehicle would fly below the ground or gravity would pull up."""
    by_name = {guess.name: guess for guess in guesses}
    downward = "as north, east and down" if down else ""
    if (position := by_name.get("position_world_m")) is not None:
        z = table[position.columns[2]]
        low, high = np.nanpercentile(z, [5.0, 95.0])
        if high <= 0.05 * (high - low) and low < 0.0:
            downward = f"z runs from {low:.3g} to {high:.3g}: it flies below its origin unless z points down"
    force = by_name.get("specific_force_body_m_s2")
    if force is not None and np.nanmedian(table[force.columns[2]]) < 0.0:
        _down(force, "gravity's reaction is along -z: the body's z points down")
        downward = downward or "as the accelerometer's"
    if downward:
        for guess in guesses:
            if guess is not force and guess.name in COLUMNS and "rotor" not in guess.name:
                _down(guess, downward)


def _down(guess: Guess, reason: str) -> None:
    guess.entries["frame"] = "z down"
    guess.reasons.append(f"z down: {reason}")


def _outputs(found: Outputs) -> list[Guess]:
    """Numbered from 0 in their order."""
    order = "in the order of the rotors that `goshawk vehicle show` lists: CHECK"
    return [
        Guess(f"motor_command_{i}_ratio", [name], dict(found.keys), [found.said, order])
        for i, name in enumerate(found.columns)
    ]


def _scalars(table: dict[str, FloatArray], used: set[str], known: set[str]) -> list[Guess]:
    """Battery, and motor commands from 0 to 1, of which the first group counts, unless they are known."""
    found: list[Guess] = []
    for name, values in table.items():
        base, told = _base(name)
        finite = values[np.isfinite(values)]
        if name in used or not len(finite):
            continue
        if re.search(r"(^|_)(vbat|vbat_latest|vbatt|battery|batt|bat|battery_voltage|voltage)$", base):
            unit = told if told in ("V", "mV") else "mV" if np.median(finite) > 100.0 else "V"
            reasons = [f"battery by its name; unit {unit}, median {np.median(finite):g}"]
            if "battery_v" not in {*known, *(guess.name for guess in found)}:
                found.append(Guess("battery_v", [name], {"unit": unit}, reasons))
        if known & COMMANDS:
            continue
        match = re.search(r"(?:^|_)(?:cmd|command|u|motor_cmd|motor_command|control|actuator|throttle)_?([0-8])$", base)
        if match and finite.min() >= 0.0 and finite.max() <= 1.0:
            found.append(Guess(f"cmd {match[1]}", [name], {}, ["a motor command by its name, from 0 to 1"]))
        match = re.search(r"(?:^|_)m(?:otor)?_?([0-8])_?pwm(?:_?16)?$", base)
        if match and finite.min() >= 0.0 and _LARGEST_MICROSECONDS < finite.max() <= _MOST_PWM16:
            reasons = ["a motor command by its name, of 16 bits by its size"]
            found.append(Guess(f"cmd {match[1]}", [name], {"scale": 1.0 / _MOST_PWM16}, reasons))
    others = [guess for guess in found if not guess.name.startswith("cmd ")]
    commands = sorted((guess for guess in found if guess.name.startswith("cmd ")), key=lambda g: g.name)
    commands = [guess for guess in commands if guess.entries == commands[0].entries]  # of one kind
    for number, guess in enumerate(commands):
        guess.name = f"motor_command_{number}_ratio"
    return [*others, *commands]


def _is_flag(name: str, values: FloatArray) -> bool:
    """Whether the column says which rows are in the air."""
    return bool(re.search(r"fly|in_air|airborne", _base(name)[0])) and set(np.unique(values)) == {0.0, 1.0}


def _text(
    path: Path, separator: tuple[str, str], guesses: list[Guess], keep: str | None, unused: tuple[str, ...]
) -> str:
    """The map, with each guess's reasons above it."""
    lines = [
        f"# Column map of {path.name}, drafted from names and numbers. Each entry is a guess with its reason: check.",
        f"# Then see what looks wrong: goshawk log check {path.name} --columns THIS_FILE --vehicle VEHICLE",
        '# Keys: unit, frame ("z up", "z down"), order, scale, sign (1, -1, a list), offset, shift_s (added to times).',
        f"format = {json.dumps(FORMAT)}",
        f"version = {VERSION}",
        f"separator = {json.dumps(separator[0])}  # {separator[1]}",
    ]
    for guess in guesses:
        lines += ["", *(f"# {reason}" for reason in guess.reasons)]
        kind = (
            "time"
            if guess.name == "time"
            else f"quantity.{guess.name}"
            if guess.name in COLUMNS
            else f"scalar.{guess.name}"
        )
        lines.append(f"[{kind}]")
        if guess.name in COLUMNS:
            lines.append(f"columns = {json.dumps(guess.columns, ensure_ascii=False)}")
        else:
            lines.append(f"column = {json.dumps(guess.columns[0], ensure_ascii=False)}")
        lines += [f"{key} = {json.dumps(value)}" for key, value in guess.entries.items()]
    if keep is not None:
        lines += ["", "# it is only 0 and 1: the rows in the air, by its name", "[keep]"]
        lines += [f"column = {json.dumps(keep, ensure_ascii=False)}", "equals = 1"]
    if unused:
        lines += ["", f"# Not used: {', '.join(unused)}"]
    return "\n".join(lines) + "\n"
