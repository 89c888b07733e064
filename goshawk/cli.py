"""The command `goshawk`: finds the verb, runs it, and reports every expected failure in one sentence.

Exit codes: 0 done; 1 the answer is no (what was looked at is not good, infeasible, unsafe, no link, no map); 2 wrong
usage or bad input; 130 interrupted. 70 is a fault of Goshawk itself.
"""

import contextlib
import errno
import importlib
import os
import sys
import traceback
import warnings
from typing import Any

import click

from goshawk.terminal.verbs import VerbGroup

TRACEBACK = "GOSHAWK_TRACEBACK"
"""Environment variable: let an internal error end with Python's traceback."""
INTERNAL = 70
"""Exit code of a fault of Goshawk itself: sysexits' EX_SOFTWARE."""
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
"""The system's error numbers of a full disk, an exceeded quota and a file that may not grow."""

GROUPS = {
    "Project": ("init", "demo", "doctor"),
    "Map": ("camera", "map", "localize"),
    "Plan": ("plan", "check", "export"),
    "Fly": ("gcs", "sitl", "upload", "fly", "params", "proxy"),
    "Learn": ("vehicle", "log", "identify", "diagnose", "compare", "next-flight"),
}
"""The verbs by task; a verb's module is in the folder of its task in `goshawk/commands`."""
VERBS = {
    # verb: what it does, in the words of `goshawk --help`
    "init": "Start a project folder; add a map, a vehicle or flights to it.",
    "camera": "Make a camera file from images, or from Kalibr's or COLMAP's.",
    "map": "Turn images into a map: poses, mesh, distance field; measure, edit and join maps.",
    "localize": "Find the poses of other images in a map (relocalization).",
    "plan": "Plan a checked trajectory through waypoints, along a recorded path, or of many missions.",
    "check": "Check a trajectory against a map and a vehicle.",
    "export": "Write a trajectory for other autopilots and planners, or as a page.",
    "sitl": "Run a SITL vehicle: the embedded C code on a simulated body.",
    "upload": "Send a checked trajectory to the vehicle and read it back.",
    "fly": "Fly the uploaded trajectory and record a flight log.",
    "log": "Show, check, fix or convert a flight log; download the vehicle's log.",
    "params": "List, read and set the controller's parameters on the vehicle.",
    "proxy": "Connect QGroundControl or MAVSDK, which cannot sign, to the vehicle.",
    "identify": "Fit the vehicle model to flight logs.",
    "diagnose": "Find which effect the vehicle model lacks, from measured flights.",
    "compare": "Compare vehicle models with measured flights.",
    "next-flight": "Propose the manoeuvre that best separates the candidate effects.",
    "vehicle": "Make a vehicle file, show it, set values, add or remove effects, undo, history.",
    "gcs": "Serve the ground station's page.",
    "demo": "Run the whole chain on a rendered room.",
    "doctor": "Check this installation.",
}


class Verbs(VerbGroup):
    """Imports a verb's module only when it is called, so that `goshawk --help` is fast."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(VERBS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in VERBS:
            return None
        room = next(task.lower() for task, verbs in GROUPS.items() if cmd_name in verbs)
        return importlib.import_module(f"goshawk.commands.{room}.{cmd_name.replace('-', '_')}").command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        for heading, verbs in GROUPS.items():
            with formatter.section(heading):
                formatter.write_dl([(verb.ljust(11), VERBS[verb]) for verb in verbs])


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
