"""From fisheye images to a metric map (poses, surfaces, free space), and relocalization in it."""

from pathlib import Path

from flight import Progress, silent
from mapping.camera import rig
from mapping.camera.rig import Camera, Rig
from mapping.dense.surface import DenseOptions
from mapping.input.depth_images import DepthFolder
from mapping.input.examination import Examination, examine
from mapping.input.images import ImageSet, read_folder
from mapping.input.selection import SelectionOptions
from mapping.localization import changes, relocalization
from mapping.localization.changes import ChangedRegion, Changes
from mapping.localization.relocalization import Localization, LocalizationOptions
from mapping.map_figures import MapReport
from mapping.map_folder import Map, MapOptions, build_map, open_map
from mapping.poses_file import read_poses, write_poses
from mapping.sparse.alignment import Length
from mapping.sparse.features.feature_files import FeatureFiles
from mapping.sparse.mapper.colmap import SparseOptions
from mapping.sparse.reconstruction import SparseMap

__all__ = [
    "Camera",
    "ChangedRegion",
    "Changes",
    "DenseOptions",
    "DepthFolder",
    "Examination",
    "ImageSet",
    "Length",
    "Localization",
    "LocalizationOptions",
    "Map",
    "MapOptions",
    "MapReport",
    "Rig",
    "SelectionOptions",
    "SparseMap",
    "SparseOptions",
    "build_map",
    "examine",
    "find_changes",
    "localize",
    "open_map",
    "read_folder",
    "read_poses",
    "rig",
    "write_poses",
]


def localize(
    known: Map,
    images: ImageSet,
    *,
    options: LocalizationOptions | None = None,
    keep: Path | None = None,
    progress: Progress = silent,
) -> Localization:
    """Poses of new images in a map; see `localization.relocalization.localize`."""
    return relocalization.localize(known.localization_map(), images, options=options, keep=keep, progress=progress)


def find_changes(
    known: Map, images: ImageSet, kept: Path, answer: Localization, *, progress: Progress = silent
) -> Changes:
    """The parts of a map that look different in images that were found in it; see `localization.changes.find`.

    Args:
        kept: the folder that `localize` was given to keep the images' features in.
    """
    placed, found = (known.rig, known.T_world_body), FeatureFiles(kept)
    return changes.find(known.localization_map(), known.field, placed, images, found, answer, progress=progress)
