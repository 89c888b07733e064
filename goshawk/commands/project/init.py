"""`goshawk init`: a project folder, with copies of an existing map, vehicle and flights."""

from pathlib import Path

import click

from flight import InputError, project
from goshawk.terminal import console

SUMMARY = "Start a project folder; add a map, a vehicle or flights to it."


@click.command()
@click.argument("folder", type=click.Path(path_type=Path))
@click.argument("flights", nargs=-1, type=click.Path(path_type=Path))
@console.path_option("--map", "map_folder", "Map folder: copied in.")
@console.path_option("--vehicle", "vehicle_file", "Vehicle file: copied in, with its history.")
@console.columns_option
@click.option("--name", help="Name: of the project [default: the folder's name].")
@console.common_options
def command(
    folder: Path,
    flights: tuple[Path, ...],
    map_folder: Path | None,
    vehicle_file: Path | None,
    columns: Path | None,
    name: str | None,
    as_json: bool,
) -> None:
    """Start a project in FOLDER, or add parts to one; then list its parts, and how to add the missing ones.

    \b
    goshawk init my-room
    goshawk init my-room --map map --vehicle my.toml
    goshawk init my-room monday.parquet tuesday.ulg
    goshawk gcs my-room              then: the ground station on it

    Map, vehicle and FLIGHTS (logs of any kind) are copied, all or none; nothing in the project is ever replaced.
    """
    from goshawk.commands.project import project_parts

    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder} is a file, not a folder; choose another name")
    for given in (map_folder, vehicle_file, *flights):
        if given is not None and not given.exists():
            raise InputError(f"{given} does not exist; nothing was made")
    if name is not None and not name.strip():
        raise InputError("--name is empty; leave it out, or give a name")
    is_new = not (folder / "project.toml").exists()
    with project_parts.all_or_nothing(folder, [project_parts.flight_name(flight) for flight in flights]):
        opened = project.create(folder, name or folder.resolve().name)
        if name is not None and opened.name != name:
            raise InputError(
                f"{folder} is the project {opened.name!r} already; change the name in {folder / 'project.toml'}"
            )
        if vehicle_file is not None:
            project_parts.add_vehicle(opened, vehicle_file)
        if flights:
            project_parts.add_flights(opened, flights, columns)
        if map_folder is not None:
            project_parts.add_map(opened, map_folder)
    found = project_parts.parts(opened)
    if as_json:
        document = {"project": str(folder), "name": opened.name, "new": is_new}
        there = {part: {"found": words or None, "give_it_with": give} for part, words, give in found}
        console.show("", {}, as_json=True, document=document | {"parts": there})
        return
    rows = [(part, words or "missing", "" if words else give) for part, words, give in found]
    console.table(f"project {opened.name} in {folder}", ("part", "path", "how to add it"), rows)
