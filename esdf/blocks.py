"""Maps too large for memory: built chunk by chunk, each with a halo, by any number of workers with the same result.

A distance capped at D depends on states within D only, so a chunk with a halo of D is as exact as the whole map: every
engine (one core, threads, processes, a Dask cluster) writes the same bytes. A chunk's values are cut into bricks of
16^3 voxels; bricks of one value everywhere are not stored.
"""

import hashlib
import math
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from esdf import _esdf
from esdf.build import FARTHEST_M, Recipe, cores, transform
from esdf.edits import Edit, replay
from esdf.field import Policy
from esdf.grid import FREE, OCCUPIED, UNKNOWN, Grid, Region, StateArray
from esdf.solids import Solid, touched
from flight import InputError, Progress, silent

BRICK = 16
CHUNK = (256, 256, 256)
"""Voxels of one chunk: large enough that the halo costs little, small enough that a worker needs 200 MB."""

Source = Callable[[Region], StateArray]
"""Returns the states of any box of voxels; called from several threads at once; processes and Dask pickle it."""


@dataclass(frozen=True, slots=True)
class ArraySource:
    """States from an array or a memory-mapped `.npy` (give its path to build with processes or Dask)."""

    array: StateArray | Path

    def __call__(self, region: Region) -> StateArray:
        array = np.load(self.array, mmap_mode="r") if isinstance(self.array, Path) else self.array
        return np.ascontiguousarray(array[region.slices])


@dataclass(frozen=True, slots=True)
class SolidSource:
    """States from closed-form solids: a world of any size without storing it."""

    solids: Sequence[Solid]
    grid: Grid

    def __call__(self, region: Region) -> StateArray:
        state = np.full(region.shape, FREE, np.uint8)
        low, high = self.grid.part(region).low_world_m, self.grid.part(region).high_world_m
        for solid in self.solids:
            solid_low, solid_high = solid.bounds_world_m
            margin = np.array(self.grid.voxel_m)
            box = self.grid.region(np.maximum(solid_low - margin, low), np.minimum(solid_high + margin, high))
            part = box.common(region)
            if not part.empty:
                state[part.relative_to(region).slices][touched(solid, self.grid, part)] = OCCUPIED
        return state


@dataclass(frozen=True, slots=True)
class EditedSource:
    """Another source, with edits replayed on top."""

    mapped: Source
    grid: Grid
    edits: tuple[Edit, ...]

    def __call__(self, region: Region) -> StateArray:
        return replay(self.mapped(region), self.grid, self.edits, region)


@dataclass(frozen=True, slots=True)
class ChunkJob:
    """All a worker anywhere needs to build one chunk."""

    folder: Path
    name: str
    region: Region
    source: Source
    grid: Grid
    cap_m: float
    unknown: Policy


def chunk_regions(grid: Grid, chunk: tuple[int, int, int] = CHUNK) -> Iterator[tuple[str, Region]]:
    """The chunks of a grid with their file names."""
    counts = [math.ceil(n / c) for n, c in zip(grid.shape, chunk, strict=True)]
    for index in np.ndindex(*counts):
        low = tuple(i * c for i, c in zip(index, chunk, strict=True))
        high = tuple(min(a + c, n) for a, c, n in zip(low, chunk, grid.shape, strict=True))
        yield "chunk_{}_{}_{}".format(*index), Region(low, high)  # pyright: ignore[reportArgumentType]


def uniform_values(cap_m: float) -> np.ndarray:
    """The values a brick may have throughout without being stored; `index` -1 - k means the k-th."""
    return np.array([cap_m, -cap_m, np.nan], np.float32)


def build_chunk(job: ChunkJob) -> str:
    """Build one chunk and write its files; returns a hash of its states."""
    recipe = Recipe.of(job.grid, job.cap_m, job.unknown)
    # One more layer on the upper sides: bricks overlap, so that no cell spans two.
    wanted = Region(job.region.low, job.region.grown((1, 1, 1), job.grid.shape).high)
    window = wanted.grown(recipe.reach, job.grid.shape)
    state = np.ascontiguousarray(job.source(window), dtype=np.uint8)
    if state.shape != window.shape or state.max() > OCCUPIED:
        raise InputError(f"the source gave {state.shape} with states up to {state.max()} for a box of {window.shape}")
    values = np.empty(wanted.shape, np.float32)
    faces = recipe.faces & _outer_faces(window, job.grid)
    transform(recipe, state, wanted.relative_to(window), values, faces, threads=1)
    own = np.ascontiguousarray(state[job.region.relative_to(window).slices])
    _write_bricks(job.folder / f"{job.name}.values", values, job.region, uniform_values(job.cap_m))
    _write_bricks(job.folder / f"{job.name}.states", own, job.region, np.array([UNKNOWN, FREE, OCCUPIED], np.uint8))
    return hashlib.sha256(repr(job.region).encode() + own.tobytes()).hexdigest()


def _outer_faces(window: Region, grid: Grid) -> int:
    """Bits of the faces of a window that are faces of the grid."""
    low = sum(1 << (2 * a) for a in range(3) if window.low[a] == 0)
    return low + sum(2 << (2 * a) for a in range(3) if window.high[a] == grid.shape[a])


def _write_bricks(path: Path, array: np.ndarray, region: Region, uniform: np.ndarray) -> None:
    bricks = tuple(math.ceil(n / BRICK) for n in region.shape)
    overlap = 1 if array.dtype == np.float32 else 0
    cut = _esdf.cut_distance_bricks if overlap else _esdf.cut_state_bricks
    index = np.empty(bricks, np.int32)
    stored = np.empty((index.size, *(BRICK + overlap,) * 3), array.dtype)
    count = cut(array, overlap, uniform, stored, index)
    np.save(path.with_suffix(path.suffix + ".index.npy"), index)
    np.save(path.with_suffix(path.suffix + ".npy"), stored[:count])


class Mapper(Protocol):
    """The interface of an executor: `concurrent.futures.Executor`, or `dask.distributed.Client.get_executor()`."""

    def map(self, function: Callable[[ChunkJob], str], jobs: Iterable[ChunkJob], /) -> Iterator[str]: ...


def build_chunks(
    folder: Path,
    source: Source,
    grid: Grid,
    *,
    cap_m: float,
    unknown: Policy,
    executor: Mapper | Executor | None = None,
    only: Collection[str] | None = None,
    progress: Progress = silent,
) -> dict[str, str]:
    """Build chunks into `folder` (which exists), all or only the named ones; returns each one's hash."""
    if not cap_m < FARTHEST_M:
        raise InputError(f"cap_m is {cap_m:g}; a map built in chunks needs a bound, a few metres")
    jobs = [
        ChunkJob(Path(folder), name, region, source, grid, cap_m, unknown)
        for name, region in chunk_regions(grid)
        if only is None or name in only
    ]
    if executor is None:
        with ThreadPoolExecutor(cores()) as threads:
            return _collect(threads, jobs, progress)
    return _collect(executor, jobs, progress)


def _collect(executor: Mapper | Executor, jobs: list[ChunkJob], progress: Progress) -> dict[str, str]:
    hashes: dict[str, str] = {}
    for job, digest in zip(jobs, executor.map(build_chunk, jobs), strict=True):
        hashes[job.name] = digest
        progress("distance field", len(hashes) / len(jobs))
    return hashes
