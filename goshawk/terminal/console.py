"""Output shared by the verbs: progress on stderr, a short table or JSON on stdout."""

import contextlib
import math
import signal
import sys
import time
from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from flight import InputError, Progress, file_format
from goshawk.terminal.words import with_unit

if TYPE_CHECKING:
    from planner import PlanOptions

json_option = click.option("--json", "as_json", is_flag=True, help="Print the facts as JSON instead of a table.")


def path_option(name: str, destination: str, help: str, *, required: bool = False) -> Any:
    """An option that takes a path. Its existence is checked where it is read, with a more specific message."""
    return click.option(name, destination, type=click.Path(path_type=Path), required=required, help=help)


map_option = path_option("--map", "map_folder", "Map folder, as `goshawk map` wrote it.", required=True)
vehicle_option = path_option("--vehicle", "vehicle_file", "Vehicle file.", required=True)
radius_option = click.option(
    "--radius",
    "radius_m",
    type=float,
    help="Radius of the sphere that encloses the vehicle, metres [default: its propellers'].",
)
margin_option = click.option(
    "--margin", "margin_m", type=float, help="Clearance to keep beyond that sphere, metres [default: 0.15]."
)

columns_option = path_option(
    "--columns", "columns", "Column map: TOML file that describes a CSV's columns or ROS topics."
)
url_option = click.option(
    "--vehicle-url",
    "url",
    default="udp://127.0.0.1:14550",
    show_default=True,
    help="Address of the vehicle's MAVLink endpoint.",
)
key_option = path_option("--key", "key_file", "Key file that signs the link [default: ~/.config/goshawk/link.key].")


def body_options(radius_m: float | None, margin_m: float | None) -> "PlanOptions":
    """The planner's options with --radius and --margin where they are given."""
    from planner import PlanOptions

    given = {"radius_m": radius_m, "margin_m": margin_m}
    return replace(PlanOptions(), **{name: value for name, value in given.items() if value is not None})


def numbers(option: str, text: str, count: int | None = None) -> list[float]:
    """The finite numbers of an option like `1.0,2.5,0`; exactly `count` of them unless it is None."""
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    wanted = "a finite number" if count == 1 else f"{count or 'a list of'} finite numbers like 1.0,2.5,0"
    if not values or not all(map(math.isfinite, values)) or len(values) != (count or len(values)):
        raise InputError(f"{option} {text!r} is not {wanted}")
    return values


def assignment(text: str) -> tuple[str, float]:
    """Name and value of `NAME=VALUE`.

    Raises:
        InputError: it is not such an assignment.
    """
    name, equals, value = text.partition("=")
    try:
        return name.strip(), float(value if equals else "")
    except ValueError:
        raise InputError(f"{text!r} is not NAME=VALUE with a number, like mass_kg=0.72") from None


@contextlib.contextmanager
def progress() -> Generator[Progress]:
    """A progress callable: one line on a terminal, a line per stage elsewhere; always on stderr."""
    if not sys.stderr.isatty():
        yield _LinePerStage()
        return
    from goshawk.terminal.progress_line import progress_line

    with progress_line() as line:
        yield line


@contextlib.contextmanager
def cancel_by_ctrl_c() -> Generator[Callable[[], bool]]:
    """The `cancel` argument of a link: true after the first Ctrl-C. The second one interrupts as usual.

    After a cancelled upload or flight the verb reports the vehicle's state and exits with code 130.
    """
    from firmware_bridge import CancelledError

    pressed = False

    def note(*_: object) -> None:
        nonlocal pressed
        pressed = True
        signal.signal(signal.SIGINT, before)

    before = signal.signal(signal.SIGINT, note)
    try:
        yield lambda: pressed
    except CancelledError as error:
        click.echo(f"goshawk: {error}", err=True)
        raise click.exceptions.Exit(130) from None
    finally:
        signal.signal(signal.SIGINT, before)


class _LinePerStage:
    """Progress for logs: each stage once, with the seconds the one before took."""

    def __init__(self) -> None:
        self._stage = ""
        self._began = time.monotonic()

    def __call__(self, stage: str, fraction: float) -> None:
        if stage != self._stage:
            self._stage = stage
            click.echo(f"  [{time.monotonic() - self._began:6.1f} s] {stage}", err=True)


def show(title: str, facts: Mapping[str, object], *, as_json: bool, document: Mapping[str, Any] | None = None) -> None:
    """Print facts as a two-column table, or (with --json) `document`, by default the facts themselves."""
    if as_json:
        click.echo(file_format.json_text(document if document is not None else facts), nl=False)
        return
    rows = [with_unit(name, value) for name, value in facts.items()]
    table(title, ("", ""), [(words, _text(value)) for words, value in rows])


def table(title: str, heads: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table

    with_heads = any(heads)
    drawn = Table(title=title, title_justify="left", title_style="bold", box=box.SIMPLE_HEAD, show_header=with_heads)
    for i, head in enumerate(heads):
        numeric = with_heads and all(isinstance(row[i], int | float) for row in rows)
        # names are typed again: a long one is folded, never cut
        drawn.add_column(head, justify="right" if numeric else "left", overflow="fold")
    for row in rows:
        drawn.add_row(*[_text(cell) for cell in row])
    console = Console(highlight=False)
    console.width = console.width if console.is_terminal else max(console.width, 120)
    console.print(drawn)


def _text(value: object) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
