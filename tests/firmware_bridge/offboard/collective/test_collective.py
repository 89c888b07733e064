"""Force, rotor speed and throttle: in air at rest, in motion, behind a lag, and of rotors weaker than the file says."""

import numpy as np
import pytest

import vehicle
from firmware_bridge import _controller, controller
from firmware_bridge.controller import Controller
from firmware_bridge.offboard import airborne
from firmware_bridge.offboard.collective.at_rest import Lead, RotorsAtRest
from firmware_bridge.offboard.collective.effectiveness import (
    GENTLE_M_S2,
    LEAST,
    MOST,
    SLOW_M_S,
    UPRIGHT,
    Effectiveness,
    Moment,
)
from goshawk.commands.fly import offboard

MODEL = vehicle.example("rigter2019")
SQUARE = MODEL.without_effect("thrust_bem").with_effect("thrust_quadratic")
AFFINE = SQUARE.with_effect("thrust_affine", constant_n=-0.2, slope_n_s=4e-4)
TICK_S = 0.004


def mixed(model, force_n: float, velocity_m_s=(0.0, 0.0, 0.0)) -> tuple[RotorsAtRest, np.ndarray]:
    parameters = Controller(controller.parameters_of(model)).raw.parameters().ravel()
    wrench = np.array([[force_n, 0.0, 0.0, 0.0]], np.float32)
    out, _ = _controller.mixer(parameters, wrench, np.array([velocity_m_s], np.float32), np.zeros((1, 3), np.float32))
    return RotorsAtRest(parameters, model.mass_kg), np.asarray(out[0, :4], np.float64)


@pytest.mark.parametrize("model", [MODEL, SQUARE, AFFINE], ids=["bem", "square", "affine"])
@pytest.mark.parametrize("share", [0.3, 1.0, 1.7])
def test_in_air_at_rest_it_is_the_force_that_was_asked_for_whatever_the_thrust_law(model, share):
    """An affine law agrees with the controller's square at hover only: its speeds elsewhere must not reach the map."""
    force_n = share * model.mass_kg * model.gravity_m_s2
    at_rest, speeds = mixed(model, force_n)
    assert at_rest.force_n(speeds, force_n) == pytest.approx(force_n, rel=2e-3)
    assert at_rest.lagging_rad_s(speeds, force_n) == pytest.approx(speeds, rel=2e-3)


def test_the_throttle_turns_the_rotors_as_fast_as_they_must_turn_in_motion():
    """By the vehicle's own forces: with the map alone, 6 m/s of sideways flow give 7 % more than was asked for."""
    force_n, velocity = 1.2 * MODEL.mass_kg * MODEL.gravity_m_s2, np.array([6.0, 0.0, -1.0])
    at_rest, speeds = mixed(MODEL, force_n, velocity)
    thrust_map, full_rad_s = offboard.thrust_map(MODEL), MODEL.limits.rotor_speed_max_rad_s

    def given_n(asked_n: float) -> float:
        turning = full_rad_s * (offboard.IDLE + (1.0 - offboard.IDLE) * thrust_map.throttle(asked_n))
        alone = MODEL.without_effect("parasitic_drag")
        return float(vehicle.wrench(alone, velocity[None], np.zeros((1, 3)), np.full((1, 4), turning))[0][0, 2])

    assert at_rest.in_motion(force_n, velocity) == pytest.approx(force_n / at_rest.force_n(speeds, force_n), rel=1e-3)
    assert given_n(force_n / at_rest.in_motion(force_n, velocity)) == pytest.approx(force_n, rel=0.015)
    assert abs(given_n(force_n) / force_n - 1.0) > 0.04


@pytest.mark.parametrize("faster", [1.0, 1.6])
def test_its_table_goes_to_the_rotors_most(faster):
    """It ended at 60 m/s2, at which stronger rotors passed for less than they give."""
    model = MODEL.with_limits(rotor_speed_max_rad_s=faster * MODEL.limits.rotor_speed_max_rad_s)
    full = np.full((1, 4), model.limits.rotor_speed_max_rad_s)
    most_n = float(vehicle.wrench(model, np.zeros((1, 3)), np.zeros((1, 3)), full)[0][0, 2])
    at_rest, speeds = mixed(model, 0.97 * most_n)
    assert at_rest.force_n(speeds, 0.97 * most_n) == pytest.approx(0.97 * most_n, rel=0.02)


