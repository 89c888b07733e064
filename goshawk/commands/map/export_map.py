"""`goshawk map export`: a map for other programs: mesh, points, grids, a COLMAP model, an OctoMap."""

from collections.abc import Callable, Mapping
from pathlib import Path

import click
import numpy as np

import esdf
import mapping
from esdf import exchange_vdb, exchange_voxblox
from flight import InputError, results
from goshawk.terminal import console, outputs
from mapping import foreign_mesh, map_server
from mapping.cloud import height_field
from mapping.dense import mesh_file
from mapping.export import colmap_files, octomap, surfaces
from mapping.map_folder import Map
from mapping.sparse import tracks

KINDS: Mapping[str, tuple[str, ...]] = {
    "mesh": (".ply", ".obj", ".stl", ".glb", ".usda"),
    "points": (".ply",),
    "ros": (".pgm",),
    "octomap": (".bt",),
    "voxblox": (".vxblx",),
    "volume": (".vdb",),
    "dem": (".asc",),
    "distances": (".ply",),
    "colmap": ("",),
}
"""What is exported, and the ends of its file's name; the first kind of an end is taken without --as."""
MOST_DISTANCES = 20_000_000
"""They take 2 GB of memory."""
_NEAR_M = 0.15
"""Points take the colour of the mesh within this."""


@click.command()
@click.argument("map_folder", metavar="MAP", type=click.Path(path_type=Path))
@console.path_option(
    "--out",
    "out",
    "File to write (.ply, .obj, .stl, .glb, .usda, .pgm, .bt, .vxblx, .vdb, .asc), or folder.",
    required=True,
)
@click.option("--as", "kind", type=click.Choice(list(KINDS)), help="What to export [default: by the end of --out].")
@click.option(
    "--height", "height_m", type=float, help="Height of the slice for ROS or of distances, metres in the map."
)
@outputs.overwrite_option
@console.common_options
def export(
    map_folder: Path, out: Path, kind: str | None, height_m: float | None, overwrite: bool, as_json: bool
) -> None:
    """Write MAP for other programs. Metres.

    \b
    goshawk map export map --out room.glb                 # mesh; also PLY, OBJ, STL, USDA
    goshawk map export map --out room.ply --as points     # the mesh's vertices with standard deviations
    goshawk map export map --out room.pgm --height 1.2    # slice, with a YAML file for ROS map_server
    goshawk map export map --out room.bt                  # OctoMap
    goshawk map export map --out room.vxblx               # ESDF layer of voxblox
    goshawk map export map --out room.vdb                 # distances as an OpenVDB volume
    goshawk map export map --out room.asc                 # elevation model: the highest surfaces, an ESRI ASCII grid
    goshawk map export map --out esdf.ply --as distances --height 1.2  # slice of the distance field; without: all of it
    goshawk map export map --out sparse/0 --as colmap     # images, poses and points: COLMAP, nerfstudio, splats

    Up is z, in OBJ and GLB y. Slices, grids and elevation model have the pilot's edits, meshes and points have none.
    `goshawk map import` reads all again but COLMAP models; slice, OctoMap, voxblox layer, volume and distances say
    which space is free. Distances are points with an intensity in metres, as nvblox' ESDF, at the middles of voxels
    that are known.
    """
    kind = _kind(out, kind)
    if kind == "ros" and height_m is None:
        raise InputError("a slice for ROS (.pgm) needs --height, metres in the map")
    if kind not in ("ros", "distances") and height_m is not None:
        raise InputError("--height goes with a slice for ROS (.pgm) or of distances")
    if kind == "colmap":
        facts = _colmap(mapping.open_map(map_folder), out, overwrite=overwrite)
        _show(map_folder, facts, [out], as_json=as_json)
        return
    yaml = out.with_suffix(".yaml") if kind == "ros" else None
    outputs.check(out, yaml, overwrite=overwrite)
    area = mapping.open_map(map_folder)
    written: dict[Path, bytes | Callable[[Path], None]] = {}
    facts: dict[str, object] = {"map_hash": area.hash}
    if kind == "ros" and yaml is not None and height_m is not None:
        image = map_server.slice_at(area.field, height_m)
        written = {out: map_server.pgm(image), yaml: map_server.yaml(out.name, area.field.grid).encode()}
        facts |= _shares(image)
    elif kind == "octomap":
        written[out] = octomap.encode(area.field)
        facts |= _shares(area.field.state)
    elif kind in ("voxblox", "volume"):
        write = exchange_vdb.export_vdb if kind == "volume" else exchange_voxblox.export_layer
        written[out] = lambda place: write(place, area.field)  # a large one at once to the disk
        facts |= _shares(area.field.state)
    elif kind == "dem":
        written[out], facts["cells with a height"] = _elevation(area)
    elif kind == "distances":
        written[out], facts["points"] = _distances(area, height_m)
    else:
        vertices, faces, colours = foreign_mesh.of_map(area)
        if kind == "points":
            written[out] = surfaces.points(vertices, colours, _deviation_m(area, len(vertices)))
            facts |= {"points": len(vertices)}
        else:
            written[out] = surfaces.mesh(out.suffix.lower(), vertices, faces, colours)
            facts |= {"triangles": len(faces), "up": surfaces.UP[out.suffix.lower()]}
    for path, data in written.items():
        with outputs.file(path, overwrite=overwrite) as temporary:
            data(temporary) if callable(data) else temporary.write_bytes(data)
    _show(map_folder, facts, list(written), as_json=as_json)


