import itertools

import numpy as np
import pytest

import planner
from flight import FormatError, InputError, TrajectoryFile, Waypoints
from planner import Conditions, PlanOptions, gate

SQUARE = np.array([[0.0, 0.0, 1.0], [4.0, 0.0, 1.5], [4.0, 4.0, 1.0], [0.0, 4.0, 1.5]])


def ask(points=SQUARE, yaw=np.nan) -> Waypoints:
    return Waypoints(points, np.full(len(points), yaw))


def moving(velocity, acceleration=(0.0, 0.0, 0.0)) -> np.ndarray:
    return np.array([[*velocity, 0.0], [*acceleration, 0.0], [0.0] * 4])


def motion(trajectory, time_s: float) -> np.ndarray:
    return np.concatenate([trajectory.evaluate(np.array([time_s]), r) for r in (1, 2, 3)])


def test_a_path_starts_and_ends_in_the_motion_that_is_asked_for(open_sky, drone):
    start, end = moving((2.0, 1.0, 0.0), (0.5, 0.0, 0.3)), moving((-1.0, 0.5, 0.2))
    plan = planner.plan(ask(), open_sky, drone, conditions=Conditions(start=start, end=end))
    assert plan.gate.passed
    assert np.abs(motion(plan.trajectory, 0.0) - start).max() < 1e-6
    assert np.abs(motion(plan.trajectory, plan.trajectory.duration_s) - end).max() < 1e-5


def test_two_plans_that_meet_in_one_motion_join_without_a_jump(open_sky, drone):
    meeting = moving((2.0, 2.0, 0.0))
    first = planner.plan(ask(SQUARE[:3]), open_sky, drone, conditions=Conditions(end=meeting))
    yaw = float(first.trajectory.evaluate(np.array([first.trajectory.duration_s]))[0, 3])
    then = Waypoints(SQUARE[2:], np.array([yaw, np.nan]))
    second = planner.plan(then, open_sky, drone, conditions=Conditions(start=meeting))
    whole = planner.mission.join([first.trajectory, second.trajectory])
    assert gate.check(whole, open_sky, drone, waypoints_world_m=SQUARE).passed


def test_a_running_start_is_faster_than_one_from_rest(open_sky, drone):
    rest = planner.plan(ask(), open_sky, drone)
    running = planner.plan(ask(), open_sky, drone, conditions=Conditions(start=moving((4.0, 0.0, 0.0))))
    assert running.trajectory.duration_s < rest.trajectory.duration_s


def test_a_waypoint_is_passed_with_the_velocity_asked_for(open_sky, drone):
    velocity = np.full((4, 3), np.nan)
    velocity[1], velocity[2] = (1.0, 2.0, 0.0), (-2.0, 0.0, 0.0)
    plan = planner.plan(ask(), open_sky, drone, conditions=Conditions(velocity_world_m_s=velocity))
    joins = plan.trajectory.position(plan.trajectory.starts_s)
    for i in (1, 2):
        at = plan.trajectory.starts_s[np.linalg.norm(joins - SQUARE[i], axis=1).argmin()]
        assert np.abs(plan.trajectory.position(np.array([at]), 1)[0] - velocity[i]).max() < 1e-6
    other = Conditions(velocity_world_m_s=velocity + 0.1)
    report = gate.check(plan.trajectory, open_sky, drone, waypoints_world_m=SQUARE, conditions=other)
    assert [check.name for check in report.failures] == ["velocity at waypoints"]


def test_only_the_leg_with_a_speed_is_flown_slowly(open_sky, drone):
    slow = Conditions(leg_speed_m_s=np.array([np.nan, 1.5, np.nan]))
    plan, free = planner.plan(ask(), open_sky, drone, conditions=slow), planner.plan(ask(), open_sky, drone)
    times = plan.trajectory.sample(0.002)
    position, speed = plan.trajectory.position(times), np.linalg.norm(plan.trajectory.position(times, 1), axis=1)
    passed = [int(np.linalg.norm(position - point, axis=1).argmin()) for point in SQUARE]
    assert speed[passed[1] : passed[2]].max() <= 1.5
    assert speed[passed[1] : passed[2]].max() > 1.35
    assert speed[: passed[1]].max() > 3.0
    report = gate.check(free.trajectory, open_sky, drone, waypoints_world_m=SQUARE, conditions=slow)
    assert [check.name for check in report.failures] == ["speed of legs"]


