"""Meshes of other programs: triangles in metres with z up, from a file that often states neither unit nor axes."""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flight import FloatArray, FormatError, InputError, errors, file_format
from mapping import reach
from mapping.dense import mesh_file, usd_file
from mapping.dense.usd_file import Stated
from mapping.map_folder import Map
from mapping.sparse import alignment

SUFFIXES = (".ply", ".obj", ".stl", ".glb", *usd_file.SUFFIXES)
UNITS_M = {"m": 1.0, "mm": 0.001, "cm": 0.01, "ft": 0.3048}
LARGEST_BYTES = 2_000_000_000
"""Reading takes several times as much memory."""
GREY = 180
"""Of a mesh without colours."""
EXTENT_M = (0.5, 1000.0)
"""Of the longest edge of the box about a place to fly in."""
APART_M = 2.0
"""Between parts of a mesh that may be several maps: rooms of one building are nearer, through a wall."""
_MOST_PARTS = 2000
_CERTAINLY_M, _CERTAINLY_MM = (1.0, 200.0), (1000.0, 300_000.0)
"""Extents in the file's numbers from which its unit is guessed; between them are centimetres, feet or metres."""
COARSEST_M = 0.001
"""Between neighbouring coordinates of a file: 0.5 m in single precision at those of a national grid."""
_SINGLE_PLY = re.compile(rb"property\s+float(32)?\s+[xyz]\s")
_HEAD_BYTES = 65_536
_METRES = {".glb": "glTF", ".e57": "E57"}
"""Kinds of file that are in metres, and what says so."""
_OTHERS = {
    ".nvdb": "of NanoVDB make an OpenVDB file, by nanovdb_convert say",
    ".nvblx": "save nvblox' mesh as PLY: its save_ply service writes it",
}
"""What to do about kinds of file that are known and not read."""
_AXES = {sign + name: (-1.0 if sign else 1.0) * np.eye(3)[k] for sign in ("", "-") for k, name in enumerate("xyz")}


@dataclass(frozen=True, slots=True, eq=False)
class ForeignMesh:
    """Triangles of another program."""

    vertices_world_m: FloatArray
    """(v, 3) with z up; vertices at one place are one."""
    faces: NDArray[np.int32]
    """(f, 3)."""
    unit: str
    """Of `UNITS_M`, and why."""
    up: str
    """The direction in the file, and why."""
    open_edges: int
    """Edges of one triangle alone: the rims of holes."""


def read(
    path: Path, *, unit: str | None = None, up: str | None = None, origin: FloatArray | None = None
) -> ForeignMesh:
    """Read a PLY, OBJ, STL, GLB or USD file.

    Args:
        unit: one of `UNITS_M`; None: guessed from the extent.
        up: an axis like `y` or `-z`, or `X,Y,Z`; None: guessed from the type of file.
        origin: (3,) in the file's numbers, what becomes the origin of the map's frame; None: the file's own.

    Raises:
        InputError: there is no such file, it is of another type or too large, or the unit cannot be right.
        FormatError: it cannot be read, holds no triangles, or a coordinate is not finite.
    """
    vertices, faces, step, stated = _triangles(path)
    R_world_file, up_because = rotation(path, up, stated=stated.up if stated else None)
    extent = float(np.ptp(vertices, axis=0).max())
    unit_m, unit_because = scale(path, extent, unit, stated_m=stated.unit_m if stated else None)
    require_fine(path, unit_m * step)
    remedy = origin_remedy(vertices[0])
    vertices = unit_m * (vertices if origin is None else vertices - origin) @ R_world_file.T
    reach.require_near_origin(vertices, str(path), remedy)
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    open_edges = int((np.unique(edges, axis=0, return_counts=True)[1] == 1).sum())
    return ForeignMesh(vertices, faces, unit_because, up_because, open_edges)


