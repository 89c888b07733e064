"""Conditions by their parts: shapes and numbers refused, rows kept with their waypoints, each check by hand."""

import numpy as np
import pytest

from esdf import solids
from flight import InputError, Trajectory
from planner import Conditions, PlanOptions
from planner.gate.conditions_met import checks
from planner.gate.visits import Visits

OPEN = np.nan
REST = np.zeros((3, 4))
LEFT_UP = np.array([[0.0, 0.5, 0.0], [0.0, 0.0, 0.5]])
LINE = np.array([[0.0, 0.0, 0.0], [4.0, 0.0, 0.0]])


def rows(values, index: int) -> np.ndarray:
    """(4, 3) open but for one."""
    found = np.full((4, 3), OPEN)
    found[index] = values
    return found


def edges(**given) -> np.ndarray:
    """(4, 2, 3) no gates but the given ones, by `at_1` and so on."""
    found = np.zeros((4, 2, 3))
    for name, pair in given.items():
        found[int(name[-1])] = pair
    return found


def motion(row: int, *values: float) -> np.ndarray:
    found = REST.copy()
    found[row, : len(values)] = values
    return found


# -- what is refused ---------------------------------------------------------------------------------------------------


def test_what_is_just_within_a_bound_is_taken(drone):
    speed, most = drone.limits.speed_m_s, drone.limits.acceleration_m_s2
    for given in (
        Conditions(start=motion(0, speed)),
        Conditions(end=motion(1, 0.0, most)),
        Conditions(start=motion(0, 0.0, 0.0, 0.0, 99.0)),  # the heading's own rate has another limit
        Conditions(start=motion(2, 99.0)),
        Conditions(leg_speed_m_s=np.array([1e-3, OPEN, speed])),
        Conditions(leg_jerk_m_s3=np.array([1e-3, OPEN, 1e30])),
        Conditions(start=motion(2, 9.0), end=motion(2, 0.0, 9.0), leg_jerk_m_s3=np.array([9.0, 1.0, OPEN])),
        Conditions(velocity_world_m_s=rows([speed, 0.0, 0.0], 1)),
        Conditions(velocity_world_m_s=rows([1.5, 0.0, 0.0], 1), leg_speed_m_s=np.array([1.5, 1.5, 0.1])),
        Conditions(fly_by_m=np.array([0.0, 99.9, 0.5, 0.0])),
        Conditions(fly_by_m=np.array([0.0, 0.5, 0.0, 0.0]), velocity_world_m_s=rows([1.0, 0.0, 0.0], 2)),
        Conditions(gate_edges_m=edges(at_1=LEFT_UP), fly_by_m=np.array([0.0, 0.0, 0.5, 0.0])),
        Conditions(gate_edges_m=edges(at_1=LEFT_UP), velocity_world_m_s=rows([1.0, 0.0, 0.0], 2)),
        Conditions(gate_edges_m=edges(at_2=[[0.0, 0.5, 4.9e-7], [0.0, 0.0, 0.5]])),
        Conditions(gate_edges_m=edges(at_2=[[0.0, 10.0, 5e-6], [0.0, 0.0, 10.0]])),
        Conditions(keep_in_world_m=LINE, keep_in_radius_m=0.05),
        Conditions(keep_in_world_m=LINE, keep_in_radius_m=999.0),
        Conditions(keep_in_world_m=LINE * 312.5, keep_in_radius_m=0.05),
    ):
        assert given.checked(4, drone.limits) is not None


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (Conditions(start=motion(0, 8.01)), "start moves at 8.01 m/s, limit 8"),
        (Conditions(end=motion(1, 0.0, 12.1)), "end moves at 12.1 m/s2, limit 12"),
        (Conditions(start=motion(2, OPEN)), "start's motion is not finite"),
        (Conditions(leg_speed_m_s=np.array([1.0, 1.0, 0.0])), "leg from waypoint 3 to 4 has a speed of 0"),
        (Conditions(leg_speed_m_s=np.array([-1.0, 1.0, 1.0])), "leg from waypoint 1 to 2 has a speed of -1"),
        (Conditions(leg_jerk_m_s3=np.array([1.0, 1.0, 0.0])), "leg from waypoint 3 to 4 has a jerk of 0 m/s3"),
        (Conditions(leg_jerk_m_s3=np.array([1.0, -1.0, 1.0])), "leg from waypoint 2 to 3 has a jerk of -1 m/s3"),
        (Conditions(start=motion(2, 0.0, 50.1)), "start moves at 50.1 m/s3, limit 50"),
        (Conditions(start=motion(2, 9.1), leg_jerk_m_s3=np.array([9.0, 1.0, 1.0])), "start moves at 9.1 m/s3, limit 9"),
        (Conditions(end=motion(2, 9.1), leg_jerk_m_s3=np.array([1.0, 1.0, 9.0])), "end moves at 9.1 m/s3, limit 9"),
        (Conditions(leg_jerk_m_s3=np.ones(2)), "leg_jerk_m_s3: expected shape"),
        (Conditions(velocity_world_m_s=rows([1.0, 0.0, 0.0], 3)), "at the first or last waypoint"),
        (Conditions(velocity_world_m_s=rows([OPEN, 0.0, 0.0], 0)), "at the first or last waypoint"),
        (Conditions(velocity_world_m_s=rows([OPEN, 0.0, 0.0], 2)), "velocity at waypoint 3 is not finite in every"),
        (Conditions(velocity_world_m_s=rows([0.0, 8.01, 0.0], 2)), "waypoint 3 is to be passed at 8.01 m/s, limit 8"),
        (
            Conditions(velocity_world_m_s=rows([1.6, 0.0, 0.0], 2), leg_speed_m_s=np.array([0.1, 1.5, 9.0])),
            "waypoint 3 .* leg from waypoint 2 is flown at 1.5 m/s",
        ),
        (
            Conditions(velocity_world_m_s=rows([1.6, 0.0, 0.0], 2), leg_speed_m_s=np.array([0.1, 9.0, 1.5])),
            "waypoint 3 .* leg from waypoint 3 is flown at 1.5 m/s",
        ),
        (Conditions(fly_by_m=np.array([0.0, 1.0, 100.0, 0.0])), "waypoint 3 is to be passed within 100 m"),
        (Conditions(fly_by_m=np.array([0.0, OPEN, 1.0, 0.0])), "waypoint 2 is to be passed within nan m"),
        (Conditions(fly_by_m=np.array([0.0, 1.0, 1.0, 0.1])), "first and last waypoint are met exactly"),
        (
            Conditions(fly_by_m=np.array([0.0, 0.0, 0.5, 0.0]), velocity_world_m_s=rows([1.0, 0.0, 0.0], 2)),
            "waypoint 3 has a velocity and a radius",
        ),
        (Conditions(gate_edges_m=edges(at_3=LEFT_UP)), "give gates to inner waypoints"),
        (Conditions(gate_edges_m=edges(at_0=LEFT_UP)), "give gates to inner waypoints"),
        (Conditions(gate_edges_m=edges(at_2=[[0.0, 0.5, 1e-4], [0.0, 0.0, 0.5]])), "gate at waypoint 3 needs two"),
        (Conditions(gate_edges_m=edges(at_2=[[0.0, 0.5, 0.0], [0.0, 0.0, 0.0]])), "gate at waypoint 3 needs two"),
        (Conditions(gate_edges_m=edges(at_1=[[0.0, OPEN, 0.0], [0.0, 0.0, 0.5]])), "gate at waypoint 2 needs two"),
        (Conditions(gate_edges_m=edges(at_1=[[0.0, np.inf, 0.0], [0.0, 0.0, 0.5]])), "gate at waypoint 2 needs two"),
        (Conditions(gate_edges_m=edges(at_1=[[np.inf, 0.0, 0.0], [1.0, 0.0, 0.0]])), "gate at waypoint 2 needs two"),
        (Conditions(gate_edges_m=edges(at_1=np.full((2, 3), OPEN))), "gate at waypoint 2 needs two"),
        (
            Conditions(gate_edges_m=edges(at_2=LEFT_UP), fly_by_m=np.array([0.0, 0.0, 0.5, 0.0])),
            "waypoint 3 has a gate and a radius",
        ),
        (
            Conditions(gate_edges_m=edges(at_2=LEFT_UP), velocity_world_m_s=rows([1.0, 0.0, 0.0], 2)),
            "waypoint 3 has a gate and a velocity",
        ),
        (Conditions(stay_s=np.zeros(4)), "plan it as a mission"),
        (Conditions(ground_world_m=np.zeros((1, 3))), "plan it as a mission"),
        (Conditions(keep_in_radius_m=1.0), "both a polyline and a radius"),
        (Conditions(keep_in_world_m=LINE, keep_in_radius_m=1000.0), "radius of 1000 m"),
        (Conditions(keep_in_world_m=LINE, keep_in_radius_m=OPEN), "radius of nan m"),
        (Conditions(keep_in_world_m=LINE * 313.0, keep_in_radius_m=0.05), "1.25e.03 m long"),
        (Conditions(keep_in_world_m=np.zeros(3), keep_in_radius_m=1.0), "expected finite points"),
        (Conditions(keep_in_world_m=np.zeros((2, 2)), keep_in_radius_m=1.0), "expected finite points"),
        (Conditions(keep_in_world_m=[[0.0, 0.0, OPEN], [1.0, 0.0, 0.0]], keep_in_radius_m=1.0), "expected finite"),
        (Conditions(start=np.zeros((3, 3))), "start: expected shape"),
        (Conditions(velocity_world_m_s=np.zeros((3, 3))), "velocity_world_m_s: expected shape"),
        (Conditions(leg_speed_m_s=np.ones(4)), "leg_speed_m_s: expected shape"),
        (Conditions(keep_in_world_m=LINE, keep_in_radius_m=np.ones(1)), "keep_in_radius_m: expected shape"),
    ],
)
def test_what_is_just_beyond_a_bound_is_refused_by_name(drone, given, words):
    limits = drone.with_limits(speed_m_s=8.0, acceleration_m_s2=12.0, jerk_m_s3=50.0).limits
    with pytest.raises(InputError, match=words):
        given.checked(4, limits)


