"""`goshawk map import`: a map without images, from what other programs made: meshes, points, grids."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click
import numpy as np

from esdf import FREE, OCCUPIED, UNKNOWN
from flight import FloatArray, InputError, Progress, results
from goshawk.terminal import console, outputs
from mapping import map_folder

_VOXEL_M, _GAP_M = 0.05, 0.2
_IMAGES = (".pgm", ".png", ".bmp", ".jpg", ".jpeg")
_KINDS = {
    "mesh": "meshes",
    "cloud": "points",
    "volume": "volumes",
    "distances": "slices of distances",
    "map": "two-dimensional maps (YAML)",
    "dem": "elevation models",
}
"""Of which an option says something."""
_A_KIND = {
    "mesh": "a mesh",
    "cloud": "a cloud of points",
    "map": "a two-dimensional map",
    "octomap": "an OctoMap",
    "voxblox": "a voxblox layer",
    "volume": "an OpenVDB volume",
    "distances": "a layer of distances",
    "dem": "an elevation model",
}
_OF_SHAPES, _OF_CLOUDS = ("mesh", "cloud", "volume"), ("cloud",)
_OF_PLACES = (*_OF_SHAPES, "dem")
_FOR: dict[str, tuple[str, ...]] = {
    "--unit": _OF_PLACES,
    "--up": _OF_SHAPES,
    "--origin": _OF_PLACES,
    "--voxel": ("mesh", "cloud", "dem"),
    "--observed": _OF_SHAPES,
    "--sensor": _OF_CLOUDS,
    "--sensor-poses": _OF_CLOUDS,
    "--viewpoints": _OF_CLOUDS,
    "--least-points": _OF_CLOUDS,
    "--gap": _OF_CLOUDS,
    "--heights": ("map", "distances", "dem"),
}
"""Kinds of FILE that each option is for."""
_KEPT = (
    "imported_from",
    "unit",
    "up",
    "origin",
    "observed_world_m",
    "open_edges",
    "open_sides",
    "points",
    "rays",
    "least_points",
)
"""Of the document, what `map.toml` says."""
_RULES = {"octomap": "OctoMap's", "voxblox": "voxblox's", "distances": "nvblox'"}
_MAKES_FREE = {
    "mesh": "name a place that is, by --observed X,Y,Z",
    "cloud": "say from where they were measured (--sensor, --sensor-poses, --viewpoints), or what is free (--observed)",
    "map": "check its image and free_thresh",
    "octomap": "it states none",
    "voxblox": "it states none",
    "volume": "name a place that is, by --observed X,Y,Z",
    "distances": "it states none",
    "dem": "state it, by --heights LOW,HIGH",
}


@dataclass(frozen=True, slots=True)
class Asked:
    """What the options say of the file; None and empty: nothing."""

    unit: str | None = None
    up: str | None = None
    voxel_m: float | None = None
    observed: tuple[str, ...] = ()
    origin: str | None = None
    sensors: tuple[str, ...] = ()
    poses: Path | None = None
    viewpoints: bool = False
    least_points: int | None = None
    gap_m: float | None = None
    heights: str | None = None
    beside: bool = False
    """Whether a file may name another one of its own folder only."""
    more: tuple[Path, ...] = ()
    """Other scans of the same place, in the same frame."""


@click.command("import")
@click.argument("files", metavar="FILE...", nargs=-1, required=True, type=click.Path(path_type=Path))
@console.path_option("--out", "out", "Map folder to write.", required=True)
@click.option("--unit", type=click.Choice(["m", "mm", "cm", "ft"]), help="Unit of FILE [default: guessed, and shown].")
@click.option("--up", "up", metavar="AXIS", help="Direction that is up: x, y, z, -x, -y, -z or X,Y,Z of FILE.")
@click.option("--origin", metavar="X,Y,Z", help="Place in FILE's numbers that becomes the map's origin.")
@click.option("--voxel", "voxel_m", type=float, help="Edge of a voxel, metres [default: 0.05].")
@click.option(
    "--observed", "observed", multiple=True, metavar="X,Y,Z",
    help="A place in the map that is known to be free, with all that no surface parts from it; may be repeated.",
)  # fmt: skip
@click.option(
    "--sensor", "sensors", multiple=True, metavar="X,Y,Z",
    help="Place in the map from which all points were measured; of several FILEs, once for each.",
)  # fmt: skip
@console.path_option("--sensor-poses", "poses", "Poses of the sensor by the times of the points, TUM or EuRoC.")
@click.option(
    "--viewpoints",
    is_flag=True,
    help="Points were measured from their vp_x, vp_y, vp_z, PCD's header or E57's scanners.",
)
@click.option("--least-points", type=click.IntRange(1), help="Points in an occupied voxel [default: 1].")
@click.option(
    "--gap",
    "gap_m",
    type=float,
    help="Widest hole between points that --observed does not pass, metres [default: 0.2].",
)
@click.option(
    "--heights",
    metavar="LOW,HIGH",
    help="Between which a two-dimensional FILE holds, or all above an elevation model is free; metres in the map.",
)
@console.dry_run_option
@outputs.overwrite_option
@console.common_options
def import_(
    files: tuple[Path, ...],
    out: Path,
    unit: str | None,
    up: str | None,
    origin: str | None,
    voxel_m: float | None,
    observed: tuple[str, ...],
    sensors: tuple[str, ...],
    poses: Path | None,
    viewpoints: bool,
    least_points: int | None,
    gap_m: float | None,
    heights: str | None,
    dry_run: bool,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Make a map of another program's mesh, points, OctoMap, voxblox layer, volume, ROS map or elevation model.

    Meshes are PLY, OBJ, STL, GLB or USD; points PLY, PCD, LAS, LAZ or E57. OctoMaps are BT or OT, layers VXBLX, volumes
    VDB (OpenVDB), ROS maps map_server's YAML, elevation models ASC or GeoTIFF.

    \b
    goshawk map import room.ply --out map --dry-run
    goshawk map import room.ply --out map --observed 2,1.5,1.2
    goshawk map import house.stl --out map --unit mm --up y --observed 2,1.5,1.2
    goshawk map import scan.pcd --out map --sensor 0,0,1.5
    goshawk map import a.las b.las --out map --origin 512300,5403200,410 --sensor 4,5,2 --sensor 9,5,2
    goshawk map import station.e57 --out map --viewpoints
    goshawk map import walk.laz --out map --sensor-poses lidar_tum.txt
    goshawk map import robot.bt --out map
    goshawk map import hall.yaml --out map --heights 0,2.5
    goshawk map import quarry.tif --out map --origin 512300,5403200,410 --voxel 0.5 --heights 0,60

    Voxels that a triangle touches are occupied, all others unknown: a mesh does not say what was seen. --observed
    states it, in metres in the map's frame, for the space about a place as far as surfaces and the mesh's box. Normals
    are not used. Nothing checks unit, up and missing surfaces, so the map's verdict is "not judged".

    Of points, voxels that hold some are occupied. Free is what a ray from the sensor to its point passed before
    anything occupied: --sensor, --sensor-poses or --viewpoints say from where. The poses are in metres in FILE's
    axes, of the sensor itself. --observed passes no hole up to --gap wide, and stays half of it away from points.
    Several FILEs are scans in one frame, each with its own place.

    An OctoMap or voxblox layer (ESDF, TSDF, occupancy) states what is free, occupied and unknown, and is taken so. Of
    distances, voxels within half their diagonal of a surface are occupied: a map that was exported comes back thicker.
    So is nvblox' ESDF, points with distances (PLY); a slice of it holds from LOW to HIGH of --heights.

    A volume of distances is a shape, as a mesh is: it needs --observed. Of one that Goshawk wrote, every voxel has its
    state again.

    A map of map_server holds for one height. With --heights you state that all between LOW and HIGH is as at that one,
    free or occupied: tables and lamps are what it does not show. Its cells become voxels.

    An elevation model has one height a cell. With --heights you state that all above it from LOW to HIGH is free: wires
    and overhanging trees are what it does not show. Below it is unknown.
    """
    asked = Asked(
        unit, up, voxel_m, observed, origin, sensors, poses, viewpoints, least_points, gap_m, heights, more=files[1:]
    )
    with console.progress() as progress:
        kind, document = import_file(files[0], out, asked, dry_run=dry_run, overwrite=overwrite, progress=progress)
    console.show(f"import of {', '.join(map(str, files))}", _facts(kind, document), as_json=as_json, document=document)


