"""`goshawk map export`: a map for other programs: its mesh, or a slice of it for ROS."""

from pathlib import Path

import click

import esdf
import mapping
from flight import InputError
from goshawk.terminal import console, outputs
from mapping import foreign_mesh, map_server
from mapping.dense import mesh_file


@click.command()
@click.argument("map_folder", metavar="MAP", type=click.Path(path_type=Path))
@console.path_option("--out", "out", "PLY mesh, or PGM image for ROS, to write.", required=True)
@click.option("--height", "height_m", type=float, help="Height of the slice of a PGM, metres in the map.")
@outputs.overwrite_option
@console.common_options
def export(map_folder: Path, out: Path, height_m: float | None, overwrite: bool, as_json: bool) -> None:
    """Write MAP for other programs: its mesh as PLY, or a slice as PGM with a YAML file for ROS map_server.

    \b
    goshawk map export map --out room.ply
    goshawk map export map --out room.pgm --height 1.2

    Metres, z up. A slice has the pilot's edits, the mesh has none. In the image occupied is black, free white, unknown
    grey. `goshawk map import` reads the YAML, and the PLY, which does not say which space is free.
    """
    kind = out.suffix.lower()
    if kind not in (".ply", ".pgm"):
        raise InputError(f"--out {out} ends neither in .ply (mesh) nor in .pgm (slice for ROS)")
    if (kind == ".pgm") != (height_m is not None):
        raise InputError("--height goes with a .pgm, and a .pgm needs it: metres in the map")
    yaml = out.with_suffix(".yaml") if kind == ".pgm" else None
    outputs.check(out, yaml, overwrite=overwrite)
    area = mapping.open_map(map_folder)
    facts: dict[str, object] = {}
    if height_m is None:
        vertices, faces, colours = foreign_mesh.of_map(area)
        with outputs.file(out, overwrite=overwrite) as temporary:
            temporary.write_bytes(mesh_file.ply(vertices, faces, colours))
        facts["triangles"] = len(faces)
    elif yaml is not None:
        image = map_server.slice_at(area.field, height_m)
        with outputs.file(out, overwrite=overwrite) as temporary:
            temporary.write_bytes(map_server.pgm(image))
        with outputs.file(yaml, overwrite=overwrite) as temporary:
            temporary.write_text(map_server.yaml(out.name, area.field.grid))
        shares = {"free": esdf.FREE, "occupied": esdf.OCCUPIED, "unknown": esdf.UNKNOWN}
        facts |= {name: f"{float((image == state).mean()):.0%}" for name, state in shares.items()}
    written = [str(path) for path in (out, yaml) if path is not None]
    document = facts | {"map_hash": area.hash, "written": written}
    console.show(f"export of {map_folder}", facts | {"written": ", ".join(written)}, as_json=as_json, document=document)
