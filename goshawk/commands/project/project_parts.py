"""Parts of a project folder, those missing for the ground station, and the commands that add them."""

import contextlib
import shutil
from collections.abc import Generator, Sequence
from pathlib import Path

import mapping
import sysid
import vehicle
from flight import InputError, file_format, flight_log, project
from flight.project import Project


def parts(opened: Project) -> list[tuple[str, str, str]]:
    """Per part: its name, its path or count (empty: missing), and the command that adds it."""
    folder = opened.folder
    flights, plans = len(opened.flights()), len(opened.trajectories())
    there = {
        "map": str(opened.map) if opened.has_map else "",
        "vehicle": str(opened.vehicle) if opened.has_vehicle else "",
        "waypoints": str(opened.waypoints) if opened.waypoints.is_file() else "",
        "trajectories": f"{plans} in {folder / 'trajectories'}" if plans else "",
        "flights": f"{flights} in {folder / 'flights'}" if flights else "",
    }
    give = {
        "map": f"goshawk map build IMAGES --camera camera.toml --out {opened.map}, or goshawk init {folder} --map MAP",
        "vehicle": f"goshawk vehicle new {opened.vehicle}, or goshawk init {folder} --vehicle vehicle.toml",
        "waypoints": f"goshawk gcs {folder}: place them on the page",
        "trajectories": f"goshawk plan {opened.waypoints} --map {opened.map} --vehicle {opened.vehicle} --out "
        f"{opened.trajectory('lap')}",
        "flights": f"goshawk fly --out {opened.flight('lap')}, or goshawk init {folder} LOG",
    }
    return [(name, found, give[name]) for name, found in there.items()]


def check_for_station(folder: Path) -> Project:
    """The project; an empty folder is made one, whose parts come on the page.

    Raises:
        InputError: it is no project, and holds something else.
    """
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder} is a file; give the folder of a project, as goshawk init makes it")
    if not folder.exists():
        raise InputError(f"{folder} does not exist; goshawk init {folder} makes a project there")
    if not any(folder.iterdir()):
        return project.create(folder, folder.resolve().name)
    if not (folder / "project.toml").is_file():
        raise InputError(f"{folder} is not a project: it has no project.toml; make it one with goshawk init {folder}")
    return project.open_project(folder)


@contextlib.contextmanager
def all_or_nothing(folder: Path, flight_names: Sequence[str]) -> Generator[None]:
    """Remove what the work inside has added to a project (which may be new) if it ends with an exception."""
    opened = Project(folder, "")
    parts = (folder / "project.toml", opened.map, opened.vehicle, vehicle.history.folder(opened.vehicle))
    flights = [opened.flight(name) for name in flight_names]
    outermost_first = [*reversed(folder.parents), folder, *parts, folder / "flights", *flights]
    new = [path for path in outermost_first if not path.exists()]
    try:
        yield
    except BaseException:
        for path in new:
            if path.is_dir():
                shutil.rmtree(path)
            else:
                path.unlink(missing_ok=True)
        raise


def flight_name(log: Path) -> str:
    """What a copy of a log is called in a project."""
    return log.name.split(".")[0]


def add_map(opened: Project, source: Path) -> None:
    """Copy a map into the project.

    Raises:
        InputError: `source` is no map, or the project has one.
    """
    if opened.map.exists():
        raise InputError(f"{opened.map} exists and is kept; move it away first, or make another project")
    mapping.open_map(source)
    with file_format.atomic_folder(opened.map) as new:
        shutil.copytree(source, new, dirs_exist_ok=True)


def add_vehicle(opened: Project, source: Path) -> None:
    """Copy a vehicle file and its history into the project.

    Raises:
        InputError: `source` is no vehicle file, or the project has one.
    """
    if opened.vehicle.exists():
        raise InputError(f"{opened.vehicle} exists and is kept; move it away first, or make another project")
    read = vehicle.load(source)
    if read.effect_files:
        vehicle.save(opened.vehicle, read)  # paths of effect files are relative to the vehicle file
        return
    past = vehicle.history.folder(source)
    if past.is_dir() and not vehicle.history.folder(opened.vehicle).exists():
        shutil.copytree(past, vehicle.history.folder(opened.vehicle))
    file_format.write_bytes(opened.vehicle, source.read_bytes())


def add_flights(opened: Project, sources: Sequence[Path], columns: Path | None) -> list[Path]:
    """Copy flight logs into the project, foreign ones in our own format.

    Raises:
        InputError: a log cannot be read, or the project has one of that name; nothing was copied then.
    """
    targets: dict[Path, Path] = {}
    for source in sources:
        target = opened.flight(flight_name(source))
        if target.exists() or target in targets:
            raise InputError(f"{target} exists and is kept; rename {source} or move the other one away")
        targets[target] = source
    logs = {target: sysid.read_log(source, columns) for target, source in targets.items()}
    for target, log in logs.items():
        flight_log.save(target, log)
    return list(logs)
