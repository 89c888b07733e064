"""The weight balance: no fit trades the thrust that carries the weight for torque, and one that would have says so."""

import re
from dataclasses import replace

import numpy as np
import pytest

import sysid
import vehicle
from flight.flight_log import from_vectors
from flight.frames import GRAVITY_M_S2
from sysid.estimator.flights.flight_data import Flight
from sysid.estimator.identification import start
from sysid.estimator.joint_problem import solver, weight
from sysid.estimator.joint_problem.problem import Point
from sysid.estimator.joint_problem.unknowns import Unknowns, biases
from sysid.estimator.prepare import prepare
from vehicle import Vehicle

INERTIA = tuple(f"inertia_{axis}_kg_m2" for axis in ("xx", "yy", "zz"))
THRUST = "thrust_bem.k1_n_s2"
UNKNOWNS = Unknowns((THRUST,), (), ())


@pytest.fixture(scope="module")
def logs(flying):
    """Vertical, fast level and rotation flights of the paper's vehicle."""
    rng = np.random.default_rng(12)
    return flying.fly(flying.Truth(), flying.paper_flights(rng), 3, duration_s=6.0, rng=rng, rate_hz=50.0)


@pytest.fixture(scope="module")
def at_start(logs, truth):
    """Flights, unknowns and where a fit of them starts."""
    flights = [f for i, log in enumerate(logs) for f in prepare(log, i, sysid.Options())]
    unknowns = Unknowns((THRUST, INERTIA[0]), (), tuple(biases(flights)))
    return flights, unknowns, *start(truth, flights)


def hovering(truth: Vehicle, *hovers: tuple[float, float]) -> tuple[list[Flight], Point]:
    """Logs at rest. Args: hovers: of each log seconds, and rotor speed as a share of what carries the weight."""
    flights = []
    for number, (duration_s, share) in enumerate(hovers):
        time_s = np.arange(0.0, duration_s + 1e-9, 0.02)
        still = np.zeros((len(time_s), 3))
        vectors = {
            "position_world_m": still,
            "q_world_body": np.tile([1.0, 0.0, 0.0, 0.0], (len(time_s), 1)),
            "rate_body_rad_s": still,
            "rotor_speed_rad_s": np.tile(share * vehicle.invert.hover(truth), (len(time_s), 1)),
        }
        flights += prepare(from_vectors(time_s, vectors), number, sysid.Options())
    return flights, start(truth, flights)[0]


def heavier(point: Point, lacking: float) -> Point:
    """In hover the same rotor speeds lack this share of the weight; all is in proportion to 1 / mass."""
    mass_kg = point.vehicle.mass_kg / (1.0 - lacking)
    return Point(point.vehicle.with_value("mass_kg", mass_kg), point.sensors, point.states)


def lacking_thrust(point: Point, factor: float) -> Point:
    return Point(point.vehicle.with_value(THRUST, factor * point.value(THRUST)), point.sensors, point.states)


@pytest.mark.parametrize("duration_s", [4.0, 40.0])
@pytest.mark.parametrize("lacking", [0.08, -0.08])
def test_what_lacks_beyond_three_percent_of_the_weight_or_more_if_short_counts_interval_by_interval(
    truth, duration_s, lacking
):
    flights, point = hovering(truth, (duration_s, 1.0))
    allowed_m_s2 = 0.3 * np.sqrt(1.0 + 10.0 / flights[0].step_s.sum())
    expected = np.sign(lacking) * (abs(lacking) * GRAVITY_M_S2 - allowed_m_s2) * np.sqrt(len(flights[0]) - 1) / 0.3
    found = weight.residuals(flights, heavier(point, lacking), UNKNOWNS)
    np.testing.assert_allclose(found, [expected], rtol=1e-3)
    within = 0.99 * np.sign(lacking) * allowed_m_s2 / GRAVITY_M_S2
    assert not weight.residuals(flights, heavier(point, within), UNKNOWNS).any()


def test_the_log_that_is_least_beyond_its_own_allowance_speaks_for_all(truth):
    """The short one, which may be further from balance by chance."""
    flights, point = hovering(truth, (40.0, 1.0), (2.5, 1.0))
    found = weight.residuals(flights, heavier(point, 0.1), UNKNOWNS)
    assert found[0] == 0.0
    assert found[1] > 0.0


