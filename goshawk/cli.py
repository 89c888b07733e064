"""The command `goshawk`: finds the verb, runs it, and turns every expected failure into one sentence.

Exit codes: 0 done, 1 the answer is no (infeasible, unsafe, no link, no map), 2 wrong usage or bad input, 70 a fault of
Goshawk's own, 130 stopped.
"""

import importlib
import os
import sys
import traceback
import warnings
from typing import Any

import click

from flight import FlightError, FormatError, InputError, file_format
from goshawk.verbs import VerbGroup

TRACEBACK = "GOSHAWK_TRACEBACK"
"""Environment variable: let a fault of our own end with Python's traceback."""

GROUPS = {
    "Begin": ("init", "demo", "doctor"),
    "Map": ("camera", "map", "localize"),
    "Plan": ("plan", "check"),
    "Fly": ("gcs", "vehicle-sim", "upload", "fly", "params", "proxy"),
    "Learn": ("vehicle", "log", "identify", "diagnose", "compare", "next-flight"),
}
"""The verbs by what one is about to do."""
VERBS = {
    # verb: what it does, in the words of `goshawk --help`
    "init": "Start a project folder, or add a map, a vehicle, flights to one.",
    "camera": "Make a camera file from images, or from Kalibr's or COLMAP's.",
    "map": "Turn images into a map: poses, mesh, distance field.",
    "localize": "Find where images were taken in a map.",
    "plan": "Plan a checked trajectory through waypoints or along a recorded path.",
    "check": "Check a trajectory against a map and a vehicle.",
    "vehicle-sim": "Run a SITL vehicle: the embedded C code on a simulated body.",
    "upload": "Send a checked trajectory to the vehicle and read it back.",
    "fly": "Fly the uploaded trajectory and record a flight log.",
    "log": "Show, check, draw, convert or mend a flight log; fetch the vehicle's own.",
    "params": "List, read and set the controller's parameters on the vehicle.",
    "proxy": "Let QGroundControl or MAVSDK, which cannot sign, talk to the vehicle.",
    "identify": "Fit the vehicle model to flight logs.",
    "diagnose": "Find which effect the vehicle model lacks, on measured flights.",
    "compare": "Compare vehicle models with measured flights.",
    "next-flight": "Propose the manoeuvre that would settle what the flights leave in doubt.",
    "vehicle": "Make a vehicle file, show it, add or remove effects, undo, history.",
    "gcs": "Serve the ground station's page.",
    "demo": "Run the whole chain on a rendered room.",
    "doctor": "Check this installation.",
}


class Verbs(VerbGroup):
    """Imports a verb's module only when it is called: `goshawk --help` stays instant."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(VERBS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in VERBS:
            return None
        return importlib.import_module(f"goshawk.commands.{cmd_name.replace('-', '_')}").command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        for heading, verbs in GROUPS.items():
            with formatter.section(heading):
                formatter.write_dl([(verb.ljust(11), VERBS[verb]) for verb in verbs])


@click.command(cls=Verbs, epilog="Each verb explains itself: goshawk VERB --help.")
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
            if not sys.warnoptions:  # a library's warnings are for its developers: python -W shows them
                warnings.simplefilter("ignore")
            code = goshawk.main(args=given, prog_name="goshawk", standalone_mode=False)
        sys.exit(code if isinstance(code, int) else 0)
    except click.ClickException as error:
        _report(error, _usage(error), as_json=_prints_json(given))
        sys.exit(2)
    except FlightError as error:
        _report(error, str(error), as_json=_prints_json(given))
        sys.exit(2 if isinstance(error, InputError | FormatError) else 1)
    except (KeyboardInterrupt, click.Abort):
        click.echo("goshawk: stopped; nothing half-written was left behind", err=True)
        sys.exit(130)
    except BrokenPipeError:
        sys.stderr.close()  # the reader of our output went away (`goshawk ... | head`); that is its right
        sys.exit(0)
    except OSError as error:  # a full disk, a folder that may not be written: the system's own words say which
        where = f"{error.filename2 or error.filename}: " if error.filename else ""
        _report(error, f"{where}{error.strerror or error}", as_json=_prints_json(given))
        sys.exit(2)
    except MemoryError as error:
        _report(error, "this needs more memory than there is; give less at a time", as_json=_prints_json(given))
        sys.exit(1)
    except Exception as error:
        if os.environ.get(TRACEBACK):
            raise
        at = traceback.extract_tb(error.__traceback__)[-1]
        said = f"{type(error).__name__}: {error}".splitlines()[0]
        where = f"{os.path.basename(at.filename)}, line {at.lineno}"
        sentence = f"a fault of Goshawk's own, not of yours: {said} ({where}); {TRACEBACK}=1 shows more, for a report"
        _report(error, sentence, as_json=_prints_json(given))
        sys.exit(70)


def _prints_json(given: list[str]) -> bool:
    """Whether standard output is JSON: `--json` alone or with `-`, not with the name of a file."""
    if "--json" not in given:
        return False
    after = given[given.index("--json") + 1 :]
    return not (after and after[0].endswith(".json"))


def _usage(error: click.ClickException) -> str:
    """Click's sentence, and where to read on."""
    context = error.ctx if isinstance(error, click.UsageError) else None
    said = " ".join(error.format_message().split()).rstrip(".")
    return f"{said}; see {context.command_path} --help" if context is not None else said


def _report(error: Exception, sentence: str, *, as_json: bool) -> None:
    sentence = " ".join(sentence.split())  # libraries draw pictures of where they stumbled
    click.echo(f"goshawk: {sentence}", err=True)
    if as_json:
        body: dict[str, Any] = {"error": {"kind": type(error).__name__, "message": sentence}}
        click.echo(file_format.json_text(body), nl=False)
