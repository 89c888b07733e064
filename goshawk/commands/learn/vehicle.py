"""`goshawk vehicle`: show a vehicle model, change it, evaluate the change, undo it."""

import json
import sys
from pathlib import Path
from typing import Any, Literal

import click

import vehicle
from firmware_bridge import controller
from flight import FormatError, InputError
from goshawk.commands.learn import model_change
from goshawk.commands.learn.flights import load
from goshawk.commands.learn.vehicle_new import new, schema
from goshawk.terminal import console, outputs, words
from goshawk.terminal.verbs import VerbGroup
from sysid.estimator import changes
from sysid.estimator.changes import Change, Flights
from sysid.estimator.verdict import Use
from vehicle import Vehicle, history

vehicle_argument = click.argument("vehicle_file", metavar="VEHICLE", type=click.Path(path_type=Path))
preview_option = click.option("--preview", is_flag=True, help="Show the changes without writing them.")
anyway_option = click.option(
    "--anyway", is_flag=True, help="Write the vehicle file even if the verdict on the refit is `do not use`."
)
yes_option = click.option("--yes", is_flag=True, help="Do not ask for confirmation.")
flights_option = click.option(
    "--flights", multiple=True, type=click.Path(path_type=Path), help="Refit to this flight. Repeatable."
)
held_out_option = click.option(
    "--held-out", multiple=True, type=click.Path(path_type=Path), help="Held-out flight, for evaluation. Repeatable."
)


def flights_options(verb: Any) -> Any:
    """Options that add-effect and remove-effect share."""
    for option in (
        console.json_option,
        anyway_option,
        preview_option,
        console.columns_option,
        held_out_option,
        flights_option,
    ):
        verb = option(verb)
    return verb


@click.group(cls=VerbGroup)
def command() -> None:
    """Make a vehicle model, show it, change it one effect at a time, and undo changes.

    \b
    goshawk vehicle new vehicle.toml --mass 0.72 --arm 0.125 --prop-diameter 0.127
    goshawk vehicle show vehicle.toml
    goshawk vehicle add-effect vehicle.toml rotor_drag_thrust --flights a.parquet --held-out b.parquet
    goshawk vehicle history vehicle.toml --held-out b.parquet --figure staircase.svg
    goshawk vehicle undo vehicle.toml

    Every version is kept beside the file, in `vehicle.history`.
    """


command.add_command(new)
command.add_command(schema)


@command.command()
@vehicle_argument
@console.json_option
def show(vehicle_file: Path, as_json: bool) -> None:
    """Parameters with their errors and sources, effects, and which of them the controller compensates.

    \b
    goshawk vehicle show vehicle.toml
    goshawk vehicle show vehicle.toml --json
    """
    shown = vehicle.load(vehicle_file)
    cancelled = controller.compensations(shown)
    effects = [
        {"name": n, "law": vehicle.effects.find(n).law, "compensated": done, "how": how}
        for n, (done, how) in cancelled.items()
    ]
    parameters = {
        name: {"value": p.value, "std": p.std, "unit": p.unit, "source": p.source}
        for name, p in ((name, shown.parameter(name)) for name in vehicle.specs(shown))
    }
    if as_json:
        document = {"name": shown.name, "hash": vehicle.vehicle_hash(shown), "effects": effects}
        console.show("", {}, as_json=True, document=document | {"parameters": parameters})
        return
    rows = [
        (words.parameter(n), f"{p['value']:.5g}", f"{p['std']:.2g}", p["unit"], p["source"], n)
        for n, p in parameters.items()
    ]
    title = f"{shown.name} ({vehicle.vehicle_hash(shown)[:12]})"
    console.table(title, ("parameter", "value", "std", "unit", "source", "name in the file"), rows)
    lines = [(e["name"], e["law"], "yes" if e["compensated"] else "no", e["how"]) for e in effects]
    console.table("effects", ("effect", "law", "compensated", "how the controller does it, or why not"), lines)


@command.command("add-effect")
@vehicle_argument
@click.argument("effect")
@click.argument("values", metavar="[NAME=VALUE]...", nargs=-1)
@flights_options
def add_effect(
    vehicle_file: Path,
    effect: str,
    values: tuple[str, ...],
    flights: tuple[Path, ...],
    held_out: tuple[Path, ...],
    columns: Path | None,
    preview: bool,
    anyway: bool,
    as_json: bool,
) -> int:
    """Add EFFECT, a name of the catalogue or a Python file of your own, to the model.

    \b
    goshawk vehicle add-effect vehicle.toml rotor_drag_thrust drag_s_m=0.0175
    goshawk vehicle add-effect vehicle.toml rotor_drag_thrust --flights a.parquet --held-out b.parquet
    goshawk vehicle add-effect vehicle.toml side_guard.py drag_kg_m=0.03

    With --flights the whole model is refitted; with --held-out the errors on held-out flights are printed for the
    changed model and for the present one fitted to the same flights. `goshawk vehicle undo` reverts the change.

    A refit ends in a verdict as `goshawk identify` gives it: usable, doubtful, or do not use (exit code 1; the file is
    then written only with --anyway).
    """
    present, given = vehicle.load(vehicle_file), dict(console.assignment(word) for word in values)
    if effect.endswith(".py"):
        changed = present.with_effect_file(effect, source="set by hand" if given else "assumed", **given)
        name = next(iter(set(changed.effects) - set(present.effects)), Path(effect).stem)
    else:
        name = vehicle.effects.find(effect).name
        changed = present.with_effect(name, source="set by hand" if given else "assumed", **given)
    if name in present.effects:
        raise InputError(f"{vehicle_file} has {name} already; remove it first, or refit with goshawk identify")
    logs, writing = (flights, held_out, columns), (preview, anyway)
    return _change(vehicle_file, present, changed, ("add-effect", name), logs, writing, as_json)


