"""How each limit's use is found: where, when and how much of it, against dense samples and by hand."""

from dataclasses import replace

import numpy as np
import pytest

import vehicle
from flight import Trajectory
from planner.curve import attitude, minimum_snap
from planner.gate import instants, limits
from planner.gate.limits import NAMES, Check, Known, Usage
from vehicle import flatness, invert

STEP_S = 0.005
PROVED = ("speed", "acceleration", "jerk")


@pytest.fixture(scope="module")
def drone() -> vehicle.Vehicle:
    """With every limit there is."""
    return vehicle.example("rigter2019").with_limits(jerk_m_s3=60.0)


def some_path(seed: int, count: int = 5, pace: float = 1.0) -> Trajectory:
    rng = np.random.default_rng(seed)
    knots = np.cumsum(rng.normal(size=(count + 1, 4)) * [2, 2, 0.5, 0.6], axis=0)
    return minimum_snap.trajectory(minimum_snap.solve(knots, pace * rng.uniform(1.5, 2.5, count)))


def sampled(path: Trajectory, drone, times: np.ndarray) -> np.ndarray:
    """(limits, times)"""
    state = flatness.state(drone, path, times)
    rate, rotor = state.rate_body_rad_s, state.rotor_speed_rad_s
    return np.stack(
        [
            np.linalg.norm(path.position(times, 1), axis=1),
            np.linalg.norm(path.position(times, 2), axis=1),
            np.linalg.norm(path.position(times, 3), axis=1),
            state.tilt_rad,
            np.hypot(rate[:, 0], rate[:, 1]),
            np.abs(rate[:, 2]),
            rotor.max(axis=1),
            rotor.min(axis=1),
        ]
    )


def made(value, bound=None, share=None) -> Usage:
    """A usage with these values (segments,) of every limit."""
    value = np.tile(np.array(value, dtype=float), (len(NAMES), 1))
    share = value if share is None else np.array(share, dtype=float)
    return Usage(value, np.zeros_like(value), share, np.ones(len(NAMES)) if bound is None else bound)


@pytest.mark.parametrize("count", [1, 5, 130])  # more than are looked at together
def test_each_segments_value_is_its_own_and_occurs_when_it_says(drone, count):
    path = some_path(8, count)
    used = limits.usage(path, drone, drone.limits, step_s=STEP_S)
    largest = 0.0
    for i in range(0, count, 1 if count < 100 else 9):
        start, end = path.starts_s[i], path.starts_s[i + 1]
        seen = sampled(path, drone, np.linspace(start + 1e-9, end - 1e-9, 801))
        at = sampled(path, drone, np.clip(used.time_s[:, i], start + 1e-9, end - 1e-9))
        hover = float(invert.hover(drone).mean())
        for k, name in enumerate(NAMES):
            assert start - 1e-9 <= used.time_s[k, i] <= end + 1e-9
            room = abs(used.bound[k] - (hover if k > 5 else 0.0))
            exact = seen[k].min() if name == "slowest rotor" else seen[k].max()
            beyond = (exact - used.value[k, i] if name == "slowest rotor" else used.value[k, i] - exact) / room
            largest = max(largest, beyond)
            assert beyond > -1e-9, name
            if used.share[k, i] >= 0.97:  # else it is not looked at more closely
                assert beyond < 0.01, name
            if name in PROVED:
                assert beyond < 0.02
                assert abs(at[k, k] - exact) < 0.06 * exact + 0.02 * room, name
            elif used.share[k, i] > 0.5:
                assert abs(at[k, k] - exact) < 0.25 * room, name
    assert largest > 0.0


@pytest.mark.parametrize("shift", [0, 1, 2])
def test_what_is_known_of_segments_is_moved_to_where_they_are_flown(drone, shift):
    path = some_path(9, 6)
    used = limits.usage(path, drone, drone.limits, step_s=STEP_S)
    kept = Trajectory(path.durations_s[shift:], path.coefficients[shift:])
    changed = kept.durations_s.copy()
    changed[1] *= 1.25
    c = kept.coefficients.copy()
    c[1] /= 1.25 ** np.arange(8)
    other = Trajectory(changed, c)
    fresh = limits.usage(other, drone, drone.limits, step_s=STEP_S)
    again = limits.usage(other, drone, drone.limits, step_s=STEP_S, known=Known((path, used)))
    np.testing.assert_allclose(again.value, fresh.value, rtol=1e-12)
    np.testing.assert_allclose(again.time_s, fresh.time_s, atol=1e-9)
    np.testing.assert_allclose(again.share, fresh.share, atol=1e-12)
    # it was not looked at again: what is known is believed
    wrong = replace(used, value=used.value + 1.0)
    believed = limits.usage(other, drone, drone.limits, step_s=STEP_S, known=Known((path, wrong)))
    moved = np.isclose(believed.value, fresh.value + 1.0).all(axis=0)
    assert moved.tolist() == [i != 1 for i in range(len(changed))]


