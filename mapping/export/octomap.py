"""The voxels of a map as an OctoMap binary tree (`.bt`; Hornung et al., "OctoMap", 2013): occupied, free, unknown.

Exact, as both have cubes at multiples of their edge: each voxel is a leaf of the 16th level, and eight leaves of one
state are one leaf of the level above.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from esdf import FREE, OCCUPIED, UNKNOWN, Field
from flight import InputError

LEVELS = 16
_CENTRE = 1 << (LEVELS - 1)
"""Key of the voxel whose lower corner is the origin."""
_FREE, _OCCUPIED, _INNER = 1, 2, 3
"""What two bits say of a child; 0: unknown."""
_OFF_LATTICE = 1e-3
"""Of a voxel: rounding of an origin in metres."""


@dataclass(frozen=True, slots=True, eq=False)
class _Level:
    """The known nodes of a level, in the order of their Morton codes."""

    code: NDArray[np.int64]
    says: NDArray[np.uint8]


def encode(field: Field) -> bytes:
    """The file's bytes.

    Raises:
        InputError: the voxels are no cubes, not at multiples of their edge, too far from the origin, or all unknown.
    """
    level = _leaves(field)
    inner: list[tuple[NDArray[np.int64], NDArray[np.uint16]]] = []
    """Codes at the last level, and children, of the nodes that have some, from the last level up."""
    nodes = 1
    for height in range(1, LEVELS + 1):
        parent, start = np.unique(level.code >> 3, return_index=True)
        child = (level.code & 7).astype(np.uint16)
        words = np.bitwise_or.reduceat(level.says.astype(np.uint16) << (2 * child), start)
        is_leaf = np.zeros(len(parent), bool) if height == LEVELS else np.isin(words, [0x5555, 0xAAAA])
        has_children = ~is_leaf
        inner.append((parent[has_children] << (3 * height), words[has_children]))
        counts = np.diff(np.append(start, len(level.code)))
        nodes += int(counts[has_children].sum())
        says = np.where(words == 0x5555, _FREE, _OCCUPIED)
        level = _Level(parent, np.where(is_leaf, says, _INNER).astype(np.uint8))
    codes, words = (np.concatenate(each) for each in zip(*inner[::-1], strict=True))  # a parent before its children
    data = words[np.argsort(codes, kind="stable")].astype("<u2").tobytes()
    head = f"# Octomap OcTree binary file\nid OcTree\nsize {nodes}\nres {field.grid.voxel_m[0]!r}\ndata\n"
    return head.encode() + data


def _leaves(field: Field) -> _Level:
    grid = field.grid
    edge_m = grid.voxel_m[0]
    if set(grid.voxel_m) != {edge_m}:
        raise InputError(f"the voxels are {grid.voxel_m} m; OctoMap has cubes")
    first = grid.low_world_m / edge_m
    if np.abs(first - np.rint(first)).max() > _OFF_LATTICE:
        raise InputError(
            f"the map's voxels begin at {np.round(grid.low_world_m, 4).tolist()} m, OctoMap's lie at multiples of "
            f"{edge_m:g} m. Export the map before it was moved, or move it by such a multiple (goshawk map origin)"
        )
    cells = np.argwhere(field.state != UNKNOWN)
    if not len(cells):
        raise InputError("all of the map is unknown; OctoMap holds what is known")
    keys = cells + np.rint(first).astype(np.int64) + _CENTRE
    if keys.min() < 0 or keys.max() >= 2 * _CENTRE:
        raise InputError(f"the map reaches farther than {_CENTRE * edge_m:g} m from the origin, where OctoMap ends")
    code = sum(_spread(keys[:, axis]) << axis for axis in range(3))
    state = field.state[tuple(cells.T)]
    says = np.where(state == OCCUPIED, _OCCUPIED, np.where(state == FREE, _FREE, 0)).astype(np.uint8)
    order = np.argsort(code)
    return _Level(np.asarray(code, dtype=np.int64)[order], says[order])


def _spread(keys: NDArray[np.int64]) -> NDArray[np.int64]:
    """The bits of numbers below 2^16, two zeros between each."""
    for shift, mask in ((32, 0x1F00000000FFFF), (16, 0x1F0000FF0000FF), (8, 0x100F00F00F00F00F),
                        (4, 0x10C30C30C30C30C3), (2, 0x1249249249249249)):  # fmt: skip
        keys = (keys | keys << shift) & mask
    return keys
