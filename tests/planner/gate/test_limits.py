import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import planner
import vehicle
from esdf.solids import Room
from flight import Waypoints
from planner import PlanOptions
from planner.curve import minimum_snap
from planner.gate import limits
from planner.optimise import repair
from vehicle import flatness


def some_path(seed: int, pace: float = 1.0):
    rng = np.random.default_rng(seed)
    positions = np.cumsum(rng.normal(size=(6, 4)) * [2, 2, 0.5, 0.3], axis=0)
    return minimum_snap.trajectory(minimum_snap.solve(positions, pace * rng.uniform(1.5, 2.5, 5)))


@settings(max_examples=25)
@given(st.integers(0, 10_000), st.sampled_from([1, 2, 3]))
def test_the_certified_maxima_bound_every_sample_of_their_segment_and_are_tight(seed, derivative):
    path = some_path(seed)
    bounds, times_s = limits.certified_maxima(path, derivative)
    for bound, time_s, start, end in zip(bounds, times_s, path.starts_s[:-1], path.starts_s[1:], strict=True):
        seen = np.linalg.norm(path.position(np.linspace(start, end, 1001), derivative), axis=1)
        assert seen.max() <= bound * (1 + 1e-9)
        assert bound <= 1.01 * seen.max() + 1e-3 * bounds.max()
        assert start <= time_s <= end


def test_sampled_checks_bound_what_lies_between_their_samples(drone):
    path = some_path(3)
    coarse = {c.name: c.value for c in limits.check(path, drone, step_s=0.02)}
    state = flatness.state(drone, path, path.sample(0.0007))
    assert state.tilt_rad.max() <= coarse["tilt"] * (1 + 1e-6)
    assert np.hypot(*state.rate_body_rad_s[:, :2].T).max() <= coarse["roll and pitch rate"] * (1 + 1e-4)
    assert np.abs(state.rate_body_rad_s[:, 2]).max() <= coarse["yaw rate"] * (1 + 1e-4)
    assert state.rotor_speed_rad_s.max() <= coarse["rotor speed"] * (1 + 1e-4)
    assert state.rotor_speed_rad_s.min() >= coarse["slowest rotor"] * (1 - 1e-4)


def test_more_time_eases_every_limit(drone):
    paths = [some_path(4).scale_time(f) for f in (1.0, 1.5, 2.5, 5.0)]
    found = [limits.check(path, drone) for path in paths]
    for quick, slow in itertools.pairwise(found):
        for a, b in zip(quick, slow, strict=True):
            assert b.value > a.value if b.name == "slowest rotor" else b.value < a.value
    assert all(c.passed for c in found[-1])


@pytest.mark.parametrize(
    ("name", "limit"),
    [
        ("speed", {"speed_m_s": 0.5}),
        ("acceleration", {"acceleration_m_s2": 0.5}),
        ("jerk", {"jerk_m_s3": 0.5}),
        ("tilt", {"tilt_rad": 0.02}),
        ("roll and pitch rate", {"rate_rad_s": 0.02}),
        ("yaw rate", {"yaw_rate_rad_s": 0.02}),
        ("rotor speed", {"rotor_speed_max_rad_s": 960.0}),
        ("slowest rotor", {"rotor_speed_min_rad_s": 940.0}),
    ],
)
def test_each_limit_is_the_one_that_fails_when_it_alone_is_tight(drone, name, limit):
    path = some_path(5, pace=1.5)
    tight = drone.with_limits(**limit)
    assert [c.name for c in limits.check(path, drone) if not c.passed] == []
    assert [c.name for c in limits.check(path, tight) if not c.passed] == [name]


@pytest.mark.parametrize("pace", [0.5, 1.0, 4.0])
def test_the_time_scale_just_uses_one_limit(drone, pace):
    path = some_path(6, pace)
    scaled = path.scale_time(repair.time_scale(path, drone, drone.limits))
    checks = limits.check(scaled, drone, step_s=0.005)
    assert all(c.passed for c in checks)
    assert not all(c.passed for c in limits.check(scaled.scale_time(0.97), drone, step_s=0.005))


def test_a_limit_that_is_exceeded_is_named_with_segment_time_value_and_remedy(drone):
    """The proposed duration of that segment is one that suffices once the others are slow enough too."""
    path = some_path(4).scale_time(0.5)
    check = next(c for c in limits.check(path, drone) if c.name == "acceleration")
    longer = path.durations_s[check.segment] * np.sqrt(check.value / check.bound)
    assert check.reason == (
        f"segment {check.segment} at {check.time_s:.1f} s: acceleration {check.value:.4g} m/s2, limit 12; "
        f"give it {longer:.2f} s"
    )
    slower = path.scale_time(longer / path.durations_s[check.segment])
    assert next(c for c in limits.check(slower, drone) if c.name == "acceleration").value == pytest.approx(12.0)


def test_each_segment_names_the_limit_that_decides_its_time(drone):
    path = some_path(5, pace=1.5)
    speed = np.linalg.norm(path.position(path.sample(0.001), 1), axis=1)
    segment = path.segment_at(path.sample(0.001))[0]
    fastest = int(segment[np.argmax(speed)])
    calm = limits.usage(path, drone, drone.limits, step_s=0.005)
    assert set(calm.binding) == {""}
    bound = drone.with_limits(speed_m_s=float(speed.max()) * 1.001).limits
    used = limits.usage(path, drone, bound, step_s=0.005)
    assert used.binding[fastest] == "speed"
    assert used.share[0, fastest] == pytest.approx(1.0, abs=0.005)


def test_free_fall_fails_with_its_reason(drone):
    drop = minimum_snap.trajectory(minimum_snap.solve(np.array([[0.0, 0, 9, 0], [0, 0, 0, 0]]), np.array([1.0])))
    checks = {c.name: c for c in limits.check(drop, drone)}
    assert not checks["slowest rotor"].passed
    assert not checks["acceleration"].passed


def test_a_plan_leaves_the_controller_its_control_reserve():
    """Tight turns up and down: thrust stays off both ends of its range, and a smaller reserve is never slower."""
    kestrel = vehicle.example("rigter2019").with_limits(acceleration_m_s2=30.0, speed_m_s=12.0)
    hill = Waypoints(np.array([[0.0, 0, 1], [3, 0, 4], [6, 0, 1], [9, 0, 4]]), np.full(4, np.nan))
    durations = []
    for reserve in (0.0, 0.08, 0.16):
        options = PlanOptions(control_reserve=reserve)
        plan = planner.plan(hill, Room((-2.0, -3.0, 0.0), (11.0, 3.0, 6.0)), kestrel, options)
        speeds = vehicle.flatness.state(kestrel, plan.trajectory, plan.trajectory.sample(0.005)).rotor_speed_rad_s
        usable = options.limits_for(kestrel)
        assert speeds.min() > usable.rotor_speed_min_rad_s - 1.0
        assert speeds.max() < usable.rotor_speed_max_rad_s + 1.0
        durations.append(plan.trajectory.duration_s)
    assert durations == sorted(durations)


def test_a_vehicle_that_cannot_hover_fails_every_limit_with_its_reason(drone):
    used, checks = limits.measure(some_path(4, 3.0), drone.with_value("mass_kg", 20.0), drone.limits, step_s=0.02)
    assert used is None
    assert {"speed", "rotor speed", "slowest rotor"} <= {check.name for check in checks}
    for check in checks:
        assert not check.passed
        assert "cannot hover" in check.reason
