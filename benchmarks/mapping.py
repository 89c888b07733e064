"""Cameras that are not what their file says: is each planted error named, and none invented?

    python benchmarks/mapping.py --cameras 40      one blind draw after the other, and the sums
    python benchmarks/mapping.py --instants 1000   CPU seconds and memory of the trial on a long path
    python benchmarks/mapping.py --hostile         wrong lens files, swapped folders, repeated texture: none may be good
    python benchmarks/mapping.py --data FOLDER     a recorded RGB-D sequence (hololens_rgbd_part1): poses, unused depth,
                                                   and images made grey, placed by the tracker's motion
    python benchmarks/mapping.py --localize 30     queries in the rendered room, with whole and with compact descriptors
    python benchmarks/mapping.py --join            two maps of one room, registered
    python benchmarks/mapping.py --room 60         a whole map of the rendered room: poses, mesh, queries, CPU, memory
    ... --room 60 --disturbed                      besides, poses with moved crates, blur, exposure jumps, a blank wall
    python benchmarks/mapping.py --hall 180        poses in a hall of 18 x 12 x 5 m
    python benchmarks/mapping.py --texture 44      the textured mesh of the rendered room against its true paint
    python benchmarks/mapping.py --walk FOLDER     a recorded walk (gopro_max_walk): poses, house wall, lens by itself

The matches are made by formula from a true rig (see `tracks`), so that a draw takes seconds. The trial starts from a
poor map: its poses and points are of the wrong size and off by centimetres.
"""

import argparse
import contextlib
import dataclasses
import resource
import shutil
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import mapping_texture
import mapping_walk
import mapping_whole
import numpy as np
import report

import mapping
from esdf.solids import Box
from flight import FloatArray, MapError, frames, rotations
from goshawk.rendered import hostile
from goshawk.rendered import world as rendered_world
from mapping import map_folder, map_parts, merging
from mapping.camera import adjustment, rig_export
from mapping.camera import rig as rigs
from mapping.camera import trial as trials
from mapping.camera.adjustment import Observations
from mapping.camera.errors import Kind
from mapping.camera.rig import Camera, Rig
from mapping.camera.trial import Trial
from mapping.dense import surface
from mapping.input.trajectory import MotionKind
from mapping.localization import relocalization
from mapping.sparse import localization_map, reconstruction
from mapping.sparse.mapper import colmap, colmap_model
from mapping.stages import StoppedError
from mapping.verdict import Standing

FORMS = ("none", "rig", "lens", "offset", "shutter", "two")
SIGHTINGS = 5.0
"""Mean number of further images of one camera in which a point is matched."""
GREY = (range(20, 30), range(40, 50))
"""Images of a recorded sequence that are made grey, to be placed by the tracker's motion."""
OUTLIERS, LARGEST_PX = 0.02, 3.0
"""Share of wrong matches, and how wrong: COLMAP drops those beyond."""


@dataclass(frozen=True, slots=True)
class Flight:
    """A curved path, drawn by chance."""

    speed_m_s: float
    swing: FloatArray
    """(5,) rad and m: amplitudes of three turns, sideways and up."""
    phase: FloatArray
    """(5,) rad."""

    def pose(self, t_s: FloatArray) -> FloatArray:
        """(n, 4, 4) T_world_body at the times (n,)."""
        waves = self.swing * np.sin(np.asarray(t_s)[:, None] * [1.9, 1.3, 1.1, 1.5, 2.0] + self.phase)
        positions = np.column_stack([self.speed_m_s * t_s, waves[:, 3], 1.5 + waves[:, 4]])
        return frames.transform(rotations.exp(waves[:, :3]), positions)


@dataclass(frozen=True, slots=True)
class Draw:
    """One blind camera: what is wrong with it, and what was seen with it."""

    form: str
    true: Rig
    planted: frozenset[str]
    offset_s: float
    shutter_s: float


