import dataclasses
import json

import numpy as np
import pytest

import planner
from esdf import solids
from flight import FormatError, InputError, Trajectory, Waypoints, trajectory
from flight.trajectory import fingerprint
from planner.gate import gate, visits


@pytest.fixture(scope="module")
def good(pillar, drone):
    waypoints = planner.planning.Waypoints(np.array([[-3.0, 0.2, 1.0], [0.0, 2.0, 1.5], [3.0, 0, 1.2]]), np.zeros(3))
    return planner.plan(waypoints, pillar, drone)


def failed(plan, changed: Trajectory, field, drone, **options) -> set[str]:
    report = gate.check(
        changed, field, drone, planner.PlanOptions(**options), waypoints_world_m=plan.waypoints.positions_world_m
    )
    assert report.passed == (not report.failures)
    return {check.name for check in report.failures}


def test_a_planned_trajectory_passes_every_check(good, pillar, drone):
    assert good.gate.passed
    assert failed(good, good.trajectory, pillar, drone) == set()
    assert good.gate.clearance_m >= 0.339
    assert len(good.gate.checks) == 17


@pytest.mark.parametrize("power", range(1, 8))
def test_a_changed_coefficient_is_caught(good, pillar, drone, power):
    c = good.trajectory.coefficients.copy()
    i = len(c) // 2
    c[i, 1, power] += 0.02 / good.trajectory.durations_s[i] ** power
    assert "position at joins" in failed(good, Trajectory(good.trajectory.durations_s, c), pillar, drone)


def test_a_shift_of_everything_misses_the_waypoints(good, pillar, drone):
    c = good.trajectory.coefficients.copy()
    c[:, 0, 0] += 0.03
    assert failed(good, Trajectory(good.trajectory.durations_s, c), pillar, drone) == {"waypoints"}


def test_a_wrong_duration_is_caught(good, pillar, drone):
    T = good.trajectory.durations_s.copy()
    T[1] *= 1.05
    assert "position at joins" in failed(good, Trajectory(T, good.trajectory.coefficients), pillar, drone)
    T = good.trajectory.durations_s.copy()
    T[-1] *= 0.9
    assert "rest at the end" in failed(good, Trajectory(T, good.trajectory.coefficients), pillar, drone)


def test_a_pillar_that_was_not_there_before_is_caught_where_it_stands(good, pillar, drone):
    middle = good.trajectory.position(np.array([0.5 * good.trajectory.duration_s]))[0]
    scene = solids.Scene([*pillar.solids, solids.Cylinder((middle[0], middle[1], 1.5), 0.05, 3.0)])
    report = gate.check(good.trajectory, scene, drone)
    assert [c.name for c in report.failures] == ["clearance"]
    assert np.linalg.norm(np.array(report.clearance_point_world_m[:2]) - middle[:2]) < 0.1
    assert report.clearance_m < 0.0


def test_more_required_clearance_than_there_is_fails(good, pillar, drone):
    assert failed(good, good.trajectory, pillar, drone, margin_m=5.0) == {"clearance"}


def test_flying_faster_fails_on_limits_only(good, pillar, drone):
    names = failed(good, good.trajectory.scale_time(0.8), pillar, drone)
    assert names
    assert names <= {"speed", "acceleration", "tilt", "roll and pitch rate", "yaw rate", "rotor speed", "slowest rotor"}


def test_waypoints_in_another_order_are_not_reached(good, pillar, drone):
    points = good.waypoints.positions_world_m
    report = gate.check(good.trajectory, pillar, drone, waypoints_world_m=points[[0, 2, 1, 2]])
    assert [c.name for c in report.failures] == ["waypoints"]
    missing = np.vstack([points[:2], [[1.0, 1.0, 1.0]], points[2:]])
    report = gate.check(good.trajectory, pillar, drone, waypoints_world_m=missing)
    assert "waypoint 3" in report.failures[0].reason


