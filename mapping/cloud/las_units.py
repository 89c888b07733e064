"""The unit that a LAS file states for its coordinates, in a record of its projection: WKT, or GeoTIFF's keys."""

import re
import struct
from collections.abc import Mapping
from pathlib import Path

from flight import InputError

Records = Mapping[int, bytes]
"""Of LASF_Projection, by their numbers."""
WKT, KEYS = 2112, 34735
_MODEL, _LINEAR, _VERTICAL = 1024, 3076, 4099
_GEOGRAPHIC, _GEOCENTRIC = 2, 3
_KEYED = {9001: "m", 9002: "ft", 9003: "ft"}
"""GeoTIFF's numbers of units; feet of the survey differ from international ones by 2 ppm."""
_NOT_OF_AXES = re.compile(
    r"\b(?:ELLIPSOID|SPHEROID|PARAMETER|PRIMEM|AUTHORITY|ID)\[[^\[\]]*(?:\[[^\[\]]*\][^\[\]]*)*\]", re.I
)
_UNIT = re.compile(r'\b(?:LENGTH)?UNIT\[\s*"([^"]*)"\s*,\s*(\d+\.?\d*(?:[eE][+-]?\d+)?)', re.I)
_DEGREES = re.compile(r"\b(?:GEOGCS|GEOGCRS|GEODCRS|GEOCCS)\[", re.I)
_PLANE = re.compile(r"\b(?:PROJCS|PROJCRS|LOCAL_CS|ENGCRS)\[", re.I)


def stated(path: Path, records: Records) -> str | None:
    """The unit, `m` or `ft`; None where no record says one.

    Raises:
        InputError: the coordinates are degrees, or its axes differ in their units.
    """
    text, keys = _text(records), _keyed(records)
    globe = bool(_DEGREES.search(text)) and not _PLANE.search(text)
    if globe or (not text and keys.get(_MODEL) in (_GEOGRAPHIC, _GEOCENTRIC)):
        raise InputError(
            f"{path} states coordinates on the globe, in degrees say; project them to metres first, with PDAL or QGIS "
            "say"
        )
    if text:
        return _one(path, _of_wkt(text))
    return _one(path, {_KEYED.get(keys[key], "another") for key in (_LINEAR, _VERTICAL) if key in keys})


def _text(records: Records) -> str:
    return records.get(WKT, b"").rstrip(b"\0").decode("utf-8", "replace")


def _keyed(records: Records) -> dict[int, int]:
    """GeoTIFF's keys whose values stand in the directory itself."""
    keys = records.get(KEYS, b"")
    rows = struct.iter_unpack("<4H", keys[8 : max(8, len(keys) // 8 * 8)])
    return {key: value for key, place, _, value in rows if not place}


def _of_wkt(text: str) -> set[str]:
    """Units of length that the axes of a plane system have."""
    units = _UNIT.findall(_NOT_OF_AXES.sub("", text)) if _PLANE.search(text) else []
    return {_named(float(factor)) for name, factor in units if _is_length(name)}


def _is_length(name: str) -> bool:
    return "deg" not in name.lower() and "rad" not in name.lower() and name.lower() not in ("grad", "unity")


def _named(metres: float) -> str:
    return "m" if metres == 1.0 else "ft" if abs(metres - 0.3048) < 1e-5 else "another"


def _one(path: Path, units: set[str]) -> str | None:
    if len(units) > 1:
        raise InputError(
            f"{path} states different units for its axes ({', '.join(sorted(units))}); write it anew in one, with PDAL "
            "or CloudCompare say"
        )
    return next((unit for unit in units if unit != "another"), None)
