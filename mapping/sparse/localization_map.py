"""What relocalization needs of a map: its points with their descriptors, and their file of 57 bytes a point.

The file is for vehicles as much as for us: docs/reference/formats.md describes it byte by byte, and
`mapping/localization/reader` reads it in plain C. A descriptor's 128 elements are kept as the nearest of eight levels,
three bits each.
"""

import zipfile
import zlib
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from flight import FloatArray, FormatError, InputError, file_format
from mapping.sparse.features import features

FILE = "points.bin"
MAGIC = b"goshloc\0"
VERSION = 1
LEVELS = (1, 12, 23, 36, 50, 67, 87, 110)
"""What the eight codes of a descriptor's element mean. Those of least mean square error (Lloyd, 1982) over a map of the
rendered room and features of a real walk, equally many; each file carries its own."""
UNIT_M = 0.001
"""Of the coordinates in the file."""
_REACH = 1 << 23
"""Coordinates are signed integers of 24 bits."""
_HEADER = np.dtype(
    [("magic", "S8"), ("version", "<u4"), ("points", "<u4"), ("origin_m", "<i4", 3), ("levels", "u1", 8)]
)
_POINT = np.dtype([("place", "u1", (3, 3)), ("codes", "u1", 48)])
_CRC_BYTES = 4
_EARLIER_FORMAT = "goshawk-localization"


@dataclass(frozen=True, slots=True, eq=False)
class LocalizationMap:
    """Map points with descriptors."""

    points_world_m: FloatArray
    """(m, 3)."""
    descriptors: np.ndarray
    """(m, 128) float32 of unit length."""


def save(folder: Path, known: LocalizationMap) -> None:
    """Write `points.bin` into a new folder.

    Raises:
        InputError: a point is not finite, or so far from the others that 24 bits of millimetres do not reach it.
    """
    folder.mkdir(parents=True)
    file_format.write_bytes(folder / FILE, encode(known))


def file(folder: Path) -> Path:
    """The file with the points of a localization map: `points.bin`, or `points.npz` of an earlier version."""
    earlier = folder / "points.npz"
    return earlier if earlier.is_file() and not (folder / FILE).is_file() else folder / FILE


def load(folder: Path) -> LocalizationMap:
    """Read what `save` wrote, now or in earlier versions (`points.npz` with `localization.toml`).

    Raises:
        InputError: the folder has no localization map.
        FormatError: it is damaged, or newer than this version.
    """
    path = file(folder)
    if not path.is_file():
        raise InputError(f"{folder} has no {FILE}; build the map again")
    if path.name != FILE:
        return _load_earlier(folder)
    with _naming(path):
        return decode(path.read_bytes())


def load_points(path: Path) -> FloatArray:
    """(m, 3) in the world: the points alone of a file that `file` names, in a tenth of the memory. Raises as `load`."""
    if path.name == FILE:
        with _naming(path):
            return _places(*_checked(path.read_bytes()))
    try:
        with np.load(path, allow_pickle=False) as data:
            return data["points_world_m"]
    except (OSError, KeyError, ValueError, EOFError, zipfile.BadZipFile) as error:
        raise FormatError(f"{path} cannot be read ({error}); build the map again") from error


@contextmanager
def _naming(path: Path) -> Generator[None]:
    """Lets an error name the file that is read."""
    try:
        yield
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}") from error
    except FormatError as error:
        raise FormatError(f"{path}: {error}; build the map again") from None


