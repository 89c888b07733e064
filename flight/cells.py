"""Numbers in the cells of tables that others wrote: a word is refused, never read as missing."""

import math
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from flight.errors import FormatError
from flight.rotations import FloatArray

MISSING = ("", "nan", "NaN", "NA", "-nan")
"""What a cell may hold where a value is missing; `-nan` is what C prints."""


def number(cell: str | None, path: Path, line: int, column: str) -> float:
    """The number in a cell; NaN where it is missing.

    Raises:
        FormatError: the cell holds neither; the message says which cell and what it holds.
    """
    text = (cell or "").strip()
    if text in MISSING:
        return math.nan
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if math.isnan(value):
        raise FormatError(
            f"{path}, line {line}, column {column}: {text[:60]!r} is not a number; where a value is missing, leave the "
            f"cell empty or write {', '.join(MISSING[1:-1])}"
        )
    return value


def numbers(cells: Iterable[tuple[int, str | None]], path: Path, column: str) -> FloatArray:
    """The numbers of a column whose cells come with their lines; raises as `number`."""
    return np.array([number(cell, path, line, column) for line, cell in cells], dtype=np.float64)
