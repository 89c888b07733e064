"""Touchdown is what the body shows: floors high, low, sloping and bumpy, seen through an estimate that errs."""

import numpy as np
import pytest
from judge import LARGEST_STOP_M, landed_by, violations
from scenario import (
    FROM_START,
    START,
    TABLE,
    TAKE_OFF,
    Command,
    Fault,
    Kind,
    Loss,
    Order,
    Policy,
    Reason,
    Scenario,
    State,
    circle,
    land,
    legs,
)

LONGEST_ON_GROUND_S = 3.0
"""From the first touch to rotors off: about one second, more after a bounce."""


def over_floor(floor_m: float, height_m: float = 1.5, **options) -> Scenario:
    """Takes off from a small table or, for a higher floor, beside a roof; flies `height_m` above the floor; lands."""
    if floor_m < 0:
        world, corner = TABLE | {"floor_m": floor_m}, (4.0, 0.0, 1.5)
    else:
        world = {"plate_m": floor_m, "plate_min_m": (2.0, -50.0), "plate_max_m": (50.0, 50.0)}
        corner = (0.0, 0.0, floor_m + 1.5)
    path = legs([(0, 0, 1.5), corner, (4.0, 0.0, floor_m + height_m)], speed_m_s=5.0)
    orders = (*TAKE_OFF, START, land(path.duration_s + 1.0, State.TRAJECTORY))
    return Scenario(orders=orders, path=path, world=world, **options)


def hover_and_land(**options) -> Scenario:
    return Scenario(orders=(*TAKE_OFF, land(1.0)), **options)


def soft(result, **options) -> None:
    """Fails with what the judge says; and the rotors must not run on for long on the ground."""
    assert violations(result, **options) == []
    assert result.entered_s(State.DISARMED) - result.hardest_touchdown_s < LONGEST_ON_GROUND_S
    assert result.end_tilt_rad < 0.5


@pytest.mark.parametrize("floor_m", [-20.0, -10.0, -3.0, -0.75, 0.5, 3.0, 10.0, 20.0])
def test_lands_on_floors_far_below_and_above_the_take_off_point(body, floor_m):
    soft(body.fly(over_floor(floor_m)))


@pytest.mark.parametrize("height_m", [0.3, 0.8, 4.0])
def test_lands_from_any_height_above_a_lower_floor(body, height_m):
    soft(body.fly(over_floor(-3.0, height_m)))


def test_comes_down_past_the_take_off_height_without_stopping_there(body):
    path = legs([(0, 0, 1.5), (4, 0, 1.5)], speed_m_s=5.0)
    orders = (*TAKE_OFF, START, land(path.duration_s + 1.0, State.TRAJECTORY))
    soft(body.fly(Scenario(orders=orders, path=path, world=TABLE | {"floor_m": -12.0})))


@pytest.mark.parametrize("degrees", [5, 10, 15])
@pytest.mark.parametrize("seed", [1, 2])
def test_lands_on_a_slope(body, degrees, seed):
    slope = float(np.tan(np.radians(degrees)))
    soft(body.fly(hover_and_land(world={"slope": (slope, 0.5 * slope)}, seed=seed)))


@pytest.mark.parametrize("bump_m", [0.03, 0.08])
def test_lands_on_bumps(body, bump_m):
    soft(body.fly(hover_and_land(world={"bump_m": bump_m, "bump_length_m": 0.5})))


@pytest.mark.parametrize("gain", [0.0, 2.0, 4.0])
def test_lands_through_ground_effect(body, gain):
    soft(body.fly(hover_and_land(vehicle={"ground_effect": gain})))


@pytest.mark.parametrize("wind_m_s", [0.0, 4.0])
def test_lands_in_gusts(body, wind_m_s):
    for seed in range(1, 5):
        world = {"wind_m_s": (wind_m_s, 0.0, 0.0), "gust_std_m_s": 1.0}
        assert violations(body.fly(hover_and_land(world=world, seed=seed))) == []


