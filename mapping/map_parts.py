"""A map's parts in memory, to make a new map of them: moved, cropped. The folder that they came from stays as it is.

The pilot's edits go along. The new map has a hash of its own, so what was planned in the old one must be planned anew.
"""

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import esdf
from esdf import Edit, Field
from esdf import moved as moving
from esdf.solids import Solid, covered_region
from esdf.storage import EDITS
from esdf.visibility import Visibility, save_visibility
from flight import FloatArray, FormatError, InputError, file_format, frames, results
from mapping import confidence_layer, given_paths, inferred_layer, map_folder, poses_file, reach
from mapping.camera import rig as rigs
from mapping.camera.rig import Rig
from mapping.dense import confidence as confidences
from mapping.dense import mesh_file, occupancy, resolution
from mapping.dense.confidence import SurfaceConfidence
from mapping.sparse import localization_map, tracks
from mapping.sparse.localization_map import LocalizationMap
from mapping.sparse.tracks import Tracks

MADE_OF = "figures_of"
"""Key of the `report.json` of a cropped map: the map whose scale, calibration and residuals it states."""
_COUNTED = ("images", "images_placed", "path_length_m", *confidences.FIGURES)
"""Facts that are those of the part in a cropped map."""
_OF_THE_WHOLE = ("unplaced_runs", "swept_occupied_m3", "resolved_m", "depth", "cpu_s")
HISTORY = "history"
"""Key of `map.toml`: how the map was made of others, a sentence a step."""


@dataclass(frozen=True, slots=True, eq=False)
class MapParts:
    """What a map folder holds."""

    name: str
    """Of its folder."""
    field: Field
    """As mapped, without edits."""
    edits: tuple[Edit, ...]
    """The pilot's."""
    vertices_world_m: FloatArray
    """(v, 3) of the mesh."""
    faces: np.ndarray
    """(f, 3) vertices."""
    colours: np.ndarray
    """(v, 3) uint8 RGB."""
    confidence: SurfaceConfidence
    """How well each vertex is known."""
    known: LocalizationMap
    """Points and descriptors."""
    rig: Rig
    """That took the images."""
    images: tuple[str, ...]
    """Names of the placed images."""
    time_s: FloatArray
    """(n,) NaN where unknown."""
    T_world_body: FloatArray
    """(n, 4, 4)."""
    seen: Visibility
    """The thinnest obstacle that the images resolve."""
    inferred: NDArray[np.bool_]
    """(nx, ny, nz) voxels of the field that a plain wall must pass through, see `inferred_layer`."""
    facts: dict[str, Any]
    """Of `map.toml`."""
    report: dict[str, Any] | None
    """Of the mapping run; None if there is none."""
    occupancy: NDArray[np.float16] | None = None
    """(nx, ny, nz) of the field, see `mapping.dense.occupancy`; None where it is not known."""
    tracks: Tracks = dataclasses.field(default_factory=tracks.none)
    """Where the images see the points."""


def read(folder: Path) -> MapParts:
    """The parts of a map folder.

    Raises:
        InputError: `folder` is not a map, or the map is refused or was imported.
        FormatError: a part of it is missing or damaged.
    """
    opened = map_folder.open_map(folder)
    opened.require_not_refused()
    opened.require_images()
    editor = esdf.open_editor(folder / "esdf")
    edits = editor.edits
    editor.replace(())
    vertices, faces, colours = mesh_file.load(folder / "mesh.ply")
    known = opened.localization_map()
    return MapParts(
        name=folder.resolve().name,
        field=editor.snapshot(),
        edits=edits,
        vertices_world_m=vertices,
        faces=faces,
        colours=colours,
        confidence=confidence_layer.load(folder / map_folder.CONFIDENCE, len(vertices)),
        known=known,
        rig=opened.rig,
        images=opened.images,
        time_s=opened.time_s,
        T_world_body=opened.T_world_body,
        seen=opened.visibility(),
        inferred=inferred_layer.load(folder / map_folder.INFERRED, opened.field.grid.shape),
        occupancy=occupancy.load(folder / occupancy.FILE, opened.field.grid.shape),
        tracks=tracks.load(folder / "localization", len(known.points_world_m), len(opened.images), len(opened.rig)),
        facts=opened.facts,
        report=map_folder.read_report(folder) or None,
    )