def test_logs_of_which_some_lack_what_others_have_too_much_are_left_alone(truth):
    flights, point = hovering(truth, (8.0, 0.95), (8.0, 1.05))
    assert not weight.residuals(flights, point, UNKNOWNS).any()
    for number, sign in enumerate((1.0, -1.0)):
        alone = Point(point.vehicle, point.sensors, point.states[number : number + 1])
        assert sign * weight.residuals(flights[number : number + 1], alone, UNKNOWNS)[0] > 0.0


def test_without_a_pose_nothing_is_known_of_the_speed_gained(truth):
    flights, point = hovering(truth, (8.0, 1.0))
    blind = [replace(f, readings=f.readings | {"position_world_m": np.full((len(f), 3), np.nan)}) for f in flights]
    assert not blind[0].has_pose
    assert weight.residuals(flights, heavier(point, 0.2), UNKNOWNS).any()
    assert not weight.residuals(blind, heavier(point, 0.2), UNKNOWNS).any()
    assert weight.held_m_s2(blind, heavier(point, 0.2), UNKNOWNS) is None


def test_the_weight_balance_is_silent_while_the_thrust_carries_the_weight(at_start):
    flights, unknowns, point, noise = at_start
    carried = weight.balance(flights, point, unknowns, noise)
    assert not carried.residual.any()
    assert not carried.information.any()
    assert weight.held_m_s2(flights, point, unknowns) is None


def test_thrust_that_made_speed_is_none_too_much(at_start):
    flights, unknowns, point, _ = at_start
    up_m_s = point.states[0].velocity_world_m_s[:, 2]
    gained_m_s = up_m_s[50:] - up_m_s[:-50]
    first = int(np.argmax(np.abs(gained_m_s)))
    nodes, between = slice(first, first + 51), slice(first, first + 50)
    piece = cut(flights[0], nodes, between)
    climbing = Point(point.vehicle, point.sensors, (point.states[0].picked(nodes),))
    assert abs(gained_m_s[first]) > 2.0 * weight.FREE_M_S2 * np.sqrt(1.0 + weight.SETTLES_S)  # within a second
    assert not weight.residuals([piece], climbing, unknowns).any()


def cut(flight: Flight, nodes: slice, between: slice) -> Flight:
    arrays = {n: getattr(flight, n)[between] for n in ("rotor_speed_rad_s", "rotor_acceleration_rad_s2")}
    readings = {n: v[between if len(v) < len(flight) else nodes] for n, v in flight.readings.items()}
    return replace(flight, time_s=flight.time_s[nodes], readings=readings, **arrays)


def in_pieces(flights, point: Point):
    """The same logs, each in three pieces, and their states."""
    pieces, states = [], []
    for flight, whole in zip(flights, point.states, strict=True):
        for nodes in (slice(0, 25), slice(24, 101), slice(100, None)):  # their mean forces take every fourth node
            pieces.append(cut(flight, nodes, slice(nodes.start, None if nodes.stop is None else nodes.stop - 1)))
            states.append(whole.picked(nodes))
    return pieces, Point(point.vehicle, point.sensors, states)


def test_a_log_in_pieces_weighs_as_much_as_in_one(at_start):
    """Piece by piece the one nearest to balance would speak for all."""
    flights, unknowns, point, _ = at_start
    weak = lacking_thrust(point, 0.5)
    found = weight.residuals(*in_pieces(flights, weak), unknowns)
    assert len(found) == len(flights)
    np.testing.assert_allclose(found, weight.residuals(flights, weak, unknowns), rtol=1e-3)


def test_the_weight_balance_grows_with_the_flights_as_what_torques_can_gain(at_start):
    flights, unknowns, point, _ = at_start
    weak = lacking_thrust(point, 0.5)
    again = [replace(flight, log_index=flight.log_index + len(flights)) for flight in flights]
    twice = Point(weak.vehicle, weak.sensors, (*weak.states, *weak.states))
    cost = weight.cost(flights, weak, unknowns)
    assert weight.cost([*flights, *again], twice, unknowns) == pytest.approx(2.0 * cost)


def test_the_weight_balance_is_silent_where_no_thrust_is_estimated(at_start):
    flights, unknowns, point, _ = at_start
    weak = lacking_thrust(point, 0.5)
    assert weight.residuals(flights, weak, unknowns).any()
    assert not weight.residuals(flights, weak, replace(unknowns, model=INERTIA)).any()


