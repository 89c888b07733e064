import itertools

import numpy as np
import pytest

import esdf
import planner
from esdf import solids
from flight import InfeasibleError, InputError, Waypoints, rotations
from planner import PlanInfeasibleError, PlanOptions
from vehicle import flatness


def dense_clearance(plan, field) -> float:
    return float(field.distance(plan.trajectory.position(plan.trajectory.sample(0.001))).min())


def length(plan) -> float:
    points = plan.trajectory.position(plan.trajectory.sample(0.002))
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


def test_waypoints_are_hit_in_the_open(open_sky, drone, through):
    waypoints = through((0, 0, 1), (4, 0, 2), (4, 4, 1), (0, 4, 2))
    plan = planner.plan(waypoints, open_sky, drone)
    t = plan.trajectory.sample(0.0005)
    position = plan.trajectory.position(t)
    for waypoint in waypoints.positions_world_m:
        assert np.linalg.norm(position - waypoint, axis=1).min() < 0.01
    assert plan.method == "direct"
    assert plan.gate.passed


def test_waypoints_a_centimetre_apart_are_refused_in_words(open_sky, drone, through):
    with pytest.raises(InputError, match="too close together"):
        planner.plan(through((0, 0, 1), (3, 0, 1), (3.01, 0, 1), (3.01, 3, 1.2)), open_sky, drone)


def test_some_limit_is_used_to_the_full(open_sky, drone, through):
    plan = planner.plan(through((0, 0, 1), (4, 0, 2), (4, 4, 1), (0, 4, 2)), open_sky, drone)
    assert not planner.gate.gate.check(plan.trajectory.scale_time(0.97), open_sky, drone).passed


def test_what_is_flown_is_within_two_percent_of_the_optimum(open_sky, drone):
    for seed in range(4):
        points = np.cumsum(np.random.default_rng(seed).normal(size=(6, 3)) * [3.0, 3.0, 0.7], axis=0)
        plan = planner.plan(Waypoints(points, np.full(6, np.nan)), open_sky, drone)
        assert plan.trajectory.duration_s < 1.02 * plan.optimum_s
        assert len(plan.binding) == len(plan.trajectory.durations_s)
        assert set(plan.binding) - {""}


def test_pieces_are_kept_however_many_waypoints_there_are(open_sky, drone):
    points = np.stack([2.5 * np.arange(30), np.sin(np.arange(30)), np.ones(30)], axis=1)
    plan = planner.plan(Waypoints(points, np.full(30, np.nan)), open_sky, drone)
    assert len(plan.trajectory.durations_s) > 30


def test_a_plan_can_be_cancelled(open_sky, drone, through):
    flag = planner.StopFlag()
    flag.set()
    with pytest.raises(planner.PlanCancelledError):
        planner.plan(through((0, 0, 1), (3, 0, 1)), open_sky, drone, stop=flag)


@pytest.mark.parametrize("margin", [0.1, 0.4, 0.9])
def test_a_plan_stays_clear_of_the_pillar(pillar, drone, through, margin):
    options = PlanOptions(radius_m=0.15, margin_m=margin)
    plan = planner.plan(through((-4, 0, 1.5), (4, 0.1, 1.5)), pillar, drone, options)
    assert dense_clearance(plan, pillar) >= options.clearance_m
    assert plan.gate.clearance_m <= dense_clearance(plan, pillar) + 1e-6


def test_more_clearance_never_makes_a_shorter_path(pillar, drone, through):
    lengths = [
        length(planner.plan(through((-4, 0, 1.5), (4, 0.1, 1.5)), pillar, drone, PlanOptions(margin_m=m)))
        for m in (0.05, 0.4, 0.8, 1.2)
    ]
    assert all(b > a for a, b in itertools.pairwise(lengths))


def test_the_doorway_is_found_and_flown(two_rooms, drone, through):
    plan = planner.plan(through((-3, -2, 1), (3, -2, 1)), two_rooms, drone)
    assert len(plan.route_world_m) > 2
    assert dense_clearance(plan, two_rooms) >= 0.339
    crossing = plan.trajectory.position(plan.trajectory.sample(0.001))
    at_wall = crossing[np.abs(crossing[:, 0]) < 0.1]
    assert (at_wall[:, 1] > 1.5).all()
    assert (at_wall[:, 1] < 2.5).all()


def test_the_corridor_method_keeps_the_same_promise_without_a_stop(two_rooms, drone, through):
    ask = through((-3, -2, 1), (3, -2, 1))
    boxed = planner.plan(ask, two_rooms, drone, PlanOptions(method="corridor"))
    assert boxed.method == "corridor"
    assert boxed.gate.passed
    assert dense_clearance(boxed, two_rooms) >= 0.339
    assert boxed.trajectory.duration_s < 1.2 * planner.plan(ask, two_rooms, drone).trajectory.duration_s
    inner = boxed.trajectory.starts_s[1:-1]
    assert np.linalg.norm(boxed.trajectory.position(inner, 1), axis=1).min() > 0.5


