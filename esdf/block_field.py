"""A distance field that stays on disk: bricks are memory-mapped, so only those that a query needs are read."""

import hashlib
import math
import os
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from esdf import _esdf
from esdf.blocks import BRICK, CHUNK, EditedSource, Mapper, Source, build_chunks, chunk_regions, uniform_values
from esdf.build import Recipe, build
from esdf.edits import EDITS, Edit, differing, load_edits, save_edits
from esdf.field import Field, Policy, SampledField
from esdf.grid import Grid, Region, StateArray
from esdf.solids import covered_region
from flight import FloatArray, FormatError, InputError, Progress, file_format, silent

FORMAT = "goshawk-esdf-blocks"
VERSION = 1


@dataclass(frozen=True, eq=False)
class BlockField(SampledField):
    """The same answers as a `Field` of the same map, bit by bit, from memory-mapped bricks."""

    folder: Path
    grid: Grid
    cap_m: float
    unknown: Policy
    hash: str
    """Hash of everything that determines the values."""
    edits: tuple[Edit, ...]
    """Edits that were applied on top of the mapped states; kept in `edits.json` beside them."""
    _addresses: NDArray[np.uint64] = field(repr=False)
    """Where each brick of distances begins in memory; uniform bricks share one."""
    _states: dict[str, tuple[NDArray[np.int32], StateArray]] = field(repr=False)
    """Per chunk: the index of its bricks of states, and the bricks."""
    _mapped: list[np.ndarray] = field(repr=False)
    """Keeps the memory behind `_addresses` alive."""

    def _query(self, points: FloatArray, out: FloatArray, gradient: FloatArray | None) -> None:
        grid = self.grid
        _esdf.query_bricks(
            self._addresses, grid.shape, grid.origin_world_m, grid.voxel_m, points, out, gradient, "best"
        )

    def _states_at(self, index: NDArray[np.int64]) -> StateArray:
        states = np.empty(len(index), np.uint8)
        chunks, of = np.unique(index // np.array(CHUNK), axis=0, return_inverse=True)
        for number, chunk in enumerate(chunks):
            mine = np.flatnonzero(of.ravel() == number)
            bricks, stored = self._states["chunk_{}_{}_{}".format(*chunk)]
            local = index[mine] - chunk * np.array(CHUNK)
            code = bricks[tuple((local // BRICK).T)]
            kept = code >= 0
            states[mine[~kept]] = -1 - code[~kept]
            states[mine[kept]] = stored[(code[kept], *(local[kept] % BRICK).T)]
        return states

    def states(self, region: Region) -> StateArray:
        """The states of a box of voxels; so a block field can be the source of another."""
        states = np.empty(region.shape, np.uint8)
        for name, chunk in chunk_regions(self.grid):
            common = chunk.common(region)
            if not common.empty:
                bricks, stored = self._states[name]
                states[common.relative_to(region).slices] = _assemble(bricks, stored, common.relative_to(chunk))
        return states

    def crop(self, region: Region) -> Field:
        """A part of the map in memory, as a map of its own (everything outside of it is unknown there)."""
        return build(self.states(region), self.grid.part(region), cap_m=self.cap_m, unknown=self.unknown)


def _assemble(bricks: NDArray[np.int32], stored: StateArray, region: Region) -> StateArray:
    """A box of a chunk's states from its bricks."""
    first = [a // BRICK for a in region.low]
    last = [math.ceil(b / BRICK) for b in region.high]
    whole = np.empty([(b - a) * BRICK for a, b in zip(first, last, strict=True)], np.uint8)
    for at in np.ndindex(*[b - a for a, b in zip(first, last, strict=True)]):
        code = bricks[at[0] + first[0], at[1] + first[1], at[2] + first[2]]
        place = tuple(slice(i * BRICK, (i + 1) * BRICK) for i in at)
        whole[place] = stored[code] if code >= 0 else -1 - code
    inner = Region(*[tuple(c - f * BRICK for c, f in zip(corner, first, strict=True)) for corner in region])  # pyright: ignore[reportArgumentType]
    return whole[inner.slices]


def build_blocks(
    folder: Path,
    source: Source,
    grid: Grid,
    *,
    cap_m: float = 2.0,
    unknown: Policy = "obstacle",
    edits: Sequence[Edit] | None = None,
    executor: Mapper | Executor | None = None,
    progress: Progress = silent,
) -> BlockField:
    """Build a map of any size on disk; an earlier one in `folder` stays until this one is complete.

    Args:
        source: Called with boxes of voxels, returns their states: `ArraySource`, `SolidSource`, `BlockField.states`...
        edits: Replayed on top, and saved with the map. None: those of the earlier map in `folder`, if there is one.
        executor: Runs the work: None for one thread per core, any `concurrent.futures.Executor`, or
            `client.get_executor()` of a Dask cluster (workers write to `folder`, which they must share). The result is
            the same bytes in every case.
    """
    made = _Making(
        Path(folder), source, grid, cap_m, unknown, _list_in(Path(folder)) if edits is None else tuple(edits)
    )
    return made.write({}, executor, progress)


def update_blocks(
    folder: Path,
    source: Source,
    changed: Region | Sequence[Region],
    *,
    edits: Sequence[Edit] | None = None,
    executor: Mapper | Executor | None = None,
    progress: Progress = silent,
) -> BlockField:
    """Rebuild the chunks that depend on boxes of voxels whose states changed (mapped anew, or edited); keep the rest.

    The result is the same bytes as a full rebuild. Fields opened before keep showing the old map.
    """
    folder = Path(folder)
    old = open_blocks(folder)
    reach = Recipe.of(old.grid, old.cap_m, old.unknown).reach
    margin = tuple(r + 1 for r in reach)
    boxes = [changed] if isinstance(changed, Region) else changed
    windows = [box.grown(margin, old.grid.shape) for box in boxes if not box.empty]  # pyright: ignore[reportArgumentType]
    stale = {n for n, region in chunk_regions(old.grid) if any(not region.common(w).empty for w in windows)}
    hashes: dict[str, str] = file_format.read_toml(folder / "blocks.toml", format=FORMAT, version=VERSION)["chunks"]
    kept = {name: hash for name, hash in hashes.items() if name not in stale}
    new = old.edits if edits is None else tuple(edits)
    return _Making(folder, source, old.grid, old.cap_m, old.unknown, new).write(kept, executor, progress)


def edit_blocks(
    folder: Path,
    source: Source,
    edits: Sequence[Edit],
    *,
    executor: Mapper | Executor | None = None,
    progress: Progress = silent,
) -> BlockField:
    """Replace the list of edits; it is saved with the map, and only the chunks that it affects are rebuilt.

    To add one: `edit_blocks(folder, source, [*field.edits, edit])`; to undo the last: pass `field.edits[:-1]`.

    Args:
        source: The states as mapped, without edits: what `build_blocks` was called with.
    """
    old = open_blocks(folder)
    reached = [covered_region(e.solid, old.grid) for e in differing(old.edits, tuple(edits))]
    return update_blocks(folder, source, reached, edits=edits, executor=executor, progress=progress)


@dataclass(frozen=True, slots=True)
class _Making:
    """A map in blocks that is being written."""

    folder: Path
    source: Source
    grid: Grid
    cap_m: float
    unknown: Policy
    edits: tuple[Edit, ...]

    def write(self, kept: Mapping[str, str], executor: Mapper | Executor | None, progress: Progress) -> BlockField:
        """Build all chunks but the `kept` ones, which are taken over from the old map; each has its hash."""
        edited = EditedSource(self.source, self.grid, self.edits) if self.edits else self.source
        names = [name for name, _ in chunk_regions(self.grid)]
        stale = [name for name in names if name not in kept]
        try:
            with file_format.atomic_folder(self.folder) as temporary:
                for file in (f for name in kept for f in self.folder.glob(f"{name}.*.npy")):
                    os.link(file, temporary / file.name)
                built = build_chunks(
                    temporary, edited, self.grid, cap_m=self.cap_m, unknown=self.unknown, executor=executor, only=stale,
                    progress=progress,
                )  # fmt: skip
                self._write_contents(temporary, {name: kept.get(name) or built[name] for name in names})
        except OSError as error:
            raise InputError(
                f"{self.folder}: no distance field was written ({error.strerror or error}); the old one stays"
            ) from error
        return open_blocks(self.folder)

    def _write_contents(self, folder: Path, hashes: dict[str, str]) -> None:
        body = {
            **self.grid.as_dict(),
            "cap_m": float(self.cap_m),
            "unknown": self.unknown,
            "chunk": list(CHUNK),
            "chunks": hashes,
        }
        file_format.write_toml(folder / "blocks.toml", format=FORMAT, version=VERSION, body=body)
        if self.edits:
            save_edits(folder / EDITS, self.edits)


def _list_in(folder: Path) -> tuple[Edit, ...]:
    """The edits saved with a map; none, if there is no map."""
    return load_edits(folder / EDITS) if (folder / EDITS).exists() else ()


def open_blocks(folder: Path, *, in_memory: bool = False) -> BlockField:
    """Open a map that `build_blocks` made. Reads the indices alone; bricks are read on demand.

    Args:
        in_memory: Read all bricks now, so that no query waits for the disk. It gains nothing once the system has
            cached them.

    Raises:
        InputError: there is none in `folder`.
        FormatError: it is damaged, or newer than this version.
    """
    folder = Path(folder)
    document = file_format.read_toml(folder / "blocks.toml", format=FORMAT, version=VERSION)
    try:
        grid = Grid.from_dict(document)
        cap_m, unknown = float(document["cap_m"]), document["unknown"]
        if tuple(document["chunk"]) != CHUNK:
            raise ValueError(f"its chunks are {document['chunk']}, not {list(CHUNK)}")
        recipe = (grid.origin_world_m, grid.voxel_m, grid.shape, cap_m, unknown, sorted(document["chunks"].items()))
        addresses, states, mapped = _map_files(folder, grid, cap_m, in_memory)
    except (KeyError, TypeError, ValueError, EOFError, OSError, InputError) as error:
        raise FormatError(
            f"{folder} holds a damaged distance field: {file_format.damage_text(error)}; build the map again"
        ) from error
    digest = hashlib.sha256(repr(recipe).encode()).hexdigest()
    return BlockField(folder, grid, cap_m, unknown, digest, _list_in(folder), addresses, states, mapped)


def _map_files(
    folder: Path, grid: Grid, cap_m: float, in_memory: bool
) -> tuple[NDArray[np.uint64], dict[str, tuple[NDArray[np.int32], StateArray]], list[np.ndarray]]:
    shared = [np.full((BRICK + 1,) * 3, value, np.float32) for value in uniform_values(cap_m)]
    mapped: list[np.ndarray] = [*shared]
    shared_addresses = np.array([s.ctypes.data for s in shared], np.uint64)
    addresses = np.zeros([math.ceil(n / BRICK) for n in grid.shape], np.uint64)
    states: dict[str, tuple[NDArray[np.int32], StateArray]] = {}
    for name, region in chunk_regions(grid):
        index, bricks = _load_bricks(folder / f"{name}.values", region, np.float32, BRICK + 1)
        if in_memory:
            bricks = np.array(bricks)
        mapped.append(bricks)
        place = tuple(slice(a // BRICK, math.ceil(b / BRICK)) for a, b in zip(*region, strict=True))
        inside = np.uint64(bricks.ctypes.data) + index.astype(np.uint64) * np.uint64((BRICK + 1) ** 3 * 4)
        addresses[place] = np.where(index >= 0, inside, shared_addresses[np.maximum(-1 - index, 0)])
        states[name] = _load_bricks(folder / f"{name}.states", region, np.uint8, BRICK)
    return addresses, states, mapped


def _load_bricks(path: Path, region: Region, kind: type, edge: int) -> tuple[NDArray[np.int32], np.ndarray]:
    index = np.load(path.with_suffix(path.suffix + ".index.npy"))
    file = path.with_suffix(path.suffix + ".npy")
    # An empty file cannot be memory-mapped: every brick of that chunk is uniform.
    stored = max(int(index.max()) + 1, 0)
    bricks = np.load(file, mmap_mode="r") if stored > 0 else np.empty((0, edge, edge, edge), kind)
    expected = tuple(math.ceil(n / BRICK) for n in region.shape)
    if (
        index.shape != expected
        or index.min() < -3
        or bricks.shape != (stored, edge, edge, edge)
        or bricks.dtype != kind
    ):
        raise ValueError(f"{file.name} does not fit its index")
    return index, bricks