def test_a_waypoint_is_reached_at_the_nearest_point_of_the_first_visit_however_long_that_lasts():
    """Three thousand samples creep by at less than the tolerance: more than are looked at together."""
    points = np.concatenate([np.full(500, 1.0), np.linspace(0.009, -0.009, 3000), np.full(500, 1.0), np.zeros(5)])
    points = np.stack([points, np.zeros(4005), np.zeros(4005)], axis=1)
    index, gap_m = visits.first_visit(points, 0, np.zeros(3), 0.01)
    assert index in (1999, 2000)
    assert gap_m < 1e-5
    assert visits.first_visit(points, 3600, np.zeros(3), 0.01) == (4000, 0.0)
    assert visits.first_visit(points, 0, np.ones(3), 0.01) is None


def test_starting_in_flight_is_caught(good, pillar, drone):
    _, rest = good.trajectory.split(0.3 * good.trajectory.duration_s)
    assert "rest at the start" in failed(good, rest, pillar, drone)


def smuggled(item: Trajectory, **arrays) -> Trajectory:
    """A trajectory changed behind the back of its own checks."""
    copy = Trajectory(item.durations_s.copy(), item.coefficients.copy())
    for name, value in arrays.items():
        object.__setattr__(copy, name, value)
    return copy


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_what_is_not_finite_is_caught_without_a_crash(good, pillar, drone, value):
    c = good.trajectory.coefficients.copy()
    c[1, 2, 3] = value
    assert failed(good, smuggled(good.trajectory, coefficients=c), pillar, drone) == {"finite"}
    T = good.trajectory.durations_s.copy()
    T[0] = value
    assert failed(good, smuggled(good.trajectory, durations_s=T), pillar, drone) == {"finite"}


def test_a_clock_that_does_not_fit_the_durations_is_caught(good, pillar, drone):
    starts = good.trajectory.starts_s * 0.99
    assert failed(good, smuggled(good.trajectory, starts_s=starts), pillar, drone) == {"finite"}


class KnowsNothing:
    def distance(self, points):
        return np.full(len(points), np.nan)


class Breaks:
    def distance(self, points):
        raise InputError("the map is gone")


@pytest.mark.parametrize("field", [KnowsNothing(), Breaks()])
def test_a_field_that_is_unknown_everywhere_fails_the_gate(good, drone, field):
    report = gate.check(good.trajectory, field, drone)
    assert [c.name for c in report.failures] == ["clearance"]
    assert report.as_dict()["clearance_m"] is None


def test_the_report_is_json_and_survives_the_file(good, tmp_path):
    json.dumps(good.gate.as_dict(), allow_nan=False)
    planner.save_plan(tmp_path / "a.json", good, name="a")
    read = trajectory.load(tmp_path / "a.json")
    assert read.checked
    assert read.vehicle_hash == good.gate.vehicle_hash
    assert np.array_equal(read.trajectory.coefficients, good.trajectory.coefficients)
    assert fingerprint(read.trajectory) == read.check["trajectory_hash"]


def test_a_failed_plan_is_never_saved(good, pillar, drone, tmp_path):
    report = gate.check(good.trajectory, pillar, drone, planner.PlanOptions(margin_m=3.0))
    bad = dataclasses.replace(good, gate=report)
    with pytest.raises(InputError, match="clearance"):
        planner.save_plan(tmp_path / "a.json", bad, name="a")
    assert not list(tmp_path.iterdir())


def test_a_plan_changed_after_its_check_is_never_saved(good, tmp_path):
    swapped = dataclasses.replace(good, trajectory=good.trajectory.scale_time(1.5))
    with pytest.raises(InputError, match="changed after"):
        planner.save_plan(tmp_path / "a.json", swapped, name="a")
    assert not list(tmp_path.iterdir())


