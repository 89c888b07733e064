"""The map's mesh as the 3D view shows it: tiles with levels of detail, and ambient occlusion in their colours.

It is made once per map, in a process of its own, since reading and simplifying a million triangles takes more memory
than all the rest of the station; the result is kept in the project's `.session`.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flight import FloatArray, MapError, Progress, silent
from gcs_web.map.prepared import load_or_make
from gcs_web.scene import tiles
from gcs_web.scene.tiles import Tile, Tiles
from mapping.dense.mesh_file import WORLD_NODE

DISPLAY_TRIANGLES = 60_000
"""Of all coarse tiles, so that the first picture is 2 MB with the page; the map is not changed."""
FINE_RATIO = 8
"""So many times as many triangles of the fine level does a browser get at the most: 10 MB."""
TILE_TRIANGLES = 30_000
"""Of a tile at the fine level, which is the mesh as it is."""
LEAST_TRIANGLES = 20
"""Of a coarse tile."""
PLAIN_TRIANGLES = (1_500, 6_000, 20_000)
"""Of the whole mesh, for browsers that draw slowly: without a graphics card two cores draw some 250,000 a second."""
_PART_TRIANGLES = 64
"""At least of a part that touches no other, for those browsers."""
CACHE = "display_mesh.npz"

_VERSION = 6
"""Of what is made: a cache of another one is made again."""
_OVERLAP = 2.0
"""Of tiles, in typical edges of the mesh: neighbours are simplified apart, and would leave cracks."""
_DARKENED = 0.95
"""Share of the mesh's brightness that is shown: the path must stand out from it."""
_MATT = 0.65
"""Share of the light that a matt surface returns: more would outshine the path."""
_PLAIN = 0.6
"""Brightness of a mesh that has no colours of its own."""
_RAYS, _REACH_M, _OFF_M = 48, 1.2, 0.02
"""Rays from each vertex into the half space before it; what they meet within this distance takes light; where they
begin, off the surface."""
_DARKEST = 0.3
"""Brightness that is left where all rays meet something."""
_RAYS_AT_ONCE = 500_000
_NEIGHBOURS = 4
"""Vertices of the coarse level whose light is averaged for one of the fine level."""


@dataclass(frozen=True, slots=True, eq=False)
class Mesh:
    """Triangles with coloured vertices, in single precision: what is shown needs no more."""

    vertices_m: np.ndarray
    """(n, 3) float32, world."""
    faces: np.ndarray
    """(m, 3) int32."""
    colours: np.ndarray
    """(n, 3) uint8."""

    def part(self, faces: np.ndarray) -> "Mesh":
        """Only these triangles, by their indices, and the vertices they need."""
        used, renamed = np.unique(self.faces[faces], return_inverse=True)
        return Mesh(self.vertices_m[used], renamed.reshape(-1, 3).astype(np.int32), self.colours[used])

    def glb(self) -> np.ndarray:
        """As bytes of a GLB file."""
        import trimesh

        mesh = trimesh.Trimesh(self.vertices_m, self.faces, vertex_colors=self.colours, process=False)
        data = mesh.export(file_type="glb", tree_postprocessor=_matt)
        assert isinstance(data, bytes)
        return np.frombuffer(data, dtype=np.uint8)


def _matt(tree: dict[str, Any]) -> None:
    """Without a material GLB means metal, which is black where nothing is mirrored in it: as on a slow machine."""
    dull = {"metallicFactor": 0.0, "roughnessFactor": 1.0, "baseColorFactor": [_MATT, _MATT, _MATT, 1.0]}
    tree["materials"] = [{"pbrMetallicRoughness": dull}]
    for mesh in tree["meshes"]:
        for part in mesh["primitives"]:
            part["material"] = 0


def load(path: Path, triangles: int, folder: Path, *, progress: Progress = silent) -> Tiles:
    """The mesh to show, from the cache in `folder` or made anew: levels of GLB bytes, and `vertices` (n, 3) and `faces`
    (m, 3) of the whole coarse level.

    Raises:
        MapError: the file holds no mesh that can be read.
    """
    key = _key(path, triangles)
    return load_or_make(folder / CACHE, key, path, _make, (path, triangles, key), progress)


def plain(shown: Tiles, triangles: int) -> np.ndarray:
    """Of the mesh to show, the whole in one piece of at most so many triangles, or the smallest there is: GLB."""
    fitting = [most for most in PLAIN_TRIANGLES if most <= triangles]
    return shown.array(f"plain_{max(fitting, default=min(PLAIN_TRIANGLES))}")


