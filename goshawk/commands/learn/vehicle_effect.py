"""`goshawk vehicle effect`: add an effect to a vehicle model, remove one, make one; evaluate the change."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import click

import vehicle
from firmware_bridge import controller
from flight import FormatError, InputError, errors
from goshawk.commands.learn import fit_options, kept, model_change
from goshawk.commands.learn.flights import load
from goshawk.terminal import console, outputs
from goshawk.terminal.verbs import VerbGroup
from sysid.diagnosis.evidence.candidates import taken_out
from sysid.estimator.validation import changes
from sysid.estimator.validation.changes import Change, Flights
from sysid.estimator.verdict import Use
from vehicle import Vehicle, history

Function = Literal["equation", "spline", "polynomial"]
"""What an effect is drafted as."""

vehicle_argument = click.argument("vehicle_file", metavar="VEHICLE", type=click.Path(path_type=Path))
_flights = click.argument("flights", nargs=-1, type=click.Path(path_type=Path))


def _flights_options(verb: Any) -> Any:
    """What `add` and `remove` share."""
    for option in (
        console.common_options,
        fit_options.anyway_option,
        console.dry_run_option,
        console.columns_option,
        fit_options.held_out_option,
        _flights,
    ):
        verb = option(verb)
    return verb


@click.group(cls=VerbGroup)
def effect() -> None:
    """Add an effect to a vehicle model, remove one, or make one of your own.

    \b
    goshawk vehicle effect add vehicle.toml rotor_drag_thrust a.parquet --held-out b.parquet
    goshawk vehicle undo vehicle.toml
    """


@effect.command("add")
@vehicle_argument
@click.argument("name", metavar="EFFECT")
@click.option("--set", "values", multiple=True, metavar="NAME=VALUE", help="Set this parameter of it. Repeatable.")
@click.option("--proposed", is_flag=True, help="First write EFFECT, a file, from what the diagnosis of FLIGHTS found.")
@_flights_options
def add(
    vehicle_file: Path,
    name: str,
    values: tuple[str, ...],
    proposed: bool,
    flights: tuple[Path, ...],
    held_out: tuple[Path, ...],
    columns: Path | None,
    dry_run: bool,
    anyway: bool,
    as_json: bool,
) -> int:
    """Add EFFECT, a name of the catalogue or a Python file of your own, to the model.

    \b
    goshawk vehicle effect add vehicle.toml rotor_drag_thrust --set drag_s_m=0.0175
    goshawk vehicle effect add vehicle.toml rotor_drag_thrust a.parquet --held-out b.parquet
    goshawk vehicle effect add vehicle.toml side_guard.py --set drag_kg_m=0.03
    goshawk vehicle effect add vehicle.toml f_of_v.py a.parquet --proposed

    The whole model is refitted to FLIGHTS; with --held-out the errors on held-out flights are printed for the changed
    model and for the present one fitted to the same flights. `goshawk vehicle undo` reverts the change.

    A refit ends in a verdict as `goshawk identify` gives it: usable, doubtful, or do not use (exit code 1; the file is
    then written only with --anyway).
    """
    present, given = vehicle.load(vehicle_file), dict(console.assignment(word) for word in values)
    if proposed:
        _draft(_diagnosed(flights, None), Path(name), Path(name).stem, None)
    is_kept = False
    try:
        changed, effect_name = _with(vehicle_file, present, name, given)
        logs, writing = (flights, held_out, columns), (dry_run, anyway)
        code = _change(vehicle_file, present, changed, ("add-effect", effect_name), logs, writing, as_json)
        is_kept = not dry_run and (code == 0 or anyway)
        return code
    finally:
        if proposed and not is_kept:
            Path(name).unlink(missing_ok=True)


def _with(vehicle_file: Path, present: Vehicle, name: str, given: dict[str, float]) -> tuple[Vehicle, str]:
    """The vehicle with the effect, and the effect's name."""
    source = "set by hand" if given else "assumed"
    if name.endswith(".py"):
        changed = present.with_effect_file(name, source=source, **given)
        name = next(iter(set(changed.effects) - set(present.effects)), Path(name).stem)
    else:
        name = vehicle.effects.find(name).name
        changed = present.with_effect(name, source=source, **given)
    if name in present.effects:
        raise InputError(f"{vehicle_file} has {name} already; remove it first, or refit with goshawk identify")
    return changed, name


