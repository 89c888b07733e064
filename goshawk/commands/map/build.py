"""`goshawk map build` and `goshawk map check`: from a folder of images to a map folder."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

import mapping
from flight import InputError, results
from goshawk.terminal import console, outputs
from mapping import map_folder, stages
from mapping.camera.trial import SIGMAS95
from mapping.dense import confidence
from mapping.input import examination, trajectory
from mapping.input.source import Source
from mapping.sparse.mapper.overlap import UnplacedRun
from mapping.verdict import Standing
from mapping.workers import Pool

VOXEL_M, FARTHEST_M, THINNEST_M, CARRIER_M = (0.005, 10.0), (0.1, 1000.0), (0.001, 1.0), (0.01, 2.0)
"""Bounds of the options: finer voxels need too much memory."""


_RECORDED = (
    console.path_option("--camera", "camera", "Camera file, as `goshawk camera` writes it.", required=True),
    console.path_option(
        "--depth", "depth", "Folder of depth images of the images' names: 16-bit millimetres or float metres."
    ),
    click.option("--depth-unit", "depth_unit_m", type=float, help="Metres that a depth pixel's value of 1 means."),
    console.path_option("--masks", "masks", "Folder of masks, black where not to look: CAMERA.png, or one an image."),
    click.option(
        "--select", "select", is_flag=True, help="Of a dense sequence, use sharp images with enough parallax."
    ),
    click.option(
        "--parallax",
        "parallax_deg",
        type=float,
        help="Angle between selected images, degrees [default: 4; a video: same].",
    ),
    console.path_option(
        "--poses", "poses", "Recorded poses that do not drift (a tracker), z up: TUM's or EuRoC's format."
    ),
    console.path_option("--odometry", "odometry", "Recorded odometry, in any frame: TUM's or EuRoC's format."),
)
"""What was recorded: options of `build` and `check`."""


def _recorded(verb: Any) -> Any:
    for option in reversed(_RECORDED):
        verb = option(verb)
    return verb


@click.command()
@click.argument("images", type=click.Path(path_type=Path))
@_recorded
@console.path_option("--out", "out", "Map folder to write.", required=True)
@console.path_option("--references", "references", "Recorded positions or gravity [default: IMAGES/references.csv].")
@click.option(
    "--length", "length", metavar="[A,B,]METRES", help="Measured length: of the path, or between images A and B."
)
@click.option("--voxel", "voxel_m", default=0.05, show_default=True, help="Edge of a voxel, metres.")
@click.option("--farthest", "farthest_m", default=8.0, show_default=True, help="Leave out depths beyond this, metres.")
@click.option(
    "--thinnest",
    "thinnest_m",
    type=float,
    help="Obstacle thickness, metres: space is unknown where one could be missing [default: not asked].",
)
@click.option(
    "--carrier-radius",
    "carrier_radius_m",
    default=0.2,
    show_default=True,
    help="Free by evidence: what carried the cameras swept a ball of this radius about each of them, metres.",
)
@click.option(
    "--from-stage", "again_from", type=click.Choice(map_folder.STAGES), help="Make this stage and those after it again."
)
@click.option("--until-stage", "until", type=click.Choice(map_folder.STAGES), help="Stop after this stage.")
@click.option("--scheduler", metavar="ADDRESS", help="Dask scheduler whose workers do the work instead.")
@outputs.overwrite_option
@console.common_options
def build(
    images: Path,
    camera: Path,
    out: Path,
    depth: Path | None,
    depth_unit_m: float | None,
    masks: Path | None,
    select: bool,
    parallax_deg: float | None,
    references: Path | None,
    poses: Path | None,
    odometry: Path | None,
    length: str | None,
    voxel_m: float,
    farthest_m: float,
    thinnest_m: float | None,
    carrier_radius_m: float,
    again_from: str | None,
    until: str | None,
    scheduler: str | None,
    overwrite: bool,
    as_json: bool,
) -> int:
    """Make a map from IMAGES, a folder or a video: poses, mesh, distance field, localization map.

    \b
    goshawk map build images --camera images/camera.toml --out map
    goshawk map build walk.mp4 --camera gopro.toml --out map --length 13.2
    goshawk map build rgb --depth depth --camera kinect.toml --out map
    goshawk map build images --camera images/camera.toml --scheduler tcp://192.168.1.10:8786 --out map

    IMAGES holds one folder per camera of the rig (or the images themselves, for one camera); the same file name
    means the same instant. The metric scale comes from depth images, --length, the distance between the cameras of a
    rig, recorded positions or poses, or odometry; the verdict weighs all that are there. Of a video (one camera) sharp
    frames with enough parallax are used, as with --select. Images of a depth camera that show no features are placed
    by --poses or --odometry, where the depth agrees.

    An earlier map in --out is replaced only with --overwrite and when the new one is complete: its edits are copied,
    and it is kept beside as OUT.old-1.

    Space is free where three images saw through it, and where the vehicle or person that carried the cameras must have
    been: --carrier-radius states how far about each camera. Measured surfaces stay occupied.

    An interrupted run leaves its finished stages in OUT.work, and pairs matched or depth found so far; the same command
    goes on from there. So does one after --until-stage. Workers of a --scheduler match images and find depth. They are
    sent what they need, and need no files, but the same build and libraries; the map is the same.

    The camera file is put on trial: what it gets wrong is corrected where a camera file can state it (`goshawk camera
    diagnose MAP` shows all of it). The verdict is good, doubtful (`goshawk plan` then asks) or refused, with reasons.
    Exit code 1: refused.
    """
    _require_within_bounds(voxel_m, farthest_m, thinnest_m, carrier_radius_m)
    base = _options(depth, depth_unit_m, masks, select, parallax_deg, poses, odometry)
    options = replace(
        base,
        dense=replace(
            base.dense,
            voxel_m=voxel_m,
            farthest_m=farthest_m,
            thinnest_m=thinnest_m or 0.0,
            carrier_radius_m=carrier_radius_m,
        ),
        length=length_from(length) if length is not None else None,
        references=references,
    )
    rig = mapping.rig.load(camera)
    pool = None
    if scheduler is not None:
        from goshawk.commands.map.task_cluster import DaskWorkers  # with the planner, which shares the cluster

        pool = DaskWorkers(scheduler)
        pool.require_scheduler()
    report = _made(images, rig, out, options, overwrite=overwrite, again_from=again_from, until=until, pool=pool)
    if report is not None:
        return _show(report, out, as_json=as_json)
    if as_json:
        console.show("map", {"stopped_after": until}, as_json=True)
    return 0


@click.command()
@click.argument("images", type=click.Path(path_type=Path))
@_recorded
@console.common_options
def check(
    images: Path,
    camera: Path,
    depth: Path | None,
    depth_unit_m: float | None,
    masks: Path | None,
    select: bool,
    parallax_deg: float | None,
    poses: Path | None,
    odometry: Path | None,
    as_json: bool,
) -> int:
    """Examine IMAGES before any long work: blur, exposure, overlap, times, folders.

    \b
    goshawk map check images --camera images/camera.toml
    goshawk map check rgb --depth depth --camera kinect.toml

    Exit code 1: no map should be made of them, as images of two cameras are exchanged.
    """
    options = _options(depth, depth_unit_m, masks, select, parallax_deg, poses, odometry)
    return _examine(images, mapping.rig.load(camera), options, as_json=as_json)


def _options(
    depth: Path | None,
    depth_unit_m: float | None,
    masks: Path | None,
    select: bool,
    parallax_deg: float | None,
    poses: Path | None,
    odometry: Path | None,
) -> mapping.MapOptions:
    """The options of a map, as far as they say what was recorded."""
    if depth_unit_m is not None and depth is None:
        raise InputError("--depth-unit goes with --depth")
    return replace(
        mapping.MapOptions(),
        depths=mapping.DepthFolder(depth, depth_unit_m) if depth is not None else None,
        masks=masks,
        selection=_selection(parallax_deg) if select or parallax_deg is not None else None,
        poses=poses,
        odometry=odometry,
    )


def _require_within_bounds(
    voxel_m: float, farthest_m: float, thinnest_m: float | None, carrier_radius_m: float
) -> None:
    for option, value, (low, high) in (
        ("--voxel", voxel_m, VOXEL_M),
        ("--farthest", farthest_m, FARTHEST_M),
        ("--thinnest", thinnest_m, THINNEST_M),
        ("--carrier-radius", carrier_radius_m, CARRIER_M),
    ):
        if value is not None and not low <= value <= high:
            raise InputError(f"{option} is {value:g} m; it must be from {low:g} to {high:g} m")


def _made(
    images: Path,
    rig: mapping.Rig,
    out: Path,
    options: mapping.MapOptions,
    *,
    overwrite: bool,
    again_from: str | None,
    until: str | None,
    pool: Pool | None,
) -> mapping.MapReport | None:
    """Make the map, and say what is used again and what is kept; None if it was to stop after the stage `until`."""
    earlier = results.newest_kept(out)
    _report_resumed(out, again_from)
    with console.progress() as progress:
        try:
            report = mapping.build_map(
                images,
                rig,
                out,
                options,
                overwrite=overwrite,
                again_from=again_from,
                until=until,
                pool=pool,
                progress=progress,
            )
        except stages.StoppedError as stopped:
            console.note(f"{stopped}; the same command without --until-stage continues from there")
            return None
    if (kept := results.newest_kept(out)) != earlier:
        outputs.report_kept(out, kept)
    return report


def _show(report: mapping.MapReport, out: Path, *, as_json: bool) -> int:
    """The table or JSON of a new map, and the exit code."""
    console.show("map", _facts(report, out), as_json=as_json, document=report.as_dict() | {"written": str(out)})
    if report.verdict != Standing.GOOD and as_json:
        click.echo(f"goshawk: the map is {report.verdict}: {'; '.join(report.reasons)}", err=True)
    return 1 if report.verdict == Standing.REFUSED else 0


def _facts(report: mapping.MapReport, out: Path) -> dict[str, str]:
    """What the table says of a new map; what the reasons of its verdict name is not said again."""
    facts = {
        "verdict": report.verdict,
        "images registered": f"{report.images_placed} of {report.images}",
        "reprojection error": f"{report.reprojection_error_px:.2f} px",
        "scale from": report.scale_source
        + _deviation(report)
        + ("; nothing else checks it" if len(report.scale_witnesses) == 1 else ""),
        "up from": report.up_source,
        "path": f"{report.path_length_m:.2f} m",
        "mesh": f"{report.mesh_vertices} vertices, {report.mesh_faces} faces",
        "surface": confidence.describe(report.as_dict()),
        "space": f"{report.free_m3:.1f} m3 free, {report.occupied_m3:.1f} m3 occupied; the rest is unknown",
        "swept by the carrier": f"{report.carrier_radius_m:g} m about each camera is free"
        + (
            f", except {1e3 * report.swept_occupied_m3:.1f} litres where images show a surface"
            if report.swept_occupied_m3 > 0.0
            else ""
        ),
        "plain walls": f"{report.inferred_m3:.1f} m3 inferred, not measured; they stay unknown to the planner",
        "contradicted by images": f"{report.contradicted_m3:.2f} m3, not free though depth images show it as free",
        "written": str(out),
    }
    if report.resolved_m:
        facts["thinnest obstacle resolved"] = ", ".join(
            f"{1000 * metres:.0f} mm in {where}" for where, metres in report.resolved_m.items()
        )
    if report.reasons:
        facts["because"] = "; ".join(report.reasons)
    if report.corrections:
        facts["camera file"] = "; ".join(report.corrections)
    if len(report.scale_witnesses) > 1:
        facts["scale beside"] = "; ".join(
            f"{w['ratio']:.3f} ± {SIGMAS95 * w['std']:.3f} of the {w['source']}" for w in report.scale_witnesses[1:]
        )
    if report.position_residual_m is not None:
        facts["recorded positions"] = f"{report.position_residual_m:.3g} m from the map (median)"
    for check in report.motions:
        facts[check["source"]] = (
            f"{check['instants']} images, scale {check['scale']:.3f} ± {SIGMAS95 * check['scale_std']:.3f} of the map's"
            + (
                f", late by {check['late_s']:.3f} ± {SIGMAS95 * check['late_std_s']:.3f} s"
                if check["late_s"] is not None
                else ""
            )
        )
    if report.placed_by_motion:
        facts["placed by recorded motion"] = f"{len(report.placed_by_motion)}: {', '.join(report.placed_by_motion)}"
    if report.image_notes:
        facts["orientation"] = "; ".join(report.image_notes)
    if report.motion_notes:
        facts["recorded motion"] = "; ".join(report.motion_notes)
    if report.not_placed:
        facts["not placed"] = ", ".join(report.not_placed)
    runs = [str(UnplacedRun(**run)) for run in report.unplaced_runs]
    if others := [run for run in runs if not any(run in reason for reason in report.reasons)]:
        facts["runs not placed"] = "; ".join(others)
    return facts


def _deviation(report: mapping.MapReport) -> str:
    """The 95 % interval of the scale, and how far the farthest image may be from its place."""
    known = [std for std in report.position_std_m if std is not None]
    said = f", ± {100.0 * SIGMAS95 * report.scale_witnesses[0]['std']:.2g} % (95 %)"
    return said + (f"; images within {SIGMAS95 * max(known):.2g} m of their places" if known else "")


def _selection(parallax_deg: float | None) -> mapping.SelectionOptions:
    base = mapping.SelectionOptions()
    return base if parallax_deg is None else replace(base, parallax_rad=math.radians(parallax_deg))


def _report_resumed(out: Path, again_from: str | None) -> None:
    """Say which stages of an interrupted run are used again."""
    resumed = stages.finished(map_folder.work_folder(out), map_folder.STAGES)
    again = map_folder.STAGES[map_folder.STAGES.index(again_from) :] if again_from else ()
    kept = [name for name in resumed if name not in again]
    if kept:
        console.note(f"{', '.join(kept)} of an earlier run are used again where the inputs are the same")
    elif again_from and not resumed:
        console.note(f"no earlier run has left stages for {out}: all are made, not only from {again_from} on")


def _examine(images: Path, rig: mapping.Rig, options: mapping.MapOptions, *, as_json: bool) -> int:
    """What can be said of the images before any long work; 1 if no map should be made of them."""
    for recorded in options.motions.values():
        trajectory.read(recorded)
    with console.progress() as progress:
        given = Source(images, rig, options.masks, options.depths, options.selection)
        if given.is_video:
            raise InputError(
                f"a folder of images is examined; {images} is a video: choose its frames with goshawk map build "
                "--out MAP --until-stage frames, then check the folder MAP.work/frames"
            )
        read = given.read(progress=progress).beside(options.motions)
        found = mapping.examine(read, progress=progress)
    facts: dict[str, Any] = {
        "images": f"{read.count} of {len(read.instants)} instants, {len(rig)} camera{'s' * (len(rig) > 1)}",
        "problems": "; ".join(found.problems) or "none found",
    }
    facts |= {
        image.image: f"{', '.join(image.problems)} (sharpness {image.sharpness:.2f} of its neighbours', mean level "
        f"{image.mean_level:.0f}, {image.clipped_share:.0%} clipped, {_matches(image)})"
        for image in found.images
        if image.problems
    }
    console.show("check", facts, as_json=as_json, document=found.as_dict())
    return 1 if found.exchanged else 0


def _matches(image: examination.ImageFacts) -> str:
    return "first" if image.matches_before is None else f"{image.matches_before} features shared with the image before"


def length_from(text: str) -> mapping.Length:
    parts = text.split(",")
    try:
        metres = float(parts[-1])
    except ValueError:
        raise InputError(f"--length {text!r} does not end in a number of metres") from None
    if len(parts) == 1:
        return mapping.Length(metres)
    if len(parts) == 3:
        return mapping.Length(metres, (parts[0], parts[1]))
    raise InputError(f"--length {text!r} is neither METRES nor IMAGE_A,IMAGE_B,METRES")
