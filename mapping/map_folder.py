"""The map folder: built from images in one step, whole or absent; planner, page and controller tools open it.

map.toml        what this is, its hash, where its scale came from, its main figures
mesh.glb/.ply   surfaces with vertex colours
esdf/           the distance field, with the pilot's edits
localization/   points with descriptors, for relocalization
camera.toml     the rig, with the lenses of the map
poses.csv       where each image was taken (body in world)
mesh_textured.glb   with a texture, if `texturing.add_texture` made one; no part of the hash
visibility.npz  how thin an object the images resolve, place by place
inferred.npz    unknown voxels that a plain wall must pass through
confidence.npz  standard deviation of each vertex of the mesh along the surface's normal
occupancy.npz   how likely something is in each voxel that depth images call free; not of measured depth
report.json     all figures of the run
"""

import dataclasses
import glob
import shutil
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import esdf
from esdf.storage import EDITS
from esdf.visibility import Visibility, load_visibility, save_visibility
from flight import (
    FlightError,
    FloatArray,
    FormatError,
    InputError,
    Progress,
    file_format,
    results,
    silent,
)
from mapping import (
    confidence_layer,
    free_space,
    given_paths,
    inferred_layer,
    map_figures,
    placed_views,
    poses_file,
    stages,
)
from mapping.camera import rig as rigs
from mapping.camera.rig import Rig
from mapping.dense import mesh_file, occupancy, resolution, surface
from mapping.dense.confidence import MeasuredSurface
from mapping.dense.surface import DenseOptions
from mapping.dense.views import THREADS
from mapping.free_space import FreeSpace
from mapping.input import source, trajectory
from mapping.input.depth_images import DepthFolder
from mapping.input.images import ImageSet
from mapping.input.selection import SelectionOptions
from mapping.input.trajectory import MotionKind
from mapping.map_figures import MapReport
from mapping.placed_views import DEPTH
from mapping.sparse import alignment, localization_map, reconstruction, tracks
from mapping.sparse.alignment import DEPTH_SOURCE, Length
from mapping.sparse.localization_map import LocalizationMap
from mapping.sparse.mapper import colmap
from mapping.sparse.mapper.colmap import SparseOptions
from mapping.stages import Work
from mapping.verdict import Standing
from mapping.workers import Pool, Threads

FORMAT = "goshawk-map"
VERSION = 1
REPORT_FORMAT = "goshawk-map-report"

VISIBILITY = "visibility.npz"
INFERRED = "inferred.npz"
CONFIDENCE = "confidence.npz"
IMPORTED = "imported"
"""Key of `map.toml`, true in a map that was not made of images and has neither cameras nor poses."""
STAGES = (source.FRAMES, source.CHECK, colmap.FEATURES, colmap.MATCHES, colmap.POSES, reconstruction.CALIBRATION, DEPTH)
"""Stages whose results survive an interrupted work, in order."""
MEASURED_SEEN_THROUGH = 1
"""Depth images of a sensor that must have seen through a voxel before it is free, as one measurement is enough."""
EARLIER_FREE_SPACE = (
    "its free space is of an earlier version, which called space free where images may not have seen through: about "
    "thin things, and before and behind plain walls"
)
"""Reason to doubt a map."""
_REPLACED = "replaced"
"""File of a work: inode of the earlier map, which is moved aside for the new one."""


@dataclass(frozen=True, slots=True)
class MapOptions:
    """How a map is made."""

    sparse: SparseOptions = field(default_factory=SparseOptions)
    """Poses."""
    dense: DenseOptions = field(default_factory=DenseOptions)
    """Surfaces."""
    length: Length | None = None
    """A measured length that gives the scale."""
    references: Path | None = None
    """Recorded positions and gravity; `references.csv` beside the images by default."""
    poses: Path | None = None
    """Recorded poses that do not drift, in TUM's or EuRoC's format: scale, world frame and pairs to match;
    with depth images also places of images that these and features do not place."""
    odometry: Path | None = None
    """Recorded odometry, likewise: scale, shape, pairs to match, places."""
    depths: DepthFolder | None = None
    """Depth images of the images' names: they place the images, and give scale and surfaces."""
    masks: Path | None = None
    """Folder of masks, see `mapping.input.masks`."""
    selection: SelectionOptions | None = None
    """How images are chosen from a dense sequence; all of a folder are used without, a video's never."""
    cap_m: float = 2.0
    """Distances in the field are exact up to here."""

    @property
    def motions(self) -> dict[MotionKind, Path]:
        """The files of recorded motion."""
        given = {MotionKind.POSES: self.poses, MotionKind.ODOMETRY: self.odometry}
        return {kind: path for kind, path in given.items() if path is not None}