def test_a_memory_of_forces_changes_nothing(drone):
    path = some_path(10, 3)
    memory = attitude.Memory()
    fresh = limits.usage(path, drone, drone.limits, step_s=STEP_S)
    for _ in range(2):
        again = limits.usage(path, drone, drone.limits, step_s=STEP_S, known=Known(None, memory))
        np.testing.assert_array_equal(again.value, fresh.value)


def test_a_limit_that_is_met_exactly_is_kept():
    bound = np.full(len(NAMES), 2.0)
    assert made([2.0], bound).passed.all()
    assert made([2.5], bound).passed[:, 0].tolist() == [name == "slowest rotor" for name in NAMES]
    assert made([1.5], bound).passed[:, 0].tolist() == [name != "slowest rotor" for name in NAMES]
    assert not made([np.nan], bound).passed.any()


def test_a_segment_is_decided_by_the_limit_it_uses_most_from_97_percent_on():
    share = np.zeros((len(NAMES), 5))
    share[3, 0], share[4, 0] = 0.969, 0.5
    share[3, 1], share[4, 1] = 0.97, 0.5
    share[3, 2], share[4, 2] = 1.0, 1.1
    share[7, 3] = np.nan  # cannot be flown
    share[0, 4] = np.inf
    found = made(np.zeros(5), share=share).binding
    assert found == ("", "tilt", "roll and pitch rate", "slowest rotor", "speed")


def test_the_worst_segment_is_that_with_the_largest_value_of_the_slowest_rotor_the_least():
    used = made([3.0, 5.0, 1.0])
    assert [used.worst(k) for k in range(len(NAMES))] == [1] * 7 + [2]
    assert [made([3.0, np.nan, 9.0]).worst(k) for k in (0, 7)] == [1, 1]


def test_checks_say_by_which_method_they_were_found_and_have_the_worst_segment(drone):
    path = some_path(11, pace=3.0)
    used, checks = limits.measure(path, drone, drone.limits, step_s=STEP_S)
    for k, check in enumerate(checks):
        assert check.passed, check.name
        assert ("proved" in check.reason) == (check.name in PROVED)
        assert ("interpolated" in check.reason) == (check.name not in PROVED)
        assert check.value == used.value[k, check.segment]
        assert check.value == (used.value[k].min() if check.name == "slowest rotor" else used.value[k].max())
        assert check.time_s == used.time_s[k, check.segment]
    by_default = limits.check(path, drone)
    assert [check.bound for check in by_default] == [check.bound for check in checks]
    other = limits.check(path, drone, drone.with_limits(speed_m_s=0.2).limits)
    assert [check.name for check in other if not check.passed] == ["speed"]


def test_a_check_is_json_able_and_a_ratio():
    check = Check("speed", 3.0, 4.0, "m/s", True, 1.5, 2, "why")
    assert check.ratio == 0.75
    assert check.as_dict() == {
        "name": "speed", "value": 3.0, "bound": 4.0, "unit": "m/s", "passed": True, "time_s": 1.5, "segment": 2,
        "reason": "why",
    }  # fmt: skip
    broken = Check("x", np.nan, np.inf, "", False).as_dict()
    assert (broken["value"], broken["bound"], broken["passed"], broken["name"]) == (None, None, False, "x")


@pytest.mark.parametrize(("limit", "power"), list(enumerate((1.0, 0.5, 1.0 / 3.0, 0.5, 1.0 / 3.0, 1.0, 0.5, 0.5))))
def test_a_refusal_proposes_the_time_in_which_the_limit_would_be_kept(limit, power):
    path = Trajectory(np.array([2.0]), np.zeros((1, 4, 8)))
    eightfold = made([8.0], share=np.full((len(NAMES), 1), 8.0))
    assert f"give it {2.0 * 8.0**power:.2f} s" in limits.excess_text(eightfold, limit, 0, path)
    less = made([0.5], share=np.full((len(NAMES), 1), 0.5))
    assert "give it 2.00 s" in limits.excess_text(less, limit, 0, path)
    assert "give it more than 3.00 s" in limits.excess_text(made([np.nan]), limit, 0, path)


