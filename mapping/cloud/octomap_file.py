"""OctoMaps (`.bt`, `.ot`; Hornung et al., "OctoMap", 2013) as voxels: occupied, free and unknown as they state them."""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from esdf import FREE, OCCUPIED, UNKNOWN, Grid
from flight import FormatError, InputError, errors
from mapping import reach
from mapping.imported import MOST_TRACED, Space, require_few
from mapping.map_server import CELLS_M

SUFFIXES = (".bt", ".ot")
LEVELS = 16
MOST_NODES = 40_000_000
"""Reading takes 3 GB of memory."""
_HEADER_BYTES = 4096
_RECORDS = {
    ("binary", "OcTree"): np.dtype([("children", "<u2")]),
    ("binary", "ColorOcTree"): np.dtype([("children", "<u2")]),
    ("full", "OcTree"): np.dtype([("log_odds", "<f4"), ("children", "u1")]),
    ("full", "ColorOcTree"): np.dtype([("log_odds", "<f4"), ("colour", "u1", 3), ("children", "u1")]),
}
"""By kind of file and of tree: the record of a node, parents before children. A binary one is of inner nodes only,
with two bits for each child."""
_KINDS = {b"# Octomap OcTree binary file": "binary", b"# Octomap OcTree file": "full"}
_CENTRE = 1 << (LEVELS - 1)
_FREE_CHILD, _OCCUPIED_CHILD, _INNER_CHILD = 1, 2, 3


@dataclass(frozen=True, slots=True, eq=False)
class _Leaves:
    """Cubes of one state."""

    key: NDArray[np.int64]
    """(n, 3) of the first voxel of each."""
    height: NDArray[np.int64]
    """(n,) each is 2^height voxels wide."""
    state: NDArray[np.uint8]


def read(path: Path) -> Space:
    """The voxels of an OctoMap, of its resolution, in metres with z up; outside of its known leaves nothing is known.

    A voxel of an `.ot` file is occupied from a probability of .5 on, as OctoMap itself has it.

    Raises:
        InputError: there is no such file, it has too many nodes or voxels, or lies too far from the origin.
        FormatError: it is damaged, cut off or of another kind, or holds nothing.
    """
    if not path.is_file():
        raise errors.missing(path)
    records, edge_m = _records(path)
    leaves = _binary(path, records) if records.dtype.names == ("children",) else _full(path, records)
    if not len(leaves.key):
        raise FormatError(f"{path} holds neither free nor occupied space")
    low, high = leaves.key.min(axis=0), (leaves.key + (1 << leaves.height)[:, None]).max(axis=0)
    corners = edge_m * (np.stack([low, high]) - _CENTRE)
    reach.require_near_origin(corners, str(path))
    nx, ny, nz = (high - low).tolist()
    if nx * ny * nz > MOST_TRACED:  # more than a grid may have at all
        raise InputError(
            f"{path}: what it knows spans {nx * ny * nz / 1e6:,.0f} million voxels, at most {MOST_TRACED / 1e6:g} "
            "million are read: cut the map, or make it coarser"
        )
    grid = Grid(tuple(corners[0].tolist()), (edge_m, edge_m, edge_m), (nx, ny, nz))
    require_few(grid, f"cut {path.name}, or make it coarser")
    state = np.full(grid.shape, UNKNOWN, np.uint8)
    for (x, y, z), size, value in zip(
        (leaves.key - low).tolist(), (1 << leaves.height).tolist(), leaves.state, strict=True
    ):
        state[x : x + size, y : y + size, z : z + size] = value
    return Space(grid, state)


