"""The web ground station with a large map: preparing mesh and points for display, memory, bytes of the first picture.

    python benchmarks/gcs_scene.py [--triangles 1000000] [--count 10000000] [--json FILE]

The mesh is the hall's rooms and pillars in small rough triangles, the points lie on it. Each is prepared by a process
of its own, once per map, whose peak of memory is measured. No browser takes part: bytes are those that one would be
sent, compressed as the 3D view compresses them; the first picture is all coarse tiles and the files of both pages.
"""

import gzip
import resource
import tempfile
import time
from collections.abc import Callable, Iterable
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
import viser
import zstandard
from gcs_station import new_project, station_process
from report import Row, main, row

import gcs_web
from flight import FloatArray, project
from gcs_web.map import display_mesh, display_points
from gcs_web.scene import tiles
from gcs_web.scene.tiles import Tiles
from mapping.dense import mesh_file

SIZE_M = (16.0, 12.0, 3.0)
ROUGH_M = 0.006
MOST_MB = 400.0


def sheet(origin_m: FloatArray, along_m: FloatArray, up_m: FloatArray, edge_m: float) -> tuple[FloatArray, np.ndarray]:
    """A rough rectangle that faces along x up: (n, 3) vertices, (m, 3) faces."""
    n, m = (int(np.linalg.norm(side) / edge_m) + 1 for side in (along_m, up_m))
    u, v = np.meshgrid(np.linspace(0.0, 1.0, n), np.linspace(0.0, 1.0, m), indexing="ij")
    normal = np.cross(along_m, up_m) / np.linalg.norm(np.cross(along_m, up_m))
    rough_m = np.random.default_rng(0).normal(0.0, ROUGH_M, u.shape)
    vertices_m = origin_m + u[..., None] * along_m + v[..., None] * up_m + rough_m[..., None] * normal
    k = np.arange(n * m).reshape(n, m)
    first = np.stack([k[:-1, :-1], k[1:, :-1], k[1:, 1:]], axis=-1)
    second = np.stack([k[:-1, :-1], k[1:, 1:], k[:-1, 1:]], axis=-1)
    return vertices_m.reshape(-1, 3), np.concatenate([first.reshape(-1, 3), second.reshape(-1, 3)])


def hall(triangles: int) -> display_mesh.Mesh:
    """Floor, walls and nine pillars, of about so many triangles in chequered colours."""
    x, y, z = np.diag(SIZE_M)
    sides = [(0 * x, x, y), (0 * x, z, x), (y, x, z), (0 * x, y, z), (x, z, y)]
    for corner in np.array([[a, b, 0.0] for a in (3.7, 7.7, 11.7) for b in (2.7, 5.7, 8.7)]):
        u, v = np.array([0.6, 0.0, 0.0]), np.array([0.0, 0.6, 0.0])
        sides += [(corner, u, z), (corner + u, v, z), (corner + u + v, -u, z), (corner + v, -v, z)]
    area_m2 = sum(float(np.linalg.norm(np.cross(along, up))) for _, along, up in sides)
    edge_m = np.sqrt(2.0 * area_m2 / triangles)
    parts = []
    for origin, along, up in sides:
        vertices_m, faces = sheet(origin, along, up, edge_m)
        chequer = np.floor(2.0 * vertices_m).sum(axis=1, keepdims=True) % 2.0
        colours = (np.array([[110, 130, 150]]) + 80.0 * chequer).astype(np.uint8)
        parts.append(display_mesh.Mesh(vertices_m.astype(np.float32), faces.astype(np.int32), colours))
    return display_mesh.joined(parts)


def prepare(told: Connection, load: Callable[..., Tiles], *arguments: Any) -> None:
    """In a process of its own: what `load` takes of the process that it starts."""
    load(*arguments)
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    told.send((used.ru_utime + used.ru_stime, used.ru_maxrss * 1024e-6))


def preparing(*asked: Any) -> tuple[float, float]:
    """CPU time, s, and peak of memory, MB, of a preparation."""
    context = get_context("spawn")
    ours, theirs = context.Pipe(duplex=False)
    process = context.Process(target=prepare, args=(theirs, *asked))
    process.start()
    theirs.close()
    answer = ours.recv()
    process.join()
    return answer