def test_shares_of_time_are_powers_of_the_shares_of_limits(drone):
    path, times = some_path(12), np.linspace(0.1, 8.0, 40)
    found = instants.time_shares(path, drone, drone.limits, times)
    values, bounds = sampled(path, drone, times), np.array([check.bound for check in limits.check(path, drone)])
    hover = float(invert.hover(drone).mean())
    base = np.array([0.0] * 6 + [hover] * 2)[:, None]
    share = np.maximum((values - base) / (bounds[:, None] - base), 0.0)
    powers = np.array([1.0, 0.5, 1.0 / 3.0, 0.5, 1.0 / 3.0, 1.0, 0.5, 0.5])[:, None]
    np.testing.assert_allclose(found, share**powers, atol=1e-7)


def test_without_room_beside_hover_every_deviation_is_too_much(drone):
    hover = float(invert.hover(drone).mean())
    at = np.full((len(NAMES), 1), hover)
    for row, limit, sign in ((6, "rotor_speed_max_rad_s", 1.0), (7, "rotor_speed_min_rad_s", -1.0)):
        tight = replace(drone.limits, **{limit: hover})
        assert limits.shares_used(at, tight, hover)[row, 0] == 0.0
        assert limits.shares_used(at + sign, tight, hover)[row, 0] > 1e6
        assert limits.shares_used(at - sign, tight, hover)[row, 0] == 0.0


@pytest.mark.parametrize("step_s", [0.5, 0.05, 0.001])
def test_samples_are_dense_and_lie_on_both_sides_of_every_join(step_s):
    path = some_path(13, 3)
    times, segment = instants.sample_times(path, step_s)
    for i in range(3):
        own = times[segment == i]
        assert own[0] == path.starts_s[i]
        assert 0.0 < path.starts_s[i + 1] - own[-1] <= 1.01e-9
        assert np.diff(own).max() <= step_s + 1e-12
        assert len(own) >= 5
        assert len(own) <= max(path.durations_s[i] / step_s, 4) + 2
    short = Trajectory(np.array([1e-7]), np.zeros((1, 4, 8)))
    times, _ = instants.sample_times(short, step_s)
    assert (np.diff(times) > 0.0).all()
    assert times[-1] == pytest.approx(1e-7 * (1.0 - 1e-3))


def test_a_vehicle_turns_as_its_rate_limit_and_the_drag_of_its_rotors_allow(drone):
    can = instants.yaw_bounds(drone, drone.limits)
    assert can.rate_rad_s == pytest.approx(0.9 * drone.limits.yaw_rate_rad_s)
    assert 0.1 < can.acceleration_rad_s2 < 100.0
    inertia = drone.value("inertia_zz_kg_m2")
    heavy = instants.yaw_bounds(drone.with_value("inertia_zz_kg_m2", 2.0 * inertia), drone.limits)
    assert heavy.acceleration_rad_s2 == pytest.approx(0.5 * can.acceleration_rad_s2)


@pytest.mark.parametrize("seed", [14, 15])
def test_a_limit_that_decides_is_bounded_to_a_hundredth_and_others_only_as_closely_as_that_needs(drone, seed):
    """The bound is the truth's within 1 % of the limit's room where the truth is at the limit, and only there."""
    path = some_path(seed, 3, pace=0.9)
    seen = sampled(path, drone, path.sample(0.0005))
    hover = float(invert.hover(drone).mean())
    tight = replace(
        drone.limits,
        tilt_rad=float(seen[3].max()),
        rate_rad_s=float(seen[4].max()),
        yaw_rate_rad_s=float(seen[5].max()),
        rotor_speed_max_rad_s=float(seen[6].max()),
        rotor_speed_min_rad_s=float(seen[7].min()),
    )
    used, loose = (limits.usage(path, drone, bounds, step_s=0.05) for bounds in (tight, drone.with_limits(
        tilt_rad=3.0, rate_rad_s=90.0, yaw_rate_rad_s=90.0, rotor_speed_max_rad_s=9000.0, rotor_speed_min_rad_s=1.0
    ).limits))  # fmt: skip
    coarser = 0.0
    for k in range(3, len(NAMES)):
        room = abs(used.bound[k] - (hover if k > 5 else 0.0))
        exact = seen[k].min() if k == 7 else seen[k].max()
        near, far = (abs(u.value[k, u.worst(k)] - exact) / room for u in (used, loose))
        assert near < 0.01, NAMES[k]
        coarser = max(coarser, far)
    assert coarser > 0.01