@pytest.mark.parametrize("shape", ["whole logs", "logs in pieces", "a shorter log"])
def test_slopes_of_the_weight_balance_agree_with_differences(at_start, shape):
    flights, unknowns, point, noise = at_start
    weak = lacking_thrust(point, 0.5)
    if shape != "whole logs":
        flights, weak = in_pieces(flights, weak)
    if shape == "a shorter log":
        flights, weak = flights[1:], Point(weak.vehicle, weak.sensors, weak.states[1:])
    carried = weight.balance(flights, weak, unknowns, noise)
    more = lacking_thrust(weak, 1.0001)
    slope = (weight.residuals(flights, more, unknowns) - carried.residual) / (1e-4 * weak.value(THRUST))
    np.testing.assert_allclose(carried.slopes[:, 0], slope, rtol=1e-2)  # of all nodes, against every fourth
    assert np.count_nonzero(carried.residual) == 1  # the flight nearest to balance
    assert carried.residual.max() > 0.0
    assert weight.cost(flights, weak, unknowns) == pytest.approx(0.5 * (carried.residual**2).sum())


def share_taken(at_start, point: Point, thrust_step: float, gain: float) -> float:
    """Share of a step of thrust that the line search takes where the residuals gain so much by the whole step."""
    flights, unknowns, _, noise = at_start
    step = np.zeros(unknowns.size)
    step[0] = thrust_step * point.value(THRUST)
    still = [np.zeros((len(flight), s.size)) for flight, s in zip(flights, point.states, strict=True)]
    there = solver.all_residuals(flights, point.moved(unknowns, step, still), noise, False)
    before = sum(map(solver.cost_of, there)) + gain
    flat = solver.Prior(np.zeros(unknowns.size), np.full(unknowns.size, np.inf))
    taken = solver._take(flights, point, unknowns, noise, flat, step, still, False, before)
    return 0.0 if taken is None else taken[1]


def test_a_step_that_loses_more_by_the_weight_than_the_residuals_gain_is_not_taken_whole(at_start):
    flights, unknowns, point, _ = at_start
    lost = weight.cost(flights, lacking_thrust(point, 0.5), unknowns)
    assert lost > 0.0
    assert share_taken(at_start, point, -0.5, 1.1 * lost) == 1.0
    assert share_taken(at_start, point, -0.5, 0.9 * lost) < 1.0


def test_a_step_may_cost_as_much_more_as_the_weight_balance_does(at_start):
    flights, unknowns, point, _ = at_start
    weak = lacking_thrust(point, 0.5)
    costs = weight.cost(flights, weak, unknowns)
    assert share_taken(at_start, weak, 0.0, -0.9 * costs) == 1.0
    assert share_taken(at_start, weak, 0.0, -1.1 * costs) == 0.0


def fitted(logs, believed: Vehicle, inertia: float) -> tuple[float, list[str]]:
    """Thrust as a share of the true one, and what the verdict says of the weight, with the inertias held."""
    for name in INERTIA:
        believed = believed.with_value(name, inertia * believed.value(name))
    fit = sysid.identify(logs, believed, sysid.Options(held=(*INERTIA, "thrust_bem.k2_n_s2_m"), gusts="white"))
    assert fit.converged
    said = [reason for reason in fit.verdict.reasons if "carries the weight" in reason]
    return fit.estimate(THRUST).value / believed.value(THRUST), said


@pytest.mark.parametrize("chosen", [slice(2, 3), slice(0, 3)])
def test_a_third_of_the_inertia_takes_no_thrust_that_carries_the_weight_and_the_verdict_says_so(logs, truth, chosen):
    """It would take more than half. Of all three flights the fit ends just inside its allowance."""
    thrust, said = fitted(logs[chosen], truth, 1.0 / 3.0)
    assert 0.94 < thrust < 0.97
    (sentence,) = said
    assert "asks for less thrust" in sentence
    share = re.search(r"held at (\d+)%", sentence)
    assert share
    assert float(share[1]) / 100.0 == pytest.approx(thrust, abs=0.01)


def test_the_verdict_says_nothing_of_the_weight_where_the_thrust_is_free_to_carry_it(logs, truth):
    thrust, said = fitted(logs[2:], truth, 1.0)
    assert thrust == pytest.approx(1.0, abs=0.01)
    assert not said
