"""What a verb prints, as data: lines and tables in their order, so that a result can be kept and shown again."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import click

from goshawk.terminal import console


@dataclass(frozen=True, slots=True)
class Screen:
    """Lines and tables."""

    parts: list[dict[str, Any]] = field(default_factory=list[dict[str, Any]])
    """Each with `line`, or with `table` (its title), `heads` and `rows`; plain JSON values."""

    def line(self, text: str) -> None:
        self.parts.append({"line": text})

    def table(self, title: str, heads: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
        self.parts.append({"table": title, "heads": list(heads), "rows": [list(row) for row in rows]})

    def show(self) -> None:
        for part in self.parts:
            if "line" in part:
                click.echo(part["line"])
            else:
                console.table(part["table"], part["heads"], part["rows"])
