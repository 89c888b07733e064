"""The batched closed loop: the same bits however it is run, and the same flight as the loop in Python."""

from dataclasses import replace

import numpy as np
import pytest

import preflight
from firmware_bridge import Sensors, closed_loop
from firmware_bridge.controller import RefusedError, State, parameters_of
from flight import InputError, Trajectory
from preflight import core, draws
from tests.preflight.conftest import EXACT, there_and_back
from vehicle import invert, native, simulate

IDLE = """from vehicle.effects.base import Effect, Spec, Stage
EFFECT = Effect(name="idle", number=900, stage=Stage.MASS, apply=lambda body, p: None,
    parameters=(Spec("nil", "1", prior=1.0, bounds=(-1.0, 1.0), planted=0.0),), law="none", source="this test",
    channel="none", regressor="none", excited_by=())
"""
WINDY = replace(preflight.Uncertainty(), wind_m_s=2.0, gust_std_m_s=1.0, drop_outs_per_s=0.5)


def loop_of(form, curve, drone, **options) -> core.Loop:
    return core.Loop(form, curve, parameters_of(drone), clearance_m=1.0, **options)


def same(one: core.Flown, other: core.Flown) -> bool:
    names = core.Flown.__slots__
    return all(np.array_equal(getattr(one, n), getattr(other, n), equal_nan=True) for n in names if n != "steps")


def test_one_and_three_threads_give_the_same_bits(form, curve, drone):
    loop = loop_of(form, curve, drone)
    drawn = draws.draw(form, loop.names, WINDY, 7, seed=3)
    alone, shared = (loop.fly(drawn.values, drawn.rows, seed=3, threads=n) for n in (1, 3))
    assert same(alone, shared)
    assert alone.steps == shared.steps


def test_a_flight_does_not_depend_on_those_beside_it(form, curve, drone):
    loop = loop_of(form, curve, drone)
    drawn = draws.draw(form, loop.names, WINDY, 5, seed=3)
    whole = loop.fly(drawn.values, drawn.rows, seed=3)
    last = loop.fly(drawn.values[4:], drawn.rows[4:], seed=3, numbers=np.array([4]))
    assert np.array_equal(whole.position_world_m[4:], last.position_world_m, equal_nan=True)
    assert not np.array_equal(whole.error_m[3], whole.error_m[4], equal_nan=True)


def test_without_noise_it_flies_as_the_loop_in_python(form, curve, drone):
    assert differs_by_m(form, curve, drone, drone) < 2e-3


def differs_by_m(form, curve, drone, true) -> float:
    """Largest difference of the tracking error from that of the loop in Python round a plant of the true vehicle."""
    perfect = Sensors()
    start = simulate.State(curve.position([0.0])[0] * [1.0, 1.0, 0.0])
    plant = simulate.Plant(true, start, ground_m=0.0, step_s=closed_loop.TICK_US * 1e-6)
    own = closed_loop.fly(plant, parameters_of(drone), curve, sensors=perfect, imu=True)
    loop = loop_of(form, curve, drone, sensors=perfect, rate_hz=400, rotor_speed_measured=True)
    drawn = draws.draw(form, loop.names, replace(EXACT, pose_delay_s=0.0), 1, seed=1)
    flown = loop.fly(drawn.values, drawn.rows, seed=1)
    on = np.isfinite(flown.path_s[0]) & (flown.state[0] == closed_loop.State.TRAJECTORY)
    at = np.rint(flown.path_s[0][on] / (closed_loop.TICK_US * 1e-6)).astype(int)
    inside = at < len(own.error_m)
    assert inside.sum() > 400
    return float(np.abs(flown.error_m[0][on][inside] - own.error_m[at[inside]]).max())


@pytest.mark.slow
def test_without_noise_it_flies_as_the_equations_in_numpy(form, curve, drone, tmp_path):
    """An effect of one's own on the mass, which does nothing, makes the plant integrate in NumPy."""
    (tmp_path / "idle.py").write_text(IDLE)
    as_numpy = drone.with_effect_file(tmp_path / "idle.py")
    assert native.for_stepping(as_numpy) is None
    assert differs_by_m(form, curve, drone, as_numpy) < 2e-3


def test_a_steady_wind_is_cancelled_and_gusts_are_felt(form, curve, drone):
    loop = loop_of(form, curve, drone, sensors=replace(Sensors(), delay_s=EXACT.pose_delay_s))
    error_m = []
    for air in (EXACT, replace(EXACT, wind_m_s=3.0), replace(EXACT, wind_m_s=3.0, gust_std_m_s=2.0)):
        drawn = draws.draw(form, loop.names, air, 6, seed=1)
        flown = loop.fly(drawn.values, drawn.rows, seed=1)
        error_m.append(float(np.mean(flown.error_m[np.isfinite(flown.path_s)])))
    calm, windy, gusty = error_m
    assert windy < calm + 0.02
    assert gusty > 1.25 * windy