def read(path: Path) -> Mesh:
    """
    Raises:
        MapError: the file holds no mesh that can be read.
    """
    import trimesh

    try:
        scene = trimesh.load_scene(path, process=False)
        world = WORLD_NODE if WORLD_NODE in scene.graph.nodes else None
        placed = [scene.graph.get(node, frame_from=world) for node in scene.graph.nodes_geometry]
        parts = [_of_trimesh(scene.geometry[name], pose) for pose, name in placed]
    except Exception as error:  # trimesh raises whatever its parsers meet
        raise MapError(f"{path.name} cannot be read ({error}); build the map again") from error
    if not sum(len(part.faces) for part in parts):
        raise MapError(f"{path.name} holds no triangles; build the map again")
    mesh = joined(parts)
    if not np.isfinite(mesh.vertices_m).all():
        raise MapError(f"{path.name} holds vertices that are not finite; build the map again")
    return mesh


def simplified(mesh: Mesh, triangles: int) -> Mesh:
    """With at most so many triangles, by quadric decimation, if it has more."""
    import open3d

    if len(mesh.faces) <= triangles:
        return mesh
    full = open3d.geometry.TriangleMesh(
        open3d.utility.Vector3dVector(mesh.vertices_m.astype(np.float64)), open3d.utility.Vector3iVector(mesh.faces)
    )
    full.vertex_colors = open3d.utility.Vector3dVector(mesh.colours / 255.0)
    simple = full.simplify_quadric_decimation(triangles)
    colours = np.round(255.0 * np.asarray(simple.vertex_colors))
    return Mesh(
        np.asarray(simple.vertices).astype(np.float32),
        np.asarray(simple.triangles).astype(np.int32),
        colours.astype(np.uint8),
    )