@pytest.mark.parametrize("drift_m_s", [-0.1, -0.05, 0.05, 0.1])
def test_lands_while_the_estimated_height_drifts(body, drift_m_s):
    drift = Fault(Kind.DRIFT, (0.0, 0.0, drift_m_s), after_s=0.0)
    scenario = Scenario(orders=(*TAKE_OFF, land(8.0)), faults=(drift,), sensors={"height_wander_m": 0.3})
    soft(body.fly(scenario))


@pytest.mark.parametrize("bias_m_s", [-0.3, -0.15, 0.15, 0.3])
@pytest.mark.parametrize("consistent", [False, True])
@pytest.mark.parametrize("floor_m", [0.0, -2.0])
def test_lands_with_a_biased_vertical_velocity(body, bias_m_s, consistent, floor_m):
    faults = [Fault(Kind.VELOCITY_BIAS, (bias_m_s,))]
    if consistent:  # an estimator whose height is the integral of that velocity
        faults.append(Fault(Kind.DRIFT, (0.0, 0.0, bias_m_s)))
    if floor_m < 0:
        faults.append(Fault(Kind.FLOOR, (floor_m,)))
    soft(body.fly(Scenario(orders=(*TAKE_OFF, land(1.0)), faults=tuple(faults))))


def test_a_velocity_bias_above_the_landing_speed_still_comes_down(body):
    faults = (Fault(Kind.VELOCITY_BIAS, (-0.4,)), Fault(Kind.DRIFT, (0.0, 0.0, -0.4)))
    scenario = Scenario(orders=(*TAKE_OFF, land(1.0)), faults=faults, parameters={"landing_m_s": 0.35})
    assert violations(body.fly(scenario)) == []


@pytest.mark.parametrize("bias_m_s", [-0.55, 0.55])
@pytest.mark.parametrize("pose_rate_hz", [50.0, 100.0])
def test_a_large_velocity_bias_does_not_hide_the_touchdown(body, bias_m_s, pose_rate_hz):
    """Between two poses the height is carried on by that velocity: it moves like a saw on a vehicle that stands."""
    bias = Fault(Kind.VELOCITY_BIAS, (bias_m_s,))
    scenario = Scenario(
        orders=(*TAKE_OFF, land(1.0)), faults=(bias,), sensors={"pose_rate_hz": pose_rate_hz}, limit_s=30.0
    )
    assert violations(body.fly(scenario), touchdown_m_s=0.8 + abs(bias_m_s) + 0.3) == []


def test_lands_without_an_accelerometer_and_without_vertical_velocity(body):
    for missing in ("has_specific_force", "has_vertical_velocity"):
        result = body.fly(over_floor(-3.0, sensors={missing: 0}))
        assert violations(result, touchdown_m_s=2.5, must_fly=False) == []


@pytest.mark.parametrize("vibration_m_s2", [0.0, 5.0])
def test_lands_with_a_poor_accelerometer(body, vibration_m_s2):
    sensors = {"vibration_m_s2": vibration_m_s2, "accelerometer_bias_m_s2": (0.3, -0.3, 0.5)}
    soft(body.fly(over_floor(-3.0, sensors=sensors)))


def test_a_tilted_estimate_does_not_keep_it_from_landing(body):
    assert violations(body.fly(hover_and_land(sensors={"tilt_error_rad": (0.05, -0.05)}))) == []


@pytest.mark.parametrize("into_s", [1.4, 1.9, 2.4, 2.9, 3.4])
def test_landing_while_braking_from_ten_metres_a_second_stays_on(body, into_s):
    path = legs([(0, 0, 1.5), (25, 0, 1.5)], speed_m_s=10.0, acceleration_m_s2=8.0)
    orders = (*TAKE_OFF, START, land(into_s, State.TRAJECTORY))
    result = body.fly(Scenario(orders=orders, path=path, world=TABLE | {"floor_m": -3.0}))
    assert result.largest_speed_m_s > 3.0
    soft(result)


