"""`goshawk map crop`, `origin`, `align`, `merge`: new maps of old ones, which stay as they are."""

import csv
import dataclasses
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click
import numpy as np

import esdf
from flight import FloatArray, FormatError, InputError, errors, frames, results, rotations
from goshawk.commands.map.edit import shape_options, solid_from
from goshawk.terminal import console, outputs

LARGEST_SCALE_ERROR = 0.02
"""How much larger or smaller than the measured points a map may be: then it is not its place that is wrong."""
LARGEST_MISFIT = 0.05
"""RMS residual of the points over their RMS distance from their centre: exchanged points leave more."""
_POINT_COLUMNS = ("map_x_m", "map_y_m", "map_z_m", "x_m", "y_m", "z_m")

_out = console.path_option("--out", "out", "Map folder to write.", required=True)


def _result(command: Callable[..., Any]) -> Callable[..., Any]:
    return _out(outputs.overwrite_option(console.common_options(command)))


@click.command()
@click.argument("map_folder", metavar="MAP", type=click.Path(path_type=Path))
@shape_options
@_result
def crop(map_folder: Path, out: Path, overwrite: bool, as_json: bool, **shapes: str | None) -> None:
    """Make a map of the part of MAP inside a shape: all outside becomes unknown.

    \b
    goshawk map crop map --box -2,-2,0,4,3,2.5 --out kitchen
    goshawk map crop map --prism 0,2.5,3,0,5,0,5,4 --out corner

    The pilot's edits go along. Plans of MAP do not hold in the new map, which has a hash of its own.
    """
    from mapping import map_parts

    results.require_free_folder(out, overwrite=overwrite, ours=_is_map)
    kept = solid_from(shapes)
    old = map_parts.read(map_folder)
    shape = next(f"--{name.replace('_', '-')} {text}" for name, text in shapes.items() if text is not None)
    new = map_parts.cropped(old, kept, f"cropped {_named(old)} with {shape}")
    facts = {"poses kept": f"{len(new.images)} of {len(old.images)}"}
    _write(out, new, facts, {"poses": len(new.images), "poses_of_old": len(old.images)}, overwrite, as_json)


@click.command()
@click.argument("map_folder", metavar="MAP", type=click.Path(path_type=Path))
@click.option("--place", "place", metavar="X,Y,Z", required=True, help="Where the new origin is in MAP, metres.")
@click.option("--turn", "turn_deg", type=float, default=0.0, help="Heading of the new x axis in MAP, degrees.")
@_result
def origin(map_folder: Path, place: str, turn_deg: float, out: Path, overwrite: bool, as_json: bool) -> None:
    """Set the origin, and the heading of the x axis, of a map.

    \b
    goshawk map origin map --place 1.20,0.35,0 --out map-from-pad
    goshawk map origin map --place 0,0,0 --turn 90 --out turned

    Without --turn the voxels stay exactly as they are. A turned map's surfaces grow by up to a voxel, so turn once.
    """
    if not abs(turn_deg) <= 360.0:
        raise InputError(f"--turn is {turn_deg:g} degrees; it must be from -360 to 360")
    x, y, z = console.numbers("--place", place, 3)
    T_old_new = frames.transform(rotations.from_yaw(math.radians(turn_deg)), [x, y, z])
    sentence = f"origin set to {x:g}, {y:g}, {z:g} m, heading {turn_deg:g} degrees, of"
    _move(map_folder, frames.invert(T_old_new), sentence, {}, {}, out, overwrite, as_json)


