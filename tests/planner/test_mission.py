import numpy as np
import pytest

import planner
from esdf import solids
from flight import InputError, Waypoints
from flight.mission import FlyBy, Gate, Ground, KeepIn, Laps, LegSpeed, Mission, Stay, Velocity, Yaw
from planner import mission
from planner.gate import gate
from planner.request.options import PlanInfeasibleError

SQUARE = np.array([[-3.0, -3.0, 1.2], [3.0, -3.0, 1.4], [3.0, 3.0, 1.2], [-3.0, 3.0, 1.4]])


@pytest.fixture(scope="module")
def hall() -> solids.Scene:
    """A room with its floor at z = 0."""
    return solids.Scene([solids.Room((-8.0, -8.0, 0.0), (8.0, 8.0, 3.0))])


def ask(points=SQUARE) -> Waypoints:
    return Waypoints(points, np.full(len(points), np.nan))


def test_laps_are_closed_and_flown_without_a_stop(hall, drone):
    plan = mission.plan(Mission(ask(), laps=Laps(3)), hall, drone)
    assert plan.gate.passed
    assert len(plan.waypoints.positions_world_m) == 13
    times = plan.trajectory.sample(0.01)
    inner = (times > 0.5) & (times < times[-1] - 0.5)
    assert np.linalg.norm(plan.trajectory.position(times[inner], 1), axis=1).min() > 0.5
    yaw = plan.trajectory.evaluate(times)[:, 3]
    assert abs(yaw[-1] - yaw[0]) > 2.0 * 2.0 * np.pi  # it looks ahead, round and round


def test_a_stay_lasts_as_long_as_asked_and_turns_nowhere(hall, drone):
    plan = mission.plan(Mission(ask(), stays=(Stay(1, 2.5), Stay(3, 1.0))), hall, drone)
    times = plan.trajectory.sample(0.01)
    values = plan.trajectory.evaluate(times)
    for i, duration_s in ((1, 2.5), (3, 1.0)):
        there = np.linalg.norm(values[:, :3] - SQUARE[i], axis=1) < 1e-9
        assert there.sum() * 0.01 >= duration_s - 0.02
        assert np.ptp(values[there, 3]) < 1e-7
    shorter = mission.conditions(Mission(ask(), stays=(Stay(1, 3.0),)))
    report = gate.check(plan.trajectory, hall, drone, waypoints_world_m=SQUARE, conditions=shorter)
    assert [check.name for check in report.failures] == ["stays"]


def test_take_off_and_landing_are_vertical_continuous_and_part_of_the_checked_flight(hall, drone):
    down, up = Ground((3.0, 0.0, 0.1)), Ground((-5.0, -3.0, 0.1))
    plan = mission.plan(Mission(ask(), take_off=up, landing=down), hall, drone)
    path = plan.trajectory
    ends = path.position(np.array([0.0, path.duration_s]))
    np.testing.assert_allclose(ends, [up.position_world_m, down.position_world_m], atol=1e-9)
    for derivative in range(4):
        assert np.abs(path.join_jumps(derivative)).max() < 1e-4
    times = path.sample(0.002)
    position = path.position(times)
    near = hall.distance(position) < 0.3  # only straight above the ground points
    off = np.minimum(*[np.linalg.norm(position[near, :2] - g.position_world_m[:2], axis=1) for g in (up, down)])
    assert near.any()
    assert off.max() < 1e-6
    first = near & (times < 0.5 * times[-1])
    assert (path.position(times[first], 1)[:, 2] >= -1e-9).all()
    assert not gate.check(path, hall, drone).passed  # without the ground points it is too near the floor
    assert gate.check_file(planner.trajectory_file(plan, name="whole"), hall, drone).passed


def test_an_obstacle_above_the_take_off_is_seen(hall, drone):
    shelf = solids.Scene([*hall.solids, solids.Box((-5.5, -3.5, 0.5), (-4.5, -2.5, 0.6))])
    with pytest.raises((InputError, planner.PlanInfeasibleError)):
        mission.plan(Mission(ask(), take_off=Ground((-5.0, -3.0, 0.1))), shelf, drone)


