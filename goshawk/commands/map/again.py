"""`goshawk map again`: where to fly or walk again, as waypoints."""

from pathlib import Path

import click

import mapping
from flight import InputError, project, results
from goshawk.commands.map import look_again
from goshawk.commands.plan import waypoints_file
from goshawk.terminal import console, outputs
from mapping.exploration.view_planning import ViewOptions

_DEFAULT = ViewOptions()


@click.command()
@click.argument("map_folder", metavar="MAP", type=click.Path(path_type=Path))
@console.path_option("--out", "out", "Waypoints file to write (.json), for `goshawk plan` [default: only list them].")
@console.path_option("--vehicle", "vehicle_file", "Vehicle file: its radius is kept clear [default: the carrier's].")
@console.radius_option
@console.margin_option
@console.path_option("--near", "near", "Waypoints of a flight to come: only unknown space near it counts.")
@click.option("--within", "within_m", default=_DEFAULT.within_m, show_default=True, help="How near, metres.")
@click.option("--range", "farthest_m", default=_DEFAULT.farthest_m, show_default=True, help="Range of a look, metres.")
@click.option(
    "--least",
    "least_m3",
    default=_DEFAULT.least_m3,
    show_default=True,
    help="Unknown volume that is worth a view, cubic metres.",
)
@click.option("--most", "most_views", default=_DEFAULT.most_views, show_default=True, help="Most views of the tour.")
@click.option("--on-foot", "on_foot", is_flag=True, help="Only at the heights at which the images were taken.")
@outputs.overwrite_option
@console.common_options
def again(
    map_folder: Path,
    out: Path | None,
    vehicle_file: Path | None,
    radius_m: float | None,
    margin_m: float | None,
    near: Path | None,
    within_m: float,
    farthest_m: float,
    least_m3: float,
    most_views: int,
    on_foot: bool,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Find where to look again in MAP: views of unknown space that touches the free space.

    \b
    goshawk map again map --vehicle vehicle.toml --out again.json
    goshawk plan again.json --map map --vehicle vehicle.toml --out again_flight.json
    goshawk map again map --near waypoints.json --within 1.5
    goshawk map again map --on-foot

    Each view is a place in free space, with the vehicle's clearance, and a heading; together they look at each place
    three times, from two sides at least. Space behind walls does not count, nor what many images looked at in vain.
    What a view shows is an estimate: unknown space may hide what is behind it, and the edges of images do not count.

    The waypoints are a proposal. `goshawk plan` makes a checked trajectory of them. Where nothing is worth another
    look no file is written, and with --overwrite an earlier one is kept beside all the same.
    """
    if out is not None:
        if out.suffix.lower() == ".csv":
            raise InputError(f"{out}: these waypoints are written as JSON; give a name that ends in .json")
        outputs.check(out, overwrite=overwrite)
    area = mapping.open_map(map_folder)
    options = ViewOptions(
        clearance_m=look_again.clearance_m(area, vehicle_file, radius_m, margin_m),
        farthest_m=farthest_m,
        least_m3=least_m3,
        most_views=most_views,
        within_m=within_m,
        heights_world_m=look_again.on_foot(area) if on_foot else _DEFAULT.heights_world_m,
    )
    wanted = None if near is None else waypoints_file.load_mission(near).waypoints.positions_world_m
    with console.progress() as progress:
        found = look_again.find(area, options, near_world_m=wanted, progress=progress)
    written = out if found.views else None
    if written is not None:
        with outputs.file(written, overwrite=overwrite) as temporary:
            project.save_waypoints(temporary, look_again.waypoints(found))
    elif overwrite and out is not None and out.exists():  # an earlier proposal must not pass for this one
        outputs.report_kept(out, results.move_aside(out))
    document = found.as_dict() | {
        "map_hash": area.hash,
        "clearance_m": options.clearance_m,
        "written": None if written is None else str(written),
    }
    facts = {"again": look_again.sentence(found)}
    if found.in_vain_m3 > 0.0:
        facts["looked at in vain"] = f"{found.in_vain_m3:.2f} m3 stayed unknown in many images: plain surfaces, glass"
    facts["written"] = str(written) if written is not None else "nothing"
    if not as_json and found.views:
        rows = [
            (
                number,
                *(f"{value:.2f}" for value in view.position_world_m),
                f"{view.heading_deg:.0f}",
                f"{view.shows_m3:.2f}",
            )
            for number, view in enumerate(found.views, start=1)
        ]
        console.table("views", ("waypoint", "x (m)", "y (m)", "z (m)", "heading (deg)", "shows (m3)"), rows)
    console.show("again", facts, as_json=as_json, document=document)
