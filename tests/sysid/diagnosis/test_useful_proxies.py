"""A name that a curve outdoes is added where it lowers the held-out error, last of all, and is called a proxy."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from sysid.diagnosis import search
from sysid.diagnosis.candidates import Candidate
from sysid.diagnosis.confirm import CostReduction
from sysid.diagnosis.findings import JudgedBy, Outcome
from sysid.diagnosis.search import Trial

CURVE = cast("Any", SimpleNamespace(channel="F_z", variable="v_z"))


def candidate(name: str, *, between_flights: bool = False) -> Candidate:
    return Candidate(name, name, (f"{name}.x",), (False,), (1.0,), ("F_z",), "v", (), between_flights=between_flights)


def outdone(name: str, *, confirmed: bool = True, **kind: bool) -> Trial:
    fell = CostReduction(np.array([3.0, 4.0, 5.0]))
    return Trial(
        candidate(name, **kind),
        Outcome.PROXY,
        fell,
        fell,
        JudgedBy.HELD_OUT,
        "",
        confirmed,
        0.9,
        (),
        CURVE,
        cast("Any", name),
    )


@pytest.fixture
def helpful(monkeypatch: pytest.MonkeyPatch) -> set[str]:
    """Candidates that the judging flights confirm beside whatever is in the model; grown by the test."""
    names: set[str] = set()
    fell = CostReduction(np.array([8.0, 9.0, 10.0]))

    def fitted(logs: Any, model: Any, one: Candidate, options: Any) -> Any:
        fit = SimpleNamespace(holds=(*model.holds, one.name))
        return SimpleNamespace(candidate=one, fit=fit, reduction=fell)

    def examined(fit: Any) -> Any:
        return SimpleNamespace(holds=fit.holds, scores={n: None for n in "abc" if n not in fit.holds})

    monkeypatch.setattr(search, "_fitted", fitted)
    monkeypatch.setattr(search, "examine", examined)
    monkeypatch.setattr(search, "_confirmed", lambda model, one, unseen: (fell, one.candidate.name in names, ""))
    return names


def added(trials: list[Trial]) -> list[tuple[Trial, Any]]:
    model = cast("Any", SimpleNamespace(holds=(), scores=dict.fromkeys("abc")))
    return search._useful_proxies((), model, trials, "", cast("Any", None))


def test_every_proxy_that_still_helps_is_added_to_the_one_before(helpful):
    helpful |= {"a", "b"}
    found = added([outdone("a"), outdone("b"), outdone("c")])
    assert [trial.candidate.name for trial, _ in found] == ["a", "b"]
    assert [model.holds for _, model in found] == [("a",), ("a", "b")]
    for trial, _ in found:
        assert trial.outcome is Outcome.USEFUL_PROXY
        assert trial.held_out.total == 27.0
        assert trial.sentence.startswith("added as a useful proxy: the cost of held-out flights fell by 27.0 ± 1.7")
        assert "a free curve of F_z against v_z explains more" in trial.sentence


def test_what_held_out_flights_did_not_prefer_is_no_useful_proxy(helpful):
    helpful |= {"a", "b"}
    assert added([outdone("a", confirmed=False)]) == []
    assert added([outdone("c")]) == []


def test_a_load_between_flights_is_no_proxy_and_nothing_is_added_twice(helpful):
    helpful |= {"a", "b"}
    assert added([outdone("a", between_flights=True)]) == []
    assert len(added([outdone("a"), outdone("a")])) == 1


def test_what_fell_too_little_is_said_so():
    fell = outdone("a")
    for total, words in ((12.0, "fell, but not surely enough"), (-12.0, "did not help")):
        judged = CostReduction(np.full(3, total / 3.0))
        refused = Trial(
            fell.candidate, Outcome.NOT_CONFIRMED, judged, judged, JudgedBy.HELD_OUT, "", False, 0.1, (), None, fell.fit
        )
        assert refused.sentence.startswith(words)
        assert replace(refused, negligible=True).sentence.startswith(
            "not added: its fitted size is negligible; the cost"
        )


@pytest.mark.parametrize(("size", "expected"), [(0.04, False), (-0.06, True)])
def test_a_size_below_a_twentieth_of_the_usual_one_is_of_no_consequence(size: float, expected):
    fit = SimpleNamespace(vehicle=SimpleNamespace(value={"a.x": size}.__getitem__))
    assert search._matters(cast("Any", SimpleNamespace(candidate=candidate("a"), fit=fit))) is expected
