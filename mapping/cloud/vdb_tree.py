"""OpenVDB files (`.vdb`): the one float grid of a file, as dense voxels.

Read are files of version 222 on (OpenVDB 3, 2014), of 32 or 16 bits a value, without compression, by zlib, or by Blosc
with LZ4, which OpenVDB writes itself. Written from OpenVDB's description of its format (`io/Compression.h`,
`tree/InternalNode.h`, `tree/LeafNode.h`) and Blosc's; checked by files of OpenVDB 10.
"""

import struct
import zlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from esdf.exchange_vdb import LEAF, LOWER, MAGIC, UPPER
from esdf.grid import Grid
from flight import FloatArray, FormatError, InputError

OLDEST = 222
_ZIP, _MASKED, _BLOSC = 1, 2, 4
"""Bits of a grid's compression."""
_HALF = "_HalfFloat"
_KINDS = ("Tree_float_5_4_3", "Tree_float_5_4_3" + _HALF)
_SCALES = ("UniformScaleMap", "ScaleMap", "UniformScaleTranslateMap", "ScaleTranslateMap")
_ALL_VALUES = 6
"""How the values of a node may be listed: all are there, those off the mask too."""
_ONE_OTHER, _TWO_OTHERS = (2, 4, 5), 5
"""Those where one value, and a second one, is written before the list."""
_CHOSEN = (3, 4, 5)
"""Those where a mask follows that chooses between two values off the node's mask."""
_SHUFFLED, _PLAIN, _WHOLE, _LZ4 = 0x01, 0x02, 0x10, 1
"""Of Blosc's flags: bytes of a number apart, not compressed, not split by bytes; and the number of its LZ4."""
_BLOSC_HEAD = struct.Struct("<4B3I")
_LEAF = (LEAF, LEAF, LEAF)
_TOO_LONG = 1 << 20
"""Bytes of a name or of metadata that no file has."""


@dataclass(frozen=True, slots=True, eq=False)
class Volume:
    """A float grid on the box about its active voxels."""

    grid: Grid
    """In the file's numbers and axes."""
    value: NDArray[np.float32]
    """(nx, ny, nz)."""
    active: NDArray[np.bool_]
    """(nx, ny, nz)."""
    background: float
    """The value of all that the file does not store."""
    name: str
    kind: str
    """OpenVDB's class: `level set`, `fog volume`, or another; empty where none is stated."""
    creator: str
    """Of the file, where it states one."""


@dataclass(frozen=True, slots=True)
class _Grid:
    """What a file says of a grid before its contents."""

    name: str
    tree: str
    instance_of: str
    start: int
    end: int


@dataclass(slots=True)
class _Tree:
    """What the nodes of a tree hold, in voxels of its lattice."""

    background: np.float32
    tiles: list[tuple[NDArray[np.int64], int, NDArray[np.float32], NDArray[np.bool_]]]
    """Lowest voxels (n, 3), edge in voxels, values and activity (n,)."""
    corners: list[NDArray[np.int64]]
    """(n, 3) lowest voxels of leaves, in the order of their values."""
    masks: list[NDArray[np.uint8]]
    """(n, 64) active voxels of these, a bit each."""


