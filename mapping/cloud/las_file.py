"""The points of a LAS or LAZ file (ASPRS LAS 1.0 to 1.4): coordinates, and the times of GPS where it has them.

The header is read here, as a damaged one makes laspy walk four thousand million empty records.
"""

import signal
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flight import FloatArray, FormatError, InputError, MapError, Progress, silent
from mapping import child
from mapping.cloud import las_units, point_file

SUFFIXES = (".las", ".laz")
_HEADER_BYTES, _VLR_BYTES, _MOST_VLRS = 227, 54, 10_000
_LEAST_BYTES = (20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67)
"""Of a point of each format."""
_TIME_OFFSET = {1: 20, 3: 20, 4: 20, 5: 20} | dict.fromkeys(range(6, 11), 22)
_LASZIP = (b"laszip encoded", 22204)
_PROJECTION = b"LASF_Projection"
_EVLR_BYTES, _LARGEST_RECORDS = 60, 1_000_000
_AT_A_TIME = 500_000
"""Points that are decompressed at once."""


@dataclass(frozen=True, slots=True, eq=False)
class _Layout:
    points: int
    offset: int
    """Bytes before the first point."""
    kind: int
    """Format of the points, 0 to 10."""
    size: int
    """Bytes of a point."""
    scale: FloatArray
    """(3,) and `origin` (3,): coordinates are the file's integers times this, plus that."""
    origin: FloatArray
    laszip: bytes | None
    """Record that says how the points are compressed; None: they are not."""
    projection: Mapping[int, bytes]
    """Records of the projection, by number."""


def read(path: Path, *, progress: Progress = silent) -> Mapping[str, NDArray[np.generic]]:
    """The columns `x`, `y`, `z` (n,) in the file's unit, and `gps_time` where there is one.

    Raises:
        InputError: there are more points than are read.
        FormatError: the file is damaged or cut off.
        MapError: the process that decompresses was ended, for want of memory say.
        ModuleNotFoundError: what decompresses is not installed.
    """
    layout = _layout(path)
    rows = _stored(path, layout) if layout.laszip is None else _decompressed(path, layout, progress)
    columns: dict[str, NDArray[np.generic]] = {
        name: rows[name] * layout.scale[k] + layout.origin[k] for k, name in enumerate("xyz")
    }
    return columns | ({"gps_time": rows["gps_time"]} if layout.kind in _TIME_OFFSET else {})


def stated_unit(path: Path, unit: str | None) -> str | None:
    """The unit of the coordinates that the file states, `m` or `ft`, if none is given; None where it states none.

    Raises:
        InputError: the coordinates are degrees, axes differ in their units, or none is given and the record of the
            projection does not say one.
    """
    records = _layout(path).projection
    stated = las_units.stated(path, records)
    found = unit or stated
    if found is None and records:
        raise InputError(
            f"{path} names a projection, and not in which unit that is: look it up, and give --unit m or --unit ft"
        )
    return found


def _layout(path: Path) -> _Layout:
    with path.open("rb") as file:
        head = file.read(375)
        if head[:4] != b"LASF" or len(head) < _HEADER_BYTES:
            raise FormatError(f"{path} is no LAS file, or its header is cut off; export it again")
        header_size, offset, records, kind, size, points = struct.unpack_from("<HIIBHI", head, 94)
        if head[25] >= 4 and len(head) == 375:
            points = struct.unpack_from("<Q", head, 247)[0]
        compressed, kind = bool(kind & 0x80), kind & 0x3F
        if kind >= len(_LEAST_BYTES) or size < _LEAST_BYTES[kind]:
            raise FormatError(f"{path} has points of format {kind} in {size} bytes; LAS has formats 0 to 10")
        scale, origin = (np.array(struct.unpack_from("<3d", head, at)) for at in (131, 155))
        if not (np.isfinite(scale).all() and np.isfinite(origin).all() and (scale > 0.0).all()):
            raise FormatError(f"{path}: its header scales the coordinates by {scale.tolist()}; export it again")
        file.seek(header_size)
        found = _records(file.read(max(0, offset - header_size)), records)
        if head[25] >= 4 and len(head) == 375:
            more_at, more = struct.unpack_from("<QI", head, 235)
            file.seek(min(more_at, path.stat().st_size))
            found = _records(file.read(_LARGEST_RECORDS), more, "<2x16sHQ", _EVLR_BYTES) | found
    laszip = found.get(_LASZIP) if compressed else None
    if compressed and laszip is None:
        raise FormatError(f"{path} is compressed, and does not say how; export it again")
    projection = {number: body for (name, number), body in found.items() if name == _PROJECTION}
    point_file.require_few(path, points)
    if laszip is None and path.stat().st_size - offset < points * size:
        raise point_file.cut_off(path, points, points * size, path.stat().st_size - offset)
    return _Layout(points, offset, kind, size, scale, origin, laszip, projection)