def test_a_file_is_good_for_its_own_map_and_vehicle_only(good, pillar, drone, tmp_path):
    planner.save_plan(tmp_path / "a.json", good, name="a")
    item = trajectory.load(tmp_path / "a.json")
    assert gate.check_file(item, pillar, drone).passed
    heavier = drone.with_value("mass_kg", 0.701)
    assert [c.name for c in gate.check_file(item, pillar, heavier).failures] == ["vehicle"]
    other = dataclasses.replace(item, map_hash="another")
    assert [c.name for c in gate.check_file(other, pillar, drone).failures] == ["record", "map"]


@pytest.mark.parametrize("derivative", range(4))
@pytest.mark.parametrize(("share", "caught"), [(0.3, False), (30.0, True)])
def test_a_jump_is_caught_from_one_millionth_of_the_largest_value_on(good, pillar, drone, derivative, share, caught):
    """Polynomials that vanish with three derivatives at the segment's end leave one jump, at its start."""
    path = good.trajectory
    c, i = path.coefficients.copy(), len(path.durations_s) // 2
    largest = np.abs(path.evaluate(path.starts_s, derivative)).max()
    T = path.durations_s[i]
    other = np.delete(np.arange(4), derivative)
    rows = [[0.0] * 8 for _ in range(8)]
    for n, (u, r) in enumerate([*[(0.0, r) for r in range(4)], *[(1.0, r) for r in range(4)]]):
        for power in range(r, 8):
            rows[n][power] = np.prod(np.arange(power, power - r, -1.0)) * u ** (power - r) / T**r
    wanted = np.zeros(8)
    wanted[derivative] = share * 1e-6 * max(1.0, largest)
    assert np.all(wanted[other] == 0.0)
    c[i, 0] += np.linalg.solve(np.array(rows), wanted) / T ** np.arange(8)
    names = failed(good, Trajectory(path.durations_s, c), pillar, drone)
    joins = {name for name in names if name.endswith("at joins")}
    assert joins == ({f"{('position', 'velocity', 'acceleration', 'jerk')[derivative]} at joins"} if caught else set())


def test_a_file_is_checked_for_the_radius_margin_limits_and_reserve_it_records(pillar, drone, tmp_path):
    ask = Waypoints(np.array([[-4.0, -2.0, 1.0], [4.0, -2.0, 1.5]]), np.full(2, np.nan))
    options = planner.PlanOptions(
        radius_m=0.1, margin_m=0.35, control_reserve=0.2, limits=drone.with_limits(speed_m_s=4.0).limits
    )
    planner.save_plan(tmp_path / "a.json", planner.plan(ask, pillar, drone, options), name="a")
    item = trajectory.load(tmp_path / "a.json")
    again = gate.check_file(item, pillar, drone)
    assert again.passed
    assert (again.required_clearance_m, again.body_radius_m) == (pytest.approx(0.45), 0.1)
    bounds = {check.name: check.bound for check in again.checks}
    assert bounds["speed"] == 4.0
    assert bounds["rotor speed"] == pytest.approx(options.limits_for(drone).rotor_speed_max_rad_s)
    assert gate.options_of(item).limits == options.limits
    for wrong in ({"radius_m": "wide"}, {**item.check["asked"], "look_at_world_m": [1.0]}, [1]):
        with pytest.raises(FormatError, match="damaged"):
            gate.options_of(dataclasses.replace(item, check={**item.check, "asked": wrong}))
    damaged = dataclasses.replace(item, check={**item.check, "asked": {"radius_m": "wide"}})
    with pytest.raises(FormatError, match="damaged"):
        gate.check_file(damaged, pillar, drone)
    assert gate.options_of(dataclasses.replace(item, check={})) == planner.PlanOptions()


