"""What a diagnosis writes beside the optimum: what counts as written, and what as an optimum."""

import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

import sysid
import vehicle
from flight import InputError
from sysid.estimator.validation.comparison import HORIZONS_S
from sysid.estimator.verdict import Verdict
from vehicle import effects

BENCHMARKS = Path(__file__).parents[3] / "benchmarks"
GIVEN = vehicle.example("hummingbird")
TRUTH = {"kind": "form", "law": "F = -c |v|^1.6 v", "variables": ["v_x"]}


@pytest.fixture
def beside(monkeypatch):
    """Errors that each model is to have, through the bookkeeping of `beside_optimum`; fits keep their vehicle."""
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    import diagnosis_written

    asked: list[sysid.Options] = []

    def compared(errors: dict[str, float], *, converged: bool = True, against: tuple[str, ...] = ()) -> dict[str, Any]:
        def identify(logs: Any, model: vehicle.Vehicle, options: sysid.Options) -> Any:
            asked.append(options)
            return SimpleNamespace(vehicle=model, converged=converged)

        def compare(logs: Any, models: dict[str, Any], options: sysid.Options) -> Any:
            return SimpleNamespace(errors={n: {"position": [errors[n]] * len(HORIZONS_S)} for n in models})

        monkeypatch.setattr(sysid, "identify", identify)
        monkeypatch.setattr(sysid, "compare", compare)
        fit = SimpleNamespace(clock="rotor speed", noise=SimpleNamespace(gusts=object()))
        search = SimpleNamespace(equation=None, models=[SimpleNamespace(fit=fit)])
        found = SimpleNamespace(search=search, vehicle=GIVEN, fit_verdict=Verdict(against=against))
        return diagnosis_written.beside_optimum([], [], GIVEN, cast("Any", found), TRUTH)

    yield compared, asked
    effects.forget_files(effects.from_files())


ERRORS = {"given": 1.0, "written": 0.5, "optimum": 0.4}


def test_the_optimum_is_fitted_as_the_diagnosis_last_fitted(beside):
    compared, asked = beside
    assert compared(ERRORS)["optimum"] == ERRORS
    assert {(options.clock, options.gusts) for options in asked} == {("rotor speed", "estimate")}


def test_a_model_that_is_refused_has_an_infinite_error(beside):
    assert beside[0](ERRORS, against=("no",))["optimum"]["written"] == float("inf")


@pytest.mark.parametrize(
    ("errors", "converged"), [(ERRORS, False), ({**ERRORS, "optimum": 5.0}, True), ({**ERRORS, "optimum": 1.0}, True)]
)
def test_a_fit_that_has_not_converged_or_helps_nothing_is_no_optimum(beside, errors, converged):
    assert set(beside[0](errors, converged=converged)) == {"no_optimum"}


def test_a_true_form_that_cannot_be_fitted_leaves_no_optimum(beside, monkeypatch):
    def fails(*_: Any) -> None:
        raise InputError("too short")

    compared, _ = beside
    compared(ERRORS)
    import diagnosis_written

    monkeypatch.setattr(sysid, "identify", fails)
    fit = SimpleNamespace(clock="pose", noise=SimpleNamespace(gusts=None))
    found = SimpleNamespace(search=SimpleNamespace(models=[SimpleNamespace(fit=fit)]))
    said = diagnosis_written.beside_optimum([], [], GIVEN, cast("Any", found), TRUTH)
    assert said == {"no_optimum": "too short"}


def test_only_laws_of_another_form_have_one(beside):
    assert "diagnosis_written" in sys.modules
    import diagnosis_written

    assert diagnosis_written.beside_optimum([], [], GIVEN, cast("Any", None), {"kind": "single"}) == {}