class _Bytes:
    """A file's bytes, read from the front."""

    def __init__(self, data: memoryview) -> None:
        self.data, self.at = data, 0

    def take(self, count: int) -> memoryview:
        if not 0 <= count <= len(self.data) - self.at:
            raise ValueError("it ends in the middle of its grid")
        self.at += count
        return self.data[self.at - count : self.at]

    def numbers(self, layout: str) -> tuple[int, ...]:
        return struct.unpack(f"<{layout}", self.take(struct.calcsize(f"<{layout}")))

    def text(self) -> str:
        (size,) = self.numbers("I")
        if size > _TOO_LONG:
            raise ValueError(f"a name of {size} bytes")
        return bytes(self.take(size)).decode("utf-8", "replace")

    def mask(self, bits: int) -> NDArray[np.bool_]:
        return np.unpackbits(np.frombuffer(self.take(bits // 8), np.uint8), bitorder="little").astype(bool)

    def metadata(self) -> dict[str, str]:
        """Those that are texts."""
        texts = dict[str, str]()
        for _ in range(self.numbers("I")[0]):
            name, kind, value = self.text(), self.text(), self.take(self.numbers("I")[0])
            if kind == "string":
                texts[name] = bytes(value).decode("utf-8", "replace")
        return texts


def read(path: Path, *, at_most: int) -> Volume:
    """The one float grid of a file; grids of other kinds beside it are passed over.

    Args:
        at_most: voxels of the box about all active ones.

    Raises:
        InputError: the box has more voxels, several grids are there, or it is of a kind that is not read.
        FormatError: it is damaged or cut off, or no OpenVDB file.
    """
    file = _Bytes(memoryview(path.read_bytes()))
    try:
        creator, grids = _heads(path, file)
        chosen = _chosen(path, grids)
        file.data, file.at = file.data[: chosen.end], chosen.start
        return _volume(path, file, chosen, creator, at_most)
    except (ValueError, IndexError, TypeError, struct.error, zlib.error, OSError, OverflowError) as error:
        raise FormatError(f"{path} is no whole OpenVDB file: {error}; export it again") from error


def _heads(path: Path, file: _Bytes) -> tuple[str, list[_Grid]]:
    """The file's creator, and what it says of each grid."""
    if len(file.data) < 8 or file.numbers("q") != (MAGIC,):
        raise FormatError(f"{path} is no OpenVDB file, or damaged: it does not begin as one; export it again")
    version, *_, has_offsets = file.numbers("III?")
    if version < OLDEST:
        raise InputError(f"{path} is of OpenVDB's format {version}, {OLDEST} on are read: save it with a newer OpenVDB")
    file.take(36)  # a random name
    creator = file.metadata().get("creator", "")
    if not has_offsets:
        raise InputError(f"{path} was written as a stream, without places of its grids: save it to a file")
    grids = []
    for _ in range(file.numbers("I")[0]):
        name, tree, instance = file.text().split("\x1e")[0], file.text(), file.text()
        start, _, end = file.numbers("qqq")
        if not 0 <= start <= end <= len(file.data):
            raise ValueError(f"grid {name!r} is cut off")
        grids.append(_Grid(name, tree, instance, start, end))
        file.at = end
    return creator, grids


def _chosen(path: Path, grids: list[_Grid]) -> _Grid:
    found = [grid for grid in grids if grid.tree in _KINDS]
    if len(found) == 1 and not found[0].instance_of:
        return found[0]
    names = ", ".join(f"{grid.name or 'without name'} ({grid.tree})" for grid in grids)[:200] or "none"
    what = "several float grids" if found else "no float grid"
    raise InputError(f"{path} holds {what}; its grids: {names}. Save one grid of distances, as floats, alone")


def _volume(path: Path, file: _Bytes, chosen: _Grid, creator: str, at_most: int) -> Volume:
    (compression,) = file.numbers("I")
    stated = file.metadata()
    low_m, voxel_m = _lattice(path, file)
    half = chosen.tree.endswith(_HALF)
    tree = _topology(file, compression, half=half)
    first, shape = _box(path, tree, at_most)
    value = np.full(shape, tree.background, np.float32)
    active = np.zeros(shape, bool)
    _fill_tiles(tree, first, value, active)
    for corner in (np.concatenate([np.zeros((0, 3), np.int64), *tree.corners]) - first).tolist():
        mask = file.mask(LEAF**3)
        values = _values(file, mask, tree.background, compression, half=half)
        place = tuple(slice(max(a, 0), max(a + LEAF, 0)) for a in corner)
        part = tuple(slice(max(-a, 0), max(-a, 0) + n) for a, n in zip(corner, value[place].shape, strict=True))
        value[place], active[place] = values.reshape(_LEAF)[part], mask.reshape(_LEAF)[part]
    grid = Grid(tuple(low_m + voxel_m * (first - 0.5)), tuple(voxel_m), shape)
    return Volume(grid, value, active, float(tree.background), chosen.name, stated.get("class", ""), creator)


def _lattice(path: Path, file: _Bytes) -> tuple[FloatArray, FloatArray]:
    """The middle of voxel (0, 0, 0), and the edges of voxels (3,)."""
    kind = file.text()
    start, edges = np.zeros(3), np.full(3, np.nan)
    if kind in _SCALES:
        vectors = np.array(file.numbers("18d" if "Translate" in kind else "15d")).reshape(-1, 3)
        start, edges = (vectors[0], vectors[1]) if "Translate" in kind else (start, vectors[0])
    elif kind == "AffineMap":
        matrix = np.array(file.numbers("16d")).reshape(4, 4)  # of rows: place @ matrix
        if not np.abs(matrix[:3, :3] - np.diag(np.diag(matrix))[:3, :3]).max() > 1e-9 * np.abs(matrix[:3, :3]).max():
            start, edges = matrix[3, :3], np.diag(matrix)[:3]
    elif kind == "TranslationMap":
        start, edges = np.array(file.numbers("3d")), np.ones(3)
    if not (np.isfinite([start, edges]).all() and (edges > 0.0).all()):
        raise InputError(
            f"{path}: its voxels are turned, mirrored or of no fixed size ({kind[:40]}); resample it along the axes"
        )
    return start, edges


def _topology(file: _Bytes, compression: int, *, half: bool) -> _Tree:
    """Of the tree, all but the values of its leaves."""
    buffers, background, tiles, children = file.numbers("IfII")
    if buffers != 1:
        raise ValueError(f"its leaves have {buffers} values a voxel")
    tree = _Tree(np.float32(background), [], [], [])
    for _ in range(tiles):
        *corner, value, is_active = file.numbers("3if?")
        one = np.array([value], np.float32), np.array([is_active])
        tree.tiles.append((np.array([corner], np.int64), LEAF * LOWER * UPPER, *one))
    for _ in range(children):
        corner = np.array(file.numbers("3i"), np.int64)
        for upper in _node(file, tree, corner, UPPER, LEAF * LOWER, compression, half):
            leaves = _node(file, tree, upper, LOWER, LEAF, compression, half)
            tree.corners.append(leaves)
            masks = file.take(len(leaves) * LEAF**3 // 8)
            tree.masks.append(np.frombuffer(masks, np.uint8).reshape(-1, LEAF**3 // 8))
    return tree


def _node(
    file: _Bytes, tree: _Tree, corner: NDArray[np.int64], side: int, edge: int, compression: int, half: bool
) -> NDArray[np.int64]:
    """The lowest voxels (n, 3) of an inner node's children, whose edge is in voxels; its tiles go into the tree."""
    is_child, is_active = file.mask(side**3), file.mask(side**3)
    values = _values(file, is_active, tree.background, compression, half=half)
    tile = np.flatnonzero(~is_child & (is_active | (values != tree.background)))
    if len(tile):
        tree.tiles.append((_places(tile, corner, side, edge), edge, values[tile], is_active[tile]))
    return _places(np.flatnonzero(is_child), corner, side, edge)


def _places(index: NDArray[np.int64], corner: NDArray[np.int64], side: int, edge: int) -> NDArray[np.int64]:
    return corner + edge * np.stack(np.unravel_index(index, (side,) * 3), axis=1)


def _box(path: Path, tree: _Tree, at_most: int) -> tuple[NDArray[np.int64], tuple[int, int, int]]:
    """The lowest voxel and the size of the box about all active voxels."""
    lows, highs = [np.zeros((0, 3), np.int64)], [np.zeros((0, 3), np.int64)]
    for corners, masks in zip(tree.corners, tree.masks, strict=True):
        leaf, x, y, z = np.nonzero(np.unpackbits(masks, axis=1, bitorder="little").reshape(-1, *_LEAF))
        if len(leaf):
            voxels = corners[leaf] + np.stack([x, y, z], axis=1)
            lows.append(voxels.min(axis=0)[None])
            highs.append(voxels.max(axis=0)[None] + 1)
    for corners, edge, _, is_active in tree.tiles:
        lows.append(corners[is_active])
        highs.append(corners[is_active] + edge)
    low, high = np.concatenate(lows), np.concatenate(highs)
    if not len(low):
        raise FormatError(f"{path} holds no active voxel: it is empty; export it again")
    low, high = low.min(axis=0), high.max(axis=0)
    nx, ny, nz = (high - low).tolist()
    if nx * ny * nz > at_most:
        raise InputError(
            f"{path}: its active voxels span {nx * ny * nz / 1e6:,.0f} million, at most {at_most / 1e6:.4g} million "
            "are read: cut it, or resample it with larger voxels"
        )
    return low, (nx, ny, nz)


def _fill_tiles(tree: _Tree, first: NDArray[np.int64], value: NDArray[np.float32], active: NDArray[np.bool_]) -> None:
    for corners, edge, values, is_active in tree.tiles:
        for low, one, on in zip((corners - first).tolist(), values, is_active, strict=True):
            place = tuple(slice(max(a, 0), max(a + edge, 0)) for a in low)
            value[place], active[place] = one, on


def _values(
    file: _Bytes, mask: NDArray[np.bool_], background: np.float32, compression: int, *, half: bool
) -> NDArray[np.float32]:
    """(n,) a node's list of values, some of which may be told by its mask (n,) of active ones."""
    how = file.take(1)[0]
    if how > _ALL_VALUES:
        raise ValueError(f"a node lists its values in way {how}")
    other = [background if how == 0 else -background, background]
    for k in range((how in _ONE_OTHER) + (how == _TWO_OTHERS)):
        other[k] = np.frombuffer(file.take(4), "<f4")[0]
    second = file.mask(len(mask)) if how in _CHOSEN else np.zeros(len(mask), bool)
    is_listed = mask if compression & _MASKED and how != _ALL_VALUES else np.ones(len(mask), bool)
    values = np.where(second, other[1], other[0]).astype(np.float32)
    values[is_listed] = _list(file, int(is_listed.sum()), compression, np.dtype("<f2" if half else "<f4"))
    return values


def _list(file: _Bytes, count: int, compression: int, kind: np.dtype[np.floating]) -> NDArray[np.floating]:
    if not count and kind.itemsize == 2:
        return np.zeros(0, np.float32)
    size = count * kind.itemsize
    if not compression & (_ZIP | _BLOSC):
        return np.frombuffer(file.take(size), kind)
    (packed,) = file.numbers("q")  # not above 0: so many bytes that are not compressed
    data = file.take(abs(packed))
    if packed > 0:
        data = _unblosc(data, size) if compression & _BLOSC else zlib.decompressobj().decompress(data, size)
    return np.frombuffer(data, kind, count)


def _unblosc(data: memoryview, size: int) -> bytes:
    """The bytes, as many as are expected, that Blosc 1 compressed by LZ4."""
    import pyarrow

    _, _, flags, width, stated, block_size, _ = _BLOSC_HEAD.unpack(data[: _BLOSC_HEAD.size])
    if stated != size or not width or not block_size:
        raise ValueError("a compressed list is damaged")
    if flags & _PLAIN:
        return bytes(data[_BLOSC_HEAD.size : _BLOSC_HEAD.size + size])
    if flags >> 5 != _LZ4:
        raise ValueError("its values are compressed by another Blosc than with LZ4")
    codec, blocks = pyarrow.Codec("lz4_raw"), []
    for block, start in enumerate(range(0, size, block_size)):
        length = min(block_size, size - start)
        (at,) = struct.unpack_from("<i", data, _BLOSC_HEAD.size + 4 * block)
        parts = 1 if flags & _WHOLE or length < block_size else width
        streams = []
        for _ in range(parts):
            (packed,) = struct.unpack_from("<i", data, at)
            stream = data[at + 4 : at + 4 + packed]
            is_plain = packed == length // parts
            streams.append(bytes(stream if is_plain else codec.decompress(stream, length // parts)))
            at += 4 + packed
        blocks.append(_unshuffled(b"".join(streams), width) if flags & _SHUFFLED else b"".join(streams))
    return b"".join(blocks)


def _unshuffled(data: bytes, width: int) -> bytes:
    """From all first bytes of numbers, then all second ones, to the numbers; a rest stays where it is."""
    whole = len(data) // width * width
    return np.frombuffer(data, np.uint8, whole).reshape(width, -1).T.tobytes() + data[whole:]
