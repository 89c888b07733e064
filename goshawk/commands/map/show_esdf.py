"""`goshawk map show-esdf`: figures and statistics of a map's distance field."""

from pathlib import Path
from typing import Any

import click
import numpy as np

import esdf
from esdf import FREE, OCCUPIED, UNKNOWN, Field, pictures
from flight import InputError
from goshawk.terminal import console, outputs
from mapping.dense import occupancy

CLEARANCES_M = (0.3, 0.5, 1.0)


@click.command("show-esdf")
@click.argument("map_folder", metavar="MAP", type=click.Path(path_type=Path))
@console.path_option("--out", "out", "Folder of images to write; without it, statistics alone.")
@click.option("--slice", "slices", multiple=True, metavar="AXIS=METRES", help="A slice, as z=1.2; may be repeated.")
@click.option(
    "--plane", "planes", nargs=3, multiple=True, metavar="A B C",
    help="A slice in any direction, through three points x,y,z; A to B is right in the image, C is above.",
)  # fmt: skip
@click.option(
    "--iso", "levels_m", multiple=True, type=float, metavar="METRES",
    help="The iso-surface at this distance, as a mesh (PLY); 0 is the obstacles' surface.",
)  # fmt: skip
@outputs.overwrite_option
@console.common_options
def show_esdf(
    map_folder: Path,
    out: Path | None,
    slices: tuple[str, ...],
    planes: tuple[tuple[str, str, str], ...],
    levels_m: tuple[float, ...],
    overwrite: bool,
    as_json: bool,
) -> None:
    """Show the distance field (ESDF) of MAP: free volume by clearance, slices, iso-surfaces, a histogram.

    \b
    goshawk map show-esdf map
    goshawk map show-esdf map --out pictures
    goshawk map show-esdf map --out pictures --slice z=1.2 --slice x=0 --iso 0.3
    goshawk map show-esdf map --out pictures --plane 0,0,0 4,3,0 0,0,2

    Edits are applied. Without --slice, --plane and --iso the images are three slices through the point of largest
    clearance, the obstacles' surface and the histogram. MAP may also be a folder that `esdf.save` wrote.
    """
    if out is None and (slices or planes or levels_m):
        raise InputError("--slice, --plane and --iso write images: give their folder with --out")
    outputs.check(overwrite=overwrite, folders=[out])
    field = esdf.load(field_folder(map_folder))
    stated = occupancy.load(map_folder / occupancy.FILE, field.grid.shape)
    document = figures(field) | ({} if stated is None else occupancy.figures(stated, field))
    if out is not None:
        with outputs.pictures(out, overwrite=overwrite) as drawn:
            files = _drawn(field, drawn.temporary, document, slices, planes, levels_m)
            document["written"] = [str(drawn.placed(Path(file))) for file in files]
    console.show(f"distance field of {map_folder}", _facts(document), as_json=as_json, document=document)


def _drawn(
    field: Field,
    out: Path,
    document: dict[str, Any],
    slices: tuple[str, ...],
    planes: tuple[tuple[str, str, str], ...],
    levels_m: tuple[float, ...],
) -> list[str]:
    """Draw the requested images, or the default ones; returns the files."""
    named = bool(slices or planes or levels_m)
    at = document["roomiest_point_m"] or (0.5 * (field.grid.low_world_m + field.grid.high_world_m)).tolist()
    chosen = slices if named else tuple(f"{axis}={value:.3f}" for axis, value in zip("xyz", at, strict=True))
    written = [
        *_slices(field, out, chosen),
        *[_plane(field, out, number, points) for number, points in enumerate(planes, start=1)],
        *[_surface(field, out, level_m) for level_m in (levels_m if named else (0.0,))],
    ]
    if not named and document["free_m3"] + document["occupied_m3"] > 0.0:
        written.append(_histogram(field, out))
    return written


def field_folder(map_folder: Path) -> Path:
    """The folder of a map's distance field; for the folder of a bare field, the folder itself.

    Raises:
        InputError: there is none.
    """
    for folder in (map_folder / "esdf", map_folder):
        if (folder / "esdf.toml").exists():
            return folder
    if any((folder / "blocks.toml").exists() for folder in (map_folder / "esdf", map_folder)):
        raise InputError(f"{map_folder} is a map in blocks, too large for this; see BlockField.crop and edit_blocks")
    raise InputError(f"{map_folder} holds no distance field: it has neither esdf/esdf.toml nor esdf.toml")


