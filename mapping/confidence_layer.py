"""The layer of a map that says how well each vertex of its mesh is known, see `mapping.dense.confidence`.

In the order of the vertices of `mesh.ply`. A map of an earlier version has none: nothing is known of its surface then.
"""

from pathlib import Path

import numpy as np

from flight import FormatError, file_format
from mapping.dense import confidence
from mapping.dense.confidence import SurfaceConfidence

VERSION = 1


def save(path: Path, known: SurfaceConfidence) -> None:
    """Write it as a compressed `.npz`; half precision, which is 0.1 % of a deviation."""
    deviation_m = known.deviation_m.astype(np.float16)
    file_format.write_arrays(path, version=VERSION, deviation_m=deviation_m, images=known.images)


def load(path: Path, vertices: int) -> SurfaceConfidence:
    """Read what `save` wrote, for a mesh of so many vertices; nothing is known where there is no file (earlier maps).

    Raises:
        FormatError: the file is damaged, newer, or of another mesh.
    """
    if not path.is_file():
        return confidence.unknown(vertices)
    fault = "a damaged layer of the surface's confidence"
    deviation_m, images = file_format.read_arrays(
        path, "deviation_m", "images", version=VERSION, fault=fault, remedy="build the map again"
    )
    if (deviation_m.dtype, images.dtype) != (np.float16, np.uint8) or not (
        deviation_m.shape == images.shape == (vertices,)
    ):
        raise FormatError(
            f"{path} holds {deviation_m.dtype} of shape {deviation_m.shape} and {images.dtype} of {images.shape}, "
            f"expected float16 and uint8 of ({vertices},), as the mesh; build the map again"
        )
    if not (np.isnan(deviation_m) | (deviation_m > 0.0)).all():
        raise FormatError(f"{path} holds a standard deviation that is not positive; build the map again")
    return SurfaceConfidence(deviation_m.astype(np.float32), images)