@pytest.mark.parametrize(("inside_m", "refused"), [(0.031, False), (0.029, True), (-0.5, True)])
def test_waypoints_lie_three_centimetres_inside_a_tube(inside_m, refused):
    tube = Conditions(keep_in_world_m=LINE, keep_in_radius_m=1.0)
    points = np.array([[1.0, 0.0, 0.0], [2.0, 1.0 - inside_m, 0.0], [3.0, 0.0, 0.0]])
    Conditions().check_inside(points)
    Conditions(keep_in_world_m=LINE, keep_in_radius_m=0.06).check_inside(np.array([[1.0, 0.03, 0.0]]))  # just so
    if refused:
        with pytest.raises(InputError, match="waypoint 2 is"):
            tube.check_inside(points)
    else:
        tube.check_inside(points)
    room, options = solids.Scene([solids.Sphere((0.0, 0.0, 9.0), 1.0)]), PlanOptions(radius_m=0.2)
    assert Conditions().room(room, options) is room
    assert tube.room(room, options) is not room
    assert Conditions(keep_in_world_m=LINE).tube is None
    assert Conditions(keep_in_radius_m=1.0).tube is None


def test_a_path_with_given_motion_is_one_with_any_velocity():
    for given, moving in (
        (Conditions(), False),
        (Conditions(start=REST), True),
        (Conditions(end=REST), True),
        (Conditions(velocity_world_m_s=np.full((4, 3), OPEN)), False),
        (Conditions(velocity_world_m_s=rows([1.0, 0.0, 0.0], 2)), True),
        (Conditions(fly_by_m=np.ones(4)), False),
    ):
        assert given.given_motion == moving


