"""`goshawk vehicle`: show a vehicle model, change it, undo changes; its effects are in `vehicle_effect`."""

from dataclasses import fields, replace
from pathlib import Path

import click

import vehicle
from firmware_bridge import controller
from flight import InputError
from goshawk.commands.learn import model_change
from goshawk.commands.learn.flights import load
from goshawk.commands.learn.vehicle_effect import effect, vehicle_argument
from goshawk.commands.learn.vehicle_new import new, schema
from goshawk.terminal import console, outputs, words
from goshawk.terminal.verbs import VerbGroup
from sysid.estimator.validation import changes
from vehicle import Limits, Vehicle, history, presets

SUMMARY = "Make a vehicle file, show it, set values, add or remove effects, undo, history."


@click.group(cls=VerbGroup)
def command() -> None:
    """Make a vehicle model, show it, change it one effect at a time, and undo changes.

    \b
    goshawk vehicle new vehicle.toml --mass 0.72 --arm 0.125 --prop-diameter 0.127
    goshawk vehicle show vehicle.toml
    goshawk vehicle set vehicle.toml mass_kg=0.72
    goshawk vehicle effect add vehicle.toml rotor_drag_thrust a.parquet --held-out b.parquet
    goshawk vehicle history vehicle.toml b.parquet --figure staircase.svg
    goshawk vehicle undo vehicle.toml

    Every version is kept beside the file, in `vehicle.history`.
    """


for verb in (new, schema, effect):
    command.add_command(verb)


