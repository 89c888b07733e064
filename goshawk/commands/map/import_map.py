"""`goshawk map import`: a map without images, from a mesh or a two-dimensional map of another program."""

from pathlib import Path
from typing import Any

import click
import numpy as np

from esdf import FREE, OCCUPIED, UNKNOWN
from flight import FloatArray, InputError, results
from goshawk.terminal import console, outputs
from mapping import map_folder

_VOXEL_M = 0.05
_IMAGES = (".pgm", ".png", ".bmp", ".jpg", ".jpeg", ".tif", ".tiff")
_MAPS = (".yaml", ".yml")


@click.command("import")
@click.argument("file", metavar="FILE", type=click.Path(path_type=Path))
@console.path_option("--out", "out", "Map folder to write.", required=True)
@click.option("--unit", type=click.Choice(["m", "mm", "cm", "ft"]), help="Unit of FILE [default: guessed, and shown].")
@click.option("--up", "up", metavar="AXIS", help="Direction that is up: x, y, z, -x, -y, -z or X,Y,Z of FILE.")
@click.option("--voxel", "voxel_m", type=float, help="Edge of a voxel, metres [default: 0.05].")
@click.option(
    "--observed", "observed", multiple=True, metavar="X,Y,Z",
    help="A place in the map that is known to be free, with all that no surface parts from it; may be repeated.",
)  # fmt: skip
@click.option("--heights", metavar="LOW,HIGH", help="Between which a two-dimensional FILE holds, metres.")
@console.dry_run_option
@outputs.overwrite_option
@console.common_options
def import_(
    file: Path,
    out: Path,
    unit: str | None,
    up: str | None,
    voxel_m: float | None,
    observed: tuple[str, ...],
    heights: str | None,
    dry_run: bool,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Make a map of a mesh that another program made, PLY, OBJ, STL or GLB, or of a map of ROS' map_server, YAML.

    \b
    goshawk map import room.ply --out map --dry-run
    goshawk map import room.ply --out map --observed 2,1.5,1.2
    goshawk map import house.stl --out map --unit mm --up y --observed 2,1.5,1.2
    goshawk map import hall.yaml --out map --heights 0,2.5

    Voxels that a triangle touches are occupied, all others unknown: a mesh does not say what was seen. --observed
    states it, in metres in the map's frame, for the space about a place as far as surfaces and the mesh's box. Normals
    are not used. Nothing checks unit, up and missing surfaces, so the map's verdict is "not judged".

    A map of map_server holds for one height. With --heights you state that all between LOW and HIGH is as at that one,
    free or occupied: tables and lamps are what it does not show. Its cells become voxels.
    """
    if voxel_m is not None and not 0.0 < voxel_m < float("inf"):
        raise InputError(f"--voxel is {voxel_m:g} m; it must be above 0")
    if file.suffix.lower() in _IMAGES:
        raise InputError(f"{file.name} is an image; give the YAML file beside it, which states its place and scale")
    places = np.array([console.numbers("--observed", text, 3) for text in observed]).reshape(-1, 3)
    results.require_free_folder(out, overwrite=overwrite, ours=map_folder.is_map)
    from mapping import foreign_mesh, imported

    with console.progress() as progress:
        progress("read the file", 0.0)
        if file.suffix.lower() in _MAPS:
            if any(given for given in (unit, up, voxel_m, observed)):
                raise InputError(f"--unit, --up, --voxel and --observed are for meshes; {file.name} states these")
            mesh, space = _floor(file, heights)
        elif heights is not None:
            raise InputError(f"--heights is for two-dimensional maps, in YAML; {file.name} is a mesh")
        else:
            mesh = foreign_mesh.read(file, unit=unit, up=up)
            progress("voxels", 0.3)
            space = imported.space(mesh, voxel_m or _VOXEL_M, places)
    document = _document(file, mesh, space, places)
    if not dry_run:
        earlier = results.newest_kept(out)
        document["hash"] = imported.write(out, mesh, space, _kept(document), _reason(file), overwrite=overwrite)
        document["written"] = str(out)
        if (kept := results.newest_kept(out)) != earlier:
            outputs.report_kept(out, kept)
    console.show(f"import of {file}", _facts(document), as_json=as_json, document=document)


def _floor(file: Path, heights: str | None) -> tuple[Any, Any]:
    """The walls and the voxels of a map of map_server."""
    from mapping import foreign_mesh, imported, map_server

    if heights is None:
        raise InputError(f"{file.name} is a map of one height; give --heights LOW,HIGH, between which it holds")
    low_m, high_m = console.numbers("--heights", heights, 2)
    floor = map_server.read(file)
    space = imported.columns(floor, low_m, high_m)
    vertices, faces = map_server.walls(floor, low_m, low_m + space.grid.voxel_m[2] * space.grid.shape[2])
    if not len(faces):
        raise InputError(f"{file.name} shows nothing occupied: a map without walls is no map to plan in")
    open_edges = len(faces)  # of two triangles each, a side is open above and below
    return foreign_mesh.ForeignMesh(vertices, faces, "m (ROS' rule)", "z (ROS' rule)", open_edges), space


def _reason(file: Path) -> str:
    return f"imported from {file.name}; its scale, its surfaces and what is free were not measured"


def _kept(document: dict[str, Any]) -> dict[str, Any]:
    """Of the document, what `map.toml` says."""
    names = ("imported_from", "unit", "up", "observed_world_m", "open_edges", "open_sides")
    return {name: document[name] for name in names}


def _document(file: Path, mesh: Any, space: Any, places: FloatArray) -> dict[str, Any]:
    """What was found, volumes in cubic metres."""
    return {
        "imported_from": file.name,
        "unit": mesh.unit,
        "up": mesh.up,
        "triangles": len(mesh.faces),
        "open_edges": mesh.open_edges,
        "open_sides": space.open_sides,
        "low_world_m": mesh.vertices_world_m.min(axis=0).tolist(),
        "high_world_m": mesh.vertices_world_m.max(axis=0).tolist(),
        "voxel_m": space.grid.voxel_m[0],
        "voxels": list(space.grid.shape),
        "observed_world_m": places.tolist(),
        "free_m3": space.volume_m3(FREE),
        "occupied_m3": space.volume_m3(OCCUPIED),
        "unknown_m3": space.volume_m3(UNKNOWN),
        "written": None,
    }


def _facts(document: dict[str, Any]) -> dict[str, object]:
    low, high = (np.round(document[name], 2).tolist() for name in ("low_world_m", "high_world_m"))
    shares = {name: document[f"{name}_m3"] for name in ("free", "occupied", "unknown")}
    whole = sum(shares.values())
    facts: dict[str, object] = {
        "unit": document["unit"],
        "up": document["up"],
        "reaches": f"from {low} to {high} m",
        "triangles": f"{document['triangles']}, {document['open_edges']} edges at holes",
        "space": ", ".join(f"{value:.1f} m3 ({value / whole:.0%}) {name}" for name, value in shares.items()),
    }
    of_mesh = Path(document["imported_from"]).suffix.lower() not in _MAPS
    if document["open_sides"] and of_mesh:  # that of a map of one height always ends there
        facts["open"] = "free space reaches the edge of the mesh's box: it has a hole there, or --observed is outside"
    if not document["free_m3"]:
        remedy = "name a place that is, by --observed X,Y,Z" if of_mesh else "check its image and free_thresh"
        facts["next"] = f"nothing is free, so no plan is possible: {remedy}"
    return facts | {"written": document["written"] or "nothing, as --dry-run asks"}
