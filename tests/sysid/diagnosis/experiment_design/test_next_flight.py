"""The proposed flight: it fits, it can be planned, and confounded effects are really separated better by it."""

from dataclasses import replace

import numpy as np
import pytest

import planner
import vehicle
from esdf import solids
from flight import FlightLog, InfeasibleError, InputError, Trajectory
from sysid import Options, identify
from sysid.diagnosis.examined import Model, examine
from sysid.diagnosis.experiment_design.next_flight import Question, ask, rank
from sysid.diagnosis.experiment_design.rehearsal import Room, fitted_into, rehearse
from vehicle import Vehicle, flights, manoeuvres
from vehicle.simulation.simulate import Wind

SPACE = (6.0, 6.0, 3.0)
OPTIONS = Options(node_rate_hz=100.0, gusts="white")
BREEZE = Wind(gust_std_m_s=0.1)


def flown(truth: Vehicle, trajectory: Trajectory, rng: np.random.Generator) -> FlightLog:
    return flights.measure(flights.fly_trajectory(truth, trajectory, wind=BREEZE, rng=rng), rng=rng)


def little_known(truth: Vehicle, rng: np.random.Generator) -> list[FlightLog]:
    """Flights that say little about drag."""
    return [
        flown(truth, fitted_into(manoeuvres.make(name), Room.of(SPACE), truth), rng)
        for name in ("doublets", "throttle_steps")
    ]


def lacking(truth: Vehicle, *names: str) -> Vehicle:
    for name in names:
        truth = truth.without_effect(name) if name in truth.effects else truth
    return truth


@pytest.fixture(scope="module")
def model() -> Model:
    """Without rotor drag, fitted to flights of a vehicle that has it."""
    truth, rng = vehicle.example(), np.random.default_rng(1)
    return examine(identify(little_known(truth, rng), lacking(truth, "rotor_drag_thrust"), OPTIONS))


@pytest.fixture(scope="module")
def question(model: Model) -> Question:
    return ask(model, ["rotor_drag_thrust", "rotor_drag_speed"])


def log_odds(question: Question, trajectory: Trajectory) -> float:
    """Of this flight alone."""
    fit = question.model.fit
    rehearsed = rehearse(fit, trajectory, Room.of((50.0, 50.0, 50.0)), 100.0, np.random.default_rng(0))
    return question.log_odds(question.information(rehearsed))


@pytest.mark.parametrize("name", [n for n in manoeuvres.LIBRARY if n not in ("ground_sweep", "ceiling_climb")])
def test_a_manoeuvre_is_made_to_fit_room_and_vehicle(name: str):
    body, room = vehicle.example(), Room.of(SPACE)
    trajectory = fitted_into(manoeuvres.make(name), room, body)
    times = trajectory.sample(0.01)
    place = trajectory.position(times)
    assert (place > room.low_world_m).all()
    assert (place < room.high_world_m).all()
    assert np.linalg.norm(trajectory.position(times, 1), axis=1).max() < body.limits.speed_m_s
    assert np.linalg.norm(trajectory.position(times, 2), axis=1).max() < body.limits.acceleration_m_s2
    flat = vehicle.flatness.state(body, trajectory, times)
    assert np.abs(flat.rate_body_rad_s[:, 2]).max() < body.limits.yaw_rate_rad_s
    assert flat.rotor_speed_rad_s.max() < body.limits.rotor_speed_max_rad_s


def test_what_does_not_fit_says_why():
    body = vehicle.example()
    with pytest.raises(InfeasibleError, match="above the ground"):
        fitted_into(manoeuvres.make("ground_sweep"), Room.of(SPACE), body)
    with pytest.raises(InfeasibleError, match="shrink"):
        fitted_into(manoeuvres.make("fast_level"), Room.of((0.5, 0.5, 0.5)), body)
    with pytest.raises(InfeasibleError, match="limit does not allow"):
        fitted_into(manoeuvres.make("yaw_sweep"), Room.of(SPACE), body.with_limits(yaw_rate_rad_s=0.2))
    with pytest.raises(InputError, match="leaves no room"):
        Room.of((6.0, 0.1, 3.0))
    near_ground = Room.of(SPACE, (-3.0, -3.0, -0.05))
    low = fitted_into(manoeuvres.make("ground_sweep"), near_ground, body)
    assert low.position(low.sample(0.02))[:, 2].min() == pytest.approx(0.08)