def test_a_lost_pose_ends_in_a_failsafe(form, curve, drone):
    loop = loop_of(form, curve, drone)
    drawn = draws.draw(form, loop.names, replace(EXACT, drop_outs_per_s=10.0, drop_out_s=5.0), 4, seed=1)
    assert (loop.fly(drawn.values, drawn.rows, seed=1).ending == core.FAILSAFE).all()


def test_a_fall_in_the_hover_and_after_a_landing_began_is_seen(form, curve, drone):
    """A storm that no pre-check refuses here: tracking is lost in the hover, and the landing becomes an emergency."""
    loop = loop_of(form, curve, drone)
    drawn = draws.draw(form, loop.names, replace(EXACT, wind_m_s=30.0), 2, seed=1)
    flown = loop.fly(drawn.values, drawn.rows, seed=1)
    assert (flown.ending == core.FAILSAFE).all()
    assert (flown.end_state == State.LANDING).all()
    assert flown.fell.all()
    assert (flown.state != core.NONE).sum(axis=1).min() > 500
    assert flown.strain.min() > 0.9
    calm = draws.draw(form, loop.names, EXACT, 2, seed=1)
    quiet = loop.fly(calm.values, calm.rows, seed=1)
    assert not quiet.fell.any()
    assert 0.0 < quiet.strain.max() < 0.5


def test_a_battery_effect_is_flown_full(form, curve, drone):
    with_battery = form.with_effect("battery_sag", sag_per_v=0.04, reference_v=16.8)
    flown = []
    for model in (form, with_battery):
        loop = loop_of(model, curve, drone)
        drawn = draws.draw(model, loop.names, EXACT, 1, seed=1)
        flown.append(loop.fly(drawn.values, drawn.rows, seed=1))
    assert same(*flown)


def flown_with(form, drone, curve, **given) -> core.Flown:
    """Ten flights of nothing but what is given."""
    loop = loop_of(form, curve, drone, sensors=replace(Sensors(), delay_s=EXACT.pose_delay_s))
    drawn = draws.draw(form, loop.names, replace(EXACT, **given), 10, seed=1)
    return loop.fly(drawn.values, drawn.rows, seed=1)


def test_a_rotor_that_loses_thrust_on_the_way_shakes_it_from_then_on_and_a_dead_one_throws_it(form, curve, drone):
    sound, weak, dead = (flown_with(form, drone, curve, motor_fault_ratio=loss) for loss in (0.0, 0.5, 1.0))
    drawn = draws.draw(form, core.native.compiled(form).names, replace(EXACT, motor_fault_ratio=0.5), 10, seed=1)
    begin = drawn.rows[:, core.DRAW_COLUMNS.index("fault_at")] * curve.duration_s
    for i in range(10):
        before = sound.path_s[i] < begin[i] - core.SAMPLE_S
        assert np.array_equal(weak.error_m[i][before], sound.error_m[i][before])
    assert np.nanmax(weak.error_m) > np.nanmax(sound.error_m) + 0.05
    assert (weak.ending == core.FINISHED).all()
    assert dead.fell.all() or (dead.tilt_rad > np.pi / 2).all()


def test_a_pose_that_jumps_moves_the_vehicle_by_as_much_from_then_on(form, curve, drone):
    still, flown = (flown_with(form, drone, curve, pose_jump_std_m=size) for size in (0.0, 0.1))
    drawn = draws.draw(form, core.native.compiled(form).names, replace(EXACT, pose_jump_std_m=0.1), 10, seed=1)
    jump = np.stack([drawn.rows[:, core.DRAW_COLUMNS.index(f"jump_{axis}_m")] for axis in "xyz"], axis=1)
    ended, usual = (
        np.array([track[np.isfinite(track[:, 0])][-1] for track in f.position_world_m]) for f in (flown, still)
    )
    early = drawn.rows[:, core.DRAW_COLUMNS.index("jump_at")] < 0.7
    assert early.sum() >= 4
    assert (ended - usual)[early] == pytest.approx(-jump[early], abs=0.02)


def test_an_updraft_lifts_the_more_the_higher_it_is_flown(form, drone, curve):
    """Rotors turn slower in it; eight times as high it is twice as strong, and at z = 0 there is none."""
    saved_j = []
    for height_m in (-1.0, 1.25, 10.0):
        shifted = curve.coefficients.copy()
        shifted[:, 2, 0] = height_m
        calm, rising = (
            flown_with(form, drone, Trajectory(curve.durations_s, shifted), thermal_std_m_s=size).energy_j
            for size in (0.0, 0.5)
        )
        drawn = draws.draw(form, core.native.compiled(form).names, replace(EXACT, thermal_std_m_s=0.5), 10, seed=1)
        updraft = drawn.rows[:, core.DRAW_COLUMNS.index("updraft_m_s")]
        saved_j.append(float(np.polyfit(updraft, calm - rising, 2)[1]))
    below, low, high = saved_j
    assert below == pytest.approx(0.0, abs=1e-9)
    assert low > 0.0
    assert high == pytest.approx(2.0 * low, rel=0.15)