def _kind(out: Path, asked: str | None) -> str:
    """
    Raises:
        InputError: the end of the name is of no kind, or not of the one that is asked for.
    """
    suffix = out.suffix.lower()
    kinds = [kind for kind, ends in KINDS.items() if suffix in ends]
    if asked == "colmap" and suffix not in {end for ends in KINDS.values() for end in ends if end}:
        return asked  # a folder may have any name
    if asked is None and kinds and suffix:
        return kinds[0]
    if asked in kinds:
        return str(asked)
    if asked is None:
        ends = ", ".join(f"{'/'.join(ends)} ({kind})" for kind, ends in KINDS.items() if ends != ("",))
        raise InputError(f"--out {out} ends in none of {ends}; a folder for COLMAP takes --as colmap")
    wanted = "a folder" if asked == "colmap" else f"a file that ends in {' or '.join(KINDS[asked])}"
    raise InputError(f"--out {out}: {asked} is {wanted}")


def _shares(state: "np.ndarray") -> dict[str, object]:
    shares = {"free": esdf.FREE, "occupied": esdf.OCCUPIED, "unknown": esdf.UNKNOWN}
    return {name: f"{float((state == which).mean()):.0%}" for name, which in shares.items()}


def _elevation(area: Map) -> tuple[bytes, str]:
    """An ASCII grid of the highest surfaces, and the share of its cells that have one."""
    grid = area.field.grid
    if grid.voxel_m[0] != grid.voxel_m[1]:
        raise InputError(f"the voxels are {grid.voxel_m[:2]} m wide; an ASCII grid has squares")
    height_m = height_field.of_states(area.field.state, grid)
    x_m, y_m, _ = grid.origin_world_m
    return height_field.encode(height_m, grid.voxel_m[0], (x_m, y_m)), f"{float(np.isfinite(height_m).mean()):.0%}"


def _distances(area: Map, height_m: float | None) -> tuple[bytes, int]:
    """A PLY file's bytes of the distances of known voxels, at one height or everywhere; and how many there are."""
    grid = area.field.grid
    known = area.field.state != esdf.UNKNOWN
    if height_m is not None:
        low_m, high_m = float(grid.low_world_m[2]), float(grid.high_world_m[2])
        if not low_m <= height_m < high_m:
            raise InputError(f"--height is {height_m:g} m; the map reaches from {low_m:.2f} to {high_m:.2f} m")
        layer = int(grid.index(np.array([[0.0, 0.0, height_m]]))[0, 2])
        known[:, :, :layer], known[:, :, layer + 1 :] = False, False
    if (count := int(known.sum())) > MOST_DISTANCES:
        raise InputError(
            f"{count / 1e6:,.0f} million voxels are known, at most {MOST_DISTANCES / 1e6:g} million distances are "
            "written: give --height, for one slice"
        )
    centres = grid.centre(np.argwhere(known))
    return surfaces.distances(centres, area.field.distance(centres)), len(centres)


def _deviation_m(area: Map, vertices: int) -> "np.ndarray":
    surface = area.surface()
    return np.full(vertices, np.nan, np.float32) if surface is None else surface.confidence.deviation_m


def _colmap(area: Map, out: Path, *, overwrite: bool) -> dict[str, object]:
    """Write COLMAP's model of a map; what is in it."""
    known = area.localization_map()
    seen = tracks.load(area.folder / "localization", len(known.points_world_m), len(area.images), len(area.rig))
    shown = np.ones((len(area.images), len(area.rig)), bool)
    if len(seen.index):
        shown[:] = False
        shown[seen.index[:, 1], seen.index[:, 2]] = True
    vertices, _, colours = mesh_file.load(area.folder / "mesh.ply")
    rgb = surfaces.colours_at(known.points_world_m, vertices, colours, _NEAR_M, foreign_mesh.GREY)
    results.require_free_folder(out, overwrite=overwrite, ours=_is_model)
    with results.new_folder(out, overwrite=overwrite, ours=_is_model) as placing:
        colmap_files.write(
            placing.temporary, area.rig, area.images, area.T_world_body, shown, known.points_world_m, rgb, seen
        )
    outputs.report_kept(out, placing.kept)
    facts: dict[str, object] = {"map_hash": area.hash, "images": int(shown.sum()), "points": len(rgb)}
    facts["observations"] = len(seen.index) or "none: the map is of an earlier version; build it again for them"
    return facts


def _is_model(folder: Path) -> bool:
    return {file.name for file in folder.iterdir()} == set(colmap_files.FILES)


def _show(map_folder: Path, facts: Mapping[str, object], paths: list[Path], *, as_json: bool) -> None:
    written = [str(path) for path in paths]
    shown = {name: value for name, value in facts.items() if name != "map_hash"}
    document = dict(facts) | {"written": written}
    console.show(f"export of {map_folder}", shown | {"written": ", ".join(written)}, as_json=as_json, document=document)