@command.command("remove-effect")
@vehicle_argument
@click.argument("effect")
@flights_options
@yes_option
def remove_effect(
    vehicle_file: Path,
    effect: str,
    flights: tuple[Path, ...],
    held_out: tuple[Path, ...],
    columns: Path | None,
    preview: bool,
    anyway: bool,
    yes: bool,
    as_json: bool,
) -> int:
    """Remove EFFECT and its parameters from the model, after confirmation.

    \b
    goshawk vehicle remove-effect vehicle.toml flapping_moment
    goshawk vehicle remove-effect vehicle.toml flapping_moment --flights a.parquet --held-out b.parquet --yes

    Refit and evaluation are as for add-effect.
    """
    present = vehicle.load(vehicle_file)
    changed = present.without_effect(effect)
    if not preview:
        lost = {n: p for n, p in present.parameters.items() if n.startswith(effect + ".")}
        said = ", ".join(f"{n} = {p.value:.4g} {p.unit} ({p.source})" for n, p in lost.items())
        _ask(f"remove {effect} from {vehicle_file}, and with it {said}?", yes, as_json)
    logs, writing = (flights, held_out, columns), (preview, anyway)
    return _change(vehicle_file, present, changed, ("remove-effect", effect), logs, writing, as_json)


@command.command("scaffold-effect")
@vehicle_argument
@console.path_option("--diagnosis", "diagnosis", "JSON of `goshawk diagnose --json`.", required=True)
@click.option("--name", required=True, help="Name of the effect: small letters, digits, _.")
@console.path_option("--out", "out", "Python file to write.", required=True)
@click.option(
    "--form",
    type=click.Choice(["spline", "polynomial"]),
    default="spline",
    show_default=True,
    help="Function that is put through the curve.",
)
@outputs.overwrite_option
@console.json_option
def scaffold_effect(
    vehicle_file: Path,
    diagnosis: Path,
    name: str,
    out: Path,
    form: Literal["spline", "polynomial"],
    overwrite: bool,
    as_json: bool,
) -> None:
    """Turn the residual curve of a diagnosis without a known effect into an effect of your own.

    \b
    goshawk diagnose flights/*.parquet --vehicle vehicle.toml --json > diagnosis.json
    goshawk vehicle scaffold-effect vehicle.toml --diagnosis diagnosis.json --name climb_twist --out climb_twist.py
    goshawk vehicle add-effect vehicle.toml climb_twist.py --flights a.parquet --held-out b.parquet

    The vehicle file is not changed; the last command does that, and reports whether the errors fell.
    """
    from sysid.diagnosis import curve

    present, facts = vehicle.load(vehicle_file), _outside(diagnosis)
    if name in present.effects:
        raise InputError(f"{vehicle_file} has an effect {name} already; choose another name")
    outputs.check(out, overwrite=overwrite)
    with outputs.file(out, overwrite=overwrite) as temporary:
        curve.scaffold(facts, temporary, name=name, form=form)
    told = {"effect": name, "channel": facts["channel"], "variable": facts["variable"], "form": form}
    then = f"goshawk vehicle add-effect {vehicle_file} {out} --flights FLIGHT --held-out FLIGHT"
    document = told | {"written": str(out.resolve()), "then": then}
    console.show(f"{name}: {facts['channel']} against {facts['variable']}", document, as_json=as_json)


def _outside(diagnosis: Path) -> dict[str, Any]:
    """The curve in a diagnosis file."""
    try:
        document = json.loads(diagnosis.read_text())
    except FileNotFoundError:
        raise InputError(f"{diagnosis} does not exist; write it with goshawk diagnose --json") from None
    except (ValueError, RecursionError) as error:
        raise FormatError(f"{diagnosis} is not JSON: {error}") from error
    if not isinstance(document, dict) or document.get("schema") != "goshawk-diagnosis":
        raise FormatError(f"{diagnosis} is not a diagnosis of goshawk diagnose --json")
    if not isinstance(document.get("outside"), dict):
        raise InputError(
            f"{diagnosis} has no residual curve: {document.get('verdict', 'nothing is outside the catalogue')}"
        )
    return document["outside"]


