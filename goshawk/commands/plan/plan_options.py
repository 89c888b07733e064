"""How `goshawk plan` and `goshawk plan batch` plan, as options: which map, which vehicle, which limits."""

from dataclasses import dataclass, replace
from pathlib import Path

import click
import numpy as np

import mapping
import planner
import vehicle
from flight import InputError
from flight.mission import KeepIn, Laps, Yaw
from goshawk.commands.plan import map_standing
from goshawk.commands.plan import preflown as ahead
from goshawk.commands.plan.batch_mission import Job
from goshawk.terminal import console, outputs
from goshawk.terminal.records import options_as
from planner.request import options
from planner.request.hidden import require_price

_SLOWER = {
    "speed_m_s": ("--speed", "m/s"),
    "acceleration_m_s2": ("--acceleration", "m/s2"),
    "jerk_m_s3": ("--jerk", "m/s3"),
}
"""Option and unit of each limit that the command line may lower."""
_OPTIONS = (
    console.map_option,
    console.vehicle_option,
    console.radius_option,
    console.margin_option,
    console.path_option(
        "--preflown",
        "preflown",
        "Result of `goshawk preflight --out` for an earlier plan: keep the margin it asks for.",
    ),
    click.option("--speed", "speed_m_s", type=float, help="Fly no faster than this, m/s."),
    click.option("--acceleration", "acceleration_m_s2", type=float, help="Accelerate no harder than this, m/s2."),
    click.option(
        "--jerk",
        "jerk_m_s3",
        type=float,
        help="Change the acceleration no faster than this, m/s3 [default: the vehicle's].",
    ),
    click.option(
        "--method",
        type=click.Choice(options.METHODS),
        default="fastest",
        show_default=True,
        help="fastest: least time. corridor: least time within a corridor of free boxes. bry: as Bry et al. (2015).",
    ),
    click.option(
        "--search",
        type=click.Choice(options.SEARCHES),
        default="grid",
        show_default=True,
        help="What finds a way round obstacles: a grid search, or one of OMPL's sampling planners.",
    ),
    click.option(
        "--starts",
        type=click.IntRange(1, options.MOST_STARTS),
        default=1,
        show_default=True,
        help="Starts of the descent, of which the fastest path is kept; as many at once as there are processors.",
    ),
    click.option("--seed", type=click.IntRange(1), default=1, show_default=True, help="Seed: of a sampling planner."),
    click.option(
        "--yaw",
        type=click.Choice(options.YAW_MODES),
        help="Heading mode [default: the waypoint file's, else along_path].",
    ),
    click.option(
        "--heading", "heading_deg", type=float, help="Keep this heading (degrees, from x towards y): --yaw fixed."
    ),
    click.option("--look-at", nargs=3, type=float, help="Face this point (metres): --yaw look_at.", metavar="X Y Z"),
    click.option("--laps", type=click.IntRange(1), help="Fly the waypoints as a closed loop this many times."),
    click.option(
        "--keep-in",
        "keep_in_m",
        type=float,
        help="Stay within this many metres of the recorded path, or of the straight lines between the waypoints.",
    ),
    click.option(
        "--thinnest",
        "thinnest_m",
        type=float,
        help="Obstacle thickness, metres: keep out of space where one could hide [default: not asked].",
    ),
    click.option(
        "--hidden-price",
        "hidden_price",
        type=float,
        help="Metres of detour for a metre less of space where anything could hide [default: none].",
    ),
    map_standing.accept_option,
    outputs.overwrite_option,
)