def draw(form: str, rng: np.random.Generator) -> Draw:
    """A rig that differs from `rendered_world.default_rig` as `form` says."""
    rig = rendered_world.default_rig(0.75)
    parts = rng.choice(["rig", "lens", "offset", "shutter"], 2, replace=False) if form == "two" else [form]
    planted: set[str] = set()
    offset_s = shutter_s = 0.0
    for part in parts:
        match part:
            case "rig":
                axis = rng.normal(size=3)
                turn = rotations.matrix(rotations.exp(np.radians(1.0) * axis / np.linalg.norm(axis)))
                T = rig.cameras[1].T_body_camera.copy()
                T[:3, :3] = T[:3, :3] @ turn
                rig = _changed(rig, 1, dataclasses.replace(rig.cameras[1], T_body_camera=T))
                planted.add(f"down: {Kind.ROTATION}")
            case "lens":
                number = int(rng.integers(2))
                camera = rig.cameras[number]
                focal, k1 = rng.uniform([0.005, 0.003], [0.015, 0.008]) * rng.choice([-1.0, 1.0], 2)
                params = camera.params.copy()
                params[:2] *= 1.0 + focal
                params[4] += k1
                rig = _changed(rig, number, dataclasses.replace(camera, params=params))
                planted |= {f"{camera.name}: {kind}" for kind in (Kind.FOCAL, Kind.RADIAL)}
            case "offset":
                offset_s = 0.005 * rng.choice([-1.0, 1.0])
                planted.add(f"down: {Kind.OFFSET}")
            case "shutter":
                shutter_s = 0.010
                planted |= {f"{camera.name}: {Kind.SHUTTER}" for camera in rig}
    return Draw(form, rig, frozenset(planted), offset_s, shutter_s)


def _changed(rig: Rig, number: int, camera: Camera) -> Rig:
    cameras = list(rig.cameras)
    cameras[number] = camera
    return dataclasses.replace(rig, cameras=tuple(cameras))


def tracks(
    drawn: Draw, told: Rig, *, instants: int, points_per_m: float, rng: np.random.Generator
) -> tuple[Observations, FloatArray]:
    """What the true rig saw, in a map that was made with the file's, and the true poses."""
    flight = Flight(
        rng.uniform(2.0, 4.5),
        rng.uniform([0.1, 0.1, 0.3, 0.5, 0.2], [0.3, 0.3, 0.7, 1.5, 0.5]),
        rng.uniform(0.0, 6.3, 5),
    )
    times_s = np.arange(instants) / 10.0
    T, length_m = flight.pose(times_s), flight.speed_m_s * times_s[-1]
    count = int(points_per_m * (length_m + 8.0))
    points = rng.uniform([-1.0, -5.0, -1.0], [length_m + 7.0, 5.0, 5.0], (count, 3))
    noise_px = rng.uniform(0.15, 0.4)
    centre = rng.uniform(-0.5, 0.5, count)
    wide = rng.geometric(1.0 / SIGHTINGS, count) + 1
    index, pixels = [], []
    middle = np.searchsorted(T[:, 0, 3], points[:, 0] - 3.0 + 3.0 * centre)
    for number, camera in enumerate(drawn.true):
        for i, t_s in enumerate(times_s):
            near = np.flatnonzero(np.abs(i - middle) * 2 <= wide)
            seen = image(camera, flight, t_s + (drawn.offset_s if number else 0.0), points[near], drawn.shutter_s)
            inside = np.flatnonzero(camera.contains(seen))
            index.append(np.column_stack([near[inside], np.full((len(inside), 2), [i, number])]))
            off_px = noise_px * rng.normal(size=(len(inside), 2))
            wrong = rng.random(len(inside)) < OUTLIERS
            off_px[wrong] = rng.uniform(-LARGEST_PX, LARGEST_PX, (int(wrong.sum()), 2))
            pixels.append(seen[inside] + off_px)
    index, pixels = np.concatenate(index), np.concatenate(pixels)
    often = np.bincount(index[:, 0], minlength=count)[index[:, 0]] >= 2
    scale = rng.uniform(0.8, 1.25)
    known = T @ frames.transform(
        rotations.exp(2e-3 * rng.normal(size=(instants, 3))), 5e-3 * rng.normal(size=(instants, 3))
    )
    known[:, :3, 3] *= scale
    near = scale * (points + 0.02 * rng.normal(size=points.shape))
    return Observations(told, known, near, index[often], pixels[often], times_s), T


def image(camera: Camera, flight: Flight, t_s: float, points: FloatArray, shutter_s: float) -> FloatArray:
    """(n, 2) pixels of points (n, 3); each row is read at a time of its own, found by iteration."""
    row_s = np.zeros(len(points))
    for _ in range(4 if shutter_s else 1):
        T = flight.pose(t_s + row_s) @ camera.T_body_camera
        seen = camera.project(np.einsum("nji,nj->ni", T[:, :3, :3], points - T[:, :3, 3]))
        row_s = shutter_s * (np.nan_to_num(seen[:, 1]) / camera.height - 0.5)
    return seen