def import_file(
    file: Path, out: Path, asked: Asked, *, dry_run: bool, overwrite: bool, progress: Progress
) -> tuple[str, dict[str, Any]]:
    """Write a map of a file; the file's kind and what was found.

    Raises:
        FlightError: the file cannot be read, what is asked does not fit it, or `out` is taken.
    """
    places = np.array([console.numbers("--observed", text, 3) for text in asked.observed]).reshape(-1, 3)
    for name, value in (("--voxel", asked.voxel_m), ("--gap", asked.gap_m)):
        if value is not None and not 0.0 < value < float("inf"):
            raise InputError(f"{name} is {value:g} m; it must be above 0")
    kind = _kind(file)
    _require_fitting(kind, asked)
    origin = _origin(asked.origin)
    results.require_free_folder(out, overwrite=overwrite, ours=map_folder.is_map)
    from mapping import foreign_mesh, imported

    progress("read the file", 0.0)
    if kind == "map":
        mesh, space, facts = _floor(file, asked.heights, beside=asked.beside)
    elif kind in ("octomap", "voxblox", "distances"):
        mesh, space, facts = _voxels(file, kind, asked.heights)
    elif kind == "volume":
        mesh, space, facts = _volume(file, asked, origin, places)
    elif kind == "dem":
        mesh, space, facts = _elevation(file, asked, origin)
    elif kind == "cloud":
        from goshawk.commands.map import import_cloud

        rays = import_cloud.Rays(asked.sensors, asked.poses, asked.viewpoints)
        options = import_cloud.Options(
            asked.voxel_m or _VOXEL_M, asked.least_points or 1, places, asked.gap_m or _GAP_M
        )
        taken = import_cloud.Taken(asked.unit, asked.up, origin)
        mesh, space, facts = import_cloud.read((file, *asked.more), taken, rays, options, progress)
    else:
        mesh = foreign_mesh.read(file, unit=asked.unit, up=asked.up, origin=origin)
        space = imported.space(mesh, asked.voxel_m or _VOXEL_M, places, progress)
        facts = _triangles(mesh) | {"parts": foreign_mesh.parts(mesh)}
    names = [each.name for each in (file, *asked.more)]
    document = _document(names, mesh, space, places) | facts
    document |= {"origin": None if origin is None else origin.tolist(), "written": None}
    if not dry_run:
        earlier = results.newest_kept(out)
        stated = {name: document[name] for name in _KEPT if document.get(name) is not None}
        document["hash"] = imported.write(out, mesh, space, stated, _reason(names), overwrite=overwrite)
        document["written"] = str(out)
        if (kept := results.newest_kept(out)) != earlier:
            outputs.report_kept(out, kept)
    return kind, document


