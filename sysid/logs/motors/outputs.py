"""Which columns of a foreign table are outputs to the motors, and over which range: decided by the names first.

What is called pwm, or is in microseconds, can only be pulses; DShot only what Betaflight's tools call `motor[i]`.
"""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from flight.rotations import FloatArray

PULSES, DSHOT = (1000.0, 2000.0), (48.0, 2047.0)
"""Outputs from stop to full: of pulses in microseconds, and of DShot."""
SPARE_US = 48.0
"""By which pulses may lie outside; smaller ones are a disarmed motor's."""
MOST_AT_REST = 2
"""Values below the least pulse: 0 and what is sent when disarmed. More are no pulses."""
FEWEST = 4
"""Motors."""
LEAST_DSHOT_TOP = 256.0
"""What DShot of a flight surely exceeds, and 8 bits or percent do not."""
_PULSE = re.compile(r"(?:^|_)(?:(?:m|mot|motor|esc|output)_?([0-8])_?pwm|pwm_?([0-8]))$")
_MOTOR = re.compile(r"(?:^|_)(?:m|mot|motor|esc|output)_?([0-8])$")
_BETAFLIGHT = re.compile(r"motor\[([0-7])\]$")
_MARKS = re.compile(
    r"(loopIteration|(gyroADC|gyroUnfilt|accSmooth|rcCommand|eRPM(\(/100\))?)\[0\]|vbatLatest)( \(.*\))?$"
)
"""Other columns of Betaflight's tables, with or without a unit."""
_NO_MOTOR = re.compile(r"(^|_)(rc|rcin|rc_in|in|input|radio|servo)(_|$)")
_TURNS = re.compile(r"eRPM(\(/100\))?\[0\]")


@dataclass(frozen=True, slots=True)
class Outputs:
    """Columns that hold a motor's output each."""

    columns: tuple[str, ...] = ()
    low: float = 0.0
    high: float = 1.0
    said: str = ""
    """What they were taken for, and why."""
    left_out: tuple[str, ...] = ()
    """Columns that are outputs by their names, of a range that nobody knows."""

    @property
    def keys(self) -> dict[str, float]:
        """Of a column map: to shares of full throttle."""
        return {"scale": 1.0 / (self.high - self.low), "offset": -self.low / (self.high - self.low)}


def is_betaflight(table: Mapping[str, FloatArray]) -> bool:
    """Whether its columns are named as Betaflight's tools do."""
    return any(_MARKS.match(name) for name in table)


def found(table: Mapping[str, FloatArray], base: Callable[[str], tuple[str, str]]) -> Outputs:
    """Of a table's columns (n,) by name.

    Args:
        base: a column's name in small letters without its unit, and the unit.
    """
    if is_betaflight(table):
        named = {name: match[1] for name in table if (match := _BETAFLIGHT.match(name))}
        if named:
            return _betaflight(table, tuple(sorted(named, key=named.__getitem__)))
    groups: dict[str, dict[str, str]] = {}
    for name in table:
        plain, unit = base(name)
        if (number := _pulse_number(plain, unit)) and not _NO_MOTOR.search(plain):
            groups.setdefault(plain.replace(number, "", 1), {})[number] = name
    named = next((group for group in groups.values() if len(group) >= FEWEST), {})
    return _pulses(table, tuple(named[number] for number in sorted(named)))


def _pulse_number(base: str, unit: str) -> str:
    """Of the motor; empty where the name is none of pulses."""
    match = _PULSE.search(base) if unit in ("", "us") else None
    match = match or (_MOTOR.search(base) if unit == "us" else None)
    return next(part for part in match.groups() if part) if match else ""


def _betaflight(table: Mapping[str, FloatArray], names: tuple[str, ...]) -> Outputs:
    """DShot in whole numbers, or pulses; eRPM beside, which DShot alone tells, decides where both are possible."""
    values = _values(table, names)
    whole = len(values) > 0 and bool((values == np.round(values)).all())
    turns = any(_TURNS.match(name) for name in table)
    if whole and values.min() >= 0.0 and LEAST_DSHOT_TOP <= values.max() <= DSHOT[1]:
        if turns or not _are_pulses(values):
            return Outputs(names, *DSHOT, "Betaflight's outputs, DShot from 48 to 2047")
        return Outputs(
            names, *PULSES, "Betaflight's outputs, pulses of 1000 to 2000 us, or DShot from 48 to 2047: CHECK"
        )
    return Outputs(left_out=names)


def _pulses(table: Mapping[str, FloatArray], names: tuple[str, ...]) -> Outputs:
    """Of those that move: outputs that nothing is connected to stay where they are."""
    moving = tuple(name for name in names if len(np.unique(table[name][np.isfinite(table[name])])) > 1)
    values, first = _values(table, moving), names.index(moving[0]) if moving else 0
    together = moving == names[first : first + len(moving)]  # else one of them was not logged
    if len(moving) >= FEWEST and together and _are_pulses(values):
        return Outputs(moving, *PULSES, "a motor output by its name, pulses of 1000 to 2000 us")
    sixteen_bits = len(values) > 0 and values.max() > PULSES[1] + 2.0 * SPARE_US
    return Outputs() if sixteen_bits else Outputs(left_out=names)


def _are_pulses(values: FloatArray) -> bool:
    """Whether all lie within the range but for those of a motor at rest."""
    at_rest = values[values < PULSES[0] - SPARE_US]
    return (
        len(at_rest) < len(values) and len(np.unique(at_rest)) <= MOST_AT_REST and values.max() <= PULSES[1] + SPARE_US
    )


def _values(table: Mapping[str, FloatArray], names: tuple[str, ...]) -> FloatArray:
    """All that are numbers."""
    every = np.concatenate([table[name] for name in names] or [np.empty(0)])
    return every[np.isfinite(every)]
