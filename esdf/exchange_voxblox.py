"""Layer files of voxblox (ETH Zurich): ESDF layers out and in, TSDF and occupancy layers in.

A layer is the number of messages, then each with its length in front, as varints: one LayerProto (1 voxel_size: double,
2 voxels_per_side: uint32, 3 type: string), then BlockProtos (1 voxels_per_side, 2 voxel_size, 3-5 origin: doubles,
6 has_data, 7 voxel_data: repeated uint32). Voxels run x fastest. Words per voxel: "tsdf": distance, weight (floats),
RGBA; "esdf": distance (float), flags (bit 0 observed, 1 hallucinated, 3 fixed; the upper bytes, the parent, are 0);
"occupancy": log-odds (float), observed. Lattices start at multiples of the voxel in the world. A hallucinated voxel,
one that voxblox' planners assume free or occupied about the robot, counts as not observed. A file may hold several
layers (voxblox saves TSDF and ESDF into one): the first is read.
"""

import math
import struct
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from esdf.field import Field
from esdf.grid import UNKNOWN, Grid
from flight import FormatError, InputError, errors, file_format

WORDS = {"tsdf": 3, "esdf": 2, "occupancy": 2}
OBSERVED, HALLUCINATED, FIXED = 1, 2, 8
SIDE = 16
DATA = 0x38  # tag of one voxel_data word
_OFF_LATTICE = 0.1
"""Voxels that a block may start beside the lattice: voxblox computes in single precision."""
Block = tuple[NDArray[np.int64], NDArray[np.uint32]]
"""Its lowest voxel, and its words (x, y, z, word)."""


@dataclass(frozen=True, eq=False)
class Layer:
    """A voxblox layer on one dense lattice; what no block covers is not observed."""

    kind: str
    """"tsdf", "esdf" or "occupancy"."""
    grid: Grid
    value: NDArray[np.float32]
    """(nx, ny, nz) distance in metres, or log-odds; NaN where not observed."""
    weight: NDArray[np.float32]
    """(nx, ny, nz) how often seen (TSDF), else 1 where observed; 0 where not."""
    layers: int = 1
    """That the file holds; this is the first."""


def export_layer(path: Path, field: Field) -> None:
    """Write a field as a voxblox ESDF layer; unknown voxels are not observed.

    Raises:
        InputError: the voxels are not cubes, or the lattice does not start at a multiple of the voxel.
    """
    voxel = field.grid.voxel_m[0]
    start = field.grid.low_world_m / voxel
    if not field.grid.cubic or np.abs(start - np.rint(start)).max() > 1e-6:
        raise InputError(
            "voxblox layers have cubic voxels on a lattice through the world's origin; resample the map, or write an "
            "OpenVDB volume, which takes any"
        )
    first = np.rint(start).astype(int)
    low, high = first // SIDE, -(-(first + np.array(field.grid.shape)) // SIDE)
    corners = [(low + at) * SIDE for at in np.ndindex(*(high - low))]
    corners = [corner for corner in corners if (field.state[_inside(field, corner - first)] != UNKNOWN).any()]
    header = _double(1, voxel) + _varint_field(2, SIDE) + b"\x1a" + _varint(4) + b"esdf"
    with file_format.atomic_file(Path(path)) as temporary, open(temporary, "wb") as out:
        out.write(_varint(1 + len(corners)) + _varint(len(header)) + header)
        for corner in corners:  # one by one: a large field is held once only
            block = _block(_words(field, corner - first), corner * voxel, voxel)
            out.write(_varint(len(block)) + block)


def _inside(field: Field, corner: NDArray[np.int64]) -> tuple[slice, ...]:
    """Of the field's lattice: the part in the block that starts at a voxel, which may lie before the field's first."""
    return tuple(slice(max(a, 0), min(a + SIDE, n)) for a, n in zip(corner.tolist(), field.grid.shape, strict=True))


def _words(field: Field, corner: NDArray[np.int64]) -> NDArray[np.uint32]:
    """(SIDE, SIDE, SIDE, 2) of the block that starts at a voxel."""
    words = np.zeros((SIDE, SIDE, SIDE, 2), np.uint32)
    inside = _inside(field, corner)
    place = tuple(slice(part.start - a, part.stop - a) for part, a in zip(inside, corner.tolist(), strict=True))
    values, known = field.values_m[inside], field.state[inside] != UNKNOWN
    words[(*place, 0)] = np.where(known, values, np.float32(0.0)).view(np.uint32)
    words[(*place, 1)] = np.where(known, OBSERVED | np.where(np.abs(values) < field.cap_m, FIXED, 0), 0)
    return words


