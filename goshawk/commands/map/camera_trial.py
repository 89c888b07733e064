"""`goshawk camera diagnose|compare|add|undo`: what a map's matches say of its camera file, and keeping it."""

from pathlib import Path
from typing import Any

import click
import numpy as np

import mapping
from flight import InputError, file_format, results, rotations
from goshawk.terminal import console, outputs
from mapping import map_folder
from mapping.camera.rig import Camera, Rig
from mapping.camera.trial import SIGMAS95


@click.command("diagnose")
@click.argument("map_folder", metavar="MAP", type=click.Path(path_type=Path))
@console.common_options
def diagnose(map_folder: Path, as_json: bool) -> None:
    """Show which errors of the camera file the matches of MAP show, exclude, or cannot tell.

    \b
    goshawk camera diagnose map
    goshawk camera add map --out camera.toml     keep what was found for the next map

    Every map puts the camera file on trial: each possible error is estimated from some of the map's points and judged
    by the others. What is present was corrected in the map itself, where a camera file can state it.
    """
    found = _findings(map_folder)
    rows = [
        (
            f"{f['camera']}: {f['error']}",
            f["verdict"],
            " ".join(f"{value:.3g}" for value in f["size"]),
            " ".join(f"{SIGMAS95 * value:.1g}" for value in f["std"]),
            f["units"][0] or "relative",
            f"{f['shift_px']:.2f}",
            f"{f['largest_shift_px']:.2f}",
        )
        for f in found
    ]
    if as_json:
        click.echo(file_format.json_text({"calibration": found}), nl=False)
        return
    heads = ("possible error", "verdict", "size", "± (95 %)", "unit", "moves image by, px", "at most, px")
    console.table("camera file on trial", heads, rows)


def _findings(folder: Path) -> list[dict[str, Any]]:
    mapping.open_map(folder)
    body = map_folder.read_report(folder)
    if not body:
        raise InputError(f"{folder} has no report.json, so nothing is known of its camera file; make the map again")
    if "calibration" not in body:
        raise InputError(f"{folder} was made by a version that did not try the camera file; make the map again")
    return body["calibration"]


@click.command("add")
@click.argument("map_folder", metavar="MAP", type=click.Path(path_type=Path))
@console.path_option("--out", "out", "Camera file to write.", required=True)
@outputs.overwrite_option
@console.common_options
def add(map_folder: Path, out: Path, overwrite: bool, as_json: bool) -> None:
    """Write the calibration that MAP was made with, corrections included, as a camera file.

    \b
    goshawk camera add map --out camera.toml --overwrite
    goshawk camera undo camera.toml              return to the file before
    """
    outputs.check(out, overwrite=overwrite)
    area = mapping.open_map(map_folder)
    area.require_images()
    rig = area.rig
    with outputs.file(out, overwrite=overwrite) as temporary:
        mapping.rig.save(temporary, rig)
    facts = {"cameras": ", ".join(camera.name for camera in rig), "written": str(out)}
    console.show("camera", facts, as_json=as_json)


@click.command("undo")
@click.argument("camera_file", metavar="CAMERA", type=click.Path(path_type=Path))
@console.common_options
def undo(camera_file: Path, as_json: bool) -> None:
    """Return to the camera file that the last --overwrite replaced; the present one is kept beside it.

    \b
    goshawk camera undo camera.toml
    """
    earlier = results.newest_kept(camera_file)
    if earlier is None:
        raise InputError(f"{camera_file} replaced no earlier file: there is no {camera_file.name}.old-1 beside it")
    rig = mapping.rig.load(earlier)
    with outputs.file(camera_file, overwrite=True) as temporary:
        mapping.rig.save(temporary, rig)
    console.show("camera", {"restored": earlier.name, "written": str(camera_file)}, as_json=as_json)


@click.command("compare")
@click.argument("first", type=click.Path(path_type=Path))
@click.argument("second", type=click.Path(path_type=Path))
@console.common_options
def compare(first: Path, second: Path, as_json: bool) -> None:
    """Show how far two camera files differ: their lenses in pixels, their poses in degrees and millimetres.

    \b
    goshawk camera compare camera.toml camera.toml.old-1
    """
    old, new = mapping.rig.load(first), mapping.rig.load(second)
    for camera in old:
        if camera.name not in (names := [other.name for other in new]):
            raise InputError(
                f"{first} has a camera {camera.name!r} and {second} does not (it has {', '.join(map(repr, names))}); "
                "cameras are compared by their names: name them alike"
            )
    rows = [_difference(old, camera, new) for camera in old]
    if as_json:
        keys = ("camera", "lens_rms_px", "lens_largest_px", "turned_deg", "moved_mm")
        click.echo(file_format.json_text({"cameras": [dict(zip(keys, row, strict=True)) for row in rows]}), nl=False)
        return
    heads = ("camera", "lens, RMS px", "lens, largest px", "turned, deg", "moved, mm")
    console.table(f"{second} against {first}", heads, rows)


def _difference(old: Rig, camera: Camera, new: Rig) -> tuple[str, float, float, float, float]:
    other = new[camera.name]
    if (other.width, other.height) != (camera.width, camera.height):
        raise InputError(
            f"camera {camera.name!r} has {camera.width}x{camera.height} pixels in one file and "
            f"{other.width}x{other.height} in the other; only calibrations of one image size can be compared"
        )
    rays = camera.unproject(camera.pixel_centres()[::8, ::8])
    off_px = np.linalg.norm(other.project(rays) - camera.project(rays), axis=-1)
    both = off_px[np.isfinite(off_px)]
    if not both.size:
        raise InputError(f"camera {camera.name!r}: no direction is seen by both lenses; they cannot be compared")
    turn = (_pose(old, camera)[:3, :3].T @ _pose(new, other)[:3, :3]).copy()
    moved_m = _pose(new, other)[:3, 3] - _pose(old, camera)[:3, 3]
    turned_rad = float(np.linalg.norm(rotations.log(rotations.from_matrix(turn))))
    return (
        camera.name,
        float(np.sqrt((both**2).mean())),
        float(both.max()),
        float(np.degrees(turned_rad)),
        1000.0 * float(np.linalg.norm(moved_m)),
    )


def _pose(rig: Rig, camera: Camera) -> np.ndarray:
    """The camera's pose in the frame of the first camera: where the body's origin lies does not matter."""
    return np.linalg.solve(rig.cameras[0].T_body_camera, camera.T_body_camera)
