"""`goshawk localize`: relocalize images in an earlier map."""

from pathlib import Path

import click

import mapping
from goshawk import console, outputs


@click.command()
@click.argument("images", type=click.Path(path_type=Path))
@console.map_option
@console.path_option("--camera", "camera", "The rig that took IMAGES [default: that of the map].")
@console.path_option("--out", "out", "Poses to write, as CSV; `goshawk plan --path` reads them.", required=True)
@outputs.overwrite_option
@console.json_option
def command(images: Path, map_folder: Path, camera: Path | None, out: Path, overwrite: bool, as_json: bool) -> int:
    """Find the poses of IMAGES in a map: a recorded walk becomes a path to plan along.

    \b
    goshawk localize walk --map map --out walk.csv
    goshawk plan --path walk.csv --map map --vehicle vehicle.toml --out walk.json

    Exit code 1: no image was found. Images that were not found are named and left out.
    """
    outputs.check(out, overwrite=overwrite)
    area = mapping.open_map(map_folder)
    rig = mapping.rig.load(camera) if camera is not None else area.rig
    with console.progress() as progress:
        folder = mapping.read_folder(images, rig, progress=progress)
        result = mapping.localize(area, folder, progress=progress)
    if result.found.any():
        with outputs.file(out, overwrite=overwrite) as temporary:
            mapping.write_poses(temporary, result.instants, folder.time_s, result.T_world_body)
    facts = {
        "found": f"{int(result.found.sum())} of {len(result.instants)}",
        "not found": ", ".join(result.failed) or "none",
        "written": str(out) if result.found.any() else "nothing",
    }
    document = {
        "found": int(result.found.sum()),
        "images": len(result.instants),
        "failed": list(result.failed),
        "inliers": result.inliers.tolist(),
        "written": str(out) if result.found.any() else None,
    }
    console.show("localization", facts, as_json=as_json, document=document)
    if not result.found.any():
        click.echo(f"goshawk: none of {images} was found in {map_folder}; nothing was written", err=True)
        return 1
    return 0
