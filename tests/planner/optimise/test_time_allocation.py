import threading
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import vehicle
from esdf import solids
from planner import PlanCancelledError, StopFlag
from planner.curve import minimum_snap
from planner.optimise import airframe, corrections, time_allocation
from planner.optimise.time_allocation import Problem, Weights
from vehicle import Limits

ONLY = ("snap", "limits", "clearance", "heading", "turning")
SEEDS = st.integers(0, 100_000)
TIGHT = Limits(
    speed_m_s=4.0,
    acceleration_m_s2=6.0,
    tilt_rad=0.7,
    rate_rad_s=4.0,
    yaw_rate_rad_s=1.0,
    rotor_speed_min_rad_s=600.0,
    rotor_speed_max_rad_s=1200.0,
    jerk_m_s3=25.0,
)


def problem(seed: int, segments: int = 5, **weights: float) -> tuple[Problem, np.ndarray]:
    rng = np.random.default_rng(seed)
    scene = solids.Scene([solids.Sphere(tuple(rng.uniform(-2, 2, 3)), 0.7) for _ in range(4)])
    knots = np.cumsum(rng.normal(size=(segments + 1, 4)), axis=0)
    free = np.ones((segments + 1, 4), dtype=bool)
    free[[0, -1]] = False
    frame = airframe.reduced(vehicle.example("rigter2019"), TIGHT)
    price = replace(Weights(snap=1e-4, limits=2.0, clearance=30.0, heading=0.5, turning=0.1), **weights)
    offsets = 0.1 * rng.normal(size=(segments, time_allocation.SAMPLES, airframe.COLUMNS - 1))
    velocity = np.full((segments + 1, 4), np.nan)
    velocity[segments // 2] = rng.normal(size=4)
    moving = {"start": rng.normal(size=(3, 4)), "end": rng.normal(size=(3, 4)), "velocity": velocity}
    given = moving if seed % 2 else {}
    target = np.array([0.3, -0.2, 1.0]) if seed % 3 == 0 else None
    reference_s = rng.uniform(0.5, 2.0, segments) if rng.uniform() < 0.5 else None
    radius = np.where(rng.random(segments + 1) < 0.5, rng.uniform(0.7, 1.5, segments + 1), 0.0)  # some have no ball
    balls = np.column_stack([knots[:, :3] + rng.normal(size=(segments + 1, 3)), radius])
    moved = {"reference_s": reference_s, "target_world_m": target, "balls": balls, **given}
    p = Problem(knots, free, frame, scene, 1.0, price, offsets, **moved)
    durations = rng.uniform(0.4, 0.9, segments)
    edges = 0.4 * rng.normal(size=(segments + 1, 2, 3)) * (rng.random(segments + 1) < 0.5)[:, None, None]
    edges[:, 1] -= edges[:, 0] * (edges[:, 1] * edges[:, 0]).sum(1, keepdims=True) / (edges[:, :1] ** 2 + 1e-30).sum(2)
    gates = np.concatenate([knots[:, None, :3] + 0.5 * rng.normal(size=(segments + 1, 1, 3)), edges], axis=1)
    speed = rng.uniform(1.0, 4.0, segments)
    jerk = rng.uniform(10.0, 80.0, segments)
    # that of jerk is drawn last, so that a seed gives what it gave before there was one
    offsets = np.insert(offsets, airframe.NAMES.index("jerk"), 0.1 * rng.normal(size=offsets.shape[:2]), axis=2)
    farther = rng.uniform(-0.3, 0.3, segments)
    return replace(p, offsets=offsets, speed_m_s=speed, jerk_m_s3=jerk, farther_m=farther, gates=gates), durations


def agrees_with_differences(p: Problem, T: np.ndarray) -> bool:
    _, by_T, by_knots = time_allocation.cost_and_gradient(p, p.knots, T)
    h = 1e-6

    def slope(knots: np.ndarray | float, times: np.ndarray | float) -> float:
        ahead, back = (time_allocation.cost_and_gradient(p, p.knots + s * knots, T + s * times)[0] for s in (h, -h))
        return (ahead - back) / (2 * h)

    numeric_T = np.array([slope(0.0, e) for e in np.eye(len(T))])
    numeric_knots = np.array([slope(e, 0.0) for e in np.eye(p.knots.size).reshape(-1, *p.knots.shape)])
    pairs = (by_T, numeric_T), (by_knots, numeric_knots.reshape(p.knots.shape))
    # The field's own gradient is a difference over a tenth of a millimetre.
    return all(np.allclose(x, y, rtol=2e-5, atol=3e-5 * (1.0 + np.abs(x).max())) for x, y in pairs)


def room_between_m(p: Problem, T: np.ndarray) -> float:
    """By how much the nearest sphere is nearer than the next one, least of all samples that are charged."""
    samples = minimum_snap.derivatives(p.spline(p.knots, T), time_allocation.FRACTIONS)[:, :, 0, :3].reshape(-1, 3)
    aim_m = np.repeat(p.aim_m, time_allocation.SAMPLES)
    nearest, second = np.sort([solid.distance(samples) for solid in p.field.solids], axis=0)[:2]
    return float((second - nearest)[nearest < aim_m].min(initial=np.inf))


@settings(max_examples=30)
@given(SEEDS, st.sampled_from(["all", *ONLY]))
def test_the_gradient_is_that_of_finite_differences(seed, only):
    weights = {} if only == "all" else {n: 0.0 for n in ONLY if n != only}
    p, T = problem(seed, 4, **weights)
    assert time_allocation.cost_and_gradient(p, p.knots, T)[0] >= T.sum()
    assume(room_between_m(p, T) > 3e-4)  # where two spheres are nearest the distance has a kink, and no gradient
    assert agrees_with_differences(p, T)


class ExactSpheres(solids.Scene):
    """Spheres whose gradient is that of the nearest one, not a difference."""

    def distance_and_gradient(self, points):
        away = points - np.array([sphere.centre_world_m for sphere in self.solids])[:, None]
        nearest = np.argmin([sphere.distance(points) for sphere in self.solids], axis=0)
        away = away[nearest, np.arange(len(points))]
        return self.distance(points), away / np.linalg.norm(away, axis=1)[:, None]


def test_where_two_spheres_are_nearest_only_the_difference_over_both_sides_is_wrong():
    p, T = problem(21, 4)
    assert room_between_m(p, T) < 1e-4  # of one sample: both spheres are within the field's difference
    assert not agrees_with_differences(p, T)
    assert agrees_with_differences(replace(p, field=ExactSpheres(p.field.solids)), T)


@settings(max_examples=30)
@given(SEEDS, st.integers(1, 7))
def test_the_kernel_agrees_with_the_numpy_reference(seed, segments):
    p, T = problem(seed, segments)
    cost, _, _ = time_allocation.cost_and_gradient(p, p.knots, T)
    assert cost == pytest.approx(time_allocation.cost_numpy(p, p.knots, T), rel=1e-9)


@settings(max_examples=20)
@given(SEEDS)
def test_the_excess_agrees_with_the_numpy_reference(seed):
    p, T = problem(seed)
    spline = p.spline(p.knots, T)
    at_samples, peaks = time_allocation.excess(p, spline)
    plain = time_allocation.excess_numpy(p, minimum_snap.derivatives(spline, time_allocation.FRACTIONS))
    assert np.allclose(at_samples, plain, rtol=1e-9, atol=1e-9 * np.abs(plain).max())
    assert (peaks >= at_samples).all()


@pytest.mark.parametrize("pace", [1.3, 1.8])
def test_the_reduced_vehicle_is_close_to_the_full_model(pace):
    """With BEM thrust, thrust-scaled and parasitic drag, in flight at up to 8 m/s; relative excess of each limit."""
    drone, rng = vehicle.example("rigter2019"), np.random.default_rng(4)
    knots = np.cumsum(rng.normal(size=(7, 4)) * [4.0, 4.0, 1.0, 0.5], axis=0)
    T = pace * np.full(6, 1.3)
    spline = minimum_snap.solve(knots, T)
    frame = airframe.reduced(drone, replace(drone.limits, jerk_m_s3=60.0))
    reduced = airframe.excess_numpy(
        frame, minimum_snap.derivatives(spline, time_allocation.FRACTIONS).reshape(-1, 5, 4)
    )
    path = minimum_snap.trajectory(spline)
    full = corrections.measured_excess(frame, drone, path, np.arange(6), time_allocation.FRACTIONS).reshape(
        reduced.shape
    )
    assert np.abs(full[:, :3] - reduced[:, :3]).max() < 1e-5
    flown = full.max(axis=1) < 0.1  # motions the optimiser may end with
    assert flown.mean() > 0.7
    assert np.abs(full[:, 3:6] - reduced[:, 3:6])[flown].max() < 0.12
    assert np.abs(full[:, 6:] - reduced[:, 6:])[flown].max() < 0.15


def test_optimising_times_never_costs_more_and_is_a_minimum():
    p, T = problem(5)
    before = time_allocation.cost_and_gradient(p, p.knots, T)[0]
    found = time_allocation.optimise(p, T, iterations=2000, precision=1e-12)
    assert found.cost < before
    rng = np.random.default_rng(0)
    for _ in range(20):
        nudged = found.durations_s * np.exp(0.02 * rng.normal(size=len(T)))
        assert time_allocation.cost_and_gradient(p, found.knots, nudged)[0] > found.cost - 1e-6


def test_pinned_numbers_stay_what_they_are():
    p, T = problem(6)
    p.free[2, 3] = p.free[3, 0] = False
    found = time_allocation.optimise(p, T, iterations=50)
    assert np.array_equal(found.knots[~p.free], p.knots[~p.free])
    assert np.abs(found.knots[p.free] - p.knots[p.free]).min() > 1e-6


def test_samples_far_from_obstacles_are_not_asked_about_again():
    class Counts:
        asked = 0

        def distance(self, points):
            self.asked += len(points)
            return np.full(len(points), 50.0)

    p, T = problem(3)
    sky = Counts()
    found = time_allocation.optimise(replace(p, field=sky), T, iterations=40)
    assert found.evaluations > 20
    assert sky.asked == len(T) * time_allocation.SAMPLES


def test_a_path_in_unknown_space_is_drawn_back_to_its_polyline():
    class KnowsHalf:
        def distance(self, points):
            return np.where(points[:, 1] > 0.3, np.nan, 50.0)

    p, _ = problem(3)
    knots = np.array([[0.0, 0, 1, 0], [2, 0, 1, 0], [4, 0, 1, 0]])
    free = np.zeros((3, 4), dtype=bool)
    free[1, :3] = True
    weights = Weights(limits=300.0, clearance=3000.0)
    off = knots.copy()
    off[1, 1] = 1.0
    p = Problem(knots, free, p.airframe, KnowsHalf(), 0.3, weights)
    cost, _, by_knots = time_allocation.cost_and_gradient(p, off, np.ones(2))
    assert cost > 10.0
    assert by_knots[1, 1] > 0.0


@pytest.mark.parametrize("name", ["speed_m_s", "acceleration_m_s2", "jerk_m_s3", "tilt_rad", "rotor_speed_max_rad_s"])
def test_more_of_any_limit_is_never_slower(name, open_sky):
    knots = np.array([[0.0, 0, 0, 0], [4, 0, 0, 0], [4, 3, 1, 0], [0, 3, 1, 0]])
    times = []
    for factor in (0.85, 1.0, 1.15):
        frame = airframe.reduced(vehicle.example("rigter2019"), replace(TIGHT, **{name: getattr(TIGHT, name) * factor}))
        p = Problem(knots, np.zeros((4, 4), dtype=bool), frame, open_sky, 0.3, Weights(limits=1000.0))
        times.append(time_allocation.optimise(p, np.full(3, 3.0)).durations_s.sum())
    assert times[0] >= times[1] - 1e-3
    assert times[1] >= times[2] - 1e-3


def test_a_stop_flag_ends_the_optimisation_from_another_thread():
    p, T = problem(1, 60)
    flag = StopFlag()
    stopper = threading.Timer(0.05, flag.set)
    stopper.start()
    with pytest.raises(PlanCancelledError):
        time_allocation.optimise(p, T, iterations=100_000, precision=-1.0, stop=flag)
    stopper.join()
    assert flag.is_set()


def test_a_knot_in_a_gate_moves_in_its_plane_only():
    p, T = problem(4)
    found = time_allocation.optimise(p, T, iterations=50)
    for before, after, gate, free in zip(p.knots, found.knots, p.gates, p.free, strict=True):
        if not gate[1:].any() or not free[0]:
            continue
        normal = np.cross(gate[1], gate[2])
        assert abs(normal @ (after - before)[:3]) < 1e-12
        assert np.linalg.norm((after - before)[:3]) > 1e-3