def look(file: Path, unit: str | None, up: str | None, origin: str | None) -> str:
    """What unit and axes a mesh or points would be read with, and how far they then reach. Raises as `import_file`."""
    from mapping import foreign_mesh
    from mapping.cloud import point_cloud

    start, kind = _origin(origin), _kind(file)
    if kind == "distances":
        return "it states what is free and occupied; a slice of it wants heights between which it holds"
    if kind == "cloud":
        cloud = point_cloud.read(file, unit=unit, up=up, origin=start)
        places, unit_said, up_said = cloud.points_world_m, cloud.unit, cloud.up
    else:
        mesh = foreign_mesh.read(file, unit=unit, up=up, origin=start)
        places, unit_said, up_said = mesh.vertices_world_m, mesh.unit, mesh.up
    low, high = (", ".join(f"{value:.2f}" for value in end) for end in (places.min(axis=0), places.max(axis=0)))
    return f"it reaches from {low} to {high} m; unit {unit_said}; up {up_said}"


def takes(file: Path, option: str) -> bool:
    """Whether an option says something of a file. Raises as `import_file`."""
    return _kind(file) in _FOR[option]


def _origin(text: str | None) -> FloatArray | None:
    return None if text is None else np.array(console.numbers("--origin", text, 3))


def _kind(file: Path) -> str:
    """Whether a file is a `mesh`, a `cloud` of points, or a two-dimensional `map`, by its name and, if PLY, header."""
    suffix = file.suffix.lower()
    if suffix in _IMAGES:
        raise InputError(f"{file.name} is an image; give the YAML file beside it, which states its place and scale")
    if suffix in (".yaml", ".yml"):
        return "map"
    from mapping.cloud import (
        columns,
        distance_points,
        height_field,
        octomap_file,
        point_file,
        vdb_file,
        voxblox_file,
    )

    if suffix in octomap_file.SUFFIXES:
        return "octomap"
    if suffix == voxblox_file.SUFFIX:
        return "voxblox"
    if suffix == vdb_file.SUFFIX:
        return "volume"
    if suffix in height_field.SUFFIXES:
        return "dem"
    if suffix in columns.SUFFIXES and suffix != ".ply":
        return "cloud"
    if suffix != ".ply" or not file.is_file() or point_file.has_faces(file):
        return "mesh"
    return "distances" if distance_points.is_layer(file) else "cloud"