# -- rows go with their waypoints --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("index", "speeds"),
    [(0, [OPEN, 1, 2, 3]), (1, [1, 1, 2, 3]), (2, [1, 2, 2, 3]), (3, [1, 2, 3, 3]), (4, [1, 2, 3, OPEN])],
)
def test_a_waypoint_inserted_halves_a_leg_and_asks_for_nothing(index, speeds):
    given = Conditions(
        leg_speed_m_s=np.array([1.0, 2.0, 3.0]),
        leg_jerk_m_s3=np.array([10.0, 20.0, 30.0]),
        fly_by_m=np.arange(1.0, 5.0),
        stay_s=np.arange(1.0, 5.0),
        velocity_world_m_s=np.ones((4, 3)),
        gate_edges_m=np.ones((4, 2, 3)),
    ).inserted(index)
    np.testing.assert_array_equal(given.leg_speed_m_s, speeds)
    np.testing.assert_array_equal(given.leg_jerk_m_s3, 10.0 * np.array(speeds))
    np.testing.assert_array_equal(given.fly_by_m, np.insert(np.arange(1.0, 5.0), index, 0.0))
    np.testing.assert_array_equal(given.stay_s, np.insert(np.arange(1.0, 5.0), index, 0.0))
    assert np.isnan(given.velocity_world_m_s).all(axis=1).tolist() == [i == index for i in range(5)]
    assert (given.gate_edges_m == 0.0).all(axis=(1, 2)).tolist() == [i == index for i in range(5)]
    assert Conditions().inserted(index).as_dict() == {}