def test_evidence_grows_with_repetition(question: Question):
    once = fitted_into(manoeuvres.make("oblique"), Room.of(SPACE), vehicle.example())
    thrice = Trajectory(np.tile(once.durations_s, 3), np.tile(once.coefficients, (3, 1, 1)))
    assert log_odds(question, thrice) == pytest.approx(3.0 * log_odds(question, once), rel=0.1)
    known = question.information(rehearse(question.model.fit, once, Room.of(SPACE), 100.0, np.random.default_rng(0)))
    assert question.log_odds(3.0 * known) == pytest.approx(3.0 * question.log_odds(known), rel=1e-6)


def test_more_noise_makes_evidence_weaker(question: Question):
    once = fitted_into(manoeuvres.make("oblique"), Room.of(SPACE), vehicle.example())
    fit = question.model.fit
    noisy = replace(fit, noise=fit.noise.with_process(2.0 * fit.noise.process))
    louder = replace(question, model=replace(question.model, fit=noisy))
    assert log_odds(louder, once) == pytest.approx(log_odds(question, once) / 4.0, rel=0.3)


def test_a_ranking_is_ordered_and_speaks(model: Model):
    library = ("hover", "throttle_steps", "oblique", "doublets", "ground_sweep", "ceiling_climb")
    ranking = rank(
        model,
        candidates=["rotor_drag_thrust", "rotor_drag_speed"],
        free_volume_m=SPACE,
        library=library,
        rng=np.random.default_rng(0),
    )
    assert [p.per_second for p in ranking] == sorted((p.per_second for p in ranking), reverse=True)
    assert ranking[0].name == "oblique"
    assert ranking[-1].expected_log_odds < 0.01 * ranking[0].expected_log_odds
    assert "tell rotor_drag_thrust from rotor_drag_speed with log odds of" in ranking[0].sentence
    assert {name for name, _ in ranking.skipped} == {"ground_sweep", "ceiling_climb"}


def test_a_single_suspect_is_sized(model: Model):
    ranking = rank(
        model,
        candidates=["parasitic_drag_speed"],
        free_volume_m=SPACE,
        library=("oblique", "throttle_steps"),
        rng=np.random.default_rng(0),
    )
    best, worst = ranking
    assert best.name == "oblique"
    for name in best.smallest_visible:
        assert best.smallest_visible[name] < worst.smallest_visible[name]
    assert "would show from" in best.sentence


def test_suspects_that_cannot_be_asked_about_are_refused(model: Model):
    with pytest.raises(InputError, match="no effect named 'no_such_effect'"):
        ask(model, ["no_such_effect"])
    with pytest.raises(InputError, match="no flight of this kind can show ceiling_effect"):
        ask(model, ["ceiling_effect"])
    with pytest.raises(InputError, match="has motor_lag already"):
        ask(model, ["motor_lag"])
    with pytest.raises(InputError, match="twice"):
        ask(model, ["rotor_drag_speed", "rotor_drag_speed"])
    assert ask(model, ["weak_rotor"]).candidates[0].effect == "weak_rotor"


@pytest.mark.parametrize("name", ["oblique", "throttle_steps"])
def test_the_planner_flies_through_the_waypoints(question: Question, name: str):
    """In an empty box: the plan passes its gate, stays inside, and tells about as much per second as was promised."""
    body, size = question.model.fit.vehicle, np.array(SPACE)  # what is believed of the vehicle when it is planned
    proposal = rank(
        question.model,
        candidates=[s.name for s in question.candidates],
        free_volume_m=SPACE,
        library=(name,),
        rng=np.random.default_rng(0),
    )[0]
    options = planner.PlanOptions().sized(body)
    low = np.array([-0.5 * size[0], -0.5 * size[1], 0.5])
    walls = options.clearance_m + 0.1
    hall = solids.Scene([solids.Room(tuple(low - walls), tuple(low + size + walls))])
    planned = planner.plan(proposal.waypoints(), hall, body, options)
    assert planned.gate.passed
    through = planned.trajectory.position(planned.trajectory.sample(0.01))
    for point in proposal.waypoints().positions_world_m:
        assert np.linalg.norm(through - point, axis=1).min() < 0.05
    if name == "oblique":
        planned_rate = log_odds(question, planned.trajectory) / planned.trajectory.duration_s
        assert planned_rate > 0.5 * proposal.per_second


def test_a_manoeuvre_that_stays_in_one_place_has_no_waypoints(model: Model):
    hover = rank(
        model,
        candidates=["rotor_drag_speed"],
        free_volume_m=SPACE,
        library=("hover",),
        rng=np.random.default_rng(0),
    )[0]
    with pytest.raises(InputError, match="stays in one place"):
        hover.waypoints()
