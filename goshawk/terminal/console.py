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

from flight import InputError, Progress, file_format, silent
from goshawk.terminal.words import with_unit

if TYPE_CHECKING:
    from planner import PlanOptions

_QUIET = "goshawk.quiet"


def _keep_quiet(context: click.Context, _: click.Parameter, quiet: bool) -> None:
    if quiet:
        context.meta[_QUIET] = True


def common_options(verb: Any) -> Any:
    """`-q` and `--json`, which every verb has."""
    quiet = click.option(
        "-q", "--quiet", is_flag=True, expose_value=False, callback=_keep_quiet,
        help="Print no progress and no notes on stderr.",
    )  # fmt: skip
    as_json = click.option("--json", "as_json", is_flag=True, help="Print JSON on stdout instead of a table.")
    return quiet(as_json(verb))


def is_quiet() -> bool:
    """Whether the verb that runs was given `-q`."""
    context = click.get_current_context(silent=True)
    return context is not None and bool(context.meta.get(_QUIET))


def note(sentence: str) -> None:
    """A remark on stderr, which `-q` suppresses; warnings and errors are not remarks."""
    if not is_quiet():
        click.echo(sentence, err=True)


def path_option(name: str, destination: str, help: str, *, required: bool = False) -> Any:
    """An option that takes a path. Its existence is checked where it is read, with a more specific message."""
    return click.option(name, destination, type=click.Path(path_type=Path), required=required, help=help)


map_option = path_option("--map", "map_folder", "Map folder, as `goshawk map build` writes it.", required=True)
vehicle_option = path_option("--vehicle", "vehicle_file", "Vehicle file.", required=True)
yes_option = click.option("--yes", is_flag=True, help="Do not ask for confirmation.")
dry_run_option = click.option("--dry-run", is_flag=True, help="Show the changes without making them.")
radius_option = click.option(
    "--radius",
    "radius_m",
    type=float,
    help="Radius of the sphere that encloses the vehicle, metres [default: its propellers'].",
)
margin_option = click.option(
    "--margin", "margin_m", type=float, help="Clearance to keep beyond the vehicle's sphere, metres [default: 0.15]."
)

columns_option = path_option(
    "--columns", "columns", "Column map: TOML file that describes a CSV's columns or ROS topics."
)


def _address(_context: click.Context, _option: click.Parameter, url: str) -> str:
    """The address, refused before the key is looked for."""
    from firmware_bridge.port import parse_url

    parse_url(url)
    return url


url_option = click.option(
    "--url",
    "url",
    default="udp://127.0.0.1:14550",
    show_default=True,
    callback=_address,
    help="Address of the vehicle's MAVLink endpoint.",
)
take_over_option = click.option("--take-over", is_flag=True, help="Take control from the station that has it.")
key_option = path_option("--key", "key_file", "Key file that signs the link [default: ~/.config/goshawk/link.key].")


def gust_option(untold: str, default: float | None = None) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """`--gust-std`, whose help says what is taken where it is not given."""
    said = f"Standard deviation of gusts, m/s [default: {untold}]."
    return click.option("--gust-std", "gust_std_m_s", type=click.FloatRange(min=0.0), default=default, help=said)


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
    like = ",".join(("1.0", "2.5", "0", "4", "5.5", "6")[: count or 3])
    wanted = "a finite number" if count == 1 else f"{count or 'a list of'} finite numbers like {like}"
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


def confirm(question: str, *, yes: bool, as_json: bool) -> None:
    """Ask before a change; `yes` is the answer already.

    Raises:
        Abort: the answer is no.
        UsageError: there is nobody to ask.
    """
    if yes:
        return
    if as_json or not sys.stdin.isatty():
        raise click.UsageError("this needs a confirmation: give --yes, or --dry-run to see the changes")
    click.confirm(question, abort=True, err=True)


@contextlib.contextmanager
def progress() -> Generator[Progress]:
    """A progress callable: one line on a terminal, a line per stage elsewhere; on stderr, and none with `-q`."""
    if is_quiet():
        yield silent
        return
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
    """Print a table; as one paragraph a row where the terminal is too narrow for the names in its columns."""
    from rich import box
    from rich.console import Console
    from rich.table import Table

    console = Console(highlight=False, markup=False, emoji=False)
    console.width = console.width if console.is_terminal else max(console.width, 120)
    if _least_width(heads, rows) > console.width:
        _paragraphs(console, title, heads, rows)
        return
    with_heads = any(heads)
    drawn = Table(title=title, title_justify="left", title_style="bold", box=box.SIMPLE_HEAD, show_header=with_heads)
    for i, (head, width) in enumerate(zip(heads, _widths(heads, rows, console.width), strict=True)):
        numeric = with_heads and all(isinstance(row[i], int | float) for row in rows)
        drawn.add_column(head, justify="right" if numeric else "left", width=width)
    for row in rows:
        drawn.add_row(*[_text(cell) for cell in row])
    console.print(drawn)


def _least_width(heads: Sequence[str], rows: Sequence[Sequence[object]]) -> int:
    """Of a table that folds no word: names are typed again."""
    return sum(_longest_word(head, rows, i) + 3 for i, head in enumerate(heads)) + 1


def _widths(heads: Sequence[str], rows: Sequence[Sequence[object]], width: int) -> list[int]:
    """Of the columns: a word at least, and what is left over where it spares a fold; Rich alone would fold words."""
    widths = [_longest_word(head, rows, i) for i, head in enumerate(heads)]
    whole = [max([len(head), *(len(_text(row[i])) for row in rows)]) for i, head in enumerate(heads)]
    spare, order = width - _least_width(heads, rows), sorted(range(len(heads)), key=lambda i: whole[i] - widths[i])
    for n, i in enumerate(order):
        more = min(whole[i] - widths[i], spare // (len(order) - n))
        widths[i], spare = widths[i] + more, spare - more
    return widths


def _longest_word(head: str, rows: Sequence[Sequence[object]], column: int) -> int:
    words = " ".join([head, *(_text(row[column]) for row in rows)]).split()
    return max(map(len, words), default=0)


def _paragraphs(console: Any, title: str, heads: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
    """Each row as a line for its first cell, and lines of the others that are not empty below it."""
    console.print(title, style="bold", soft_wrap=True)
    for row in rows:
        console.print(f"\n  {_text(row[0])}", soft_wrap=True)
        for head, cell in zip(heads[1:], row[1:], strict=True):
            if (text := _text(cell)) != "":
                console.print(f"    {head}: {text}" if head else f"    {text}", soft_wrap=True)
    console.print()


def _text(value: object) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