def test_least_snap_in_the_boxes_is_the_last_resort_and_stops_nowhere(two_rooms, drone, through, monkeypatch):
    monkeypatch.setattr(planner.optimise.fastest, "until_flyable", lambda *_, **__: None)
    plan = planner.plan(through((-3, -2, 1), (3, -2, 1)), two_rooms, drone)
    assert plan.method == "corridor"
    assert dense_clearance(plan, two_rooms) >= 0.339
    inner = plan.trajectory.starts_s[1:-1]
    assert np.linalg.norm(plan.trajectory.position(inner, 1), axis=1).min() > 0.1


def test_a_quadratic_program_without_an_answer_is_refused_with_a_remedy(two_rooms, drone, through, monkeypatch):
    def fails(self, durations_s, stop):
        raise InfeasibleError("no answer")

    monkeypatch.setattr(planner.optimise.fastest, "until_flyable", lambda *_, **__: None)
    monkeypatch.setattr(planner.optimise.repair.quadratic.SnapProgram, "solve", fails)
    with pytest.raises(PlanInfeasibleError, match="no answer; lower margin_m"):
        planner.plan(through((-3, -2, 1), (3, -2, 1)), two_rooms, drone)


def test_a_waypoint_at_hardly_more_than_the_required_distance_can_be_passed(pillar, drone, through):
    plan = planner.plan(through((-4, -2, 1), (0, -0.943001, 1.5), (4, -2, 1)), pillar, drone)
    assert plan.gate.passed


def test_a_way_far_round_is_found(drone, through):
    long_wall = solids.Scene([solids.Room((-30, -30, 0), (30, 30, 3)), solids.Box((-0.1, -31, -1), (0.1, 12, 4))])
    plan = planner.plan(through((-2, 0, 1), (2, 0, 1)), long_wall, drone)
    assert dense_clearance(plan, long_wall) >= 0.339
    assert plan.trajectory.position(plan.trajectory.sample(0.01))[:, 1].max() > 12.0


def test_a_sampled_field_gives_the_same_promise_as_the_formula(two_rooms, drone, through):
    grid = esdf.Grid(np.array([-5.3, -4.3, -0.3]), (0.1, 0.1, 0.1), (106, 86, 36))
    field = esdf.build(esdf.rasterize(two_rooms, grid), grid)
    plan = planner.plan(through((-3, -2, 1), (3, -2, 1)), field, drone)
    assert plan.gate.map_hash == field.hash
    assert dense_clearance(plan, field) >= 0.339
    assert dense_clearance(plan, two_rooms) >= 0.339 - 0.05 * np.sqrt(3)  # rasterized: half a voxel's diagonal


def test_asked_headings_are_met_and_yaw_turns_the_short_way(open_sky, drone):
    yaw = np.array([3.0, np.nan, -3.0, 0.5])
    waypoints = Waypoints(np.array([[0.0, 0, 1], [-3, 0, 1], [-6, 0, 1], [-6, 4, 1]]), yaw)
    plan = planner.plan(waypoints, open_sky, drone, PlanOptions(yaw="smooth"))
    t = plan.trajectory.sample(0.001)
    values = plan.trajectory.evaluate(t)
    for point, wanted in zip(waypoints.positions_world_m, yaw, strict=True):
        if np.isfinite(wanted):
            at = values[np.linalg.norm(values[:, :3] - point, axis=1).argmin(), 3]
            assert abs(np.angle(np.exp(1j * (at - wanted)))) < 0.02
    between = values[np.linalg.norm(values[:, :3] - waypoints.positions_world_m[1], axis=1).argmin(), 3]
    assert abs(between - np.pi) < 0.6  # not round by zero


def test_the_vehicle_looks_along_the_path_where_it_may(open_sky, drone, through):
    plan = planner.plan(through((0, 0, 1), (8, 0, 1), (16, 3, 1), (24, 3, 1)), open_sky, drone)
    t = plan.trajectory.sample(0.01)
    velocity = plan.trajectory.position(t, 1)
    fast = np.linalg.norm(velocity[:, :2], axis=1) > 3.0
    q = flatness.state(drone, plan.trajectory, t[fast]).q_world_body
    forward = rotations.rotate(q, np.array([1.0, 0.0, 0.0]))
    course = velocity[fast] / np.linalg.norm(velocity[fast], axis=1)[:, None]
    cosine = (forward[:, :2] * course[:, :2]).sum(axis=1) / np.linalg.norm(forward[:, :2], axis=1)
    assert np.degrees(np.arccos(np.clip(cosine, -1, 1))).max() < 15.0