@dataclass(frozen=True, slots=True, eq=False)
class Map:
    """An opened map folder."""

    folder: Path
    """Where it is."""
    field: esdf.Field
    """Signed distance, the pilot's edits applied."""
    rig: Rig
    """The rig that took the images; without cameras in an imported map."""
    images: tuple[str, ...]
    """Names of the placed images."""
    time_s: FloatArray
    """(n,) NaN where unknown."""
    T_world_body: FloatArray
    """(n, 4, 4)."""
    facts: dict[str, Any]
    """`map.toml`: scale source, figures."""

    @property
    def hash(self) -> str:
        """Identity of the map, recorded in every plan made in it; changes with every edit."""
        return self.field.hash

    @property
    def standing(self) -> Standing:
        """What may be done in it; a map whose free space is of an earlier rule is at best doubtful."""
        given = _standing(self.facts, self.folder)
        return Standing.DOUBTFUL if given is not Standing.REFUSED and has_earlier_free_space(self.facts) else given

    @property
    def reasons(self) -> tuple[str, ...]:
        """Why it is not good."""
        earlier = (EARLIER_FREE_SPACE,) if has_earlier_free_space(self.facts) else ()
        return (*self.facts.get("reasons", ()), *earlier)

    def require_not_refused(self) -> None:
        """Check that the map may be planned in at all.

        Raises:
            InputError: its verdict is "refused"; the message gives the reasons.
        """
        if self.standing is Standing.REFUSED:
            raise InputError(f"{self.folder} must not be planned in: {'; '.join(self.reasons)}; make the map again")

    def require_images(self) -> None:
        """Check that the map was made of images.

        Raises:
            InputError: it was imported.
        """
        if not self.rig.cameras:
            raise InputError(f"{self.folder} was imported and has no images, which this needs; build a map of images")

    @property
    def mesh(self) -> Path:
        return self.folder / "mesh.glb"

    def visibility(self) -> Visibility:
        """The thinnest obstacle that the images resolve, place by place; thinner ones may be missing from the map.

        Raises:
            FormatError: the file is damaged, or of another map.
        """
        if (self.folder / VISIBILITY).is_file():
            seen = load_visibility(self.folder / VISIBILITY)
            if not resolution.fits(seen, self.field.grid):
                raise FormatError(f"{self.folder / VISIBILITY} is of a grid unlike the map's; build the map again")
            return seen
        cameras = [(c, pose @ c.T_body_camera) for pose in self.T_world_body for c in self.rig.cameras]
        return resolution.visibility(self.field.state, self.field.grid, cameras)  # a map of an earlier version

    def inferred(self) -> NDArray[np.bool_]:
        """(nx, ny, nz) voxels that nothing measured, and that a plain wall must pass through; they are unknown.

        None in a map of an earlier version, nor where the pilot's edits say what is there.

        Raises:
            FormatError: the file is damaged, or of another map.
        """
        marked = inferred_layer.load(self.folder / INFERRED, self.field.grid.shape)
        return marked & (self.field.state == esdf.UNKNOWN)

    def surface(self) -> MeasuredSurface | None:
        """The vertices of the mesh, and how well they are known: not at all in a map of an earlier version.

        None in a map without a mesh in `mesh.ply`, which was not made of images.

        Raises:
            FormatError: a file is damaged, or they do not fit each other.
        """
        if not (self.folder / "mesh.ply").is_file():
            return None
        vertices, _, _ = mesh_file.load(self.folder / "mesh.ply")
        if not len(vertices):
            return None
        return MeasuredSurface(vertices, confidence_layer.load(self.folder / CONFIDENCE, len(vertices)))

    def free_space(self) -> FreeSpace | None:
        """What is free, and how thin an obstacle is ruled out there; None where the map has nothing to say it of.

        Raises:
            FormatError: a file of it is damaged.
        """
        if not len(self.T_world_body) and not (self.folder / VISIBILITY).is_file():
            return None
        edited = self.folder / "esdf" / EDITS
        edits = esdf.load_edits(edited) if edited.exists() else ()
        radius_m = float(self.facts.get("carrier_radius_m", 0.0))
        empty = free_space.known_empty(self.field.grid, edits, self.rig, self.T_world_body, radius_m)
        stated = occupancy.load(self.folder / occupancy.FILE, self.field.grid.shape)
        return FreeSpace(self.field, self.visibility(), empty, stated, free_space.shots(self))

    def localization_map(self) -> LocalizationMap:
        """Points with descriptors.

        Raises:
            InputError: there are none.
            FormatError: their file is damaged.
        """
        self.require_images()
        return localization_map.load(self.folder / "localization")


