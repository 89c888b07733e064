"""Files that a page sent, which wait in the project to be read by a command or a job."""

from pathlib import Path

from flight import InputError, project
from flight.project import Project

LOGS = (
    ".parquet", ".ulg", ".bin", ".log", ".bbl", ".bfl", ".tlog", ".tum", ".csv", ".csv.gz", ".mcap", ".bag", ".db3",
)  # fmt: skip
"""Endings of flight logs that can be read."""
SHAPES = (".ply", ".obj", ".stl", ".glb", ".pcd")
"""Of meshes and point clouds."""
FLOORS, FLOOR_IMAGES = (".yaml", ".yml"), (".pgm", ".png", ".bmp")
"""Of ROS' maps of one height, and of the images that these name."""
VEHICLES = (".params", ".param", ".parm", ".urdf", ".xml", ".txt")
"""Of descriptions of vehicles by other programs."""


def place(opened: Project, name: str) -> Path:
    """Where a file of this name waits.

    Raises:
        InputError: nothing reads such a file, or its name could lead out of the folder.
    """
    if not name.lower().endswith((*LOGS, *SHAPES, *FLOORS, *FLOOR_IMAGES, *VEHICLES)):
        raise InputError(
            f"{name!r} is none of the files that can be read: logs ({', '.join(LOGS)}), meshes and points "
            f"({', '.join(SHAPES)}), ROS maps ({', '.join(FLOORS)} with an image) and vehicles ({', '.join(VEHICLES)})"
        )
    return opened.folder / ".session" / "incoming" / project.part_name(name)


def listed(opened: Project, kinds: tuple[str, ...]) -> list[str]:
    """Names of those with these endings, the newest first, then of those that lie in the project itself."""
    folder = place(opened, f"any{kinds[0]}").parent
    sent = sorted(_with(folder, kinds), key=lambda path: -path.stat().st_mtime_ns)
    own = sorted(path.name for path in _with(opened.folder, kinds))
    return list(dict.fromkeys([*(path.name for path in sent), *own]))


def found(opened: Project, name: str) -> Path:
    """A file of `listed`.

    Raises:
        InputError: it is not there.
    """
    for path in (place(opened, name), opened.folder / project.part_name(name)):
        if path.is_file():
            return path
    raise InputError(f"{name} is not here (any more); choose the file again")


def _with(folder: Path, kinds: tuple[str, ...]) -> list[Path]:
    if not folder.is_dir():
        return []
    return [path for path in folder.iterdir() if path.name.lower().endswith(kinds) and not path.name.startswith(".")]