def test_a_low_battery_leaves_the_rotors_less_and_falls_with_the_energy_drawn(form, drone):
    """Of a vehicle whose rotors turn little faster than in its hover."""
    fastest = 1.4 * float(np.max(invert.hover(form)))
    form, drone = (replace(v, limits=replace(v.limits, rotor_speed_max_rad_s=fastest)) for v in (form, drone))
    gentle = there_and_back(1.0, 2.0)
    model = form.with_effect("battery_sag", sag_per_v=0.04, reference_v=16.8)
    full, low = (flown_with(model, drone, gentle, battery_v=volts) for volts in (None, 14.8))
    assert (full.ending == core.FINISHED).all()
    assert low.energy_j.mean() == pytest.approx(full.energy_j.mean(), rel=0.02)  # the observer finds it
    assert low.rotor_reserve.mean() < full.rotor_reserve.min() - 0.02
    loop = loop_of(model, gentle, drone, sensors=Sensors())
    drawn = draws.draw(model, loop.names, replace(EXACT, battery_v=14.8), 1, seed=1)
    drawn.rows[:, core.DRAW_COLUMNS.index("battery_fall_v_j")] *= 100.0
    emptied = loop.fly(drawn.values, drawn.rows, seed=1)
    assert emptied.rotor_reserve[0] < low.rotor_reserve.min()
    drawn.rows[:, core.DRAW_COLUMNS.index("battery_fall_v_j")] *= 100.0
    assert (loop.fly(drawn.values, drawn.rows, seed=1).ending == core.FINISHED).all()  # no emptier than empty


def test_the_rotors_speeds_are_told_only_where_they_are_measured(form, curve, drone):
    """A vehicle of slower motors than its controller takes them for, in gusts: the observer is surprised less."""
    slow = form.with_value("motor_lag.rise_s", 2.0 * form.value("motor_lag.rise_s"))
    flown = []
    for measured in (False, True):
        loop = loop_of(slow, curve, drone, rotor_speed_measured=measured, sensors=Sensors())
        drawn = draws.draw(slow, loop.names, replace(EXACT, gust_std_m_s=1.0), 2, seed=1)
        flown.append(loop.fly(drawn.values, drawn.rows, seed=1))
    assert not same(*flown)


def test_one_kind_of_luck_can_be_changed_alone(form, curve, drone):
    loop = loop_of(form, curve, drone, sensors=Sensors())
    drawn = draws.draw(form, loop.names, replace(EXACT, gust_std_m_s=1.0), 1, seed=3)
    usual, noise, air = (
        loop.fly(drawn.values, drawn.rows, seed=3, anew=anew) for anew in ((), [core.NOISE], [core.GUSTS])
    )
    assert same(usual, noise)  # perfect sensors
    assert not same(usual, air)


def test_a_late_pose_from_the_first_tick_on_is_flown(form, curve, drone):
    late = replace(EXACT, pose_delay_s=0.05)
    loop = loop_of(form, curve, drone, sensors=replace(Sensors(), delay_s=late.pose_delay_s))
    drawn = draws.draw(form, loop.names, late, 2, seed=1)
    assert (loop.fly(drawn.values, drawn.rows, seed=1).ending == core.FINISHED).all()


def test_rows_that_do_not_belong_together_are_refused(form, curve, drone):
    loop = loop_of(form, curve, drone)
    drawn = draws.draw(form, loop.names, EXACT, 3, seed=1)
    with pytest.raises(InputError, match=r"values have shape \(2, "):
        loop.fly(drawn.values[:2], drawn.rows, seed=1)
    with pytest.raises(InputError, match="numbers"):
        loop.fly(drawn.values, drawn.rows, seed=1, numbers=np.arange(2))


def test_gusts_without_a_length_are_refused():
    with pytest.raises(InputError, match="gust_length_m"):
        core.Air(gust_length_m=0.0)


def test_a_trajectory_that_the_vehicle_refuses_is_refused_here(form, curve, drone):
    with pytest.raises(RefusedError, match="segment"):
        loop_of(form, Trajectory(curve.durations_s / 8.0, curve.coefficients * 8.0 ** np.arange(6)), drone)


def test_a_control_rate_that_the_observer_does_not_bear_is_refused(form, curve, drone):
    with pytest.raises(InputError, match="400 to 1000"):
        loop_of(form, curve, drone, rate_hz=200)