@pytest.mark.parametrize("share", [0.0, 1e-3, 0.1, 1.0, 5.0])
def test_the_ratio_in_motion_is_bounded_whatever_is_asked_for(share):
    at_rest, _ = mixed(MODEL, 1.0)
    for velocity in ([0.0, 0.0, 0.0], [30.0, 0.0, 0.0], [0.0, 0.0, 30.0], [0.0, 0.0, -30.0]):
        ratio = at_rest.in_motion(share * MODEL.mass_kg * MODEL.gravity_m_s2, np.array(velocity))
        assert 0.5 <= ratio <= 2.0


def test_a_step_down_stops_no_rotor():
    """Led by more than its filter, a force of a quarter asked for no throttle, in flight."""
    lead = Lead(0.035, 0.015)
    lead.force_n(10.0, TICK_S)
    for asked_n in (2.5, 1.0):
        assert min(lead.force_n(asked_n, TICK_S) for _ in range(100)) >= 0.5 * asked_n


def test_rotors_that_cannot_turn_more_slowly_give_what_the_mixer_says():
    """Else a vehicle that lands would never be unloaded."""
    at_rest, speeds = mixed(MODEL, 0.0)
    assert at_rest.force_n(speeds, 0.0) == 0.0


def test_of_unlike_rotors_the_likeness_stays():
    at_rest, speeds = mixed(MODEL, 7.0)
    unlike = speeds * np.array([1.1, 0.9, 1.05, 0.95])
    lagging = at_rest.lagging_rad_s(unlike, 5.0)
    assert lagging / lagging[0] == pytest.approx(unlike / unlike[0])
    assert at_rest.force_n(lagging, 5.0) == pytest.approx(5.0, rel=0.01)


def test_behind_the_rotors_lag_the_lead_leaves_its_filter():
    lag_s, filter_s = 0.035, 0.015
    lead, speed, ideal = Lead(lag_s, filter_s), 2.0, 2.0
    assert lead.force_n(4.0, TICK_S) == pytest.approx(4.0)
    for _ in range(100):
        speed += (1.0 - np.exp(-TICK_S / lag_s)) * (np.sqrt(lead.force_n(9.0, TICK_S)) - speed)
        ideal += (1.0 - np.exp(-TICK_S / filter_s)) * (3.0 - ideal)
        assert speed == pytest.approx(ideal, abs=0.12)
    assert lead.force_n(9.0, TICK_S) == pytest.approx(9.0, abs=1e-6)
    lead.reset()
    assert lead.force_n(1.0, TICK_S) == pytest.approx(1.0)


def moment(**more) -> Moment:
    still = {"speed_m_s": 0.0, "bend_m_s2": 0.0, "up_z": 1.0, "predicted_m_s2": 9.81, "excess_m_s2": 3.0}
    return Moment(**{**still, **more})


@pytest.mark.parametrize("truth", [0.8, 0.93, 1.0, 1.2])
def test_the_share_that_comes_is_learnt_within_two_seconds(truth):
    learnt = Effectiveness(9.81)
    for _ in range(int(2.0 / TICK_S)):
        predicted_m_s2 = 9.81 / truth * learnt.share
        learnt.learn(TICK_S, moment(predicted_m_s2=predicted_m_s2, excess_m_s2=9.81 - predicted_m_s2))
    assert learnt.share == pytest.approx(truth, rel=0.02)


@pytest.mark.parametrize(
    "more",
    [
        {"speed_m_s": SLOW_M_S + 0.01},
        {"bend_m_s2": GENTLE_M_S2 + 0.01},
        {"up_z": UPRIGHT - 0.01},
        {"predicted_m_s2": 3.0},
    ],
)
def test_fast_bent_leaning_or_unloaded_flight_teaches_nothing(more):
    learnt = Effectiveness(9.81)
    assert not learnt.learn(TICK_S, moment(**more))
    assert learnt.share == 1.0


@pytest.mark.parametrize(("excess_m_s2", "bound"), [(-9.0, LEAST), (20.0, MOST)])
def test_no_share_is_beyond_its_bounds_where_the_rest_is_the_observers(excess_m_s2, bound):
    learnt = Effectiveness(9.81)
    assert [learnt.learn(TICK_S, moment(excess_m_s2=excess_m_s2)) for _ in range(2000)][-1] is False
    assert (learnt.share, learnt.at_bound) == (bound, True)


def test_whatever_share_is_believed_the_guard_takes_its_hover_for_one():
    assert airborne._LEAST_HOVER < 1.0 / MOST
    assert 1.0 / LEAST < airborne._MOST_HOVER