@click.command()
@click.argument("map_folder", metavar="MAP", type=click.Path(path_type=Path))
@console.path_option("--points", "points", f"CSV of points in MAP and measured: {','.join(_POINT_COLUMNS)}.")
@click.option("--up", "up", metavar="X,Y,Z", help="Direction that is up: in MAP, as a plumb line shows.")
@_result
def align(map_folder: Path, points: Path | None, up: str | None, out: Path, overwrite: bool, as_json: bool) -> None:
    """Move and turn a map so that its points lie where they were measured, or its z axis points up.

    \b
    goshawk map align map --points surveyed.csv --out site
    goshawk map align map --up 0.01,-0.02,1 --out level

    At least three points that are not on one line. The scale is not changed: a map that is 2 % larger or smaller than
    the measured points is refused. Upright edits (cylinders, prisms) cannot lean: remove them before.
    """
    if (points is None) == (up is None):
        raise click.UsageError("Give either --points or --up.")
    if points is not None:
        T, residual_m, scale = fit_points(*read_points(points))
        facts = {"residual": f"{1000.0 * residual_m:.0f} mm RMS", "scale": f"{scale:.4f} of the measured one"}
        document = {"residual_m": residual_m, "scale_of_measured": scale}
        sentence = f"aligned to points of {points.name},"
        _move(map_folder, T, sentence, facts, document, out, overwrite, as_json, up_source="measured points")
        return
    from mapping.sparse import alignment

    direction = np.array(console.numbers("--up", up or "", 3))
    if (length := float(np.linalg.norm(direction))) < 1e-6:
        raise InputError(f"--up {up} has no direction")
    R = alignment.upright(direction / length)
    turn_deg = math.degrees(float(rotations.angle_between(rotations.from_matrix(R), rotations.from_yaw(0.0))))
    T = np.eye(4)
    T[:3, :3] = R
    facts, document = {"turned": f"{turn_deg:.2f} deg"}, {"turned_rad": math.radians(turn_deg)}
    _move(map_folder, T, f"up set to {up},", facts, document, out, overwrite, as_json, up_source="a stated direction")


@click.command()
@click.argument("first", type=click.Path(path_type=Path))
@click.argument("second", type=click.Path(path_type=Path))
@_result
def merge(first: Path, second: Path, out: Path, overwrite: bool, as_json: bool) -> None:
    """Join two maps that overlap into one, in the frame of FIRST.

    \b
    goshawk map merge hall corridor --out building

    Registered by common points, refined on the surfaces. Refused if too little is common, if one is more than 5 %
    larger, or if surfaces of one lie in free space of the other. Edits of both go along; the verdict is the worse one.
    """
    from mapping import map_parts, merging

    results.require_free_folder(out, overwrite=overwrite, ours=_is_map)
    a, b = map_parts.read(first), map_parts.read(second)
    with console.progress() as progress:
        found = merging.register(a, b, progress=progress)
        joined = merging.merged(a, b, found)
    x, y, z = found.T_first_second[:3, 3]
    facts = {
        "common points": f"{len(found.pairs)} of {found.matches} that look alike",
        "apart": f"{1000.0 * found.residual_m:.0f} mm, median",
        "second map at": f"{x:.2f}, {y:.2f}, {z:.2f} m",
        "its scale": f"{found.scale:.4f}",
        "seen by both": f"{found.seen_by_both:.0%} of the smaller mesh, {found.contradiction:.1%} contradict",
    }
    _write(out, joined, facts, found.as_dict(), overwrite, as_json)


def read_points(path: Path) -> tuple[FloatArray, FloatArray]:
    """(n, 3) points in the map and as measured.

    Raises:
        InputError, FormatError: there is no such file, or a column or number of it is missing.
    """
    if not path.is_file():
        raise errors.missing(path, f"the columns {','.join(_POINT_COLUMNS)}")
    try:
        with open(path, encoding="utf-8-sig", errors="replace", newline="") as stream:  # spreadsheets write the mark
            rows = list(csv.DictReader(stream))
        values = np.array([[float(row[name]) for name in _POINT_COLUMNS] for row in rows]).reshape(-1, 6)
    except (KeyError, TypeError, ValueError, csv.Error) as error:
        raise FormatError(f"{path}: each line needs a number for each of {','.join(_POINT_COLUMNS)}") from error
    if not np.isfinite(values).all():
        raise FormatError(f"{path}: a coordinate is not finite")
    return values[:, :3], values[:, 3:]