def write(out: Path, parts: MapParts, *, overwrite: bool = False) -> str:
    """Write a new map folder, whole or not at all; returns its hash, edits included.

    Raises:
        InputError: an earlier map is there and `overwrite` was not given, or something else is there.
    """
    results.require_free_folder(out, overwrite=overwrite, ours=map_folder.is_map)
    with results.new_folder(out, overwrite=overwrite, ours=map_folder.is_map) as placing:
        new = placing.temporary
        esdf.save(new / "esdf", parts.field)
        save_visibility(new / map_folder.VISIBILITY, parts.seen)
        inferred_layer.save(new / map_folder.INFERRED, parts.inferred)
        confidence_layer.save(new / map_folder.CONFIDENCE, parts.confidence)
        occupancy.save(new / occupancy.FILE, parts.occupancy)
        if parts.edits:
            esdf.save_edits(new / "esdf" / EDITS, parts.edits)
        for name in ("mesh.glb", "mesh.ply"):
            mesh_file.save(new / name, parts.vertices_world_m, parts.faces, parts.colours)
        localization_map.save(new / "localization", parts.known)
        tracks.save(new / "localization", parts.tracks)
        rigs.save(new / "camera.toml", parts.rig)
        poses_file.write_poses(new / "poses.csv", parts.images, parts.time_s, parts.T_world_body)
        if parts.report is not None:
            file_format.write_json(
                new / "report.json",
                format=map_folder.REPORT_FORMAT,
                version=map_folder.VERSION,
                body=_body(parts.report) | {"hash": parts.field.hash},
            )
        # of the mapping run, and this map is not what it would make
        of_the_run = ("inputs", given_paths.IMAGES, given_paths.MASKS)
        facts = {name: value for name, value in _body(parts.facts).items() if name not in of_the_run}
        file_format.write_toml(
            new / "map.toml",
            format=map_folder.FORMAT,
            version=map_folder.VERSION,
            body=facts | {"hash": parts.field.hash},
        )
        return map_folder.open_map(new).hash


def moved(parts: MapParts, T_new_old: FloatArray, sentence: str) -> MapParts:
    """The map in another frame.

    Args:
        T_new_old: (4, 4) rotation and translation; without a rotation the voxels stay exactly as they are.
        sentence: what was done, for the map's history.

    Raises:
        InputError: it is no rigid motion, leads too far from the origin, or would lean an upright edit.
    """
    R = T_new_old[:3, :3]
    if not np.isfinite(T_new_old).all() or np.abs(R @ R.T - np.eye(3)).max() > 1e-6 or np.linalg.det(R) < 0.0:
        raise InputError(f"a map is moved by a rotation and a translation, not by {np.round(T_new_old, 3).tolist()}")
    vertices = frames.apply(T_new_old, parts.vertices_world_m)
    reach.require_near_origin(vertices, f"the moved map {parts.name}")
    field = moving.moved_field(parts.field, T_new_old)
    return dataclasses.replace(
        parts,
        field=field,
        edits=moving.moved_edits(parts.edits, T_new_old, field.grid),
        vertices_world_m=vertices,
        known=dataclasses.replace(parts.known, points_world_m=frames.apply(T_new_old, parts.known.points_world_m)),
        T_world_body=T_new_old @ parts.T_world_body,
        seen=resolution.moved(parts.seen, T_new_old, field.grid),
        inferred=inferred_layer.moved(parts.inferred, parts.field, T_new_old, field),
        occupancy=None if parts.occupancy is None else occupancy.moved(parts.occupancy, parts.field, T_new_old, field),
        facts=noted(parts, sentence),
    )