@pytest.mark.parametrize(
    ("index", "speeds", "open_speeds"),
    [(0, [2, 1], [2, 1]), (1, [2, 1], [2, 1]), (2, [3, 1], [OPEN, 1]), (3, [3, 2], [OPEN, 2])],
)
def test_a_waypoint_deleted_leaves_the_lower_speed_of_two_legs(index, speeds, open_speeds):
    most = np.array([3.0, 2.0, 1.0])
    given = Conditions(leg_speed_m_s=most, leg_jerk_m_s3=most, fly_by_m=np.arange(1.0, 5.0)).deleted(index)
    np.testing.assert_array_equal(given.leg_speed_m_s, speeds)
    np.testing.assert_array_equal(given.leg_jerk_m_s3, speeds)
    np.testing.assert_array_equal(given.fly_by_m, np.delete(np.arange(1.0, 5.0), index))
    one_open = Conditions(leg_speed_m_s=np.array([OPEN, 2.0, 1.0])).deleted(index)
    np.testing.assert_array_equal(one_open.leg_speed_m_s, open_speeds)
    rising = Conditions(leg_speed_m_s=np.array([1.0, 2.0, 3.0])).deleted(index)
    assert rising.leg_speed_m_s.tolist() == [[2, 3], [1, 3], [1, 2], [1, 2]][index]
    assert Conditions().deleted(index).as_dict() == {}


def test_conditions_of_waypoints_stand_at_their_knots(drone):
    waypoint = np.array([0, -1, 1, 2, -1, 3])
    given = Conditions(
        velocity_world_m_s=rows([1.0, 2.0, 3.0], 1),
        fly_by_m=np.array([0.5, 1.0, 0.0, 2.0]),
        gate_edges_m=edges(at_0=LEFT_UP, at_2=2.0 * LEFT_UP),
        leg_speed_m_s=np.array([OPEN, 1.0, 99.0]),
        leg_jerk_m_s3=np.array([7.0, OPEN, 8.0]),
    )
    places = np.arange(12.0).reshape(4, 3)
    asked = given.at_knots(places, waypoint, drone.limits)
    knots = asked["velocity"]
    assert knots.shape == (6, 4)
    assert knots[2].tolist() == [1.0, 2.0, 3.0, 0.0]
    assert np.isnan(np.delete(knots, 2, axis=0)).all()
    at = waypoint >= 0
    balls, openings = asked["balls"], asked["gates"]
    np.testing.assert_array_equal(balls[at, :3], places)
    np.testing.assert_allclose(balls[:, 3], 0.97 * np.array([0.5, 0.0, 1.0, 0.0, 0.0, 2.0]))
    np.testing.assert_array_equal(openings[at, 0], places)
    np.testing.assert_allclose(openings[0, 1:], 0.97 * LEFT_UP)
    np.testing.assert_allclose(openings[3, 1:], 0.97 * 2.0 * LEFT_UP)
    assert (openings[[1, 2, 4, 5], 1:] == 0.0).all()
    first = Conditions(velocity_world_m_s=rows([1.0, 0.0, 0.0], 0)).at_knots(places, waypoint, drone.limits)
    assert first["velocity"][0].tolist() == [1.0, 0.0, 0.0, 0.0]
    assert given.most_on_legs(waypoint)["speed"].tolist() == [np.inf, np.inf, 1.0, 99.0, 99.0]
    assert given.most_on_legs(waypoint)["jerk"].tolist() == [7.0, 7.0, np.inf, 8.0, 8.0]
    assert [most.tolist() for most in Conditions().most_on_legs(waypoint).values()] == [[np.inf] * 5] * 2
    assert set(Conditions().at_knots(places, waypoint, drone.limits).values()) == {None}