def encode(known: LocalizationMap) -> bytes:
    """The bytes of the file. Raises as `save`."""
    points, count = np.asarray(known.points_world_m, dtype=np.float64).reshape(-1, 3), len(known.points_world_m)
    if not np.isfinite(points).all():
        raise InputError("a point of the localization map is not finite")
    origin_m = np.round(0.5 * (points.min(axis=0) + points.max(axis=0))) if count else np.zeros(3)
    place = np.round((points - origin_m) / UNIT_M)
    if np.abs(place).max(initial=0.0) >= _REACH or np.abs(origin_m).max() >= 2.0**31:
        raise InputError(
            f"points of the localization map reach from {points.min(axis=0).round(1).tolist()} to "
            f"{points.max(axis=0).round(1).tolist()} m; at most {2 * _REACH * UNIT_M:.0f} m fit"
        )
    header = np.zeros((), _HEADER)
    header["magic"], header["version"], header["points"] = MAGIC, VERSION, count
    header["origin_m"], header["levels"] = origin_m, LEVELS
    body = np.zeros(count, _POINT)
    body["place"] = place.astype("<i4").view("u1").reshape(-1, 3, 4)[:, :, :3]  # the fourth byte repeats the sign
    borders = 0.5 * (np.array(LEVELS[:-1]) + LEVELS[1:])
    codes = np.searchsorted(borders, 512.0 * np.asarray(known.descriptors)).astype(np.uint8)
    bits = np.unpackbits(codes[..., None], axis=-1, count=3, bitorder="little")
    body["codes"] = np.packbits(bits.reshape(count, 384), axis=-1, bitorder="little")
    data = header.tobytes() + body.tobytes()
    return data + zlib.crc32(data).to_bytes(_CRC_BYTES, "little")


def decode(data: bytes) -> LocalizationMap:
    """What was given to `encode`: points to half a millimetre, descriptors to their levels.

    Raises:
        FormatError: these are not the bytes of a localization map, or of a newer one.
    """
    header, body = _checked(data)
    bits = np.unpackbits(body["codes"], axis=-1, bitorder="little").reshape(len(body), 128, 3)
    codes = bits[..., 0] | bits[..., 1] << 1 | bits[..., 2] << 2
    return LocalizationMap(_places(header, body), features.unit(header["levels"][codes]))


def _checked(data: bytes) -> tuple[np.void, np.ndarray]:
    """Header and points of a file."""
    if len(data) < _HEADER.itemsize + _CRC_BYTES or not data.startswith(MAGIC):
        raise FormatError("not a localization map")
    header = np.frombuffer(data, _HEADER, 1)[0]
    count = int(header["points"])
    if header["version"] != VERSION:
        raise FormatError(f"localization map of version {header['version']}; this version reads {VERSION}")
    if len(data) != _HEADER.itemsize + count * _POINT.itemsize + _CRC_BYTES:
        raise FormatError(f"{len(data)} bytes do not hold the {count} points that the header names")
    if zlib.crc32(memoryview(data)[:-_CRC_BYTES]) != int.from_bytes(data[-_CRC_BYTES:], "little"):
        raise FormatError("damaged: the checksum does not match")
    if (np.diff(header["levels"].astype(int)) <= 0).any():
        raise FormatError(f"damaged: the levels of the descriptors do not increase: {header['levels'].tolist()}")
    return header, np.frombuffer(data, _POINT, offset=_HEADER.itemsize, count=count)


def _places(header: np.void, body: np.ndarray) -> FloatArray:
    """(m, 3) in the world."""
    low, middle, high = np.moveaxis(body["place"].astype(np.int32), -1, 0)
    units = low | middle << 8 | high << 16
    return header["origin_m"] + UNIT_M * np.where(units < _REACH, units, units - 2 * _REACH)


def _load_earlier(folder: Path) -> LocalizationMap:
    """A localization map of before its file was `points.bin`."""
    document = file_format.read_toml(folder / "localization.toml", format=_EARLIER_FORMAT, version=1)
    if file_format.file_hash(folder / "points.npz") != document.get("hash"):
        raise FormatError(f"{folder / 'points.npz'} does not match its hash; build the map again")
    with np.load(folder / "points.npz", allow_pickle=False) as data:
        return LocalizationMap(data["points_world_m"], features.unit(data["descriptors"]))