@effect.command("remove")
@vehicle_argument
@click.argument("name", metavar="EFFECT")
@_flights_options
@console.yes_option
def remove(
    vehicle_file: Path,
    name: str,
    flights: tuple[Path, ...],
    held_out: tuple[Path, ...],
    columns: Path | None,
    dry_run: bool,
    anyway: bool,
    yes: bool,
    as_json: bool,
) -> int:
    """Remove EFFECT and its parameters from the model, after confirmation.

    \b
    goshawk vehicle effect remove vehicle.toml flapping_moment
    goshawk vehicle effect remove vehicle.toml flapping_moment a.parquet --held-out b.parquet --yes

    Refit and evaluation are as for `add`.
    """
    present = vehicle.load(vehicle_file)
    changed = taken_out(present, name)
    if not dry_run:
        lost = {n: p for n, p in present.parameters.items() if n.startswith(name + ".")}
        said = ", ".join(f"{n} = {p.value:.4g} {p.unit} ({p.source})" for n, p in lost.items())
        console.confirm(f"remove {name} from {vehicle_file}, and with it {said}?", yes=yes, as_json=as_json)
    logs, writing = (flights, held_out, columns), (dry_run, anyway)
    return _change(vehicle_file, present, changed, ("remove-effect", name), logs, writing, as_json)


