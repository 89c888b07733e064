"""The textured mesh of a map folder: `mesh_textured.glb`, made of the map's mesh and the images that it was made of.

It is for looking at. Nothing is planned in it, and it has no part in the map's hash.
"""

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flight import InputError, Progress, results, silent
from mapping import child
from mapping.dense import atlas, mesh_file, texture
from mapping.dense.texture import TextureView
from mapping.input.images import ImageSet, read_folder
from mapping.map_folder import Map

FILE = "mesh_textured.glb"
"""Name of the textured mesh in a map folder."""


@dataclass(frozen=True, slots=True)
class TextureOptions:
    """How fine the textured mesh is."""

    faces: int = 20_000
    """The mesh is simplified to at most so many."""
    size: int = 2048
    """Edge of the texture, pixels."""


@dataclass(frozen=True, slots=True)
class TextureReport:
    """Figures of a textured mesh."""

    faces: int
    """Of the simplified mesh."""
    size: int
    """Edge of the texture, pixels."""
    texel_m: float
    """Edge of a texel on the surface: square root of the mean area."""
    images: int
    """Images that gave colours."""
    left_out: list[str]
    """Images that do not look like the map."""
    painted: float
    """Share of the surface that has its colours from an image; the rest has the map's vertex colours."""
    gain_range: list[float]
    """Smallest and largest exposure of an image, relative to their geometric mean."""
    bytes: int
    """Size of the file."""

    def as_dict(self) -> dict[str, Any]:
        return dataclasses.asdict(self)


def add_texture(
    known: Map,
    images: Path,
    *,
    masks: Path | None = None,
    options: TextureOptions | None = None,
    overwrite: bool = False,
    progress: Progress = silent,
) -> TextureReport:
    """Write `mesh_textured.glb` into a map folder, whole or not at all.

    Args:
        images: the folder of the images that the map was made of.
        masks: the masks that it was made with.
        overwrite: replace an earlier one, which stays beside it as `mesh_textured.glb.old-1`.

    Raises:
        InputError: the images are gone or are not the map's; an earlier textured mesh is there and `overwrite` was not
            given.
        MapError: the mesh cannot be flattened.
    """
    from scipy import spatial

    options = options or TextureOptions()
    out = known.folder / FILE
    results.require_free(out, overwrite=overwrite)
    vertices, faces, colours = mesh_file.load(known.folder / "mesh.ply")
    views = views_of(known, images, masks, progress)
    flat = child.run(_flatten, vertices, faces, options, progress=progress)
    _, nearest = spatial.KDTree(vertices).query(flat.vertices_world_m)
    tolerance_m = float(max(known.field.grid.voxel_m))
    painted = texture.paint(
        flat, colours[nearest], views, size=options.size, tolerance_m=tolerance_m, progress=progress
    )
    with results.new_file(out, overwrite=overwrite) as placing:
        mesh_file.save_textured(placing.temporary, *atlas.seams_split(flat), painted.pixels)
    gains = np.exp(painted.exposure.log_gain)
    return TextureReport(
        faces=len(flat.faces),
        size=options.size,
        texel_m=atlas.texel_m(flat, options.size),
        images=len(views) - len(painted.left_out),
        left_out=list(painted.left_out),
        painted=painted.painted,
        gain_range=[float(gains.min()), float(gains.max())],
        bytes=out.stat().st_size,
    )


def views_of(known: Map, images: Path, masks: Path | None, progress: Progress) -> list[TextureView]:
    """The images of a map's poses.

    Raises:
        InputError: they are gone, or none of them has a name that the map's poses have.
    """
    if not images.exists():
        raise InputError(
            f"the map's images are not in {images}; name the folder that they were moved to, with --images (without "
            "them there is no texture)"
        )
    if images.is_file():
        raise InputError(
            f"{images} is a file; of a map made of a video give the frames, numbered as the map's are: ffmpeg -i VIDEO "
            "-fps_mode passthrough -start_number 0 FOLDER/%06d.png, then --images FOLDER"
        )
    found = read_folder(images, known.rig, minimum=1, masks=masks, progress=progress)
    poses = dict(zip(known.images, known.T_world_body, strict=True))
    views = [
        TextureView(
            found.relative(instant, camera),
            known.rig.cameras[camera],
            poses[found.instants[instant]] @ known.rig.cameras[camera].T_body_camera,
            _Reader(found, instant, camera),
        )
        for instant, camera in found.pairs()
        if found.instants[instant] in poses
    ]
    if not views:
        raise InputError(
            f"{images} has none of the map's images (such as {known.images[0]}); give the folder with --images"
        )
    return views


@dataclass(frozen=True, slots=True)
class _Reader:
    """Pixels and mask of one image, read when they are asked for."""

    images: ImageSet
    instant: int
    camera: int

    def __call__(self) -> tuple[np.ndarray, np.ndarray | None]:
        return self.images.pixels(self.instant, self.camera), self.images.used(self.instant, self.camera)


def _flatten(
    vertices: np.ndarray, faces: np.ndarray, options: TextureOptions, progress: Progress
) -> atlas.FlattenedMesh:
    return atlas.flatten(vertices, faces, most_faces=options.faces, size=options.size, progress=progress)
