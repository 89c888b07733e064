import json
from dataclasses import fields, replace

import numpy as np
import pytest

from flight import FormatError, InputError, Waypoints, project
from flight import mission as missions
from flight.mission import FlyBy, Gate, Ground, KeepIn, Laps, LegJerk, LegSpeed, Mission, Stay, Velocity, Yaw

POINTS = Waypoints(np.arange(15.0).reshape(5, 3), np.array([np.nan, 0.5, np.nan, np.nan, -1.0]))
FULL = Mission(
    POINTS,
    laps=Laps(3, 1, 3),
    stays=(Stay(4, 2.0),),
    velocities=(Velocity(2, (1.0, 0.0, 0.5)),),
    leg_speeds=(LegSpeed(0, 2, 1.5),),
    leg_jerks=(LegJerk(1, 3, 25.0),),
    fly_bys=(FlyBy(3, 0.5),),
    take_off=Ground((0.0, 0.0, 0.1)),
    landing=None,
    yaw=Yaw("look_at", look_at_world_m=(1.0, 2.0, 3.0)),
    gates=(Gate(1, 0.8, 0.6, 0.5, roll_rad=0.1),),
    keep_in=KeepIn(0.5, ((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (2.0, 3.0, 4.0))),
)


def test_a_mission_comes_back_as_it_was_written(tmp_path):
    missions.save(tmp_path / "w.json", FULL)
    back = missions.load(tmp_path / "w.json")
    names = [field.name for field in fields(Mission) if field.name != "waypoints"]
    assert [getattr(back, name) for name in names] == [getattr(FULL, name) for name in names]
    np.testing.assert_array_equal(back.waypoints.positions_world_m, POINTS.positions_world_m)
    np.testing.assert_array_equal(back.waypoints.yaw_rad, POINTS.yaw_rad)


def test_waypoints_alone_are_written_as_before_and_an_old_file_is_read(tmp_path):
    missions.save(tmp_path / "new.json", Mission(POINTS))
    project.save_waypoints(tmp_path / "old.json", POINTS)
    assert (tmp_path / "new.json").read_bytes() == (tmp_path / "old.json").read_bytes()
    assert missions.load(tmp_path / "old.json").plain


def test_a_reader_of_waypoints_alone_refuses_a_mission_instead_of_dropping_what_it_asks(tmp_path):
    missions.save(tmp_path / "w.json", FULL)
    with pytest.raises(FormatError, match="fly_bys, gates, keep_in, laps, leg_jerks, leg_speeds, stays"):
        project.load_waypoints(tmp_path / "w.json")


def test_laps_unroll_to_a_closed_loop_with_a_way_in_and_out():
    flown = replace(FULL, laps=Laps(2, 1, 3)).unrolled()
    order = flown.waypoints.positions_world_m[:, 0] / 3.0
    assert order.tolist() == [0, 1, 2, 3, 1, 2, 3, 1, 4]
    assert [v.waypoint for v in flown.velocities] == [2, 5]
    assert [s.waypoint for s in flown.stays] == [8]
    assert [g.waypoint for g in flown.gates] == [1, 4, 7]
    assert sorted(leg.first for leg in flown.leg_speeds) == [0, 1, 4]
    assert flown.unrolled() is flown


@pytest.mark.parametrize(
    ("speed", "legs"),
    [
        (LegSpeed(3, 4, 1.0), [7]),  # the way out, though it begins at the first waypoint of the laps
        (LegSpeed(1, 2, 1.0), [1, 4]),  # not the way out
        (LegSpeed(1, 3, 1.0), [1, 2, 3, 4, 5, 6]),  # the way back from the last waypoint of the laps to their first
        (LegSpeed(0, 4, 1.0), [0, 1, 2, 3, 4, 5, 6, 7]),
    ],
)
def test_the_legs_of_laps_keep_the_limits_of_those_that_are_listed(speed, legs):
    jerk = LegJerk(speed.first, speed.last, 30.0)
    flown = Mission(POINTS, laps=Laps(2, 1, 3), leg_speeds=(speed,), leg_jerks=(jerk,)).unrolled()
    assert sorted(leg.first for leg in flown.leg_speeds) == legs
    assert sorted(flown.leg_jerks, key=lambda leg: leg.first) == [LegJerk(i, i + 1, 30.0) for i in legs]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"stays": (Stay(7, 1.0),)}, "waypoint 8; there are 1 to 5"),
        ({"stays": (Stay(1, -1.0),)}, "stay at waypoint 2 lasts -1 s"),
        ({"stays": (Stay(2, 1.0),)}, "waypoint 3 has a stay and a velocity"),
        ({"leg_speeds": (LegSpeed(3, 3, 1.0),)}, "from waypoint 4 to 4"),
        ({"leg_speeds": (LegSpeed(1, 3, 0.0),)}, "speed from waypoint 2 is 0 m/s"),
        ({"leg_jerks": (LegJerk(2, 5, 1.0),)}, "a jerk is given from waypoint 3 to 6; there are 1 to 5"),
        ({"leg_jerks": (LegJerk(1, 3, -1.0),)}, "jerk from waypoint 2 is -1 m/s3; it must be positive"),
        ({"leg_jerks": (LegJerk(1, 3, np.nan),)}, "jerk from waypoint 2 is nan m/s3"),
        ({"laps": Laps(0)}, "0 laps"),
        ({"fly_bys": (FlyBy(9, 1.0),)}, "waypoint 10"),
        ({"fly_bys": (FlyBy(4, 1.0),)}, "waypoint 5 has a stay and a radius"),
        ({"laps": Laps(2, 3, 1)}, "from waypoint 4 to 2"),
        ({"velocities": (Velocity(0, (1.0, 0.0, 0.0)),)}, "waypoint 1 has a velocity and a take_off"),
        ({"stays": (Stay(0, 1.0),)}, "waypoint 1 has a stay and a take_off"),
        ({"take_off": Ground((0.0, 0.0, 0.1), 0.0)}, "take_off climbs at 0 m/s"),
        ({"landing": Ground((0.0, 0.0, 0.1), np.inf)}, "landing climbs at inf m/s"),
        ({"landing": Ground((0.0, np.nan, 0.1))}, "landing is at"),
        ({"velocities": (Velocity(2, (np.nan, 0.0, 0.0)),)}, "velocity at waypoint 3 is"),
        ({"fly_bys": (FlyBy(3, np.nan),)}, "radius at waypoint 4 is nan m"),
        ({"fly_bys": (FlyBy(3, 0.0),)}, "radius at waypoint 4 is 0 m"),
        ({"yaw": Yaw("fixed", np.nan)}, "heading to hold is nan"),
        ({"yaw": Yaw("fixed", 1e300)}, "from -100 to 100"),
        ({"yaw": Yaw("look_at", 0.0, (1e300, 0.0, 0.0))}, "point to look at"),
        ({"gates": (Gate(5, 1.0, 1.0, 0.0),)}, "a gate belongs to waypoint 6"),
        ({"gates": (Gate(1, 0.0, 1.0, 0.0),)}, "gate at waypoint 2 has a width_m of 0"),
        ({"gates": (Gate(1, 1.0, 1.0, np.nan),)}, "gate at waypoint 2 has a heading_rad of nan"),
        ({"gates": (Gate(2, 1.0, 1.0, 0.0),)}, "waypoint 3 has a gate and a velocity"),
        ({"gates": (Gate(3, 1.0, 1.0, 0.0),)}, "waypoint 4 has a gate and a radius"),
        ({"gates": (Gate(1, 1.0, 1.0, 0.0), Gate(1, 2.0, 2.0, 0.0))}, "waypoint 2 has a gate and another gate"),
        ({"keep_in": KeepIn(np.nan)}, "radius_m of nan"),
        ({"keep_in": KeepIn(0.01)}, "radius_m of 0.01"),
        ({"keep_in": KeepIn(1.0, ((0.0, 0.0, 0.0),))}, "polyline of 1 points"),
        ({"keep_in": KeepIn(1.0, ((0.0, 0.0, 0.0), (0.0, np.inf, 0.0)))}, "point 2 of the tube"),
    ],
)
def test_requests_that_make_no_sense_are_refused_by_number(change, words):
    with pytest.raises(InputError, match=words):
        replace(FULL, **change)


