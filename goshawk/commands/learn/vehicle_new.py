"""`goshawk vehicle new` and `goshawk vehicle schema`: make a vehicle file."""

import json
import math
import sys
from dataclasses import replace
from pathlib import Path

import click
import numpy as np

import vehicle
from flight import InputError
from flight.units import RAD_S_PER_RPM
from goshawk.terminal import console, outputs, words
from vehicle import Parameter, Vehicle, commented, draft, layouts, presets
from vehicle.draft import Known

RANGES = {
    "--mass": (0.0, 1000.0, "kg"),
    "--prop-diameter": (0.0, 5.0, "m"),
    "--hover-rpm": (10.0, 200_000.0, "rpm"),
    "--max-rpm": (10.0, 400_000.0, "rpm"),
}
"""Smaller and larger numbers are in another unit."""


@click.command("new")
@click.argument("out", type=click.Path(path_type=Path), required=False)
@click.option("--mass", "mass_kg", type=float, help="Mass ready to fly, battery included, kg.")
@click.option("--arm", "arm_m", type=float, help="Distance from the centre to a motor, metres.")
@click.option(
    "--frame", type=click.Choice(layouts.FRAMES),
    help="Arms between the axes (x, hex, octo), also ahead (+, hex+, octo+), or coaxial (y6, x8) [default: x].",
)  # fmt: skip
@click.option("--motor-order", type=click.Choice(list(layouts.FIRMWARES)), help="Number rotors as this firmware does.")
@click.option(
    "--props-out",
    is_flag=True,
    help="Reverse all rotors: the usual (front left clockwise, seen from above), or those of --import.",
)
@click.option("--prop-diameter", "diameter_m", type=float, help="Diameter of a propeller, metres (5 inches: 0.127).")
@click.option("--hover-rpm", type=float, help="Rotor speed in hover, if known: gives a much better thrust coefficient.")
@click.option("--max-rpm", type=float, help="Fastest rotor speed, if known.")
@click.option(
    "--limits",
    type=click.Choice(list(presets.PRESETS)),
    help="What plans may ask: a share of the thrust beyond the weight [default: usual with --hover-rpm and --max-rpm, "
    "else careful].",
)
@click.option("--name", help="Name: of the vehicle [default: the file's name].")
@console.path_option(
    "--import", "source", "Import from a file of PX4, ArduPilot, Betaflight, RotorPy, URDF, MJCF or drone-models."
)
@outputs.overwrite_option
@console.common_options
def new(
    out: Path | None,
    mass_kg: float | None,
    arm_m: float | None,
    frame: str | None,
    motor_order: str | None,
    props_out: bool,
    diameter_m: float | None,
    hover_rpm: float | None,
    max_rpm: float | None,
    limits: str | None,
    name: str | None,
    source: Path | None,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Make a vehicle file from a data sheet or another program's file; missing values are marked estimates.

    \b
    goshawk vehicle new my.toml --mass 0.72 --arm 0.125 --prop-diameter 0.127
    goshawk vehicle new six.toml --frame hex --motor-order ardupilot --mass 1.6 --arm 0.28 --prop-diameter 0.23
    goshawk vehicle new my.toml --import px4.params --mass 0.72 --prop-diameter 0.127
    goshawk vehicle new my.toml --import hummingbird_params.py

    `--limits careful`, `usual` or `race` plan with 27, 50 or 80 % of the thrust beyond the weight, tilted by at most
    .5, .8 or 1.1 rad. `goshawk vehicle set FILE limits=race` fits a file anew.

    On a terminal it asks for missing values. Every number in the file has a standard deviation and a source; a
    default is marked as one.
    """
    asks = sys.stdin.isatty() and not as_json
    if out is None:
        if not asks:
            raise click.UsageError(
                "give the file to write: goshawk vehicle new my.toml --mass ... --arm ... --prop-diameter ..."
            )
        out = Path(click.prompt("Vehicle file to write", default="vehicle.toml", err=True))
    if out.suffix != ".toml":
        raise InputError(f"{out} does not end in .toml; call it {out.name}.toml")
    outputs.check(out, overwrite=overwrite)
    known = imported(source) if source is not None else Known()
    known = with_options(known, mass_kg, arm_m, frame, diameter_m, hover_rpm, max_rpm, firmware=motor_order)
    if asks:
        known = _asked(known, frame, motor_order)
    if props_out:
        known = reversed_spins(known)
    made = draft.draft(replace(known, name=name or known.name or out.stem), limits=limits)
    with outputs.file(out, overwrite=overwrite) as temporary:
        commented.write(temporary, made)
    _show(out, made, known, limits or draft.preset_for(known), as_json)


def imported(path: Path) -> Known:
    """Data of another program's file; the suffix determines the format."""
    from vehicle.importers import (
        import_ardupilot,
        import_betaflight,
        import_drone_models,
        import_mjcf,
        import_px4,
        import_rotorpy,
        import_urdf,
    )

    suffix = path.suffix.lower()
    if suffix in (".params", ".param", ".parm"):
        return (import_ardupilot if import_ardupilot.is_ardupilot(path) else import_px4).read(path)
    readers = {
        ".ulg": import_px4.read,
        ".py": import_rotorpy.read,
        ".urdf": import_urdf.read,
        ".xml": import_mjcf.read,
        ".txt": import_betaflight.read,
        ".toml": import_drone_models.read,
    }
    reader = readers.get(suffix)
    if reader is None:
        endings = ", ".join((".params", ".param", *readers))
        raise InputError(f"--import {path}: the suffix must be one of {endings}, which identify the format")
    return reader(path)


def with_options(
    known: Known,
    mass_kg: float | None,
    arm_m: float | None,
    frame: str | None,
    diameter_m: float | None,
    hover_rpm: float | None,
    max_rpm: float | None,
    *,
    firmware: str | None = None,
) -> Known:
    """Options override imported values. `--arm` without `--frame` scales an imported geometry.

    Raises:
        InputError: a value that no vehicle has.
        click.UsageError: a frame without its arm, or a motor order where imported places stay.
    """
    if firmware is not None and known.hub_body_m is not None and (frame is None or arm_m is None):
        raise click.UsageError(
            "--motor-order would not change the imported order of the rotors: leave it out, or give --frame and --arm"
        )
    given = {
        "--mass": mass_kg,
        "--arm": arm_m,
        "--prop-diameter": diameter_m,
        "--hover-rpm": hover_rpm,
        "--max-rpm": max_rpm,
    }
    for option, value in given.items():
        if value is not None and not (math.isfinite(value) and value > 0.0):
            raise InputError(f"{option} is {value:g}; a positive number is expected")
        least, most, unit = RANGES.get(option, (0.0, math.inf, ""))
        if value is not None and not least <= value <= most:
            bound = f"at least {least:g}" if value < least else f"at most {most:g}"
            raise InputError(f"{option} is {value:g} {unit}; {bound} {unit} is expected: give it in {unit}")
    if mass_kg is not None:
        source = "given on the command line; std: 1 %, as of a kitchen scale"
        known = replace(known, mass_kg=Parameter(mass_kg, float(f"{0.01 * mass_kg:.2g}"), "kg", source))
    if diameter_m is not None:
        radius = Parameter(0.5 * diameter_m, 0.0, "m", "given on the command line: half the propeller's diameter")
        known = replace(known, rotor_radius_m=radius)
    if arm_m is not None and frame is None and known.hub_body_m is not None:
        own_m = float(np.hypot(known.hub_body_m[:, 0], known.hub_body_m[:, 1]).mean())
        draft.layout(arm_m, "x")  # refuses an impossible arm
        note = f"rotor places were scaled from a mean arm of {own_m:.4g} m to the given {arm_m:g} m"
        note = note if known.arm_known else f"rotor places are at the given arm of {arm_m:g} m"
        hubs = np.round(known.hub_body_m * (arm_m / own_m), 6)
        known = replace(known, hub_body_m=hubs, arm_known=True, notes=(*known.notes, note))
    elif arm_m is not None:
        hubs, spin = draft.layout(arm_m, frame or "x", firmware)
        words = layouts.find(frame or "x", firmware).words
        note = f"defaults to check against your vehicle: {frame or 'x'} frame; rotors {words}"
        known = replace(known, hub_body_m=hubs, arm_known=True, spin=spin, axis_body=None, notes=(*known.notes, note))
    elif frame is not None and known.hub_body_m is not None:
        raise click.UsageError("--frame replaces the imported places of the rotors: give --arm too")
    if hover_rpm is not None:
        known = replace(known, hover_rad_s=hover_rpm * RAD_S_PER_RPM)
    return known if max_rpm is None else replace(known, rotor_speed_max_rad_s=max_rpm * RAD_S_PER_RPM)


def reversed_spins(known: Known) -> Known:
    """All rotors turn the other way than the default, or than another program's file says."""
    spin = -draft.spins(known)
    turns = ", ".join(draft.TURNS[int(s)] for s in spin)
    note = f"--props-out: all spins reversed, rotors 0 to {len(spin) - 1} {turns}"
    return replace(known, spin=spin, notes=(*known.notes, note))


def _asked(known: Known, frame: str | None, firmware: str | None) -> Known:
    """Ask for the data that no formula can estimate."""
    if known.mass_kg is None:
        grams = click.prompt("Mass ready to fly, in grams", type=click.FloatRange(1.0, 1e6), err=True)
        known = with_options(known, grams / 1000.0, None, None, None, None, None)
    if known.hub_body_m is None or not known.arm_known:
        frame = frame or click.prompt("Frame", type=click.Choice(layouts.FRAMES), default="x", err=True)
        arm = click.prompt("From the centre to a motor, in millimetres", type=click.FloatRange(1.0, 1e4), err=True)
        known = with_options(known, None, arm / 1000.0, frame, None, None, None, firmware=firmware)
    if known.rotor_radius_m is None:
        inches = click.prompt("Propeller diameter, in inches", type=click.FloatRange(0.1, 100.0), err=True)
        known = with_options(known, None, None, None, 0.0254 * inches, None, None)
    return known


def _show(out: Path, made: Vehicle, known: Known, preset: str, as_json: bool) -> None:
    shown = {n: made.parameters[n] for n in vehicle.specs(made) if not n.startswith("pose_sensor")}
    guessed = [n for n, p in shown.items() if p.source.startswith(("default", "estimated"))]
    if as_json:
        parameters = {n: {"value": p.value, "std": p.std, "unit": p.unit, "source": p.source} for n, p in shown.items()}
        document = {"written": str(out), "name": made.name, "effects": list(made.effects)}
        document |= {"limits": {"preset": preset} | made.limits.as_dict()}
        console.show(
            "",
            {},
            as_json=True,
            document=document | {"parameters": parameters, "not_measured": guessed, "notes": list(known.notes)},
        )
        return
    rows = [
        (words.parameter(n), f"{p.value:.4g} ± {p.std:.1g}" if p.std else f"{p.value:.4g}", p.unit, p.source)
        for n, p in shown.items()
    ]
    console.table(made.name, ("parameter", "value", "unit", "where it came from"), rows)
    for note in known.notes:
        click.echo(f"note: {note}")
    most, ratio, std = made.limits, presets.thrust_to_weight(made), presets.thrust_to_weight_std(made)
    click.echo(
        f"limits: {preset}: {most.speed_m_s:g} m/s, {most.acceleration_m_s2:g} m/s2, {most.tilt_rad:g} rad of tilt, "
        f"from {ratio:.1f} ± {std:.1g} times its weight in thrust; --limits takes {', '.join(presets.PRESETS)}"
    )
    click.echo(f"written: {out}; {len(guessed)} of {len(shown)} numbers are defaults or estimates")
    fit = f"to fit it to its flights: goshawk identify FLIGHTS --vehicle {out} --out fitted.toml"
    simulated = made.rotors == 4 and made.axis_body is None  # by the embedded controller
    click.echo(f"next, to simulate it: goshawk sitl --vehicle {out}\nor {fit}" if simulated else f"next, {fit}")


@click.command("schema")
@console.path_option("--out", "out", "File to write [default: print it].")
@outputs.overwrite_option
@console.common_options
def schema(out: Path | None, overwrite: bool, as_json: bool) -> None:
    """Write the JSON schema of vehicle files, for completion and checks in editors.

    \b
    goshawk vehicle schema --out vehicle.schema.json
    goshawk vehicle schema | less

    Write `#:schema vehicle.schema.json` into the first line of a vehicle file (taplo, Even Better TOML).
    """
    from vehicle.schema import schema as described

    outputs.check(out, overwrite=overwrite)
    text = json.dumps(described(), indent=1) + "\n"
    if out is None:
        click.echo(text, nl=False)
        return
    with outputs.file(out, overwrite=overwrite) as temporary:
        temporary.write_text(text)
    console.show("schema", {"written": str(out)}, as_json=as_json)