@pytest.mark.parametrize("floor_m", [0.0, -3.0])
def test_a_fence_breach_lands_on_the_floor_that_is_there(body, floor_m):
    """A gust carries it out of a narrow fence."""
    blown = Fault(Kind.GUST, (0.0, 16.0, 0.0), after_s=1.0, duration_s=3.0)
    faults = (blown, Fault(Kind.FLOOR, (floor_m,))) if floor_m < 0 else (blown,)
    scenario = Scenario(
        faults=faults, parameters={"fence_max_y_m": 0.35, "fence_min_y_m": -2.0, "kp_xy_1_s2": 3.0, "observer": 0.0}
    )
    result = body.fly(scenario)
    assert landed_by(result, Reason.FENCE_BREACH)
    assert violations(result) == []


@pytest.mark.parametrize("floor_m", [-20.0, -3.0, -0.75])
def test_a_lost_link_lands_on_the_floor_that_is_there(body, floor_m):
    path = legs([(0, 0, 1.5), (6, 0, 1.5), (6, 0, floor_m + 1.5)], speed_m_s=4.0, policy=Policy.LAND)
    lost = Fault(Kind.LINK_LOST, after_s=path.duration_s - 3.0, since=State.TRAJECTORY)
    result = body.fly(
        Scenario(orders=(*TAKE_OFF, START), path=path, faults=(lost,), world=TABLE | {"floor_m": floor_m}, limit_s=90.0)
    )
    assert landed_by(result, Reason.LINK_LOST)
    soft(result)


def test_a_throw_downwards_in_landing_is_not_a_touchdown(body):
    for after_s in (0.2, 0.5, 1.0):
        kick = Fault(Kind.KICK, (0.0, 0.0, -3.0), after_s=after_s, since=State.LANDING)
        result = body.fly(over_floor(-20.0, 18.0, faults=(kick,), limit_s=90.0))
        assert violations(result) == []


@pytest.mark.parametrize("rotor", range(4))
def test_a_dead_rotor_in_landing_is_not_a_touchdown(body, rotor):
    dead = Fault(Kind.ROTOR_HEALTH, (rotor, 0.0), after_s=1.0, since=State.LANDING)
    result = body.fly(over_floor(-20.0, 15.0, faults=(dead,), limit_s=90.0))
    in_air = result.stop_clearance_m > LARGEST_STOP_M
    assert not (in_air and result.stop_reason == Reason.TOUCHDOWN)
    assert result.at_rest


def test_a_vehicle_on_its_back_stops_its_rotors(body):
    """A rotor dies half a metre up: it hits the floor tumbling, and must not claw there for long."""
    for rotor in range(4):
        dead = Fault(Kind.ROTOR_HEALTH, (rotor, 0.0), after_s=1.0)
        low = (Order(Command.ARM, 0, 0.3, FROM_START), Order(Command.TAKE_OFF, 0.5, 0.8, FROM_START))
        result = body.fly(Scenario(orders=low, faults=(dead,), limit_s=20.0))
        assert result.at_rest
        assert result.stop_s - result.first_touchdown_s < 3.0


@pytest.mark.parametrize("loss", [Loss.FROZEN, Loss.NOT_VALID, Loss.NAN, Loss.NO_XY])
@pytest.mark.parametrize("floor_m", [0.0, -3.0])
def test_an_emergency_descent_ends_on_the_ground(body, loss, floor_m):
    lost = Fault(Kind.POSITION_LOST, (loss,), after_s=1.0)
    faults = (lost, Fault(Kind.FLOOR, (floor_m,))) if floor_m < 0 else (lost,)
    result = body.fly(Scenario(faults=faults))
    assert State.EMERGENCY in result.states
    assert violations(result, touchdown_m_s=1.5 if loss == Loss.NO_XY else 2.5) == []
    assert result.stop_s - result.hardest_touchdown_s < LONGEST_ON_GROUND_S