def figures(field: Field) -> dict[str, Any]:
    """Statistics of a field; volumes in cubic metres."""
    voxel_m3 = float(np.prod(field.grid.voxel_m))
    counts = np.bincount(field.state.ravel(), minlength=3) * voxel_m3
    free_m = field.values_m[(field.state == FREE) & np.isfinite(field.values_m)]
    roomiest = None
    if free_m.size:
        inside = np.where(field.state == FREE, np.nan_to_num(field.values_m, nan=-np.inf), -np.inf)
        # If several voxels have the capped distance, the one nearest to their mean is used.
        best = np.argwhere(inside == inside.max())
        middle = best[np.argmin(np.linalg.norm(best - best.mean(axis=0), axis=1))]
        roomiest = field.grid.centre(middle[None])[0].round(3).tolist()
    return {
        **field.grid.as_dict(),
        "cap_m": field.cap_m,
        "unknown": field.unknown,
        "hash": field.hash,
        "free_m3": float(counts[FREE]),
        "occupied_m3": float(counts[OCCUPIED]),
        "unknown_m3": float(counts[UNKNOWN]),
        "roomiest_m": float(free_m.max()) if free_m.size else None,
        "roomiest_point_m": roomiest,
        "free_m3_at_least": {f"{c:g}": float((free_m >= c).sum()) * voxel_m3 for c in CLEARANCES_M},
    }


def _facts(document: dict[str, Any]) -> dict[str, object]:
    size = [round(n * v, 2) for n, v in zip(document["shape"], document["voxel_m"], strict=True)]
    low = [round(x, 2) for x in document["origin_world_m"]]
    facts: dict[str, object] = {
        "voxels": f"{' x '.join(map(str, document['shape']))} of {' x '.join(f'{v:g}' for v in document['voxel_m'])} m",
        "reaches": f"from {low}, {' x '.join(map(str, size))} m",
        "exact up to": f"{document['cap_m']:g} m",
        "unknown counts as": "an obstacle" if document["unknown"] == "obstacle" else "NaN",
        "free, occupied, unknown": f"{document['free_m3']:.1f}, {document['occupied_m3']:.1f}, "
        f"{document['unknown_m3']:.1f} m3",
    }
    if said := occupancy.describe(document):
        facts["contradicted by images"] = said
    if document["roomiest_point_m"] is not None:
        facts["largest clearance"] = (
            f"{document['roomiest_m']:.2f} m to the nearest surface, at {document['roomiest_point_m']}"
        )
        for clearance, volume in document["free_m3_at_least"].items():
            facts[f"free by {clearance} m and more"] = f"{volume:.1f} m3"
    for path in document.get("written", []):
        facts[Path(path).name] = path
    return facts


def _slices(field: Field, out: Path, chosen: tuple[str, ...]) -> list[str]:
    from goshawk import plot
    from sysid.report import drawing

    written: list[str] = []
    for text in chosen:
        axis, _, at = text.partition("=")
        if axis not in ("x", "y", "z"):
            raise InputError(f"--slice {text!r} does not begin with x=, y= or z=")
        at_m = console.numbers("--slice", at, 1)[0]
        path = out / f"slice_{axis}_{at_m:g}.png"
        written.append(str(drawing.written(plot.map_slice(field, at_m, axis), path)))
    return written


def _plane(field: Field, out: Path, number: int, points: tuple[str, str, str]) -> str:
    from goshawk import plot
    from sysid.report import drawing

    a, b, c = (console.numbers("--plane", text, 3) for text in points)
    figure = plot.slices({f"through {', '.join(points)}": pictures.plane_through(field, a, b, c)})
    return str(drawing.written(figure, out / f"plane_{number}.png"))


def _histogram(field: Field, out: Path) -> str:
    from goshawk import plot
    from sysid.report import drawing

    return str(drawing.written(plot.distances(field), out / "histogram.png"))


def _surface(field: Field, out: Path, level_m: float) -> str:
    from mapping.dense import mesh_file

    if not np.isfinite(level_m):
        raise InputError(f"--iso {level_m:g} is not a finite number of metres")
    vertices, faces = pictures.iso_surface(field, level_m)
    if len(faces) == 0:
        raise InputError(f"no point of this map is {level_m:g} m from the nearest surface; choose another level")
    path = out / f"surface_{level_m:g}m.ply"
    mesh_file.save(path, vertices, faces, np.full((len(vertices), 3), 180, np.uint8))
    return str(path)
