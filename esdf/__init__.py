"""The distance field: how far every point of a map is from the nearest surface, exactly, and honestly where unknown."""

from esdf import solids
from esdf.build import build
from esdf.clearance import Clearance, certify
from esdf.field import KNOWN, OUTSIDE, UNMAPPED, Field
from esdf.grid import FREE, OCCUPIED, UNKNOWN, Grid
from esdf.solids import rasterize
from esdf.storage import load, save

__all__ = [
    "FREE",
    "KNOWN",
    "OCCUPIED",
    "OUTSIDE",
    "UNKNOWN",
    "UNMAPPED",
    "Clearance",
    "Field",
    "Grid",
    "build",
    "certify",
    "load",
    "rasterize",
    "save",
    "solids",
]
