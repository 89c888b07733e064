"""`goshawk preflight`: a trajectory flown many times in simulation before it is flown once."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import click
import numpy as np

import mapping
import preflight
import vehicle
from flight import TrajectoryFile, file_format, trajectory
from goshawk.commands.plan import preflight_batch, preflight_inputs
from goshawk.commands.plan.preflight_inputs import DEFAULT, PLAN_AGAIN, blowing, body_of, of_map, require_fit
from goshawk.commands.plan.preflight_inputs import document as document_of
from goshawk.terminal import console, outputs
from goshawk.terminal.verbs import DefaultVerbGroup
from preflight import remedies, worst
from preflight.result import SCHEMA, SCHEMA_VERSION

SUMMARY = "Fly a trajectory a thousand times in simulation: go or no-go."


@click.command()
@click.argument("trajectory_file", metavar="TRAJECTORY", type=click.Path(path_type=Path))
@console.map_option
@console.vehicle_option
@click.option("--flights", type=int, help="Flights to count [default: as many as can show --risk]; of a --rare level.")
@click.option(
    "--rare", is_flag=True, help="Estimate by levels of ever nearer flights [default: for risks below 0.001]."
)
@preflight_inputs.risk_option
@click.option("--wind", default="0", show_default=True, help="Steady wind: its speed, from anywhere, or x,y,z (m/s).")
@console.gust_option
@click.option(
    "--thermals",
    "thermal_std_m_s",
    type=click.FloatRange(0.0, 10.0),
    default=0.0,
    show_default=True,
    help="Vertical wind at 10 m height, m/s: its standard deviation; less below.",
)
@click.option(
    "--pose-delay",
    "pose_delay_s",
    type=click.FloatRange(0.0, 0.1),
    help="Delay of the pose, untold, s: its standard deviation [default: the model's, or 0.003].",
)
@click.option(
    "--drop-outs",
    "drop_outs_per_s",
    type=click.FloatRange(0.0, 10.0),
    default=0.0,
    show_default=True,
    help="Gaps of the pose a second, each of --drop-out-time.",
)
@click.option(
    "--drop-out-time",
    "drop_out_s",
    type=click.FloatRange(0.0, 5.0),
    default=DEFAULT.drop_out_s,
    show_default=True,
    help="Length of a gap of the pose, s.",
)
@preflight_inputs.localization_option
@click.option(
    "--pose-jump",
    "pose_jump_std_m",
    type=click.FloatRange(0.0, 5.0),
    default=0.0,
    show_default=True,
    help="Lasting jump of the pose at some moment of every flight, m: its standard deviation.",
)
@click.option(
    "--pose-outside",
    is_flag=True,
    help="The pose is not one in the map (motion capture): a wrong scale moves its walls.",
)
@click.option(
    "--motor-fault",
    "motor_fault_ratio",
    type=click.FloatRange(0.0, 1.0),
    default=0.0,
    show_default=True,
    help="Share of its thrust that one rotor loses at some moment of every flight.",
)
@click.option(
    "--battery", "battery_v", type=click.FloatRange(0.0), help="Lowest battery voltage at the start [default: full]."
)
@click.option("--advise", is_flag=True, help="Find the largest wind that is a go, and how much slower is one.")
@preflight_inputs.seed_option
@console.path_option("--out", "out", "JSON file to write with the whole result.")
@console.path_option("--report", "report", "HTML page to write: the flights in the map, the worst three, and why.")
@outputs.overwrite_option
@console.common_options
def one(
    trajectory_file: Path,
    map_folder: Path,
    vehicle_file: Path,
    flights: int | None,
    rare: bool,
    risk: float,
    wind: str,
    gust_std_m_s: float,
    thermal_std_m_s: float,
    pose_delay_s: float | None,
    drop_outs_per_s: float,
    drop_out_s: float,
    localization_std_m: float,
    pose_jump_std_m: float,
    pose_outside: bool,
    motor_fault_ratio: float,
    battery_v: float | None,
    advise: bool,
    seed: int,
    out: Path | None,
    report: Path | None,
    overwrite: bool,
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
    outputs.check(out, report, overwrite=overwrite)
    item = trajectory.load(trajectory_file)
    believed = vehicle.load(vehicle_file)
    uncertainty = replace(
        blowing(wind), gust_std_m_s=gust_std_m_s, thermal_std_m_s=thermal_std_m_s, pose_delay_std_s=pose_delay_s,
        drop_outs_per_s=drop_outs_per_s, drop_out_s=drop_out_s, localization_std_m=localization_std_m,
        pose_jump_std_m=pose_jump_std_m, pose_of_map=not pose_outside, motor_fault_ratio=motor_fault_ratio,
        battery_v=battery_v,
    )  # fmt: skip
    options = preflight.Options(flights, risk, seed, uncertainty, rare=rare or None)
    with console.progress() as progress:
        progress("opening the map", 0.0)
        area = mapping.open_map(map_folder)
        require_fit(item, area, believed)
        options = replace(options, uncertainty=of_map(area, uncertainty))
        radius_m, clearance_m = body_of(item, believed)
        body = {"radius_m": radius_m, "clearance_m": clearance_m}
        flown = (believed, item.trajectory, area.field)
        result = preflight.fly(*flown, **body, options=options, progress=progress)
        advice = None
        if advise and not result.cut_off:
            advice = preflight.advised(*flown, result, **body, options=options, progress=progress)
        progress("flying the worst again", 0.0)
        bundle = worst.BUNDLE if report is not None else 0
        try:
            replay = preflight.replay(*flown, result, **body, options=options, bundle=bundle)
        except KeyboardInterrupt:  # the result is kept
            replay = None
    document = document_of(item, area, believed, seed, result, replay)
    if advice is not None:
        document |= {"advice": {"wind_m_s": advice.wind_m_s, "slower": advice.slower}}
    if out is not None:
        with outputs.file(out, overwrite=overwrite) as temporary:
            file_format.write_json(temporary, format=SCHEMA, version=SCHEMA_VERSION, body=document)
    if report is not None and replay is not None:
        page = _page(item, area, believed, options, radius_m, result, replay, advice, document[PLAN_AGAIN])
        with outputs.file(report, overwrite=overwrite) as temporary:
            temporary.write_text(page, encoding="utf-8")
    if as_json:
        click.echo(file_format.json_text(document), nl=False)
    else:
        show(f"preflight of {trajectory_file}", result, advice, document[PLAN_AGAIN])
    if stopped := _stopped(result, replay, wants_advice=advise and advice is None):
        click.echo(f"goshawk: {stopped}", err=True)
        return 130
    return 0 if result.go else 1


def _stopped(result: preflight.Result, replay: preflight.Replay | None, *, wants_advice: bool) -> str:
    """What Ctrl-C ended, in words; empty if nothing was."""
    if result.cut_off:
        return f"stopped after {_stopped_after(result)}"
    if result.unexplained:
        return "all flights were flown; stopped before it was told what decides"
    if replay is None:
        return "stopped before the worst were flown again"
    return "stopped before the advice was found" if wants_advice else ""


def _stopped_after(result: preflight.Result) -> str:
    if result.rare is None:
        return f"{result.flights} of {result.wanted} flights"
    risk = result.rare.risk
    return f"level {risk.levels}: {risk.flights} flights, and the risk is at most {risk.upper:.1e}"


def _page(
    item: TrajectoryFile,
    area: mapping.Map,
    believed: vehicle.Vehicle,
    options: preflight.Options,
    radius_m: float,
    result: preflight.Result,
    replay: preflight.Replay,
    advice: preflight.Advice | None,
    again: dict[str, Any] | None,
) -> str:
    """The report's text."""
    from goshawk.commands.plan import preflight_page

    decides, remedy = _decides(result, again)
    told = preflight_page.Told(
        item, area, believed, options, radius_m, result, replay, place(result), decides, remedy,
        "" if advice is None else advice.sentence(),
    )  # fmt: skip
    return preflight_page.text(told)


