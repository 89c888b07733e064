"""The disturbance observer: what it finds, what it cancels, and when it must not."""

import sys
from pathlib import Path

import numpy as np
import pytest
from scenario import FROM_START, TAKE_OFF, Command, Fault, Kind, Order, Reason, Scenario, State, circle, land

sys.path.insert(0, str(Path(__file__).resolve().parents[3] / "benchmarks"))

import controller_worlds

OFF, WAITS, RUNS, HOLDS, NO_ACCELEROMETER = range(5)
WEIGHT_N = 0.7 * 9.80665
MODEL = {"rotor_lag_s": 0.03}
ENGAGE = Order(Command.ENGAGE, after_s=1.5, since=FROM_START)


def hover(**changes):
    """Twelve seconds in the air, the model learned."""
    return Scenario(**{"orders": TAKE_OFF, "parameters": MODEL, "limit_s": 14.0, **changes})


def steady(trace):
    return (trace["state"] == State.HOLD) & (trace["time_s"] > 9.0)


def force_n(trace):
    return np.stack([trace[f"force_{axis}"] for axis in "xyz"])


@pytest.mark.parametrize("world", [w for w in controller_worlds.WORLDS if w.bar_mm], ids=lambda world: world.name)
def test_the_path_is_held_within_its_bar_in_every_world(world):
    assert controller_worlds.fly(world, 1, {}).mean_mm <= world.bar_mm


def test_without_it_a_light_wind_costs_five_times_as_much():
    world = next(w for w in controller_worlds.WORLDS if w.name == "wind 3 m/s")
    assert controller_worlds.fly(world, 1, {"observer": 0.0}).mean_mm > 50.0


@pytest.mark.parametrize("tick_s", [0.005, 0.00025])
def test_it_works_at_every_control_rate(tick_s, body):
    scenario = hover(world={"wind_m_s": (3.0, 0.0, 0.0)}, tick_s=tick_s, limit_s=9.0)
    trace = body.fly(scenario, trace_every=1).trace
    last = (trace["state"] == State.HOLD) & (trace["time_s"] > 7.0)
    assert np.hypot(trace["x"], trace["y"])[last].mean() < 0.02


def test_off_flies_as_without_an_accelerometer_bit_for_bit(body):
    """Before landing nothing but the observer looks at the accelerometer."""
    scenario = {"orders": (*TAKE_OFF, Order(Command.START, after_s=0.5)), "path": circle(5.0), "limit_s": 12.0}
    off = Scenario(**scenario, parameters={**MODEL, "observer": 0.0, "obs_force_hz": 3.0, "obs_fuse_rad_s": 2.0})
    without = Scenario(**scenario, parameters=MODEL, sensors={"has_specific_force": 0})
    first, second = body.fly(off, trace_every=1).trace, body.fly(without, trace_every=1).trace
    assert set(first["observer"][3000:]) == {OFF}
    assert set(second["observer"][3000:]) == {NO_ACCELEROMETER}
    for i in range(4):
        assert np.array_equal(first[f"command{i}"], second[f"command{i}"])


@pytest.mark.parametrize("mass", [0.95, 1.05])
def test_a_wrong_mass_is_found_as_a_vertical_force(body, mass):
    trace = body.fly(hover(vehicle={"mass_kg": 0.7 * mass}), trace_every=1).trace
    assert force_n(trace)[2][steady(trace)].mean() == pytest.approx((1.0 - mass) * WEIGHT_N, abs=0.02)


def test_a_wind_is_found_along_its_direction(body):
    trace = body.fly(hover(world={"wind_m_s": (3.0, -4.0, 0.0)}), trace_every=1).trace
    mean = force_n(trace)[:2][:, steady(trace)].mean(axis=1)
    drag_n = 0.0175 * WEIGHT_N * 5.0
    assert np.hypot(*mean) == pytest.approx(drag_n, rel=0.3)
    assert mean[1] / mean[0] == pytest.approx(-4.0 / 3.0, rel=0.1)


def test_a_weak_rotor_is_found_as_a_torque(body):
    weak = Fault(Kind.ROTOR_HEALTH, (2, 0.85), since=FROM_START)
    trace = body.fly(hover(faults=(weak,)), trace_every=1).trace
    torque = [trace[f"torque_{axis}"][steady(trace)].mean() for axis in "xy"]
    lost_n_m = 0.0885 * WEIGHT_N / 4 * 0.15 / 0.963
    assert torque == pytest.approx([lost_n_m, -lost_n_m], rel=0.15)


def test_the_stated_deviation_is_that_of_the_force(body):
    trace = body.fly(hover(parameters={**MODEL, "obs_fuse_rad_s": 0.5}), trace_every=1).trace
    spread = force_n(trace)[:, steady(trace)].std(axis=1).mean()
    assert trace["force_std"][steady(trace)].mean() == pytest.approx(spread, rel=0.5)


def test_a_biased_accelerometer_moves_the_vehicle_by_little(body):
    biased = hover(sensors={"accelerometer_bias_m_s2": (0.3, -0.3, 0.3)})
    trace = body.fly(biased, trace_every=1).trace
    gap = [trace[axis][steady(trace)].mean() - trace[f"setpoint_{axis}"][steady(trace)].mean() for axis in "xyz"]
    assert np.linalg.norm(gap) < 0.012