def test_pieces_of_a_quarter_of_a_sampling_step_are_halved_no_more(drone):
    knots = np.array([[0.0, 0.0, 0.0, 0.0], [0.5, 0.0, 0.1, 0.1], [0.8, 0.3, 0.1, 0.2]])
    path = minimum_snap.trajectory(minimum_snap.solve(knots, np.array([0.25, 0.25])))
    tight = drone.with_limits(tilt_rad=1e-3, rate_rad_s=1e-3, yaw_rate_rad_s=1e-3).limits  # near all along
    whole, same, halved = (limits.usage(path, drone, tight, step_s=step_s).value[3:6] for step_s in (2.0, 1.0, 0.99))
    np.testing.assert_array_equal(same, whole)
    assert (halved < 0.99 * whole).all()


LOOSE = {
    "tilt_rad": 3.0,
    "rate_rad_s": 90.0,
    "yaw_rate_rad_s": 90.0,
    "rotor_speed_max_rad_s": 9000.0,
    "rotor_speed_min_rad_s": 1.0,
}


def test_a_segment_is_looked_at_in_pieces_of_fifty_sampling_steps(drone):
    path, count = some_path(17, 1), 60
    path = path.scale_time(50.0 * count / 2048.0 / path.duration_s)
    bounds = drone.with_limits(**LOOSE).limits
    pieces = path.cut(path.duration_s * np.arange(1, count) / count)
    whole, parts = (limits.usage(one, drone, bounds, step_s=1.0 / 2048.0).value[3:] for one in (path, pieces))
    assert parts.shape[1] == count
    np.testing.assert_allclose(whole[:-1, 0], parts[:-1].max(axis=1), rtol=1e-9)
    np.testing.assert_allclose(whole[-1, 0], parts[-1].min(), rtol=1e-9)


@pytest.fixture(scope="module")
def half_second() -> Trajectory:
    """A path that is one piece to begin with, and whose bounds are looser for it."""
    whole = some_path(17, 3, pace=0.9)
    start = float(whole.starts_s[1]) + 0.3
    parts = whole.cut(np.array([start, start + 0.5]))
    return Trajectory(parts.durations_s[2:3], parts.coefficients[2:3])


@pytest.mark.parametrize("k", [4, 7])  # the bounds of the others are close enough as they are
def test_each_limit_is_looked_at_more_closely_where_it_is_used_to_the_full(drone, half_second, k):
    seen = sampled(half_second, drone, half_second.sample(0.0005))[k]
    truth = float(seen.min() if k == 7 else seen.max())
    hover = float(invert.hover(drone).mean())
    at_it = drone.with_limits(**LOOSE | {list(LOOSE)[k - 3]: truth}).limits
    close, far = (
        abs(float(limits.usage(half_second, drone, bounds, step_s=0.01).value[k, 0]) - truth)
        for bounds in (at_it, drone.with_limits(**LOOSE).limits)
    )
    assert close < far
    assert close < 0.004 * abs(truth - (hover if k > 5 else 0.0))


def test_a_bound_that_is_close_enough_or_far_from_its_limit_does_not_get_closer_with_shorter_steps(drone, half_second):
    seen = sampled(half_second, drone, half_second.sample(0.0005))
    tight = drone.with_limits(
        tilt_rad=float(seen[3].max()), rate_rad_s=float(seen[4].max()), yaw_rate_rad_s=float(seen[5].max())
    ).limits
    close, far = (
        [limits.usage(half_second, drone, bounds, step_s=step_s).value for step_s in (0.02, 0.01)]
        for bounds in (tight, drone.with_limits(**LOOSE).limits)
    )
    np.testing.assert_array_equal(close[0], close[1])
    np.testing.assert_array_equal(far[0], far[1])
    assert (close[0][3:6] < far[0][3:6]).all()