def error_m(found: FloatArray, true: FloatArray) -> float:
    """RMS distance of the positions after the best rigid alignment, without scale."""
    a, b = (T[:, :3, 3] - T[:, :3, 3].mean(axis=0) for T in (found, true))
    u, _, vt = np.linalg.svd(b.T @ a)
    R = u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))]) @ vt
    return float(np.sqrt(np.mean(np.sum((a @ R.T - b) ** 2, axis=1))))


def blind(count: int, seed: int) -> None:
    """One line a draw, then the sums."""
    named = planted = inventions = 0
    ratios: list[float] = []
    errors: list[tuple[float, float]] = []
    stated: list[tuple[float, float]] = []
    for number in range(count):
        form = FORMS[number % len(FORMS)]
        drawn = draw(form, np.random.default_rng([seed, number]))
        told = rendered_world.default_rig(0.75)
        started_s = time.process_time()
        found, off_m = _tried(drawn, told, number, seed)
        cpu_s = time.process_time() - started_s
        right, clean_m = _tried(drawn, drawn.true, number, seed, clean=True)
        present = {str(f.candidate) for f in found.present}
        named += len(present & drawn.planted)
        planted += len(drawn.planted)
        inventions += len(present - drawn.planted)
        ratios.append(off_m / clean_m)
        errors.append((off_m, clean_m))
        stated.append((_stated_m(found), _stated_m(right)))
        missed, more = sorted(drawn.planted - present), sorted(present - drawn.planted)
        said = f"{'; MISSED ' + ', '.join(missed) if missed else ''}{'; INVENTED ' + ', '.join(more) if more else ''}"
        print(
            f"{number:3d} {form:8s} {1000 * off_m:6.1f} mm, clean {1000 * clean_m:6.1f} mm, "
            f"scale std {found.scale_std:.4f}, clean {right.scale_std:.4f}, {cpu_s:4.1f} CPU s{said}",
            flush=True,
        )
    print(f"named {named} of {planted}; invented {inventions} in {count} cameras")
    print(f"error over that with the right file: median {np.median(ratios):.2f}, worst {max(ratios):.2f}")
    for of, pairs in (("RMS of all", errors), ("the same, as the trials state it", stated)):
        off_m, clean_m = np.sqrt(np.mean(np.square(pairs), axis=0))
        print(f"{of}: {1000 * off_m:.1f} mm, with the right file {1000 * clean_m:.1f} mm, {off_m / clean_m:.2f} times")
    by_right = np.divide(*np.transpose(stated))
    print(f"of one camera, as its trials state it: median {np.median(by_right):.2f}, worst {by_right.max():.2f} times")


def _stated_m(found: Trial) -> float:
    """RMS error of the positions that the standard deviation of the scale makes."""
    positions = found.T_world_body[:, :3, 3]
    return found.scale_std * float(np.sqrt(np.mean(np.sum((positions - positions.mean(axis=0)) ** 2, axis=1))))


def _tried(drawn: Draw, told: Rig, number: int, seed: int, *, clean: bool = False) -> tuple[Trial, float]:
    if clean:
        drawn = dataclasses.replace(drawn, offset_s=0.0, shutter_s=0.0)
    seen, T = tracks(drawn, told, instants=40, points_per_m=400.0, rng=np.random.default_rng([seed, number, 1]))
    found = trials.hold(seen)
    return found, error_m(found.T_world_body, T)


def long(instants: int) -> None:
    """CPU seconds and memory of one trial."""
    rng = np.random.default_rng(0)
    drawn = draw("rig", rng)
    seen, T = tracks(drawn, rendered_world.default_rig(0.75), instants=instants, points_per_m=400.0, rng=rng)
    before_kib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    started_s = time.process_time()
    found = trials.hold(seen)
    print(
        f"{instants} instants, {len(seen.index)} observations: {time.process_time() - started_s:.1f} CPU s, "
        f"memory from {before_kib // 1024} to {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024} MiB, "
        f"present: {', '.join(str(f.candidate) for f in found.present)}, {1000 * error_m(found.T_world_body, T):.1f} mm"
    )


def wrong_inputs() -> None:
    """One line a case: the verdict and its reason; then how many were called good."""
    good = 0
    with tempfile.TemporaryDirectory() as name:
        folders = {
            is_tiled: hostile.render(Path(name) / str(is_tiled), is_tiled=is_tiled) for is_tiled in (False, True)
        }
        for what, case in hostile.cases().items():
            standing, why = hostile.outcome(folders[case.is_tiled], case.rig)
            good += standing == Standing.GOOD
            print(f"{what}: {standing}{'' if case.named in why else ', CAUSE NOT NAMED'}: {why}", flush=True)
    print(f"called good: {good} of {len(hostile.cases())}")