def import_layer(path: Path, *, at_most: int | None = None) -> Layer:
    """Read a voxblox layer.

    Args:
        at_most: voxels of the box about all blocks, which need not be near each other; None: no bound.

    Raises:
        InputError: there is no such file, or the box has more voxels.
        FormatError: it is cut off, not a voxblox layer, or of a type this does not read.
    """
    kind, voxel, side, blocks, layers = _read(Path(path))
    corners = np.array([corner for corner, _ in blocks])
    voxels = float(np.prod(np.ptp(corners, axis=0) + float(side)))
    if at_most is not None and voxels > at_most:
        raise InputError(
            f"{path}: its blocks span {voxels / 1e6:,.0f} million voxels, at most {at_most / 1e6:.4g} million are "
            "read: cut the map"
        )
    return replace(_assemble(kind, voxel, side, blocks), layers=layers)


def _read(path: Path) -> tuple[str, float, int, list[Block], int]:
    """Of the first layer: type, voxel in metres, voxels per side of a block, blocks; and how many layers there are."""
    try:
        data = memoryview(path.read_bytes())
    except FileNotFoundError:
        raise errors.missing(path) from None
    try:
        layers = _layers(data)
        kinds = [bytes(_fields(messages[0])[1][3]) for messages in layers]  # the others are whole, too
        numbers, blobs, _ = _fields(layers[0][0])
        voxel = struct.unpack("<d", blobs[1])[0]
        side, kind = numbers[2], kinds[0].decode()
        if not 0.0 < voxel < math.inf:
            raise ValueError(f"its voxels are of {voxel:g} m")
        if kind not in WORDS:
            raise ValueError(f"its type is {kind!r}; {', '.join(WORDS)} can be read")
        blocks = [_read_block(message, side, WORDS[kind], voxel) for message in layers[0][1:]]
        if not blocks:
            raise ValueError("it holds no block")
    except (IndexError, KeyError, ValueError, TypeError, struct.error) as error:
        raise FormatError(f"{path} is not a whole voxblox layer: {error}") from error
    return kind, voxel, side, blocks, len(layers)


def _assemble(kind: str, voxel: float, side: int, blocks: list[Block]) -> Layer:
    corners = np.array([corner for corner, _ in blocks])
    low, high = corners.min(axis=0), corners.max(axis=0) + side
    grid = Grid(tuple(low * voxel), (voxel, voxel, voxel), tuple(high - low))
    value = np.full(grid.shape, np.nan, np.float32)
    weight = np.zeros(grid.shape, np.float32)
    for corner, words in blocks:
        place = tuple(slice(a, a + side) for a in corner - low)
        if kind == "tsdf":
            seen = np.ascontiguousarray(words[..., 1]).view(np.float32)
        else:
            flags = words[..., 1] & (OBSERVED | (HALLUCINATED if kind == "esdf" else 0))
            seen = (flags == OBSERVED).astype(np.float32)
        value[place] = np.where(seen > 0, np.ascontiguousarray(words[..., 0]).view(np.float32), np.nan)
        weight[place] = seen
    return Layer(kind, grid, value, weight)


def _block(words: NDArray[np.uint32], origin: NDArray[np.float64], voxel: float) -> bytes:
    """A BlockProto."""
    head = _varint_field(1, SIDE) + _double(2, voxel)
    head += b"".join(_double(3 + a, float(origin[a])) for a in range(3)) + _varint_field(6, 1)
    return head + _encode_words(np.ascontiguousarray(words.transpose(2, 1, 0, 3)).ravel())


