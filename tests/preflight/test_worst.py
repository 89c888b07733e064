"""The worst flights flown once more: the same bits, where they came closest, and a fair bundle beside them."""

from dataclasses import replace

import numpy as np
import pytest

import preflight
from preflight import clearance, study, worst
from tests.preflight.conftest import EXACT, Wall

OPTIONS = preflight.Options(
    flights=40, risk=0.1, uncertainty=replace(EXACT, localization_std_m=0.05, map_error_std_m=0.02), explain=False
)
WALL = Wall(0.3)


@pytest.fixture(scope="module")
def result(drone, curve):
    return preflight.fly(preflight.Scenario(drone, curve, WALL, radius_m=0.2), OPTIONS)


@pytest.fixture(scope="module")
def found(drone, curve, result):
    return preflight.replay(preflight.Scenario(drone, curve, WALL, radius_m=0.2), result, OPTIONS)


def test_the_worst_are_the_nearest_and_the_worst_is_first(result, found):
    order = np.argsort(result.record.clearance_m)
    assert [track.number for track in found.worst] == order[: worst.WORST].tolist()
    assert [track.number for track in found.bundle] == list(range(40))


def test_a_flight_flown_again_is_the_same_bit_by_bit(drone, curve, result):
    numbers = np.array([31, 4, 17])
    flown, near = study.fly_again(preflight.Scenario(drone, curve, WALL, radius_m=0.2), numbers, OPTIONS)
    np.testing.assert_array_equal(near.clearance_m.min(axis=1), result.record.clearance_m[numbers])
    np.testing.assert_array_equal(flown.energy_j, result.record.energy_j[numbers])


def test_a_track_ends_soon_after_it_touches_and_tells_the_first_touch(result, found):
    touching = [track for track in (*found.worst, *found.bundle) if track.touches]
    assert {track.number for track in touching} == set(np.flatnonzero(result.record.touched).tolist())
    for track in touching:
        assert (track.clearance_m[: track.moment] >= 0.0).all()
        assert track.time_s[-1] <= track.time_s[track.moment] + 0.21


def test_a_track_that_touches_nothing_holds_where_it_came_closest(result, found):
    for track in found.bundle:
        if not track.touches:
            assert track.clearance_m[track.moment] == result.record.clearance_m[track.number]
            point = track.position_world_m[track.moment]
            np.testing.assert_array_equal(point, result.record.point_world_m[track.number])


def test_the_obstacle_is_where_the_wall_is(found):
    for track in found.worst:
        x, _, z = track.position_world_m[track.moment]
        assert track.surface_world_m == pytest.approx((x, -WALL.away_m, z), abs=1e-5)


def test_a_lost_flight_is_worse_than_a_nearer_one_that_came_home(result):
    left, clearance_m = np.zeros(40, bool), np.full(40, 0.3)
    left[7], clearance_m[[3, 21]] = True, (0.1, 0.2)
    record = replace(result.record, left_map=left, clearance_m=clearance_m)
    assert worst.worst_numbers(record).tolist() == [7, 3, 21]


def test_a_long_flight_is_thinned_but_keeps_its_ends_and_the_moment_that_matters(
    drone, curve, result, found, monkeypatch
):
    monkeypatch.setattr(worst, "_BUNDLE_SAMPLES", 9)
    thin = preflight.replay(preflight.Scenario(drone, curve, WALL, radius_m=0.2), result, OPTIONS)
    for few, many in zip(thin.bundle, found.bundle, strict=True):
        assert len(few.time_s) <= 10 < len(many.time_s) <= 161
        assert (few.time_s[0], few.time_s[-1]) == (many.time_s[0], many.time_s[-1])
        assert few.time_s[few.moment] == many.time_s[many.moment]
        assert few.clearance_m[few.moment] == many.clearance_m[many.moment]
    assert [len(track.time_s) for track in thin.worst] == [len(track.time_s) for track in found.worst]


def test_without_a_map_the_largest_error_is_the_worst(drone, curve):
    result = preflight.fly(preflight.Scenario(drone, curve, None), OPTIONS)
    found = preflight.replay(preflight.Scenario(drone, curve, None), result, OPTIONS)
    assert found.worst[0].number == int(np.nanmax(result.record.error_m, axis=1).argmax())
    assert found.worst[0].surface_world_m is None
    assert found.worst[0].as_dict(curve)["clearance_m"] is None


def test_a_distance_without_slope_or_out_of_the_map_has_no_surface():
    class Flat:
        def distance(self, points_world_m):
            return np.where(np.asarray(points_world_m)[:, 0] > 0.0, 1.0, np.nan)

    assert np.isnan(clearance.surface(Flat(), np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]]))).all()
