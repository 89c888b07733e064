"""The command `goshawk`: finds the verb, runs it, and reports every expected failure in one sentence.

Exit codes: 0 done; 1 the answer is no (what was looked at is not good, infeasible, unsafe, no link, no map); 2 wrong
usage or bad input; 130 interrupted. 70 is a fault of Goshawk itself.
"""

import contextlib
import errno
import importlib
import os
import re
import sys
import traceback
import warnings
from functools import cache
from pathlib import Path
from typing import Any

import click

from goshawk.terminal.verbs import VerbGroup

TRACEBACK = "GOSHAWK_TRACEBACK"
"""Environment variable: let an internal error end with Python's traceback."""
INTERNAL = 70
"""Exit code of a fault of Goshawk itself: sysexits' EX_SOFTWARE."""
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
"""The system's error numbers of a full disk, an exceeded quota and a file that may not grow."""

TASKS = {
    "Project": ("init", "demo", "paper", "doctor"),
    "Map": ("camera", "map", "localize"),
    "Plan": ("plan", "check", "preflight", "export"),
    "Fly": ("gcs", "sitl", "upload", "fly", "params", "proxy"),
    "Learn": ("vehicle", "log", "identify", "diagnose", "compare", "next-flight"),
}
"""The order in which `goshawk --help` shows verbs, by task; those not named here come last in their task."""
COMMANDS = Path(__file__).with_name("commands")
"""A folder for each task, and for a verb of many modules one of its own. A module with a `SUMMARY` there is a verb: its
words in `goshawk --help`."""
_SUMMARY = re.compile(r'^SUMMARY = "(.+)"$', re.MULTILINE)


@cache
def verbs() -> dict[str, dict[str, str]]:
    """Of each task, its verbs and their summaries; their modules are read and not imported, which would take long."""
    found: dict[str, dict[str, str]] = {}
    for task, first in TASKS.items():
        modules = [*(COMMANDS / task.lower()).glob("*.py"), *map(_own_module, first)]
        texts = {path.stem.replace("_", "-"): path.read_text("utf-8") for path in modules if path.is_file()}
        summaries = {verb: summary[1] for verb, text in sorted(texts.items()) if (summary := _SUMMARY.search(text))}
        found[task] = {verb: summaries[verb] for verb in dict.fromkeys([*first, *summaries])}
    return found


def _own_module(verb: str) -> Path:
    """The module of a verb that has a folder of its own."""
    name = verb.replace("-", "_")
    return COMMANDS / name / f"{name}.py"


class Verbs(VerbGroup):
    """Imports a verb's module only when it is called, so that `goshawk --help` is fast."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return [verb for summaries in verbs().values() for verb in summaries]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        task = next((task.lower() for task, summaries in verbs().items() if cmd_name in summaries), None)
        if task is None:
            return None
        folder = _own_module(cmd_name).parent.name if _own_module(cmd_name).is_file() else task
        return importlib.import_module(f"goshawk.commands.{folder}.{cmd_name.replace('-', '_')}").command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        for task, summaries in verbs().items():
            with formatter.section(task):
                formatter.write_dl([(verb.ljust(11), summary) for verb, summary in summaries.items()])


@click.command(
    cls=Verbs,
    epilog="Each verb has a help of its own: goshawk VERB --help.",
    context_settings={"help_option_names": ["-h", "--help"]},
)
@click.version_option(package_name="goshawk", message="goshawk %(version)s")
def goshawk() -> None:
    """Map a room, plan through it at speed, fly, and learn the vehicle from its flights.

    \b
    goshawk demo --out demo-out      the whole chain on a rendered room
    goshawk gcs demo-out             the ground station on what it made
    """


def main(arguments: list[str] | None = None) -> None:
    """Entry point of the `goshawk` command."""
    given = sys.argv[1:] if arguments is None else arguments
    try:
        with warnings.catch_warnings():
            if not sys.warnoptions:  # warnings of libraries are for developers: python -W shows them
                warnings.simplefilter("ignore")
            code = goshawk.main(args=given, prog_name="goshawk", standalone_mode=False)
        sys.exit(code if isinstance(code, int) else 0)
    except (KeyboardInterrupt, click.Abort):
        click.echo("goshawk: stopped; nothing half-written was left behind", err=True)
        sys.exit(130)
    except BrokenPipeError:
        sys.stderr.close()  # the reader closed the pipe (`goshawk ... | head`), which is no error
        sys.exit(0)
    except Exception as error:
        sentence, code = explained(error)
        if code == INTERNAL and os.environ.get(TRACEBACK):
            raise
        _report(error, sentence, as_json="--json" in given)
        sys.exit(code)


def explained(error: Exception) -> tuple[str, int]:
    """What to say about an error, and the exit code."""
    from flight import FlightError, FormatError, InputError, extras  # brings NumPy: not for `goshawk --version`

    if isinstance(error, click.ClickException):
        return _usage(error), 2
    if isinstance(error, FlightError):
        return str(error), 2 if isinstance(error, InputError | FormatError) else 1
    if isinstance(error, OSError):  # a full disk, a folder without write permission: the system names the cause
        where = f"{error.filename2 or error.filename}: " if error.filename else ""
        remedy = "; free some space there, or write to another disk" if error.errno in FULL else ""
        return f"{where}{error.strerror or error}{remedy}", 2
    if isinstance(error, MemoryError):
        return "not enough memory; use fewer or smaller inputs", 1
    if needed := extras.missing(error):
        return f"this verb needs {needed}", 2
    at = traceback.extract_tb(error.__traceback__)[-1]
    said = f"{type(error).__name__}: {error}".splitlines()[0]
    where = f"{os.path.basename(at.filename)}, line {at.lineno}"
    return (
        f"an internal error of Goshawk: {said} ({where}); {TRACEBACK}=1 shows the traceback, for a bug report",
        INTERNAL,
    )


def _usage(error: click.ClickException) -> str:
    """Click's message, with a reference to the verb's help."""
    context = error.ctx if isinstance(error, click.UsageError) else None
    said = " ".join(error.format_message().split()).rstrip(".")
    return f"{said}; see {context.command_path} --help" if context is not None else said


def _report(error: Exception, sentence: str, *, as_json: bool) -> None:
    sentence = " ".join(sentence.split())  # messages of some libraries have several lines
    with contextlib.suppress(OSError):  # what cannot be written there must not change the exit code
        click.echo(f"goshawk: {sentence}", err=True)
    if as_json:
        from flight import file_format

        body: dict[str, Any] = {"error": {"kind": type(error).__name__, "message": sentence}}
        with contextlib.suppress(OSError):
            click.echo(file_format.json_text(body), nl=False)