def _read_block(message: memoryview, side: int, words_per_voxel: int, voxel: float) -> Block:
    _, blobs, at = _fields(message, until=DATA)
    if at < len(message):
        pairs = _decode_varints(message[at:])
        if (pairs[0::2] != DATA).any():
            raise ValueError("a block holds unexpected fields among its voxels")
        words = pairs[1::2]
    else:  # written by a newer protobuf, which packs the words
        words = _decode_varints(blobs.get(7, memoryview(b"")))
    if len(words) != side**3 * words_per_voxel:
        raise ValueError(f"a block holds {len(words)} words, not {side**3 * words_per_voxel}")
    origin = np.array([struct.unpack("<d", blobs.get(3 + a, bytes(8)))[0] for a in range(3)])
    first = origin / voxel
    if not np.isfinite(first).all() or np.abs(first - np.rint(first)).max() > _OFF_LATTICE:
        raise ValueError(f"a block starts at {origin.tolist()} m, which is no multiple of the voxel of {voxel:g} m")
    grid_of_words = words.astype(np.uint32).reshape(side, side, side, words_per_voxel).transpose(2, 1, 0, 3)
    return np.rint(first).astype(np.int64), grid_of_words


def _layers(data: memoryview) -> list[list[memoryview]]:
    """The messages of each layer."""
    layers, at = list[list[memoryview]](), 0
    while at < len(data) or not layers:
        count, at = _read_varint(data, at)
        layers.append([])
        for _ in range(count):
            size, at = _read_varint(data, at)
            if at + size > len(data):
                raise ValueError("it ends in the middle of a message")
            layers[-1].append(data[at : at + size])
            at += size
    return layers


def _fields(message: memoryview, until: int | None = None) -> tuple[dict[int, int], dict[int, memoryview], int]:
    """Fields by number, varints and all others apart, and where it stopped: at the first tag `until`, or the end."""
    numbers: dict[int, int] = {}
    blobs: dict[int, memoryview] = {}
    at = 0
    while at < len(message):
        tag, after = _read_varint(message, at)
        if tag == until:
            break
        field, kind, at = tag >> 3, tag & 7, after
        if kind == 0:
            numbers[field], at = _read_varint(message, at)
            continue
        if kind not in (1, 2, 5):
            raise ValueError(f"wire type {kind} is not known")
        size = {1: 8, 5: 4}.get(kind, 0)
        if kind == 2:
            size, at = _read_varint(message, at)
        if at + size > len(message):
            raise ValueError("a field is cut off")
        blobs[field] = message[at : at + size]
        at += size
    return numbers, blobs, at


def _read_varint(data: memoryview, at: int) -> tuple[int, int]:
    value, shift = 0, 0
    while True:
        byte = data[at]
        value |= (byte & 0x7F) << shift
        at, shift = at + 1, shift + 7
        if byte < 0x80:
            return value, at
        if shift > 63:
            raise ValueError("a number is longer than 64 bits")


def _decode_varints(data: memoryview) -> NDArray[np.uint64]:
    """All varints of a stretch of bytes at once."""
    raw = np.frombuffer(data, np.uint8)
    ends = np.flatnonzero(raw < 0x80)
    if len(raw) and (not len(ends) or ends[-1] != len(raw) - 1):
        raise ValueError("it ends in the middle of a number")
    starts = np.concatenate([[0], ends[:-1] + 1])
    values = np.zeros(len(ends), np.uint64)
    for byte in range(int((ends - starts).max(initial=0)) + 1):
        inside = starts + byte <= ends
        part = raw[np.minimum(starts + byte, max(len(raw) - 1, 0))].astype(np.uint64) & np.uint64(0x7F)
        values |= np.where(inside, part << np.uint64(7 * byte), np.uint64(0))
    return values


def _encode_words(words: NDArray[np.uint32]) -> bytes:
    """Field 7 of a BlockProto: every word with its tag in front."""
    wide = words.astype(np.uint64)
    groups = np.stack([(wide >> np.uint64(7 * b)) & np.uint64(0x7F) for b in range(5)], axis=1).astype(np.uint8)
    length = np.maximum(5 - np.argmax(groups[:, ::-1] > 0, axis=1), 1)
    length[~groups.any(axis=1)] = 1
    more = np.arange(5) < (length - 1)[:, None]
    stream = np.concatenate([np.full((len(words), 1), DATA, np.uint8), groups | np.where(more, 0x80, 0)], axis=1)
    return stream[np.arange(6) <= length[:, None]].astype(np.uint8).tobytes()


def _varint(value: int) -> bytes:
    size = max(1, math.ceil(value.bit_length() / 7))
    return bytes((value >> 7 * i) & 0x7F | (0x80 if i < size - 1 else 0) for i in range(size))


def _varint_field(number: int, value: int) -> bytes:
    return _varint(number << 3) + _varint(value)


def _double(number: int, value: float) -> bytes:
    return _varint(number << 3 | 1) + struct.pack("<d", value)