def build_map(
    images: Path,
    rig: Rig,
    out: Path,
    options: MapOptions | None = None,
    *,
    overwrite: bool = False,
    again_from: str | None = None,
    until: str | None = None,
    pool: Pool | None = None,
    progress: Progress = silent,
) -> MapReport:
    """Make the map folder `out` from a folder of images, or from a video.

    Finished stages are kept in `work_folder(out)` until the map is there: interrupted, killed or out of disk, the same
    call goes on with the first unfinished one.

    Args:
        overwrite: replace an earlier map in `out` when the new one is complete. The pilot's edits are copied over, and
            the earlier map stays beside it as `OUT.old-1`.
        again_from: one of `STAGES`: it and those after it are made again even if an interrupted run finished them.
        until: one of `STAGES`: the last to make.
        pool: who matches images and finds their depth; by default threads of this machine, for depth `THREADS`: each
            takes some 45 bytes of memory a pixel.

    Raises:
        StoppedError: the stage `until` is finished.
        InputError: there is an earlier map and `overwrite` was not given; the images or what was recorded with them
            cannot be used.
        MapError: these images do not suffice for a map.
    """
    options = options or MapOptions()
    interrupted = work_folder(out).exists()
    if not interrupted:
        results.require_free_folder(out, overwrite=overwrite, ours=is_map)
    _require_scale(Path(images), rig, options)
    for recorded in options.motions.values():
        trajectory.read(recorded)  # a fault of it is told before the images are decoded
    again = STAGES[STAGES.index(again_from) :] if again_from else ()
    given = source.Source(Path(images), rig, options.masks, options.depths, options.selection)
    if not given.is_video:
        if source.FRAMES in (again_from, until):
            raise InputError(f"the stage {source.FRAMES!r} is that of a video; {images} is a folder of images")
        checked = given.read(progress=progress)
        _require_fitting(checked, options)
    with stages.begin(work_folder(out), again=again, until=until) as begun:
        _put_back(out, begun)
        if given.is_video:
            checked = given.frames(begun, progress=progress)
            _require_fitting(checked, options)
        checked = checked.beside(options.motions)
        work = begun.on(rigs.fingerprint(rig), *checked.digests())
        source.require_usable(work, checked, progress=progress)
        report = _placed_before(out, _all_inputs(checked, options, work)) if interrupted else None
        if report is None:
            results.require_free_folder(out, overwrite=overwrite, ours=is_map)
            given_from = given_paths.noted(Path(out), Path(images), options.masks)
            report = _build(checked, out, options, work, given_from, overwrite=overwrite, pool=pool, progress=progress)
        stages.finish(begun)
    return report


def _require_scale(images: Path, rig: Rig, options: MapOptions) -> None:
    has_other = options.depths is not None or bool(options.motions)
    alignment.require_scale(images, rig, options.length, options.references, has_other=has_other)


