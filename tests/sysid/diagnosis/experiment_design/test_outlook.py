"""What would tell: a manoeuvre is advised only where its rehearsal shows the usual size."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

import vehicle
from flight import FlightLog
from goshawk.commands.learn import what_next
from goshawk.commands.learn.what_next import DiagnoseCall
from sysid import Options, identify
from sysid.diagnosis.evidence.candidates import Candidate
from sysid.diagnosis.examined import Model, examine
from sysid.diagnosis.experiment_design.next_flight import ask, in_doubt
from sysid.diagnosis.experiment_design.outlook import outlook, space
from sysid.diagnosis.findings import CandidateFinding, Size, Verdict
from sysid.diagnosis.procedure import Diagnosis
from tests.sysid import flying


@pytest.fixture(scope="module")
def model() -> Model:
    """Of flights some 5 m above the ground."""
    rng = np.random.default_rng(4)
    logs = flying.fly(flying.Truth(gust=0.1), flying.paper_flights(rng), 3, duration_s=6.0, rng=rng, rate_hz=100.0)
    high = "position_world_z_m"
    logs = [FlightLog({**log.columns, high: log.columns[high] + 5.0}, log.metadata) for log in logs]
    return examine(identify(logs[:2], vehicle.example("rigter2019"), Options(node_rate_hz=100.0, gusts="white")))


def open_(candidate: Candidate, shrunk: float = 1.0) -> CandidateFinding:
    """In doubt, at a share of its usual size."""
    sizes = tuple(
        Size(p, "1", 0.0, 1.0, 1.6, 1.0, shrunk * usual)
        for p, usual in zip(candidate.parameters, candidate.usual, strict=True)
    )
    how = (candidate.excited_by, candidate.channels, candidate.regressor)
    return CandidateFinding(candidate.name, Verdict.INCONCLUSIVE, "", sizes, 0.0, 0.5, 0.0, 0.1, (), *how)


def doubting(model: Model, *findings: CandidateFinding) -> Diagnosis:
    search = SimpleNamespace(models=(model,), undecided=None, trials=(), equation=None)
    rest: Any = dict.fromkeys(Diagnosis.__slots__, ())
    return Diagnosis(
        **{
            **rest,
            "search": search,
            "input_verdict": model.fit.verdict,
            "candidates": findings,
            "outside": None,
            "payload_carried": (),
        }
    )


def test_a_manoeuvre_is_advised_where_it_would_show_the_usual_size_and_not_otherwise(model):
    damping = model.candidate_set.candidate("angular_damping")
    rng = np.random.default_rng(0)
    usual = outlook(doubting(model, open_(damping, 10.0)), rng=rng)["angular_damping"]
    assert usual.would_tell
    assert usual.manoeuvre in damping.excited_by
    assert usual.sentence.endswith("would show its usual size")
    question = ask(model, ["angular_damping"])
    _, now = question.sizes(question.known)
    for parameter, size in usual.smallest_visible.items():  # a flight more never shows less
        assert 0.0 < size <= now[parameter]
    tiny = outlook(doubting(model, open_(damping, 1e-6)), rng=rng)["angular_damping"]
    assert not tiny.would_tell
    assert tiny.sentence.startswith("not even")


def test_no_flight_is_advised_for_what_is_too_small_to_matter(model):
    """These flights would have shown its usual size."""
    shown = open_(model.candidate_set.candidate("angular_damping"), 1e6)
    assert outlook(doubting(model, shown), rng=np.random.default_rng(0)) == {}


def test_the_ground_is_not_advised_where_these_flights_stayed_high(model):
    ground = model.candidate_set.candidate("ground_effect")
    found = doubting(model, open_(ground))
    view = outlook(found, rng=np.random.default_rng(0))["ground_effect"]
    assert view.manoeuvre == ""
    assert "no manoeuvre that shows it fits" in view.sentence
    asked = DiagnoseCall((), cast("Any", "vehicle.toml"))
    assert what_next.lines(found, asked, {"ground_effect": view}) == []


def test_the_flight_proposed_answers_what_a_flight_can_answer(model):
    ground, damping = (open_(model.candidate_set.candidate(n)) for n in ("ground_effect", "angular_damping"))
    found = doubting(model, ground, damping)
    assert in_doubt(found) == ("ground_effect",)
    assert in_doubt(found, ["angular_damping"]) == ("angular_damping",)


def test_the_space_is_the_box_that_was_flown(model):
    size_m, corner_m = space(doubting(model))
    place = np.concatenate([f.position_world_m for f in model.fit.flights])
    assert (size_m >= np.ptp(place, axis=0) - 0.06).all()
    np.testing.assert_allclose(corner_m, place.min(axis=0), atol=0.6)
