"""A map without images, from what another program made: its voxels, and the folder. What is free must be stated."""

from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np
from numpy.typing import NDArray

import esdf
from esdf import FREE, OCCUPIED, UNKNOWN, Grid, triangles
from flight import FloatArray, InputError, Progress, file_format, results, silent
from mapping import foreign_mesh, map_folder, reach
from mapping.dense import mesh_file
from mapping.foreign_mesh import ForeignMesh
from mapping.map_server import Floor
from mapping.verdict import Standing

MOST_VOXELS = 450_000_000
"""A hall of 100 x 50 x 10 m has 410 million of 5 cm."""
MOST_TRACED = 150_000_000
"""Of a cloud of points or an OctoMap, whose rays or leaves take memory of their own."""
_CGROUPS = Path("/sys/fs/cgroup")
_LIMITS = {
    "1": (_CGROUPS / "memory", "memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file"),
    "2": (_CGROUPS, "memory.max", "memory.current", "inactive_file"),
}
"""Of Linux' control groups, by version: where they are, the files of a limit and of what is taken, in bytes, and what
of the latter, in `memory.stat`, is of files and can be given back."""
BYTES_EACH = 14
"""Of memory at most, of all arrays of an import together: 12 while the finished map is opened."""


@dataclass(frozen=True, slots=True, eq=False)
class Space:
    """The voxels of an imported map."""

    grid: Grid
    state: NDArray[np.uint8]
    """(nx, ny, nz)."""
    of: str = ""
    """Which part of the file it is, where that may hold several."""

    @property
    def open_sides(self) -> int:
        """Free voxels on the six faces of the box: there nothing bounds the free space."""
        sides = [np.take(self.state, end, axis) for axis in range(3) for end in (0, -1)]
        return sum(int((side == FREE).sum()) for side in sides)

    def volume_m3(self, which: int) -> float:
        """Of the voxels in one state."""
        return float((self.state == which).sum()) * float(np.prod(self.grid.voxel_m))


def space(mesh: ForeignMesh, voxel_m: float, observed_world_m: FloatArray, progress: Progress = silent) -> Space:
    """Voxels that a mesh touches are occupied; those that a path connects with an observed place are free.

    All others stay unknown. Paths lead through faces of voxels, within the box about the mesh.

    Args:
        observed_world_m: (n, 3) places that are known to be free; n may be 0.

    Raises:
        InputError: too many voxels, or a place is outside the box or in a voxel of the surface.
    """
    low, high = mesh.vertices_world_m.min(axis=0), mesh.vertices_world_m.max(axis=0)
    grid = Grid.covering(low - voxel_m, high + voxel_m, voxel_m)
    require_few(grid, "cut the mesh", coarser=True)
    progress(f"{grid.voxels / 1e6:,.1f} million voxels, {BYTES_EACH * grid.voxels / 1e9:.1f} GB of memory", 0.3)
    surface = triangles.touched(mesh.vertices_world_m, mesh.faces, grid)
    state = np.where(surface, np.uint8(OCCUPIED), np.uint8(UNKNOWN))
    remedy = f"lies in a voxel of the surface; name a place that is free, or take a smaller --voxel than {voxel_m:g} m"
    state[connected(surface, grid, observed_world_m, "mesh", remedy)] = FREE
    return Space(grid, state)


def columns(floor: Floor, low_m: float, high_m: float) -> Space:
    """Columns of voxels over the cells of a two-dimensional map, in its states from one height to another.

    Raises:
        InputError: there is less than a voxel between the heights, they are too far away, or there are too many voxels.
    """
    reach.require_near_origin(np.array([low_m, high_m]), "--heights")
    layers = int((high_m - low_m) / floor.cell_m + 1e-6) if low_m < high_m else 0  # none that reaches beyond
    if layers < 1:
        raise InputError(f"--heights is {low_m:g},{high_m:g} m; the second must be at least {floor.cell_m:g} m higher")
    cube = (floor.cell_m, floor.cell_m, floor.cell_m)
    grid = Grid((*floor.low_world_m, low_m), cube, (*floor.state.shape, layers))
    require_few(grid, "give less between the heights, or a coarser map")
    return Space(grid, np.repeat(floor.state[:, :, None], layers, axis=2))


