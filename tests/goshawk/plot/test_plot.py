"""Figures show the values they are asked for, with units, in either style, and refuse what they cannot show."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

import planner
import sysid
import vehicle
from esdf import Grid, build, pictures, rasterize, solids
from firmware_bridge.controller import State
from flight import FlightLog, InputError, Waypoints
from goshawk import plot
from planner.gate.limits import NAMES
from sysid.report import drawing

DRONE = vehicle.example("rigter2019").with_limits(speed_m_s=3.0)
HALL = solids.Scene([solids.Room((0, 0, 0), (8, 5, 3)), solids.Cylinder((4, 2.2, 1.5), 0.3, 3)])
POINTS = np.array([[1.0, 2.5, 1.2], [4.0, 3.6, 1.4], [7.0, 2.5, 1.2]])


@pytest.fixture(scope="module")
def plan():
    return planner.plan(Waypoints(POINTS, np.full(3, np.nan)), HALL, DRONE)


@pytest.fixture(scope="module")
def field():
    grid = Grid((0, 0, 0), 0.1, (80, 50, 30))
    state = rasterize(HALL, grid)
    state[:, :4] = 0  # unknown
    return build(state, grid, unknown="nan")


@pytest.fixture(scope="module")
def log():
    rng = np.random.default_rng(3)
    there_and_back = Waypoints(np.concatenate([POINTS, POINTS[-2::-1]]), np.full(5, np.nan))
    path = planner.plan(there_and_back, HALL, DRONE).trajectory
    return vehicle.flights.measure(vehicle.flights.fly_trajectory(DRONE, path, rng=rng), rng=rng)


def curves(axes) -> np.ndarray:
    """(n, 2) points of all solid curves of more than one point."""
    return np.concatenate([line.get_xydata() for line in axes.lines if line.get_linestyle() == "-"])


def on_trajectory(log: FlightLog) -> FlightLog:
    columns = dict(log.columns)
    for axis in "xyz":
        columns[f"setpoint_position_world_{axis}_m"] = columns[f"position_world_{axis}_m"] + 0.03
    columns["mission_state"] = np.full(len(log), float(State.TRAJECTORY))
    return FlightLog(columns, log.metadata)


def test_importing_the_helpers_does_not_import_matplotlib():
    program = "import sys; from goshawk import plot; raise SystemExit('matplotlib' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", program], check=False).returncode == 0


def test_a_plan_shows_path_speed_and_rotor_margin_of_the_trajectory(plan):
    figure = plot.plan(plan, DRONE, HALL)
    above, speed, margin = figure.axes
    t = curves(speed)[:, 0]
    expected = np.linalg.norm(plan.trajectory.position(np.minimum(t, plan.trajectory.duration_s), 1), axis=1)
    assert curves(speed)[:, 1] == pytest.approx(expected, abs=1e-6)
    flat = vehicle.flatness.state(DRONE, plan.trajectory, curves(margin)[:, 0])
    bounds = planner.PlanOptions().limits_for(DRONE)
    low, high = bounds.rotor_speed_min_rad_s**2, bounds.rotor_speed_max_rad_s**2
    squared = flat.rotor_speed_rad_s**2
    nearest = np.minimum(squared - low, high - squared).min(axis=1) / (high - low)
    assert curves(margin)[:, 1] == pytest.approx(100 * nearest, abs=1e-6)
    assert curves(margin)[:, 1].min() > -1.0  # the gate passed
    shown = curves(above)
    assert np.linalg.norm(shown[:, None] - POINTS[None, :, :2], axis=2).min(axis=0).max() < 0.02
    for axes in figure.axes:
        assert axes.get_ylabel() in ("y (m)", "m/s", "% of the thrust range")


def test_a_segment_has_the_colour_that_the_legend_gives_to_the_limit_that_binds_it(plan):
    figure = plot.plan(plan, DRONE)
    legend = figure.legends[0]
    colours = {
        text.get_text(): key.get_color() for text, key in zip(legend.get_texts(), legend.get_lines(), strict=True)
    }
    assert len(set(plan.binding)) > 1
    assert set(colours) == {name or "none used to the full" for name in plan.binding}
    starts = plan.trajectory.starts_s
    for line in figure.axes[1].lines:
        if line.get_linestyle() == "-":
            middle = np.mean(line.get_xdata())
            segment = int(np.searchsorted(starts, middle, side="right")) - 1
            assert line.get_color() == colours[plan.binding[segment] or "none used to the full"]


def test_every_limit_has_a_colour_of_its_own_in_both_styles():
    from goshawk.plot import plans

    assert all(len(set(colours)) == len(NAMES) for colours in plans._COLOURS.values())


def test_a_file_is_checked_again_before_it_is_drawn(plan):
    item = planner.trajectory_file(plan, name="t")
    assert "passes the gate" in plot.plan(item, DRONE, HALL)._suptitle.get_text()
    blocked = solids.Scene([*HALL.solids, solids.Box((3.5, 3.0, 0.0), (4.5, 4.2, 3.0))])
    assert "may not be flown" in plot.plan(item, DRONE, blocked)._suptitle.get_text()
    with pytest.raises(InputError, match="give `field`"):
        plot.plan(item, DRONE)


def test_a_plan_is_not_drawn_for_another_vehicle(plan):
    with pytest.raises(InputError, match="plan again"):
        plot.plan(plan, DRONE.with_limits(speed_m_s=2.0))


def test_the_map_behind_a_path_is_where_the_obstacles_are():
    from goshawk.plot import maps

    _, axes = drawing.figure(1, 1, (4.0, 3.0))
    maps.behind(axes[0, 0], HALL, np.array([-1.0, 0.0]), np.array([8.0, 5.0]), 1.2)
    image = axes[0, 0].images[0]
    assert image.origin == "lower"
    left, right, bottom, top = image.get_extent()
    alpha = image.get_array()[..., 3]
    rows, columns = alpha.shape
    x = left + (np.arange(columns) + 0.5) * (right - left) / columns
    y = bottom + (np.arange(rows) + 0.5) * (top - bottom) / rows
    points = np.stack([*np.meshgrid(x, y), np.full((rows, columns), 1.2)], axis=-1)
    assert np.array_equal(alpha > 0, HALL.distance(points.reshape(-1, 3)).reshape(rows, columns) < 0)
    assert (alpha > 0).any()


def test_a_slice_has_the_colours_of_the_field_and_grey_where_it_is_unknown(field):
    figure = plot.map_slice(field, 1.2)
    image = figure.axes[0].images[0].get_array()
    picture = pictures.axis_slice(field, "z", 1.2)
    assert image.shape[:2] == picture.distance_m.shape
    assert (image[np.isnan(picture.distance_m), :3] == 128).all()
    known = np.isfinite(picture.distance_m)
    full = np.nanmax(np.abs(picture.distance_m))
    assert np.array_equal(image[known][:, :3], pictures.colours(picture.distance_m[known], full_m=full))
    assert (figure.axes[0].get_xlabel(), figure.axes[0].get_ylabel()) == ("x (m)", "y (m)")
    with pytest.raises(InputError, match="outside of it"):
        plot.map_slice(field, 40.0)


def test_the_histogram_shows_every_known_cubic_metre(field):
    stairs = plot.distances(field).axes[0].patches[0].get_data().values
    assert stairs.sum() == pytest.approx(np.isfinite(field.values_m).sum() * 0.1**3)


def test_a_log_shows_what_was_recorded_and_nothing_else(log):
    titles = {axes.get_title(loc="left") for axes in plot.log(log).axes}
    assert titles == {"from above", "from the side", "position", "body rate", "specific force", "rotor speed"}
    rotors = {
        name: values for name, values in log.columns.items() if name == "time_s" or name.startswith("rotor_speed_")
    }
    figure = plot.log(FlightLog(rotors, {}))
    assert [axes.get_title(loc="left") for axes in figure.axes] == ["rotor speed"]
    for i, line in enumerate(figure.axes[0].lines):
        assert np.array_equal(line.get_ydata(), log.columns[f"rotor_speed_{i}_rad_s"])


@pytest.mark.parametrize(
    "columns", [{}, {"battery_v": np.ones(3)}, {f"rate_body_{a}_rad_s": np.full(3, np.nan) for a in "xyz"}]
)
def test_a_log_without_anything_to_draw_is_refused(columns):
    with pytest.raises(InputError, match="nothing to draw"):
        plot.log(FlightLog({"time_s": np.arange(3.0), **columns}, {}))


def test_an_empty_log_is_refused():
    columns = {"time_s": np.empty(0), **{f"position_world_{a}_m": np.empty(0) for a in "xyz"}}
    with pytest.raises(InputError, match="0 rows"):
        plot.log(FlightLog(columns, {}))


def test_tracking_says_the_mean_distance_to_the_set_point(log):
    axes = plot.tracking({"mine": on_trajectory(log)}).axes[0]
    assert axes.lines[0].get_ydata() == pytest.approx(30.0 * np.sqrt(3.0), rel=1e-6)
    assert axes.get_legend().get_texts()[0].get_text() == "mine: 52 mm mean"


def test_tracking_of_a_flight_without_set_points_or_trajectory_is_refused(log):
    with pytest.raises(InputError, match="mine: the log has no column mission_state"):
        plot.tracking({"mine": log})
    flown = on_trajectory(log)
    held = {**flown.columns, "mission_state": np.zeros(len(log))}
    with pytest.raises(InputError, match="mine: the vehicle was never on its trajectory"):
        plot.tracking({"mine": replace(flown, columns=held)})


def test_the_residual_shows_that_the_missing_effect_explains_the_force(log):
    compared = sysid.compare([log], {"before": DRONE.without_effect("rotor_drag_thrust"), "after": DRONE})
    figure = plot.residual(compared)
    labels = [axes.get_ylabel() for axes in figure.axes]
    assert labels == ["unexplained F_x (N)", "unexplained F_y (N)", "unexplained F_z (N)"]
    before, after = (np.abs(figure.axes[0].lines[i].get_ydata()).mean() for i in (0, 1))
    assert after < 0.1 * before
    name = compared.flights[0].name
    assert name in plot.residual(compared, name)._suptitle.get_text()
    with pytest.raises(InputError, match=f"it has {name}"):
        plot.residual(compared, "another")


def contrast(one: str, other: str) -> float:
    """Of two colours, WCAG 2: 1 to 21."""

    def light(colour: str) -> float:
        channels = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255.0
        linear = np.where(channels <= 0.04045, channels / 12.92, ((channels + 0.055) / 1.055) ** 2.4)
        return float(linear @ [0.2126, 0.7152, 0.0722])

    dark, bright = sorted((light(one), light(other)))
    return (bright + 0.05) / (dark + 0.05)


@pytest.mark.parametrize("style", ["light", "dark"])
def test_curves_and_words_can_be_told_from_the_paper(style):
    from goshawk.plot import plans

    look = drawing.LOOKS[style]
    assert contrast(look.ink, look.paper) >= 7.0
    assert min(contrast(colour, look.paper) for colour in (*look.colours, *plans._COLOURS[style])) >= 2.9
    assert contrast(plans._NONE, look.paper) >= 2.9


def test_a_dark_figure_has_no_light_paper_and_leaves_matplotlib_as_it_was(plan, field, log):
    import matplotlib
    from matplotlib.colors import to_hex
    from matplotlib.text import Text

    before = dict(matplotlib.rcParams)
    flown = {"mine": on_trajectory(log)}
    for figure in (
        plot.plan(plan, DRONE, HALL, style="dark"),
        plot.map_slice(field, 1.0, style="dark"),
        plot.log(log, style="dark"),
        plot.tracking(flown, style="dark"),
    ):
        look = drawing.LOOKS["dark"]
        assert to_hex(figure.get_facecolor()) == look.paper
        assert {to_hex(axes.get_facecolor()) for axes in figure.axes} == {look.paper}
        figure.canvas.draw()
        words = [text for text in figure.findobj(Text) if text.get_text() and not text.get_text().endswith(" m")]
        assert {to_hex(text.get_color()) for text in words} == {look.ink}
    assert dict(matplotlib.rcParams) == before
    assert drawing.look() is drawing.LOOKS["light"]


def test_a_style_that_is_not_there_is_refused_by_name(plan):
    with pytest.raises(InputError, match="'sepia' is not known; choose one of: light, dark"):
        plot.plan(plan, DRONE, style="sepia")  # pyright: ignore[reportArgumentType]


def test_the_same_drawing_makes_the_same_file(tmp_path, field):
    for suffix in ("svg", "png"):
        paths = [tmp_path / f"{i}.{suffix}" for i in range(2)]
        first, second = (drawing.written(plot.distances(field), path).read_bytes() for path in paths)
        assert first == second
