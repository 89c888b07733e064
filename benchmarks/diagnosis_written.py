"""What a user has of a diagnosis besides its sentence: how long the answer is, whether a model is written, how good.

Of laws of another form than the catalogue's the model that is written stands beside the best that its flights allow:
the same fit with the true law's form, sizes and shapes free.
"""

import contextlib
import io
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import form_laws

import sysid
import vehicle
from flight import FlightLog, InputError
from goshawk.commands.learn import diagnosis_screen, what_next
from goshawk.commands.learn.diagnose import first
from sysid.diagnosis import Diagnosis, equation_text
from sysid.diagnosis.procedure import while_searching
from sysid.estimator.validation.comparison import HORIZONS_S
from sysid.estimator.verdict import Use
from vehicle import effects, purpose

COLUMNS = 80
OUT = Path("better.toml")
OPTIONS = while_searching(sysid.Options(gusts="white"))
"""As a diagnosis fits, by the clock of the pose and with disturbances taken for noise."""


def answer(found: Diagnosis) -> dict[str, Any]:
    """Lines on the screen, and the fate of the model."""
    given, last = found.predicts.given_m, found.predicts.fitted_m
    use = found.fit_verdict.use
    return {
        "lines": screen_lines(found),
        "halves": bool(last <= 0.5 * given),
        "written": use is not Use.REJECTED,
        "for_prediction": use is Use.PREDICTION,
        "marked": bool(purpose.mark_sentence(found.vehicle)),
    }


def screen_lines(found: Diagnosis) -> int:
    """Lines of 80 columns of `goshawk diagnose --auto --out` without --details, at most: the verb looks first whether a
    next flight would tell, and proposes none that would not."""
    refused = found.fit_verdict.use is Use.REJECTED
    told = io.StringIO()
    with contextlib.redirect_stdout(told):
        diagnosis_screen.short(found).show()
    lines = told.getvalue().splitlines()
    lines += [f"next: {line}" for line in first(what_next.lines(found, _call(found)))]
    mark = purpose.mark_sentence(found.vehicle)
    lines += [
        f"not written: {OUT}, as the fit is not to be used (see --anyway)" if refused else f"written: {OUT}{mark}"
    ]
    return sum(max(1, -(-len(line) // COLUMNS)) for line in lines)


def _call(found: Diagnosis) -> what_next.DiagnoseCall:
    """As a user asks who wants the model."""
    training, held_out = ([Path(f"{name}.parquet") for name in part] for part in (found.flights, found.held_out))
    refused = found.fit_verdict.use is Use.REJECTED
    return what_next.DiagnoseCall(
        training,
        Path("vehicle.toml"),
        held_out,
        auto=True,
        out=None if refused else OUT,
        refused=OUT if refused else None,
    )


def beside_optimum(
    training: list[FlightLog],
    held_out: list[FlightLog],
    given: vehicle.Vehicle,
    found: Diagnosis,
    truth: dict[str, Any],
) -> dict[str, Any]:
    """Position errors after 0.5 s on held-out flights: of the model given, of the one written and of the optimum.

    Written is the vehicle of the diagnosis, with the equation that its next command adds, if it does, fitted as that
    does. A model that is refused, or whose fit fails, has an infinite error. Where the fit with the true law's form has
    not converged or is no better than the model given, there is no optimum to compare with.
    """
    if truth["kind"] != "form":
        return {}
    options = _as_fitted(found)
    with tempfile.TemporaryDirectory() as spare:
        folder = Path(spare)
        try:
            true = form_laws.informed(given, truth["law"], truth["variables"], folder)
            best = sysid.identify(training, true, options)
            written = _written(training, found, folder, options)
            models = {"given": given, "optimum": best.vehicle} | ({} if written is None else {"written": written})
            compared = sysid.compare(held_out, models, options)
        except InputError as error:
            return {"no_optimum": str(error)}
        finally:
            effects.forget_files(effects.from_files())
    at = HORIZONS_S.index(0.5)
    errors = {"written": float("inf")} | {name: compared.errors[name]["position"][at] for name in models}
    if not best.converged or not errors["optimum"] < errors["given"]:
        return {"no_optimum": f"{'' if best.converged else 'not converged, '}{errors}"}
    law = found.search.equation
    return {
        "optimum": errors,
        "equation": None if law is None else law.form.formula,
        "true_sizes": {n: p.value for n, p in best.vehicle.parameters.items() if n.startswith(form_laws.NAME)},
    }


def _as_fitted(found: Diagnosis) -> sysid.Options:
    """The options of the diagnosis' own last fit."""
    fit = found.search.models[-1].fit
    return replace(OPTIONS, clock=fit.clock, gusts="white" if fit.noise.gusts is None else "estimate")


def _written(
    training: list[FlightLog], found: Diagnosis, folder: Path, options: sysid.Options
) -> vehicle.Vehicle | None:
    """None where nothing is written."""
    if found.fit_verdict.use is Use.REJECTED:
        return None
    law = found.search.equation
    if law is None or not any(line.endswith("--proposed") for line in what_next.lines(found, _call(found))):
        return found.vehicle
    file = equation_text.scaffold(law, folder / "proposed.py", name="proposed")
    try:
        fitted = sysid.identify(training, found.vehicle.with_effect_file(file), options)
    except InputError:
        return None
    return None if fitted.verdict.use is Use.REJECTED else fitted.vehicle
