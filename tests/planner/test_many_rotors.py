"""Plans for six and eight rotors: the gate proves each rotor's limits with the allocation that flies."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import planner
from flight import InputError, Waypoints
from planner import PlanOptions
from planner.gate import gate
from planner.optimise import airframe
from planner.optimise.corrections import measured_excess
from planner.request import inputs
from tests.vehicle import frames
from vehicle import allocation, draft, flatness

WAY = Waypoints(np.array([[0, 0, 1.5], [5, 0, 2], [5, 5, 1.5], [0, 5, 2.5]]), np.full(4, np.nan))


def made(frame: str, axis_body=None):
    known = frames.large(frame, axis_body=axis_body)
    return draft.draft(known, limits="race").with_effect("rotor_drag_speed", drag_kg=1e-4)


@pytest.fixture(scope="module", params=["hex", "octo", "x8"])
def planned(request, open_sky):
    drone = made(request.param)
    return drone, planner.plan(WAY, open_sky, drone)


def test_rotors_that_turn_the_body_as_they_spin_up_are_planned_for(open_sky):
    """What needs the rotors' acceleration is nothing at steady speed, where the reduced model is made."""
    plain = made("x").without_effect("rotor_drag_speed")
    heavy = plain.with_effect("rotor_acceleration_torque", rotor_inertia_kg_m2=1e-4)
    one, other = (airframe.reduced(drone, drone.limits) for drone in (plain, heavy))
    np.testing.assert_array_equal(one.mix, other.mix)
    assert one.drag_per_speed_1_m == other.drag_per_speed_1_m
    assert planner.plan(WAY, open_sky, heavy).gate.passed


def test_the_gate_passes_and_every_rotor_stays_within_its_limits(planned):
    drone, plan = planned
    assert plan.gate.passed
    speed = flatness.state(drone, plan.trajectory, plan.trajectory.sample(0.002)).rotor_speed_rad_s
    assert speed.shape[1] == drone.rotors
    assert drone.limits.rotor_speed_min_rad_s < speed.min()
    assert speed.max() < drone.limits.rotor_speed_max_rad_s


def test_a_limit_below_what_one_rotor_needs_is_found_by_the_gate(planned, open_sky):
    drone, plan = planned
    speed = flatness.state(drone, plan.trajectory, plan.trajectory.sample(0.002)).rotor_speed_rad_s
    tight = drone.with_limits(rotor_speed_max_rad_s=float(speed.max()) * 0.99)
    found = gate.check(plan.trajectory, open_sky, tight, PlanOptions(control_reserve=0.0))
    assert not found.passed
    assert any("rotor speed" in one.name and not one.passed for one in found.checks)


@settings(max_examples=15)
@given(st.sampled_from(("hex", "octo")), st.integers(0, 1000))
def test_the_reduced_model_of_many_rotors_is_exact_near_hover_and_its_idle_rows_never_bind(frame, seed):
    drone = made(frame)
    reduced = airframe.reduced(drone, drone.limits)
    rng = np.random.default_rng(seed)
    motion = 1e-3 * rng.normal(size=(4, 5, 4))
    excess = airframe.excess_numpy(reduced, motion)
    assert excess.shape[1] == len(reduced.names) == 22
    fast, slow = excess[:, 6:14], excess[:, 14:]
    assert (fast[:, drone.rotors :] == -1.0).all()
    assert (slow[:, drone.rotors :] == -1.0).all()
    # fastest and slowest sum to what lies between the limits, whatever is flown
    between = reduced.effort_least - reduced.effort_most
    np.testing.assert_allclose(fast + slow, np.tile(between, (4, 1)), atol=1e-9)
    still = airframe.excess_numpy(reduced, np.zeros((1, 5, 4)))[0, 6 : 6 + drone.rotors]
    np.testing.assert_allclose(still, 1.0 - reduced.effort_most[: drone.rotors], atol=1e-6)


def test_what_the_model_measures_has_a_column_for_each_rotor_of_the_kernel(planned):
    drone, plan = planned
    frame = airframe.reduced(drone, drone.limits)
    found = measured_excess(frame, drone, plan.trajectory, np.array([0]), np.linspace(0.0, 1.0, 5))
    assert found.shape == (1, 5, len(frame.names))
    assert np.isfinite(found).all()


def leaning(frame: str, lean_rad: float, way: str):
    """Rotors that lean inwards, along the ring against their neighbours, or all ahead."""
    hubs, spin = draft.layout(0.28, frame)
    outward = hubs * [1.0, 1.0, 0.0] / np.hypot(hubs[:, 0], hubs[:, 1])[:, None]
    along = np.cross([0.0, 0.0, 1.0], outward) * spin[:, None]
    towards = {"inwards": -outward, "along the ring": along, "ahead": np.tile([1.0, 0.0, 0.0], (len(hubs), 1))}[way]
    return made(frame, np.cos(lean_rad) * np.array([0.0, 0.0, 1.0]) + np.sin(lean_rad) * towards)


def test_rotors_whose_torque_pushes_sideways_are_refused_by_planner_and_gate(planned, open_sky):
    inwards = leaning("hex", 0.35, "inwards")
    with pytest.raises(InputError, match=r"tilted rotors sideways \(0\.36 of torque over arm, at most 0\.02"):
        planner.plan(WAY, open_sky, inwards)
    with pytest.raises(InputError, match="tilted rotors sideways"):
        gate.check(planned[1].trajectory, open_sky, inwards)


@pytest.mark.parametrize(("frame", "way", "lean_rad"), [("hex", "along the ring", 0.35), ("octo", "ahead", 0.2)])
def test_rotors_that_lean_along_the_ring_or_all_ahead_are_admitted(frame, way, lean_rad, open_sky):
    drone = leaning(frame, lean_rad, way)
    assert inputs.admitted(WAY, open_sky, drone, None, None, None).vehicle is drone
    assert allocation.sideways(drone) < 1e-9


def test_of_tilted_rotors_that_are_planned_flatness_stays_within_the_gates_tilt(open_sky):
    drone = leaning("hex", 0.35, "along the ring")
    plan = planner.plan(WAY, open_sky, drone)
    assert plan.gate.passed
    tilt = flatness.state(drone, plan.trajectory, plan.trajectory.sample(0.002)).tilt_rad
    assert tilt.max() < drone.limits.tilt_rad * 1.0001


@pytest.mark.parametrize("frame", ["x", "hex", "octo", "x8"])
def test_a_ring_that_leans_inwards_pushes_sideways_by_the_tangent_of_its_lean(frame):
    assert allocation.sideways(made(frame)) == 0.0
    share = allocation.sideways(leaning(frame, 0.1, "inwards"))
    assert share == pytest.approx(np.tan(0.1), rel=0.02)
