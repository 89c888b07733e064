"""Certified clearance: the minimum over the whole curve, between samples too; an unfinished check fails."""

import numpy as np
import pytest

from esdf import FREE, OCCUPIED, UNKNOWN, Grid, build, certify, rasterize, solids
from flight import InputError, Trajectory

PILLARS = solids.Scene([solids.Cylinder((2.0, 0.3, 1.0), 0.2, 2.0), solids.Sphere((4.0, -0.5, 1.2), 0.3)])


def straight(start, end, duration_s=2.0):
    start, end = np.array(start, float), np.array(end, float)
    coefficients = np.zeros((1, 4, 2))
    coefficients[0, :3, 0], coefficients[0, :3, 1] = start, (end - start) / duration_s
    return Trajectory(np.array([duration_s]), coefficients)


def wiggle(rng, segments=6, degree=5):
    coefficients = rng.normal(0, 0.3, (segments, 4, degree + 1))
    coefficients[:, :3, 0] = rng.uniform((0, -1, 0.5), (5, 1, 1.5), (segments, 3))
    return Trajectory(rng.uniform(0.5, 1.5, segments), coefficients)


def test_the_clearance_of_a_straight_flight_past_a_sphere_is_the_formula():
    verdict = certify(solids.Sphere((1.0, 1.0, 1.0), 0.25), straight((0, 0, 1), (2, 0, 1)), 0.74)
    assert verdict.passed
    assert verdict.reason == "clear"
    assert verdict.minimum_m == pytest.approx(0.75, abs=1e-3)
    assert verdict.time_s == pytest.approx(1.0, abs=0.05)
    assert verdict.minimum_m - 1e-3 <= verdict.proven_m <= 0.75


def test_the_proof_is_below_and_the_minimum_close_to_a_dense_sampling():
    rng = np.random.default_rng(0)
    for _ in range(20):
        path = wiggle(rng)
        verdict = certify(PILLARS, path, PILLARS.distance(path.position(path.sample(0.01))).min())
        dense = PILLARS.distance(path.position(path.sample(1e-4))).min()
        assert verdict.proven_m <= dense + 1e-9
        assert dense - 2e-3 < verdict.minimum_m < dense + 2e-3
        assert PILLARS.distance(verdict.point_world_m[None])[0] == pytest.approx(verdict.minimum_m)
        assert path.segment_at([verdict.time_s])[0][0] == verdict.segment
        assert not verdict.passed or verdict.reason == "clear"


def test_far_above_the_requirement_the_bound_stays_below_the_minimum_and_costs_little():
    rng = np.random.default_rng(7)
    for required in (-1.0, 0.0, 0.1):
        path = wiggle(rng)
        verdict = certify(PILLARS, path, required)
        dense = PILLARS.distance(path.position(path.sample(1e-3))).min()
        assert verdict.proven_m <= dense <= verdict.minimum_m + 0.05 * max(verdict.minimum_m - required, 0.0) + 2e-3
        assert verdict.passed == (verdict.proven_m >= required)
    free = np.full((100, 100, 100), FREE, np.uint8)
    empty = build(free, Grid((0, 0, 0), 0.5, free.shape), unknown="nan")
    verdict = certify(empty, straight((1, 1, 1), (40, 40, 40), 60.0), 0.3)
    assert verdict.minimum_m == empty.cap_m
    assert verdict.proven_m > 1.7


def test_an_obstacle_thinner_than_any_sampling_is_not_flown_through():
    wire = solids.Capsule((1.003, -1.0, 1.0), (1.003, 1.0, 1.0), 0.0005)
    verdict = certify(wire, straight((0, 0, 1), (200, 0, 1), 20.0), 0.0)
    assert not verdict.passed
    assert verdict.reason == "too close"
    assert verdict.time_s == pytest.approx(0.1003, abs=1e-3)


