"""Diagnosis: a planted effect is found, an innocent model is left alone, what nobody knows is drawn and not named."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import vehicle
from flight import FlightLog, InputError
from sysid import Identification, Options, identify
from sysid.diagnosis import diagnose, fitting
from sysid.diagnosis.evidence import free_form
from sysid.diagnosis.evidence.candidates import candidate_set
from sysid.diagnosis.evidence.confirm import Judge, settle
from sysid.diagnosis.evidence.evidence import Blocks, Evidence, block_edges
from sysid.diagnosis.evidence.score import loss_without, score
from sysid.diagnosis.examined import Model, examine, stated_curve
from sysid.diagnosis.fitting import refit
from sysid.diagnosis.procedure import while_searching
from sysid.estimator.joint_problem.chain import eliminate
from sysid.estimator.joint_problem.problem import linearise
from sysid.estimator.trajectory.midpoint import middle
from sysid.estimator.trajectory.model import along
from tests.sysid import flying

OFF_M = (0.006, -0.004)
Extra = Callable[[np.ndarray, np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]


def flights(
    extra: Extra | None, seed: int, duration_s: float, spread: float = 0.0, tether: float = 0.0
) -> list[FlightLog]:
    rng = np.random.default_rng(seed)
    truth = flying.Truth(gust=0.1, extra=extra, tether=tether)
    return flying.fly(truth, flying.paper_flights(rng, spread=spread), 3, duration_s=duration_s, rng=rng)


def off_centre(seed: int, duration_s: float, spread: float = 0.0) -> list[FlightLog]:
    """Flights of a vehicle whose centre of mass is 70 um off, a thirtieth of what is usual."""
    rng = np.random.default_rng(seed)
    truth = flying.Truth(gust=0.1, centre=(0.0, 7e-5))
    return flying.fly(truth, flying.paper_flights(rng, spread=spread), 3, duration_s=duration_s, rng=rng)


def damping(velocity: np.ndarray, rate: np.ndarray, speed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return 0.0 * velocity, -0.0008 * rate


def turning_when_climbing(velocity: np.ndarray, rate: np.ndarray, speed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    torque = np.zeros_like(rate)
    torque[:, 2] = 0.004 * velocity[:, 2]
    return 0.0 * velocity, torque


@pytest.mark.slow  # tests/goshawk/commands/learn/test_diagnose.py holds the same law through the command line
def test_a_hidden_effect_is_named_sized_and_confirmed_by_unseen_flights():
    found = diagnose(
        flights(damping, 1, 16.0), vehicle.example(), held_out=flights(damping, 2, 10.0, spread=0.2), auto=True
    )
    assert found.additions == ("angular_damping",)
    candidate = found.candidates[0]
    assert candidate.verdict == "present"
    assert candidate.confidence > 0.8
    for size in candidate.sizes:
        assert abs(size.value - 0.0008) < 4.0 * size.sigma
    before, after = (s.position_m["0.5 s"] for s in found.staircase[-2:])
    assert after < before
    assert found.outside is None
    for innocent in found.candidates:
        if innocent.verdict == "excluded":  # nobody is cleared by flights that could not have shown him
            assert all(s.sigma > 0.0 and s.smallest_visible <= s.usual for s in innocent.sizes), innocent.name
    assert found.as_dict()["additions"] == ["angular_damping"]


@pytest.mark.slow
def test_an_effect_too_small_to_matter_is_neither_named_nor_drawn_as_a_curve():
    """It is part of the model all the same: what it explains is nothing unknown."""

    given = vehicle.example().without_effect("centre_of_mass")
    training, held_out = off_centre(1, 20.0), off_centre(2, 12.0, spread=0.2)
    found = diagnose(training, given, held_out=held_out, auto=True)
    assert found.additions == ()
    assert found.negligible == ("centre_of_mass",)
    assert found.vehicle.value("centre_of_mass.y_m") == pytest.approx(7e-5, rel=0.15)
    assert found.outside is None
    assert found.confidence > 0.8
    assert found.verdict == "nothing that matters is missing; centre_of_mass shows, too small to matter"
    assert {s.name: s.verdict for s in found.candidates}["centre_of_mass"] == "excluded"


@pytest.mark.slow
def test_nothing_is_added_to_a_model_that_lacks_nothing():
    found = diagnose(flights(None, 3, 20.0), vehicle.example(), held_out=flights(None, 4, 12.0, spread=0.2), auto=True)
    assert found.additions == ()
    assert found.outside is None
    assert found.verdict == "nothing that these flights could show is missing"


@pytest.mark.slow
def test_an_effect_that_nobody_knows_is_drawn_and_not_named():
    found = diagnose(
        flights(turning_when_climbing, 5, 20.0),
        vehicle.example(),
        held_out=flights(turning_when_climbing, 6, 12.0, spread=0.2),
        auto=True,
    )
    assert found.additions == ()
    assert found.outside is not None
    assert (found.outside.channel, found.outside.variable) == ("M_z", "v_z")
    inner = slice(10, -10)
    drawn = found.outside.acceleration * found.outside.force_or_torque
    slope = np.polyfit(found.outside.at[inner], drawn[inner], 1)[0]
    assert slope == pytest.approx(0.004, rel=0.15)


@pytest.mark.slow
def test_a_tether_is_seen_in_the_axes_of_the_world():
    found = diagnose(
        flights(None, 5, 20.0, tether=0.05),
        vehicle.example(),
        held_out=flights(None, 6, 12.0, spread=0.2, tether=0.05),
        auto=True,
    )
    assert found.additions == ()
    assert found.outside is not None
    assert found.outside.channel in ("F_x_world", "F_y_world")
    assert found.outside.variable == found.outside.channel[2]
    assert found.outside.confidence > 0.8
    drawn = found.outside.acceleration * found.outside.force_or_torque
    slope = np.polyfit(found.outside.at, drawn, 1)[0]
    assert slope == pytest.approx(-0.05, rel=0.15)


def test_blocks_add_up_to_what_the_estimator_knows():
    """At the optimum the base's scores vanish, and the blocks' information is the fit's own.

    A candidate's score and information say by how much the cost changes when it is put in, all states settled anew.
    Judged by its own flights, the fit is where states, biases and delays are at their best already.
    """
    logs = flights(damping, 7, 6.0)
    fit = identify(logs, vehicle.example(), Options(node_rate_hz=100.0, gusts="white"))
    evidence = Evidence(
        fit.flights, fit.solution.point, fit.noise, fit.unknowns, candidate_set(fit.vehicle, fit.flights)
    )
    known = np.sum(fit.solution.information, axis=0)
    scale = np.sqrt(np.outer(np.diag(known), np.diag(known)))
    summed = evidence.named.only(evidence.base)
    assert evidence.names[: len(evidence.base)] == fit.unknowns.names
    assert np.abs((summed.information.sum(axis=0) - known) / scale).max() < 1e-6
    pull = np.abs(summed.score.sum(axis=0) / np.sqrt(np.diag(known)))
    bounds = vehicle.specs(fit.vehicle)
    free = [n not in bounds or bounds[n].bounds[0] < fit.vehicle.value(n) for n in fit.unknowns.names]
    assert pull[free].max() < 0.1
    settled, _ = settle(fit.flights, fit.solution.point, fit.noise, fit.clock)
    assert settled.states is fit.solution.point.states
    assert settled.sensors == fit.solution.point.sensors
    judge = Judge(fit.flights, fit.noise, fit.solution.point)
    lined = candidate_set(fit.vehicle, fit.flights).vehicle
    for name in ("angular_damping.z_n_m_s", "flapping_moment.moment_kg_m"):
        (place,) = evidence.place([name])
        score_, information = evidence.named.score[:, place].sum(), evidence.named.information[:, place, place].sum()
        size = 0.5 * abs(score_) / information
        predicted = score_ * size + 0.5 * information * size**2
        assert -judge.reduction(lined, lined.with_value(name, size)).total == pytest.approx(predicted, rel=0.05)


@pytest.fixture(scope="module")
def calm() -> Identification:
    """A fit to one flight of the vehicle as the model has it."""
    return identify(flights(None, 9, 12.0)[:1], vehicle.example(), Options(node_rate_hz=100.0, gusts="white"))


def test_white_noise_judges_states_that_carried_disturbances_without_them(calm):
    """Disturbances of which no noise level says how large they are would explain everything."""
    point = calm.solution.point
    carried = replace(point, states=tuple(states.with_gust() for states in point.states))
    costs = [Judge(calm.flights, calm.noise, near).costs(calm.vehicle) for near in (point, carried)]
    np.testing.assert_allclose(costs[1], costs[0], rtol=1e-9)


@pytest.mark.parametrize("channels", [("M_y",), ("F_x_world", "F_y_world")])
def test_curves_are_freed_of_what_the_states_can_do_in_every_block(calm, channels):
    """The short way of the evidence, by what is at right angles, against products of all rows."""
    fit = calm
    evidence = Evidence(
        fit.flights, fit.solution.point, fit.noise, fit.unknowns, candidate_set(fit.vehicle, fit.flights)
    )
    flight = fit.flights[0]
    mid = middle(flight, fit.solution.point.states[0])
    moved = {"M_y": {(10, 4): np.ones(len(mid.step_s))}}  # row of the defect, row of the process noise: share
    for axis, name in enumerate(("F_x_world", "F_y_world")):
        moved[name] = {(3 + i, i): mid.R_world_body[:, axis, i] for i in range(3)}
    borders = []
    for channel in channels:
        named = {variable for _, variable, _ in evidence.groups(channel)}
        drawn = free_form.columns([c for c in evidence.curves if c.variable in named], flight, mid)
        borders.append(np.zeros((len(drawn), 12, drawn.shape[1])))
        for (row, i), share in moved[channel].items():
            borders[-1][:, row] = -2.0 * (np.sqrt(flight.step_s) * share)[:, None] * drawn / fit.noise.process[i]
    border = np.concatenate(borders, axis=2)
    point = fit.solution.point
    rows = linearise(flight, point.states[0], point, fit.unknowns, fit.noise, False)
    rows = replace(rows, defect_border=border, sensor_border=np.zeros((*rows.sensor.shape, border.shape[2])))
    defect, sensor = rows.freed(eliminate(rows).sensitivity())
    found = evidence.with_curves(*channels).information[:, len(evidence.names) :, len(evidence.names) :]
    edges = block_edges(flight.time_s)
    assert len(found) == len(edges) > 2
    for own, (begin, end) in zip(found, edges, strict=True):
        flat = np.concatenate([defect[begin:end].reshape(-1, len(own)), sensor[begin:end].reshape(-1, len(own))])
        np.testing.assert_allclose(own, flat.T @ flat, atol=1e-9 * np.abs(own).max())


def test_a_constant_curve_of_thrust_is_what_the_same_share_of_all_rotors_does(calm):
    """The functions of a family sum to one, so all together are a share of one: against finite differences."""
    fit, flight = calm, calm.flights[0]
    lined = candidate_set(fit.vehicle, fit.flights).vehicle
    mid, step = middle(flight, fit.solution.point.states[0]), 1e-4
    curves = {c.variable: c for c in free_form.curves(fit.flights, fit.solution.point.states, lined)}
    for channel, variable in (("T", "n"), ("T", "s"), ("T", "speed"), ("T_1", "n_1")):
        which, moved = free_form.accelerations(channel, [curves[variable]], flight, mid, lined)
        stronger = lined
        for i in range(4) if channel == "T" else [1]:
            stronger = stronger.with_value(f"weak_rotor.loss_{i}", -step)
        change = (along(stronger, flight, mid) - along(lined, flight, mid)) / step
        assert moved.sum(axis=2) == pytest.approx(change[:, which], rel=1e-4, abs=1e-6)


def test_a_constant_curve_of_lift_is_what_the_same_force_at_every_hub_does(calm):
    """Of a vehicle whose centre of mass is off the middle of its hubs: against finite differences."""
    fit, flight = calm, calm.flights[0]
    off = fit.vehicle.with_effect("centre_of_mass", source="test", x_m=0.01, y_m=-0.02)
    lined = candidate_set(off, fit.flights).vehicle
    mid, step = middle(flight, fit.solution.point.states[0]), 1e-4
    (curve,) = (c for c in free_form.curves(fit.flights, fit.solution.point.states, lined) if c.variable == "speed")
    which, moved = free_form.accelerations("L", [curve], flight, mid, lined)
    change = (along(lined.with_value("thrust_affine.constant_n", step), flight, mid) - along(lined, flight, mid)) / step
    assert moved.sum(axis=2) == pytest.approx(change[:, which], rel=1e-4, abs=1e-6)
    assert np.abs(change[:, which]).min() > 0.1  # in F_z, M_x and M_y


def tiring_rotor(velocity: np.ndarray, rate: np.ndarray, speed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rotor 1 loses the more of its thrust the faster it turns: 6 % at hover."""
    lost = 0.06 * (speed[:, 1] / 950.0) ** 2 * 2.08e-6 * speed[:, 1] ** 2
    force, torque = 0.0 * velocity, 0.0 * rate
    force[:, 2] = -lost
    torque[:, 0], torque[:, 1] = -flying.HUBS[1, 1] * lost, flying.HUBS[1, 0] * lost
    return force, torque


