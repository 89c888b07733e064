"""The columns of a file of points: PLY, and PCD as text, binary or compressed."""

import io
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from esdf import exchange
from flight import FormatError, InputError

SUFFIXES = (".ply", ".pcd")
LARGEST_BYTES = 4_000_000_000
MOST_POINTS = 30_000_000
"""An import with rays takes 3.6 GB of memory."""
_HEADER_BYTES = 65_536
_PLY_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8",
}  # fmt: skip
_PCD_KINDS = {"F": "f", "I": "i", "U": "u"}


@dataclass(frozen=True, slots=True)
class Layout:
    """Where a file holds which numbers of its points."""

    types: tuple[tuple[str, str], ...]
    """Name and NumPy type of each number of a point, in order."""
    points: int
    offset: int
    """Bytes before the first point."""
    coding: str
    """`text`, `binary`, or `compressed`."""
    is_distances: bool = False
    """Whether it says that its points are voxels with distances, as Goshawk writes them."""


def has_faces(path: Path) -> bool:
    """Whether a PLY file states triangles; also where its header cannot be read, which its reader reports."""
    words = [line.split() for line in _header(path, b"end_header")[0]]
    faces = [line[2] for line in words if line[:2] == ["element", "face"] and len(line) == 3]
    return not words or any(count != "0" for count in faces)


def layout(path: Path) -> Layout:
    """Where a file holds which numbers. Raises as `read`."""
    found = _ply(path) if path.suffix.lower() == ".ply" else _pcd(path)
    _require_plausible(path, found)
    return found


def read(path: Path, *, at_most: int | None = None) -> Mapping[str, NDArray[np.generic]]:
    """The named columns (n,) of the points, in the file's own types; `x`, `y` and `z` are among them.

    Args:
        at_most: points from the front, of a file that is not compressed; None: all.

    Raises:
        InputError: it is too large.
        FormatError: it is damaged or cut off, or holds no points.
    """
    found = layout(path)
    if at_most is not None:
        found = replace(found, points=min(found.points, at_most))
    read = {"text": _text, "binary": _binary, "compressed": _compressed}[found.coding]
    columns = read(path, found)
    if lengths := {name: len(column) for name, column in columns.items() if len(column) != found.points}:
        raise FormatError(
            f"{path} is damaged or cut off: it states {found.points} points and holds {min(lengths.values())}; "
            "export it again"
        )
    return columns


def viewpoint(path: Path) -> tuple[float, float, float] | None:
    """From where a PCD file's header says that it was taken, in its numbers; None where it does not, or says zeros.

    Raises:
        FormatError: the header's words are no numbers.
    """
    lines = _header(path, b"DATA")[0] if path.suffix.lower() == ".pcd" else []
    words = next((line.split()[1:] for line in lines if line.startswith("VIEWPOINT")), [])
    if not words:
        return None
    try:
        x, y, z, *turn = (float(word) for word in words)
    except ValueError:
        x, y, z, turn = math.nan, 0.0, 0.0, []
    if len(turn) != 4 or not all(map(math.isfinite, (x, y, z))):
        raise FormatError(f"{path}: its VIEWPOINT is {' '.join(words)[:80]!r}; x y z and a quaternion are expected")
    return (x, y, z) if any((x, y, z)) else None


def _require_plausible(path: Path, layout: Layout) -> None:
    """Refuse before memory is set aside for the points."""
    names = [name for name, _ in layout.types]
    if missing := [name for name in "xyz" if name not in names]:
        raise FormatError(f"{path}: its points have no {', '.join(missing)}; they have {', '.join(names)[:200]}")
    if len(set(names)) != len(names) or not "".join(names).isascii():
        raise FormatError(f"{path}: a name of a column is there twice, or not in ASCII; export it again")
    require_few(path, layout.points)
    needed, there = layout.points * np.dtype(list(layout.types)).itemsize, path.stat().st_size - layout.offset
    if layout.coding == "binary" and there < needed:
        raise cut_off(path, layout.points, needed, there)


def require_few(path: Path, points: int) -> None:
    """
    Raises:
        FormatError: a file states no points; InputError: it states more than memory is for, or is too large.
    """
    if points < 1:
        raise FormatError(f"{path} holds no points; export it again")
    size = path.stat().st_size
    if points > MOST_POINTS or size > LARGEST_BYTES:
        raise InputError(
            f"{path} holds {points / 1e6:,.4g} million points in {size / 1e9:.3g} GB, at most "
            f"{MOST_POINTS / 1e6:g} million in {LARGEST_BYTES / 1e9:g} GB are read: thin it to a few per voxel, with "
            "CloudCompare say"
        )


def cut_off(path: Path, points: int, needed: int, there: int) -> FormatError:
    """The error of a file that ends before its points do, in bytes."""
    return FormatError(
        f"{path} is cut off: its {points} points take {needed} bytes, and {there} are there; copy it again"
    )


def _header(path: Path, last: bytes) -> tuple[list[str], int]:
    """Lines up to the one that begins with `last`, and the bytes they take; none where there is no such line."""
    with path.open("rb") as file:
        lines = file.read(_HEADER_BYTES).splitlines(keepends=True)
    end = next((k for k, line in enumerate(lines) if line.startswith(last) and line.endswith(b"\n")), None)
    if end is None:
        return [], 0
    used = lines[: end + 1]
    return [line.decode("ascii", "replace").strip() for line in used], sum(map(len, used))


