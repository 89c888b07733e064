"""Tables and code in Markdown."""

import re
from collections.abc import Iterable, Sequence

SIGNS = re.compile(r"([*<\[\]]|(?<!\w)_|_(?!\w))")
"""Signs of emphasis, links and HTML; an underscore inside a word is none."""


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table; bars inside cells are escaped."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in line)} |" for line in lines)


def code(text: str) -> str:
    """Text in backticks; empty stays empty."""
    return f"`{text}`" if text else ""


def plain(text: str) -> str:
    """Text that says what it says: signs that Markdown would take for its own are escaped outside backticks."""
    parts = text.split("`")
    parts[::2] = [SIGNS.sub(r"\\\1", part) for part in parts[::2]]
    return "`".join(parts)


def codes(names: Iterable[str]) -> str:
    """Names in backticks, with commas between them."""
    return ", ".join(code(name) for name in names)


def number(value: float) -> str:
    """The shortest text of a value that was stored in single precision."""
    return f"{value:.6g}"