@dataclass(frozen=True, slots=True)
class Asked:
    """Values of the options."""

    map_folder: Path
    vehicle_file: Path
    radius_m: float | None
    margin_m: float | None
    preflown: Path | None
    speed_m_s: float | None
    acceleration_m_s2: float | None
    jerk_m_s3: float | None
    method: options.Method
    search: options.Search
    starts: int
    seed: int
    yaw: options.YawMode | None
    heading_deg: float | None
    look_at: tuple[float, float, float] | None
    laps: int | None
    keep_in_m: float | None
    thinnest_m: float | None
    hidden_price: float | None
    accept_doubtful: bool
    overwrite: bool

    def job(self, drone: vehicle.Vehicle, out: Path) -> Job:
        """What is to be planned for a vehicle, into a file or a folder.

        Raises:
            InputError, UsageError: a limit is out of its range, or two options contradict each other.
        """
        again = self.again(drone)
        margin_m, near = (self.margin_m, ()) if again is None else (again.margin_m, again.near)
        wanted = options_from(
            drone, margin_m, self.speed_m_s, self.acceleration_m_s2, self.radius_m, self.jerk_m_s3
        )  # fmt: skip
        return Job(
            self.map_folder,
            self.vehicle_file,
            replace(
                wanted.sized(drone),
                method=self.method,
                search=self.search,
                starts=self.starts,
                search_seed=self.seed,
                local_margins=near,
            ),
            out,
            None if self.laps is None else Laps(self.laps),
            yaw_from(self.yaw, self.heading_deg, self.look_at),
            None if self.keep_in_m is None else KeepIn(self.keep_in_m),
            self.thinnest_m,
            again,
            hidden_price=self.hidden_price if self.hidden_price is None else require_price(self.hidden_price),
            overwrite=self.overwrite,
        )

    def again(self, drone: vehicle.Vehicle) -> ahead.Again | None:
        """What --preflown asks for; at least the margin of --margin.

        Raises:
            InputError, FormatError: as `ahead.read`.
        """
        if self.preflown is None:
            return None
        asked = ahead.read(self.preflown, mapping.open_map(self.map_folder).hash, drone)
        kept = replace(asked, margin_m=max(asked.margin_m, self.margin_m or 0.0))
        console.note(f"note: keeps a margin of {kept} ({self.preflown} asks for {asked.margin_m:.3f} m)")
        return kept

    def opened_map(self) -> mapping.Map:
        """The map, if it may be planned in."""
        area = mapping.open_map(self.map_folder)
        map_standing.require(area, accept_doubtful=self.accept_doubtful)
        return area


plan_options = options_as(Asked, _OPTIONS)
"""A decorator that gives a verb these options; their values reach it as one argument `asked`."""


def yaw_from(
    mode: options.YawMode | None, heading_deg: float | None, look_at: tuple[float, float, float] | None
) -> Yaw | None:
    """The yaw record that the command line asks for; None if it does not.

    Raises:
        UsageError: two of the options contradict each other.
    """
    wanted = {"fixed": heading_deg is not None, "look_at": look_at is not None}
    given = [name for name, is_given in wanted.items() if is_given]
    if len(given) == 2 or (given and mode not in (None, given[0])):
        raise click.UsageError("--yaw, --heading and --look-at contradict each other: give one of them")
    if mode in wanted and not given:
        raise click.UsageError(f"--yaw {mode} needs {'--heading' if mode == 'fixed' else '--look-at'}")
    if given:
        mode = "fixed" if heading_deg is not None else "look_at"
    return None if mode is None else Yaw(mode, np.radians(heading_deg or 0.0), look_at)


def options_from(
    drone: vehicle.Vehicle,
    margin_m: float | None = None,
    speed_m_s: float | None = None,
    acceleration_m_s2: float | None = None,
    radius_m: float | None = None,
    jerk_m_s3: float | None = None,
) -> planner.PlanOptions:
    """The planner's options: the defaults, overridden by the command line."""
    options = console.body_options(radius_m, margin_m)
    asked = {"speed_m_s": speed_m_s, "acceleration_m_s2": acceleration_m_s2, "jerk_m_s3": jerk_m_s3}
    slower = {name: value for name, value in asked.items() if value is not None}
    if not slower:
        return options
    own = drone.limits
    for name, value in slower.items():
        most = own.as_dict().get(name)
        if most is None and not 0.0 < value < np.inf:
            raise InputError(f"--jerk {value:g} must be a positive, finite number of m/s3; leave it out for no limit")
        if most is not None and not 0.0 < value <= most:
            option, unit = _SLOWER[name]
            limit = f"{most:g} {unit}, the vehicle's limit"
            raise InputError(
                f"{option} {value:g} must be above 0 and at most {limit}; raise {name} under [limits] in the vehicle "
                "file if the vehicle can do more"
            )
    return replace(options, limits=replace(own, **slower))