@pytest.mark.slow
def test_a_thrust_law_of_one_rotor_is_drawn_whole_and_brings_no_false_name():
    found = diagnose(
        flights(tiring_rotor, 5, 20.0),
        vehicle.example(),
        held_out=flights(tiring_rotor, 6, 12.0, spread=0.2),
        auto=True,
    )
    assert set(found.additions) <= {"weak_rotor[1]"}
    assert found.outside is not None
    assert (found.outside.channel, found.outside.variable) == ("T_1", "n_1")


def saturating_lift(velocity: np.ndarray, rate: np.ndarray, speed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Thrust that every rotor gains alike, up to 0.15 N at speed, with the centre of mass at `OFF_M`."""
    square = (velocity[:, :2] ** 2).sum(axis=1)
    gained = 0.15 * square / (1.0 + square)
    force, torque = 0.0 * velocity, 0.0 * rate
    force[:, 2] = 4.0 * gained
    torque[:, 0], torque[:, 1] = -OFF_M[1] * force[:, 2], OFF_M[0] * force[:, 2]
    return force, torque


def test_lift_beside_a_centre_of_mass_off_the_middle_is_no_moment():
    rng, truth = np.random.default_rng(9), flying.Truth(gust=0.1, centre=OFF_M, extra=saturating_lift)
    logs = flying.fly(truth, flying.paper_flights(rng), 3, duration_s=8.0, rng=rng)
    known = vehicle.example().with_value("centre_of_mass.x_m", OFF_M[0]).with_value("centre_of_mass.y_m", OFF_M[1])
    best = stated_curve(examine(identify(logs, known, while_searching(Options(gusts="white")))))
    assert best is not None
    assert (best.channel, best.variable) == ("L", "speed")


def linear_blocks(rng: np.random.Generator, truth: np.ndarray, blocks: int = 60) -> Blocks:
    """Blocks of a linear problem with unit noise: residual y - A theta, at theta = 0."""
    columns = rng.normal(size=(blocks, 40, len(truth)))
    residual = -(columns @ truth) + rng.normal(size=(blocks, 40))
    return Blocks(np.einsum("bri,br->bi", columns, residual), np.einsum("bri,brj->bij", columns, columns))


def test_a_score_recovers_size_sigma_and_chance():
    rng = np.random.default_rng(0)
    given, tested = np.arange(2), np.array([2])
    present = score(linear_blocks(rng, np.array([1.0, -2.0, 0.3])), given, tested)
    assert present.size[0] == pytest.approx(0.3, abs=4.0 * present.sigma[0])
    assert present.sigma[0] == pytest.approx(1.0 / np.sqrt(60 * 40), rel=0.3)
    assert present.significance < 1e-8
    assert present.gain_unseen > 50.0
    chances = [score(linear_blocks(rng, np.array([1.0, -2.0, 0.0])), given, tested).significance for _ in range(200)]
    assert 0.02 < np.mean(np.array(chances) < 0.05) < 0.11


def test_a_size_that_cannot_be_negative_is_not_called_negative():
    rng = np.random.default_rng(1)
    found = score(linear_blocks(rng, np.array([1.0, -0.5])), np.array([0]), np.array([1]), np.array([True]))
    assert found.size[0] == 0.0
    assert found.gain == 0.0
    assert found.significance == 1.0
    assert found.sigma[0] > 0.0


def test_taking_out_what_is_needed_costs_what_it_brought():
    rng = np.random.default_rng(2)
    blocks = linear_blocks(rng, np.array([1.0, 0.5]))
    brought = score(blocks, np.array([0]), np.array([1])).gain
    step = -np.linalg.solve(blocks.information.sum(axis=0), blocks.score.sum(axis=0))
    moved = Blocks(blocks.score + blocks.information @ step, blocks.information)
    lost = loss_without(moved, np.array([0]), np.array([1]), step[1:])
    assert lost.gain == pytest.approx(brought, rel=1e-9)
    assert lost.significance < 1e-8


BENDING = while_searching(Options(gusts="white", held=("rotor_yaw_torque.torque_n_m_s2",)))


@pytest.fixture(scope="module")
def bending() -> tuple[list[FlightLog], vehicle.Vehicle, Model]:
    """Flights with a centre of mass far off, the vehicle as believed, and the fit without that effect."""
    rng = np.random.default_rng(1)
    believed = vehicle.example().without_effect("centre_of_mass")
    truth = flying.Truth(gust=0.1, centre=(0.03, -0.02))
    logs = flying.fly(truth, flying.paper_flights(rng), 3, duration_s=6.0, rng=rng)
    return logs, believed, examine(identify(logs, believed, BENDING))


@pytest.mark.parametrize("stuck", [False, True])
def test_an_effect_that_bent_the_whole_model_out_of_shape_is_still_fitted(bending, monkeypatch, stuck):
    """From the bent model, or, where no way leads on from there, from the numbers that the model was given."""
    logs, believed, bent = bending
    assert bent.fit.vehicle.value("inertia_xx_kg_m2") > 3.0 * believed.value("inertia_xx_kg_m2")
    centre = bent.candidate_set.candidate("centre_of_mass")
    if stuck:

        def only_from_given(*args, near=None, **more):
            if near is not None:
                raise InputError("the fit does not get better in any direction")
            return identify(*args, **more)

        monkeypatch.setattr(fitting, "identify", only_from_given)
    found = refit(logs, bent, centre, BENDING).vehicle
    assert found.value("centre_of_mass.x_m") == pytest.approx(0.03, abs=1e-4)
    assert found.value("centre_of_mass.y_m") == pytest.approx(-0.02, abs=1e-4)
    assert found.parameter("rotor_yaw_torque.torque_n_m_s2") == believed.parameter("rotor_yaw_torque.torque_n_m_s2")


def test_one_flight_cannot_both_teach_and_judge():
    logs = flights(None, 8, 6.0)
    with pytest.raises(InputError, match="both for fitting and as held out"):
        diagnose(logs, vehicle.example(), held_out=logs[:1])


def test_nothing_is_excluded_by_a_model_far_from_its_flights():
    """Gusts of 8 m/s2, which no vehicle of this kind meets: something is wrong with log or model, and that is said."""
    rng = np.random.default_rng(9)
    truth = flying.Truth(gust=8.0, gust_time=0.15)
    logs = flying.fly(truth, flying.paper_flights(rng), 3, duration_s=8.0, rng=rng, rate_hz=100.0)
    found = diagnose(logs, vehicle.example())
    assert found.confidence <= 0.5
    assert "so much stays unexplained" in found.verdict
    assert not [s.name for s in found.candidates if s.verdict == "excluded"]
    assert any("unexplained" in finding for finding in found.findings)


def test_parameters_cannot_be_freed_by_name(truth):
    with pytest.raises(InputError, match="is not possible here"):
        diagnose([], truth, options=Options(free=("inertia_xx_kg_m2",)))
