"""The next flight in a map: it keeps the clearance, passes `goshawk check`, and answers; a small room is refused."""

import numpy as np
import pytest

import esdf
import vehicle
from esdf import solids
from flight import InfeasibleError, trajectory
from goshawk.commands.learn import mapped_flight
from planner import PlanOptions
from planner.gate import gate
from sysid import Options, identify
from sysid.diagnosis.examined import examine
from sysid.diagnosis.experiment_design.next_flight import Question, ask
from vehicle import flights, manoeuvres

PAIR = ("rotor_drag_thrust", "rotor_drag_speed")


@pytest.fixture(scope="module")
def truth() -> vehicle.Vehicle:
    return vehicle.example()


@pytest.fixture(scope="module")
def question(truth) -> Question:
    """A short flight says little about two kinds of rotor drag."""
    rng = np.random.default_rng(2)
    flown = flights.fly_trajectory(truth, manoeuvres.scaled(manoeuvres.make("doublets"), 0.5), rng=rng)
    believed = truth.without_effect("rotor_drag_thrust")
    options = Options(node_rate_hz=100.0, gusts="white")
    return ask(examine(identify([flights.measure(flown, rng=rng)], believed, options)), PAIR)


def room(side_m: float, height_m: float) -> esdf.Field:
    scene = solids.Room((0.0, 0.0, 0.0), (side_m, side_m, height_m))
    grid = esdf.Grid.covering((-0.2, -0.2, -0.2), (side_m + 0.2, side_m + 0.2, height_m + 0.2), 0.1)
    return esdf.build(esdf.rasterize(scene, grid), grid)


def ranked(question: Question, field: esdf.Field, truth: vehicle.Vehicle, *names: str) -> mapped_flight.MappedRanking:
    believed, rng = truth.without_effect("rotor_drag_thrust"), np.random.default_rng(0)
    return mapped_flight.rank_in_map(question, field, believed, PlanOptions(margin_m=0.2), library=names, rng=rng)


def test_what_fits_keeps_the_clearance_and_is_checked_and_answers_the_question(question, truth, tmp_path):
    field = room(8.0, 3.5)
    found = ranked(question, field, truth, "doublets", "oblique", "ground_sweep", "hover")
    best = found.flights[0]
    assert found.candidates == PAIR
    assert [each.proposal.name for each in found.flights] == ["oblique", "doublets"]
    assert {name for name, _ in found.skipped} == {"ground_sweep", "hover"}
    assert best.proposal.known_log_odds + best.proposal.expected_log_odds >= mapped_flight.SETTLED_LOG_ODDS
    assert best.gate.clearance_m >= best.gate.required_clearance_m == pytest.approx(truth.reach_m + 0.2, abs=1e-3)
    assert (best.low_world_m > 0.0).all()
    assert (best.high_world_m < [8.0, 8.0, 3.5]).all()
    trajectory.save(tmp_path / "next.json", best.file("next"))
    kept = trajectory.load(tmp_path / "next.json")
    assert kept.as_checked
    assert gate.check_file(kept, field, truth.without_effect("rotor_drag_thrust")).passed
    assert len(kept.waypoints_world_m) > 2


@pytest.mark.slow
def test_a_larger_room_never_makes_the_flight_smaller(question, truth):
    sizes = [ranked(question, room(side, 3.0), truth, "oblique").flights[0].size for side in (3.0, 6.0)]
    assert sizes[1] > sizes[0]


def test_a_room_too_small_is_refused_with_the_space_it_takes_and_the_space_there_is(question, truth):
    with pytest.raises(InfeasibleError, match=r"not in this map: oblique needs [\d.]+ x [\d.]+ x [\d.]+ m") as refused:
        ranked(question, room(0.9, 0.9), truth, "oblique")
    assert "the largest free box is 0." in str(refused.value)