def test_every_kind_at_once_passes_the_gate_and_keeps_what_is_asked(hall, drone):
    points = np.concatenate([SQUARE, [[0.0, 0.0, 1.5]]])
    whole = Mission(
        ask(points),
        laps=Laps(2, 0, 3),
        stays=(Stay(4, 1.0),),
        velocities=(Velocity(1, (1.5, 1.5, 0.0)),),
        leg_speeds=(LegSpeed(2, 3, 2.0),),
        fly_bys=(FlyBy(3, 0.4),),
        take_off=Ground((-5.0, -3.0, 0.1)),
        yaw=Yaw("look_at", look_at_world_m=(0.0, 0.0, 1.0)),
    )
    with pytest.raises(InputError, match="4"):
        mission.plan(Mission(ask(), stays=(Stay(4, 1.0),)), hall, drone)
    plan = mission.plan(whole, hall, drone)
    assert plan.gate.passed
    names = {check.name for check in plan.gate.checks}
    assert {"stays", "speed of legs", "velocity at waypoints", "look at the point"} <= names


def test_the_heading_turns_on_by_whole_turns_where_parts_join(hall, drone):
    one = mission.plan(Mission(ask(), laps=Laps(1)), hall, drone).trajectory
    joined = mission.join([one, one.reverse().reverse()])
    assert np.abs(joined.join_jumps(0)[:, 3]).max() < np.pi


def test_a_waypoint_in_an_obstacle_is_named_as_the_pilot_counts_it(hall, drone):
    points = np.concatenate([SQUARE, [[0.0, 0.0, -0.5]]])
    whole = Mission(ask(points), laps=Laps(3, 0, 3), stays=(Stay(1, 1.0),), take_off=Ground((-5.0, -3.0, 0.1)))
    with pytest.raises(InputError, match="waypoint 5 at"):
        mission.plan(whole, hall, drone)


def test_a_refusal_counts_waypoints_as_flown(hall, drone):
    wall = solids.Scene([*hall.solids, solids.Box((-8.1, -0.1, -0.1), (8.1, 0.1, 3.1))])
    with pytest.raises(planner.PlanInfeasibleError) as caught:
        mission.plan(Mission(ask(), stays=(Stay(1, 1.0),), take_off=Ground((-5.0, -3.0, 0.1))), wall, drone)
    assert caught.value.segment == 1


@pytest.mark.parametrize("height_m", [0.3, 0.9])  # inside a block, and in its upper half
def test_a_take_off_from_inside_an_obstacle_is_refused(hall, drone, height_m):
    block = solids.Scene([*hall.solids, solids.Box((-5.5, -3.5, 0.0), (-4.5, -2.5, 1.2))])
    with pytest.raises(InputError, match="m inside an obstacle or beyond a wall"):
        mission.plan(Mission(ask(), take_off=Ground((-5.0, -3.0, height_m))), block, drone)


def test_stays_that_last_longer_than_a_trajectory_may_are_refused_before_any_work(hall, drone):
    patient = Mission(ask(), laps=Laps(2), stays=(Stay(1, 3000.0), Stay(2, 3000.0)))
    with pytest.raises(InputError, match=r"stays last 1.2e\+04 s in all"):
        mission.plan(patient, hall, drone)


def test_stays_and_paths_that_last_too_long_together_are_refused_before_a_file_would_be(open_sky, drone):
    asked = Mission(ask(), stays=(Stay(0, 3600.0), Stay(1, 3600.0), Stay(2, 2799.0)))
    with pytest.raises(PlanInfeasibleError, match=r"stays and paths last 1000\d\.?\d* s together"):
        mission.plan(asked, open_sky, drone)


def test_gates_and_a_tube_hold_for_a_whole_flight_from_ground_to_ground(hall, drone):
    loop = Mission(
        ask(),
        laps=Laps(2, 0, 3),
        stays=(Stay(1, 1.0),),
        gates=(Gate(2, 0.8, 0.6, 2.3), Gate(3, 0.8, 0.6, -2.3)),
        keep_in=KeepIn(0.8),
        take_off=Ground((-5.0, -3.0, 0.1)),
        landing=Ground((-5.0, -3.5, 0.1)),
    )
    plan = mission.plan(loop, hall, drone)
    found = {check.name: check for check in plan.gate.checks}
    assert found["keep-in"].value <= 0.8
    assert found["gates"].reason.startswith("all 4 passed")
    assert gate.check_file(planner.trajectory_file(plan, name="whole"), hall, drone).passed