def page_bytes() -> int:
    """What a browser loads of both pages, compressed as they are served."""
    ours = [gzip.compress(file.read_bytes()) for file in (Path(gcs_web.__file__).parent / "static").glob("*.*")]
    theirs = gzip.compress((Path(viser.__file__).parent / "client" / "build" / "index.html").read_bytes())
    return sum(map(len, ours)) + len(theirs)


def sent(shown: Tiles, chosen: Iterable[int], *, fine: bool) -> int:
    """Bytes of a level of tiles on their way to a browser: compressed as viser does."""
    compressor = zstandard.ZstdCompressor(level=12)
    return sum(len(compressor.compress(shown.level(tile, fine=fine).tobytes())) for tile in chosen)


def near(shown: Tiles, most: int) -> frozenset[int]:
    """What a browser gets in full in the middle of the hall."""
    return tiles.near(shown, 0.5 * np.array(SIZE_M), np.array([1.0, 0.0, 0.0]), most)


def mesh(opened: project.Project, triangles: int) -> list[Row]:
    made = hall(triangles)
    mesh_file.save(opened.map / "mesh.glb", made.vertices_m, made.faces, made.colours)
    folder = opened.folder / ".session"
    asked = (opened.map / "mesh.glb", display_mesh.DISPLAY_TRIANGLES, folder)
    cpu_s, peak_mb = preparing(display_mesh.load, *asked)
    shown = display_mesh.load(*asked)
    first_mb = 1e-6 * (sent(shown, range(len(shown)), fine=False) + page_bytes())
    with station_process(opened.folder) as station:
        station_mb = station.peak_mb
    name = f"mesh of {len(made.faces):,} triangles"
    close = near(shown, display_mesh.FINE_RATIO * display_mesh.DISPLAY_TRIANGLES)
    return [
        row(f"{name}: preparation, memory", peak_mb, "MB", "<= 400", peak_mb <= MOST_MB, peers={"CPU s": cpu_s}),
        row("the same: the station's memory, peak", station_mb, "MB", "<= 400", station_mb <= MOST_MB),
        row("the same: first picture", first_mb, "MB", "<= 2", first_mb <= 2.0, {"pages": 1e-6 * page_bytes()}),
        row("the same: in full near the camera", 1e-6 * sent(shown, close, fine=True), "MB",
            peers={"tiles": len(close), "of": len(shown), "triangles": int(shown.sizes[list(close)].sum())}),
    ]  # fmt: skip


def points(opened: project.Project, count: int) -> list[Row]:
    rng = np.random.default_rng(0)
    surface = hall(200_000)
    chosen = surface.faces[rng.integers(0, len(surface.faces), count), 0]
    source = opened.map / "localization" / "points.npz"
    source.parent.mkdir(exist_ok=True)
    np.savez(source, points_world_m=surface.vertices_m[chosen] + rng.normal(0.0, 0.02, (count, 3)))
    folder = opened.folder / ".session"
    cpu_s, peak_mb = preparing(display_points.load, source, folder)
    shown = display_points.load(source, folder)
    coarse_mb = 1e-6 * sent(shown, range(len(shown)), fine=False)
    close = near(shown, display_points.MOST_FINE_POINTS)
    begun_s = time.process_time()
    near(shown, display_points.MOST_FINE_POINTS)
    choice_ms = 1000.0 * (time.process_time() - begun_s)
    return [
        row(f"{count:,} points: preparation, memory", peak_mb, "MB", peers={"CPU s": cpu_s}),
        row("the same: first picture", coarse_mb, "MB", peers={"tiles": len(shown)}),
        row("the same: in full near the camera", 1e-6 * sent(shown, close, fine=True), "MB",
            peers={"tiles": len(close), "points": int(shown.sizes[list(close)].sum())}),
        row("the same: choice of tiles after a camera's move", choice_ms, "CPU ms"),
    ]  # fmt: skip


def rows(triangles: int = 1_000_000, count: int = 10_000_000) -> list[Row]:
    with tempfile.TemporaryDirectory() as name:
        opened = new_project(Path(name) / "project")
        return [*mesh(opened, triangles), *points(opened, count)]


if __name__ == "__main__":
    main(rows, triangles=1_000_000, count=10_000_000)
