"""`goshawk localize`: relocalize images in an earlier map."""

import tempfile
from dataclasses import asdict
from pathlib import Path
from typing import Any

import click
import numpy as np

import mapping
from flight import InputError
from goshawk.terminal import console, outputs
from mapping import Changes, Localization

SUMMARY = "Find the poses of other images in a map (relocalization)."
_DEFAULT = mapping.LocalizationOptions()
_NAMED = 5
"""Images and regions that the table names one by one; JSON has all."""


@click.command()
@click.argument("images", type=click.Path(path_type=Path))
@console.map_option
@console.path_option("--camera", "camera", "Camera file: the rig that took IMAGES [default: that of the map].")
@click.option(
    "--fastest",
    "fastest_m_s",
    default=_DEFAULT.fastest_m_s,
    show_default=True,
    help="A pose that is not reached from its neighbours in time at this speed is refused, m/s.",
)
@console.path_option("--out", "out", "Poses (CSV) to write; `goshawk plan --path` reads them.", required=True)
@outputs.overwrite_option
@console.common_options
def command(
    images: Path,
    map_folder: Path,
    camera: Path | None,
    fastest_m_s: float,
    out: Path,
    overwrite: bool,
    as_json: bool,
) -> int:
    """Find the poses of IMAGES in a map: a recorded walk becomes a path to plan along.

    \b
    goshawk localize walk --map map --out walk.csv
    goshawk localize walk --map map --out walk.csv --fastest 3
    goshawk plan --path walk.csv --map map --vehicle vehicle.toml --out walk.json

    Each pose has a standard deviation, in the map (its own errors come on top). With IMAGES/times.csv neighbours in
    time count: they refuse a pose that cannot be reached, and say where to look again for an image that was not found.
    Regions of the map that look different in IMAGES are listed: what was moved, hidden or lit differently.

    Exit code 1: no image was found. Images that were not found are named and left out.
    """
    if not 0.0 < fastest_m_s < float("inf"):
        raise InputError(f"--fastest is {fastest_m_s:g} m/s; it must be above 0")
    outputs.check(out, overwrite=overwrite)
    area = mapping.open_map(map_folder)
    area.require_images()
    rig = mapping.rig.load(camera) if camera is not None else area.rig
    with console.progress() as progress, tempfile.TemporaryDirectory(prefix="goshawk-") as name:
        folder = mapping.read_folder(images, rig, minimum=1, progress=progress)
        options = mapping.LocalizationOptions(fastest_m_s=fastest_m_s)
        result = mapping.localize(area, folder, options=options, keep=Path(name), progress=progress)
        changes = mapping.find_changes(area, folder, Path(name), result, progress=progress)
    if result.found.any():
        with outputs.file(out, overwrite=overwrite) as temporary:
            mapping.write_poses(temporary, result.instants, folder.time_s, result.T_world_body, result.covariance)
    written = str(out) if result.found.any() else None
    document = _document(result, changes) | {"written": written}
    console.show("localization", _facts(result, changes, written), as_json=as_json, document=document)
    if not result.found.any():
        click.echo(f"goshawk: none of {images} was found in {map_folder}; nothing was written", err=True)
        return 1
    return 0


def _document(result: Localization, changes: Changes) -> dict[str, Any]:
    covariance = [None if np.isnan(each).any() else each.tolist() for each in result.covariance]
    return {
        "found": int(result.found.sum()),
        "images": len(result.instants),
        "failed": list(result.failed),
        "reasons": result.refused,
        "inliers": result.inliers.tolist(),
        "covariance": covariance,
        "changed": [asdict(region) for region in changes.regions],
        "usual_share": None if np.isnan(changes.usual_share) else changes.usual_share,
    }


def _facts(result: Localization, changes: Changes, written: str | None) -> dict[str, str]:
    facts = {
        "found": f"{int(result.found.sum())} of {len(result.instants)}",
        "not found": "; ".join(f"{name}: {result.refused[name]}" for name in result.failed[:_NAMED]) or "none",
    }
    if len(result.failed) > _NAMED:
        facts["not found"] += f"; and {', '.join(result.failed[_NAMED:])}"
    if result.found.any():
        facts["standard deviation"] = _certainty(result.covariance[result.found])
        facts["changed regions"] = _changed(changes)
    return facts | {"written": written or "nothing"}


def _certainty(covariance: np.ndarray) -> str:
    """Medians over the images that were found, (n, 6, 6)."""
    position_m, turn_rad = (
        float(np.median(np.sqrt(np.trace(part, axis1=1, axis2=2))))
        for part in (covariance[:, :3, :3], covariance[:, 3:, 3:])
    )
    return f"{1000.0 * position_m:.1f} mm, {np.degrees(turn_rad):.3f} deg in the map, median of the images"


def _changed(changes: Changes) -> str:
    if not changes.can_tell:
        return "not known: too little of the map is seen again"
    listed = [
        f"({', '.join(f'{value:.1f}' for value in region.low_world_m)}) to "
        f"({', '.join(f'{value:.1f}' for value in region.high_world_m)}) m, where {region.found / region.looks:.0%} is "
        f"found again, not {changes.usual_share:.0%}"
        for region in changes.regions[:_NAMED]
    ]
    more = len(changes.regions) - len(listed)
    return "; ".join(listed) + (f"; and {more} more" if more else "") or "none"