@pytest.mark.parametrize("seed", [3, 7, 12])
def test_a_leg_may_be_asked_to_be_flown_ten_times_as_slowly_as_its_neighbours(open_sky, drone, seed):
    """Such plans used to be refused for a speed that was missed by 4 % to three times."""
    rng = np.random.default_rng(seed)
    points = np.cumsum(rng.normal(size=(7, 3)) * [3.0, 3.0, 0.7], axis=0)
    asked = np.where(rng.random(6) < 0.5, rng.uniform(0.3, 3.0, 6), np.nan)
    asked[2] = 0.35
    radius = np.where(rng.random(7) < 0.4, 0.4, 0.0) * (seed % 2)
    radius[[0, -1]] = 0.0
    given = Conditions(leg_speed_m_s=asked, fly_by_m=radius)
    plan = planner.plan(ask(points), open_sky, drone, conditions=given)
    check = next(check for check in plan.gate.checks if check.name == "speed of legs")
    assert 0.95 < check.value / check.bound <= 1.0


def test_a_waypoint_with_a_radius_is_passed_by_within_it_and_faster(open_sky, drone):
    exact = planner.plan(ask(), open_sky, drone)
    near = Conditions(fly_by_m=np.array([0.0, 0.8, 0.8, 0.0]))
    plan = planner.plan(ask(), open_sky, drone, conditions=near)
    position = plan.trajectory.position(plan.trajectory.sample(0.001))
    gaps = np.array([np.linalg.norm(position - point, axis=1).min() for point in SQUARE])
    assert gaps[[0, 3]].max() < 1e-6
    assert (gaps[1:3] <= 0.8).all()
    assert gaps[1:3].max() > 0.4  # it uses the room
    assert plan.trajectory.duration_s < 0.95 * exact.trajectory.duration_s
    report = gate.check(plan.trajectory, open_sky, drone, waypoints_world_m=SQUARE)
    assert [check.name for check in report.failures] == ["waypoints"]
    assert gate.check(exact.trajectory, open_sky, drone, waypoints_world_m=SQUARE, conditions=near).passed


def test_a_larger_radius_is_never_slower(open_sky, drone):
    times = [
        planner.plan(ask(), open_sky, drone, conditions=Conditions(fly_by_m=np.array([0.0, r, r, 0.0])))
        for r in (0.0, 0.2, 0.6, 1.2)
    ]
    durations = [plan.trajectory.duration_s for plan in times]
    assert all(b <= 1.01 * a for a, b in itertools.pairwise(durations))


def test_conditions_travel_with_the_file_and_are_asked_by_its_check(open_sky, drone, tmp_path):
    plan = planner.plan(ask(), open_sky, drone, conditions=Conditions(start=moving((2.0, 0.0, 0.0))))
    item = planner.trajectory_file(plan, name="moving")
    assert gate.check_file(item, open_sky, drone).passed
    unasked = TrajectoryFile(item.trajectory, "x", item.map_hash, item.vehicle_hash, item.waypoints_world_m, {})
    assert not gate.check_file(unasked, open_sky, drone).passed
    for wrong in ({"start": ["x"]}, {"start": [1.0]}, {"leg_speed_m_s": [1.0]}, {"spin": [1.0]}, [1], {"stay_s": 3.0}):
        check = {"conditions": wrong}
        damaged = TrajectoryFile(item.trajectory, "x", "", "", item.waypoints_world_m, check)
        with pytest.raises(FormatError, match="damaged"):
            gate.check_file(damaged, open_sky, drone)


