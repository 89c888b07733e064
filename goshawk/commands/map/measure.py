"""`goshawk map measure`: the length between two places of a map."""

import math
from pathlib import Path

import click
import numpy as np

import mapping
from esdf import KNOWN, UNMAPPED
from flight import FloatArray, InputError
from goshawk.terminal import console
from mapping import Map
from mapping.camera.trial import SIGMAS95
from mapping.map_folder import read_report
from mapping.reach import FARTHEST_M
from mapping.verdict import Standing


@click.command()
@click.argument("map_folder", metavar="MAP", type=click.Path(path_type=Path))
@click.option("--first", "start", metavar="X,Y,Z|IMAGE", required=True, help="First point: metres, or an image's name.")
@click.option("--second", "end", metavar="X,Y,Z|IMAGE", required=True, help="Second point.")
@console.common_options
def measure(map_folder: Path, start: str, end: str, as_json: bool) -> None:
    """Measure the length between two places of MAP, and the clearance at each.

    \b
    goshawk map measure map --first 1.2,0.35,0.8 --second 4.1,0.4,0.8
    goshawk map measure map --first 0003.png --second 0027.png          between the places of two images

    Points are in metres in the map's world frame; of an image it is the place of the body. The standard deviation is
    that of the map's scale; how well a point was chosen comes on top. To measure with a tape and make the map agree,
    give goshawk map build --length.
    """
    area = mapping.open_map(map_folder)
    points_world_m = np.array([_point(area, "--first", start), _point(area, "--second", end)])
    step_m = points_world_m[1] - points_world_m[0]
    length_m = float(np.linalg.norm(step_m))
    witnesses = read_report(map_folder).get("scale_witnesses", [])
    std_m = float(witnesses[0]["std"]) * length_m if witnesses else None
    clearances = [_clearance(area, point) for point in points_world_m]
    doubts = {} if area.standing is Standing.GOOD else {"map": f"{area.standing}: {'; '.join(area.reasons)}"}
    facts = doubts | {
        "length": f"{length_m:.3f} m" + ("" if std_m is None else f" ± {SIGMAS95 * std_m:.3f} m, of the map's scale"),
        "horizontal": f"{math.hypot(step_m[0], step_m[1]):.3f} m",
        "rise": f"{step_m[2]:+.3f} m",
        "clearance at the first": _words(*clearances[0]),
        "clearance at the second": _words(*clearances[1]),
    }
    document = {
        "points_world_m": points_world_m.tolist(),
        "length_m": length_m,
        "length_std_m": std_m,
        "horizontal_m": math.hypot(step_m[0], step_m[1]),
        "rise_m": float(step_m[2]),
        "clearance_m": [clearance_m for clearance_m, _ in clearances],
        "status": [status for _, status in clearances],
        "map_hash": area.hash,
        "verdict": str(area.standing),
        "reasons": list(area.reasons),
    }
    console.show("measure", facts, as_json=as_json, document=document)


def _point(area: Map, option: str, text: str) -> FloatArray:
    """(3,) in the world: three numbers, or where an image of the map was taken."""
    if text in area.images:
        return area.T_world_body[area.images.index(text), :3, 3]
    try:
        point_world_m = np.array(console.numbers(option, text, 3))
    except InputError:
        raise InputError(f"{option} {text!r} is neither X,Y,Z in metres nor an image of {area.folder}") from None
    if (farthest_m := float(np.abs(point_world_m).max())) > FARTHEST_M:
        raise InputError(
            f"{option} is {farthest_m:g} m from the origin; a map reaches at most {FARTHEST_M:g} m: is it in metres?"
        )
    return point_world_m


def _clearance(area: Map, point_world_m: FloatArray) -> tuple[float | None, str]:
    """Metres to what is nearest, obstacle or unknown space, and the kind of place; None in what is not mapped."""
    status = int(area.field.status(point_world_m[None])[0])
    if status == KNOWN:
        return float(area.field.distance(point_world_m[None])[0]), "mapped"
    return None, "unknown space" if status == UNMAPPED else "outside of the map"


def _words(clearance_m: float | None, status: str) -> str:
    if clearance_m is None:
        return f"not known: {status}"
    if clearance_m < 0.0:
        return f"{-clearance_m:.3f} m inside an obstacle"
    return f"{clearance_m:.3f} m from obstacles and unknown space"