def parts(mesh: ForeignMesh) -> int:
    """How many there are that lie more than `APART_M` from each other, by their boxes; small fragments do not count."""
    from mapping import connected

    faces, count = mesh.faces, len(mesh.vertices_world_m)
    label = connected.groups(faces[:, [0, 1]].ravel(), faces[:, [1, 2]].ravel(), count)
    low, high = np.full((label.max() + 1, 3), np.inf), np.full((label.max() + 1, 3), -np.inf)
    np.minimum.at(low, label, mesh.vertices_world_m)
    np.maximum.at(high, label, mesh.vertices_world_m)
    large = (high - low).max(axis=1) >= EXTENT_M[0]
    low, high = low[large][:_MOST_PARTS], high[large][:_MOST_PARTS]
    is_near = (low[:, None] - high[None] <= APART_M).all(axis=2)
    first, second = np.nonzero(is_near & is_near.T)
    return int(connected.groups(first, second, len(low)).max(initial=0)) + 1


def require_fine(path: Path, step_m: float) -> None:
    """
    Raises:
        InputError: the file's coordinates are too far apart, as `reach.single_step` tells.
    """
    if step_m > COARSEST_M:
        raise InputError(
            f"{path} stores single precision: its coordinates are {step_m:.3g} m apart, at most {COARSEST_M:g} m may "
            "be; subtract the offset where it was exported, in double"
        )


def origin_remedy(place: FloatArray) -> str:
    """What to do about a file far from its origin, with one of its places (3,) in its numbers."""
    x, y, z = np.round(place, -1).tolist()
    return f"give --origin {x:.0f},{y:.0f},{z:.0f}, the place in its numbers that becomes the map's origin"


def of_map(area: Map) -> tuple[FloatArray, NDArray[np.int32], NDArray[np.uint8]]:
    """Vertices (v, 3), faces (f, 3) and colours (v, 3) of a map's mesh.

    Raises:
        InputError, FormatError: it is missing or damaged.
    """
    if (area.folder / "mesh.ply").is_file():
        return mesh_file.load(area.folder / "mesh.ply")
    mesh = read(area.mesh)
    return mesh.vertices_world_m, mesh.faces, np.full((len(mesh.vertices_world_m), 3), GREY, np.uint8)


def _triangles(path: Path) -> tuple[FloatArray, NDArray[np.int32], float, Stated | None]:
    """Vertices (v, 3) in the file's numbers and axes, merged where they coincide, and faces (f, 3).

    Returns:
        With the distance between neighbouring numbers where the file stores single precision, else 0; and what the file
        states of itself.
    """
    kind = path.suffix.lower()
    if kind not in SUFFIXES:
        remedy = _OTHERS.get(kind, "convert it, with MeshLab or Blender say")
        raise InputError(f"{path} is not one of {', '.join(SUFFIXES)}; {remedy}")
    if not path.is_file():
        raise errors.missing(path)
    if (size := path.stat().st_size) > LARGEST_BYTES:
        raise InputError(
            f"{path} has {size / 1e9:.1f} GB, at most {LARGEST_BYTES / 1e9:g} GB are read: reduce its triangles, with "
            "MeshLab say; details smaller than a voxel are lost anyway"
        )
    stated = None
    if kind in usd_file.SUFFIXES:
        vertices, faces, step, stated = usd_file.read(path)
    else:
        vertices, faces, step = _by_trimesh(path)
    if not len(faces):
        raise FormatError(
            f"{path} holds {len(vertices)} points and no triangles: make a mesh of them first, with MeshLab say"
        )
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise FormatError(f"{path} is damaged: a triangle names a vertex that is not there; export it again")
    if count := int((~np.isfinite(vertices).all(axis=1)).sum()):
        raise FormatError(f"{path}: {count} of {len(vertices)} vertices are not finite; remove them, with MeshLab say")
    merged, renamed = np.unique(vertices, axis=0, return_inverse=True)
    return merged, renamed.reshape(-1)[faces].astype(np.int32), step, stated


def _by_trimesh(path: Path) -> tuple[FloatArray, NDArray[np.int64], float]:
    """Vertices (v, 3), faces (f, 3), and how far apart numbers of single precision are."""
    import trimesh

    try:
        scene: Any = trimesh.load_scene(path, file_type=path.suffix.lower()[1:], process=False)
        soup: Any = scene.to_geometry()
        vertices = np.asarray(soup.vertices, dtype=np.float64).reshape(-1, 3)
        faces = np.asarray(getattr(soup, "faces", ()), dtype=np.int64).reshape(-1, 3)
    except Exception as error:  # the reader of foreign files raises what it likes
        raise FormatError(f"{path} cannot be read: {file_format.damage_text(error)}; export it again") from error
    return vertices, faces, _step(path, scene) if len(faces) else 0.0


