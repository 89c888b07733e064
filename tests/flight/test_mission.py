import json
from dataclasses import fields, replace

import numpy as np
import pytest

from flight import FormatError, InputError, Waypoints, project
from flight import mission as missions
from flight.mission import FlyBy, Ground, Laps, LegSpeed, Mission, Stay, Velocity, Yaw

POINTS = Waypoints(np.arange(15.0).reshape(5, 3), np.array([np.nan, 0.5, np.nan, np.nan, -1.0]))
FULL = Mission(
    POINTS,
    laps=Laps(3, 1, 3),
    stays=(Stay(4, 2.0),),
    velocities=(Velocity(2, (1.0, 0.0, 0.5)),),
    leg_speeds=(LegSpeed(0, 2, 1.5),),
    fly_bys=(FlyBy(3, 0.5),),
    take_off=Ground((0.0, 0.0, 0.1)),
    landing=None,
    yaw=Yaw("look_at", look_at_world_m=(1.0, 2.0, 3.0)),
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
    with pytest.raises(FormatError, match="fly_bys, laps, leg_speeds, stays"):
        project.load_waypoints(tmp_path / "w.json")


def test_laps_unroll_to_a_closed_loop_with_a_way_in_and_out():
    flown = replace(FULL, laps=Laps(2, 1, 3)).unrolled()
    order = flown.waypoints.positions_world_m[:, 0] / 3.0
    assert order.tolist() == [0, 1, 2, 3, 1, 2, 3, 1, 4]
    assert [v.waypoint for v in flown.velocities] == [2, 5]
    assert [s.waypoint for s in flown.stays] == [8]
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
def test_the_legs_of_laps_keep_the_speeds_of_those_that_are_listed(speed, legs):
    flown = Mission(POINTS, laps=Laps(2, 1, 3), leg_speeds=(speed,)).unrolled()
    assert sorted(leg.first for leg in flown.leg_speeds) == legs


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"stays": (Stay(7, 1.0),)}, "waypoint 7; there are 0 to 4"),
        ({"stays": (Stay(1, -1.0),)}, "stay at waypoint 1 lasts -1 s"),
        ({"stays": (Stay(2, 1.0),)}, "waypoint 2 has a stay and a velocity"),
        ({"leg_speeds": (LegSpeed(3, 3, 1.0),)}, "from waypoint 3 to 3"),
        ({"leg_speeds": (LegSpeed(1, 3, 0.0),)}, "from waypoint 1 is 0 m/s"),
        ({"laps": Laps(0)}, "0 laps"),
        ({"fly_bys": (FlyBy(9, 1.0),)}, "waypoint 9"),
        ({"fly_bys": (FlyBy(4, 1.0),)}, "waypoint 4 has a stay and a radius"),
        ({"laps": Laps(2, 3, 1)}, "from waypoint 3 to 1"),
        ({"velocities": (Velocity(0, (1.0, 0.0, 0.0)),)}, "waypoint 0 has a velocity and a take_off"),
        ({"stays": (Stay(0, 1.0),)}, "waypoint 0 has a stay and a take_off"),
        ({"take_off": Ground((0.0, 0.0, 0.1), 0.0)}, "take_off climbs at 0 m/s"),
        ({"landing": Ground((0.0, 0.0, 0.1), np.inf)}, "landing climbs at inf m/s"),
        ({"landing": Ground((0.0, np.nan, 0.1))}, "landing is at"),
        ({"velocities": (Velocity(2, (np.nan, 0.0, 0.0)),)}, "velocity at waypoint 2 is"),
        ({"fly_bys": (FlyBy(3, np.nan),)}, "radius at waypoint 3 is nan m"),
        ({"fly_bys": (FlyBy(3, 0.0),)}, "radius at waypoint 3 is 0 m"),
        ({"yaw": Yaw("fixed", np.nan)}, "heading to hold is nan"),
    ],
)
def test_requests_that_make_no_sense_are_refused_by_number(change, words):
    with pytest.raises(InputError, match=words):
        replace(FULL, **change)


@pytest.mark.parametrize(
    "wrong",
    [{"laps": {"count": 1.5}}, {"stays": [{"waypoint": "x", "duration_s": 1}]}, {"yaw": {"up": 1}}, {"spin": 1},
     {"landing": {"position_world_m": [1, 2]}}],
)  # fmt: skip
def test_damaged_or_unknown_requests_are_refused(tmp_path, wrong):
    body = {"format": "goshawk-waypoints", "version": 2, "waypoints": project.waypoint_records(POINTS), **wrong}
    (tmp_path / "w.json").write_text(json.dumps(body))
    with pytest.raises(FormatError):
        missions.load(tmp_path / "w.json")