def _require_fitting(images: ImageSet, options: MapOptions) -> None:
    """Check that references, motion, length, rig and memory fit the images: a fault is told before any long work."""
    if not images.has_pairs:  # then only what gives one camera a scale counts
        _require_scale(images.folder, rigs.Rig(images.rig.cameras[:1]), options)
    recorded = images.beside(options.motions)
    alignment.read_references(recorded, options.references)
    placed_views.require_room(recorded, options.dense.voxel_m)
    alignment.require_ends(images, options.length)


def work_folder(out: Path) -> Path:
    """Where the finished stages of an interrupted `build_map` are kept, for the next try."""
    place = Path(out).resolve()  # beside the map itself, as a link may lead to another disk
    return place.parent / f"{place.name}.work"


def _note_replaced(out: Path, work: Work) -> None:
    """Write down which map is about to be moved aside for the new one."""
    if is_map(out):
        (work.folder / _REPLACED).write_text(str(Path(out).stat().st_ino))


def _put_back(out: Path, work: Work) -> None:
    """Move the earlier map back if a run was killed between moving it aside and placing the new one."""
    note, place = work.folder / _REPLACED, Path(out).resolve()
    if note.is_file() and not place.exists():
        for kept in place.parent.glob(f"{glob.escape(place.name)}.old-*"):
            if str(kept.stat().st_ino) == note.read_text():
                kept.rename(place)
                break
    note.unlink(missing_ok=True)


def _all_inputs(images: ImageSet, options: MapOptions, work: Work) -> str:
    """Hash of everything that the map depends on."""
    return work.on(
        options.sparse, options.length, _recorded(images, options), options.dense, options.cap_m
    ).depends.hex()


def _placed_before(out: Path, inputs: str) -> MapReport | None:
    """The report of the map in `out` if it is of the same inputs: a run was killed after it had placed the map."""
    try:
        facts = open_map(out).facts if is_map(out) else {}
    except FlightError:  # an earlier map that is damaged
        return None
    body = read_report(out) if facts.get("inputs") == inputs else {}
    names = {field.name for field in dataclasses.fields(MapReport)}
    return MapReport(**{name: body[name] for name in names}) if names <= body.keys() else None


def _build(
    images: ImageSet,
    out: Path,
    options: MapOptions,
    work: Work,
    given_from: dict[str, str],
    *,
    overwrite: bool,
    pool: Pool | None,
    progress: Progress,
) -> MapReport:
    placed = reconstruction.reconstruct(
        images,
        options.sparse,
        length=options.length,
        references=options.references,
        work=work,
        pool=pool or Threads(),
        progress=progress,
    )
    started_s = time.process_time()
    seen = placed_views.views(placed)
    stereo = options.dense.stereo
    depth_work = work.on(options.sparse, options.length, _recorded(images, options), stereo)
    depths = placed_views.depth_stage(placed, seen, stereo, depth_work, pool or Threads(THREADS), progress)
    dense_options = options.dense
    if images.depths is not None:
        dense_options = dataclasses.replace(dense_options, least_seen_through=MEASURED_SEEN_THROUGH, contradicted=False)
    dense = surface.reconstruct(seen, dense_options, depths=depths, progress=progress)
    progress("distance field", 0.0)
    distances = esdf.build(dense.state, dense.grid, cap_m=options.cap_m)
    cpu_s = {**placed.cpu_s, "dense": round(time.process_time() - started_s, 2)}
    report = map_figures.report(placed, dense, options.dense.carrier_radius_m, distances.hash, cpu_s)
    with results.new_folder(out, overwrite=overwrite, ours=is_map, within=work.folder) as placing:
        new = placing.temporary
        esdf.save(new / "esdf", distances)
        save_visibility(new / VISIBILITY, dense.seen)
        inferred_layer.save(new / INFERRED, dense.inferred)
        confidence_layer.save(new / CONFIDENCE, dense.confidence)
        stated = None if dense.looks is None else occupancy.probability(dense.looks)
        occupancy.save(new / occupancy.FILE, stated)
        mesh_file.save(new / "mesh.glb", dense.vertices_world_m, dense.faces, dense.colours)
        mesh_file.save(new / "mesh.ply", dense.vertices_world_m, dense.faces, dense.colours)
        localization_map.save(new / "localization", placed.localization_map())
        tracks.save(new / "localization", placed.tracks())
        rigs.save(new / "camera.toml", placed.rig)
        poses_file.write_poses(new / "poses.csv", placed.images.instants, placed.images.time_s, placed.T_world_body)
        file_format.write_json(new / "report.json", format=REPORT_FORMAT, version=VERSION, body=report.as_dict())
        file_format.write_toml(
            new / "map.toml",
            format=FORMAT,
            version=VERSION,
            body=report.facts() | {"inputs": _all_inputs(images, options, work)} | given_from,
        )
        _keep_edits(Path(out), new)  # last: a pilot may draw a no-fly zone while the files are written
        _note_replaced(out, work)
    progress("distance field", 1.0)
    return report


