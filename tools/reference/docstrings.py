"""Docstrings as Sphinx is to read them: plain sentences with code in single backticks, and public names only."""

import re
from typing import Any

from sphinx.ext.napoleon import Config, GoogleDocstring

ESCAPED = re.compile(r"([*|\\]|(?<=\w)_(?!\w))")
"""Signs that would be markup: emphasis, substitution, escape, reference."""
ARRAY = re.compile(r"~?numpy\.ndarray\[tuple\[~?typing\.Any, \.\.\.\], ~?numpy\.dtype\[(~?[\w.]+)\]\]")
"""What the alias `NDArray[...]` was resolved to."""


def prepare(app: Any, what: str, name: str, found: object, options: object, lines: list[str]) -> None:
    """Sphinx's `autodoc-process-docstring`: escape what is no markup, then turn `Args:` and the like into fields.

    Napoleon alone would take what stands before an attribute's first colon for its type.
    """
    in_block = False
    for i, line in enumerate(lines):
        in_block = line.startswith("    ") if in_block or lines[i - 1].endswith("::") else False
        if not in_block:
            lines[i] = _escaped(line)
    if what not in ("attribute", "property", "data"):
        lines[:] = GoogleDocstring(lines, Config(napoleon_use_rtype=False), what=what).lines()


def _escaped(line: str) -> str:
    parts = line.split("`")
    parts[::2] = [ESCAPED.sub(r"\\\1", part) for part in parts[::2]]
    return "`".join(parts)


def shorten(
    app: Any, what: str, name: str, found: object, options: object, arguments: str | None, returned: str | None
) -> tuple[str | None, str | None]:
    """Sphinx's `autodoc-process-signature`: leave private fields out, and write array types as the source has them."""
    if arguments is not None:
        arguments = ARRAY.sub(r"~numpy.typing.NDArray[\1]", _without_private(arguments))
    return arguments, ARRAY.sub(r"~numpy.typing.NDArray[\1]", returned) if returned is not None else None


def _without_private(arguments: str) -> str:
    """`(grid: Grid, _states: dict[int, str])` without what begins with an underscore."""
    parts, depth = [""], 0
    for sign in arguments[1:-1]:
        depth += (sign in "([{") - (sign in ")]}")
        if sign == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += sign
    return f"({', '.join(part.strip() for part in parts if not part.strip().startswith('_'))})"