def _require_fitting(kind: str, asked: Asked) -> None:
    """
    Raises:
        InputError: an option says nothing about a file of this kind; it would be ignored.
    """
    given: dict[str, Any] = {
        "--unit": asked.unit,
        "--up": asked.up,
        "--voxel": asked.voxel_m,
        "--observed": asked.observed,
        "--heights": asked.heights,
        "--origin": asked.origin,
        "--sensor": asked.sensors,
        "--sensor-poses": asked.poses,
        "--viewpoints": asked.viewpoints,
        "--least-points": asked.least_points,
        "--gap": asked.gap_m,
    }
    for option, value in given.items():
        if value and kind not in _FOR[option]:
            *most, last = (_KINDS[one] for one in _FOR[option])
            kinds = f"{', '.join(most)} and {last}" if most else last
            raise InputError(f"{option} is for {kinds}; FILE is {_A_KIND[kind]}")
    others = {_kind(file) for file in asked.more}
    if others - {"cloud"} or (others and kind != "cloud"):
        raise InputError(
            "several FILEs are scans of points; of other kinds give one, and join maps by goshawk map merge"
        )


def _floor(file: Path, heights: str | None, *, beside: bool) -> tuple[Any, Any, dict[str, Any]]:
    """The walls and the voxels of a map of map_server, and facts about them."""
    from mapping import foreign_mesh, imported, map_server

    if heights is None:
        raise InputError(f"{file.name} is a map of one height; give --heights LOW,HIGH, between which it holds")
    low_m, high_m = _heights(heights)
    floor = map_server.read(file, beside=beside)
    space = imported.columns(floor, low_m, high_m)
    vertices, faces = map_server.walls(floor, low_m, low_m + space.grid.voxel_m[2] * space.grid.shape[2])
    if not len(faces):
        raise InputError(f"{file.name} shows nothing occupied: a map without walls is no map to plan in")
    open_edges = len(faces)  # of two triangles each, a side is open above and below
    mesh = foreign_mesh.ForeignMesh(vertices, faces, "m (ROS' rule)", "z (ROS' rule)", open_edges)
    return mesh, space, _triangles(mesh)


def _heights(text: str) -> tuple[float, float]:
    low_m, high_m = console.numbers("--heights", text, 2)
    return low_m, high_m


def _elevation(file: Path, asked: Asked, origin: FloatArray | None) -> tuple[Any, Any, dict[str, Any]]:
    """The surface and the voxels of a digital elevation model, and facts about them."""
    from mapping import foreign_mesh
    from mapping.cloud import height_field

    between = None if asked.heights is None else _heights(asked.heights)
    field = height_field.read(file, origin=origin, unit=asked.unit)
    space = height_field.space(field, asked.voxel_m or _VOXEL_M, between)
    vertices, faces = height_field.surface(field)
    mesh = foreign_mesh.ForeignMesh(vertices, faces, field.unit, "z (heights)", 0)
    cells = {"cells": field.height_m.size, "cells_without_data": int(np.isnan(field.height_m).sum())}
    return mesh, space, _triangles(mesh) | cells


def _voxels(file: Path, kind: str, heights: str | None) -> tuple[Any, Any, dict[str, Any]]:
    """The sides of what is occupied, the voxels of a file that states them, and facts about them."""
    from mapping import foreign_mesh
    from mapping.cloud import distance_points, occupancy, octomap_file, voxblox_file

    if kind == "distances":
        space = distance_points.read(file, None if heights is None else _heights(heights))
    else:
        space = octomap_file.read(file) if kind == "octomap" else voxblox_file.read(file)
    vertices, faces, _ = occupancy.surface(space)
    if not len(faces):
        raise InputError(f"{file.name} has nothing occupied: a map without surfaces is no map to plan in")
    rule = f"({_RULES[kind]} rule)"
    mesh = foreign_mesh.ForeignMesh(vertices, faces, f"m {rule}", f"z {rule}", 0)
    return mesh, space, _triangles(mesh) | ({"layer": space.of} if space.of else {})


