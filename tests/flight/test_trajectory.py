"""Polynomial identities, and what a trajectory keeps when it is cut, stretched, turned round or saved."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from flight import polynomial, trajectory
from flight.errors import FormatError, InputError
from flight.trajectory import Trajectory, TrajectoryFile

coefficient_rows = arrays(np.float64, st.tuples(st.integers(1, 4), st.integers(1, 10)), elements=st.floats(-5.0, 5.0))
durations = st.floats(0.1, 5.0)


def random_trajectory(seed: int, segments: int = 4, n: int = 8) -> Trajectory:
    rng = np.random.default_rng(seed)
    return Trajectory(rng.uniform(0.3, 2.0, segments), rng.normal(size=(segments, 4, n)))


@given(coefficient_rows, durations)
def test_the_derivative_matches_a_central_difference(c, t):
    h = 1e-5
    slope = (polynomial.evaluate(c, t + h) - polynomial.evaluate(c, t - h)) / (2 * h)
    exact = polynomial.evaluate(polynomial.differentiate(c), t)
    np.testing.assert_allclose(exact, slope, atol=1e-3 * (1 + np.abs(exact).max()), rtol=1e-4)


@given(coefficient_rows, durations, st.floats(-1.0, 1.0))
def test_centred_coefficients_describe_the_same_curve(c, T, s):
    centred = polynomial.centred_from_seconds(c, np.full(len(c), T))
    scale = np.abs(polynomial.evaluate(np.abs(c), T)).max() + 1.0
    expected = polynomial.evaluate(c, (s + 1) * T / 2)
    np.testing.assert_allclose(polynomial.evaluate(centred, s), expected, atol=1e-12 * scale)
    np.testing.assert_allclose(
        polynomial.seconds_from_centred(centred, np.full(len(c), T)), c, rtol=1e-5, atol=1e-6 * scale / T**9 + 1e-9
    )


@given(coefficient_rows, durations, st.floats(0.0, 1.0))
def test_a_curve_lies_within_its_bernstein_control_points(c, T, fraction):
    points = polynomial.bernstein_from_seconds(c, np.full(len(c), T))
    value = polynomial.evaluate(c, fraction * T)
    slack = 1e-9 * (1 + np.abs(points).max())
    assert np.all(value <= points.max(axis=-1) + slack)
    assert np.all(value >= points.min(axis=-1) - slack)
    np.testing.assert_allclose(points[:, 0], c[:, 0], atol=slack)
    np.testing.assert_allclose(points[:, -1], polynomial.evaluate(c, T), atol=slack)


@given(st.integers(0, 1000), st.floats(0.01, 0.99), st.integers(0, 4))
def test_split_keeps_the_curve(seed, fraction, derivative):
    whole = random_trajectory(seed)
    cut = fraction * whole.duration_s
    before, after = whole.split(cut)
    t = np.linspace(0.0, whole.duration_s, 37)
    early, late = t[t < cut], t[t >= cut]
    scale = np.abs(whole.evaluate(t, derivative)).max() + 1
    np.testing.assert_allclose(before.evaluate(early, derivative), whole.evaluate(early, derivative), atol=1e-9 * scale)
    np.testing.assert_allclose(
        after.evaluate(late - cut, derivative), whole.evaluate(late, derivative), atol=1e-8 * scale
    )
    rejoined = trajectory.join([before, after])
    assert rejoined.duration_s == pytest.approx(whole.duration_s)


def test_split_at_a_join_gives_whole_segments():
    whole = random_trajectory(3)
    before, after = whole.split(float(whole.starts_s[2]))
    assert len(before.durations_s) == 2
    assert len(after.durations_s) == 2


@given(st.integers(0, 1000), st.floats(0.2, 5.0))
def test_flying_slower_divides_each_derivative(seed, factor):
    original = random_trajectory(seed)
    slow = original.scale_time(factor)
    t = np.linspace(0.0, original.duration_s, 23)[1:-1]
    for order in range(4):
        expected = original.evaluate(t, order) / factor**order
        np.testing.assert_allclose(slow.evaluate(t * factor, order), expected, rtol=1e-6, atol=1e-6)


@given(st.integers(0, 1000))
def test_reversing_twice_is_the_identity(seed):
    original = random_trajectory(seed)
    backward = original.reverse()
    t = np.linspace(0.0, original.duration_s, 19)
    scale = np.abs(original.coefficients).max() * 2.0**8
    np.testing.assert_allclose(backward.evaluate(original.duration_s - t), original.evaluate(t), atol=1e-10 * scale)
    np.testing.assert_allclose(backward.reverse().coefficients, original.coefficients, atol=1e-9 * scale)


def test_join_jumps_show_a_discontinuity_and_its_size():
    c = np.zeros((2, 4, 3))
    c[0, 0] = [0.0, 1.0, 0.0]
    c[1, 0] = [2.25, 1.0, 0.0]
    jumps = Trajectory(np.array([2.0, 1.0]), c).join_jumps(0)
    np.testing.assert_allclose(jumps, [[0.25, 0, 0, 0]])


@pytest.mark.parametrize(
    ("durations_s", "coefficients", "word"),
    [
        ([], np.zeros((0, 4, 2)), "at least one"),
        ([1.0, 0.0], np.zeros((2, 4, 2)), "segment 1 lasts 0 s"),
        ([1.0], np.full((1, 4, 2), np.nan), "finite"),
        ([1.0], np.zeros((1, 3, 2)), "do not fit"),
    ],
)
def test_a_bad_trajectory_is_refused_with_a_reason(durations_s, coefficients, word):
    with pytest.raises(InputError, match=word):
        Trajectory(np.array(durations_s), coefficients)


@pytest.mark.parametrize("time_s", [-0.1, 1e6, np.nan])
def test_a_time_outside_is_refused(time_s):
    with pytest.raises(InputError):
        random_trajectory(0).position([time_s])


def example_file() -> TrajectoryFile:
    return TrajectoryFile(
        random_trajectory(1), "lap", "ab" * 32, "cd" * 32, np.ones((2, 3)), {"passed": True, "clearance_m": 0.4}
    )


def test_a_saved_trajectory_reads_back_exactly(tmp_path):
    item = example_file()
    trajectory.save(tmp_path / "t.json", item)
    back = trajectory.load(tmp_path / "t.json")
    np.testing.assert_array_equal(back.trajectory.coefficients, item.trajectory.coefficients)
    np.testing.assert_array_equal(back.trajectory.durations_s, item.trajectory.durations_s)
    assert (back.name, back.map_hash, back.vehicle_hash, back.checked) == (
        item.name,
        item.map_hash,
        item.vehicle_hash,
        True,
    )


@pytest.mark.parametrize("damage", ["cut", "newer", "other", "no_segments", "nan"])
def test_a_damaged_trajectory_file_is_refused(tmp_path, damage):
    path = tmp_path / "t.json"
    trajectory.save(path, example_file())
    document = json.loads(path.read_text())
    if damage == "cut":
        path.write_text(path.read_text()[:200])
    else:
        change = {
            "newer": {"version": 99},
            "other": {"format": "x"},
            "no_segments": {"segments": []},
            "nan": {"segments": None},
        }
        path.write_text(json.dumps(document | change[damage]))
    with pytest.raises(FormatError):
        trajectory.load(path)


def checked_file(tmp_path) -> tuple[Path, dict[str, Any]]:
    """A file as a planner writes it, and its document."""
    path, item = tmp_path / "t.json", example_file()
    asked = {"limits": {"speed_m_s": 2.0}, "margin_m": 0.15, "yaw": "along_path"}
    check = {**item.check, "trajectory_hash": trajectory.fingerprint(item.trajectory), "asked": asked}
    conditions = {"gate_edges_m": [[[0.0, 0.5, 0.0], [0.0, 0.0, 0.5]]] * 2}
    trajectory.save(path, trajectory.sealed(replace(item, check=check | {"conditions": conditions})))
    return path, json.loads(path.read_text())


CHANGES = {
    "a wider gate": lambda d: d["check"]["conditions"]["gate_edges_m"][0][0].__setitem__(1, 0.6),
    "another limit": lambda d: d["check"]["asked"]["limits"].__setitem__("speed_m_s", 9.0),
    "less margin": lambda d: d["check"]["asked"].__setitem__("margin_m", 0.05),
    "more clearance": lambda d: d["check"].__setitem__("clearance_m", 2.0),
    "no conditions": lambda d: d["check"].pop("conditions"),
    "no hash": lambda d: d["check"].pop("record_hash"),
    "another waypoint": lambda d: d["waypoints_world_m"][0].__setitem__(2, 1.5),
    "another map": lambda d: d.__setitem__("map_hash", "ef" * 32),
    "another segment": lambda d: d["segments"][0]["x"].__setitem__(0, 0.1),
}


@pytest.mark.parametrize("change", CHANGES)
def test_any_change_of_what_was_checked_is_noticed(tmp_path, change):
    path, document = checked_file(tmp_path)
    assert trajectory.load(path).as_checked
    CHANGES[change](document)
    path.write_text(json.dumps(document))
    assert not trajectory.load(path).as_checked


def test_a_file_of_version_1_is_read_and_stays_of_that_version(tmp_path):
    path, document = checked_file(tmp_path)
    del document["check"]["record_hash"]
    path.write_text(json.dumps(document | {"version": 1}))
    old = trajectory.load(path)
    assert old.as_checked
    assert old.record_kept is None
    trajectory.save(path, old)
    assert trajectory.load(path).record_kept is None
    assert trajectory.sealed(old).record_kept


def test_a_trajectory_that_would_not_be_read_back_is_not_written(tmp_path):
    still = Trajectory(np.array([6000.0, 6000.0]), np.zeros((2, 4, 1)))
    with pytest.raises(InputError, match=r"lasts 1.2e\+04 s; at most 10000 s"):
        trajectory.save(tmp_path / "t.json", TrajectoryFile(still, "t", "", "", np.ones((2, 3)), {}))
    assert not list(tmp_path.iterdir())


def test_the_nearest_join_is_the_nearest_of_all():
    path = random_trajectory(4, segments=9)
    times = np.append(np.random.default_rng(1).uniform(-0.5, path.duration_s + 0.5, 200), path.starts_s)
    brute = path.starts_s[np.abs(times[:, None] - path.starts_s).argmin(axis=1)]
    assert np.array_equal(path.nearest_join(times), brute)


def test_cutting_leaves_the_motion_as_it_is():
    path = random_trajectory(3)
    times = np.sort(np.random.default_rng(0).uniform(0.0, path.duration_s, 50))
    cut = path.cut(np.concatenate([times[:20], times[:3], path.starts_s, [-1.0, path.duration_s + 1.0]]))
    assert len(cut.durations_s) == len(path.durations_s) + 20
    np.testing.assert_allclose(cut.evaluate(times, 2), path.evaluate(times, 2), rtol=1e-9, atol=1e-9)
    np.testing.assert_array_equal(path.cut(np.zeros(0)).coefficients, path.coefficients)