def _records(path: Path) -> tuple[NDArray[np.void], float]:
    """The records of the nodes, and the edge of a voxel in metres."""
    with path.open("rb") as file:
        head = file.read(_HEADER_BYTES)
    lines = head.split(b"\n")
    kind, end = (
        _KINDS.get(lines[0].rstrip()),
        next((k for k, line in enumerate(lines) if line.strip() == b"data"), None),
    )
    if kind is None or end is None:
        raise FormatError(f"{path} is no OctoMap, or its header is cut off; save it again")
    stated = {words[0]: words[1] for line in lines[:end] if len(words := line.decode("ascii", "replace").split()) == 2}
    record = _RECORDS.get((kind, stated.get("id", "")))
    if record is None:
        raise FormatError(f"{path} is of the kind {stated.get('id', '')[:40]!r}; OcTree and ColorOcTree are read")
    try:
        edge_m = float(stated.get("res", ""))
    except ValueError:
        edge_m = math.nan
    if not CELLS_M[0] <= edge_m <= CELLS_M[1]:
        raise InputError(
            f"{path}: voxels are {stated.get('res')} m; they must be within {CELLS_M[0]} and {CELLS_M[1]} m"
        )
    offset = sum(len(line) + 1 for line in lines[: end + 1])
    count, rest = divmod(path.stat().st_size - offset, record.itemsize)
    if count > MOST_NODES:
        raise InputError(
            f"{path} has {count / 1e6:.0f} million nodes, at most {MOST_NODES / 1e6:g} million are read: prune it"
        )
    if count < 1 or rest:
        raise _damaged(path)
    return np.fromfile(path, record, count, offset=offset), edge_m


def _damaged(path: Path) -> FormatError:
    return FormatError(f"{path} is damaged or cut off: its nodes are no tree; save it again")


def _binary(path: Path, records: NDArray[np.void]) -> _Leaves:
    words = records["children"].astype(np.int64)[:, None] >> np.arange(0, 16, 2) & 3
    key, height = _placed(path, words == _INNER_CHILD)
    node, child = np.nonzero((words == _FREE_CHILD) | (words == _OCCUPIED_CHILD))
    if (height[node] == 0).any():
        raise _damaged(path)
    state = np.where(words[node, child] == _OCCUPIED_CHILD, np.uint8(OCCUPIED), np.uint8(FREE))
    return _Leaves(_of_child(key[node], height[node], child), height[node] - 1, state)


def _full(path: Path, records: NDArray[np.void]) -> _Leaves:
    if not np.isfinite(records["log_odds"]).all():
        raise _damaged(path)
    children = (records["children"][:, None] >> np.arange(8) & 1).astype(bool)
    key, height = _placed(path, children)
    leaf = ~children.any(axis=1)
    state = np.where(records["log_odds"][leaf] >= 0.0, np.uint8(OCCUPIED), np.uint8(FREE))
    return _Leaves(key[leaf], height[leaf], state)


def _of_child(key: NDArray[np.int64], height: NDArray[np.int64], child: NDArray[np.int64]) -> NDArray[np.int64]:
    """(n, 3) the first key of children, of nodes of that height."""
    return key + ((child[:, None] >> np.arange(3) & 1) << (height - 1)[:, None])


def _placed(path: Path, has_child: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The first key (n, 3) and the height (n,) of each node, by which children (n, 8) of it follow, before any sibling.

    After a node and all below it, the count of children yet to come is one less than before it. So a node's sibling is
    the first later node with that count.
    """
    count = len(has_child)
    coming = np.concatenate([[0], np.cumsum(has_child.sum(axis=1) - 1)])
    if coming[-1] != -1 or (coming[:-1] < 0).any():
        raise _damaged(path)
    order = np.lexsort((np.arange(count + 1), coming))
    sorted_by = coming[order] * (count + 2) + order
    key, height = np.zeros((count, 3), np.int64), np.full(count, LEVELS, np.int64)
    nodes = np.zeros(1, np.int64)
    while len(nodes):
        if has_child[nodes[height[nodes] == 0]].any():
            raise _damaged(path)
        nodes = nodes[has_child[nodes].any(axis=1)]
        at = nodes + 1
        children = []
        for child in range(8):
            here = has_child[nodes, child]
            found = at[here]
            key[found] = _of_child(key[nodes[here]], height[nodes[here]], np.full(len(found), child))
            height[found] = height[nodes[here]] - 1
            wanted = (coming[found] - 1) * (count + 2) + found
            at[here] = order[np.minimum(np.searchsorted(sorted_by, wanted), count)]
            children.append(found)
        nodes = np.concatenate(children)
    return key, height
