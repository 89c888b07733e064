"""`goshawk params`: list, read and set the controller's parameters on the vehicle; a set is all or nothing."""

from pathlib import Path

import click

import firmware_bridge
import vehicle
from firmware_bridge import controller
from firmware_bridge.parameters import difference, refuse_unknown, shortest
from flight import InputError
from goshawk.terminal import console
from goshawk.terminal.verbs import VerbGroup

SUMMARY = "List, read and set the controller's parameters on the vehicle."


@click.group(cls=VerbGroup)
def command() -> None:
    """List, read and set the parameters of the vehicle's controller.

    \b
    goshawk params list
    goshawk params get mass_kg kp_xy_1_s2
    goshawk params set mass_kg=0.72 kp_xy_1_s2=8
    goshawk params set --vehicle vehicle.toml --dry-run

    A set is sent as one block with a checksum: the vehicle accepts all of it or nothing, and reports the reason.
    """


@command.command("list")
@console.url_option
@console.key_option
@console.common_options
def list_(url: str, key_file: Path | None, as_json: bool) -> None:
    """List every parameter of the vehicle, with its bounds.

    \b
    goshawk params list
    goshawk params list --json > before.json
    """
    with firmware_bridge.connect(url, key=key_file) as link:
        values = shortest(link.parameters())
    if as_json:
        console.show("", {}, as_json=True, document=values)
        return
    rows = [(name, value, *_range(name)) for name, value in values.items()]
    console.table(f"parameters of {url}", ("name", "value", "smallest", "largest", "in the air"), rows)


@command.command()
@click.argument("names", nargs=-1, required=True, metavar="NAME...")
@console.url_option
@console.key_option
@console.common_options
def get(names: tuple[str, ...], url: str, key_file: Path | None, as_json: bool) -> None:
    """Read some parameters.

    \b
    goshawk params get mass_kg
    goshawk params get kp_xy_1_s2 kd_xy_1_s --json
    """
    with firmware_bridge.connect(url, key=key_file) as link:
        values = shortest(link.parameters())
    refuse_unknown(names, values)
    console.show("", {name: values[name] for name in names}, as_json=as_json)


@command.command("set")
@click.argument("assignments", nargs=-1, metavar="NAME=VALUE...")
@console.path_option(
    "--vehicle", "vehicle_file", "Vehicle file: set the parameters that follow from it; NAME=VALUE overrides them."
)
@click.option(
    "--accept-mark", is_flag=True, help="Compensate by a model that is marked for prediction, not for design."
)
@console.dry_run_option
@console.yes_option
@console.url_option
@console.key_option
@console.take_over_option
@console.common_options
def set_(
    assignments: tuple[str, ...],
    vehicle_file: Path | None,
    accept_mark: bool,
    dry_run: bool,
    yes: bool,
    url: str,
    key_file: Path | None,
    take_over: bool,
    as_json: bool,
) -> None:
    """Set parameters, all of them or none; the changes are shown first.

    \b
    goshawk params set mass_kg=0.72
    goshawk params set --vehicle vehicle.toml kp_xy_1_s2=8
    goshawk params set --vehicle vehicle.toml --dry-run --json
    """
    requested = from_vehicle(vehicle_file, accept_mark=accept_mark or dry_run) | dict(
        console.assignment(text) for text in assignments
    )
    if not requested:
        raise InputError("nothing to set: give NAME=VALUE, or --vehicle FILE")
    controller.checked(requested)
    with firmware_bridge.connect(url, key=key_file) as link:
        present = link.parameters()
        refuse_unknown(requested, present)
        changed = difference(present, requested)
        rows = [(name, before, after, _unit(name)) for name, (before, after) in changed.items()]
        if rows and not as_json:
            console.table("", ("name", "vehicle has", "will have", "unit"), rows)
        if rows and not dry_run:
            console.confirm("Set these?", yes=yes, as_json=as_json)
            link.take_control(force=take_over)
            link.set_parameters({name: after for name, (_, after) in changed.items()})
    document = {
        "vehicle": url,
        "set": bool(rows) and not dry_run,
        "changes": {name: {"before": before, "after": after, "unit": unit} for name, before, after, unit in rows},
    }
    if as_json:
        console.show("", {}, as_json=True, document=document)
    else:
        console.note(_verdict(len(rows), dry_run=dry_run))


def _verdict(changes: int, *, dry_run: bool) -> str:
    if not changes:
        return "no change: the vehicle has these values already"
    return "nothing was changed" if dry_run else f"set and confirmed by checksum: {changes} parameters"


def from_vehicle(file: Path | None, *, accept_mark: bool) -> dict[str, float]:
    """Controller parameters for a vehicle file; its mark, and effects not compensated, are listed on stderr.

    Raises:
        InputError: the model is for prediction, not for design, and nobody accepted that.
    """
    if file is None:
        return {}
    believed = vehicle.load(file)
    if mark := vehicle.purpose.mark_sentence(believed):
        if not accept_mark:
            raise InputError(f"{file} is {mark}; measure or set these values, or give --accept-mark to fly with them")
        click.echo(f"warning: {file} is {mark}", err=True)
    made = controller.parameters_of(believed)
    if made.not_compensated:
        click.echo(f"warning: not compensated by the controller: {', '.join(made.not_compensated)}", err=True)
    return dict(made.parameters)


def _unit(name: str) -> str:
    row = controller.PARAMETERS.get(name)
    return "?" if row is None else row.unit


def _range(name: str) -> tuple[object, object, str]:
    """Bounds, and whether it may change in flight, from the generated parameter table."""
    row = controller.PARAMETERS.get(name)
    if row is None:
        return "?", "?", "?"
    return row.smallest, row.largest, "yes" if row.in_flight else "only disarmed"
