"""Blackbox logs of Betaflight and INAV (`.BBL`, `.BFL`): header and main frames as a table of whole numbers.

A log is lines `H name:value`, then frames: `I` (whole), `P` (differences from what the frames before predict), and
others that are passed over. After damage, reading goes on at the next `I`.
https://betaflight.com/docs/development/Blackbox-Internals
"""

from array import array
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flight import FormatError
from sysid.logs.readers.blackbox_bytes import READERS, Bytes

START = b"H Product:Blackbox flight data recorder"
LONGEST_FRAME = 256
LARGEST_STEP_US = 10_000_000
LARGEST_HEADER = 1 << 17
_KINDS = frozenset(b"IPSGHE")
_EVENT_NUMBERS = {0: 1, 14: 2, 15: 1, 30: 2}
"""Event to how many variable-byte numbers it has."""


@dataclass(frozen=True, slots=True)
class Recorded:
    """One flight of a file."""

    header: dict[str, str]
    fields: dict[str, NDArray[np.int64]]
    """Field of the main frames to (n,) values."""
    lost: str
    """What could not be read, in one sentence; empty: nothing."""


@dataclass(frozen=True, slots=True)
class _Plan:
    """How the fields of one kind of frame are read: groups of fields that are packed together, and predictors."""

    groups: tuple[tuple[int, Callable[[Bytes, int], list[int]]], ...]
    predictors: tuple[int, ...]


def is_blackbox(head: bytes) -> bool:
    return START in head


def flights(content: bytes) -> list[tuple[int, int]]:
    """Where each flight of a file begins and ends, in bytes."""
    starts: list[int] = []
    at = content.find(START)
    while at >= 0:
        starts.append(at)
        at = content.find(START, at + 1)
    return list(zip(starts, [*starts[1:], len(content)], strict=True))


def read(path: Path, content: bytes, begin: int, end: int) -> Recorded:
    """The main frames of one flight.

    Raises:
        FormatError: its header does not say what the frames hold.
    """
    header, at = _header(content, begin, end)
    names = header.get("Field I name", "").split(",")
    whole, change = _plan(path, header, "I", "I"), _plan(path, header, "P", "I")
    if not {"loopIteration", "time"} <= set(names) or len(set(names)) < len(names):
        raise FormatError(
            f"{path}: the header at byte {begin} names no fields of its frames; the file is damaged there"
        )
    others = {ord(kind): _plan(path, header, kind, kind) for kind in "SGH" if f"Field {kind} name" in header}
    signed = _numbers(header, "Field I signed")
    low = [0 if signed[i : i + 1] == (0,) else 2**31 for i in range(len(names))]
    frames = _Frames(names, low, _constants(header), whole, change, others)
    skipped, first = frames.read(Bytes(content, at, end))
    lost = ""
    if skipped:
        where = "was cut" if first + skipped >= end else "is damaged"
        lost = f"the file {where} at byte {first} of {len(content)}: {skipped} bytes from there on are no whole frames"
    table = np.array(frames.rows, dtype=np.int64).reshape(-1, len(names))
    return Recorded(header, {name: table[:, i] for i, name in enumerate(names)}, lost)


def _header(content: bytes, at: int, end: int) -> tuple[dict[str, str], int]:
    """Name to value, and where the frames begin."""
    found: dict[str, str] = {}
    last = min(end, at + LARGEST_HEADER)
    while content[at : at + 2] == b"H " and at < last:
        stop = content.find(b"\n", at, last)
        if stop < 0:
            break
        name, _, value = content[at + 2 : stop].decode("ascii", "replace").partition(":")
        found.setdefault(name, value)
        at = stop + 1
    return found, at


def _numbers(header: dict[str, str], name: str) -> tuple[int, ...]:
    try:
        return tuple(int(word) for word in header.get(name, "").split(","))
    except ValueError:
        return ()


def _plan(path: Path, header: dict[str, str], kind: str, named: str) -> _Plan:
    count = len(header.get(f"Field {named} name", "").split(","))
    predictors, encodings = (_numbers(header, f"Field {kind} {what}") for what in ("predictor", "encoding"))
    if len(predictors) != count or len(encodings) != count or not set(encodings) <= set(READERS):
        raise FormatError(
            f"{path}: the header does not say how the {count} fields of {kind} frames are packed; it is damaged, or of "
            "another firmware than Betaflight and INAV"
        )
    groups, at = [], 0
    while at < count:
        most, reader = READERS[encodings[at]]
        size = 1
        while size < most and at + size < count and encodings[at + size] == encodings[at]:
            size += 1
        groups.append((size, reader))
        at += size
    return _Plan(tuple(groups), predictors)


