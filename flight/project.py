"""A project folder: the map, the vehicle, the waypoints, the trajectories and the flights of one place.

project.toml        what this folder is
map/                written by `goshawk map build`
vehicle.toml        what we believe about the vehicle
waypoints.json      the pilot's waypoints (see `Waypoints`)
trajectories/*.json checked trajectories
flights/*.parquet   flight logs
"""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from flight import file_format
from flight.errors import FormatError, InputError
from flight.rotations import FloatArray

FORMAT = "goshawk-project"
VERSION = 1
WAYPOINTS_FORMAT = "goshawk-waypoints"
WAYPOINTS_VERSION = 1
MISSION_VERSION = 2
"""Of a waypoints file that asks for more than waypoints (`flight.mission`)."""
_NAME_LENGTH = 100
_PART_NAME = re.compile(rf"[^\W_][\w .+=,()-]{{0,{_NAME_LENGTH - 1}}}")


@dataclass(frozen=True, slots=True)
class Project:
    """Paths of a project's parts. The parts may not exist yet."""

    folder: Path
    name: str

    @property
    def map(self) -> Path:
        return self.folder / "map"

    @property
    def has_map(self) -> bool:
        return (self.map / "map.toml").is_file()

    @property
    def vehicle(self) -> Path:
        return self.folder / "vehicle.toml"

    @property
    def has_vehicle(self) -> bool:
        return self.vehicle.is_file()

    @property
    def waypoints(self) -> Path:
        return self.folder / "waypoints.json"

    def trajectory(self, name: str) -> Path:
        """Raises `InputError` if `name` is no `part_name`."""
        return self.folder / "trajectories" / f"{part_name(name)}.json"

    def flight(self, name: str) -> Path:
        """Raises `InputError` if `name` is no `part_name`."""
        return self.folder / "flights" / f"{part_name(name)}.parquet"

    def trajectories(self) -> list[Path]:
        return _whole(self.folder / "trajectories", ".json")

    def flights(self) -> list[Path]:
        return _whole(self.folder / "flights", ".parquet")


def _whole(folder: Path, suffix: str) -> list[Path]:
    """Files of this kind, without those that are being written: their names begin with a dot."""
    return sorted(path for path in folder.glob(f"*{suffix}") if not path.name.startswith("."))


def part_name(name: str) -> str:
    """The name, if a trajectory or a flight may have it: it becomes a file's name and is shown on the page.

    Raises:
        InputError: it could lead out of the folder, hide the file, or be taken for markup.
    """
    if not _PART_NAME.fullmatch(name):
        raise InputError(
            f"{name!r} cannot be a name here: take 1 to {_NAME_LENGTH} letters, digits, spaces or any of . _ + = , ( ) "
            "and -, with a letter or digit first"
        )
    return name


def create(folder: Path, name: str) -> Project:
    """Start a project in `folder` (made if need be); opening one that is there already is no error."""
    folder = Path(folder)
    if (folder / "project.toml").exists():
        return open_project(folder)
    folder.mkdir(parents=True, exist_ok=True)
    file_format.write_toml(folder / "project.toml", format=FORMAT, version=VERSION, body={"name": name})
    return Project(folder, name)


def open_project(folder: Path) -> Project:
    """Raises `InputError` if `folder` is not a project, `FormatError` if its `project.toml` cannot be read."""
    folder = Path(folder)
    if not (folder / "project.toml").is_file():
        raise InputError(f"{folder} is not a Goshawk project: it has no project.toml; `goshawk init` makes one")
    document = file_format.read_toml(folder / "project.toml", format=FORMAT, version=VERSION)
    return Project(folder, str(document.get("name", folder.name)))


@dataclass(frozen=True, slots=True, eq=False)
class Waypoints:
    """Positions, and optionally headings, that a trajectory must pass."""

    positions_world_m: FloatArray
    """(n, 3), in order."""
    yaw_rad: FloatArray
    """(n,) heading at each; NaN where the planner may choose (it then looks along the path)."""

    def __post_init__(self) -> None:
        positions = np.asarray(self.positions_world_m, dtype=np.float64)
        yaw = np.asarray(self.yaw_rad, dtype=np.float64)
        if positions.ndim != 2 or positions.shape[1] != 3 or yaw.shape != (len(positions),):
            raise InputError(
                f"waypoints: expected positions (n, 3) and yaw (n,), got {positions.shape} and {yaw.shape}"
            )
        broken = np.flatnonzero(~np.isfinite(positions).all(axis=1))
        if broken.size:
            raise InputError(f"waypoint {int(broken[0]) + 1} is not finite: {positions[broken[0]].tolist()}")
        if np.isinf(yaw).any():
            raise InputError(f"the yaw of waypoint {int(np.flatnonzero(np.isinf(yaw))[0]) + 1} is infinite")
        object.__setattr__(self, "positions_world_m", positions)
        object.__setattr__(self, "yaw_rad", yaw)


def waypoint_records(waypoints: Waypoints) -> list[dict[str, object]]:
    """JSON-able: one record for each waypoint."""
    return [
        {"position_world_m": p.tolist(), "yaw_rad": None if np.isnan(y) else float(y)}
        for p, y in zip(waypoints.positions_world_m, waypoints.yaw_rad, strict=True)
    ]


def save_waypoints(path: Path, waypoints: Waypoints) -> None:
    body = {"waypoints": waypoint_records(waypoints)}
    file_format.write_json(path, format=WAYPOINTS_FORMAT, version=WAYPOINTS_VERSION, body=body)


def load_waypoints(path: Path) -> Waypoints:
    """Read a file of waypoints alone; `flight.mission.load` reads those that ask for more.

    Raises:
        InputError: no such file.
        FormatError: it is damaged, of another format, or asks for more than waypoints.
    """
    document = file_format.read_json(path, format=WAYPOINTS_FORMAT, version=MISSION_VERSION)
    more = sorted(set(document) - {"format", "version", "waypoints"})
    if more and document["version"] > WAYPOINTS_VERSION:
        raise FormatError(f"{path} asks for {', '.join(more)} besides waypoints; only `goshawk plan` knows these")
    return waypoints_from(document, path)


def waypoints_from(document: file_format.Document, path: Path) -> Waypoints:
    """The waypoints of a file's content.

    Raises:
        FormatError: they are damaged.
    """
    try:
        points = document["waypoints"]
        positions = np.array([p["position_world_m"] for p in points], dtype=np.float64).reshape(-1, 3)
        yaws = [p.get("yaw_rad") for p in points]
        broken = [i for i, y in enumerate(yaws) if y is not None and np.isnan(float(y))]
        if broken:
            raise FormatError(
                f"{path}: the yaw of waypoint {broken[0] + 1} is not a number; null leaves it to the planner"
            )
        return Waypoints(positions, np.array([np.nan if y is None else y for y in yaws], dtype=np.float64))
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise FormatError(f"{path} is a damaged waypoint file: {file_format.damage_text(error)}") from error
