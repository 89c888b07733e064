"""A plan: the path from above, speed and rotor margin over time, coloured by the limit that binds in each segment."""

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from flight import FloatArray, InputError, Trajectory, TrajectoryFile
from goshawk.plot import maps
from planner import GateReport, Plan
from planner.gate import gate
from planner.gate.limits import NAMES
from planner.request.space import DistanceField
from sysid.report import drawing
from vehicle import Limits, Vehicle, flatness, vehicle_hash

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_STEP_S, _MOST_STEPS = 0.01, 3000
_COLOURS = {
    "light": ("#1f6f8b", "#548c2f", "#7d6608", "#8d5a97", "#c26fa5", "#4b5fa5", "#b0413e", "#c98a1b"),
    "dark": ("#54b3d6", "#8fcb63", "#cdbb4a", "#c99bd4", "#f0a3d0", "#8da2f0", "#f0837d", "#ecb95a"),
}
"""Of the limits, in the order of `planner.gate.limits.NAMES`."""
_NONE = "#8b959e"
"""Where no limit is used to the full."""
_AROUND_M = 0.6
"""Shown of the map round the path, at least."""
_TALL = 0.52
"""Height of the map's panel over its width."""


def plan(
    shown: Plan | TrajectoryFile,
    vehicle: Vehicle,
    field: DistanceField | None = None,
    *,
    style: drawing.Style = "light",
) -> "Figure":
    """The path from above, and over time the speed and the share of the thrust range that the busiest rotor has left.

    Each stretch has the colour of the limit that decides its time; at a margin of 0 % a rotor is at its limit less the
    control reserve.

    Args:
        vehicle: that the plan was made for.
        field: the map, drawn behind the path as it is at the path's middle height. A file is checked in it again.

    Raises:
        InputError: the vehicle is not the plan's, or a file comes without a map.
    """
    report = report_of(shown, vehicle, field)
    points = shown.waypoints_world_m if isinstance(shown, TrajectoryFile) else shown.waypoints.positions_world_m
    with drawing.styled(style):
        figure, axes = drawing.figure(1, 1, (12.0, 4.6))
        axes[0, 0].remove()
        grid = figure.add_gridspec(2, 2, width_ratios=[1.15, 1.0])
        above = figure.add_subplot(grid[:, 0])
        speed = figure.add_subplot(grid[0, 1])
        margin = figure.add_subplot(grid[1, 1], sharex=speed)
        colours = segment_colours(report, shown.trajectory, style)
        from_above(above, shown.trajectory, colours, points, field)
        bounds = report.options.limits_for(vehicle)
        _over_time(speed, margin, shown.trajectory, vehicle, bounds, colours)
        drawing.headed(figure, _sentence(shown.trajectory, report))
        _legend(figure, report, style)
    return figure


def report_of(shown: Plan | TrajectoryFile, vehicle: Vehicle, field: DistanceField | None) -> GateReport:
    """What the gate says: of a plan when it was made, of a file now.

    Raises:
        InputError: the vehicle is not the plan's, or a file comes without a map.
    """
    if isinstance(shown, TrajectoryFile):
        if field is None:
            raise InputError("a trajectory file is checked again before it is drawn; give `field`, the map it is for")
        return gate.check_file(shown, field, vehicle)
    if shown.gate.vehicle_hash != vehicle_hash(vehicle):
        raise InputError(
            f"the plan was made for the vehicle {shown.gate.vehicle_hash[:12]}, this one is "
            f"{vehicle_hash(vehicle)[:12]} ({vehicle.name}); give the plan's own, or plan again"
        )
    return shown.gate


def _sentence(path: Trajectory, report: GateReport) -> str:
    verdict = "passes the gate" if report.passed else "may not be flown"
    clearance = "not proven" if not np.isfinite(report.clearance_m) else f"at least {report.clearance_m:.2f} m"
    return f"{path.duration_s:.2f} s, {verdict}; clearance {clearance}, {report.required_clearance_m:.2f} m required"


def _colours(style: drawing.Style) -> dict[str, str]:
    """Limit to colour."""
    names: tuple[str, ...] = NAMES
    return dict(zip(names, _COLOURS[style], strict=True))


def segment_colours(report: GateReport, path: Trajectory, style: drawing.Style) -> list[str]:
    """A colour for each segment; grey where no limit is used to the full or none is known."""
    colours = _colours(style)
    return [colours.get(name, _NONE) for name in report.binding or [""] * len(path.durations_s)]