def show(
    title: str,
    result: preflight.Result,
    advice: preflight.Advice | None = None,
    again: dict[str, Any] | None = None,
) -> None:
    """What, how sure, what next, in 24 lines."""
    counted = {"touches": result.touched, "leaves the map": result.left_map}  # of the first level alone
    facts: dict[str, object] = {
        "go": f"{'GO' if result.go else 'NO-GO'}: {result.reason()}",
        **({"lost": str(result.rare.risk)} if result.rare is not None else {}),
        **{words: str(chance) for words, chance in counted.items() if result.rare is None or chance.count},
        "to the end": f"{100.0 * result.finished:.1f} %",
    }
    others = sorted(result.endings().items(), key=lambda item: -item[1].count)
    facts |= {words: str(chance) for words, chance in others[:2]}
    if (where := place(result)) is not None:
        facts["narrowest"] = where
    facts["decides most"], remedy = _decides(result, again)
    if advice is not None:
        facts["advice"] = advice.sentence()
    facts["next"] = "fly it" if result.go else remedy
    if result.assumed:
        facts["assumed"] = "; ".join(result.assumed)
    console.show(title, facts, as_json=False)
    console.table("", ("", "median", "90 %", "99 %", "worst"), _spreads(result))


def place(result: preflight.Result) -> str | None:
    """Where it is narrow, in words; None without a map."""
    found = result.place()
    if found is None:
        return None
    x, y, z = found.point_world_m
    those = "of the touches" if found.touching else "of the nearest flights"
    where = f"segment {found.segment} at {found.time_s:.1f} s near ({x:.2f}, {y:.2f}, {z:.2f})"
    return f"{where}, {100.0 * found.share:.0f} % {those}"


