"""`goshawk camera`: a camera file from images, Kalibr, Basalt or COLMAP, and to COLMAP.

Its trial in a map is in `camera_trial`."""

from pathlib import Path

import click
import numpy as np

import mapping
from flight import results
from goshawk.commands.map import camera_trial
from goshawk.terminal import console, outputs
from goshawk.terminal.verbs import VerbGroup
from mapping.camera.rig import Rig

SUMMARY = "Make a camera file from images, or from Kalibr's or COLMAP's."


out_option = console.path_option("--out", "out", "Camera file to write.", required=True)
WAYS_TO_SCALE = (
    "give goshawk map build the path's length (--length 13.2) or between two images (--length A.jpg,B.jpg,2.5), or "
    "positions of the vehicle (references.csv: odometry, a tracker, GPS)"
)


@click.group(cls=VerbGroup)
def command() -> None:
    """Make the camera file that `goshawk map build` reads.

    \b
    goshawk camera new photos --out camera.toml
    goshawk camera import camchain.yaml --out camera.toml
    goshawk camera import cameras.txt --rig rigs.txt --out camera.toml
    goshawk camera diagnose map                  what the map's matches say of its camera file
    """


@command.command("new")
@click.argument("images", type=click.Path(path_type=Path))
@out_option
@click.option("--focal-px", "focal_px", type=float, help="Focal length in pixels, if known.")
@click.option("--quick", is_flag=True, help="No self-calibration: EXIF or a default, with its error, at once.")
@outputs.overwrite_option
@console.common_options
def new(images: Path, out: Path, focal_px: float | None, quick: bool, overwrite: bool, as_json: bool) -> None:
    """Guess the lens of the camera that took IMAGES: from EXIF, then by self-calibration.

    \b
    goshawk camera new photos --out camera.toml
    goshawk camera new photos --out camera.toml --quick
    goshawk map build photos --camera camera.toml --length 13.2 --out map

    IMAGES is a folder of images that one camera took from several places, neighbours overlapping. The result is a
    first guess: mapping refines it.
    """
    from mapping.sparse.calibration import lens_guess

    outputs.check(out, overwrite=overwrite)
    with console.progress() as report:
        found = lens_guess.from_pictures(images, focal_px=focal_px, calibrate=not quick, progress=report)
    camera = found.camera
    with outputs.file(out, overwrite=overwrite) as temporary:
        mapping.rig.save(temporary, Rig((camera,), refine_intrinsics=True))
        notes = [
            f"Lens of the images in {images.name}: {found.source}.",
            f"Focal length good to {100 * found.focal_std:.1f} %.",
        ]
        temporary.write_text("".join(f"# {note}\n" for note in notes) + temporary.read_text())
    seen_deg = np.degrees(_field_of_view_rad(Rig((camera,))))
    facts = {
        "image": f"{camera.width} x {camera.height} pixels",
        "lens": camera.model,
        "focal length": f"{camera.focal_px[0]:.1f} px ± {100 * found.focal_std:.1f} %",
        "field of view": f"{seen_deg:.0f} degrees across",
        "how": found.source,
        "scale": f"not known: {WAYS_TO_SCALE}",
        "written": str(out),
    }
    document = {"written": str(out), "params": camera.params.tolist(), "model": camera.model, "source": found.source}
    document |= {"focal_std": found.focal_std, "calibrated": found.is_calibrated, "scale": None}
    console.show("camera", facts, as_json=as_json, document=document)
    if not found.is_calibrated and not as_json:
        reason = "--quick was given" if quick else "the images could not be placed with any of the start lenses"
        click.echo(f"note: the lens is a default ({reason}); a map made with it may fail or be distorted")