def _legend(figure: "Figure", report: GateReport, style: drawing.Style) -> None:
    from matplotlib.lines import Line2D

    colours = _colours(style)
    named = [name for name in NAMES if name in report.binding]
    keys = [Line2D([], [], color=colours[name], linewidth=3, label=name) for name in named]
    if "" in report.binding or not report.binding:
        label = "none used to the full" if report.binding else "not known"
        keys.append(Line2D([], [], color=_NONE, linewidth=3, label=label))
    figure.legend(
        handles=keys,
        loc="outside lower center",
        ncols=len(keys),
        frameon=False,
        fontsize=9,
        title="the limit that binds",
    )


def from_above(
    panel: "Axes",
    path: Trajectory,
    colours: list[str],
    points_world_m: FloatArray,
    field: DistanceField | None,
    *,
    numbered: bool = True,
) -> None:
    """The path, a colour a segment, its waypoints, numbered or not, and the map at its middle height."""
    times, segment = _sampled(path)
    position = path.position(times)
    low, high = _shown(np.concatenate([position, points_world_m])[:, :2])
    z_m = float(np.median(position[:, 2]))
    if field is not None:
        maps.behind(panel, field, low, high, z_m)
    _coloured(panel, position[:, 0], position[:, 1], segment, colours, 2.6)
    look = drawing.look()
    panel.plot(*points_world_m[:, :2].T, "o", markersize=4.5, color=look.paper, markeredgecolor=look.ink, zorder=3)
    for number, (x, y) in enumerate(points_world_m[:, :2], start=1) if numbered else ():
        panel.annotate(str(number), (x, y), (5, 5), textcoords="offset points", fontsize=8, color=look.ink)
    title = "from above" if field is None else f"from above; the map at z = {z_m:.1f} m"
    drawing.plain(panel, title, "x (m)", "y (m)")
    panel.set(aspect="equal", xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    panel.grid(False)


def _shown(points_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Corners (2,) of what is shown of the map: room round the points, in the panel's shape."""
    low, high = points_m.min(axis=0) - _AROUND_M, points_m.max(axis=0) + _AROUND_M
    size = high - low
    spare = np.maximum(np.array([size[1] / _TALL, size[0] * _TALL]) - size, 0.0)
    return low - 0.5 * spare, high + 0.5 * spare


def _over_time(
    speed: "Axes", margin: "Axes", path: Trajectory, vehicle: Vehicle, bounds: Limits, colours: list[str]
) -> None:
    times, segment = _sampled(path)
    flat = flatness.state(vehicle, path, times)
    _coloured(speed, times, np.linalg.norm(flat.velocity_world_m_s, axis=1), segment, colours, 2.0)
    _coloured(margin, times, 100.0 * bounds.rotor_margin(flat.rotor_speed_rad_s), segment, colours, 2.0)
    ink = drawing.look().ink
    speed.axhline(bounds.speed_m_s, color=ink, linewidth=0.9, linestyle="--")
    note = f"limit {bounds.speed_m_s:g} m/s"
    speed.annotate(note, (1.0, bounds.speed_m_s), (0, 3), xycoords=("axes fraction", "data"),
                   textcoords="offset points", ha="right", fontsize=8, color=ink)  # fmt: skip
    margin.axhline(0.0, color=ink, linewidth=0.9, linestyle="--")
    drawing.plain(speed, "speed", "", "m/s")
    drawing.plain(margin, "rotor margin above the control reserve", "time (s)", "% of the thrust range")
    speed.tick_params(labelbottom=False)
    speed.set_ylim(0.0, 1.15 * bounds.speed_m_s)


def _sampled(path: Trajectory) -> tuple[FloatArray, np.ndarray]:
    """Times (n,), joins among them, and the segment that each step between two of them is in: (n - 1,)."""
    even = path.sample(max(_STEP_S, path.duration_s / _MOST_STEPS))
    last = path.duration_s * (1.0 - 1e-9)
    times = np.unique(np.concatenate([np.minimum(even, last), path.starts_s[:-1], [last]]))
    middle = 0.5 * (times[1:] + times[:-1])
    return times, np.searchsorted(path.starts_s[1:-1], middle, side="right")


def _coloured(
    panel: "Axes", x: FloatArray, y: FloatArray, segment: np.ndarray, colours: list[str], width: float
) -> None:
    """A curve, each stretch of one colour as one line."""
    changes = [0, *(np.flatnonzero(np.diff(segment)) + 1).tolist(), len(segment)]
    for first, end in pairwise(changes):
        colour = colours[segment[first]]
        panel.plot(x[first : end + 1], y[first : end + 1], color=colour, linewidth=width, solid_capstyle="round")