def cropped(parts: MapParts, kept: Solid, sentence: str) -> MapParts:
    """The part of a map inside a solid: what is outside becomes unknown, and is left out of mesh, points and poses.

    Raises:
        InputError: nothing is known inside the solid, or no surface of the map lies in it.
    """
    region = covered_region(kept, parts.field.grid)
    if region.empty:
        raise InputError(f"the {type(kept).__name__.lower()} to keep touches no voxel of the map")
    region = resolution.whole_cells(region)
    grid = parts.field.grid.part(region)
    outside = kept.distance(grid.centres().reshape(-1, 3)).reshape(grid.shape) > 0.0
    state = np.where(outside, np.uint8(esdf.UNKNOWN), parts.field.state[region.slices])
    if not (state != esdf.UNKNOWN).any():
        raise InputError(f"nothing is known inside the {type(kept).__name__.lower()} to keep")
    field = esdf.build(state, grid, cap_m=parts.field.cap_m, unknown=parts.field.unknown)

    def inside(points_world_m: FloatArray) -> np.ndarray:
        return kept.distance(points_world_m) <= 0.0

    points = inside(parts.known.points_world_m)
    placed = inside(parts.T_world_body[:, :3, 3])
    vertices, faces, colours, confidence = mesh_of(parts, inside(parts.vertices_world_m))
    if not len(faces):
        raise InputError(
            f"no surface of the map lies inside the {type(kept).__name__.lower()} to keep; take a larger one"
        )
    part = dataclasses.replace(
        parts,
        field=field,
        edits=moving.moved_edits(parts.edits, np.eye(4), grid),
        vertices_world_m=vertices,
        faces=faces,
        colours=colours,
        confidence=confidence,
        known=LocalizationMap(parts.known.points_world_m[points], parts.known.descriptors[points]),
        images=tuple(name for name, there in zip(parts.images, placed, strict=True) if there),
        time_s=parts.time_s[placed],
        T_world_body=parts.T_world_body[placed],
        inferred=parts.inferred[region.slices] & ~outside,
        occupancy=None
        if parts.occupancy is None
        else np.where(outside, np.float16(np.nan), parts.occupancy[region.slices]),
        tracks=parts.tracks.part(points, placed),
        seen=resolution.moved(parts.seen, np.eye(4), grid),
        facts=noted(parts, sentence),
    )
    figures = _figures_of_part(part, _walked_m(parts.T_world_body, placed))
    return dataclasses.replace(
        part,
        facts={name: value for name, value in part.facts.items() if name not in _COUNTED}
        | {name: figures[name] for name in _COUNTED if name in part.facts and name in figures},
        report=None if parts.report is None else _report_of_part(parts, figures),
    )


def _walked_m(T_world_body: FloatArray, placed: np.ndarray) -> float:
    """Length of the way between images (n, 4, 4) that follow each other and are both kept."""
    steps_m = np.linalg.norm(np.diff(T_world_body[:, :3, 3], axis=0), axis=1)
    return float(steps_m[placed[:-1] & placed[1:]].sum())


def _figures_of_part(part: MapParts, path_length_m: float) -> dict[str, Any]:
    """What a report says of a map's own extent, for a part of it."""
    voxel_m3 = float(np.prod(part.field.grid.voxel_m))
    free, occupied = (part.field.state == which for which in (esdf.FREE, esdf.OCCUPIED))
    count, listed = len(part.images) * len(part.rig.cameras), (part.report or {}).get("not_placed", [])
    lacking = [name for name in listed if name.rsplit("/", 1)[-1] in part.images]  # another camera's is there
    by_motion = [name for name in (part.report or {}).get("placed_by_motion", []) if Path(name).name in part.images]
    return {
        "images": count,
        "images_placed": count - len(lacking),
        "not_placed": lacking,
        "placed_by_motion": by_motion,
        "path_length_m": path_length_m,
        "points": len(part.known.points_world_m),
        "mesh_vertices": len(part.vertices_world_m),
        "mesh_faces": len(part.faces),
        "free_m3": float(free.sum()) * voxel_m3,
        "occupied_m3": float(occupied.sum()) * voxel_m3,
        "inferred_m3": float(part.inferred.sum()) * voxel_m3,
        **confidences.figures(part.confidence, part.field.grid.voxel_m[0]),
    }


def _report_of_part(whole: MapParts, figures: dict[str, Any]) -> dict[str, Any]:
    """The whole map's report with a part's own figures, without those that are not known of a part."""
    report = whole.report or {}
    kept = {name: value for name, value in report.items() if name not in (*_OF_THE_WHOLE, *confidences.FIGURES)}
    return {**kept, **figures, MADE_OF: report.get(MADE_OF, whole.name)}


def mesh_of(parts: MapParts, kept: np.ndarray) -> tuple[FloatArray, np.ndarray, np.ndarray, SurfaceConfidence]:
    """Vertices, faces, colours and confidence of the faces all of whose vertices are in the mask (v,)."""
    faces = parts.faces[kept[parts.faces].all(axis=1)]
    used, faces_new = np.unique(faces, return_inverse=True)
    faces_new = faces_new.reshape(-1, 3).astype(np.int32)
    return parts.vertices_world_m[used], faces_new, parts.colours[used], parts.confidence.part(used)


def noted(parts: MapParts, sentence: str) -> dict[str, Any]:
    """The map's facts with one more sentence in its history."""
    history = parts.facts.get(HISTORY, [])
    if not isinstance(history, list):
        raise FormatError(f"{parts.name}/map.toml: the history is {history!r}; a list of sentences is expected")
    return parts.facts | {HISTORY: [*history, sentence]}


def _body(document: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in document.items() if name not in ("format", "version")}