def sparse(mesh: Mesh, triangles: int) -> Mesh:
    """`simplified`, but poles, wires and whatever else stands alone stay there as long as a half of the triangles is
    enough for them, the longest first: over the whole, few triangles would all go to the ground."""
    if len(mesh.faces) <= triangles:
        return mesh
    parts = _apart(mesh)
    share = triangles / len(mesh.faces)
    counts = np.array([len(part) for part in parts])
    wanted = np.minimum(counts, np.maximum(share * counts, _PART_TRIANGLES)).astype(int)
    extent_m = [np.ptp(mesh.vertices_m[mesh.faces[part]].reshape(-1, 3), axis=0).max() for part in parts]
    order = np.argsort(extent_m)[::-1]
    order = order[order != np.argmax(counts)]
    kept = order[np.cumsum(wanted[order]) <= triangles // 2]
    rest = np.concatenate([parts[k] for k in set(range(len(parts))) - set(kept.tolist())])
    alone = [simplified(mesh.part(parts[k]), int(wanted[k])) for k in kept]
    left = triangles - sum(len(part.faces) for part in alone)
    return joined([simplified(mesh.part(rest), left), *alone])


def _apart(mesh: Mesh) -> list[np.ndarray]:
    """Indices of the triangles of each part that touches no other."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    count, faces = len(mesh.vertices_m), mesh.faces
    edges = np.concatenate([faces[:, :2], faces[:, 1:]])
    graph = coo_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), (count, count))
    of_face = connected_components(graph, directed=False)[1][faces[:, 0]]
    order = np.argsort(of_face, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(of_face[order])) + 1)


def cut(mesh: Mesh) -> list[Mesh]:
    """Tiles of at most about `TILE_TRIANGLES`, which overlap a little."""
    corners = mesh.vertices_m[mesh.faces]
    edge_m = float(np.median(np.linalg.norm(corners[:, 0] - corners[:, 1], axis=1)))
    parts = tiles.split(corners.mean(axis=1), TILE_TRIANGLES, overlap_m=_OVERLAP * edge_m)
    return [mesh.part(part) for part in parts]


def light(vertices_m: FloatArray, normals: FloatArray, faces: np.ndarray, *, progress: Progress = silent) -> FloatArray:
    """Share of the sky that each vertex sees: ambient occlusion by rays, cosine-weighted, of limited reach.

    Args:
        vertices_m: (n, 3).
        normals: (n, 3), unit length.
        faces: (m, 3) indices.

    Returns:
        (n,) from 0 (all rays meet something near) to 1.
    """
    import open3d

    scene = open3d.t.geometry.RaycastingScene()
    scene.add_triangles(
        open3d.core.Tensor.from_numpy(vertices_m.astype(np.float32)),
        open3d.core.Tensor.from_numpy(faces.astype(np.uint32)),
    )
    sphere = np.random.default_rng(1).normal(size=(_RAYS, 3))
    sphere /= np.linalg.norm(sphere, axis=1, keepdims=True)
    open_share = np.empty(len(vertices_m))
    step = max(_RAYS_AT_ONCE // _RAYS, 1)
    for start in range(0, len(vertices_m), step):
        progress("shading the mesh", start / len(vertices_m))
        part = slice(start, start + step)
        direction = normals[part, None] + 0.98 * sphere  # a unit sphere on the normal's tip: cosine-weighted
        direction /= np.linalg.norm(direction, axis=2, keepdims=True)
        origin = np.broadcast_to((vertices_m + _OFF_M * normals)[part, None], direction.shape)
        rays = np.concatenate([origin, direction], axis=2).astype(np.float32)
        hit = scene.test_occlusions(open3d.core.Tensor.from_numpy(rays), tfar=_REACH_M).numpy()
        open_share[part] = 1.0 - hit.mean(axis=1)
    return open_share


def _make(folder: Path, asked: tuple[Path, int, str], progress: Progress) -> None:
    """In a process of its own: write the cache."""
    path, triangles, key = asked
    progress("reading the mesh", 0.0)
    fine = cut(read(path))
    share = min(triangles / sum(len(tile.faces) for tile in fine), 1.0)
    coarse = []
    for k, tile in enumerate(fine):
        progress("simplifying the mesh", k / len(fine))
        coarse.append(simplified(tile, max(int(share * len(tile.faces)), LEAST_TRIANGLES)))
    whole = joined(coarse)
    seen = light(whole.vertices_m, normals(whole), whole.faces, progress=progress)
    others = {"vertices": whole.vertices_m, "faces": whole.faces}
    for k, most in enumerate(PLAIN_TRIANGLES):
        progress("simplifying the mesh", k / len(PLAIN_TRIANGLES))
        others[f"plain_{most}"] = sparse(_shaded(whole, seen), most).glb()
    tiles.save(folder / CACHE, key, _tiles(fine, coarse, whole, seen), others)


def _tiles(fine: list[Mesh], coarse: list[Mesh], whole: Mesh, seen: FloatArray) -> Iterator[Tile]:
    """`seen`: the light of the coarse vertices, of which fine ones have that of those nearest to them."""
    from scipy.spatial import KDTree

    tree, begin = KDTree(whole.vertices_m), 0
    for full, simple in zip(fine, coarse, strict=True):
        shown = _shaded(simple, seen[begin : begin + len(simple.vertices_m)])
        begin += len(simple.vertices_m)
        near = None
        if len(simple.faces) < len(full.faces):
            near = tree.query(full.vertices_m, min(_NEIGHBOURS, len(seen)))[1].reshape(len(full.vertices_m), -1)
        yield Tile(
            full.vertices_m.min(axis=0),
            full.vertices_m.max(axis=0),
            shown.glb(),
            None if near is None else _shaded(full, seen[near].mean(axis=1)).glb(),
            len(full.faces),
        )


def joined(meshes: list[Mesh]) -> Mesh:
    begins = np.cumsum([0, *(len(mesh.vertices_m) for mesh in meshes[:-1])])
    return Mesh(
        np.concatenate([mesh.vertices_m for mesh in meshes]),
        np.concatenate([mesh.faces + begin for mesh, begin in zip(meshes, begins, strict=True)]).astype(np.int32),
        np.concatenate([mesh.colours for mesh in meshes]),
    )


def normals(mesh: Mesh) -> FloatArray:
    """(n, 3) at the vertices, unit length: means over their triangles, weighted by area; zero where there are none."""
    corners = mesh.vertices_m[mesh.faces].astype(np.float64)
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    total = np.zeros((len(mesh.vertices_m), 3))
    for corner in range(3):
        np.add.at(total, mesh.faces[:, corner], across)
    return total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-12)


def _of_trimesh(mesh: Any, T_world_mesh: FloatArray) -> Mesh:
    """`mesh`: of trimesh, whose types do not say what its visuals have."""
    vertices_m = mesh.vertices @ T_world_mesh[:3, :3].T + T_world_mesh[:3, 3]
    colours = np.full(vertices_m.shape, int(255 * _PLAIN), dtype=np.uint8)
    if mesh.visual.kind == "vertex":
        colours = np.asarray(mesh.visual.vertex_colors[:, :3], dtype=np.uint8)
    elif mesh.visual.kind == "texture":
        colours = _of_texture(mesh, colours)
    return Mesh(vertices_m.astype(np.float32), mesh.faces.astype(np.int32), colours)


def _of_texture(mesh: Any, plain: np.ndarray) -> np.ndarray:
    """Colours of the vertices by the texture, as fine as the mesh; `plain` where it has no picture with it."""
    try:
        found = np.asarray(mesh.visual.to_color().vertex_colors)[:, :3]
    except (AttributeError, ValueError, IndexError):
        return plain
    return found.astype(np.uint8) if found.shape == plain.shape else plain


def _shaded(mesh: Mesh, seen: FloatArray) -> Mesh:
    bright = _DARKENED * (_DARKEST + (1.0 - _DARKEST) * seen[:, None])
    return Mesh(mesh.vertices_m, mesh.faces, (bright * mesh.colours).astype(np.uint8))


def _key(path: Path, triangles: int) -> str:
    try:
        found = path.stat()
    except OSError as error:
        raise MapError(f"{path.name} cannot be read ({error.strerror}); build the map again") from error
    return f"{_VERSION} {found.st_mtime_ns} {found.st_size} {triangles}"