def depth_camera(data: Path) -> None:
    """A recorded RGB-D sequence: poses against its tracker's, a mesh of every other depth image against the rest."""
    import open3d

    K = np.loadtxt(data / "K.txt")
    lens = [K[0, 0], K[1, 1], K[0, 2] + 0.5, K[1, 2] + 0.5]  # K counts from the middle of the first pixel
    rig = Rig((rigs.forward_camera("PINHOLE", 540, 360, lens),))
    table = np.loadtxt(data / "poses_camera_to_world.csv", delimiter=",", skiprows=1, usecols=range(1, 17))
    options = mapping.MapOptions(depths=mapping.DepthFolder(data / "depth"))
    images = mapping.read_folder(data / "images", rig, depths=options.depths)
    tracker = table.reshape(-1, 4, 4)
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "map"
        with contextlib.suppress(StoppedError):
            mapping.build_map(data / "images", rig, out, options, until=colmap.MATCHES)
        (database,) = (map_folder.work_folder(out) / colmap.MATCHES).glob("*.db")
        shutil.copy(database, folder)
        report = mapping.build_map(data / "images", rig, out, options)
        placed = mapping.open_map(out)
        where = np.array([images.instants.index(name) for name in placed.images])
        T_world_camera = placed.T_world_body @ rig.cameras[0].T_body_camera
        ours = np.full(tracker.shape, np.nan)
        ours[where] = T_world_camera
        judged = [explained(Path(folder) / database.name, images, T) for T in (ours, tracker)]
    T_tracker_world = mapping_whole.aligned(T_world_camera, tracker[where])
    off_m = np.linalg.norm((T_tracker_world @ T_world_camera)[:, :3, 3] - tracker[where][:, :3, 3], axis=1)
    worst = int(where[off_m.argmax()])
    print(
        f"{report.images_placed} of {report.images} placed, verdict {report.verdict}, "
        f"{sum(report.cpu_s.values()):.0f} CPU s; positions beside the tracker's: "
        f"{1000 * np.sqrt(np.mean(off_m**2)):.1f} mm RMS, {1000 * off_m.max():.1f} worst ({images.instants[worst]})"
    )
    for name, (error_px, apart) in zip(("map", "tracker"), judged, strict=True):
        print(
            f"matches with the {name}'s poses: {np.nanmean(error_px):.2f} px off, {error_px[worst]:.2f} in the image "
            f"of the worst; median difference from the sensor's depth {np.nanmean(apart):.2%}, {apart[worst]:.2%}"
        )
    views = [
        surface.ImageView(rig.cameras[0], T, images.pixels(int(k), 0))
        for T, k in zip(T_world_camera, where, strict=True)
    ]
    depth_m = [images.depth_m(int(k), 0) for k in where]
    used = [
        surface.depth_from_sensor(view, depth) if number % 2 == 0 else None
        for number, (view, depth) in enumerate(zip(views, depth_m, strict=True))
    ]
    mesh = surface.reconstruct(views, depths=used)
    scene = open3d.t.geometry.RaycastingScene()
    scene.add_triangles(mesh.vertices_world_m.astype(np.float32), mesh.faces.astype(np.uint32))
    pixels, apart_m = rig.cameras[0].pixel_centres()[::6, ::6], []
    for T, depth in list(zip(T_world_camera, depth_m, strict=True))[1::2]:
        seen = (depth[::6, ::6] > 0.0) & (depth[::6, ::6] < surface.DenseOptions().farthest_m)
        rays = rig.cameras[0].unproject(pixels[seen])
        points = frames.apply(T, rays / rays[:, 2:] * depth[::6, ::6][seen][:, None])
        apart_m.append(scene.compute_distance(points.astype(np.float32)).numpy())
    median_mm = 1000.0 * np.median(np.concatenate(apart_m))
    print(f"mesh of every other depth image to the depth of the rest: median {median_mm:.1f} mm")
    for grey in GREY:
        without_features(data, rig, tracker, ours, grey)


