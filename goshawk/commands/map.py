"""`goshawk map`: from a folder of images to a map folder; its sub-verbs show and edit a map's distance field."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import click

import mapping
from flight import InputError, results
from goshawk import console, outputs
from goshawk.commands.map_edit import edit
from goshawk.commands.map_show_esdf import show_esdf
from mapping import map_folder, stages
from mapping.verdict import Standing

VOXEL_M, FARTHEST_M, THINNEST_M = (0.005, 10.0), (0.1, 1000.0), (0.001, 1.0)
"""Bounds of the options: finer voxels need too much memory."""


class MapVerbs(click.Group):
    """`goshawk map IMAGES` makes a map; if IMAGES is the name of a sub-verb, the sub-verb runs instead."""

    def make_context(
        self, info_name: str | None, args: list[str], parent: click.Context | None = None, **extra: Any
    ) -> click.Context:
        if args and args[0] in self.commands:
            return super().make_context(info_name, args, parent, **extra)
        return build.make_context(info_name, args, parent, **extra)


@click.command()
@click.argument("images", type=click.Path(path_type=Path))
@console.path_option("--camera", "camera", "Camera file of the rig, as `goshawk camera` writes it.", required=True)
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
    help="Leave space unknown where an obstacle this thick could be missing, metres [default: not asked].",
)
@click.option(
    "--from", "again_from", type=click.Choice(map_folder.STAGES), help="Make this stage and those after it again."
)
@click.option("--until", "until", type=click.Choice(map_folder.STAGES), help="Stop after this stage.")
@outputs.overwrite_option
@console.json_option
def build(
    images: Path,
    camera: Path,
    out: Path,
    references: Path | None,
    length: str | None,
    voxel_m: float,
    farthest_m: float,
    thinnest_m: float | None,
    again_from: str | None,
    until: str | None,
    overwrite: bool,
    as_json: bool,
) -> int:
    """Make a map from IMAGES: poses, mesh, distance field, localization map.

    \b
    goshawk map images --camera images/camera.toml --out map
    goshawk map walk --camera gopro.toml --out map --length 13.2
    goshawk map show-esdf --help     show the distance field of a map
    goshawk map edit --help          add obstacles and no-fly zones to it, clear errors

    IMAGES holds one folder per camera of the rig (or the images themselves, for one camera); the same file name
    means the same instant. The metric scale comes from --length, the distance between the cameras of a rig, or
    recorded positions. An earlier map in --out is replaced only with --overwrite and when the new one is complete: its
    edits are copied, and it is kept beside as OUT.old-1.

    An interrupted run leaves its finished stages in OUT.work; the same command goes on from there. So does one
    after --until.

    The camera file is put on trial: what it gets wrong is corrected where a camera file can state it (`goshawk camera
    diagnose MAP` shows all of it). The verdict is good, doubtful (`goshawk plan` then asks) or refused, with reasons.
    Exit code 1: refused.
    """
    for option, value, (low, high) in (
        ("--voxel", voxel_m, VOXEL_M),
        ("--farthest", farthest_m, FARTHEST_M),
        ("--thinnest", thinnest_m, THINNEST_M),
    ):
        if value is not None and not low <= value <= high:
            raise InputError(f"{option} is {value:g} m; it must be from {low:g} to {high:g} m")
    base = mapping.MapOptions()
    options = replace(
        base,
        dense=replace(base.dense, voxel_m=voxel_m, farthest_m=farthest_m, thinnest_m=thinnest_m or 0.0),
        length=length_from(length) if length is not None else None,
        references=references,
    )
    earlier = results.newest_kept(out)
    resumed = stages.finished(map_folder.work_folder(out), map_folder.STAGES)
    if resumed:
        click.echo(
            f"an earlier run ended after {resumed[-1]}; its stages are reused where the inputs are the same", err=True
        )
    with console.progress() as progress:
        rig = mapping.rig.load(camera)
        try:
            report = mapping.build_map(
                images,
                rig,
                out,
                options,
                overwrite=overwrite,
                again_from=again_from,
                until=until,
                progress=progress,
            )
        except stages.StoppedError as stopped:
            click.echo(f"goshawk: {stopped}; the same command without --until continues from there", err=True)
            return 0
    if (kept := results.newest_kept(out)) != earlier:
        outputs.report_kept(out, kept)
    facts = {
        "verdict": report.verdict,
        "images registered": f"{report.images_placed} of {report.images}",
        "reprojection error": f"{report.reprojection_error_px:.2f} px",
        "scale from": report.scale_source,
        "up from": report.up_source,
        "path": f"{report.path_length_m:.2f} m",
        "mesh": f"{report.mesh_vertices} vertices, {report.mesh_faces} faces",
        "space": f"{report.free_m3:.1f} m3 free, {report.occupied_m3:.1f} m3 occupied; the rest is unknown",
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
            f"{w['ratio']:.3f} ± {w['std']:.3f} of the {w['source']}" for w in report.scale_witnesses[1:]
        )
    if report.not_placed:
        facts["not placed"] = ", ".join(report.not_placed)
    console.show("map", facts, as_json=as_json, document=report.as_dict() | {"written": str(out)})
    if report.verdict != Standing.GOOD:
        click.echo(f"goshawk: the map is {report.verdict}: {'; '.join(report.reasons)}", err=True)
    return 1 if report.verdict == Standing.REFUSED else 0


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


command = MapVerbs("map", commands=[show_esdf, edit])