def _constants(header: dict[str, str]) -> dict[int, int]:
    """Predictor to the number that it predicts."""
    low = _numbers(header, "motorOutput") or (0,)
    one = {4: "minthrottle", 9: "vbatref"}
    return {p: (_numbers(header, name) or (0,))[0] for p, name in one.items()} | {0: 0, 8: 1500, 11: low[0]}


class _Frames:
    """Frames read one after the other; `rows` holds the main ones."""

    def __init__(
        self,
        names: list[str],
        low: list[int],
        constants: dict[int, int],
        whole: _Plan,
        change: _Plan,
        others: dict[int, _Plan],
    ) -> None:
        """`low`: what the smallest value of each field is below zero."""
        self.rows = array("q")
        self._low = low
        self._constants, self._whole, self._change, self._others = constants, whole, change, others
        self._motor = names.index("motor[0]") if "motor[0]" in names else -1
        self._time, self._count = names.index("time"), len(names)
        self._last: list[int] | None = None
        self._before: list[int] | None = None

    def read(self, data: Bytes) -> tuple[int, int]:
        """How many bytes were passed over, and where the first of them is."""
        skipped, first = 0, -1
        while data.at < data.end:
            start = data.at
            try:
                more = self._frame(data)
            except EOFError:
                more = None
            if more is False:
                break
            if more is None:
                first = start if first < 0 else first
                data.at = self._next_whole(data.content, start + 1, data.end)
                skipped += data.at - start
        return skipped, first

    def _next_whole(self, content: bytes, at: int, end: int) -> int:
        self._last = self._before = None
        found = content.find(b"I", at, end)
        return end if found < 0 else found

    def _frame(self, data: Bytes) -> bool | None:
        """Read one frame: True done, False the log ends, None it is damaged."""
        start = data.at
        kind = data.byte()
        if kind == 0x45:
            return self._event(data)
        row: list[int] | None = None
        if kind == 0x49:
            row = self._values(data, self._whole)
        elif kind == 0x50 and self._last is not None:
            row = self._values(data, self._change)
        elif kind in self._others:
            self._numbers(data, self._others[kind])
        else:
            return None
        ends_well = data.at == data.end or data.content[data.at] in _KINDS
        if data.at - start > LONGEST_FRAME or not ends_well:
            return None
        return row is None or self._keep(row, whole=kind == 0x49)

    def _keep(self, row: list[int], *, whole: bool) -> bool | None:
        if self._last is not None and (row[self._time] - self._last[self._time]) & 0xFFFFFFFF > LARGEST_STEP_US:
            return None
        self._before = row if whole else self._last
        self._last = row
        self.rows.extend(row)
        return True

    def _numbers(self, data: Bytes, plan: _Plan) -> list[int]:
        values: list[int] = []
        for count, reader in plan.groups:
            values += reader(data, count)
        return values

    def _values(self, data: Bytes, plan: _Plan) -> list[int]:
        values = self._numbers(data, plan)
        constants, last, before = self._constants, self._last, self._before
        for i, predictor in enumerate(plan.predictors):
            if predictor in constants:
                values[i] += constants[predictor]
            elif predictor == 5:
                values[i] += values[self._motor] if 0 <= self._motor < i else 0
            elif last is not None and before is not None:
                if predictor == 1:
                    values[i] += last[i]
                elif predictor == 2:
                    values[i] += 2 * last[i] - before[i]
                elif predictor == 3:
                    values[i] += int((last[i] + before[i]) / 2)
                elif predictor == 6:
                    values[i] += last[i] + 1
            values[i] = (values[i] + self._low[i] & 0xFFFFFFFF) - self._low[i]  # the firmware counts in 32 bits
        return values

    def _event(self, data: Bytes) -> bool | None:
        kind = data.byte()
        if kind == 255:
            return False if data.content[data.at : data.at + 10] == b"End of log" else None
        if kind == 13:
            if data.byte() < 128:
                data.signed()
            else:
                data.little(4)
            return True
        if kind not in _EVENT_NUMBERS:
            return None
        for _ in range(_EVENT_NUMBERS[kind]):
            data.unsigned()
        if kind == 14:
            self._last = self._before = None  # a pause: the next frame is a whole one
        return True
