"""What lies between the rooms: alignment with the truth, the rows in the air, the floor, a recorded path."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

import esdf
import planner
from esdf import solids
from firmware_bridge.airborne import in_the_air, slowed
from firmware_bridge.controller import State
from flight import FlightLog, FormatError, InputError, flight_log, frames, rotations
from goshawk.commands.plan.plan import read_headings, read_path
from goshawk.demo.chain import ROOM_M, excursion, floor_below
from goshawk.demo.map_accuracy import rigid_alignment
from planner.route import simplify

ROOT = Path(__file__).parents[2]
TRACKING_ERROR = 67
"""Of `tc_reason`."""


def test_a_training_flight_leaves_out_places_without_room():
    """A walker passed; unknown space close by on all sides leaves no room for the vehicle."""
    path = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [4.0, 0.0, 0.0]])
    tight = cast("Any", SimpleNamespace(distance=lambda points: np.where(points[:, 0] < 1.0, 0.3, 2.0)))
    found = excursion(path, tight, np.random.default_rng(1), yaw_swing_rad=1.0)
    assert len(found.positions_world_m) == len(found.yaw_rad) == 2
    assert (tight.distance(found.positions_world_m) > ROOM_M).all()


@pytest.mark.parametrize("seed", range(8))
def test_alignment_brings_moved_points_back_without_mirror_or_scale(seed):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(12, 3)) * [3.0, 2.0, [1.0, 0.0][seed % 2]]  # every other time all on one plane
    T = frames.transform(rotations.exp(rng.normal(size=3)), rng.normal(size=3))
    np.testing.assert_allclose(rigid_alignment(points, frames.apply(T, points)), T, atol=1e-9)
    mirrored = rigid_alignment(points, points * [1.0, 1.0, -1.0])
    assert np.linalg.det(mirrored[:3, :3]) == pytest.approx(1.0)
    grown = rigid_alignment(points, frames.apply(T, 1.5 * points))
    np.testing.assert_allclose(grown[:3, :3] @ grown[:3, :3].T, np.eye(3), atol=1e-12)


def test_no_small_motion_aligns_noisy_points_better():
    rng = np.random.default_rng(5)
    a = rng.normal(size=(30, 3))
    T_b_a = frames.transform(rotations.exp([0.4, -1.0, 2.0]), [1.0, 2.0, 3.0])
    b = frames.apply(T_b_a, a) + 0.1 * rng.normal(size=a.shape)
    best = rigid_alignment(a, b)
    least = np.sum((frames.apply(best, a) - b) ** 2)
    for _ in range(50):
        near = frames.transform(rotations.exp(1e-2 * rng.normal(size=3)), 1e-2 * rng.normal(size=3)) @ best
        assert np.sum((frames.apply(near, a) - b) ** 2) > least


def log_of(*states: State) -> FlightLog:
    each = 50
    time_s = 0.005 * np.arange(each * len(states))
    columns = {"mission_state": np.repeat(np.array(states, dtype=np.float64), each), "battery_v": time_s}
    return flight_log.FlightLog({"time_s": time_s, **columns}, {"source": "test"})


def test_rows_in_the_air_are_those_between_take_off_and_landing():
    flown = (State.HOLD, State.APPROACH, State.TRAJECTORY, State.PAUSING, State.PAUSED, State.TRAJECTORY, State.HOLD)
    log = log_of(State.DISARMED, State.ARMED, State.TAKE_OFF, *flown, State.LANDING, State.ARMED, State.DISARMED)
    kept = in_the_air(log, "loop")
    assert len(kept) == 50 * len(flown)
    np.testing.assert_array_equal(kept.time_s, log.time_s[150:-150])
    np.testing.assert_array_equal(kept.columns["battery_v"], log.columns["battery_v"][150:-150])
    assert kept.metadata == log.metadata


def test_how_far_the_controller_slowed_a_trajectory_down_is_said_with_the_reason():
    log = log_of(State.HOLD, State.TRAJECTORY, State.LANDING)
    limit, reason = np.ones(150), np.zeros(150)
    limit[:50] = 0.1  # not on the trajectory
    limit[50:100] = 0.9999  # a low-pass never quite comes back to 1
    limit[80] = np.nan  # not recorded
    unhindered = flight_log.FlightLog(log.columns | {"path_limit_ratio": limit, "limit_reason": reason}, {})
    assert slowed(unhindered) == slowed(log) == ""
    behind = limit.copy()
    behind[60:70], reason[60:70] = 0.52, TRACKING_ERROR
    said = slowed(flight_log.FlightLog(log.columns | {"path_limit_ratio": behind, "limit_reason": reason}, {}))
    assert said == "slowed by its tracking error, to 52% of the planned speed at the slowest"


def test_an_emergency_in_the_air_does_not_end_the_flight():
    log = log_of(State.ARMED, State.HOLD, State.EMERGENCY, State.HOLD, State.LANDING)
    assert len(in_the_air(log, "loop")) == 150


@pytest.mark.parametrize("ground", [State.ARMED, State.DISARMED, State.FAULT])
def test_a_log_of_two_flights_is_refused_with_the_time_on_the_ground(ground):
    two = log_of(State.HOLD, State.LANDING, ground, State.TAKE_OFF, State.HOLD)
    with pytest.raises(InputError, match=r"loop holds more than one flight: it stands at 0\.5 s"):
        in_the_air(two, "loop")


def test_a_log_without_flight_is_refused():
    with pytest.raises(InputError, match="never in free air"):
        in_the_air(log_of(State.DISARMED, State.ARMED, State.TAKE_OFF, State.LANDING), "loop")


@pytest.fixture(scope="module")
def field() -> esdf.Field:
    """A room of 4 by 3 by 2.5 m with its floor at z = 0."""
    room = solids.Room((0.0, 0.0, 0.0), (4.0, 3.0, 2.5))
    grid = esdf.Grid(np.full(3, -0.2), np.full(3, 0.05), (88, 68, 58))
    return esdf.build(esdf.rasterize(room, grid), grid, cap_m=2.0)


def test_the_floor_is_where_it_is_from_any_height(field):
    for height_m in (0.3, 1.0, 2.2):
        assert floor_below(field, np.array([2.0, 1.5, height_m])) == pytest.approx(0.0, abs=0.5 * field.grid.voxel_m[2])


def test_there_is_no_floor_below_a_point_that_is_not_free(field):
    for point in ([2.0, 1.5, -0.1], [2.0, 1.5, 30.0]):
        with pytest.raises(InputError, match="not free"):
            floor_below(field, np.array(point))


def write(path: Path, *rows: str) -> Path:
    path.write_text("\n".join(rows) + "\n")
    return path


def test_a_path_is_read_whatever_stands_beside_it(tmp_path):
    path = write(tmp_path / "p.csv", "image,z_m,y_m,x_m", "a.png,3,2,1", "b.png,6.5,5,4")
    np.testing.assert_array_equal(read_path(path), [[1.0, 2.0, 3.0], [4.0, 5.0, 6.5]])


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        (("x_m,y_m", "1,2", "3,4"), "z_m"),
        (("x_m,y_m,z_m", "1,2,3"), "1 positions"),
        (("x_m,y_m,z_m",), "0 positions"),
        (("",), "0 positions"),
        (("x_m,y_m,z_m", "1,2,3", "1,two,3"), "two"),
        (("x_m,y_m,z_m", "1,2,3", "1,2"), "p.csv"),
        (("x_m,y_m,z_m", "1,2,3", "1,,3"), "p.csv"),
        (("x_m,y_m,z_m", "1,2,3", "1,nan,3"), "position 2 is not finite"),
        (("x_m,y_m,z_m", "inf,2,3", "1,2,3"), "position 1 is not finite"),
    ],
)
def test_a_bad_row_is_refused_with_the_reason(tmp_path, rows, words):
    with pytest.raises((InputError, FormatError), match=words):
        read_path(write(tmp_path / "p.csv", *rows))


def test_a_missing_path_is_refused(tmp_path):
    with pytest.raises(InputError, match="does not exist"):
        read_path(tmp_path / "none.csv")


def test_positions_without_clearance_are_left_out_and_counted(field):
    s = np.linspace(0.0, 1.0, 41)[:, None]
    walked = (1 - s) * [-0.1, 1.5, 1.2] + s * [3.0, 1.5, 1.2]  # begins in the wall, in unknown space
    options = planner.PlanOptions(radius_m=0.15)
    waypoints, left_out = simplify.waypoints_along(walked, 0.10, field, options)
    near_m = field.distance(walked)
    assert left_out == (~(near_m >= options.waypoint_clearance_m)).sum() > 0
    assert (field.distance(waypoints.positions_world_m) >= options.waypoint_clearance_m).all()
    assert np.isnan(waypoints.yaw_rad).all()
    roomy = walked[left_out:]
    np.testing.assert_array_equal(waypoints.positions_world_m, roomy[simplify.rdp(roomy, 0.10)])
    assert len(waypoints.positions_world_m) == 2


def test_recorded_headings_are_read_and_kept(field, tmp_path):
    rows = [f"{x},1.5,1.2,{yaw}" for x, yaw in zip(np.linspace(1.0, 3.0, 21), [90] * 10 + [""] + [0] * 10, strict=True)]
    path = write(tmp_path / "p.csv", "x_m,y_m,z_m,yaw_deg", *rows)
    yaw = read_headings(path)
    assert yaw is not None
    assert np.isnan(yaw[10])
    waypoints, _ = simplify.waypoints_along(read_path(path), 0.10, field, planner.PlanOptions(radius_m=0.15), yaw)
    assert len(waypoints.positions_world_m) >= 4
    assert waypoints.yaw_rad[0] == pytest.approx(np.pi / 2)
    assert waypoints.yaw_rad[-1] == 0.0


def test_a_path_without_clearance_is_refused_with_the_remedy(field):
    wall = np.array([[0.05, 1.0, 1.0], [0.05, 2.0, 1.0], [9.0, 9.0, 9.0]])
    with pytest.raises(InputError, match=r"0 of 3 recorded positions .* Lower --margin"):
        simplify.waypoints_along(wall, 0.10, field, planner.PlanOptions(radius_m=0.15))


def test_the_doctor_checks_every_compiled_part():
    from goshawk.commands.project.doctor import _MODULES

    compiled = {f"{stub.parent.name}.{stub.stem}" for stub in ROOT.glob("*/_*.pyi")}
    assert compiled
    assert compiled <= set(_MODULES)
