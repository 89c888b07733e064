"""The mesh of a map in other programs' formats, and its vertices as points with their standard deviations."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from esdf import exchange
from flight import FloatArray
from mapping.dense import mesh_file, usd_file

UP = {".ply": "z", ".stl": "z", ".obj": "y", ".glb": "y", usd_file.WRITTEN: "z"}
"""Of each kind of file, as most programs read it."""
_RGB = ("red", "green", "blue")


def mesh(kind: str, vertices_world_m: FloatArray, faces: NDArray[np.int32], colours: NDArray[np.uint8]) -> bytes:
    """A file's bytes, with the axis `UP[kind]` up.

    Args:
        kind: of `UP`; an STL file holds no colours.
    """
    import trimesh

    if kind == ".ply":
        return mesh_file.ply(vertices_world_m, faces, colours)
    if kind == usd_file.WRITTEN:
        return usd_file.encode(vertices_world_m, faces, colours)
    vertices = vertices_world_m @ mesh_file.R_GLTF_WORLD.T if UP[kind] == "y" else vertices_world_m
    whole = trimesh.Trimesh(vertices, faces, vertex_colors=colours, process=False)
    data = whole.export(file_type=kind[1:])
    return data.encode() if isinstance(data, str) else bytes(data)  # pyright: ignore[reportArgumentType]


def points(vertices_world_m: FloatArray, colours: NDArray[np.uint8], deviation_m: NDArray[np.float32]) -> bytes:
    """A PLY file's bytes of points alone: x, y, z, red, green, blue, std (metres along the normal, NaN: not known)."""
    return _rows(
        dict(zip("xyz", vertices_world_m.T, strict=True))
        | dict(zip(_RGB, colours.T, strict=True))
        | {"std": deviation_m}
    )


def distances(centres_world_m: FloatArray, distance_m: FloatArray) -> bytes:
    """A PLY file's bytes of places (n, 3) with their distance (m) to a surface as `intensity`, as nvblox' ESDF."""
    columns = dict(zip("xyz", centres_world_m.T, strict=True)) | {"intensity": distance_m.astype(np.float32)}
    return _rows(columns, f"{exchange.PLY_COMMENT}\n")


def _rows(columns: Mapping[str, NDArray[Any]], comment: str = "") -> bytes:
    """A PLY file's bytes of points with these columns: double, float or unsigned char."""
    named = {"<f8": "double", "|u1": "uchar", "<f4": "float"}
    count = len(next(iter(columns.values())))
    rows = np.zeros(count, [(name, values.dtype) for name, values in columns.items()])
    for name, values in columns.items():
        rows[name] = values
    properties = "".join(f"property {named[values.dtype.str]} {name}\n" for name, values in columns.items())
    head = f"ply\nformat binary_little_endian 1.0\n{comment}element vertex {len(rows)}\n{properties}end_header\n"
    return head.encode() + rows.tobytes()


def colours_at(
    points_world_m: FloatArray, vertices_world_m: FloatArray, colours: NDArray[np.uint8], within_m: float, other: int
) -> NDArray[np.uint8]:
    """(m, 3) of the nearest vertex; the grey `other` where none is so near."""
    from scipy.spatial import KDTree

    result = np.full((len(points_world_m), 3), other, np.uint8)
    if len(vertices_world_m):
        far_m, found = KDTree(vertices_world_m).query(points_world_m, distance_upper_bound=within_m)
        near, nearest = np.isfinite(far_m), np.asarray(found)
        result[near] = colours[nearest[near]]
    return result
