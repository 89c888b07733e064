"""`goshawk fly`: take off, fly the uploaded trajectory, land; write the flight log."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import click

import firmware_bridge
import vehicle
from firmware_bridge.airborne import slowed, tracking
from firmware_bridge.link import refuse_unfit
from flight import FlightLog, InputError, flight_log, trajectory
from goshawk.terminal import console, outputs

SUMMARY = "Fly the uploaded trajectory and record a flight log."


@click.command()
@click.argument("plan", metavar="[TRAJECTORY]", type=click.Path(path_type=Path), required=False)
@click.option(
    "--on",
    "address",
    metavar="ADDRESS",
    help="Flight controller of other firmware: betaflight:tcp://HOST:PORT; mavlink:udp://HOST:PORT and "
    "crazyflie:udp://HOST:PORT, which have flown simulated ones only: not PX4, not ArduPilot, no Crazyflie.",
)
@click.option("--arming", "arms", is_flag=True, help="With mavlink: and crazyflie: arm it; else the pilot does.")
@click.option("--rehearse", is_flag=True, help="Fly it on Betaflight's real firmware in a simulated body.")
@console.path_option("--body", "body_file", "With --rehearse: vehicle file of the body, if another.")
@console.path_option("--record", "record", "With --rehearse: folder for its blackbox and the poses sent (TUM).")
@click.option(
    "--pose-stream",
    "pose_stream",
    default="udp://127.0.0.1:7777",
    show_default=True,
    help="Address at which the vehicle's poses arrive, as TUM lines.",
)
@console.path_option("--vehicle", "vehicle_file", "Vehicle file, for --on and --rehearse.")
@console.path_option("--out", "out", "Flight log to write.", required=True)
@console.path_option("--trajectory", "trajectory_file", "Refuse to fly unless this is the vehicle's active trajectory.")
@console.url_option
@console.key_option
@console.take_over_option
@outputs.overwrite_option
@console.common_options
def command(
    plan: Path | None,
    address: str | None,
    arms: bool,
    rehearse: bool,
    body_file: Path | None,
    record: Path | None,
    pose_stream: str,
    vehicle_file: Path | None,
    out: Path,
    trajectory_file: Path | None,
    url: str,
    key_file: Path | None,
    take_over: bool,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Fly the vehicle's active trajectory, and write the flight log.

    \b
    goshawk fly --out flights/walk.parquet
    goshawk fly walk.json --rehearse --vehicle vehicle.toml --out rehearsed.parquet
    goshawk fly walk.json --on betaflight:tcp://127.0.0.1:5761 --vehicle vehicle.toml --out walk.parquet
    goshawk fly walk.json --on mavlink:udpin://127.0.0.1:14540 --arming --vehicle vehicle.toml --out walk.parquet
    goshawk fly --trajectory walk.json --out flights/walk.parquet

    Refused on the ground: a start too far away, a tilted or moving vehicle, a low battery, no estimate, the geofence.
    Ctrl-C brakes along the path and lands. The log of a flight that ends early is written too.
    """
    outputs.check(out, overwrite=overwrite)

    def write(log: FlightLog) -> None:
        with outputs.file(out, overwrite=overwrite) as temporary:
            flight_log.save(temporary, log)
        if "ended_early" in log.metadata:
            click.echo(f"note: wrote the log as far as it goes to {out}", err=True)

    if (body_file or record) and not rehearse:
        raise click.UsageError("--body and --record are for --rehearse")
    if address is not None or rehearse:
        rehearsal = Rehearsal(body_file, record) if rehearse else None
        _fly_off_board(plan, address, arms, rehearsal, pose_stream, vehicle_file, out, write, overwrite, as_json)
        return
    if plan is not None:
        raise InputError(f"{plan}: with --on or --rehearse it is flown; of a vehicle of ours say --trajectory {plan}")
    item = trajectory.load(trajectory_file) if trajectory_file is not None else None
    with (
        console.cancel_by_ctrl_c() as cancel,
        firmware_bridge.connect(url, key=key_file) as link,
        console.progress() as report,
    ):
        link.take_control(force=take_over)
        log = link.fly(item, progress=report, cancel=cancel, ended_early=write)
    write(log)
    planned = {"planned_s": item.trajectory.duration_s} if item is not None else {}
    facts = {"written": str(out), "rows": len(log), **planned, **tracking(log)}
    why = slowed(log)
    console.show("flight", facts, as_json=as_json, document=facts | {"slowed": why})
    if not as_json and why:
        click.echo(f"note: {why}")


@dataclass(frozen=True, slots=True)
class Rehearsal:
    """What is asked of one."""

    body_file: Path | None
    record: Path | None


def _fly_off_board(
    plan: Path | None,
    address: str | None,
    arms: bool,
    rehearsal: Rehearsal | None,
    pose_stream: str,
    vehicle_file: Path | None,
    out: Path,
    write: Callable[[FlightLog], None],
    overwrite: bool,
    as_json: bool,
) -> None:
    from goshawk.commands.fly import autopilot, crazyflie, offboard

    if address is not None and rehearsal is not None:
        raise InputError("--rehearse flies in a simulated body, --on the flight controller there; give one of them")
    mavlink = address is not None and address.startswith(autopilot.line.PREFIX)
    flies_itself = address is not None and address.startswith(crazyflie.PREFIX)
    if arms and not (mavlink or flies_itself):
        raise InputError("--arming is for mavlink: and crazyflie: addresses; Betaflight is armed by its own switch")
    if plan is None:
        raise InputError("name the trajectory file to fly: goshawk fly walk.json --rehearse --vehicle vehicle.toml")
    if rehearsal is not None and rehearsal.record is not None:
        outputs.check(*(rehearsal.record / name for name in offboard.RECORDED), overwrite=overwrite)
    item, model = trajectory.load(plan), offboard.model_of(vehicle_file)
    refuse_unfit(item, None, vehicle.vehicle_hash(model) if item.checked else None, rehearsal is not None)
    touch_down: dict[str, float] = {}
    with console.cancel_by_ctrl_c() as cancel, console.progress() as report:
        if rehearsal is not None:
            flies = vehicle.load(rehearsal.body_file) if rehearsal.body_file is not None else None
            log, early, down_m_s = offboard.rehearse(
                model, item, seed=1, progress=report, cancel=cancel, flies=flies, record=rehearsal.record
            )
            touch_down = {"touch_down_m_s": down_m_s}
        else:
            assert address is not None
            where = offboard.Where(address, *offboard.pose_address(pose_stream))
            if flies_itself:
                log, early = crazyflie.fly(model, item, address, arms=arms, progress=report, cancel=cancel)
            elif mavlink:
                log, early = autopilot.fly(model, item, where, arms=arms, progress=report, cancel=cancel)
            else:
                log, early = offboard.fly(model, item, where, progress=report, cancel=cancel)
    write(log)
    facts = {"written": str(out), "rows": len(log), "planned_s": item.trajectory.duration_s, **tracking(log)}
    notes = {name: log.metadata[name] for name in ("battery", "failsafe") if name in log.metadata}
    console.show("flight", facts | touch_down | notes, as_json=as_json)
    if early:
        click.echo(f"goshawk: ended early: {early}", err=True)
        raise click.exceptions.Exit(1)
