"""The distance field against its bars and its peers, in one process: CPU seconds and ratios."""

import math
import multiprocessing
import tempfile
import time
from pathlib import Path

import numpy as np
from report import Row, cpu_seconds, main, row

from esdf import (
    FREE,
    OCCUPIED,
    Edit,
    Editor,
    Grid,
    SolidSource,
    build,
    build_blocks,
    certify,
    open_blocks,
    rasterize,
    solids,
)
from esdf.build import Recipe, transform
from flight import Trajectory

VOXEL_M, CAP_M = 0.05, 2.0


def boxes_map(n: int, rng: np.random.Generator) -> np.ndarray:
    """Free space with boxes up to 1.5 m: about 2 % occupied, like a furnished building."""
    state = np.full((n, n, n), FREE, np.uint8)
    for _ in range(60 * (n // 256) ** 3):
        low, size = rng.integers(0, n - 30, 3), rng.integers(3, 30, 3)
        state[tuple(slice(a, a + s) for a, s in zip(low, size, strict=True))] = OCCUPIED
    return state


def building() -> list[Row]:
    """512^3: capped and uncapped against `edt`, the memory bound, two threads."""
    import edt

    n = 512
    state = boxes_map(n, np.random.default_rng(0))
    grid = Grid((0, 0, 0), VOXEL_M, state.shape)
    out = np.empty(state.shape, np.float32)

    def ours(cap_m: float, threads: int = 1) -> None:
        recipe = Recipe.of(grid, cap_m, "nan")
        transform(recipe, state, grid.everything, out, recipe.faces, threads=threads)

    capped, uncapped = cpu_seconds(lambda: ours(CAP_M)), cpu_seconds(lambda: ours(math.inf))
    mask = state != OCCUPIED
    peer = cpu_seconds(lambda: edt.edt(mask, anisotropy=(VOXEL_M,) * 3, black_border=False, parallel=1))
    source = np.ones(1 << 28, np.uint8)
    target = np.empty_like(source)
    bytes_per_s = 2 * source.nbytes / cpu_seconds(lambda: np.copyto(target, source), 5)
    # State read, two-byte squares written and read once, distances written.
    bound = (1 + 2 + 2 + 4) * n**3 / bytes_per_s
    one, two = (min(_wall(lambda t=t: ours(CAP_M, t)) for _ in range(4)) for t in (1, 2))
    two_cpu = cpu_seconds(lambda: ours(CAP_M, 2)) / cpu_seconds(lambda: ours(CAP_M))
    ratio = peer / capped
    return [
        row(
            "512^3 capped at 2 m, signed",
            capped,
            "CPU s",
            "<= 0.30",
            capped <= 0.3,
            peers={"edt": peer, "memory bound": bound},
        ),
        row("  times faster than edt", ratio, "x", ">= 2", ratio >= 2),
        row("512^3 uncapped, signed", uncapped, "CPU s", peers={"edt": peer}),
        row("  times faster than edt", peer / uncapped, "x", ">= 1", peer >= uncapped),
        row("  two threads over one (wall)", one / two, "x", ">= 1.7", one / two >= 1.7),
        row("  CPU of both threads over one thread's", two_cpu, "x"),
    ]


def _wall(work) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def path_points(n: int, low, high, rng: np.random.Generator) -> np.ndarray:
    """Positions along a smooth flight, about 5 mm apart: 5 m/s at 1 kHz."""
    steps = rng.normal(0, 0.0005, (n, 3)).cumsum(axis=0).clip(-0.004, 0.004)
    span = np.asarray(high) - np.asarray(low)
    folded = np.abs((rng.uniform(0, 1, 3) * span + steps.cumsum(axis=0)) % (2 * span) - span)
    return np.asarray(low) + folded


def query_rates(field, low, high) -> tuple[float, float]:
    """Million values with gradients per CPU second: along paths (10,000 points a call), at random places."""
    rng = np.random.default_rng(1)
    path = np.split(path_points(400_000, low, high, rng), 40)
    scattered = rng.uniform(low, high, (1_000_000, 3))
    for points in (*path, scattered):
        field.distance_and_gradient(points)
    along = cpu_seconds(lambda: [field.distance_and_gradient(p) for p in path], 7)
    return 0.4 / along, 1.0 / cpu_seconds(lambda: field.distance_and_gradient(scattered), 5)


def asking() -> list[Row]:
    """Queries, certified clearance and an edit in 256^3."""
    rng = np.random.default_rng(2)
    state = boxes_map(256, rng)
    grid = Grid((0, 0, 0), VOXEL_M, state.shape)
    field = build(state, grid)
    along, scattered = query_rates(field, np.full(3, 0.1), grid.high_world_m - 0.1)
    path, arena = loop_among_pillars()
    verdict = certify(arena, path, 0.3)
    proof = cpu_seconds(lambda: certify(arena, path, 0.3), 9)
    editor = Editor(field)

    def edit() -> None:
        editor.apply(Edit("add", solids.Box((5, 5, 5), (6, 6, 7))))

    def edit_time() -> float:
        seconds = cpu_seconds(edit, 1)
        editor.undo()
        return seconds

    seconds = min(edit_time() for _ in range(9))
    edit()
    same = np.array_equal(editor.field.values_m, build(editor.field.state, grid).values_m)
    return [
        row("query value + gradient along paths", along, "M/s", ">= 100", along >= 100),
        row("query value + gradient at random", scattered, "M/s", ">= 20", scattered >= 20),
        row(f"certify 50 segments, 60 s ({verdict.reason})", 1e3 * proof, "CPU ms", "<= 2", proof <= 2e-3),
        row("edit a 1 x 1 x 2 m box", 1e3 * seconds, "CPU ms", "<= 6, bit-equal", seconds <= 6e-3 and same),
    ]


def loop_among_pillars():
    """A 50-segment, 60 s flight of degree 7 and the field of the arena it is flown in."""
    segments, duration_s = 50, 1.2
    sample_s = np.linspace(0.0, duration_s, 8)
    powers = np.vander(sample_s, 8, increasing=True)
    coefficients = np.zeros((segments, 4, 8))
    for i in range(segments):
        phase = 2 * np.pi * (i * duration_s + sample_s) / 60
        curve = np.stack([10 + 7 * np.cos(phase), 10 + 7 * np.sin(2 * phase), 2 + 0.8 * np.sin(3 * phase)])
        coefficients[i, :3] = np.linalg.solve(powers, curve.T).T
    path = Trajectory(np.full(segments, duration_s), coefficients)
    flown = path.position(path.sample(0.01))
    spots = np.random.default_rng(3).uniform(1, 19, (80, 2))
    far = [s for s in spots if np.linalg.norm(flown[:, :2] - s, axis=1).min() > 0.8]
    grid = Grid((0, 0, 0), VOXEL_M, (400, 400, 80))
    pillars = solids.Scene([solids.Cylinder((float(x), float(y), 2.0), 0.3, 4.0) for x, y in far])
    return path, build(rasterize(pillars, grid), grid)


def town(size_m: tuple[float, float, float], grid: Grid) -> SolidSource:
    """A floor with one house, wall or pillar on every 25 square metres."""
    rng = np.random.default_rng(4)
    parts: list[solids.Solid] = [solids.Box((-1, -1, -1), (size_m[0] + 1, size_m[1] + 1, 0.2))]
    for x, y in rng.uniform((0, 0), size_m[:2], (int(size_m[0] * size_m[1] / 25), 2)):
        height = float(rng.uniform(1, size_m[2]))
        if rng.random() < 0.5:
            width, depth = rng.uniform(0.3, 4, 2)
            parts.append(solids.Box((x, y, 0), (x + width, y + depth, height)))
        else:
            parts.append(solids.Cylinder((x, y, height / 2), float(rng.uniform(0.1, 0.5)), height))
    return SolidSource(parts, grid)


def large_map(size_m: tuple[float, float, float]) -> dict[str, float]:
    """Build a town on disk; in a process of its own, so that the memory measured is the build's."""
    grid = Grid.covering((0, 0, 0), size_m, VOXEL_M)
    with tempfile.TemporaryDirectory() as folder:
        target, source = Path(folder) / "town", town(size_m, grid)
        wall = cpu = math.inf
        for _ in range(1 if grid.voxels > 1e8 else 3):
            started = time.perf_counter(), time.process_time()
            field = build_blocks(target, source, grid, cap_m=CAP_M)
            wall, cpu = min(wall, time.perf_counter() - started[0]), min(cpu, time.process_time() - started[1])
        memory = peak_memory_gib()
        along, scattered = query_rates(field, np.full(3, 0.1), np.array(size_m) - 0.1)
        loaded = open_blocks(target, in_memory=True)
        in_memory = query_rates(loaded, np.full(3, 0.1), np.array(size_m) - 0.1)
        gathered = gather_rate(sum(file.stat().st_size for file in target.glob("*.values.npy")) // 4)
    return {
        "wall": wall,
        "ns": 1e9 * cpu / grid.voxels,
        "GiB": memory,
        "along": along,
        "scattered": scattered,
        "along in memory": in_memory[0],
        "scattered in memory": in_memory[1],
        "gathered": gathered,
        "voxels": grid.voxels,
    }


def gather_rate(values: int) -> float:
    """Million values per CPU second that NumPy fetches from random places of as many values: the memory's own pace."""
    memory = np.ones(values, np.float32)
    places = np.random.default_rng(6).integers(0, values, 1_000_000)
    return 1.0 / cpu_seconds(lambda: memory.take(places), 5)


def peak_memory_gib() -> float:
    """Most memory this process has held (`getrusage` would count what its parent held before starting it)."""
    status = Path("/proc/self/status").read_text()
    return float(next(line for line in status.splitlines() if line.startswith("VmHWM")).split()[1]) / 2**20


def large() -> list[Row]:
    """100 x 100 x 10 m at 5 cm on disk, and the cost per voxel of smaller maps."""
    sizes = [(5.0, 5.0, 5.0), (25.0, 20.0, 10.0), (100.0, 100.0, 10.0)]
    with multiprocessing.get_context("spawn").Pool(1, maxtasksperchild=1) as pool:
        results = pool.map(large_map, sizes, chunksize=1)
    big = results[-1]
    growth = big["ns"] / min(r["ns"] for r in results)
    return [
        row("100 x 100 x 10 m: wall", big["wall"], "s", "<= 90", big["wall"] <= 90),
        row("  memory of the build", big["GiB"], "GiB", "<= 8", big["GiB"] <= 8),
        *[row(f"  CPU per voxel, {r['voxels']:.0e} voxels", r["ns"], "ns") for r in results],
        row("  cost per voxel, largest over least", growth, "x", "flat: <= 1.5", growth <= 1.5),
        rate_row("along", big, 100),
        rate_row("scattered", big, None),
        rate_row("along in memory", big, 100),
        rate_row("scattered in memory", big, 20),
    ]


def rate_row(name: str, big: dict[str, float], bar: float | None) -> Row:
    peers = {"NumPy, single values": big["gathered"]} if "scattered" in name else {}
    if bar is None:
        return row(f"  query: {name}", big[name], "M/s", peers=peers)
    return row(f"  query: {name}", big[name], "M/s", f">= {bar}", big[name] >= bar, peers=peers)


def correctness() -> list[Row]:
    """1,000 random masks against scipy, and the quasi-Euclidean distance that incremental mappers use."""
    from scipy import ndimage

    rng = np.random.default_rng(5)
    worst = 0.0
    for _ in range(1000):
        shape = tuple(int(n) for n in rng.integers(2, 12, 3))
        state = np.where(rng.random(shape) < rng.uniform(0.01, 0.5), OCCUPIED, FREE).astype(np.uint8)
        state.flat[0], state.flat[-1] = OCCUPIED, FREE
        voxel = (VOXEL_M,) * 3 if rng.random() < 0.5 else tuple(rng.uniform(0.05, 0.3, 3))
        values = build(state, Grid((0, 0, 0), voxel, shape), cap_m=math.inf, unknown="nan", threads=1).values_m
        # Voxel centres at the odd places of a lattice of half voxels; a solid voxel covers 3^3 of its places.
        fine = np.zeros([2 * n + 1 for n in shape], bool)
        fine[1::2, 1::2, 1::2] = state == OCCUPIED
        fine = ndimage.binary_dilation(fine, np.ones((3, 3, 3)))
        truth = ndimage.distance_transform_edt(~fine, sampling=np.array(voxel) / 2)[1::2, 1::2, 1::2]
        outside = state == FREE
        worst = max(worst, float(np.abs(values - truth)[outside].max()))
    direction = np.sort(np.abs(rng.normal(size=(1_000_000, 3))), axis=1)
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    steps = np.diff(direction, axis=1, prepend=0.0) @ np.sqrt([3.0, 2.0, 1.0])
    return [
        row("largest difference from scipy, 1,000 masks", worst, "m", "rounding: <= 1e-6", worst <= 1e-6),
        row("quasi-Euclidean distance, for comparison: error up to", 100 * (steps.max() - 1), "%"),
    ]


def rows() -> list[Row]:
    """Benchmark the distance field."""
    return building() + asking() + large() + correctness()


if __name__ == "__main__":
    main(rows)
