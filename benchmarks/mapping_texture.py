"""The textured mesh of a map of the rendered room against its true paint, beside the vertex colours of the same map."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

import mapping_whole
import numpy as np
import open3d
import report
import trimesh
from numpy.typing import NDArray
from report import Row, row

import mapping
from flight import FloatArray, frames
from goshawk import _rendering
from goshawk.rendered import scene as rendered_room
from goshawk.rendered import world as rendered_world
from mapping.dense import mesh_file
from mapping.texturing import FILE

Levels = Callable[[NDArray[np.int64], FloatArray], FloatArray]

VIEWS = 6


def texture(work: Path, pairs: int) -> list[Row]:
    """`goshawk map build` and `goshawk map texture` on the furnished room, compared at views beside the path."""
    flight = rendered_world.loop_flight(pairs)
    images = rendered_world.write_rendered_sequence(work / "images", flight=flight)
    mapping_whole.command("map", "build", images, "--camera", images / "camera.toml", "--out", work / "map")
    cost = mapping_whole.command("map", "texture", work / "map")
    made = mapping.open_map(work / "map")
    true = flight.T_world_body[[int(Path(name).stem) for name in made.images]]
    return compare(made, mapping_whole.aligned(made.T_world_body, true), pairs, cost)


def compare(made: mapping.Map, T_true_map: FloatArray, pairs: int, cost: mapping_whole.Cost) -> list[Row]:
    """Mean error in grey levels, each view up to the one brightness that all its pixels share."""
    beside = mapping_whole.beside(rendered_world.loop_flight(4 * VIEWS)).T_world_body
    camera = rendered_world.default_rig()["front"]
    plain, painted = _with_vertex_colours(made.folder), _with_texture(made.folder)
    errors: dict[str, list[float]] = {"vertex colours": [], "texture": []}
    for T_world_body in beside:
        T = T_world_body @ camera.T_body_camera
        rays = camera.unproject(camera.pixel_centres())[::2, ::2]
        truth = _true_colours(T, rays)
        T_map = frames.invert(T_true_map) @ T
        for name, mesh in (("vertex colours", plain), ("texture", painted)):
            errors[name].append(_error(mesh, T_map, rays, truth))
    mean = {name: float(np.mean(values)) for name, values in errors.items()}
    name = f"texture, room, {pairs} pairs"
    share = mean["texture"] / mean["vertex colours"]
    rows = [
        row(
            f"{name}: mean error of 255 grey levels",
            mean["texture"],
            "",
            peers={"vertex colours": mean["vertex colours"]},
        ),
        row(
            f"{name}: error over that of vertex colours",
            share,
            "",
            "< 1",
            share < 1.0,
        ),
        row(f"{name}: CPU", cost.cpu_s, "s"),
    ]
    report.print_table(rows)
    return rows


def _true_colours(T_world_camera: FloatArray, rays: FloatArray) -> FloatArray:
    """(h, w) without noise, vignetting and exposure jumps; NaN where no light arrives."""
    lit = np.isfinite(rays[..., 2])
    scene = rendered_room.furnished()
    tables = scene.solid_table(), scene.material_table(), rendered_room.LAMPS_WORLD_M
    asked = np.ascontiguousarray(np.where(lit[..., None], rays, [0.0, 0.0, 1.0]))
    pose = np.ascontiguousarray(T_world_camera)
    seen = _rendering.render(*tables, asked, pose, rendered_world.GAIN, 0.0, 0.0, 0, rendered_world.THREADS)
    return np.where(lit, seen.astype(float), np.nan)


class _Mesh:
    """Triangles, and a function from faces (n,) and barycentric coordinates (n, 3) to grey levels (n,)."""

    def __init__(self, vertices: FloatArray, faces: NDArray[np.int64], levels: Levels) -> None:
        self.levels = levels
        self._tensor = cast(Any, open3d.core.Tensor)
        self._scene = open3d.t.geometry.RaycastingScene()
        self._scene.add_triangles(self._tensor(vertices.astype(np.float32)), self._tensor(faces.astype(np.uint32)))

    def seen(self, T_world_camera: FloatArray, rays: FloatArray) -> FloatArray:
        """(n,) grey levels along rays (n, 3) of the camera's frame; NaN where they meet nothing."""
        directions = rays @ T_world_camera[:3, :3].T
        asked = np.column_stack([np.broadcast_to(T_world_camera[:3, 3], directions.shape), directions])
        found = self._scene.cast_rays(self._tensor(asked.astype(np.float32)))
        hit = np.isfinite(found["t_hit"].numpy())
        second, third = found["primitive_uvs"].numpy()[hit].T
        levels = np.full(len(rays), np.nan)
        share = np.stack([1.0 - second - third, second, third], axis=1)
        levels[hit] = self.levels(found["primitive_ids"].numpy()[hit].astype(np.int64), share)
        return levels


def _with_vertex_colours(folder: Path) -> _Mesh:
    vertices, faces, colours = mesh_file.load(folder / "mesh.ply")
    grey = colours.mean(axis=1)
    return _Mesh(vertices, faces.astype(np.int64), lambda face, share: (share * grey[faces[face]]).sum(axis=1))


def _with_texture(folder: Path) -> _Mesh:
    loaded: Any = trimesh.load(folder / FILE, force="mesh", process=False)
    x, y, z = np.asarray(loaded.vertices).T  # glTF's axes: x, z, -y of the world
    faces, uv = np.asarray(loaded.faces), np.asarray(loaded.visual.uv)
    grey = np.asarray(loaded.visual.material.baseColorTexture.convert("RGB")).mean(axis=2)
    height, width = grey.shape

    def levels(face: NDArray[np.int64], share: FloatArray) -> FloatArray:
        u, v = np.einsum("nk,nkc->cn", share, uv[faces[face]])  # trimesh has v upwards
        line, column = ((1.0 - v) * height).astype(int), (u * width).astype(int)
        return grey[np.clip(line, 0, height - 1), np.clip(column, 0, width - 1)]

    return _Mesh(np.stack([x, -z, y], axis=1), faces, levels)


def _error(mesh: _Mesh, T_map_camera: FloatArray, rays: FloatArray, truth: FloatArray) -> float:
    lit = np.isfinite(truth)
    found, true = mesh.seen(T_map_camera, rays[lit]), truth[lit]
    hit = np.isfinite(found)
    brightness = np.median(true[hit] / np.maximum(found[hit], 1.0))
    return float(np.abs(brightness * found[hit] - true[hit]).mean())