def _decides(result: preflight.Result, again: dict[str, Any] | None) -> tuple[str, str]:
    """What decides most, and what to do about it: with more room where that helps."""
    said, remedy = _remedy(result)
    if again is None:
        return said, remedy
    room = f"plan with --margin {again['margin_m']:.2f}, as --preflown does from the file of --out"
    return said, f"{remedy}; or {room}, which is not tried yet: {_short(again['segments'])}"


def _short(segments: list[dict[str, Any]]) -> str:
    """Which segment needs most room: of those that flights touch in, else of those where they are given up."""
    worst = max(segments, key=lambda each: (each["touching"], each["margin_m"]))
    if worst["touching"]:
        return f"segment {worst['segment']} is {100.0 * worst['extra_m']:.0f} cm short"
    return f"flights are given up for their tracking error in segment {worst['segment']}"


def _remedy(result: preflight.Result) -> tuple[str, str]:
    if result.dominating is None:
        next_step = "run it to the end" if result.cut_off else "preflight with more --flights"
        return f"not known from {result.flights} flights", next_step
    factor, share = result.dominating
    without = "" if result.removed is None else f"; without it {result.removed.risk}"
    of = "what loses flights" if result.rare is not None and result.loss_shares else "the variance"
    return f"{factor}: {100.0 * share:.0f} % of {of}{without}", remedies.words(factor)


def _spreads(result: preflight.Result) -> list[tuple[object, ...]]:
    """Rows of quantiles, the bad side on the right."""
    d = result.as_dict()
    high, low = ("median", "q90", "q99", "most"), ("median", "q10", "q01", "least")
    rows = (
        ("tracking error, m", d["error_m"], high, 1.0),
        ("clearance beyond the vehicle, m", d["clearance_m"], low, 1.0),
        ("tilt, deg", d["tilt_rad"], high, math.degrees(1.0)),
        ("rotor reserve, %", d["rotor_reserve"], low, 100.0),
    )
    return [
        (name, *(np.round(unit * found[at], 3).item() for at in order)) for name, found, order, unit in rows if found
    ]


command = DefaultVerbGroup("preflight", own=one, commands=[preflight_batch.command])
