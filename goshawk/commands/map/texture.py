"""`goshawk map texture`: the mesh of a map with a texture from its images."""

from pathlib import Path

import click

import mapping
from flight import InputError, results
from goshawk.terminal import console, outputs

FACES, SIZE = (100, 500_000), (256, 8192)
"""Bounds of the options: fewer show no room, more take too much time and memory."""


@click.command()
@click.argument("map_folder", metavar="MAP", type=click.Path(path_type=Path))
@click.option("--faces", "faces", default=20_000, show_default=True, help="Simplify the mesh to at most so many faces.")
@click.option("--size", "size", default=2048, show_default=True, help="Edge of the texture, pixels.")
@console.path_option("--images", "images", "The map's images, if they were moved since the map was made.")
@console.path_option("--masks", "masks", "Folder of masks, if they were moved since.")
@outputs.overwrite_option
@console.common_options
def texture(
    map_folder: Path,
    faces: int,
    size: int,
    images: Path | None,
    masks: Path | None,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Write MAP/mesh_textured.glb: a simplified mesh with a texture from the images that MAP was made of.

    \b
    goshawk map texture map
    goshawk map texture map --faces 50000 --size 4096 --overwrite

    For looking at, in any viewer of glTF, where it stands upright. Exposure and vignetting of the images are evened;
    what no image shows keeps the colours of MAP/mesh.glb. The map and its hash stay as they are. A larger --size is
    sharper, until a texel is as small as a pixel of the images on the surface.
    """
    from mapping import given_paths, texturing

    for option, value, (low, high) in (("--faces", faces, FACES), ("--size", size, SIZE)):
        if not low <= value <= high:
            raise InputError(f"{option} is {value}; it must be from {low} to {high}")
    known = mapping.open_map(map_folder)
    out = map_folder / texturing.FILE
    images = images or given_paths.read(map_folder, known.facts, given_paths.IMAGES)
    if images is None:
        raise InputError(
            f"{map_folder / 'map.toml'} does not say where its images are (it is a copy, or of an earlier version); "
            "give --images"
        )
    earlier = results.newest_kept(out)
    with console.progress() as progress:
        made = texturing.add_texture(
            known,
            images,
            masks=masks or given_paths.read(map_folder, known.facts, given_paths.MASKS),
            options=texturing.TextureOptions(faces, size),
            overwrite=overwrite,
            progress=progress,
        )
    if (kept := results.newest_kept(out)) != earlier:
        outputs.report_kept(out, kept)
    low, high = made.gain_range
    facts = {
        "mesh": f"{made.faces} faces",
        "texture": f"{made.size} x {made.size} pixels, one covers {1000.0 * made.texel_m:.1f} mm",
        "images": str(made.images),
        "painted": f"{made.painted:.1%} of the surface; the rest has the colours of mesh.glb",
        "exposure evened": f"from {low:.2f} to {high:.2f} of the mean",
        "written": f"{out} ({made.bytes / 1e6:.1f} MB)",
    }
    if made.left_out:
        facts["do not look like the map"] = ", ".join(made.left_out)
    console.show("texture", facts, as_json=as_json, document=made.as_dict() | {"written": str(out)})