def require_few(grid: Grid, remedy: str, *, coarser: bool = False, at_most: int = MOST_VOXELS) -> None:
    """
    Raises:
        InputError: there are more voxels than memory is for.
    """
    free_bytes = free_memory_bytes()
    most = min(at_most, free_bytes // BYTES_EACH)
    if grid.voxels <= most:
        return
    if coarser:
        remedy = f"take --voxel {1.05 * grid.voxel_m[0] * (grid.voxels / max(most, 1)) ** (1 / 3):.2g}, or {remedy}"
    count = f"voxels of {grid.voxel_m[0]:g} m would be {grid.voxels / 1e6:,.0f} million"
    if grid.voxels > at_most:
        raise InputError(f"{count}, at most {at_most / 1e6:g} million: {remedy}")
    raise InputError(
        f"{count} and take {BYTES_EACH * grid.voxels / 1e9:.1f} GB of memory; {free_bytes / 1e9:.1f} GB are free here: "
        f"{remedy}"
    )


def free_memory_bytes() -> int:
    """What this machine can give without swapping, and what the container or service that this runs in may take."""
    try:
        said = dict(line.split(":", 1) for line in Path("/proc/meminfo").read_text().splitlines())
        free = 1024 * int(said["MemAvailable"].split()[0])
        lines = Path("/proc/self/cgroup").read_text().splitlines()
    except (OSError, KeyError, ValueError):  # no Linux: as many voxels as ever
        return BYTES_EACH * MOST_VOXELS
    return min([free, *(left for line in lines for left in _left_bytes(line))])


def _left_bytes(line: str) -> list[int]:
    """What a control group, as in /proc/self/cgroup, and those above it leave of their limits of memory."""
    _, controllers, name = line.split(":", 2)
    if controllers and "memory" not in controllers.split(","):
        return []
    top, most, used, cached = _LIMITS["1" if controllers else "2"]
    found = []
    within = PurePosixPath(name)
    for group in (within, *within.parents):
        folder = top / str(group).lstrip("/")
        try:
            said = dict(line.split() for line in (folder / "memory.stat").read_text().splitlines())
            taken = int((folder / used).read_text()) - int(said[cached])
            found.append(max(0, int((folder / most).read_text()) - taken))
        except (OSError, KeyError, ValueError):  # no such group as seen from inside, or no limit: "max"
            continue
    return found


def connected(
    closed: NDArray[np.bool_], grid: Grid, places_world_m: FloatArray, what: str, remedy: str
) -> NDArray[np.bool_]:
    """The voxels that are not closed and are connected with one of the places (n, 3), through faces of voxels.

    Raises:
        InputError: a place is outside of the box of `what`, or in a closed voxel; then `remedy` follows its name.
    """
    from scipy import ndimage

    for place in places_world_m:
        if not grid.contains(place[None])[0]:
            corners = f"{np.round(grid.low_world_m, 2).tolist()} to {np.round(grid.high_world_m, 2).tolist()}"
            raise InputError(
                f"--observed {_text(place)} is outside of the {what}'s box, {corners} m in the map's frame"
            )
        if closed[_voxel(grid, place)]:
            raise InputError(f"--observed {_text(place)} {remedy}")
    if not len(places_world_m):
        return np.zeros(grid.shape, bool)
    rooms, count = ndimage.label(~closed)  # pyright: ignore[reportGeneralTypeIssues]
    is_asked = np.zeros(count + 1, bool)
    is_asked[[rooms[_voxel(grid, place)] for place in places_world_m]] = True
    asked = np.empty(grid.shape, bool)
    for layer, room in zip(asked, rooms, strict=True):  # np.isin of all takes 14 bytes a voxel more
        layer[:] = is_asked[room]
    return asked


def _voxel(grid: Grid, place_world_m: FloatArray) -> tuple[int, int, int]:
    i, j, k = np.clip(grid.index(place_world_m[None])[0], 0, np.array(grid.shape) - 1).tolist()
    return i, j, k


def _text(place_world_m: FloatArray) -> str:
    return ",".join(f"{x:g}" for x in place_world_m)


def write(out: Path, mesh: ForeignMesh, found: Space, facts: dict[str, Any], reason: str, *, overwrite: bool) -> str:
    """Write the map folder, whole or not at all; returns its hash.

    Args:
        facts: of `map.toml`, besides.
        reason: why the map is not called good.

    Raises:
        InputError: an earlier map is there and `overwrite` was not given, or something else is there.
    """
    field = esdf.build(found.state, found.grid)
    grey = np.full((len(mesh.vertices_world_m), 3), foreign_mesh.GREY, np.uint8)
    with results.new_folder(out, overwrite=overwrite, ours=map_folder.is_map) as placing:
        new = placing.temporary
        esdf.save(new / "esdf", field)
        mesh_file.save(new / "mesh.glb", mesh.vertices_world_m, mesh.faces, grey)
        file_format.write_toml(
            new / "map.toml",
            format=map_folder.FORMAT,
            version=map_folder.VERSION,
            body={"hash": field.hash, "verdict": Standing.NOT_JUDGED, "reasons": [reason]}
            | facts
            | {map_folder.IMPORTED: True},
        )
        return map_folder.open_map(new).hash
