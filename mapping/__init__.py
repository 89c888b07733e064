"""From fisheye images to a metric map (poses, surfaces, free space), and relocalization in it."""

from flight import Progress, silent
from mapping import localization, rig
from mapping.alignment import Length
from mapping.colmap import SparseOptions
from mapping.dense import DenseOptions
from mapping.images import ImageSet, read_folder
from mapping.localization import Localization, LocalizationOptions
from mapping.map_folder import Map, MapOptions, MapReport, build_map, open_map, read_poses, write_poses
from mapping.rig import Camera, Rig
from mapping.sparse import SparseMap

__all__ = [
    "Camera",
    "DenseOptions",
    "ImageSet",
    "Length",
    "Localization",
    "LocalizationOptions",
    "Map",
    "MapOptions",
    "MapReport",
    "Rig",
    "SparseMap",
    "SparseOptions",
    "build_map",
    "localization",
    "localize",
    "open_map",
    "read_folder",
    "read_poses",
    "rig",
    "write_poses",
]


def localize(
    known: Map, images: ImageSet, *, options: LocalizationOptions | None = None, progress: Progress = silent
) -> Localization:
    """Poses of new images in a map; see `localization.localize`."""
    return localization.localize(known.localization_map(), images, options=options, progress=progress)
