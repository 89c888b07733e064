"""Triangle meshes with vertex colours as files: GLB for viewers, PLY for everything else.

Coordinates are the world's in both: metres, z up. (glTF's y is up, so other viewers show the room on its side; our
own page and the map folder use the world's axes instead.)
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flight import FloatArray, InputError, file_format

SUFFIXES = (".glb", ".ply")


def save(path: Path, vertices_world_m: FloatArray, faces: NDArray[np.int32], colours: NDArray[np.uint8]) -> None:
    """Write a mesh; the suffix determines the format. `colours` (n, 3) RGB."""
    import trimesh

    if Path(path).suffix not in SUFFIXES:
        raise InputError(f"{path}: a mesh is written as one of {', '.join(SUFFIXES)}")
    mesh = trimesh.Trimesh(vertices_world_m, faces, vertex_colors=colours, process=False)
    data = mesh.export(file_type=Path(path).suffix[1:])
    assert isinstance(data, bytes)
    file_format.write_bytes(Path(path), data)