@pytest.mark.parametrize("has_specific_force", [0, 1])
def test_the_height_is_still_measured_when_only_the_horizontal_position_is_lost(body, has_specific_force):
    """In wind that lifts it a little: the descent is at the landing speed, not blind."""
    lost = Fault(Kind.POSITION_LOST, (Loss.NO_XY,), after_s=1.0)
    world = {"wind_m_s": (2.5, 0.0, 0.3)}
    result = body.fly(Scenario(faults=(lost,), world=world, sensors={"has_specific_force": has_specific_force}))
    assert violations(result) == []
    assert result.hardest_touchdown_m_s < 1.1
    assert result.first_touchdown_s - result.entered_s(State.EMERGENCY) < 4.0


@pytest.mark.parametrize("floor_m", [0.0, -3.0])
def test_without_accelerometer_and_vertical_velocity_the_gyro_ends_the_descent(body, floor_m):
    """An unload test would show nothing but the fall's end; a torque that no longer turns it does."""
    blind = {"after_s": 0.5, "since": State.LANDING}
    faults = (Fault(Kind.NO_SPECIFIC_FORCE, **blind), Fault(Kind.NO_VERTICAL_VELOCITY, **blind))
    world = TABLE | {"floor_m": floor_m} if floor_m else {}
    result = body.fly(
        Scenario(orders=(*TAKE_OFF, land(1.0)), faults=faults, world=world, parameters={"emergency_s": 12.0})
    )
    assert violations(result, touchdown_m_s=2.5) == []
    assert (result.stop_state, result.stop_reason) == (State.DISARMED, Reason.TOUCHDOWN)
    assert result.stop_s - result.entered_s(State.EMERGENCY) < 12.0


@pytest.mark.parametrize("slope", [0.0, 0.1, -0.1])
@pytest.mark.parametrize("wind_m_s", [0.0, 2.0])
def test_a_blind_descent_does_not_float_along_the_ground(body, slope, wind_m_s):
    """Downhill, downwind, and in ground effect four per cent less than the weight is enough to stay up."""
    for seed in range(3):
        lost = Fault(Kind.POSITION_LOST, (Loss.FROZEN,), after_s=1.0)
        world = {"slope": (slope, 0.0), "wind_m_s": (wind_m_s, 0.0, 0.0), "gust_std_m_s": 0.3}
        result = body.fly(Scenario(faults=(lost,), world=world, seed=seed))
        assert violations(result, touchdown_m_s=2.5) == []


def test_no_path_is_ever_mistaken_for_the_ground(body):
    """Fast flight, steep descents and stops: nothing but an order lands."""
    for seed, speed in enumerate((3.0, 6.0, 9.0)):
        path = circle(speed, radius_m=max(4.0, speed**2 / 8))
        orders = (*TAKE_OFF, START, land(path.duration_s + 1.0, State.TRAJECTORY))
        soft(body.fly(Scenario(orders=orders, path=path, seed=seed)))


LONGEST_AFTER_TOUCH_S = 5.0


def _after_touch_s(result) -> float:
    return (result.stop_s if result.at_rest else result.end_s) - result.first_touchdown_s


@pytest.mark.parametrize("blind", [False, True])
@pytest.mark.parametrize(
    "options",
    [{"vehicle": {"contact_n_s_m": 0.5, "contact_n_m": 2000.0}}, {"vehicle": {"contact_n_s_m": 2.0}},
     {"sensors": {"vibration_m_s2": 10.0}}],
)  # fmt: skip
def test_no_rotor_turns_long_after_the_touch_whatever_bounces_or_vibrates(body, options, blind):
    for seed in range(4):
        faults = (Fault(Kind.POSITION_LOST, (Loss.FROZEN,), 1.0),) if blind else ()
        orders = TAKE_OFF if blind else (*TAKE_OFF, land(1.0))
        result = body.fly(Scenario(orders=orders, faults=faults, seed=seed, **options))
        aloft_again_s = max(result.last_airborne_s - result.first_touchdown_s, 0.0)  # thrown up by what bounces
        assert result.at_rest
        assert _after_touch_s(result) - aloft_again_s < LONGEST_AFTER_TOUCH_S