@command.command()
@vehicle_argument
@console.common_options
def show(vehicle_file: Path, as_json: bool) -> None:
    """Parameters with their errors and sources, rotors, effects, and which of them the controller compensates.

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
    rotors = [
        {"x_m": x, "y_m": y, "z_m": z, "spin": "counter-clockwise" if turns > 0 else "clockwise"}
        for (x, y, z), turns in zip(shown.hub_body_m.tolist(), shown.spin, strict=True)
    ]
    if as_json:
        document = {"name": shown.name, "hash": vehicle.vehicle_hash(shown), "rotors": rotors, "effects": effects}
        document |= {"parameters": parameters, vehicle.purpose.KEY: vehicle.purpose.not_for_design(shown)}
        console.show("", {}, as_json=True, document=document)
        return
    if mark := vehicle.purpose.mark_sentence(shown):
        click.echo(f"{shown.name} is {mark}")
    rows = [
        (words.parameter(n), f"{p['value']:.5g}", f"{p['std']:.2g}", p["unit"], p["source"], n)
        for n, p in parameters.items()
    ]
    title = f"{shown.name} ({vehicle.vehicle_hash(shown)[:12]})"
    console.table(title, ("parameter", "value", "std", "unit", "source", "name in the file"), rows)
    hubs = [(f"{i}", *(f"{r[axis]:.4g}" for axis in ("x_m", "y_m", "z_m")), r["spin"]) for i, r in enumerate(rotors)]
    heads = ("rotor", "x, m forward", "y, m left", "z, m up", "turns, seen from above")
    console.table("rotors, in body axes", heads, hubs)
    lines = [(e["name"], e["law"], "yes" if e["compensated"] else "no", e["how"]) for e in effects]
    console.table("effects", ("effect", "law", "compensated", "how the controller does it, or why not"), lines)


@command.command("set")
@vehicle_argument
@click.argument("values", metavar="KEY=VALUE...", nargs=-1, required=True)
@console.dry_run_option
@console.common_options
def set_(vehicle_file: Path, values: tuple[str, ...], dry_run: bool, as_json: bool) -> None:
    """Set parameters, as `goshawk vehicle show` names them, `limits.NAME`, limits=PRESET, or gravity_m_s2.

    \b
    goshawk vehicle set vehicle.toml mass_kg=0.72 rotor_drag_thrust.drag_s_m=0.0175
    goshawk vehicle set vehicle.toml limits.speed_m_s=12 --dry-run
    goshawk vehicle set vehicle.toml limits=race

    Presets, fitted to the vehicle's thrust and weight: careful, usual, race (`goshawk vehicle new --help`); single
    limits hold after them, in any order.
    A value that was set has the source "set by hand". `goshawk vehicle undo` reverts the change.
    """
    present = changed = vehicle.load(vehicle_file)
    for text in sorted(values, key=_turn):
        changed = _assigned(changed, text)
    warnings = presets.beyond_thrust(changed)
    step = None if dry_run else history.record(vehicle_file, changed, "set", effect=" ".join(values))
    lines = history.differences(present, changed)
    if as_json:
        document = {"vehicle": str(vehicle_file), "version": step.number if step else None, "changes": lines}
        console.show("", {}, as_json=True, document=document | {"warnings": warnings})
        return
    for line in [*lines, *(f"warning: {warning}" for warning in warnings)]:
        click.echo(line)
    click.echo(f"written: {vehicle_file}, version {step.number}" if step else "nothing was written")


def _turn(text: str) -> int:
    """When a NAME=VALUE is due: a preset fits the numbers that its limits follow from; single limits stand after it."""
    name = text.partition("=")[0].strip()
    if name == "limits":
        return 1
    return 2 if name.startswith("limits.") and not name.startswith("limits.rotor_speed_") else 0


def _assigned(changed: Vehicle, text: str) -> Vehicle:
    """A copy with one NAME=VALUE; a preset of all limits is the only value that is a word."""
    name, _, value = text.partition("=")
    if name.strip() == "limits":
        return replace(changed, limits=presets.limits(changed, value.strip()))
    return _with(changed, *console.assignment(text))


def _with(changed: Vehicle, key: str, value: float) -> Vehicle:
    """A copy with one value set. Raises `InputError` for an unknown key or a value out of its range."""
    room, _, name = key.rpartition(".")
    if key == "gravity_m_s2":
        return changed.with_gravity(value)
    if room == "limits":
        if name not in (known := [field.name for field in fields(Limits)]):
            raise InputError(f"there is no limit {name!r}; there are {', '.join(known)}")
        return changed.with_limits(**{name: value})
    return changed.with_value(key, value)


@command.command()
@vehicle_argument
@click.option("--to-version", "number", type=int, help="Return to this version of the history instead.")
@console.dry_run_option
@console.yes_option
@console.common_options
def undo(vehicle_file: Path, number: int | None, dry_run: bool, yes: bool, as_json: bool) -> None:
    """Restore the vehicle file's version before its last change, byte for byte, after confirmation.

    \b
    goshawk vehicle undo vehicle.toml
    goshawk vehicle undo vehicle.toml --to-version 0 --yes

    The undone version stays in the history and can be restored with --to-version.
    """
    left, restored = history.target(vehicle_file, number)
    was, will_be = history.version(vehicle_file, left), history.version(vehicle_file, restored)
    if not dry_run:
        what = f"return {vehicle_file} from version {left.number} to {restored.number} ({_done(restored)})"
        console.confirm("\n".join([f"{what}?", *history.differences(was, will_be)]), yes=yes, as_json=as_json)
        history.restore(vehicle_file, number)
    facts = {"left": left.number, "restored": restored.number, "file_sha256": restored.file_sha256}
    document = facts | {"written": not dry_run, "changes": history.differences(was, will_be)}
    if as_json:
        console.show("", {}, as_json=True, document=document)
        return
    for line in document["changes"]:
        click.echo(line)
    click.echo(f"{'would be' if dry_run else 'is'} at version {restored.number} ({_done(restored)})")


@command.command("history")
@vehicle_argument
@click.argument("held_out", metavar="[FLIGHTS]...", nargs=-1, type=click.Path(path_type=Path))
@console.columns_option
@console.path_option("--figure", "figure", "Figure to write, .svg or .png: the error staircase over the versions.")
@outputs.overwrite_option
@console.common_options
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
    goshawk vehicle history vehicle.toml b.parquet --figure staircase.svg

    Every version is evaluated on FLIGHTS, held-out ones; without, the table shows the recorded verdicts.
    """
    if figure is not None and not held_out:
        raise click.UsageError("--figure needs FLIGHTS: versions are compared on the same flights")
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


def _done(step: history.Step) -> str:
    return f"{step.action} {step.effect}".rstrip()