@command.command()
@vehicle_argument
@click.option("--to", "number", type=int, help="Return to this version of the history instead.")
@preview_option
@yes_option
@console.json_option
def undo(vehicle_file: Path, number: int | None, preview: bool, yes: bool, as_json: bool) -> None:
    """Restore the vehicle file's version before its last change, byte for byte, after confirmation.

    \b
    goshawk vehicle undo vehicle.toml
    goshawk vehicle undo vehicle.toml --to 0 --yes

    The undone version stays in the history and can be restored with --to.
    """
    left, restored = history.target(vehicle_file, number)
    was, will_be = history.version(vehicle_file, left), history.version(vehicle_file, restored)
    if not preview:
        what = f"return {vehicle_file} from version {left.number} to {restored.number} ({_done(restored)})"
        _ask("\n".join([f"{what}?", *history.differences(was, will_be)]), yes, as_json)
        history.restore(vehicle_file, number)
    facts = {"left": left.number, "restored": restored.number, "file_sha256": restored.file_sha256}
    document = facts | {"written": not preview, "changes": history.differences(was, will_be)}
    if as_json:
        console.show("", {}, as_json=True, document=document)
        return
    for line in document["changes"]:
        click.echo(line)
    click.echo(f"{'would be' if preview else 'is'} at version {restored.number} ({_done(restored)})")


@command.command("history")
@vehicle_argument
@held_out_option
@console.columns_option
@console.path_option("--figure", "figure", "Draw the error staircase over the versions: .svg or .png.")
@outputs.overwrite_option
@console.json_option
def show_history(
    vehicle_file: Path,
    held_out: tuple[Path, ...],
    columns: Path | None,
    figure: Path | None,
    overwrite: bool,
    as_json: bool,
) -> None:
    """List every version of the model, the action that made it, and its errors on held-out flights.

    \b
    goshawk vehicle history vehicle.toml
    goshawk vehicle history vehicle.toml --held-out b.parquet --figure staircase.svg

    With --held-out every version is evaluated on these flights; else the table shows the recorded verdicts.
    """
    if figure is not None and not held_out:
        raise click.UsageError("--figure needs --held-out: versions are compared on the same flights")
    outputs.check(figure, overwrite=overwrite)
    told = history.read(vehicle_file)
    line = told.line()
    errors: dict[int, dict[str, float]] = {}
    left_out: tuple[str, ...] = ()
    if held_out:
        models = {str(step.number): history.version(vehicle_file, step) for step in line}
        with console.progress() as report:
            logs = [load(path, columns) for path in held_out]
            by_version, left_out = changes.held_out_errors(models, logs, progress=report)
        errors = {int(number): found for number, found in by_version.items()}
    if figure is not None:
        names = [path.name for path in held_out]
        with outputs.file(figure, overwrite=overwrite) as temporary:
            model_change.staircase(line, [errors[step.number] for step in line], names, temporary)
    _show_history(told, errors, left_out, figure, as_json)


def _show_history(
    told: history.History,
    errors: dict[int, dict[str, float]],
    left_out: tuple[str, ...],
    figure: Path | None,
    as_json: bool,
) -> None:
    on_line = {step.number for step in told.line()}
    if as_json:
        steps = [vehicle_step | {"undone": n not in on_line} for n, vehicle_step in enumerate(told.as_dicts())]
        document = {"current": told.current, "steps": steps, "errors": errors, "figure": figure and str(figure)}
        document["left_out"] = list(left_out)
        console.show("", {}, as_json=True, document=document)
        return
    rows = []
    for step in told.steps:
        found = errors.get(step.number) or (step.held_out.after if step.held_out else {})
        position = model_change.prediction_error("position", found["position_m"]) if found else ""
        helped = step.held_out.verdict if step.held_out else ""
        mark = "now" if step.number == told.current else "" if step.number in on_line else "undone"
        rows.append((step.number, mark, _done(step), step.when_utc[:16], step.vehicle_hash[:8], position, helped))
    heads = (
        "version",
        "",
        "made by",
        "when (UTC)",
        "hash",
        f"position error after {changes.HORIZON_S:g} s",
        "verdict at the time",
    )
    console.table("history", heads, rows)
    for sentence in left_out:
        click.echo(f"note: {sentence}")
    if figure is not None:
        click.echo(f"figure: {figure}")


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
        writing: preview only, and write in spite of the verdict `do not use`.

    Returns:
        The exit code: 1 if the verdict on the refit is `do not use`.
    """
    preview, anyway = writing
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
    if not preview and (usable or anyway):
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


def _done(step: history.Step) -> str:
    return f"{step.action} {step.effect}".rstrip()


def _ask(question: str, yes: bool, as_json: bool) -> None:
    if yes:
        return
    if as_json or not sys.stdin.isatty():
        raise click.UsageError("this changes the vehicle file; give --yes to confirm, or --preview to see the changes")
    click.confirm(question, abort=True, err=True)
