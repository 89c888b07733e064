"""Shared by the benchmark scripts: rows, the printed table, `--json FILE`, CPU seconds."""

import argparse
import json
import os
import platform
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any


@dataclass(frozen=True, slots=True)
class Row:
    """One measured number, the bar it is held against, and what the peers scored in the same process."""

    name: str
    value: float
    unit: str
    bar: str | None = None
    ok: bool | None = None
    peers: dict[str, float] = field(default_factory=dict)


def row(
    name: str,
    value: float,
    unit: str,
    bar: str | None = None,
    ok: bool | None = None,
    peers: dict[str, float] | None = None,
) -> Row:
    return Row(name, float(value), unit, bar, None if ok is None else bool(ok), dict(peers or {}))


def cpu_seconds(work: Callable[[], Any], repeats: int = 3) -> float:
    """Least CPU time (all threads) of a few runs: what the work costs when nothing else disturbs it."""
    best = float("inf")
    for _ in range(repeats):
        start = time.process_time()
        work()
        best = min(best, time.process_time() - start)
    return best


def machine() -> dict[str, Any]:
    model = next(
        (line.split(":", 1)[1].strip() for line in _cpuinfo() if line.startswith("model name")), platform.processor()
    )
    return {
        "cpu": model,
        "cores": os.cpu_count(),
        "load": os.getloadavg()[0],
        "python": platform.python_version(),
        "system": platform.system(),
    }


def _cpuinfo() -> list[str]:
    path = Path("/proc/cpuinfo")
    return path.read_text().splitlines() if path.exists() else []


def main(rows: Callable[..., list[Row]], **options: int | str) -> None:
    """Run a benchmark script: measure, print the table, write the JSON if asked.

    Args:
        options: numbers or words that `rows` takes by name, each an option with this default.
    """
    parser = argparse.ArgumentParser(description=rows.__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name, default in options.items():
        parser.add_argument(f"--{name}", type=type(default), default=default, help="[default: %(default)s]")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the rows here")
    arguments = parser.parse_args()
    measured = rows(**{name: getattr(arguments, name) for name in options})
    print_table(measured)
    if arguments.json:
        write(measured, arguments.json)


def write(measured: list[Row], path: Path) -> None:
    """The rows with the machine, and its load over the last minute, as JSON."""
    body = {"machine": machine(), "rows": [asdict(r) for r in measured]}
    path.write_text(json.dumps(body, indent=1) + "\n")


def print_table(measured: list[Row]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table("measured", "value", "unit", "bar", "ok", "peers")
    for r in measured:
        verdict = {True: "[green]yes[/]", False: "[red]no[/]", None: ""}[r.ok]
        peers = ", ".join(f"{name} {value:.4g}" for name, value in r.peers.items())
        table.add_row(r.name, f"{r.value:.4g}", r.unit, r.bar or "", verdict, peers)
    Console().print(table)
