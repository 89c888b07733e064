"""The points of an E57 file (ASTM E2807), each scan at its pose, and from where each was measured.

Pages of 1024 bytes end in a checksum. They hold sections of packets, whose streams hold one field each, and a text in
XML that says what the fields are.
"""

import re
import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from flight import FloatArray, FormatError, InputError, rotations
from mapping.cloud import point_file

SUFFIXES = (".e57",)
_PAGE, _USED = 1024, 1020
_LARGEST_XML = 50_000_000
_PAGES_AT_A_TIME = 100_000
_DATA = 1
"""First byte of a section, and of a packet, of data; packets 0 and 2 hold an index, or nothing."""
_CARTESIAN = ("cartesianX", "cartesianY", "cartesianZ")
_SPHERICAL = ("sphericalRange", "sphericalAzimuth", "sphericalElevation")
_INVALID = {_CARTESIAN: "cartesianInvalidState", _SPHERICAL: "sphericalInvalidState"}


@dataclass(frozen=True, slots=True)
class _Field:
    """One number of each point."""

    name: str
    kind: str
    """NumPy type of a float; empty for an integer."""
    bits: int
    least: int
    scale: float
    offset: float


@dataclass(frozen=True, slots=True, eq=False)
class _Pages:
    """A file without its checksums."""

    path: Path
    pages: NDArray[np.uint8]
    """(p, 1024)."""

    def read(self, offset: int, length: int) -> bytes:
        """So many bytes from a place in the file, which counts checksums."""
        page, first = divmod(offset, _PAGE)
        last = page + -(-(first + length) // _USED)
        if first > _USED or last > len(self.pages):
            raise damaged(self.path, "it refers to a place beyond its end")
        return self.pages[page:last, :_USED].tobytes()[first : first + length]

    def after(self, offset: int, length: int) -> int:
        """The place so many bytes after another one."""
        page, first = divmod(offset, _PAGE)
        more, first = divmod(first + length, _USED)
        return _PAGE * (page + more) + first


def damaged(path: Path, what: str) -> FormatError:
    return FormatError(f"{path} is damaged or cut off: {what}; copy or export it again")


def read(path: Path) -> Mapping[str, NDArray[np.generic]]:
    """The columns `x`, `y`, `z` (n,) in metres of all scans in the file's frame, and `vp_x`, `vp_y`, `vp_z`.

    These are where each scan's scanner stood; NaN in scans without a pose. Points that a scan calls invalid are left
    out.

    Raises:
        InputError: there are more points than are read.
        FormatError: the file is damaged or cut off, or a scan has no coordinates.
    """
    pages, text = _opened(path)
    scans = [each for each in _children(_child(text, "data3D")) if _child(each, "points") is not None]
    counts = [_integer(path, _child(scan, "points"), "recordCount", 0, least=0) for scan in scans]
    point_file.require_few(path, sum(counts))
    parts = [_scan(pages, scan, count) for scan, count in zip(scans, counts, strict=True) if count]
    points, places = (np.concatenate(each) for each in zip(*parts, strict=True))
    return dict(zip(("x", "y", "z", "vp_x", "vp_y", "vp_z"), (*points.T, *places.T), strict=True))


def _opened(path: Path) -> tuple[_Pages, ElementTree.Element]:
    with path.open("rb") as file:
        head = file.read(48)
    if head[:8] != b"ASTM-E57" or len(head) < 48:
        raise FormatError(f"{path} is no E57 file, or its header is cut off; export it again")
    length, xml_offset, xml_length, page_size = struct.unpack("<QQQQ", head[16:])
    size = path.stat().st_size
    if page_size != _PAGE or length != size or size % _PAGE:
        raise damaged(path, f"it states {length} bytes in pages of {page_size}, and has {size}")
    if size > point_file.LARGEST_BYTES or xml_length > _LARGEST_XML:
        raise InputError(
            f"{path} has {size / 1e9:.3g} GB, at most {point_file.LARGEST_BYTES / 1e9:g} are read: thin it"
        )
    pages = _Pages(path, np.memmap(path, np.uint8, "r", shape=(size // _PAGE, _PAGE)))
    _require_unharmed(pages)
    text = pages.read(xml_offset, xml_length)
    try:
        if b"<!" in text.replace(b"<![CDATA[", b"").replace(b"<!--", b""):  # entities may grow without bound
            raise damaged(path, "its text declares entities")
        return pages, ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise damaged(path, str(error)) from None


def _require_unharmed(pages: _Pages) -> None:
    """Check each page against its checksum, CRC-32C."""
    table = np.arange(256, dtype=np.uint32)
    for _ in range(8):
        table = (table >> 1) ^ np.where(table & 1, np.uint32(0x82F63B78), np.uint32(0))
    for begin in range(0, len(pages.pages), _PAGES_AT_A_TIME):
        some = np.ascontiguousarray(pages.pages[begin : begin + _PAGES_AT_A_TIME])
        rest = np.full(len(some), 0xFFFFFFFF, np.uint32)
        for column in np.ascontiguousarray(some[:, :_USED].T):
            rest = (rest >> 8) ^ table[(rest & 0xFF) ^ column]
        stated = np.ascontiguousarray(some[:, _USED:]).view(">u4")[:, 0]
        if (wrong := np.flatnonzero(~rest != stated)).size:
            raise damaged(pages.path, f"page {begin + wrong[0]} is not what its checksum says")


def _scan(pages: _Pages, scan: ElementTree.Element, count: int) -> tuple[FloatArray, FloatArray]:
    """Points (n, 3) in the file's frame, and the place (n, 3) of the scanner."""
    cloud = _child(scan, "points")
    assert cloud is not None
    fields = [_field(pages.path, each) for each in _children(_child(cloud, "prototype"))]
    names = [field.name for field in fields]
    kind = next((kind for kind in (_CARTESIAN, _SPHERICAL) if set(kind) <= set(names)), None)
    if kind is None:
        raise FormatError(f"{pages.path}: a scan has neither cartesian nor spherical coordinates")
    wanted = {names.index(name) for name in (*kind, _INVALID[kind]) if name in names}
    values = _columns(pages, fields, wanted, _integer(pages.path, cloud, "fileOffset", 0, least=0), count)
    columns = dict(zip((names[k] for k in sorted(wanted)), values, strict=True))
    points = np.stack([columns[name] for name in kind], axis=1)
    points = points[columns.get(_INVALID[kind], np.zeros(count)) == 0]
    if kind is _SPHERICAL:
        r, azimuth, elevation = points.T
        flat = r * np.cos(elevation)
        points = np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), r * np.sin(elevation)], axis=1)
    q, place = _pose(pages.path, _child(scan, "pose"))
    if q is None:
        return points, np.full(points.shape, np.nan)
    return points @ rotations.matrix(q).T + place, np.tile(place, (len(points), 1))


def _pose(path: Path, pose: ElementTree.Element | None) -> tuple[FloatArray | None, FloatArray]:
    """q_world_scanner (w, x, y, z) and its place (3,); None where the scan has no pose."""
    if pose is None:
        return None, np.zeros(3)
    turn, shift = _child(pose, "rotation"), _child(pose, "translation")
    q = np.array([1.0, 0.0, 0.0, 0.0]) if turn is None else np.array([_number(path, turn, name) for name in "wxyz"])
    place = np.zeros(3) if shift is None else np.array([_number(path, shift, name) for name in "xyz"])
    if not abs(float(np.linalg.norm(q)) - 1.0) < 1e-3 or not np.isfinite(place).all():
        raise damaged(path, f"a scan's pose is {q.tolist()}, {place.tolist()}, no unit quaternion and place")
    return q / np.linalg.norm(q), place


def _field(path: Path, element: ElementTree.Element) -> _Field:
    name, kind = _name(element), element.get("type")
    if kind == "Float":
        is_single = element.get("precision") == "single"
        return _Field(name, "<f4" if is_single else "<f8", 32 if is_single else 64, 0, 1.0, 0.0)
    if kind not in ("Integer", "ScaledInteger"):
        raise FormatError(f"{path}: {name[:60]} of a point is a {str(kind)[:40]}, which is no number")
    least, most = (
        _integer(path, element, end, other) for end, other in (("minimum", -(2**63)), ("maximum", 2**63 - 1))
    )
    if most < least or least < -(2**63) or most >= 2**63:
        raise damaged(path, f"{name[:60]} goes from {least} to {most}")
    try:
        scale, offset = float(element.get("scale", "1")), float(element.get("offset", "0"))
    except ValueError:
        raise damaged(path, f"the scale of {name[:60]} is no number") from None
    return _Field(name, "", (most - least).bit_length(), least, scale, offset)


def _columns(
    pages: _Pages, fields: list[_Field], wanted: set[int], offset: int, count: int
) -> Iterator[NDArray[np.float64]]:
    """The wanted fields (count,), in order."""
    section = pages.read(offset, 32)
    length, packet = struct.unpack_from("<QQ", section, 8)
    if section[0] != _DATA:
        raise damaged(pages.path, "a scan's points are not where it says")
    streams: dict[int, list[bytes]] = {k: [] for k in sorted(wanted)}
    held = dict.fromkeys(streams, 0)
    needed = {k: -(-count * fields[k].bits // 8) for k in streams}
    end = pages.after(offset, length)
    while packet < end and any(held[k] < needed[k] for k in streams):
        kind, size, buffers = struct.unpack("<BxHH", pages.read(packet, 6))
        if kind == _DATA:
            body = pages.read(packet, size + 1)
            if buffers != len(fields) or 6 + 2 * buffers > len(body):
                raise damaged(pages.path, f"a packet has {buffers} streams for {len(fields)} fields")
            ends = 6 + 2 * buffers + np.cumsum(np.frombuffer(body, "<u2", buffers, 6), dtype=np.int64)
            for k in streams:
                streams[k].append(body[ends[k - 1] if k else 6 + 2 * buffers : ends[k]])
                held[k] += len(streams[k][-1])
        packet = pages.after(packet, size + 1)
    for k in streams:
        if held[k] < needed[k]:
            raise damaged(pages.path, f"a scan states {count} points and holds fewer")
    return (_decoded(fields[k], b"".join(parts), count) for k, parts in streams.items())


def _decoded(field: _Field, stream: bytes, count: int) -> NDArray[np.float64]:
    """(count,) of a stream: floats as they are, integers in as few bits as their range takes, the lowest first."""
    if field.kind:
        return np.frombuffer(stream, field.kind, count).astype(np.float64)
    raw = np.zeros(count, np.uint64)
    padded = np.frombuffer(stream + bytes(16), np.uint8)
    first = np.arange(count, dtype=np.int64) * field.bits
    for k in range(-(-field.bits // 8) + 1 if field.bits else 0):
        part = padded[(first >> 3) + k].astype(np.uint64)
        shift = 8 * k - (first & 7)
        up, down = np.maximum(shift, 0).astype(np.uint64), np.maximum(-shift, 0).astype(np.uint64)
        raw |= np.where(shift < 64, (part >> down) << np.minimum(up, 63), np.uint64(0))
    mask = np.uint64((1 << field.bits) - 1)
    return ((raw & mask).astype(np.float64) + field.least) * field.scale + field.offset


def _name(element: ElementTree.Element) -> str:
    return element.tag.rsplit("}", 1)[-1]


def _children(element: ElementTree.Element | None) -> list[ElementTree.Element]:
    return [] if element is None else list(element)


def _child(element: ElementTree.Element | None, name: str) -> ElementTree.Element | None:
    return next((each for each in _children(element) if _name(each) == name), None)


def _number(path: Path, parent: ElementTree.Element, name: str) -> float:
    element = _child(parent, name)
    text = "" if element is None else (element.text or "").strip()
    try:
        return float(text or "0")  # zeros may be left out
    except ValueError:
        raise damaged(path, f"{name} of a pose is {text[:40]!r}") from None


def _integer(path: Path, element: ElementTree.Element | None, name: str, other: int, *, least: int = -(2**63)) -> int:
    text = (None if element is None else element.get(name)) or str(other)
    if not re.fullmatch(r"-?[0-9]{1,19}", text) or int(text) < least:
        raise damaged(path, f"{name} is {text[:40]!r}")
    return int(text)
