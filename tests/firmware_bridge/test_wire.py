"""One conversion for the wire: times that do not drift, the same points, the same bytes whoever uploads."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import vehicle
from firmware_bridge import _controller, wire
from firmware_bridge.controller import Controller, LinkLoss, parameters_of
from flight import InputError, Trajectory, TrajectoryFile


def _file(trajectory: Trajectory, **check: object) -> TrajectoryFile:
    return TrajectoryFile(trajectory, "lap", "ab" * 32, "cd" * 32, np.zeros((2, 3)), check)


def _wiggle(durations_s: np.ndarray, seed: int = 0) -> Trajectory:
    return Trajectory(durations_s, np.random.default_rng(seed).normal(0.0, 0.3, (len(durations_s), 4, 8)))


@settings(max_examples=50)
@given(st.integers(1, wire.MAX_SEGMENTS), st.floats(0.021, 0.9), st.integers(0, 99))
def test_joins_stay_within_half_a_microsecond_however_many_there_are(segments: int, duration_s: float, seed: int):
    durations_s = duration_s * np.random.default_rng(seed).uniform(1.0, 1.5, segments)
    trajectory = _wiggle(durations_s, seed)
    joins_us = np.cumsum(wire.plan_from_trajectory(trajectory).durations_us.astype(np.int64))
    np.testing.assert_allclose(joins_us, trajectory.starts_s[1:] * 1e6, rtol=0.0, atol=0.501)


def test_the_vehicle_evaluates_every_check_point_as_the_planner_does(curves):
    for trajectory in (curves.figure_eight(), curves.general()):
        plan = wire.plan_from_trajectory(trajectory)
        times_us, values = wire.check_points(plan, trajectory)
        rows = _controller.evaluate(plan.durations_us, plan.coefficients, times_us)
        np.testing.assert_allclose(rows[:, :3], values[:, :3], atol=2e-5)  # float32 at 6 m: 0.5 um a rounding
        np.testing.assert_allclose(rows[:, 15], values[:, 3], atol=2e-5)


def test_what_the_wire_holds_is_the_curve_that_was_planned(curves):
    trajectory = curves.figure_eight()
    back = wire.plan_from_trajectory(trajectory).trajectory()
    times_s = np.linspace(0.0, min(trajectory.duration_s, back.duration_s), 2001)
    np.testing.assert_allclose(back.evaluate(times_s), trajectory.evaluate(times_s), atol=2e-5)


def test_an_upload_without_a_link_sends_the_same_plan_as_a_file(curves):
    trajectory = curves.figure_eight(speed_m_s=5.0, turns=1)
    plan = wire.plan_from_file(_file(trajectory), on_link_loss=LinkLoss.LAND)
    controller = Controller(parameters_of(vehicle.example("rigter2019")))
    assert controller.upload(trajectory, id=plan.id, link_loss=LinkLoss.LAND) == plan.crc32


def test_the_id_names_the_content():
    trajectory = _wiggle(np.array([1.0, 2.0]))
    file = _file(trajectory)
    first = wire.plan_from_file(file)
    assert wire.plan_from_file(file).id == first.id
    for other in (
        dataclasses.replace(file, name="lap-2"),
        dataclasses.replace(file, map_hash="ee" * 32),
        dataclasses.replace(file, trajectory=trajectory.scale_time(1.1)),
        dataclasses.replace(file, check={"passed": True, "clearance_m": 0.4, "body_radius_m": 0.15}),
    ):
        assert wire.plan_from_file(other).id != first.id
    assert wire.plan_from_file(file, on_link_loss=LinkLoss.LAND).id != first.id


@pytest.mark.parametrize(
    ("check", "clearance_m"),
    [
        ({"passed": True, "clearance_m": 0.35, "body_radius_m": 0.15}, 0.2),
        ({"passed": True, "clearance_m": None, "body_radius_m": 0.15}, 0.0),
        ({"passed": True}, 0.0),
        ({"passed": False, "clearance_m": 0.35, "body_radius_m": 0.15}, 0.0),
        ({"passed": True, "clearance_m": float("nan"), "body_radius_m": 0.15}, 0.0),
        ({"passed": True, "clearance_m": -0.1, "body_radius_m": 0.15}, 0.0),
        ({"passed": True, "clearance_m": "far", "body_radius_m": 0.15}, 0.0),
    ],
)
def test_only_a_clearance_that_the_gate_proved_is_stated(check: dict[str, object], clearance_m: float):
    assert wire.plan_from_file(_file(_wiggle(np.array([1.0])), **check)).clearance_m == np.float32(clearance_m)


def test_a_value_beyond_the_controllers_range_is_refused_by_name_and_bound():
    short = _wiggle(np.array([1.0, 0.0199]))
    with pytest.raises(InputError, match=r"segment 1 of trajectory lasts 0\.0199 s; the vehicle takes 0\.02 to 60 s"):
        wire.plan_from_trajectory(short)
    with pytest.raises(InputError, match=r"segment 0 of trajectory lasts 60\.1 s"):
        wire.plan_from_trajectory(_wiggle(np.array([60.1, 1.0])))
    with pytest.raises(InputError, match="lasts 3601 s; the vehicle takes up to 3600 s"):
        wire.plan_from_trajectory(_wiggle(np.append(np.full(60, 60.0), 1.0)))
    far = Trajectory(np.array([1.0, 1.0]), np.full((2, 4, 1), 1e39) * np.array([0.0, 1.0])[:, None, None])
    with pytest.raises(InputError, match="segment 1 of trajectory has numbers beyond"):
        wire.plan_from_trajectory(far)
    good = _wiggle(np.array([1.0]))
    for id in (0, -1, 2**32):
        with pytest.raises(InputError, match="trajectory id"):
            wire.plan_from_trajectory(good, id=id)
    for clearance_m in (-0.1, float("nan"), float("inf")):
        with pytest.raises(InputError, match="clearance"):
            wire.plan_from_trajectory(good, clearance_m=clearance_m)