def test_the_optimiser_aims_a_little_below_the_limits_of_a_leg_and_never_above_the_vehicles(drone):
    places, waypoint, most = np.zeros((3, 3)), np.array([0, -1, 1, 2]), np.array([2.0, OPEN])
    asked = Conditions(leg_speed_m_s=most).at_knots(places, waypoint, drone.limits)
    np.testing.assert_allclose(asked["speed_m_s"], [1.97, 1.97, drone.limits.speed_m_s])
    assert asked["jerk_m_s3"] is None
    for limited, open_leg in ((drone, np.inf), (drone.with_limits(jerk_m_s3=1.98), 1.98)):
        asked = Conditions(leg_jerk_m_s3=most).at_knots(places, waypoint, limited.limits)
        np.testing.assert_allclose(asked["jerk_m_s3"], [1.97, 1.97, open_leg])
        assert asked["speed_m_s"] is None


# -- what the gate asks ------------------------------------------------------------------------------------------------


def powers(*coefficients: tuple[float, ...], duration_s: float = 1.0) -> Trajectory:
    """Segments along x with these coefficients."""
    c = np.zeros((len(coefficients), 4, 8))
    for i, row in enumerate(coefficients):
        c[i, 0, : len(row)] = row
    return Trajectory(np.full(len(coefficients), duration_s), c)


def verdict(name: str, trajectory, visits=None, **asked):
    return {check.name: check for check in checks(trajectory, visits, Conditions(**asked))}[name]


def at(*times_s: float) -> Visits:
    return Visits(*[np.array(times_s)] * 3)


@pytest.mark.parametrize("derivative", [1, 2, 3])
def test_each_end_is_at_rest_or_in_the_motion_asked_for_to_a_millionth(derivative):
    size = float(np.prod(np.arange(1, derivative + 1)))
    moving = powers(tuple([0.0] * derivative + [0.5]), tuple([0.0] * derivative + [-0.5]))
    for name, value in (("start", 0.5 * size), ("end", None)):
        check = verdict(f"rest at the {name}", moving)
        assert not check.passed
        if value is not None:
            assert check.value == pytest.approx(value)
            asked = motion(derivative - 1, value)
            assert verdict("motion at the start", moving, start=asked).passed
            assert verdict("motion at the start", moving, start=asked + 9e-7).passed
            assert not verdict("motion at the start", moving, start=asked + 2e-6).passed
            assert not verdict("motion at the start", moving, start=-asked).passed


def test_the_end_is_that_of_the_last_segment_in_units_of_its_size():
    ends = powers((1.0, 0.0), (1.0, 1e-6))
    assert verdict("rest at the start", ends).passed
    assert verdict("rest at the end", ends).passed  # just as much as it may
    assert not verdict("rest at the end", powers((1.0, 0.0), (1.0, 1.1e-6))).passed
    assert verdict("rest at the end", powers((100.0, 0.0), (50.0, 4e-5))).passed
    assert not verdict("rest at the end", powers((100.0, 0.0), (50.0, 6e-5))).passed
    assert verdict("rest at the end", powers((1.0, 0.0), (1.0, 0.0), (50.0, 4e-5))).passed
    long = powers((1.0, 0.0), (0.0, 1e-5), duration_s=50.0)
    assert not verdict("rest at the end", long).passed
    assert verdict("rest at the end", long).bound == 1e-6
    # a large coefficient counts as what it is at the segment's end
    quick = powers((0.0,), (0.0, 1.5e-6, 0.0, 1000.0), duration_s=0.1)
    assert verdict("rest at the end", quick).bound == pytest.approx(1e-6)