@command.command("import")
@click.argument("calibration", type=click.Path(path_type=Path))
@out_option
@console.path_option("--rig", "rigs", "COLMAP's rigs.txt: poses of several cameras on the vehicle.")
@outputs.overwrite_option
@console.common_options
def bring(calibration: Path, out: Path, rigs: Path | None, overwrite: bool, as_json: bool) -> None:
    """Turn a calibration of Kalibr, EuRoC, ROS, OpenCV, Basalt or COLMAP into a camera file.

    \b
    goshawk camera import camchain.yaml --out camera.toml
    goshawk camera import sensor.yaml --out camera.toml           # or of camera_info, OpenCV, VINS
    goshawk camera import calibration.json --out camera.toml
    goshawk camera import sparse/0/cameras.txt --out camera.toml
    goshawk camera import cameras.txt --rig rigs.txt --out camera.toml

    The first camera is taken to look along body x; edit T_body_camera if it does not. Images of camera NAME are read
    from the sub-folder NAME.
    """
    from mapping.camera import rig_import, yaml_import

    outputs.check(out, overwrite=overwrite)
    notes: tuple[str, ...] = ()
    kind = calibration.suffix.lower()
    if rigs is not None and kind in (".yaml", ".yml", ".json"):
        raise click.UsageError(f"--rig goes with COLMAP's cameras.txt; a {kind} file places its cameras itself")
    if kind in (".yaml", ".yml"):
        rig, notes = yaml_import.read(calibration)
    elif kind == ".json":
        rig = rig_import.read_basalt(calibration)
    else:
        rig = rig_import.read_colmap(calibration, rigs)
    with outputs.file(out, overwrite=overwrite) as temporary:
        mapping.rig.save(temporary, rig)
    scale = f"from the baseline of {100 * rig.baseline_m:.1f} cm" if len(rig) > 1 else f"not known: {WAYS_TO_SCALE}"
    for note in notes:
        click.echo(f"note: {note}", err=True)
    document = {
        "notes": list(notes),
        "written": str(out),
        "cameras": [c.name for c in rig],
        "baseline_m": rig.baseline_m,
    }
    facts = {"cameras": ", ".join(f"{c.name} ({c.model}, images in {c.folder})" for c in rig), "scale": scale}
    console.show("camera", facts | {"written": str(out)}, as_json=as_json, document=document)


@command.command("export")
@click.argument("source", metavar="CAMERA|MAP", type=click.Path(path_type=Path))
@console.path_option("--out", "out", "Folder to write.", required=True)
@outputs.overwrite_option
@console.common_options
def export(source: Path, out: Path, overwrite: bool, as_json: bool) -> None:
    """Write a camera file for COLMAP (cameras.txt, rigs.txt); of a map also its poses as TUM does (poses.tum).

    \b
    goshawk camera export camera.toml --out colmap
    goshawk camera export map --out colmap
    """
    from mapping.camera import rig_export

    area = mapping.open_map(source) if source.is_dir() else None
    if area is not None:
        area.require_images()
    rig = area.rig if area is not None else mapping.rig.load(source)
    results.require_free_folder(out, overwrite=overwrite, ours=_is_export)
    with results.new_folder(out, overwrite=overwrite, ours=_is_export) as placing:
        rig_export.write_colmap(placing.temporary, rig)
        if area is not None and np.isfinite(area.time_s).all():
            rig_export.write_tum(placing.temporary / "poses.tum", area.time_s, area.T_world_body)
        written = sorted(file.name for file in placing.temporary.iterdir())
    if placing.kept is not None:
        outputs.report_kept(out, placing.kept)
    console.show("camera", {"files": ", ".join(written), "written": str(out)}, as_json=as_json)


def _is_export(folder: Path) -> bool:
    return (folder / "cameras.txt").is_file() and (folder / "rigs.txt").is_file()


for verb in (camera_trial.diagnose, camera_trial.compare, camera_trial.add, camera_trial.undo):
    command.add_command(verb)


def _field_of_view_rad(rig: Rig) -> float:
    """Angle between the rays through the middles of the left and the right edge."""
    camera = rig.cameras[0]
    middle = camera.height / 2.0
    left, right = camera.unproject([[0.5, middle], [camera.width - 0.5, middle]])
    if not np.isfinite([left, right]).all():
        return 2.0 * camera.half_field_rad
    return float(np.arccos(np.clip(left @ right, -1.0, 1.0)))
