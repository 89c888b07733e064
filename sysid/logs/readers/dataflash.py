"""ArduPilot's self-describing log (DataFlash `.BIN`, and its text form `.log`) as one table for each message.

A message is `0xA3 0x95 type` and its fields without gaps, little-endian; messages `FMT` (type 128) give name, length,
one letter a field and the fields' names. https://ardupilot.org/dev/docs/code-overview-adding-a-new-log-message.html
"""

from array import array
from collections.abc import Collection
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flight import FormatError

HEAD = b"\xa3\x95"
FORMAT_TYPE, FORMAT_BYTES = 128, 89
LETTERS = {
    # letter of FMT: NumPy's type, and what one is worth
    "b": ("i1", 1.0), "B": ("u1", 1.0), "h": ("<i2", 1.0), "H": ("<u2", 1.0), "i": ("<i4", 1.0), "I": ("<u4", 1.0),
    "f": ("<f4", 1.0), "d": ("<f8", 1.0), "q": ("<i8", 1.0), "Q": ("<u8", 1.0), "g": ("<f2", 1.0), "M": ("u1", 1.0),
    "c": ("<i2", 0.01), "C": ("<u2", 0.01), "e": ("<i4", 0.01), "E": ("<u4", 0.01), "L": ("<i4", 1e-7),
    "n": ("S4", 0.0), "N": ("S16", 0.0), "Z": ("S64", 0.0), "a": ("V64", 0.0),
}  # fmt: skip

Table = dict[str, NDArray[Any]]
"""Field to (n,) values: float64, or bytes where it is text."""


@dataclass(frozen=True, slots=True)
class Tables:
    """What was read."""

    tables: dict[str, Table]
    """Message name to its table; only those asked for that occur."""
    names: tuple[str, ...]
    """All messages the file has."""
    lost: str
    """What could not be read, in one sentence; empty: nothing."""


@dataclass(slots=True)
class _Form:
    name: str
    dtype: np.dtype[Any]
    scale: dict[str, float]
    count: int = 0
    at: "array[int]" = field(default_factory=lambda: array("Q"))
    """Where each message begins, if it is asked for."""


def is_binary(head: bytes) -> bool:
    return head[:3] == HEAD + bytes([FORMAT_TYPE])


def is_text(head: bytes) -> bool:
    return b"FMT, 128, 89, FMT" in head[:4096]


def read(path: Path, wanted: Collection[str]) -> Tables:
    """The tables of some messages.

    Raises:
        FormatError: it is not such a log.
    """
    content = path.read_bytes()
    return _text(path, content, wanted) if is_text(content[:4096]) else _binary(path, content, wanted)


def _binary(path: Path, content: bytes, wanted: Collection[str]) -> Tables:
    forms: dict[int, _Form] = {}
    lengths = {FORMAT_TYPE: FORMAT_BYTES}
    at, end, skipped, first = 0, len(content), 0, -1
    while at < end:
        size = lengths.get(content[at + 2], 0) if content[at : at + 2] == HEAD and at + 2 < end else 0
        if size == 0 or at + size > end:
            first = at if first < 0 else first
            next_at = content.find(HEAD, at + 1)
            next_at = end if next_at < 0 else next_at
            skipped, at = skipped + next_at - at, next_at
            continue
        kind = content[at + 2]
        if kind == FORMAT_TYPE:
            _learn(content[at + 3 : at + size], forms, lengths)
        elif kind in forms:
            forms[kind].count += 1
            if forms[kind].name in wanted:
                forms[kind].at.append(at)
        at += size
    if not forms:
        raise FormatError(f"{path} is no ArduPilot log: no message in it says what the others hold (FMT)")
    tables = {f.name: _gathered(content, f) for f in forms.values() if f.at}
    lost = _lost(first, skipped, end) if skipped else ""
    return Tables(tables, tuple(sorted(f.name for f in forms.values() if f.count)), lost)


def _lost(first: int, skipped: int, end: int) -> str:
    where = "was cut" if first + skipped == end else "is damaged"
    return f"the file {where} at byte {first} of {end}: {skipped} bytes from there on are no whole messages"


def _learn(body: bytes, forms: dict[int, _Form], lengths: dict[int, int]) -> None:
    """Take up what one FMT message says; the first of a type counts, and one that cannot be true is passed over."""
    kind, length = body[0], body[1]
    if kind in lengths or length < len(HEAD) + 1:
        return
    lengths[kind] = length
    name, letters, names = (
        body[a:b].split(b"\0")[0].decode("ascii", "replace") for a, b in ((2, 6), (6, 22), (22, 86))
    )
    fields = names.split(",")
    if len(fields) != len(letters) or len(set(fields)) < len(fields) or not all(fields) or set(letters) - set(LETTERS):
        return
    dtype = np.dtype([(f, LETTERS[c][0]) for f, c in zip(fields, letters, strict=True)])
    if dtype.itemsize + 3 == length:
        forms[kind] = _Form(name, dtype, {f: LETTERS[c][1] for f, c in zip(fields, letters, strict=True)})


def _gathered(content: bytes, form: _Form) -> Table:
    raw = b"".join(content[at + 3 : at + 3 + form.dtype.itemsize] for at in form.at)
    values = np.frombuffer(raw, dtype=form.dtype)
    return {
        name: values[name] if scale == 0.0 else np.asarray(values[name], dtype=np.float64) * scale
        for name, scale in form.scale.items()
    }


def _text(path: Path, content: bytes, wanted: Collection[str]) -> Tables:
    """Lines such as `ATT, 1234567, 0.1, ...`; their numbers are scaled already."""
    fields: dict[str, list[tuple[str, bool]]] = {}
    rows: dict[str, list[list[Any]]] = {}
    names: set[str] = set()
    bad: list[int] = []
    for number, line in enumerate(content.decode("utf-8", "replace").splitlines(), 1):
        cells = [cell.strip() for cell in line.split(",")]
        if cells[0] == "FMT" and len(cells) >= 6:
            fields.setdefault(cells[3], [(name, c in "nNZaM") for c, name in zip(cells[4], cells[5:], strict=False)])
        elif cells[0] in fields and len(cells) == 1 + len(fields[cells[0]]):
            names.add(cells[0])
            row = _row(cells[1:], fields[cells[0]]) if cells[0] in wanted else []
            bad += [number] if row is None else []
            rows.setdefault(cells[0], []).extend([row] if row else [])
        elif line.strip():
            bad.append(number)
    if not fields:
        raise FormatError(f"{path} is no ArduPilot log: no line of it says what the others hold (FMT)")
    tables = {name: _columns(rows[name], fields[name]) for name in names if rows[name]}
    lost = f"{len(bad)} lines are damaged or cut, the first is line {bad[0]}" if bad else ""
    return Tables(tables, tuple(sorted(names)), lost)


def _row(cells: list[str], fields: list[tuple[str, bool]]) -> list[Any] | None:
    """The values of a line: numbers, and bytes where it is text; None where one is no number."""
    try:
        return [cell.encode() if word else float(cell) for cell, (_, word) in zip(cells, fields, strict=True)]
    except ValueError:
        return None


def _columns(rows: list[list[Any]], fields: list[tuple[str, bool]]) -> Table:
    values = zip(*rows, strict=True)
    return {name: np.array(column) for (name, _), column in zip(fields, values, strict=True)}