def test_the_distance_from_the_middle_of_a_tube_is_proved():
    aside = powers((1.0, 1.0))
    aside = Trajectory(aside.durations_s, aside.coefficients + 0.25 * np.eye(8)[0] * np.eye(4)[1][:, None])
    for radius, passed in ((1.0, True), (0.2, False)):
        check = verdict("keep-in", aside, keep_in_world_m=LINE, keep_in_radius_m=radius)
        assert (check.passed, check.bound) == (passed, radius)
        assert 0.25 <= check.value < 0.3  # proved, as closely as the radius needs


def test_a_velocity_is_asked_at_its_own_waypoint():
    path = powers((0.0, 1.0), (1.0, 2.0))
    points = at(0.0, 0.5, 1.5, 2.0)
    for wanted, index, passed in (
        ([1.0, 0.0, 0.0], 1, True),
        ([2.0, 0.0, 0.0], 2, True),
        ([2.0, 1.9e-4, 0.0], 2, True),
        ([2.0, 2.1e-4, 0.0], 2, False),
        ([0.0, 0.0, 0.0], 1, False),
        ([-1.0, 0.0, 0.0], 1, False),
    ):
        check = verdict("velocity at waypoints", path, points, velocity_world_m_s=rows(wanted, index))
        assert check.passed == passed, wanted
    both = rows([1.0, 0.0, 0.0], 1)
    both[2] = [0.0, 0.0, 0.0]
    check = verdict("velocity at waypoints", path, points, velocity_world_m_s=both)
    assert (check.passed, check.value, check.time_s) == (False, 2.0, 1.5)
    assert check.reason == "largest difference at waypoint 3"
    still = powers((0.0, 0.01), (0.01, 0.01))
    slow = verdict("velocity at waypoints", still, points, velocity_world_m_s=rows([0.01, 0.0, 0.0], 1))
    assert slow.bound == pytest.approx(1e-4)
    just_so = verdict(
        "velocity at waypoints", powers((0.0,), (0.0,)), points, velocity_world_m_s=rows([slow.bound, 0.0, 0.0], 1)
    )
    assert (just_so.passed, just_so.value) == (True, slow.bound)
    nothing = {check.name for check in checks(path, points, Conditions(velocity_world_m_s=np.full((4, 3), OPEN)))}
    assert "velocity at waypoints" not in nothing


def test_a_join_stands_for_a_visit_that_it_belongs_to():
    path = powers((0.0, 1.0), (1.0, 2.0))
    times = np.array([0.0, 0.9, 1.1, 1.25, 2.0])
    visits = Visits(
        times, times - np.array([0.0, 0.2, 0.0995, 0.2, 0.0]), times + np.array([0.0, 0.0995, 0.2, 0.2, 0.0])
    )
    assert visits.joins_s(path).tolist() == [0.0, 1.0, 1.0, 1.25, 2.0]
    narrow = Visits(times, times - 0.098, times + 0.098)
    assert narrow.joins_s(path).tolist() == [0.0, 0.9, 1.1, 1.25, 2.0]


def test_each_leg_has_its_own_largest_speed():
    path = powers((0.0, 1.0), (1.0, 3.0), (4.0, 2.0))
    points = at(0.0, 1.0, 2.0, 3.0)
    for speeds, passed in (
        ((1.0, 3.0, 2.0), True),
        ((OPEN, 3.0, OPEN), True),
        ((0.99, 3.0, 2.0), False),
        ((1.0, 2.99, 2.0), False),
        ((1.0, 3.0, 1.99), False),
    ):
        check = verdict("speed of legs", path, points, leg_speed_m_s=np.array(speeds))
        assert check.passed == passed, speeds
    check = verdict("speed of legs", path, points, leg_speed_m_s=np.array([0.9, 1.5, 1.9]))
    assert (check.value, check.bound, check.segment) == (pytest.approx(3.0), 1.5, 1)
    assert check.reason.startswith("leg from waypoint 2 at 1.")
    check = verdict("speed of legs", path, at(0.0, 1.0, 1.5), leg_speed_m_s=np.array([3.0, 1.9]))
    assert (check.passed, check.bound) == (False, 1.9)  # behind the last visit too
    nothing = {check.name for check in checks(path, points, Conditions(leg_speed_m_s=np.full(3, OPEN)))}
    assert "speed of legs" not in nothing