def _volume(file: Path, asked: Asked, origin: FloatArray | None, places: FloatArray) -> tuple[Any, Any, dict[str, Any]]:
    """The sides of what is occupied, the voxels of an OpenVDB volume, and facts about them."""
    from mapping import foreign_mesh
    from mapping.cloud import occupancy, vdb_file

    found = vdb_file.read(file, unit=asked.unit, up=asked.up, origin=origin)
    space = vdb_file.space(found, places)
    vertices, faces, _ = occupancy.surface(space)
    if not len(faces):
        raise InputError(f"{file.name} has nothing occupied: a map without surfaces is no map to plan in")
    mesh = foreign_mesh.ForeignMesh(vertices, faces, found.unit, found.up, 0)
    return mesh, space, _triangles(mesh)


def _triangles(mesh: Any) -> dict[str, Any]:
    return {"triangles": len(mesh.faces), "open_edges": mesh.open_edges}


def _reason(names: Sequence[str]) -> str:
    return f"imported from {', '.join(names)}; its scale, its surfaces and what is free were not measured"


def _document(names: Sequence[str], mesh: Any, space: Any, places: FloatArray) -> dict[str, Any]:
    """What was found, volumes in cubic metres."""
    return {
        "imported_from": names[0] if len(names) == 1 else list(names),
        "unit": mesh.unit,
        "up": mesh.up,
        "open_sides": space.open_sides,
        "low_world_m": mesh.vertices_world_m.min(axis=0).tolist(),
        "high_world_m": mesh.vertices_world_m.max(axis=0).tolist(),
        "voxel_m": space.grid.voxel_m[0],
        "voxels": list(space.grid.shape),
        "observed_world_m": places.tolist(),
        "free_m3": space.volume_m3(FREE),
        "occupied_m3": space.volume_m3(OCCUPIED),
        "unknown_m3": space.volume_m3(UNKNOWN),
    }


def _facts(kind: str, document: dict[str, Any]) -> dict[str, object]:
    low, high = (np.round(document[name], 2).tolist() for name in ("low_world_m", "high_world_m"))
    shares = {name: document[f"{name}_m3"] for name in ("free", "occupied", "unknown")}
    whole = sum(shares.values())
    facts: dict[str, object] = {
        "unit": document["unit"],
        "up": document["up"],
        "reaches": f"from {low} to {high} m",
        **_contents(kind, document),
        "space": ", ".join(f"{value:.1f} m3 ({value / whole:.0%}) {name}" for name, value in shares.items()),
    }
    if document.get("parts", 1) > 1:
        facts["apart"] = (
            f"{document['parts']} parts, more than 2 m from each other: cut the file if they are several maps"
        )
    if document["open_sides"] and kind == "mesh":  # that of a map of one height always ends there
        facts["open"] = "free space reaches the edge of the mesh's box: it has a hole there, or --observed is outside"
    if not document["free_m3"]:
        facts["next"] = f"nothing is free, so no plan is possible: {_MAKES_FREE[kind]}"
    return facts | {"written": document["written"] or "nothing, as --dry-run asks"}


def _contents(kind: str, document: dict[str, Any]) -> dict[str, object]:
    if kind == "dem":
        said = f"{document['cells_without_data']:,} of {document['cells']:,} cells without data"
        return {"triangles": document["triangles"], "heights": said}
    if kind != "cloud":
        triangles = {"triangles": f"{document['triangles']}, {document['open_edges']} edges at holes"}
        return {**triangles, **{name: document[name] for name in ("layer",) if name in document}}
    found: dict[str, object] = {"points": document["points"]}
    if document["not_finite"]:
        found["left out"] = f"{document['not_finite']} points that are not finite"
    if document["rays"]:
        found["sensor"] = document["sensor"]
        found["rays"] = (
            f"{document['rays']}, {document['stopped_rays'] / document['rays']:.1%} stopped before their point"
        )
    return found
