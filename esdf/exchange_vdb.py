"""OpenVDB files (`.vdb`) for Houdini, Blender and others: distances as a sparse float grid, written.

File version 224, a `Tree_float_5_4_3`: a root, nodes of 32^3 nodes of 16^3 leaves of 8^3 voxels. Known voxels are
active. A leaf that is as far as the cap everywhere is stored as a tile, and what no leaf covers is the background: the
cap too. Nothing is compressed. Written from the format's description; checked by reading it with TinyVDB.
`mapping.cloud.vdb_tree` reads such files of all programs.
"""

import struct
import uuid
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from esdf.field import Field
from esdf.grid import UNKNOWN, Grid
from flight import file_format

VERSION = 224
LIBRARY = (9, 0)
MAGIC = 0x56444220
CREATOR = "Goshawk"
"""In the file's metadata: where it stands, active voxels are all that is known, and none is of another program."""
LEAF, LOWER, UPPER = 8, 16, 32
"""Along each axis: voxels of a leaf, leaves of a lower node, lower nodes of an upper node."""
ALL_VALUES = b"\x06"
"""Compression flag of a list of values: every value is stored, active or not."""


def export_vdb(path: Path, field: Field, *, name: str = "distance") -> None:
    """Write the distances as an OpenVDB float grid; index (i, j, k) is our voxel (i, j, k)."""
    values = np.where(np.isfinite(field.values_m), field.values_m, np.float32(field.cap_m)).astype(np.float32)
    grid = _grid(_Leaves(values, field.state != UNKNOWN, np.float32(field.cap_m)), field.grid, name)
    file_format.write_bytes(Path(path), _file(grid, name))


def _string(text: str) -> bytes:
    return struct.pack("<I", len(text)) + text.encode()


def _metadata(entries: dict[str, str]) -> bytes:
    return struct.pack("<I", len(entries)) + b"".join(
        _string(key) + _string("string") + _string(value) for key, value in entries.items()
    )


def _file(grid: tuple[bytes, bytes], name: str) -> bytes:
    """The whole file round one grid, whose topology and buffers are given."""
    topology, buffers = grid
    head = struct.pack("<qIII?", MAGIC, VERSION, *LIBRARY, True) + str(uuid.uuid4()).encode()
    head += _metadata({"creator": CREATOR}) + struct.pack("<I", 1)
    head += _string(name) + _string("Tree_float_5_4_3") + _string("")
    start = len(head) + 3 * 8
    blocks = start + len(topology)
    return head + struct.pack("<qqq", start, blocks, blocks + len(buffers)) + topology + buffers


def _grid(leaves: "_Leaves", grid: Grid, name: str) -> tuple[bytes, bytes]:
    """What comes before the leaves' values, and these."""
    scale = np.array(grid.voxel_m)
    # A VDB voxel's index is its centre.
    transform = np.stack([grid.low_world_m + 0.5 * scale, scale, scale, 1 / scale, 1 / scale**2, 0.5 / scale])
    head = struct.pack("<I", 0) + _metadata({"class": "unknown", "name": name})
    head += (
        _string("UniformScaleTranslateMap" if grid.cubic else "ScaleTranslateMap") + transform.astype("<f8").tobytes()
    )
    topology, buffers = leaves.tree()
    return head + topology, buffers


class _Leaves:
    """A dense field cut into leaves: values (nx, ny, nz, 512) and which are active."""

    def __init__(self, values: NDArray[np.float32], known: NDArray[np.bool_], background: np.float32) -> None:
        self.background = background
        self.values, self.active = _cut(values, background), _cut(known, np.False_)
        same = (self.values == background).all(axis=-1)
        self.tile = same & self.active.all(axis=-1)
        """Known, and as far as the cap throughout."""
        self.stored = ~(self.tile | (same & ~self.active.any(axis=-1)))

    def tree(self) -> tuple[bytes, bytes]:
        """Topology from the root down, and the buffers of the leaves in the same order."""
        uppers = list(_blocks(self.stored.shape, LOWER * UPPER))
        topology = [struct.pack("<IfII", 1, self.background, 0, len(uppers))]
        buffers: list[bytes] = []
        for corner in uppers:
            topology.append(struct.pack("<3i", *(LEAF * c for c in corner)))
            topology.append(self._upper(corner, buffers))
        return b"".join(topology), b"".join(buffers)

    def _upper(self, corner: tuple[int, ...], buffers: list[bytes]) -> bytes:
        there = np.zeros((UPPER,) * 3, bool)
        there[tuple(np.s_[: -(-(n - c) // LOWER)] for n, c in zip(self.stored.shape, corner, strict=True))] = True
        values = np.where(there, np.float32(0.0), self.background)
        lower = [
            self._lower(tuple(c + LOWER * int(i) for c, i in zip(corner, at, strict=True)), buffers)
            for at in np.argwhere(there)
        ]
        return _mask(there) + _mask(np.zeros_like(there)) + _listed(values) + b"".join(lower)

    def _lower(self, corner: tuple[int, ...], buffers: list[bytes]) -> bytes:
        part = tuple(slice(c, c + LOWER) for c in corner)
        stored, active = self.stored[part], self.active[part]
        child, tile = np.zeros((LOWER,) * 3, bool), np.zeros((LOWER,) * 3, bool)
        here = tuple(slice(n) for n in stored.shape)
        child[here], tile[here] = stored, self.tile[part]
        values = np.where(child, np.float32(0.0), self.background)
        masks = np.packbits(active[stored], axis=-1, bitorder="little")
        leaves = np.empty(len(masks), [("mask", np.uint8, 64), ("how", "S1"), ("values", "<f4", LEAF**3)])
        leaves["mask"], leaves["how"], leaves["values"] = masks, ALL_VALUES, self.values[part][stored]
        buffers.append(leaves.tobytes())
        return _mask(child) + _mask(tile) + _listed(values) + masks.tobytes()


def _cut(array: np.ndarray, fill: np.generic) -> np.ndarray:
    """(nx, ny, nz) voxels to (mx, my, mz, 512), filled up to whole leaves."""
    beyond = -np.array(array.shape) % LEAF
    padded = np.pad(array, np.stack([0 * beyond, beyond], axis=1), constant_values=fill)
    mx, my, mz = (n // LEAF for n in padded.shape)
    return padded.reshape(mx, LEAF, my, LEAF, mz, LEAF).transpose(0, 2, 4, 1, 3, 5).reshape(mx, my, mz, LEAF**3)


def _blocks(shape: tuple[int, ...], edge: int) -> Iterator[tuple[int, ...]]:
    for at in np.ndindex(*(-(-n // edge) for n in shape)):
        yield tuple(edge * i for i in at)


def _mask(bits: NDArray[np.bool_]) -> bytes:
    return np.packbits(bits.ravel(), bitorder="little").tobytes()


def _listed(values: NDArray[np.float32]) -> bytes:
    return ALL_VALUES + values.astype("<f4").tobytes()
