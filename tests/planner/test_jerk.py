"""A limit on jerk, of the whole path or of single legs: optimised, proved, kept in the file, and free without one."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

import planner
import vehicle
from flight import FormatError, InputError, Waypoints, trajectory
from flight.mission import Ground, Laps, LegJerk, Mission, Stay
from planner import Conditions, PlanOptions
from planner.curve import minimum_snap
from planner.gate import gate, limits

POINTS = np.array([[0.0, 0.0, 1.0], [4.0, 0.0, 1.5], [4.0, 4.0, 1.0], [0.0, 4.0, 1.5], [-3.0, 2.0, 1.0]])
JERK = limits.NAMES.index("jerk")


def ask(points: np.ndarray = POINTS) -> Waypoints:
    return Waypoints(points, np.full(len(points), np.nan))


def within(drone: vehicle.Vehicle, jerk_m_s3: float | None, **options) -> PlanOptions:
    return PlanOptions(limits=replace(drone.limits, jerk_m_s3=jerk_m_s3), **options)


def seen(path, times: np.ndarray | None = None) -> np.ndarray:
    """The size of the jerk at samples."""
    return np.linalg.norm(path.position(path.sample(0.0005) if times is None else times, 3), axis=1)


def check_of(report, name: str = "jerk"):
    return next((check for check in report.checks if check.name == name), None)


@pytest.mark.parametrize("options", [{}, {"yaw": "free"}, {"method": "corridor"}])
def test_a_path_uses_the_jerk_it_may_have_and_no_more(open_sky, drone, options):
    plan = planner.plan(ask(), open_sky, drone, within(drone, 20.0, **options))
    assert 0.97 * 20.0 < seen(plan.trajectory).max() <= 20.0
    check = check_of(plan.gate)
    assert check.passed
    assert (check.bound, check.unit, check.reason) == (20.0, "m/s3", "proved between samples")
    assert "jerk" in plan.binding


def test_half_of_the_jerk_never_makes_a_faster_flight_and_at_last_costs_the_cube_root_of_two(open_sky, drone):
    times = [
        planner.plan(ask(), open_sky, drone, within(drone, jerk)).trajectory.duration_s
        for jerk in (None, 48.0, 24.0, 12.0, 6.0, 3.0)
    ]
    assert all(later >= 0.997 * sooner for sooner, later in itertools.pairwise(times))  # of two descents' ends
    assert times[-1] / times[-2] == pytest.approx(2.0 ** (1.0 / 3.0), rel=0.01)  # where nothing else binds


def test_a_limit_far_away_changes_no_bit_of_a_plan(open_sky, pillar, drone):
    for field, points in ((open_sky, POINTS), (pillar, np.array([[-4.0, 0.1, 1.5], [4.0, 0.0, 1.5]]))):
        free, far = (planner.plan(ask(points), field, drone, within(drone, jerk)) for jerk in (None, 1e200))
        assert np.array_equal(free.trajectory.coefficients, far.trajectory.coefficients)
        assert np.array_equal(free.trajectory.durations_s, far.trajectory.durations_s)
        assert check_of(free.gate) is None
        assert [check for check in far.gate.checks if check.name != "jerk"] == list(free.gate.checks)


def test_the_gate_refuses_jerk_that_is_exceeded_between_its_samples_only(open_sky, drone):
    path = planner.plan(ask(), open_sky, drone).trajectory
    most, coarse = float(seen(path).max()), path.sample(0.5)
    below = 0.999 * most
    assert seen(path, coarse).max() < below
    for jerk, passes in ((below, False), (1.01 * most, True)):
        report = gate.check(path, open_sky, drone, within(drone, jerk, sample_step_s=0.5))
        assert check_of(report).passed == passes
    failure = check_of(gate.check(path, open_sky, drone, within(drone, below)))
    segment, longer_s = failure.segment, path.durations_s[failure.segment] * (failure.value / below) ** (1.0 / 3.0)
    assert failure.reason == (
        f"segment {segment} at {failure.time_s:.1f} s: jerk {failure.value:.4g} m/s3, limit {below:.4g}; "
        f"give it {longer_s:.2f} s"
    )


@pytest.mark.parametrize("slower", [0.7, 1.5, 4.0])
def test_a_path_flown_slower_has_less_jerk_by_the_cube(drone, slower):
    rng = np.random.default_rng(3)
    knots = np.cumsum(rng.normal(size=(6, 4)) * [2, 2, 0.5, 0.3], axis=0)
    path = minimum_snap.trajectory(minimum_snap.solve(knots, rng.uniform(1.5, 2.5, 5)))
    before, after = (limits.usage(p, drone, drone.limits, step_s=0.01) for p in (path, path.scale_time(slower)))
    np.testing.assert_allclose(after.value[JERK], before.value[JERK] / slower**3, rtol=1e-9)


def test_a_path_that_can_only_be_slowed_down_keeps_the_limit(two_rooms, drone):
    points = ask(np.array([[-4.0, -2.0, 1.2], [4.0, -2.0, 1.2]]))
    plan = planner.plan(points, two_rooms, drone, within(drone, 2.0, method="bry"))
    assert plan.method == "bry"
    assert 0.9 * 2.0 < seen(plan.trajectory).max() <= 2.0
    assert set(plan.binding) - {""} == {"jerk"}


@pytest.mark.parametrize("seed", [3, 7, 12])
def test_a_legs_limit_holds_on_its_leg_and_on_no_other(open_sky, drone, seed):
    points = np.cumsum(np.random.default_rng(seed).normal(size=(6, 3)) * [3.0, 3.0, 0.7], axis=0)
    asked = Conditions(leg_jerk_m_s3=np.array([np.nan, np.nan, 5.0, np.nan, np.nan]))
    plan, free = (planner.plan(ask(points), open_sky, drone, conditions=given) for given in (asked, None))
    position = plan.trajectory.position(plan.trajectory.sample(0.0005))
    jerk = seen(plan.trajectory)
    first, last = (int(np.linalg.norm(position - point, axis=1).argmin()) for point in points[2:4])
    assert 0.95 * 5.0 < jerk[first + 1 : last].max() <= 5.0  # the samples nearest to the waypoints may be outside
    assert min(jerk[:first].max(), jerk[last:].max()) > 15.0
    check = check_of(plan.gate, "jerk of legs")
    assert check.passed
    assert (check.bound, check.unit) == (5.0, "m/s3")
    assert check_of(plan.gate) is None
    report = gate.check(free.trajectory, open_sky, drone, waypoints_world_m=points, conditions=asked)
    assert [failure.name for failure in report.failures] == ["jerk of legs"]


def test_the_stricter_of_a_legs_limit_and_the_vehicles_holds(open_sky, drone):
    legs = Conditions(leg_jerk_m_s3=np.array([50.0, 5.0, np.nan, np.nan]))
    plan = planner.plan(ask(), open_sky, drone, within(drone, 15.0), conditions=legs)
    assert 0.97 * 15.0 < check_of(plan.gate).value <= 15.0
    assert 0.95 * 5.0 < check_of(plan.gate, "jerk of legs").value <= 5.0


def test_a_mission_keeps_the_limits_of_its_legs_in_every_lap(open_sky, drone):
    asked = Mission(
        ask(POINTS[:4]),
        laps=Laps(2),
        leg_jerks=(LegJerk(0, 2, 12.0), LegJerk(1, 2, 4.0)),
        stays=(Stay(3, 1.0),),
        take_off=Ground((0.0, 0.0, 0.2), 0.5),
    )
    plan = planner.mission.plan(asked, open_sky, drone, within(drone, 25.0))
    assert check_of(plan.gate).passed
    legs = np.array([np.nan, 12.0, 4.0, np.nan, np.nan, 12.0, 4.0, np.nan, np.nan])  # the climb, then two laps
    np.testing.assert_array_equal(plan.gate.conditions.leg_jerk_m_s3, legs)
    assert 0.95 < check_of(plan.gate, "jerk of legs").ratio <= 1.0


def test_a_session_keeps_the_limits_of_legs_and_takes_another_limit(open_sky, drone):
    asked = Conditions(leg_jerk_m_s3=np.array([np.nan, 6.0, np.nan, np.nan]))
    session = planner.Planner(ask(), open_sky, drone, within(drone, 30.0), conditions=asked)
    moved = session.move(2, POINTS[2] + [0.3, 0.2, 0.0])
    parted = session.insert(2, POINTS[1] + [0.2, 2.0, 0.1])
    for plan, legs in ((moved, 1), (parted, 2)):
        assert plan.gate.passed
        assert seen(plan.trajectory).max() <= 30.0
        assert (plan.gate.conditions.leg_jerk_m_s3 == 6.0).sum() == legs
    slower = session.limit(replace(drone.limits, jerk_m_s3=10.0))
    assert 0.97 * 10.0 < seen(slower.trajectory).max() <= 10.0


def test_the_limit_comes_back_from_the_file_and_is_asked_again(open_sky, drone, tmp_path):
    legs = Conditions(leg_jerk_m_s3=np.array([np.nan, 5.0, np.nan, np.nan]))
    plan = planner.plan(ask(), open_sky, drone, within(drone, 20.0), conditions=legs)
    planner.save_plan(tmp_path / "lap.json", plan, name="lap")
    item = trajectory.load(tmp_path / "lap.json")
    assert gate.options_of(item).limits.jerk_m_s3 == 20.0
    np.testing.assert_array_equal(gate.asked_of(item).leg_jerk_m_s3, legs.leg_jerk_m_s3)
    again = gate.check_file(item, open_sky, drone)
    assert again.passed
    assert {"jerk", "jerk of legs"} <= {check.name for check in again.checks}
    # a vehicle that has become more careful since
    stricter = gate.check_file(item, open_sky, drone.with_limits(jerk_m_s3=10.0))
    assert {"jerk", "vehicle"} == {failure.name for failure in stricter.failures}


def test_files_and_hashes_without_a_limit_are_those_of_before(open_sky, drone):
    plan = planner.plan(ask(), open_sky, drone, within(drone, None))
    document = plan.gate.as_dict()
    assert "jerk_m_s3" not in document["asked"]["limits"]
    assert PlanOptions.from_dict(document["asked"]).limits.jerk_m_s3 is None
    assert [check["name"] for check in document["checks"] if "jerk" in check["name"]] == ["jerk at joins"]
    assert vehicle.vehicle_hash(drone).startswith("bd871ae0d89b23c0")  # of before there was such a limit
    assert vehicle.vehicle_hash(drone.with_limits(jerk_m_s3=20.0)) != vehicle.vehicle_hash(drone)
    with pytest.raises(FormatError, match="damaged"):
        PlanOptions.from_dict(document["asked"] | {"limits": document["asked"]["limits"] | {"jerk_m_s3": -1.0}})


def test_the_stricter_of_two_limits_is_the_only_one_where_one_has_none(drone):
    for ours, theirs, both in ((None, None, None), (7.0, None, 7.0), (None, 8.0, 8.0), (7.0, 8.0, 7.0)):
        one, other = (replace(drone.limits, jerk_m_s3=jerk) for jerk in (ours, theirs))
        assert one.stricter(other) == replace(drone.limits, jerk_m_s3=both)


@pytest.mark.parametrize("jerk", [0.0, -3.0, np.nan, np.inf])
def test_a_limit_that_is_no_positive_number_is_refused_with_its_value(drone, jerk):
    with pytest.raises(InputError, match=f"limit jerk_m_s3 is {jerk}; it must be a positive, finite number"):
        replace(drone.limits, jerk_m_s3=jerk)


def test_a_way_that_would_take_hours_at_a_limit_is_refused_before_any_work(open_sky, drone):
    with pytest.raises(InputError, match=r"takes more than 10000 s at jerk_m_s3 1e-12: raise the limit"):
        planner.plan(ask(), open_sky, drone, within(drone, 1e-12))