@pytest.mark.parametrize("rotor", range(4))
def test_no_rotor_turns_long_after_a_crash(body, rotor):
    for after_s in (0.4, 1.3, 2.2):
        dead = Fault(Kind.ROTOR_HEALTH, (rotor, 0.0), after_s)
        result = body.fly(Scenario(faults=(dead,), seed=rotor))
        assert _after_touch_s(result) < LONGEST_AFTER_TOUCH_S


@pytest.mark.parametrize(
    "drift_m_s", [(-0.27, -0.03, -0.26), (0.0, 0.3, -0.04), (-0.12, -0.23, -0.13), (0.25, 0.25, 0.0)]
)
def test_an_estimate_that_drifts_on_the_ground_does_not_keep_the_rotors_turning(body, drift_m_s):
    """It leans against the drift and turns on its feet; what carries it is more than its rotors give."""
    for seed in range(4):
        drift = Fault(Kind.DRIFT, drift_m_s, after_s=0.2, since=State.LANDING)
        result = body.fly(Scenario(orders=(*TAKE_OFF, land(1.0)), faults=(drift,), seed=seed))
        assert _after_touch_s(result) < LONGEST_AFTER_TOUCH_S


@pytest.mark.parametrize("sensors", [{}, {"has_specific_force": 0}])
@pytest.mark.parametrize("sinks_m_s", [0.3, 0.4, 0.6])
def test_an_estimate_that_sinks_on_the_ground_does_not_keep_the_rotors_turning(body, sinks_m_s, sensors):
    """Height and vertical speed agree that it sinks; but the accelerometer shows that something carries it, or neither
    grows as in a fall."""
    bias = Fault(Kind.VELOCITY_BIAS, (-sinks_m_s,), since=State.TAKE_OFF)
    drift = Fault(Kind.DRIFT, (0.0, 0.0, -sinks_m_s), since=State.TAKE_OFF)
    for seed in range(4):
        result = body.fly(Scenario(orders=(*TAKE_OFF, land(1.0)), faults=(bias, drift), seed=seed, sensors=sensors))
        assert result.at_rest
        assert _after_touch_s(result) < LONGEST_AFTER_TOUCH_S


def test_a_hover_that_sank_to_the_ground_without_notice_lands(body):
    """Estimated height and its velocity rise together while it stands."""
    faults = (Fault(Kind.VELOCITY_BIAS, (0.3,)), Fault(Kind.DRIFT, (0.0, 0.0, 0.3)))
    result = body.fly(Scenario(faults=faults, orders=TAKE_OFF, limit_s=30.0))
    assert result.reason_of(State.LANDING) == Reason.GROUNDED
    assert _after_touch_s(result) < LONGEST_AFTER_TOUCH_S


@pytest.mark.parametrize("felt", [True, False])
@pytest.mark.parametrize("rise_m_s", [0.11, 0.14])
def test_a_path_that_sank_to_the_ground_without_notice_lands(body, rise_m_s, felt):
    """It turns and bounces on its feet: neither accelerometer nor rotors' commands tell what carries it."""
    path = circle(2.5, radius_m=2.0, turns=2.0)
    orders = (*TAKE_OFF, START, land(path.duration_s + 4.0, State.TRAJECTORY))
    faults = [Fault(Kind.VELOCITY_BIAS, (rise_m_s,), since=State.TAKE_OFF)]
    faults += [Fault(Kind.DRIFT, (0.0, 0.0, rise_m_s), since=State.TAKE_OFF)]
    faults += [] if felt else [Fault(Kind.NO_SPECIFIC_FORCE)]
    for seed in range(4):
        result = body.fly(Scenario(orders=orders, faults=tuple(faults), path=path, seed=seed, limit_s=60.0))
        assert _after_touch_s(result) < LONGEST_AFTER_TOUCH_S