def test_headings_yaw_mode_and_tolerance_travel_with_the_file_and_are_checked_again(pillar, drone, tmp_path):
    points = np.array([[-4.0, -2.0, 1.0], [0.0, -3.0, 1.2], [4.0, -2.0, 1.5]])
    options = planner.PlanOptions(yaw="smooth", waypoint_tolerance_m=0.02)
    plan = planner.plan(Waypoints(points, np.array([0.0, 1.0, np.nan])), pillar, drone, options)
    planner.save_plan(tmp_path / "a.json", plan, name="a")
    item = trajectory.load(tmp_path / "a.json")
    assert gate.check_file(item, pillar, drone).passed
    assert (gate.options_of(item).yaw, gate.options_of(item).waypoint_tolerance_m) == ("smooth", 0.02)
    np.testing.assert_array_equal(gate.headings_of(item), [0.0, 1.0, np.nan])
    turned = item.trajectory.coefficients.copy()
    turned[:, 3, 0] += 0.3
    off = dataclasses.replace(item, trajectory=Trajectory(item.trajectory.durations_s, turned))
    failures = {check.name for check in gate.check_file(off, pillar, drone).failures}
    assert failures >= {"heading at waypoints", "trajectory"}
    for wrong in ([0.0], ["north", 0.0, 0.0], 3.0):
        with pytest.raises(FormatError, match="headings"):
            gate.check_file(dataclasses.replace(item, check={**item.check, "yaw_rad": wrong}), pillar, drone)


def test_a_point_that_is_looked_at_travels_with_the_file(pillar, drone):
    points = np.array([[-4.0, -2.0, 1.0], [4.0, -2.0, 1.5]])
    options = planner.PlanOptions(yaw="look_at", look_at_world_m=(0.0, 0.0, 1.0))
    item = planner.trajectory_file(
        planner.plan(Waypoints(points, np.full(2, np.nan)), pillar, drone, options), name="a"
    )
    names = {check.name for check in gate.check_file(item, pillar, drone).checks}
    assert "look at the point" in names
    elsewhere = {**item.check, "asked": {**item.check["asked"], "look_at_world_m": [0.0, -9.0, 1.0]}}
    report = gate.check_file(dataclasses.replace(item, check=elsewhere), pillar, drone)
    assert [check.name for check in report.failures] == ["look at the point", "record"]


def test_the_radius_is_the_vehicles_own_unless_one_is_given(good, pillar, drone):
    assert good.gate.body_radius_m == pytest.approx(0.189)
    assert 0.0 <= good.gate.body_radius_m - drone.reach_m < 1e-3
    large = dataclasses.replace(drone, hub_body_m=2.0 * drone.hub_body_m)
    assert gate.check(good.trajectory, pillar, large).body_radius_m == pytest.approx(0.314)
    assert gate.check(good.trajectory, pillar, large, planner.PlanOptions(radius_m=0.2)).body_radius_m == 0.2
    with pytest.raises(InputError, match="left to the vehicle"):
        _ = planner.PlanOptions().clearance_m


def test_a_vehicle_that_reaches_beyond_the_clearance_is_refused_and_never_passes(good, pillar, drone):
    large = dataclasses.replace(drone, hub_body_m=3.0 * drone.hub_body_m)
    assert large.reach_m == pytest.approx(3.0 * 0.12516 + 0.0635, abs=1e-4)
    options = planner.PlanOptions(radius_m=0.15)
    with pytest.raises(InputError, match=r"reach 0\.439 m .* beyond the clearance of 0\.300 m .* raise radius_m"):
        planner.plan(good.waypoints, pillar, large, options)
    report = gate.check(good.trajectory, pillar, large, options)
    assert "raise radius_m" in {check.name: check.reason for check in report.failures}["clearance"]
    assert "clearance" not in failed(good, good.trajectory, pillar, drone)


def test_progress_of_a_check_rises_to_one(good, pillar, drone, tmp_path):
    told: list[float] = []
    planner.save_plan(tmp_path / "a.json", good, name="a")
    item = trajectory.load(tmp_path / "a.json")
    gate.check_file(item, pillar, drone, progress=lambda _, fraction: told.append(fraction))
    assert len(told) > 1
    assert told == sorted(told)
    assert told[-1] == 1.0