def test_a_straight_climb_has_a_plan(open_sky, drone, through):
    plan = planner.plan(through((0, 0, 1), (0, 0, 4)), open_sky, drone)
    assert np.abs(plan.trajectory.position(plan.trajectory.sample(0.01))[:, :2]).max() < 0.05


def test_the_same_inputs_give_the_same_plan(pillar, drone, through):
    ask = through((-4, 0, 1), (0, 3, 2), (4, 0.1, 1))
    one, other = planner.plan(ask, pillar, drone), planner.plan(ask, pillar, drone)
    assert one.gate.trajectory_hash == other.gate.trajectory_hash


def test_progress_reaches_the_end_and_never_goes_back(open_sky, drone, through):
    seen: list[float] = []
    planner.plan(through((0, 0, 1), (3, 0, 1)), open_sky, drone, progress=lambda stage, f: seen.append(f))
    assert seen == sorted(seen)
    assert seen[-1] == 1.0


def refusal(points, field, drone, error=InputError, **options) -> str:
    with pytest.raises(error) as caught:
        planner.plan(Waypoints(np.array(points, dtype=float), np.full(len(points), np.nan)), field, drone,
                     PlanOptions(**options))  # fmt: skip
    text = str(caught.value)
    assert "\n" not in text
    return text


def test_one_waypoint_is_refused(pillar, drone):
    assert "at least two" in refusal([[2, 2, 1]], pillar, drone)


def test_waypoints_in_one_place_are_refused_by_number(pillar, drone):
    assert "waypoints 2 and 3" in refusal([[2, 2, 1], [3, 3, 1], [3, 3, 1]], pillar, drone)


def test_a_nan_waypoint_is_refused_by_number(pillar, drone):
    assert "waypoint 2" in refusal([[2, 2, 1], [np.nan, 3, 1]], pillar, drone)


def test_a_waypoint_inside_an_obstacle_is_refused_with_depth_and_the_nearest_free_point(pillar, drone):
    text = refusal([[-3, 0, 1], [0.4, 0, 1.5], [3, 0, 1]], pillar, drone)
    assert "waypoint 2" in text
    assert "0.20 m inside an obstacle or beyond a wall" in text
    named = np.array([float(x) for x in text.split("near (")[1].split(")")[0].split(",")])
    assert pillar.distance(named[None])[0] >= 0.29
    assert np.linalg.norm(named - [0.9, 0.0, 1.5]) < 0.15


def test_a_waypoint_too_near_an_obstacle_is_refused_with_both_distances(pillar, drone):
    text = refusal([[-3, 0, 1], [0.8, 0, 1.5], [3, 0, 1]], pillar, drone)
    assert "0.200 m from an obstacle or unknown space, 0.343 m are required" in text


def test_a_waypoint_outside_the_map_or_in_the_unknown_is_refused(pillar, drone):
    grid = esdf.Grid(np.array([-3.0, -3.0, 0.0]), (0.1, 0.1, 0.1), (60, 60, 30))
    state = esdf.rasterize(pillar, grid)
    state[40:, :10] = esdf.UNKNOWN
    for policy in ("obstacle", "nan"):
        field = esdf.build(state, grid, unknown=policy)
        outside = refusal([[-2, 0, 1], [9, 0, 1]], field, drone)
        assert "waypoint 2 at (9.00, 0.00, 1.00) is in unknown space or outside of the map" in outside
        assert "waypoint 2" in refusal([[-2, 0, 1], [2, -2.8, 1]], field, drone)


def test_a_room_without_a_door_says_between_which_waypoints(drone):
    scene = solids.Scene([solids.Room((-3, -3, 0), (3, 3, 2.5)), solids.Box((-0.1, -3.1, 0), (0.1, 3.1, 2.6))])
    with pytest.raises(PlanInfeasibleError) as caught:
        planner.plan(Waypoints(np.array([[-2.0, 0, 1], [-1.5, 1, 1], [2.0, 0, 1]]), np.full(3, np.nan)), scene, drone)
    assert caught.value.segment == 1
    assert "between waypoints 2 and 3" in str(caught.value)
    assert caught.value.remedy


def test_a_vehicle_that_cannot_hover_is_refused(open_sky, drone, through):
    weak = drone.with_limits(rotor_speed_min_rad_s=100.0, rotor_speed_max_rad_s=500.0)
    with pytest.raises(PlanInfeasibleError, match="hover"):
        planner.plan(through((0, 0, 1), (3, 0, 1)), open_sky, weak)


@pytest.mark.parametrize(
    "wrong", [{"radius_m": -1.0}, {"margin_m": np.nan}, {"pieces": 0}, {"method": "x"}, {"sample_step_s": 0.0}]
)
def test_options_that_make_no_sense_are_refused(wrong):
    with pytest.raises(InputError):
        PlanOptions(**wrong)