def _ply(path: Path) -> Layout:
    lines, offset = _header(path, b"end_header")
    if not lines or lines[0] != "ply":
        raise FormatError(f"{path} is no PLY file, or its header is cut off; export it again")
    coding, element, points, types = "", "", 0, []
    for words in map(str.split, lines):
        if words[:1] == ["format"] and len(words) > 1:
            coding = words[1]
        elif words[:1] == ["element"] and len(words) == 3:
            if element == "" and words[1] != "vertex":
                raise InputError(f"{path}: points must come first in it, before {words[1]}; export it again without")
            element = words[1]
            points = _count(path, words[2]) if element == "vertex" else points
        elif words[:1] == ["property"] and element == "vertex":
            if len(words) != 3 or words[1] not in _PLY_TYPES:
                raise FormatError(f"{path}: a point has a {' '.join(words)[:60]!r}, which is no number")
            types.append((words[2], _PLY_TYPES[words[1]]))
    order = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}.get(coding)
    if order is None:
        raise FormatError(f"{path} is PLY of format {coding[:40]!r}; ascii and binary are read")
    typed = tuple((name, order + kind) for name, kind in types)
    return Layout(typed, points, offset, "binary" if order else "text", exchange.PLY_COMMENT in lines)


def _pcd(path: Path) -> Layout:
    lines, offset = _header(path, b"DATA")
    stated = {line.split()[0]: line.split()[1:] for line in lines if line and not line.startswith("#")}
    missing = [name for name in ("FIELDS", "SIZE", "TYPE", "POINTS", "DATA") if not stated.get(name)]
    if missing:
        raise FormatError(f"{path} is no PCD file, or damaged: its header has no {', '.join(missing)}; export it again")
    names = stated["FIELDS"]
    counts = [_count(path, word) for word in stated.get("COUNT", ["1"] * len(names))]
    if not len(names) == len(counts) == len(stated["SIZE"]) == len(stated["TYPE"]):
        raise FormatError(f"{path}: FIELDS, SIZE, TYPE and COUNT differ in length; export it again")
    types = []
    for k, (name, size, kind, count) in enumerate(zip(names, stated["SIZE"], stated["TYPE"], counts, strict=True)):
        if kind not in _PCD_KINDS or size not in ("1", "2", "4", "8") or (kind, size) in (("F", "1"), ("F", "2")):
            raise FormatError(f"{path}: {name[:60]} is of type {kind[:9]} and size {size[:9]}; export it again")
        if count > 1000:
            raise FormatError(f"{path}: {name[:60]} is there {count} times in each point; export it without")
        # PCL fills gaps by fields named _, of which there may be many.
        own = [name if count == 1 and name != "_" else f"{name}[{k}.{n}]" for n in range(count)]
        types += [(one, f"<{_PCD_KINDS[kind]}{size}") for one in own]
    coding = {"ascii": "text", "binary": "binary", "binary_compressed": "compressed"}.get(stated["DATA"][0])
    if coding is None:
        raise FormatError(f"{path} is PCD of {stated['DATA'][0][:40]!r}; ascii, binary and binary_compressed are read")
    points = _count(path, stated["POINTS"][0])
    size = [_count(path, word) for name in ("WIDTH", "HEIGHT") for word in stated.get(name, [])]
    if size and math.prod(size) != points:
        raise FormatError(f"{path}: POINTS is {points}, and WIDTH times HEIGHT {math.prod(size)}; export it again")
    return Layout(tuple(types), points, offset, coding)


def _count(path: Path, word: str) -> int:
    if not (word.isascii() and word.isdigit() and len(word) < 16):
        raise FormatError(f"{path}: its header has {word[:40]!r} in place of a number; export it again")
    return int(word)


def _binary(path: Path, layout: Layout) -> Mapping[str, NDArray[np.generic]]:
    """Columns that stay on disk until they are used."""
    points = np.memmap(path, np.dtype(list(layout.types)), "r", layout.offset, (layout.points,))
    return {name: points[name] for name, _ in layout.types}


def _text(path: Path, layout: Layout) -> Mapping[str, NDArray[np.generic]]:
    """Numbers of text are read as 64 bits, whatever type the header states."""
    with path.open("rb") as file:
        file.seek(layout.offset)
        text = io.TextIOWrapper(file, "latin-1")
        try:
            rows = np.loadtxt(text, np.float64, comments=None, ndmin=2, max_rows=layout.points)
        except ValueError as error:
            raise FormatError(f"{path} cannot be read: {str(error)[:150]}; export it again") from None
    if len(rows) and rows.shape[1] != len(layout.types):
        raise FormatError(
            f"{path}: a line has {rows.shape[1]} numbers, its header {len(layout.types)}; export it again"
        )
    return {name: rows[:, k] for k, (name, _) in enumerate(layout.types) if k < rows.shape[1]}


def _compressed(path: Path, layout: Layout) -> Mapping[str, NDArray[np.generic]]:
    """By Open3D, once the lengths are what they must be: it trusts them, and reads beyond its memory."""
    import open3d

    needed = layout.points * np.dtype(list(layout.types)).itemsize
    lengths = np.fromfile(path, "<u4", 2, offset=layout.offset)
    if len(lengths) < 2 or lengths[1] != needed or path.stat().st_size - layout.offset - 8 < lengths[0]:
        raise FormatError(f"{path} is damaged or cut off: its points would take {needed} bytes; copy it again")
    with open3d.utility.VerbosityContextManager(open3d.utility.VerbosityLevel.Error):
        cloud = open3d.t.io.read_point_cloud(path)
    columns = {name: cloud.point[name].numpy() for name in cloud.point}
    positions = columns.pop("positions", np.zeros((0, 3)))
    return dict(zip("xyz", positions.T, strict=True)) | {
        name: values[:, 0] for name, values in columns.items() if values.ndim == 2 and values.shape[1] == 1
    }
