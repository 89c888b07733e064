"""The distance field: how far every point of a map is from the nearest surface; NaN where the map is unknown."""

from esdf import observe, regrid, solids
from esdf.block_field import BlockField, build_blocks, edit_blocks, open_blocks, update_blocks
from esdf.blocks import ArraySource, SolidSource
from esdf.build import build
from esdf.clearance import Clearance, certify, profile
from esdf.edits import Edit, Editor, load_edits, save_edits
from esdf.field import KNOWN, OUTSIDE, UNMAPPED, Field
from esdf.grid import FREE, OCCUPIED, UNKNOWN, Grid
from esdf.solids import rasterize
from esdf.storage import load, open_editor, save

__all__ = [
    "FREE",
    "KNOWN",
    "OCCUPIED",
    "OUTSIDE",
    "UNKNOWN",
    "UNMAPPED",
    "ArraySource",
    "BlockField",
    "Clearance",
    "Edit",
    "Editor",
    "Field",
    "Grid",
    "SolidSource",
    "build",
    "build_blocks",
    "certify",
    "edit_blocks",
    "load",
    "load_edits",
    "observe",
    "open_blocks",
    "open_editor",
    "profile",
    "rasterize",
    "regrid",
    "save",
    "save_edits",
    "solids",
    "update_blocks",
]