def test_what_a_field_proves_holds_for_the_solid_it_was_made_from():
    rng = np.random.default_rng(3)
    grid = Grid((-2.0, -3.0, -1.0), 0.05, (180, 120, 80))
    field = build(rasterize(PILLARS, grid), grid)
    passed = 0
    for _ in range(20):
        path = wiggle(rng, segments=3)
        if not grid.contains(path.position(path.sample(1e-3))).all():
            continue
        verdict = certify(field, path, 0.2)
        truth = PILLARS.distance(path.position(path.sample(1e-4))).min()
        assert verdict.proven_m <= max(truth, 0.0)
        passed += verdict.passed
        assert not (verdict.passed and truth < 0.2)
    assert passed > 3


def test_leaving_the_map_and_entering_the_unknown_have_their_own_reasons():
    state = np.full((40, 40, 40), FREE, np.uint8)
    state[20, 20, 20] = UNKNOWN
    field = build(state, Grid((0, 0, 0), 0.1, state.shape), unknown="nan")
    assert certify(field, straight((1, 1, 1), (3, 1, 1)), 0.3).passed
    assert certify(field, straight((1, 2.05, 2.05), (3, 2.05, 2.05)), 0.3).reason == "unknown"
    assert certify(field, straight((1, 1, 1), (5, 1, 1)), 0.3).reason == "outside the map"


def test_a_single_unknown_voxel_is_found_however_fast_the_flight():
    state = np.full((400, 20, 20), FREE, np.uint8)
    state[123, 10, 10] = UNKNOWN
    field = build(state, Grid((0, 0, 0), 0.1, state.shape), unknown="nan")
    verdict = certify(field, straight((0.5, 1.05, 1.05), (39, 1.05, 1.05), 0.5), 0.1)
    assert verdict.reason == "unknown"
    assert np.isnan(verdict.minimum_m)
    assert not verdict.passed


def test_an_uncapped_map_without_obstacles_is_clear_and_still_has_an_edge():
    free = np.full((40, 40, 40), FREE, np.uint8)
    field = build(free, Grid((0, 0, 0), 0.1, free.shape), cap_m=np.inf, unknown="nan")
    verdict = certify(field, straight((1, 1, 1), (3, 3, 3)), 0.3)
    assert verdict.passed
    assert verdict.minimum_m == pytest.approx(1e9)
    assert certify(field, straight((1, 1, 1), (30, 3, 3)), 0.3).reason == "outside the map"


def test_a_flight_too_long_to_check_does_not_pass():
    coefficients = np.zeros((1, 4, 8))
    coefficients[0, :3, 0] = 2.0
    coefficients[0, 0, 1:] = 1e9 * np.array([1, -7, 19, -25.5, 18.1, -6.6, 0.98])
    free = np.full((40, 40, 40), FREE, np.uint8)
    field = build(free, Grid((0, 0, 0), 0.1, free.shape), unknown="nan")
    verdict = certify(field, Trajectory(np.array([1.0]), coefficients), 0.3)
    assert not verdict.passed
    assert verdict.reason in ("unfinished", "outside the map")


def test_more_required_clearance_never_turns_a_failure_into_a_pass():
    path = straight((0, 0, 1), (5, 0.5, 1))
    verdicts = [certify(PILLARS, path, r).passed for r in np.linspace(0, 1, 11)]
    assert verdicts == sorted(verdicts, reverse=True)


def test_standing_still_is_certified_by_one_query():
    assert certify(solids.Sphere((0, 0, 0), 1.0), straight((3, 0, 0), (3, 0, 0)), 1.9).passed


@pytest.mark.parametrize(("required", "tolerance"), [(np.nan, 1e-3), (0.3, 0.0), (0.3, -1.0)])
def test_senseless_requirements_are_refused(required, tolerance):
    with pytest.raises(InputError):
        certify(PILLARS, straight((0, 0, 0), (1, 0, 0)), required, tolerance_m=tolerance)


def test_a_path_through_a_wall_fails_with_a_negative_minimum():
    state = np.full((40, 40, 40), FREE, np.uint8)
    state[20:24] = OCCUPIED
    field = build(state, Grid((0, 0, 0), 0.1, state.shape))
    verdict = certify(field, straight((1, 2, 2), (3, 2, 2)), 0.0)
    assert not verdict.passed
    assert verdict.minimum_m < -0.1