@pytest.mark.parametrize(
    ("conditions", "words"),
    [
        (Conditions(start=moving((50.0, 0.0, 0.0))), "start moves at 50 m/s"),
        (Conditions(end=moving((0.0, 0.0, 0.0), (90.0, 0.0, 0.0))), "end moves at 90 m/s2"),
        (Conditions(start=np.full((3, 4), np.nan)), "start's motion is not finite"),
        (Conditions(leg_speed_m_s=np.array([1.0, 0.0, 1.0])), "leg from waypoint 1 to 2"),
        (Conditions(leg_speed_m_s=np.ones(2)), "expected shape"),
        (Conditions(fly_by_m=np.array([0.0, -1.0, 0.0, 0.0])), "waypoint 1 is to be passed within -1 m"),
        (Conditions(fly_by_m=np.array([1.0, 0.0, 0.0, 0.0])), "first and last"),
        (Conditions(velocity_world_m_s=np.array([[np.nan] * 3, [99.0, 0, 0], *[[np.nan] * 3] * 2])), "waypoint 1"),
        (Conditions(velocity_world_m_s=np.array([[np.nan] * 3, [1, np.nan, 0], *[[np.nan] * 3] * 2])), "waypoint 1"),
        (Conditions(velocity_world_m_s=np.array([[1.0, 0, 0], *[[np.nan] * 3] * 3])), "first or last"),
        (
            Conditions(
                velocity_world_m_s=np.array([[np.nan] * 3, [3.0, 0, 0], *[[np.nan] * 3] * 2]),
                leg_speed_m_s=np.array([np.nan, 2.0, np.nan]),
            ),
            "waypoint 1 is to be passed at 3 m/s, but the leg from waypoint 1 is flown at 2 m/s at most",
        ),
    ],
)
def test_conditions_that_cannot_be_met_are_refused_by_name(open_sky, drone, conditions, words):
    with pytest.raises(InputError, match=words):
        planner.plan(ask(), open_sky, drone, conditions=conditions)


def test_a_fixed_heading_is_held_and_a_waypoint_may_not_ask_for_another(open_sky, drone):
    plan = planner.plan(ask(), open_sky, drone, PlanOptions(yaw="fixed", heading_rad=0.7))
    assert np.abs(plan.trajectory.evaluate(plan.trajectory.sample(0.01))[:, 3] - 0.7).max() < 1e-9
    with pytest.raises(InputError, match="holds 40 deg"):
        planner.plan(ask(yaw=0.2), open_sky, drone, PlanOptions(yaw="fixed", heading_rad=0.7))


def test_a_steady_heading_is_that_of_the_start(open_sky, drone):
    plan = planner.plan(ask(), open_sky, drone, PlanOptions(yaw="steady"))
    yaw = plan.trajectory.evaluate(plan.trajectory.sample(0.01))[:, 3]
    assert np.ptp(yaw) < 1e-9
    given = Waypoints(SQUARE, np.array([1.0, np.nan, np.nan, np.nan]))
    plan = planner.plan(given, open_sky, drone, PlanOptions(yaw="steady"))
    assert np.abs(plan.trajectory.evaluate(plan.trajectory.sample(0.01))[:, 3] - 1.0).max() < 1e-9


@pytest.mark.parametrize("method", ["fastest", "corridor"])
def test_the_vehicle_looks_at_the_point(open_sky, drone, method):
    centre = np.array([2.0, 2.0, 1.0])
    plan = planner.plan(
        ask(), open_sky, drone, PlanOptions(yaw="look_at", look_at_world_m=tuple(centre), method=method)
    )
    values = plan.trajectory.evaluate(plan.trajectory.sample(0.01))
    aim = centre[:2] - values[:, :2]
    off = np.abs(np.angle(np.exp(1j * (values[:, 3] - np.arctan2(aim[:, 1], aim[:, 0])))))
    assert off.max() < 0.3
    elsewhere = PlanOptions(yaw="look_at", look_at_world_m=(20.0, 20.0, 1.0))
    report = gate.check(plan.trajectory, open_sky, drone, elsewhere, waypoints_world_m=SQUARE)
    assert "look at the point" in [check.name for check in report.failures]


def test_a_free_heading_costs_no_time(open_sky, drone):
    times = [
        planner.plan(ask(), open_sky, drone, PlanOptions(yaw=mode)).trajectory.duration_s
        for mode in ("free", "along_path")
    ]
    assert times[0] <= times[1] * 1.01


@pytest.mark.parametrize("wrong", [{"yaw": "look_at"}, {"yaw": "up"}, {"heading_rad": np.inf}])
def test_yaw_options_that_make_no_sense_are_refused(wrong):
    with pytest.raises(InputError):
        PlanOptions(**wrong)


def test_mirrored_conditions_mirror_the_path(open_sky, drone):
    mirror = np.array([1.0, -1.0, 1.0])
    plans = [
        planner.plan(
            ask(SQUARE * m), open_sky, drone, conditions=Conditions(start=moving(np.array([2.0, 1.0, 0.0]) * m))
        )
        for m in (np.ones(3), mirror)
    ]
    for one, other in itertools.pairwise(plans):
        assert one.trajectory.duration_s == pytest.approx(other.trajectory.duration_s, rel=5e-3)
