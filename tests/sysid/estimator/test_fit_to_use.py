"""Why a fit is not to be used is named by the first trial that gives one to be used."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

import vehicle
from sysid import Options
from sysid.estimator import fit_to_use
from sysid.estimator.fit_to_use import Chosen, likely_cause
from sysid.estimator.verdict import Verdict

YAW = "inertia_zz_kg_m2"
BAD = Verdict(against=("inertia_zz_kg_m2 came out 0.06",), unphysical=(YAW,))
LOGS: Any = [SimpleNamespace(metadata={"name": name}) for name in ("lap", "spin")]


def fit(verdict: Verdict, *, converged: bool = True) -> Any:
    """The second log is explained worst."""
    flights = [SimpleNamespace(log_index=i) for i in (0, 1)]
    residuals = [([1.0], []), ([3.0], [])]
    return SimpleNamespace(
        verdict=verdict, converged=converged, flights=flights, solution=SimpleNamespace(residuals=residuals)
    )


@pytest.mark.parametrize(
    ("usable", "converged", "sentence", "held", "without", "steps"),
    [
        ("steps", False, "with 60 steps the fit is usable", (), "", 60),
        ("held", True, f"with the vehicle file's {YAW} the fit is usable", (YAW,), "", 0),
        ("fewer", True, "without spin the fit is usable", (), "spin", 0),
    ],
)
def test_the_first_change_that_mends_the_fit_is_its_likely_cause(
    monkeypatch: pytest.MonkeyPatch, usable: str, converged: bool, sentence: str, held, without: str, steps: int
):
    def identify(logs: Any, given: Any, options: Options, **how: Any) -> Any:
        kind = "fewer" if len(logs) < 2 else "held" if YAW in options.held else "steps"
        assert (how["near"] is None) == (kind == "fewer")
        return fit(Verdict() if kind == usable else BAD)

    monkeypatch.setattr(fit_to_use, "identify", identify)
    made = Chosen(fit(BAD, converged=converged), replace(Options(), max_iterations=30))
    cause = likely_cause(LOGS, vehicle.example(), made)
    assert cause is not None
    assert (cause.sentence, cause.held, cause.without, cause.steps) == (sentence, held, without, steps)


def test_where_no_trial_helps_no_cause_is_named(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(fit_to_use, "identify", lambda *asked, **how: fit(BAD))
    assert likely_cause(LOGS, vehicle.example(), Chosen(fit(BAD), Options())) is None


@pytest.mark.parametrize(("other", "taken"), [(Verdict(), True), (BAD, False)])
def test_the_other_way_to_treat_disturbances_is_taken_only_where_its_fit_may_be_used(
    monkeypatch: pytest.MonkeyPatch, other: Verdict, taken: bool
):
    asked = Options(gusts="white")
    made = {"white": fit(BAD), "estimate": fit(other)}
    made["estimate"].noise, made["estimate"].parameters = SimpleNamespace(gusts=object()), ()
    monkeypatch.setattr(fit_to_use, "identify", lambda logs, given, options, **how: made[options.gusts])
    chosen = fit_to_use.fit_to_use(LOGS, vehicle.example(), asked)
    assert chosen.fit is made["estimate" if taken else "white"]
    assert chosen.options.gusts == ("estimate" if taken else "white")
    assert bool(chosen.said) is taken