def test_a_dead_reckoned_speed_does_not_keep_the_rotors_turning_on_the_ground(body):
    """Position and velocity stop in flight; the dead-reckoned estimate moves on after the touch."""
    path = circle(3.0, radius_m=2.0, turns=1.0)
    for seed in range(4):
        faults = (
            Fault(Kind.POSITION_LOST, (Loss.NO_XY,), 1.5, since=State.TRAJECTORY),
            Fault(Kind.SPEED_WRONG, (-2.8, -0.3, -0.6), 3.0, since=State.TRAJECTORY),
        )
        orders = (*TAKE_OFF, START)
        result = body.fly(Scenario(orders=orders, faults=faults, path=path, seed=seed, limit_s=60.0))
        assert result.at_rest
        assert _after_touch_s(result) < LONGEST_AFTER_TOUCH_S


@pytest.mark.parametrize("gust_m_s", [0.0, 0.8])
@pytest.mark.parametrize(
    "lost", [Fault(Kind.POSITION_LOST, (Loss.FROZEN,), 1.0), Fault(Kind.NO_VERTICAL_VELOCITY, (), 1.0)]
)
def test_the_gyro_alone_tells_the_ground_from_the_air(body, gust_m_s, lost):
    """A small roll torque to and fro turns a body in the air, and none that stands, or floats on ground effect."""
    for seed in range(12):
        faults = (Fault(Kind.NO_SPECIFIC_FORCE), lost)
        world = {"gust_std_m_s": gust_m_s, "wind_m_s": (2.0 * gust_m_s, 0.0, 0.0)}
        result = body.fly(Scenario(orders=TAKE_OFF, faults=faults, world=world, seed=seed, limit_s=60.0))
        assert result.at_rest
        assert result.stop_clearance_m < LARGEST_STOP_M
        assert result.stop_s - max(result.first_touchdown_s, result.last_airborne_s) < LONGEST_AFTER_TOUCH_S


@pytest.mark.parametrize("after_s", [3.2, 3.3, 3.4, 6.5])
def test_an_accelerometer_lost_in_a_blind_descent_neither_drops_it_nor_passes_for_the_ground(body, after_s):
    """A look for the ground that it was to judge is given up, and the test by torque begins then."""
    up = legs([(0, 0, 1.5), (0, 0, 8.0)], speed_m_s=4.0)
    lost_s = up.duration_s + 1.0
    for seed in range(3):
        faults = (
            Fault(Kind.POSITION_LOST, (Loss.NAN,), lost_s, since=State.TRAJECTORY),
            Fault(Kind.NO_SPECIFIC_FORCE, after_s=lost_s + after_s, since=State.TRAJECTORY),
        )
        result = body.fly(Scenario(orders=(*TAKE_OFF, START), path=up, faults=faults, seed=seed, limit_s=90.0))
        assert violations(result, touchdown_m_s=2.5) == []


def test_braking_upwards_is_no_ground(body):
    """Little thrust is asked for while the mixer, turning hard, gives more."""
    for seed in range(6):
        path = legs([(0, 0, 1.5), (0.5, 0, 4.5), (0, 0.5, 1.5)], speed_m_s=6.0, acceleration_m_s2=8.0)
        kick = Fault(Kind.KICK, (0.0, 0.0, 0.0, 3.0), 0.45, since=State.TRAJECTORY)
        orders = (*TAKE_OFF, START, land(path.duration_s + 1.0, State.TRAJECTORY))
        result = body.fly(Scenario(orders=orders, path=path, faults=(kick,), seed=seed))
        assert not result.had(Reason.GROUNDED)


