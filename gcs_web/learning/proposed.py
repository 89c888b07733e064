"""The proposed next flight as it is kept on disk, and a level cut through the map to draw it over."""

from pathlib import Path

import msgspec
import numpy as np

from esdf.edits import EDITS
from esdf.field import SampledField
from flight import file_format
from flight.project import Project
from gcs_web.flights import session_files
from gcs_web.protocol.next_flight import NextFlight, Section

CELLS = 90
"""Of the longer side of a section."""


def file(folder: Path) -> Path:
    return folder / ".session" / "next-flight.json"


def map_hash(project: Project) -> str:
    """Of what the map says of itself, its hash as built among it, and of the pilot's edits; empty where no map is."""
    facts, edits = project.map / "map.toml", project.map / "esdf" / EDITS
    if not facts.is_file():
        return ""
    return " ".join(file_format.file_hash(file) for file in (facts, edits) if file.is_file())


def save(folder: Path, found: NextFlight) -> None:
    file_format.write_bytes(file(folder), msgspec.json.encode(found))


def load(folder: Path) -> NextFlight:
    """The one that was saved; none where there is none that can be read."""
    return session_files.read(file(folder), NextFlight) or NextFlight("none")


def section(field: SampledField, height_m: float, clearance_m: float) -> Section:
    """Where the map has room for the vehicle's centre at one height, at about `CELLS` cells along its longer side."""
    low = np.asarray(field.grid.low_world_m)[:2]
    size = (np.array(field.grid.shape) * np.broadcast_to(field.grid.voxel_m, (3,)))[:2]
    cell_m = float(size.max()) / CELLS
    x, y = (low[i] + cell_m * (np.arange(max(1, round(size[i] / cell_m))) + 0.5) for i in range(2))
    points = np.stack([*np.meshgrid(x, y), np.full((len(y), len(x)), height_m)], axis=-1)
    distance_m = field.distance(points.reshape(-1, 3)).reshape(len(y), len(x))
    free = np.nan_to_num(distance_m, nan=-np.inf) >= clearance_m
    rows = ["".join("." if cell else "#" for cell in row) for row in free]
    return Section((float(low[0]), float(low[1])), height_m, cell_m, rows)