def test_each_leg_has_its_own_largest_jerk():
    path = powers((0.0, 0.0, 0.0, 1.0), (1.0, 3.0, 3.0, 3.0), (10.0, 18.0, 12.0, 2.0))  # jerk is 6 times the last
    points = at(0.0, 1.0, 2.0, 3.0)
    for jerks, passed in (
        ((6.001, 18.001, 12.001), True),
        ((OPEN, 18.001, OPEN), True),
        ((5.999, 18.001, 12.001), False),
        ((6.001, 17.999, 12.001), False),
        ((6.001, 18.001, 11.999), False),
    ):
        check = verdict("jerk of legs", path, points, leg_jerk_m_s3=np.array(jerks))
        assert check.passed == passed, jerks
    check = verdict("jerk of legs", path, points, leg_jerk_m_s3=np.array([5.0, 2.0, 11.0]))
    assert (check.value, check.bound, check.segment) == (pytest.approx(18.0), 2.0, 1)
    assert check.reason.startswith("leg from waypoint 2 at 1.")
    assert check.reason.endswith(": 18 m/s3, asked for at most 2")


def test_within_a_radius_the_faster_of_two_legs_counts_and_behind_it_the_later_one():
    path = powers((0.0, 1.0), (1.0, 3.0), (4.0, 3.0), (7.0, 1.0))
    radius = Visits(np.array([0.0, 2.0, 4.0]), np.array([0.0, 1.0, 4.0]), np.array([0.0, 3.0, 4.0]))
    for first, later, passed in (
        (3.0, 1.0, True),
        (1.0, 3.0, True),
        (2.9, 1.0, False),
        (1.0, 2.9, False),
        (3.0, 0.9, False),
    ):
        check = verdict("speed of legs", path, radius, leg_speed_m_s=np.array([first, later]))
        assert check.passed == passed, (first, later)


def hovers(*segments: tuple[float, bool], turning: bool = False) -> Trajectory:
    """Segments of a duration that either rest or move on by a metre."""
    durations = np.array([duration for duration, _ in segments])
    c = np.zeros((len(segments), 4, 8))
    c[:, 0, 1] = [0.0 if rests else 1.0 / duration for duration, rests in segments]
    c[1:, 0, 0] = np.cumsum([0.0 if rests else 1.0 for _, rests in segments])[:-1]
    if turning:
        c[:, 3, 2] = 0.1
    return Trajectory(durations, c)


@pytest.mark.parametrize(
    ("visit_s", "stay_s", "passed"),
    [
        (2.0, 3.0, True),
        (2.0, 3.0 + 9e-7, True),
        (2.0, 3.0 + 2e-6, False),
        (3.5, 3.0, True),
        (5.0, 3.0, True),
        (1.91, 3.0, True),
        (1.89, 3.0, False),
        (5.09, 3.0, True),
        (5.11, 3.0, False),
    ],
)
def test_a_stay_is_the_rest_that_its_visit_touches(visit_s, stay_s, passed):
    path = hovers((2.0, False), (3.0, True), (2.0, False), (4.0, True))
    check = verdict("stays", path, at(0.0, visit_s, 7.0), stay_s=np.array([0.0, stay_s, 0.0]))
    assert check.passed == passed


def test_the_longest_lack_of_a_stay_is_told_and_a_turn_is_no_stay():
    path = hovers((2.0, False), (3.0, True), (2.0, False), (4.0, True))
    check = verdict("stays", path, at(0.0, 2.0, 7.0), stay_s=np.array([0.0, 3.5, 6.0]))
    assert (check.passed, check.value, check.time_s) == (False, 2.0, 7.0)
    assert check.reason == "waypoint 3: 4.00 s of 6.00 s"
    assert verdict("stays", path, at(0.0, 2.0, 7.0), stay_s=np.array([0.0, 3.0, 4.0])).passed
    turning = hovers((2.0, False), (3.0, True), (2.0, False), turning=True)
    assert not verdict("stays", turning, at(0.0, 2.0, 7.0), stay_s=np.array([0.0, 3.0, 0.0])).passed
