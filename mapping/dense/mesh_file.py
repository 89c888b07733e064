"""Triangle meshes as files: with vertex colours as GLB for our page and PLY for everything else, with a texture as GLB.

Coordinates with vertex colours are the world's: metres, z up, on which our own page and the map folder rely. glTF's y
is up: a node about the mesh turns it, so that viewers show the room upright. A textured mesh is for viewers alone, and
has glTF's axes.
"""

import io
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flight import FloatArray, FormatError, InputError, file_format

SUFFIXES = (".glb", ".ply")
R_GLTF_WORLD = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
"""glTF's y is the world's z (up), its z the world's -y."""
WORLD_NODE = "goshawk_world"
"""Node of a GLB file in whose frame coordinates are the world's; files of earlier versions have none, and no other."""
_JPEG_QUALITY = 92


def save(path: Path, vertices_world_m: FloatArray, faces: NDArray[np.int32], colours: NDArray[np.uint8]) -> None:
    """Write a mesh; the suffix determines the format. `colours` (n, 3) RGB."""
    import trimesh

    if Path(path).suffix not in SUFFIXES:
        raise InputError(f"{path}: a mesh is written as one of {', '.join(SUFFIXES)}")
    if Path(path).suffix == ".ply":
        file_format.write_bytes(Path(path), ply(vertices_world_m, faces, colours))
        return
    mesh = trimesh.Trimesh(vertices_world_m, faces, vertex_colors=colours, process=False)
    T_gltf_world = np.eye(4)
    T_gltf_world[:3, :3] = R_GLTF_WORLD
    upright = trimesh.Scene()
    upright.add_geometry(mesh, node_name=WORLD_NODE, transform=T_gltf_world)
    data = upright.export(file_type="glb")
    assert isinstance(data, bytes)
    file_format.write_bytes(Path(path), data)


def ply(vertices_world_m: FloatArray, faces: NDArray[np.int32], colours: NDArray[np.uint8]) -> bytes:
    """A mesh as a PLY file's bytes."""
    import trimesh

    mesh = trimesh.Trimesh(vertices_world_m, faces, vertex_colors=colours, process=False)
    data = mesh.export(file_type="ply")
    assert isinstance(data, bytes)
    return data


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


def save_textured(
    path: Path, vertices_world_m: FloatArray, faces: NDArray[np.int32], uv: FloatArray, texture: NDArray[np.uint8]
) -> None:
    """Write a textured mesh as GLB, upright (y up) and unlit: the images hold the light already.

    Args:
        uv: (v, 2) texture coordinates, v down from the first row.
        texture: (size, size, 3) RGB.
    """
    import trimesh
    from PIL import Image
    from trimesh.exchange.gltf import export_glb
    from trimesh.visual import TextureVisuals
    from trimesh.visual.material import PBRMaterial

    coded = io.BytesIO()
    Image.fromarray(texture).save(coded, format="JPEG", quality=_JPEG_QUALITY)
    material = PBRMaterial(baseColorTexture=Image.open(coded), metallicFactor=0.0, roughnessFactor=1.0)
    from_below = uv * [1.0, -1.0] + [0.0, 1.0]  # trimesh counts v from the last row
    visual = TextureVisuals(uv=from_below, material=material)
    mesh = trimesh.Trimesh(vertices_world_m @ R_GLTF_WORLD.T, faces, visual=visual, process=False)
    data = export_glb(trimesh.Scene(mesh), tree_postprocessor=_unlit)
    file_format.write_bytes(Path(path), data)


def _unlit(tree: dict[str, Any]) -> None:
    tree["extensionsUsed"] = ["KHR_materials_unlit"]
    for material in tree["materials"]:
        material["extensions"] = {"KHR_materials_unlit": {}}