def _recorded(images: ImageSet, options: MapOptions) -> list[object]:
    """What scale and world frame depend on besides the images."""
    path = options.references or images.folder / "references.csv"
    return [path.read_bytes() if path.is_file() else b"", images.motion_digests()]


def read_report(folder: Path) -> dict[str, Any]:
    """The figures of the mapping run; empty for a map that was joined of others, or made elsewhere.

    Raises:
        FormatError: the report is damaged or of a newer version.
    """
    path = folder / "report.json"
    return dict(file_format.read_json(path, format=REPORT_FORMAT, version=VERSION)) if path.is_file() else {}


def is_map(folder: Path) -> bool:
    """Whether a folder is a map, by its `map.toml`."""
    return (folder / "map.toml").exists()


def _keep_edits(old: Path, new: Path) -> None:
    edits = old / "esdf" / EDITS
    if edits.exists():
        shutil.copy(edits, new / "esdf" / EDITS)


def open_map(folder: Path) -> Map:
    """Open a map folder.

    Raises:
        InputError: `folder` is not a map.
        FormatError: it is damaged or of a newer version.
    """
    folder = Path(folder)
    if not (folder / "map.toml").is_file():
        bare = " (it is a distance field: `esdf.load` opens it in Python)" if (folder / "esdf.toml").is_file() else ""
        raise InputError(f"{folder} is not a map{bare}: it has no map.toml; `goshawk map build` makes one of images")
    facts = file_format.read_toml(folder / "map.toml", format=FORMAT, version=VERSION)
    _standing(facts, folder)  # a verdict that cannot be read must not pass for none
    if facts.get(IMPORTED) is True:
        field = esdf.load(folder / "esdf")
        return Map(folder, field, Rig(()), (), np.zeros(0), np.zeros((0, 4, 4)), facts)
    images, time_s, T_world_body = poses_file.read_poses(folder / "poses.csv")
    rig = rigs.load(folder / "camera.toml")
    return Map(folder, esdf.load(folder / "esdf"), rig, images, time_s, T_world_body, facts)


def has_earlier_free_space(facts: dict[str, Any]) -> bool:
    """Whether `map.toml` is of a map of images made before each free voxel had to be seen through over its whole width.

    Depth images of a sensor measure each pixel; a map without a source of scale was not made of images.
    """
    return "carrier_radius_m" not in facts and facts.get("scale_source", DEPTH_SOURCE) != DEPTH_SOURCE


def _standing(facts: dict[str, Any], folder: Path) -> Standing:
    """
    Raises:
        FormatError: the verdict, its reasons or the carrier's radius are not what this version writes.
    """
    given, reasons = facts.get("verdict", Standing.NOT_JUDGED), facts.get("reasons", [])
    if given not in list(Standing):
        raise FormatError(f"{folder / 'map.toml'}: the verdict is {given!r}; known are {', '.join(Standing)}")
    if not isinstance(reasons, list) or not all(isinstance(reason, str) for reason in reasons):
        raise FormatError(f"{folder / 'map.toml'}: the reasons are {reasons!r}; a list of sentences is expected")
    radius_m = facts.get("carrier_radius_m", 1.0)
    if not isinstance(radius_m, int | float) or not 0.0 < radius_m < np.inf:
        raise FormatError(f"{folder / 'map.toml'}: carrier_radius_m is {radius_m!r}; metres above 0 are expected")
    return Standing(given)