def fit_points(map_m: FloatArray, measured_m: FloatArray) -> tuple[FloatArray, float, float]:
    """The rigid motion (4, 4) from the map to the measured points, its RMS residual, and the map's relative size.

    Raises:
        InputError: fewer than three points, all on one line; the map is not as large as the measured points, of another
            shape, or upside down.
    """
    if len(map_m) < 3:
        raise InputError(f"{len(map_m)} points are given; at least 3 are needed")
    a, b = map_m - map_m.mean(axis=0), measured_m - measured_m.mean(axis=0)
    U, sizes, Vt = np.linalg.svd(b.T @ a)  # Umeyama (1991)
    if sizes[1] < 1e-4 * max(sizes[0], 1e-12):
        raise InputError("the points lie on one line: a map can still turn about it; add one beside it")
    R = U @ np.diag([1.0, 1.0, np.sign(np.linalg.det(U @ Vt))]) @ Vt
    scale = float(np.sqrt((a**2).sum() / (b**2).sum()))
    if abs(scale - 1.0) > LARGEST_SCALE_ERROR:
        raise InputError(
            f"the map is {scale:.3f} times as large as the measured points, more than {LARGEST_SCALE_ERROR:.0%} off: a "
            "point is wrong, or make the map again with --length"
        )
    off_m = np.linalg.norm(a @ R.T - b, axis=1)
    residual_m, extent_m = (float(np.sqrt((lengths_m**2).mean())) for lengths_m in (off_m, np.linalg.norm(b, axis=1)))
    if residual_m > LARGEST_MISFIT * extent_m:
        raise InputError(
            f"the points do not fit: {residual_m:.3f} m RMS are left, more than {LARGEST_MISFIT:.0%} of their extent "
            f"of {extent_m:.2f} m, most at point {int(off_m.argmax()) + 1}; are two exchanged?"
        )
    if R[2, 2] < 0.0:
        raise InputError(
            "the measured points would turn the map upside down: their axes must be right-handed with z up (x east, y "
            "north), not north, east, down"
        )
    T = np.eye(4)
    T[:3, :3] = R
    T[:3, 3] = measured_m.mean(axis=0) - R @ map_m.mean(axis=0)
    return T, residual_m, scale


def _move(
    map_folder: Path,
    T_new_old: FloatArray,
    sentence: str,
    facts: dict[str, str],
    document: dict[str, Any],
    out: Path,
    overwrite: bool,
    as_json: bool,
    *,
    up_source: str | None = None,
) -> None:
    from mapping import map_parts

    results.require_free_folder(out, overwrite=overwrite, ours=_is_map)
    old = map_parts.read(map_folder)
    new = map_parts.moved(old, T_new_old, f"{sentence} {_named(old)}")
    if up_source is not None:
        new = dataclasses.replace(new, facts=new.facts | {"up_source": up_source})
    _write(out, new, facts, document | {"T_new_old": T_new_old.tolist()}, overwrite, as_json)


def _write(
    out: Path, new: Any, facts: dict[str, str], document: dict[str, Any], overwrite: bool, as_json: bool
) -> None:
    from mapping import map_parts

    earlier = results.newest_kept(out)
    hash = map_parts.write(out, new, overwrite=overwrite)
    if (kept := results.newest_kept(out)) != earlier:
        outputs.report_kept(out, kept)
    voxel_m3 = float(np.prod(new.field.grid.voxel_m))
    free_m3, occupied_m3 = (float((new.field.state == which).sum()) * voxel_m3 for which in (esdf.FREE, esdf.OCCUPIED))
    facts = facts | {
        "space": f"{free_m3:.1f} m3 free, {occupied_m3:.1f} m3 occupied, before edits",
        "edits": str(len(new.edits)),
        "written": str(out),
    }
    document = document | {
        "free_m3": free_m3, "occupied_m3": occupied_m3, "edits": len(new.edits), "hash": hash, "written": str(out),
    }  # fmt: skip
    console.show("new map", facts, as_json=as_json, document=document)


def _named(parts: Any) -> str:
    return f"{parts.name} ({parts.field.hash[:8]})"


def _is_map(folder: Path) -> bool:
    from mapping import map_folder

    return map_folder.is_map(folder)