@pytest.mark.parametrize(
    "wrong",
    [{"laps": {"count": 1.5}}, {"stays": [{"waypoint": "x", "duration_s": 1}]}, {"yaw": {"up": 1}}, {"spin": 1},
     {"landing": {"position_world_m": [1, 2]}}, {"keep_in": {"radius_m": 1, "polyline_world_m": [[1, 2]]}},
     {"keep_in": {"radius_m": 1, "polyline_world_m": 5}}, {"gates": [{"waypoint": 1}]}],
)  # fmt: skip
def test_damaged_or_unknown_requests_are_refused(tmp_path, wrong):
    body = {"format": "goshawk-waypoints", "version": 2, "waypoints": project.waypoint_records(POINTS), **wrong}
    (tmp_path / "w.json").write_text(json.dumps(body))
    with pytest.raises(FormatError):
        missions.load(tmp_path / "w.json")


def test_the_edges_of_a_gate_are_square_to_the_direction_in_which_it_is_passed():
    gate = Gate(1, 0.8, 0.6, 0.7, pitch_rad=0.3, roll_rad=-0.4)
    left, up = gate.edges_m
    forward = np.array([np.cos(0.3) * np.cos(0.7), np.cos(0.3) * np.sin(0.7), np.sin(0.3)])
    np.testing.assert_allclose(np.cross(left, up), 0.4 * 0.3 * forward, atol=1e-12)
    np.testing.assert_allclose(Gate(1, 2.0, 2.0, 0.0).edges_m, [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], atol=1e-12)
    rolled = Gate(1, 2.0, 2.0, 0.0, roll_rad=0.1).edges_m
    assert rolled[0, 2] > 0.0  # clockwise: the left edge rises


def test_a_record_in_another_unit_is_refused_with_the_names_that_are_known(tmp_path):
    gate = {"waypoint": 1, "width_m": 1.0, "height_m": 1.0, "heading_deg": 20.0}
    body = {"format": "goshawk-waypoints", "version": 2, "waypoints": project.waypoint_records(POINTS), "gates": [gate]}
    (tmp_path / "w.json").write_text(json.dumps(body))
    with pytest.raises(
        FormatError, match="has heading_deg, but what it is about has waypoint, width_m, height_m, heading"
    ):
        missions.load(tmp_path / "w.json")


def test_a_heading_that_is_not_a_number_is_not_taken_for_an_open_one(tmp_path):
    records = [{"position_world_m": [0.0, 0.0, 1.0], "yaw_rad": yaw} for yaw in (None, float("nan"))]
    (tmp_path / "w.json").write_text(json.dumps({"format": "goshawk-waypoints", "version": 1, "waypoints": records}))
    with pytest.raises(FormatError, match="yaw of waypoint 2 is not a number"):
        missions.load(tmp_path / "w.json")
