"""A flight log: where it went, and over time its position, attitude rates and rotors; tracking errors of flights."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from firmware_bridge.controller import State
from flight import FlightLog, FloatArray, InputError
from flight.flight_log import ROTOR_QUANTITIES
from sysid.report import drawing

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_PANELS = {
    "position_world_m": ("position", "m", "xyz"),
    "velocity_world_m_s": ("velocity", "m/s", "xyz"),
    "rate_body_rad_s": ("body rate", "rad/s", "xyz"),
    "specific_force_body_m_s2": ("specific force", "m/s²", "xyz"),
    "rotor_speed_rad_s": ("rotor speed", "rad/s", ""),
    "disturbance_force_world_n": ("measured disturbance force, world axes", "N", "xyz"),
    "disturbance_torque_body_n_m": ("measured disturbance torque, body axes", "N m", "xyz"),
}
"""Quantity to its title, unit and components."""
_SET_POINTS = {"position_world_m": "setpoint_position_world_m", "velocity_world_m_s": "setpoint_velocity_world_m_s"}


def log(shown: FlightLog, *, style: drawing.Style = "light") -> "Figure":
    """What was recorded: the path from above, and each vector over time with its set-point dashed.

    A quantity that was not recorded has no panel; where it was not sampled, its curve has a gap.

    Raises:
        InputError: the log has no row, or nothing that is drawn here.
    """
    names = [name for name in _PANELS if shown.has(name) and np.isfinite(shown.vector(name)).any()]
    if not names:
        wanted = ", ".join(_PANELS)
        raise InputError(f"the log has {len(shown)} rows and none of {wanted}, so there is nothing to draw")
    with drawing.styled(style):
        above = "position_world_m" in names
        figure, axes = drawing.figure(1, 1, (12.0 if above else 8.0, max(4.0, 1.75 * len(names) + 0.4)))
        axes[0, 0].remove()
        rows = max(2, len(names))
        grid = figure.add_gridspec(rows, 2 if above else 1, width_ratios=[0.8, 1.0] if above else None)
        if above:
            half = (rows + 1) // 2
            _path(figure.add_subplot(grid[:half, 0]), shown, 1)
            _path(figure.add_subplot(grid[half:, 0]), shown, 2)
        first = None
        for row, name in enumerate(names):
            panel = first = figure.add_subplot(grid[row, -1], sharex=first)
            _over_time(panel, shown, name, last=row == len(names) - 1)
        drawing.headed(figure, _sentence(shown))
    return figure


def _sentence(shown: FlightLog) -> str:
    long_s = float(np.ptp(shown.time_s))
    name = str(shown.metadata.get("name") or shown.metadata.get("trajectory") or "flight")
    return f"{name}: {long_s:.1f} s, {len(shown)} samples"


def _path(panel: "Axes", shown: FlightLog, up: int) -> None:
    """From above (`up` is 1, world y) or from the side (2, world z)."""
    look = drawing.look()
    if shown.has("setpoint_position_world_m"):
        wanted = shown.vector("setpoint_position_world_m")
        panel.plot(wanted[:, 0], wanted[:, up], "--", color=look.ink, linewidth=1.0, label="set-point")
    position = shown.vector("position_world_m")
    panel.plot(position[:, 0], position[:, up], color=look.colours[1], linewidth=1.8, label="flown")
    start = position[np.isfinite(position).all(axis=1)][:1]
    panel.plot(start[:, 0], start[:, up], "o", color=look.colours[0], markersize=6, label="start")
    drawing.plain(panel, "from above" if up == 1 else "from the side", "x (m)", f"{'xyz'[up]} (m)")
    panel.set_aspect("equal", adjustable="datalim")
    if up == 1:
        panel.legend(frameon=False, fontsize=8, ncols=3, loc="lower right", bbox_to_anchor=(1.0, 0.98))


def _over_time(panel: "Axes", shown: FlightLog, name: str, *, last: bool) -> None:
    title, unit, components = _PANELS[name]
    if name in ROTOR_QUANTITIES:
        components = "01234567"[: len(shown.names(name))]
    values, wanted = shown.vector(name), _SET_POINTS.get(name, "")
    for i, (component, colour) in enumerate(zip(components, drawing.cycle(components), strict=True)):
        panel.plot(shown.time_s, values[:, i], color=colour, linewidth=1.1, label=component)
        if wanted and shown.has(wanted):
            panel.plot(shown.time_s, shown.vector(wanted)[:, i], "--", color=colour, linewidth=0.9)
    panel.legend(frameon=False, fontsize=8, ncols=len(components), loc="lower right", bbox_to_anchor=(1.0, 0.97))
    dashed = ", set-point dashed" if wanted and shown.has(wanted) else ""
    drawing.plain(panel, f"{title}{dashed}", "time (s)" if last else "", unit)
    panel.tick_params(labelbottom=last)


def tracking(flights: Mapping[str, FlightLog], *, style: drawing.Style = "light") -> "Figure":
    """Distance to the set-point over the time on the trajectory, with its mean, for each flight under its label.

    Raises:
        InputError: a flight has no set-point, or was never on its trajectory.
    """
    with drawing.styled(style):
        figure, axes = drawing.figure(1, 1, (9.5, 3.2))
        draw_tracking(axes[0, 0], flights)
    return figure


def draw_tracking(panel: "Axes", flights: Mapping[str, FlightLog]) -> None:
    """As `tracking`, on axes that are there."""
    most_mm = 0.0
    for colour, (label, flown) in zip(drawing.cycle(flights), flights.items(), strict=True):
        time_s, error_m = _tracking_error(label, flown)
        mean_mm, most_mm = 1000.0 * float(np.nanmean(error_m)), max(most_mm, 1000.0 * float(np.nanmax(error_m)))
        panel.plot(time_s, 1000.0 * error_m, color=colour, linewidth=1.0, label=f"{label}: {mean_mm:.0f} mm mean")
    drawing.plain(panel, "distance to the set-point", "time on the trajectory (s)", "mm")
    panel.set_ylim(0.0, most_mm * (1.05 + 0.1 * len(flights)))  # room for the legend above all curves
    panel.legend(frameon=False, fontsize=9, loc="upper right")


def _tracking_error(label: str, flown: FlightLog) -> tuple[FloatArray, FloatArray]:
    if not flown.has("mission_state"):
        raise InputError(f"{label}: the log has no column mission_state, which says when it was on the trajectory")
    error_m = np.linalg.norm(flown.vector("position_world_m") - flown.vector("setpoint_position_world_m"), axis=1)
    rows = flown.columns["mission_state"] == State.TRAJECTORY
    if not (rows & np.isfinite(error_m)).any():
        raise InputError(f"{label}: the vehicle was never on its trajectory (column mission_state); choose another log")
    return flown.time_s[rows] - flown.time_s[rows][0], error_m[rows]