def _step(path: Path, scene: Any) -> float:
    """The largest `reach.single_step` of the parts, before a GLB's own transforms of them, in the whole's numbers."""
    if path.suffix.lower() == ".obj" or (path.suffix.lower() == ".ply" and not _SINGLE_PLY.search(_head(path))):
        return 0.0
    steps = [0.0]
    for node in scene.graph.nodes_geometry:
        T, name = scene.graph[node]
        steps.append(reach.single_step(scene.geometry[name].vertices) * float(np.cbrt(abs(np.linalg.det(T[:3, :3])))))
    return max(steps)


def _head(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(_HEAD_BYTES).split(b"end_header", 1)[0]


def rotation(path: Path, up: str | None, *, stated: str | None = None) -> tuple[FloatArray, str]:
    """R_world_file (3, 3), and the words for it.

    Raises:
        InputError: `up` is no direction.
    """
    if up is not None:
        return alignment.upright(_direction(up)).round(15), f"{up}, as given"
    if stated is not None:
        return alignment.upright(_AXES[stated]).round(15), f"{stated} (USD's upAxis)"
    kind = path.suffix.lower()
    axis = "y" if kind in (".glb", ".obj", *usd_file.SUFFIXES) else "z"
    if kind in usd_file.SUFFIXES:
        why = "Pixar's rule; the file does not say; else give --up"
    else:
        why = "glTF's rule" if kind == ".glb" else f"guessed, as most {kind[1:].upper()} files; else give --up"
    return alignment.upright(_AXES[axis]).round(15), f"{axis} ({why})"


def _direction(up: str) -> FloatArray:
    if up in _AXES:
        return _AXES[up]
    try:
        direction = np.array([float(part) for part in up.split(",")])
    except ValueError:
        direction = np.zeros(0)
    if direction.shape != (3,) or not 1e-6 < float(np.linalg.norm(direction)) < np.inf:
        raise InputError(f"--up {up!r} is neither one of {', '.join(_AXES)} nor a direction X,Y,Z")
    return direction / np.linalg.norm(direction)


def scale(
    path: Path, extent: float, unit: str | None, *, given: str = "as given", stated_m: float | None = None
) -> tuple[float, str]:
    """Metres of the file's unit, and the words for it; `given` says from where one is known.

    Args:
        stated_m: metres of a unit, as the file states it.

    Raises:
        InputError: it cannot be guessed from the extent in the file's numbers, or a map would not be that large.
    """
    if unit is None and stated_m is not None:
        return _possible(path, extent, f"units of {stated_m:g} m", stated_m), f"{stated_m:g} m (USD's metersPerUnit)"
    if unit is None and path.suffix.lower() in _METRES:
        unit, why = "m", f"{_METRES[path.suffix.lower()]}'s rule"
    elif unit is not None:
        why = given
    elif _CERTAINLY_M[0] <= extent <= _CERTAINLY_M[1]:
        unit, why = "m", f"guessed from an extent of {extent:.4g}; else give --unit"
    elif _CERTAINLY_MM[0] <= extent <= _CERTAINLY_MM[1]:
        unit, why = "mm", f"guessed from an extent of {extent:.4g}; else give --unit"
    else:
        raise InputError(
            f"{path} is {extent:.4g} long, from which its unit cannot be guessed; give --unit {'|'.join(UNITS_M)}"
        )
    return _possible(path, extent, unit, UNITS_M[unit]), f"{unit} ({why})"


def _possible(path: Path, extent: float, unit: str, unit_m: float) -> float:
    """`unit_m`.

    Raises:
        InputError: a map would not be that large.
    """
    if not EXTENT_M[0] <= extent * unit_m <= EXTENT_M[1]:
        raise InputError(
            f"{path} would be {extent * unit_m:.4g} m long with its {extent:.4g} in {unit}; a map has {EXTENT_M[0]:g} "
            f"to {EXTENT_M[1]:g} m: give another --unit, or cut it"
        )
    return unit_m
