"""Triangle meshes with vertex colours as files: GLB for viewers, PLY for everything else.

Coordinates are the world's in both: metres, z up. (glTF's y is up, so other viewers show the room on its side; our
own page and the map folder use the world's axes instead.)
"""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flight import FloatArray, FormatError, InputError, file_format

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


def load(path: Path) -> tuple[FloatArray, NDArray[np.int32], NDArray[np.uint8]]:
    """Vertices (v, 3), faces (f, 3) and colours (v, 3) of a mesh that `save` wrote as PLY.

    Raises:
        InputError: there is none.
        FormatError: it is damaged.
    """
    import trimesh

    if not path.is_file():
        raise InputError(f"{path} is missing; build the map again")
    try:
        mesh: Any = trimesh.load(path, process=False)
        vertices = np.asarray(mesh.vertices, dtype=np.float64).reshape(-1, 3)
        faces = np.asarray(mesh.faces, dtype=np.int32).reshape(-1, 3)
        colours = np.asarray(mesh.visual.vertex_colors, dtype=np.uint8)[:, :3]
    except Exception as error:  # the reader of foreign files raises what it likes
        raise FormatError(f"{path} is damaged: {file_format.damage_text(error)}") from error
    whole = len(colours) == len(vertices) and np.isfinite(vertices).all()
    if not whole or (faces < 0).any() or (faces >= len(vertices)).any():
        raise FormatError(f"{path} is damaged: faces, vertices and colours do not fit; build the map again")
    return vertices, faces, colours
