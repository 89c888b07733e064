"""Maps of rendered rooms and a hall against the truth: poses, surfaces, queries, cost."""

import os
import resource
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import report
from numpy.typing import NDArray
from report import Row, row

import mapping
from flight import FloatArray, frames, rotations
from goshawk.demo import map_accuracy
from goshawk.rendered import accuracy, disturbed, hall
from goshawk.rendered import scene as rendered_room
from goshawk.rendered import world as rendered_world
from goshawk.rendered.world import RenderedFlight
from mapping import verdict
from mapping.camera import rig as rigs
from mapping.localization import relocalization
from mapping.sparse import reconstruction
from mapping.sparse.localization_map import LocalizationMap
from mapping.verdict import Standing

QUERIES = 30
WITHIN_M, WITHIN_RAD = 0.05, np.radians(2.0)


@dataclass(frozen=True, slots=True)
class Cost:
    """Of one command."""

    cpu_s: float
    """All threads and child processes."""
    largest_mib: float
    """Peak resident memory of the largest of its processes."""


def command(*words: object) -> Cost:
    """Run `goshawk`, its progress discarded.

    Raises:
        RuntimeError: it crashed. A map that is refused (exit code 1) is still measured.
    """
    process = subprocess.Popen(
        [sys.executable, "-m", "goshawk", *map(str, words)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode not in (0, 1):
        raise RuntimeError(f"goshawk {' '.join(map(str, words))}: exit code {process.returncode}")
    return Cost(used.ru_utime + used.ru_stime, used.ru_maxrss / 1024.0)


def beside(path: RenderedFlight) -> RenderedFlight:
    """Every fourth instant from the second on, moved by up to 25 cm and 12 degrees beside the path."""
    count = len(path.times_s[1::4])
    rng = np.random.default_rng(3)
    aside = frames.transform(
        rotations.exp(np.radians(rng.uniform(-12.0, 12.0, (count, 3)))), rng.uniform(-0.25, 0.25, (count, 3))
    )
    return RenderedFlight(path.times_s[1::4].copy(), path.T_world_body[1::4] @ aside)


def aligned(T_found: FloatArray, T_true: FloatArray) -> FloatArray:
    """The rigid motion (4, 4), no scale, that fits the positions of found poses (n, 4, 4) to the true ones."""
    return map_accuracy.rigid_alignment(T_found[:, :3, 3], T_true[:, :3, 3])


def room(work: Path, pairs: int) -> list[Row]:
    """The furnished room by the command: poses, mesh, queries beside the path, CPU seconds and memory."""
    name, scene = f"room, {pairs} pairs", rendered_room.furnished()
    flight, queries = rendered_world.loop_flight(pairs), beside(rendered_world.loop_flight(4 * QUERIES))
    rendered_world.write_rendered_sequence(work / "images", flight=flight)
    rendered_world.write_rendered_sequence(work / "queries", flight=queries, seed=9)
    cost = command("map", "build", work / "images", "--camera", work / "images" / "camera.toml", "--out", work / "map")
    made = mapping.open_map(work / "map")
    index = np.array([int(Path(image).stem) for image in made.images])
    T_true = flight.T_world_body[index]
    T_world_map = aligned(made.T_world_body, T_true)
    shots = [(camera, T @ camera.T_body_camera) for T in T_true for camera in made.rig]
    seen = accuracy.seen_surface(scene, shots, rng=np.random.default_rng(1))
    mesh, field = map_accuracy.mesh_vertices(made), made.field
    score = accuracy.compare(scene, seen, mesh, field.state, field.grid, T_world_map=T_world_map)
    near, covered, inside = score.share_within_5cm, score.seen_share_within_10cm, score.free_share_in_matter
    cpu_bar_s = 0.75 * 2 * pairs
    rows = [
        *_poses(name, T_world_map @ made.T_world_body, flight, index, 0.004),
        *_queries(name, made.localization_map(), work / "queries", queries, T_world_map, QUERIES),
        row(f"{name}: mesh within 5 cm of the truth", near, "share", ">= 0.99", near >= 0.99),
        row(f"{name}: seen surface within 10 cm of the mesh", covered, "share", ">= 0.97", covered >= 0.97),
        row(f"{name}: mesh, median error", 1000 * score.median_error_m, "mm"),
        row(f"{name}: free voxels inside matter", inside, "share", "<= 2e-4", inside <= 2e-4),
        row(f"{name}: verdict good", made.standing == Standing.GOOD, "0 or 1"),
        row(f"{name}: CPU", cost.cpu_s, "s", f"<= {cpu_bar_s:g}", cost.cpu_s <= cpu_bar_s),
        row(f"{name}: memory, largest process", cost.largest_mib, "MiB", "<= 1024", cost.largest_mib <= 1024),
    ]
    report.print_table(rows)
    return rows


def disturbed_room(work: Path, pairs: int, clean_mean_m: float) -> list[Row]:
    """Crates that move, blur, exposure jumps, a blank wall: poses and queries, which see the crates elsewhere again."""
    rig = rendered_world.default_rig()
    flight, queries = rendered_world.loop_flight(pairs), beside(rendered_world.loop_flight(4 * QUERIES))
    for name, flown, seed in (("images", flight, 1), ("queries", queries, 9)):
        picture = disturbed.pictures(rig, flown, seed, is_later=name == "queries")
        rendered_world.write_rendered_sequence(work / name, flight=flown, seed=seed, picture=picture)
    return _placed(work, f"disturbed room, {pairs} pairs", flight, queries, 1.5 * clean_mean_m, 27)


def large_hall(work: Path, pairs: int) -> list[Row]:
    """The hall of 18 x 12 x 5 m: poses and queries."""
    through, scene = hall.LOOP_WORLD_M, hall.furnished()
    flight = rendered_world.loop_flight(pairs, through_world_m=through)
    queries = beside(rendered_world.loop_flight(4 * QUERIES, through_world_m=through))
    rendered_world.write_rendered_sequence(work / "images", flight=flight, scene=scene)
    rendered_world.write_rendered_sequence(work / "queries", flight=queries, scene=scene, seed=9)
    return _placed(work, f"hall, {pairs} pairs", flight, queries, 0.020, 28)


def _placed(
    work: Path, name: str, flight: RenderedFlight, queries: RenderedFlight, mean_bar_m: float, recall_bar: int
) -> list[Row]:
    """Poses of `work`/images without surfaces, and `work`/queries found among their points."""
    images = work / "images"
    placed = reconstruction.reconstruct(mapping.read_folder(images, rigs.load(images / "camera.toml")))
    children_mib = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024.0
    index = np.flatnonzero(placed.placed)
    T = placed.T_world_body[index]
    T_world_map = aligned(T, flight.T_world_body[index])
    rows = [
        *_poses(name, T_world_map @ T, flight, index, mean_bar_m),
        *_queries(name, placed.localization_map(), work / "queries", queries, T_world_map, recall_bar),
        row(f"{name}: verdict good", verdict.judge(placed).standing == Standing.GOOD, "0 or 1"),
        row(f"{name}: CPU of the poses", sum(placed.cpu_s.values()), "s"),
        row("memory, largest child process until now", children_mib, "MiB"),
    ]
    report.print_table(rows)
    return rows


def _poses(name: str, T_found: FloatArray, flight: RenderedFlight, index: NDArray[np.int64], bar_m: float) -> list[Row]:
    """Error of the positions after the best rigid alignment, without scale."""
    off_m = np.linalg.norm(T_found[:, :3, 3] - flight.T_world_body[index, :3, 3], axis=1)
    count, mean_m = len(flight.times_s), float(off_m.mean())
    return [
        row(f"{name}: placed", len(index), "pairs", f"{count}", len(index) == count),
        row(f"{name}: position, mean", 1000 * mean_m, "mm", f"<= {1000 * bar_m:.3g}", mean_m <= bar_m),
        row(f"{name}: position, worst", 1000 * float(off_m.max()), "mm"),
    ]


def _queries(
    name: str,
    known: LocalizationMap,
    folder: Path,
    queries: RenderedFlight,
    T_world_map: FloatArray,
    bar: int,
) -> list[Row]:
    """The images of `folder`, found in a map, against the truth."""
    answer = relocalization.localize(known, mapping.read_folder(folder, rigs.load(folder / "camera.toml")))
    T, T_true = T_world_map @ answer.T_world_body[answer.found], queries.T_world_body[answer.found]
    off_m = np.linalg.norm(T[:, :3, 3] - T_true[:, :3, 3], axis=1)
    off_rad = rotations.angle_between(*(rotations.from_matrix(each[:, :3, :3]) for each in (T, T_true)))
    right = (off_m < WITHIN_M) & (off_rad < WITHIN_RAD)
    recall, count = int(right.sum()), len(queries.times_s)
    return [
        row(f"{name}: queries within 5 cm, 2 deg", recall, f"of {count}", f">= {bar}", recall >= bar),
        row(f"{name}: queries placed wrongly", int((~right).sum()), f"of {count}"),
        row(f"{name}: queries, median error", 1000 * float(np.median(off_m)), "mm"),
    ]