@effect.command("scaffold")
@vehicle_argument
@_flights
@console.path_option("--diagnosis", "diagnosis", "JSON of `goshawk diagnose --json` [default: kept with FLIGHTS].")
@click.option("--name", required=True, help="Name: of the effect, in small letters, digits, _.")
@console.path_option("--out", "out", "Python file to write.", required=True)
@click.option(
    "--form",
    type=click.Choice(["equation", "spline", "polynomial"]),
    help="The law that was proposed, or a function through the curve [default: equation if there is one, else spline].",
)
@outputs.overwrite_option
@console.common_options
def scaffold(
    vehicle_file: Path,
    flights: tuple[Path, ...],
    diagnosis: Path | None,
    name: str,
    out: Path,
    form: Function | None,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Turn what the diagnosis of FLIGHTS found beyond the catalogue, a law or a curve, into an effect of your own.

    \b
    goshawk vehicle effect scaffold vehicle.toml a.parquet --name climb_twist --out climb_twist.py
    goshawk vehicle effect add vehicle.toml climb_twist.py a.parquet --held-out b.parquet

    The vehicle file is not changed; the last command does that, and reports whether the errors fell.
    """
    present, document = vehicle.load(vehicle_file), _diagnosed(flights, diagnosis)
    if name in present.effects:
        raise InputError(f"{vehicle_file} has an effect {name} already; choose another name")
    outputs.check(out, overwrite=overwrite)
    with outputs.file(out, overwrite=overwrite) as temporary:
        told = _draft(document, temporary, name, form)
    then = f"goshawk vehicle effect add {vehicle_file} {out} FLIGHT --held-out FLIGHT"
    shown = told | {"written": str(out.resolve()), "then": then}
    console.show(f"{name}: {told['channel']} against {told['variable']}", shown, as_json=as_json)


def _diagnosed(flights: tuple[Path, ...], diagnosis: Path | None) -> Mapping[str, Any]:
    """A diagnosis in JSON: of a file, or the newest that is kept with the flights.

    Raises:
        InputError: there is none.
        FormatError: the file is no diagnosis.
    """
    if (diagnosis is None) == (not flights):
        raise click.UsageError("give the FLIGHTS that were diagnosed, or --diagnosis FILE")
    if diagnosis is None:
        found = kept.newest("diagnosis", flights)
        if found is None:
            raise InputError(f"no diagnosis of {' '.join(map(str, flights))} is kept; run goshawk diagnose on them")
        return found.document
    try:
        document = json.loads(diagnosis.read_text())
    except FileNotFoundError:
        raise errors.missing(diagnosis, "what goshawk diagnose --json wrote") from None
    except (ValueError, RecursionError) as error:
        raise FormatError(f"{diagnosis} is not JSON: {error}") from error
    if not isinstance(document, dict) or document.get("schema") != "goshawk-diagnosis":
        raise FormatError(f"{diagnosis} is not a diagnosis of goshawk diagnose --json")
    return document


def _draft(document: Mapping[str, Any], file: Path, name: str, function: Function | None) -> dict[str, str]:
    """Write an effect file of the equation that a diagnosis proposes, or of the curve that it drew.

    Args:
        function: the equation if there is one and nothing is asked, else a spline through the curve.

    Returns:
        What was made: effect, channel, variable, form.

    Raises:
        InputError: the diagnosis found no curve (or proposes no equation), or no effect can be made of it.
    """
    from sysid.diagnosis import curve, equation_text

    equation, outside = (document.get(key) for key in ("equation", "outside"))
    chosen = function or ("equation" if isinstance(equation, dict) else "spline")
    if chosen == "equation":
        if not isinstance(equation, dict):
            raise InputError("the diagnosis proposes no equation; ask for --form spline")
        equation_text.scaffold(equation, file, name=name)
        law = equation_text.from_dict(equation)
        told = (law.channel, law.variable)
    else:
        if not isinstance(outside, dict):
            verdict = document.get("verdict", "nothing is outside the catalogue")
            raise InputError(f"the diagnosis has no residual curve: {verdict}")
        curve.scaffold(outside, file, name=name, form=chosen)
        told = (str(outside["channel"]), str(outside["variable"]))
    return {"effect": name, "channel": told[0], "variable": told[1], "form": chosen}


def _change(
    file: Path,
    present: Vehicle,
    changed: Vehicle,
    what: tuple[str, str],
    logs: tuple[tuple[Path, ...], tuple[Path, ...], Path | None],
    writing: tuple[bool, bool],
    as_json: bool,
) -> int:
    """Refit and evaluate if flights were given; write and report.

    Args:
        writing: show only, and write in spite of the verdict `do not use`.

    Returns:
        The exit code: 1 if the verdict on the refit is `do not use`.
    """
    dry_run, anyway = writing
    training, held_out, columns = logs
    with console.progress() as report:
        flights = Flights({p: load(p, columns) for p in training}, {p: load(p, columns) for p in held_out})
        change = Change(changed, {}, None, (), None)
        if training:
            change = changes.refitted(present, changed, flights, progress=report)
        elif held_out:
            change = changes.evaluated(present, changed, flights, progress=report)
    usable = change.fit is None or change.fit.use is not Use.REJECTED
    step = None
    if not dry_run and (usable or anyway):
        step = history.record(file, change.vehicle, what[0], effect=what[1], held_out=change.held_out)
    _show_change(file, present, change, what, step, as_json)
    return 0 if usable else 1


def _show_change(
    file: Path, present: Vehicle, change: Change, what: tuple[str, str], step: history.Step | None, as_json: bool
) -> None:
    helped = change.held_out.verdict if change.held_out else "not evaluated: no held-out flight was given"
    facts: dict[str, Any] = {"vehicle": str(file), "action": what[0], "effect": what[1], "verdict": helped}
    facts |= {"version": step.number if step else None}
    cancelled, how = controller.compensations(change.vehicle).get(what[1], (None, ""))
    if as_json:
        document = facts | {"errors": change.errors, "changes": history.differences(present, change.vehicle)}
        document |= {
            "fit": change.fit.as_dict() if change.fit else None,
            "findings": change.findings,
            "compensated": cancelled,
            "how": how,
        }
        console.show("", {}, as_json=True, document=document)
        return
    reasons = change.fit.reasons if change.fit else ()
    if change.fit:
        click.echo(f"verdict on the refit: {change.fit.use}")
    for reason in reasons:
        click.echo(f"  {reason}")
    for line in history.differences(present, change.vehicle):
        click.echo(line)
    if change.errors:
        rows = [
            (model, *(model_change.prediction_error(q, errors[key]) for q, key in changes.KEYS.items()))
            for model, errors in change.errors.items()
        ]
        heads = ("model", *changes.KEYS)
        console.table(f"held-out error after {changes.HORIZON_S:g} s, rms", heads, rows)
    for finding in (f for f in change.findings if f not in reasons):
        click.echo(f"note: {finding}")
    click.echo(f"{what[1]} {helped}" if change.held_out else helped)
    if cancelled is not None:
        click.echo(f"{'compensated' if cancelled else 'NOT compensated'} by the controller: {how}")
    refused = change.fit is not None and change.fit.use is Use.REJECTED
    unwritten = f"nothing was written{' (see --anyway)' if refused else ''}"
    click.echo(f"written: {file}, version {step.number}" if step else unwritten)