def _records(
    stored: bytes, count: int, head: str = "<2x16sHH", head_bytes: int = _VLR_BYTES
) -> dict[tuple[bytes, int], bytes]:
    """What records hold, by user and number, as far as they are whole."""
    at, found = 0, {}
    for _ in range(min(count, _MOST_VLRS)):
        if at + head_bytes > len(stored):
            break
        name, number, length = struct.unpack_from(head, stored, at)
        at += head_bytes
        found.setdefault((name.rstrip(b"\0"), number), stored[at : at + length])
        at += length
    return found


def _fields(layout: _Layout) -> np.dtype:
    """Of a point: what is read of it."""
    names, kinds, offsets = ["x", "y", "z"], ["<i4"] * 3, [0, 4, 8]
    if layout.kind in _TIME_OFFSET:
        names, kinds, offsets = [*names, "gps_time"], [*kinds, "<f8"], [*offsets, _TIME_OFFSET[layout.kind]]
    return np.dtype({"names": names, "formats": kinds, "offsets": offsets, "itemsize": layout.size})


def _stored(path: Path, layout: _Layout) -> NDArray[np.void]:
    return np.memmap(path, _fields(layout), "r", layout.offset, (layout.points,))


def _decompressed(path: Path, layout: _Layout, progress: Progress) -> NDArray[np.void]:
    """In a child process: lazrs aborts where a damaged file states absurd sizes."""
    import lazrs  # noqa: F401  # the child needs it: what is missing is said here, where its sentence is known

    try:
        return child.run(decompress, path, layout, progress=progress)
    except child.CrashError as error:
        if error.signal == signal.SIGABRT:
            raise _damaged(path, "decompressing it was given up") from None
        raise MapError(
            f"{path}: decompressing it was ended ({error.signal.name if error.signal else 'without an answer'}), as "
            "happens where memory runs out; free some, or write the file without compression"
        ) from None


def _damaged(path: Path, what: str) -> FormatError:
    return FormatError(f"{path} is damaged or cut off: {what[:150]}; copy or export it again")


def decompress(path: Path, layout: _Layout, *, progress: Progress = silent) -> NDArray[np.void]:
    """What is read of the points (n,), in parts: of a lie, no more is set aside than what there is."""
    import lazrs

    fields = _fields(layout)
    kept = np.dtype([(name, fields[name].str) for name in fields.names or ()])
    parts: list[NDArray[np.void]] = []
    with path.open("rb") as file:
        file.seek(layout.offset)
        try:
            source = lazrs.LasZipDecompressor(file, layout.laszip)  # pyright: ignore[reportAttributeAccessIssue]
            for begin in range(0, layout.points, _AT_A_TIME):
                progress("decompress the points", begin / layout.points)
                raw = bytearray(layout.size * min(_AT_A_TIME, layout.points - begin))
                source.decompress_many(raw)
                parts.append(np.frombuffer(raw, fields).astype(kept))
        except lazrs.LazrsError as error:  # pyright: ignore[reportAttributeAccessIssue]
            raise _damaged(path, str(error)) from None
    return np.concatenate(parts)
