"""What the station keeps in `.session/` and can do without: a file that cannot be read counts as missing."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import msgspec

T = TypeVar("T")


def read(path: Path, kind: type[T], decode: Callable[..., Any] = msgspec.json.decode) -> T | None:
    """What was saved; None where there is none, or it is damaged."""
    try:
        return decode(path.read_bytes(), type=kind)
    except (OSError, msgspec.DecodeError, UnicodeDecodeError, RecursionError):
        return None