def test_it_waits_for_lift_off(body):
    heavy = hover(vehicle={"mass_kg": 0.77}, world={"wind_m_s": (4.0, 0.0, 0.0)})
    trace = body.fly(heavy, trace_every=1).trace
    standing = trace["clearance_m"] < 0.02
    assert not np.isin(trace["observer"][standing], (RUNS, HOLDS)).any()
    assert (force_n(trace)[:, standing] == 0.0).all()


def test_landing_and_emergency_hold_what_has_lasted(body):
    orders = (*TAKE_OFF, land(3.0))
    trace = body.fly(hover(orders=orders, world={"wind_m_s": (4.0, 0.0, 0.0)}), trace_every=1).trace
    landing = trace["state"] == State.LANDING
    assert set(trace["observer"][landing]) == {HOLDS}
    assert (np.ptp(force_n(trace)[:, landing], axis=1) == 0.0).all()
    assert force_n(trace)[0][landing][0] > 0.3


@pytest.mark.parametrize("world", [
    {"gust_std_m_s": 4.0},
    {"wind_m_s": (5.0, 0.0, 0.0), "gust_std_m_s": 1.5},
    {"slope": (0.36, 0.1)},
    {"bump_m": 0.05, "bump_length_m": 0.5},
])  # fmt: skip
def test_a_held_force_overturns_no_vehicle_on_the_ground(body, world):
    for seed in range(1, 9):
        orders = (*TAKE_OFF, land(1.0))
        result = body.fly(Scenario(orders=orders, world=world, seed=seed))
        assert result.at_rest
        assert result.hardest_touchdown_m_s < 1.5
        assert result.end_tilt_rad < 0.45


def test_engaging_begins_anew(body):
    scenario = Scenario(orders=(ENGAGE,), start_m=(0.0, 0.0, 4.0), parameters=MODEL, limit_s=6.0)
    trace = body.fly(scenario, trace_every=1).trace
    start = np.argmax(trace["state"] == State.HOLD)
    assert trace["observer"][start] == RUNS
    assert np.linalg.norm(force_n(trace)[:, start]) < 0.1
    assert np.linalg.norm(force_n(trace)[:, start:], axis=0).max() < 1.0


def test_without_accelerometer_it_is_off_and_says_so(body):
    gone = Fault(Kind.NO_SPECIFIC_FORCE, after_s=2.0)
    result = body.fly(hover(faults=(gone,), world={"wind_m_s": (2.0, 0.0, 0.0)}), trace_every=1)
    trace = result.trace
    assert set(trace["observer"][steady(trace)]) == {NO_ACCELEROMETER}
    assert (force_n(trace)[:, steady(trace)] == 0.0).all()
    assert int(trace["warnings"][-1]) & 64


def test_what_it_finds_is_limited(body):
    limited = hover(parameters={**MODEL, "obs_force_m_s2": 0.3}, world={"wind_m_s": (5.0, 0.0, 0.0)})
    trace = body.fly(limited, trace_every=1).trace
    assert np.abs(force_n(trace)).max() <= 0.3 * 0.7 + 1e-6


def test_saturation_winds_nothing_up(body):
    """Half a second with rotors that cannot carry it: afterwards the force is gone within half a second."""
    weak = tuple(Fault(Kind.ROTOR_HEALTH, (i, 0.25), after_s=1.0, duration_s=0.5) for i in range(4))
    trace = body.fly(hover(faults=weak, start_m=(0.0, 0.0, 30.0), orders=(ENGAGE,)), trace_every=1).trace
    assert trace["saturation"].max() > 0
    later = trace["time_s"] > 3.5
    assert np.abs(force_n(trace)[2][later]).max() < 0.6


@pytest.mark.parametrize("late_s", [0.0, 0.02, 0.04])
def test_an_untold_delay_is_found_to_three_milliseconds(late_s, body):
    world = controller_worlds.World("late", late_s=late_s)
    for seed in (1, 2, 3):
        trace = body.fly(controller_worlds.scenario(world, seed, {}), trace_every=1).trace
        moving = np.flatnonzero(trace["state"] == State.TRAJECTORY)
        for column in ("position_delay_s", "attitude_delay_s"):
            errors_s = np.abs(trace[column][moving] - late_s)
            assert errors_s[-1] < 0.003, column
            assert errors_s[3000:].max() < 0.004, column  # four standard deviations after six seconds


def test_a_relocalization_turns_the_force_with_the_frame(body):
    moved = Fault(Kind.RELOCALIZED, (1.0, 0.0, 0.0, np.pi / 2), after_s=3.0)
    trace = body.fly(hover(faults=(moved,), world={"wind_m_s": (4.0, 0.0, 0.0)}), trace_every=1).trace
    last = steady(trace)
    assert force_n(trace)[1][last].mean() > 0.3
    assert abs(force_n(trace)[0][last].mean()) < 0.1
    assert not any(change == State.LANDING for change in trace["state"])


@pytest.mark.parametrize("jump", [(3.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.5)])
def test_a_jump_of_the_pose_is_no_delay_and_no_disturbance(body, jump):
    fault = Fault(Kind.JUMP, jump, after_s=2.0)
    result = body.fly(hover(orders=(*TAKE_OFF, land(6.0)), faults=(fault,), limit_s=40.0), trace_every=1)
    assert result.at_rest
    assert result.hardest_touchdown_m_s < 1.5
    assert not result.had(Reason.TILT_ERROR)
    assert np.abs(result.trace["position_delay_s"]).max() < 0.025  # recovering turns hard