def test_a_blind_descent_from_high_up_touches_softly(body):
    """Each look for the ground costs speed, and is given back."""
    up = legs([(0, 0, 1.5), (0, 0, 18.0)], speed_m_s=6.0)
    for seed in range(6):
        lost = Fault(Kind.POSITION_LOST, (Loss.FROZEN,), up.duration_s + 1.0, since=State.TRAJECTORY)
        world = {"gust_std_m_s": 0.8, "wind_m_s": (1.5, 0.0, 0.0)}
        result = body.fly(
            Scenario(orders=(*TAKE_OFF, START), path=up, faults=(lost,), world=world, seed=seed, limit_s=90.0)
        )
        assert violations(result, touchdown_m_s=2.5) == []
        assert np.hypot(*result.end_position_m[:2]) < 25.0


@pytest.mark.parametrize("floor_m", [-15.0, -3.5, -2.3])
def test_an_edge_that_was_touched_in_a_blind_descent_is_not_the_ground(body, floor_m):
    """Less thrust after an impact, and far to fall, or so little that there is no time for a second look."""
    for x_m in (0.5, 0.55, 0.6, 0.65, 0.7):
        path = legs([(0, 0, 1.5), (x_m, 0, 1.2)], speed_m_s=1.0)
        lost = Fault(Kind.POSITION_LOST, (Loss.FROZEN,), path.duration_s + 1.0, since=State.TRAJECTORY)
        world = TABLE | {"floor_m": floor_m}
        result = body.fly(Scenario(orders=(*TAKE_OFF, START), path=path, faults=(lost,), world=world, limit_s=90.0))
        assert violations(result, touchdown_m_s=2.5) == []


def test_a_blind_descent_after_fast_flight_leans_against_the_wind_of_a_hover(body):
    """What the observer finds at 9 m/s is drag that the model lacks, most of it, and no wind."""
    path = circle(9.0, radius_m=13.0, turns=1.0)
    for angle in (0.0, 2.1, 4.2):
        world = {"wind_m_s": (3.0 * np.cos(angle), 3.0 * np.sin(angle), 0.0)}
        lost = Fault(Kind.POSITION_LOST, (Loss.FROZEN,), path.duration_s - 0.5, since=State.TRAJECTORY)
        flight = Scenario(orders=(*TAKE_OFF, START), path=path, faults=(lost,), world=world, limit_s=90.0)
        trace = body.fly(flight, trace_every=50).trace
        blind = np.flatnonzero(trace["state"] == State.EMERGENCY)
        speed_m_s = np.hypot(trace["vx"], trace["vy"])[blind]
        assert speed_m_s.max() < 0.4


@pytest.mark.parametrize("after_s", [0.15, 0.2, 0.25])
def test_a_pose_that_freezes_in_a_landing_is_not_the_ground(body, after_s):
    """Its height stays as the ground's would, and no accelerometer tells of the fall."""
    frozen = Fault(Kind.STUCK, (), after_s, since=State.LANDING)
    for seed in range(4):
        faults = (Fault(Kind.NO_SPECIFIC_FORCE, (), 0.5), frozen)
        result = body.fly(Scenario(orders=(*TAKE_OFF, land(1.0)), faults=faults, seed=seed))
        assert violations(result, touchdown_m_s=2.5) == []


def test_a_hover_that_a_missed_reset_sent_to_the_ground_lands(body):
    """Its estimate stands a little above the set-point: two thirds of the weight are asked for, a third is carried."""
    for seed in range(6):
        missed = Fault(Kind.RESET_MISSED, (0.2, 0.1, 1.53), 0.5)
        world = {"wind_m_s": (1.5, 1.5, 0.0), "gust_std_m_s": 0.8}
        result = body.fly(
            Scenario(faults=(missed,), orders=(*TAKE_OFF, land(12.0)), world=world, seed=seed, limit_s=40.0)
        )
        assert result.reason_of(State.LANDING) == Reason.GROUNDED
        assert _after_touch_s(result) < LONGEST_AFTER_TOUCH_S
