"""`goshawk sitl`: the SITL vehicle, until Ctrl-C."""

import json
import math
from dataclasses import replace
from pathlib import Path

import click
import numpy as np

import vehicle
from firmware_bridge import Impairment, Sensors, SitlVehicle, controller, keys
from flight import FloatArray, InputError, trajectory
from goshawk.terminal import console

SUMMARY = "Run a SITL vehicle: the embedded C code on a simulated body."
FARTHEST_M = 1e5
"""Positions travel as 32-bit floats: beyond this they are coarser than a centimetre."""
STRONGEST_M_S = 100.0
"""Of wind and gusts, in every axis: a hurricane has 90 m/s."""
LONGEST_DELAY_S = 60.0
"""The link has given up long before."""


@click.command()
@console.vehicle_option
@console.path_option(
    "--believed", "believed_file", "Vehicle file for the controller's parameters [default: --vehicle]."
)
@click.option("--at", "at", default="0,0,0", show_default=True, help="Start on the ground at x,y,z (world, metres).")
@console.path_option("--start-of", "trajectory_file", "Start on the ground below the start of this trajectory.")
@click.option(
    "--ground", "ground_m", default=0.0, show_default=True, help="Height of the floor for --start-of, metres."
)
@click.option(
    "--port",
    type=click.IntRange(0, 65535),
    default=14550,
    show_default=True,
    help="Port to listen at; 0 takes a free one.",
)
@console.key_option
@click.option(
    "--time-factor", "speed", default=1.0, show_default=True, help="Real-time factor; 0 is as fast as possible."
)
@click.option("--perfect-sensors", is_flag=True, help="No noise and no delay in the estimate.")
@click.option("--loss", "loss_ratio", default=0.0, show_default=True, help="Share of datagrams lost each way.")
@click.option("--delay", "delay_s", default=0.0, show_default=True, help="Delay of datagrams each way, seconds.")
@click.option("--wind", default="0,0,0", show_default=True, help="Steady wind, x,y,z or x alone (world, m/s).")
@console.gust_option("0.0", 0.0)
@click.option(
    "--mass-ratio", "mass_ratio", type=click.FloatRange(0.5, 1.5), default=1.0, help="True mass over the file's."
)
@click.option("--rotor", "rotors", multiple=True, metavar="I=RATIO", help="Thrust of rotor 0 to 3 over the file's.")
@click.option(
    "--pose-delay", "pose_delay_s", type=click.FloatRange(0.0, 0.2), default=0.0, help="Delay of the pose, untold, s."
)
@click.option(
    "--observer", type=click.Choice(["on", "off"]), default="on", show_default=True, help="Disturbance observer."
)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Seed: of all noise.")
@click.option(
    "--state",
    "state_file",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Permanent memory of the link: boot count and signature stamp. Without it, a random boot number.",
)
@console.common_options
def command(
    vehicle_file: Path,
    believed_file: Path | None,
    at: str,
    trajectory_file: Path | None,
    ground_m: float,
    port: int,
    key_file: Path | None,
    speed: float,
    perfect_sensors: bool,
    loss_ratio: float,
    delay_s: float,
    wind: str,
    gust_std_m_s: float,
    mass_ratio: float,
    rotors: tuple[str, ...],
    pose_delay_s: float,
    observer: str,
    seed: int,
    state_file: Path | None,
    as_json: bool,
) -> None:
    """Run a SITL vehicle: the embedded controller and link (the same C files) on a simulated body, over UDP.

    \b
    goshawk sitl --vehicle vehicle.toml --start-of walk.json
    goshawk sitl --vehicle vehicle.toml --wind 3 --mass-ratio 1.05 --rotor 2=.85

    --vehicle is the true vehicle that is simulated; --believed gives its controller's parameters. A link key is made on
    first use. The first line printed is the address; --json makes it an object.
    """
    if not (math.isfinite(speed) and speed >= 0.0):
        raise InputError(f"--time-factor {speed:g} is not a number of at least 0")
    if not abs(ground_m) <= FARTHEST_M:
        raise InputError(f"--ground {ground_m:g} is not a height within {FARTHEST_M:g} m of 0")
    blowing = np.array(console.numbers("--wind", wind if "," in wind else f"{wind},0,0", 3))
    for option, value_m_s in (("--wind", float(np.abs(blowing).max())), ("--gust-std", gust_std_m_s)):
        if not value_m_s <= STRONGEST_M_S:
            raise InputError(f"{option} {value_m_s:g} m/s is too strong; at most {STRONGEST_M_S:g} m/s is simulated")
    if delay_s > LONGEST_DELAY_S:
        raise InputError(f"--delay {delay_s:g} s is too long; at most {LONGEST_DELAY_S:g} s is simulated")
    if not 0.0 <= loss_ratio <= 1.0:
        raise InputError(f"--loss {loss_ratio:g} is no share of datagrams; it is from 0 (none) to 1 (all)")
    line = Impairment(loss_ratio=loss_ratio, delay_s=delay_s)
    learned = vehicle.load(vehicle_file)
    setup = controller.parameters_of(vehicle.load(believed_file) if believed_file is not None else learned)
    truth = _changed(learned, mass_ratio, rotors)
    place = np.array(console.numbers("--at", at, 3)) if trajectory_file is None else _below(trajectory_file, ground_m)
    if np.abs(place).max() > FARTHEST_M:
        raise InputError(f"--at {at}: the start is more than {FARTHEST_M:g} m from the origin")
    plant = vehicle.simulate.Plant(
        truth,
        vehicle.simulate.State(position_world_m=place),
        rng=np.random.default_rng(seed + 1),
        wind=vehicle.simulate.Wind(tuple(blowing), gust_std_m_s),
        ground_m=float(place[2]),
    )
    served = SitlVehicle(
        plant,
        {**setup.parameters, "observer": float(observer == "on")},
        key=keys.load_or_create(key_file),
        port=port,
        speed=speed,
        sensors=replace(Sensors() if perfect_sensors else Sensors.typical(), untold_delay_s=pose_delay_s),
        line=line,
        seed=seed,
        state_file=state_file,
    )
    click.echo(json.dumps({"url": served.url}) if as_json else served.url)
    console.note(f"{truth.name} stands at {place.round(2).tolist()}; stop with Ctrl-C")
    if setup.not_compensated:
        click.echo(f"warning: not compensated by the controller: {', '.join(setup.not_compensated)}", err=True)
    served.serve()


