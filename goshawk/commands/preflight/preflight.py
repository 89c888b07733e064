"""`goshawk preflight`: a trajectory flown many times in simulation before it is flown once."""

from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import click

import mapping
import preflight
import vehicle
from flight import InputError, Progress, file_format, trajectory
from goshawk.commands.preflight import batch, home, inputs, screen
from goshawk.commands.preflight.options import Asked, preflight_options
from goshawk.commands.preflight.outcome import Outcome
from goshawk.terminal import console, outputs
from goshawk.terminal.verbs import DefaultVerbGroup
from preflight import worst
from preflight.result import SCHEMA, SCHEMA_VERSION

SUMMARY = "Fly a trajectory a thousand times in simulation: go or no-go."


@click.command()
@click.argument("trajectory_file", metavar="TRAJECTORY", type=click.Path(path_type=Path))
@console.map_option
@console.vehicle_option
@click.option("--wind", help="Steady wind: its speed, from anywhere, or x,y,z, m/s [default: none, or as of --like].")
@preflight_options
@click.option(
    "--advise",
    is_flag=True,
    help="Find the largest wind that is a go, how much slower is one, the battery to take, and ways home.",
)
@click.option(
    "--moments",
    type=click.IntRange(1, 100),
    default=home.MOMENTS,
    show_default=True,
    help="Moments of the plan from which --advise looks for a way home.",
)
@click.option(
    "--carried",
    "carried_wh",
    type=click.FloatRange(0.0, min_open=True),
    help="Battery's energy at the rotors, Wh: --advise tells until when it brings the vehicle home.",
)
@console.path_option("--out", "out", "JSON file to write with the whole result.")
@console.path_option("--report", "report", "HTML page to write: the flights in the map, the worst three, and why.")
@console.common_options
def one(
    trajectory_file: Path,
    map_folder: Path,
    vehicle_file: Path,
    wind: str | None,
    asked: Asked,
    advise: bool,
    moments: int,
    carried_wh: float | None,
    out: Path | None,
    report: Path | None,
    as_json: bool,
) -> int:
    """Fly TRAJECTORY many times in simulation: how likely is it to touch anything, and what decides that?

    \b
    goshawk preflight lap.json --map map --vehicle vehicle.toml
    goshawk preflight lap.json --map map --vehicle vehicle.toml --wind 3 --gust-std 1 --report lap.html
    goshawk preflight batch --help        many plans, vehicles and winds in one map

    The flight controller's own C code flies the identified model with parameters drawn from its errors, wind, noise,
    delay, and errors of pose, map and start. A loss is to touch anything, to leave the map, to overturn, or to come
    down without a position. Results are the same on every number of processors; Ctrl-C keeps what was flown.

    Exit code 0: go, the risk is shown to be at most --risk. 1: no-go, or not shown.
    """
    outputs.check(out, report, overwrite=asked.overwrite)
    if carried_wh is not None and not advise:
        raise InputError("--carried tells until when a way home is left, which --advise looks for: give both")
    if moments != home.MOMENTS and not advise:
        raise InputError("--moments are those from which --advise looks for a way home: give both")
    item, believed = trajectory.load(trajectory_file), vehicle.load(vehicle_file)
    like = asked.like({vehicle_file: believed}, wind)
    options = asked.flown(wind, like)
    with console.progress() as progress:
        progress("opening the map", 0.0)
        subject = inputs.subject(item, mapping.open_map(map_folder), believed, options, like)
        bundle = worst.BUNDLE if report is not None else 0
        found = _flown(subject, progress, advise=advise, moments=moments, bundle=bundle)
        found = replace(found, carried_j=None if carried_wh is None else 3600.0 * carried_wh)
    _write(found, out, report, overwrite=asked.overwrite)
    if as_json:
        click.echo(file_format.json_text(found.as_dict()), nl=False)
    else:
        screen.show(f"preflight of {trajectory_file}", found)
    if stopped := _stopped(found, wants_advice=advise and found.advice is None):
        click.echo(f"goshawk: {stopped}", err=True)
        return 130
    return 0 if found.result.go else 1


def _flown(
    subject: inputs.Subject, progress: Progress, *, advise: bool, bundle: int, moments: int = home.MOMENTS
) -> Outcome:
    """Fly it, find what would be a go if asked for, and fly the worst again; after Ctrl-C, what there is."""
    scenario, options = subject.scenario, subject.options
    result = preflight.fly(scenario, options, progress=progress)
    advice, ways, replay = None, [], None
    if advise and result.hides:
        console.note("no advice: what the map may have missed alone forbids a go")
    advise = advise and not result.cut_off and not result.hides
    looked_for = advise and home.looked_for(subject)
    if advise:
        with suppress(KeyboardInterrupt):  # what was found is kept
            if looked_for:
                for way in home.ways_home(subject, moments, progress=progress):
                    ways.append(way)
            advice = preflight.advised(scenario, result, options, progress=progress)
    progress("flying the worst again", 0.0)
    with suppress(KeyboardInterrupt):  # the result is kept
        replay = preflight.replay(scenario, result, options, bundle=bundle)
    return Outcome(subject, result, replay, advice, tuple(ways) if ways or (looked_for and advice) else None)


def _write(found: Outcome, out: Path | None, report: Path | None, *, overwrite: bool) -> None:
    if out is not None:
        with outputs.file(out, overwrite=overwrite) as temporary:
            file_format.write_json(temporary, format=SCHEMA, version=SCHEMA_VERSION, body=found.as_dict())
    if report is not None and found.replay is not None:
        from goshawk.commands.preflight import page

        text = page.text(found)
        with outputs.file(report, overwrite=overwrite) as temporary:
            temporary.write_text(text, encoding="utf-8")


def _stopped(found: Outcome, *, wants_advice: bool) -> str:
    """What Ctrl-C ended, in words; empty if nothing was."""
    result = found.result
    if result.cut_off:
        return f"stopped after {_stopped_after(result)}"
    if result.unexplained:
        return "all flights were flown; stopped before it was told what decides"
    if found.replay is None:
        return "stopped before the worst were flown again"
    return "stopped before the advice was found" if wants_advice else ""


def _stopped_after(result: preflight.Result) -> str:
    if result.rare is None:
        return f"{result.flights} of {result.wanted} flights"
    risk = result.rare.risk
    return f"level {risk.levels}: {risk.flights} flights, and the risk is at most {risk.upper:.1e}"


command = DefaultVerbGroup("preflight", own=one, commands=[batch.command])