def without_features(data: Path, rig: Rig, tracker: FloatArray, T_whole: FloatArray, grey: range) -> None:
    """Some images made grey: where the tracker's motion places them, beside the poses of a map of the whole images."""
    import cv2

    with tempfile.TemporaryDirectory() as name:
        folder, recorded = Path(name) / "images", Path(name) / "poses.tum"
        shutil.copytree(data / "images", folder)
        images = mapping.read_folder(folder, rig, depths=mapping.DepthFolder(data / "depth"))
        for instant in grey:
            cv2.imwrite(str(images.path(instant, 0)), np.full((360, 540), 110, np.uint8))
        time_s = np.arange(len(tracker)) / 10.0
        rig_export.write_tum(recorded, time_s, tracker)
        images = dataclasses.replace(images, time_s=time_s)
        alone = reconstruction.reconstruct(images)
        placed = reconstruction.reconstruct(images.beside({MotionKind.POSES: recorded}))
    T_world_camera = placed.T_world_body @ rig.cameras[0].T_body_camera
    with_features = placed.placed & ~np.isin(np.arange(len(tracker)), grey)
    T_whole_world = mapping_whole.aligned(T_world_camera[with_features], T_whole[with_features])
    off_mm = 1000.0 * np.linalg.norm((T_whole_world @ T_world_camera - T_whole)[:, :3, 3], axis=1)
    print(
        f"images {grey[0]} to {grey[-1]} made grey: {alone.placed.sum()} placed without the tracker's motion, "
        f"{placed.placed.sum()} with it, {len(placed.by_motion)} by it; beside the map of the whole images: grey ones "
        f"{np.median(off_mm[grey]):.1f} mm median, {off_mm[grey].max():.1f} worst, others "
        f"{np.nanmedian(off_mm[with_features]):.1f}, {np.nanmax(off_mm[with_features]):.1f} mm"
    )


def explained(database: Path, images: mapping.ImageSet, T_world_camera: FloatArray) -> tuple[FloatArray, FloatArray]:
    """How well poses explain the matched features, whose points are triangulated with them; depth has no part in that.

    Returns:
        For each instant the mean reprojection error (px), and the median of the points' relative difference from the
        sensor's depth.
    """
    import pycolmap

    seen = colmap_model.observations(
        colmap_model.triangulated(
            database, images, T_world_camera, pycolmap.IncrementalPipelineOptions(), without_matches=True
        ),
        images,
    )
    error_px = np.linalg.norm(adjustment.residuals(seen, adjustment.initial(seen)), axis=1)
    mean_px, apart = np.full((2, len(images.instants)), np.nan)
    for instant in np.unique(seen.index[:, 1]):
        own = seen.index[:, 1] == instant
        points = frames.apply(frames.invert(T_world_camera[instant]), seen.points_world[seen.index[own, 0]])
        column, row = seen.pixels[own].astype(int).T
        there_m = images.depth_m(int(instant), 0)[row, column]
        known = there_m > 0.0
        mean_px[instant] = error_px[own].mean()
        apart[instant] = np.median(np.abs(points[known, 2] / there_m[known] - 1.0))
    return mean_px, apart


def localize(count: int) -> None:
    """Images taken beside the path of a map of 60 pairs: found with descriptors of 8 bits and with the file's 3."""
    asked = mapping_whole.beside(rendered_world.loop_flight(4 * count))
    with tempfile.TemporaryDirectory() as folder:
        known, queries = Path(folder) / "known", Path(folder) / "queries"
        rendered_world.write_rendered_sequence(known)
        rendered_world.write_rendered_sequence(queries, flight=asked, seed=9)
        placed = reconstruction.reconstruct(mapping.read_folder(known, rigs.load(known / "camera.toml")))
        images = mapping.read_folder(queries, placed.rig)
        whole = placed.localization_map()
        data = localization_map.encode(whole)
        print(f"{len(whole.points_world_m)} points, {len(data) / len(whole.points_world_m):.3f} bytes each")
        T_true_map = mapping_whole.aligned(placed.T_world_body, rendered_world.loop_flight(60).T_world_body)
        for name, points in (("8 bits", whole), ("3 bits", localization_map.decode(data))):
            answer = relocalization.localize(points, images)
            T = T_true_map @ answer.T_world_body[answer.found]
            true_T = asked.T_world_body[answer.found]
            off_m = np.linalg.norm(T[:, :3, 3] - true_T[:, :3, 3], axis=1)
            off_rad = rotations.angle_between(*(rotations.from_matrix(each[:, :3, :3]) for each in (T, true_T)))
            recall = int(((off_m < 0.05) & (off_rad < np.radians(2.0))).sum())
            agree = f"{np.median(answer.inliers):.0f} of {np.median(answer.matches):.0f} pairs"
            error = f"median {1000.0 * np.median(off_m):.2f} mm, worst {1000.0 * off_m.max():.2f} mm"
            print(f"{name}: {recall} of {count} within 5 cm and 2 deg, {error}, {agree} agree")