def _changed(learned: vehicle.Vehicle, mass_ratio: float, rotors: tuple[str, ...]) -> vehicle.Vehicle:
    """The vehicle that flies, where it is not the one of the file."""
    truth = learned.with_value("mass_kg", learned.mass_kg * mass_ratio) if mass_ratio != 1.0 else learned
    if rotors and "weak_rotor" not in truth.effects:
        truth = truth.with_effect("weak_rotor")
    for text in rotors:
        rotor, ratio = _rotor(text)
        name = f"weak_rotor.loss_{rotor}"
        truth = truth.with_value(name, 1.0 - (1.0 - truth.value(name)) * ratio)
    return truth


def _rotor(text: str) -> tuple[int, float]:
    rotor, _, value = text.partition("=")
    try:
        ratio = float(value)
    except ValueError:
        ratio = math.nan
    if rotor not in ("0", "1", "2", "3") or not 0.0 <= ratio <= 1.5:
        raise InputError(f"--rotor {text!r} is not a rotor 0 to 3 and a ratio from 0 to 1.5, like 2=.85")
    return int(rotor), ratio


def _below(trajectory_file: Path, ground_m: float) -> FloatArray:
    start = trajectory.load(trajectory_file).trajectory.position([0.0])[0]
    if start[2] <= ground_m:
        raise InputError(f"the trajectory starts at {start[2]:.2f} m, below the ground at {ground_m:.2f} m")
    return np.array([start[0], start[1], ground_m])