def join() -> None:
    """Two maps of one room from other images, whole and as halves that overlap less and less: where they are put."""
    flights = {"first": rendered_world.loop_flight(60), "second": mapping_whole.beside(rendered_world.loop_flight(120))}
    maps, T_true_map = {}, {}
    with tempfile.TemporaryDirectory() as folder:
        for seed, (name, flight) in zip((1, 9), flights.items(), strict=True):
            images = rendered_world.write_rendered_sequence(Path(folder) / f"{name}-images", flight=flight, seed=seed)
            mapping.build_map(images, rigs.load(images / "camera.toml"), Path(folder) / name)
            maps[name] = map_parts.read(Path(folder) / name)
            T_true_map[name] = mapping_whole.aligned(maps[name].T_world_body, flight.T_world_body)
    true = frames.invert(T_true_map["first"]) @ T_true_map["second"]
    _join("whole", maps["first"], maps["second"], true)
    for overlap_m in (3.0, 1.5, 0.8, 0.3, 0.0):
        ends = {"first": (-9.0, 0.5 * overlap_m), "second": (-0.5 * overlap_m, 9.0)}
        halves = []
        for name, (low, high) in ends.items():
            upright = map_parts.moved(maps[name], T_true_map[name], "to the room's axes")
            half = map_parts.cropped(upright, Box((low, -9.0, -9.0), (high, 9.0, 9.0)), "cut")
            halves.append(map_parts.moved(half, frames.invert(T_true_map[name]), "back"))
        _join(f"halves that overlap by {overlap_m} m", *halves, true)


def _join(title: str, first: map_parts.MapParts, second: map_parts.MapParts, true: FloatArray) -> None:
    started_s = time.process_time()
    try:
        found = merging.register(first, second)
    except MapError as error:
        print(f"{title}: refused, {error}")
        return
    points = second.known.points_world_m
    off_mm = 1000.0 * np.linalg.norm(frames.apply(true, points) - frames.apply(found.T_first_second, points), axis=1)
    print(
        f"{title}: {len(found.pairs)} of {found.matches} pairs, median {np.median(off_mm):.1f} mm and worst "
        f"{off_mm.max():.1f} mm off, {found.contradiction:.2%} contradict, {time.process_time() - started_s:.1f} CPU s"
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cameras", type=int, default=0, help="number of blind draws")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--instants", type=int, default=0, help="length of one long path")
    parser.add_argument("--hostile", action="store_true", help="inputs that must not become a good map")
    parser.add_argument("--data", type=Path, help="folder of a recorded RGB-D sequence")
    parser.add_argument("--localize", type=int, default=0, help="number of queries in the rendered room")
    parser.add_argument("--join", action="store_true", help="register two maps of the rendered room")
    parser.add_argument("--room", type=int, default=0, help="pairs of images of the rendered room")
    parser.add_argument("--disturbed", action="store_true", help="with --room: the same disturbed")
    parser.add_argument("--hall", type=int, default=0, help="pairs of images of the rendered hall")
    parser.add_argument("--texture", type=int, default=0, help="pairs of images of a textured map")
    parser.add_argument("--walk", type=Path, help="folder of a recorded walk")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the rows of the last five here")
    given = parser.parse_args()
    if given.cameras:
        blind(given.cameras, given.seed)
    if given.instants:
        long(given.instants)
    if given.hostile:
        wrong_inputs()
    if given.data:
        depth_camera(given.data)
    if given.localize:
        localize(given.localize)
    if given.join:
        join()
    if given.disturbed and not given.room:
        parser.error("--disturbed goes with --room")
    rows: list[report.Row] = []
    with tempfile.TemporaryDirectory() as name:
        if given.room:
            rows += mapping_whole.room(Path(name) / "room", given.room)
        if given.disturbed:
            clean_m = next(r.value for r in rows if r.name.endswith("position, mean")) / 1000.0
            rows += mapping_whole.disturbed_room(Path(name) / "disturbed", given.room, clean_m)
        if given.hall:
            rows += mapping_whole.large_hall(Path(name) / "hall", given.hall)
        if given.texture:
            rows += mapping_texture.texture(Path(name) / "texture", given.texture)
        if given.walk:
            rows += mapping_walk.walk(Path(name) / "walk", given.walk)
    if given.json:
        report.write(rows, given.json)
