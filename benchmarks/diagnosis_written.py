"""What a user has of a diagnosis besides its sentence: how long the answer is, whether a model is written, how good.

Of laws of another form than the catalogue's the model that is written stands beside the best that its flights allow:
the same fit with the true law's form, sizes and shapes free.
"""

import contextlib
import io
import tempfile
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
OPTIONS = while_searching(sysid.Options(gusts="white"))
"""As a diagnosis fits."""


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
    training, held_out = ([Path(f"{name}.parquet") for name in part] for part in (found.flights, found.held_out))
    out = Path("better.toml")
    refused = found.fit_verdict.use is Use.REJECTED
    call = what_next.DiagnoseCall(
        training,
        Path("vehicle.toml"),
        held_out,
        auto=True,
        out=None if refused else out,
        refused=out if refused else None,
    )
    told = io.StringIO()
    with contextlib.redirect_stdout(told):
        diagnosis_screen.short(found).show()
    lines = told.getvalue().splitlines()
    lines += [f"next: {line}" for line in first(what_next.lines(found, call))]
    mark = purpose.mark_sentence(found.vehicle)
    lines += [
        f"not written: {out}, as the fit is not to be used (see --anyway)" if refused else f"written: {out}{mark}"
    ]
    return sum(max(1, -(-len(line) // COLUMNS)) for line in lines)


def beside_optimum(
    training: list[FlightLog],
    held_out: list[FlightLog],
    given: vehicle.Vehicle,
    found: Diagnosis,
    truth: dict[str, Any],
) -> dict[str, Any]:
    """Position errors after 0.5 s on held-out flights: of the model given, of the one written and of the optimum.

    Written is the vehicle of the diagnosis, with the equation that it proposes, if it does, fitted as its next command
    does.
    """
    if truth["kind"] != "form":
        return {}
    with tempfile.TemporaryDirectory() as spare:
        folder = Path(spare)
        try:
            true = form_laws.informed(given, truth["law"], truth["variables"], folder)
            best = sysid.identify(training, true, OPTIONS).vehicle
            models = {"given": given, "written": _written(training, found, folder), "optimum": best}
            compared = sysid.compare(held_out, models, OPTIONS)
        except InputError as error:
            return {"no_optimum": str(error)}
        finally:
            effects.forget_files(effects.from_files())
    at = HORIZONS_S.index(0.5)
    law = found.search.equation
    return {
        "optimum": {name: compared.errors[name]["position"][at] for name in models},
        "equation": None if law is None else law.form.formula,
        "true_sizes": {n: p.value for n, p in best.parameters.items() if n.startswith(form_laws.NAME)},
    }


def _written(training: list[FlightLog], found: Diagnosis, folder: Path) -> vehicle.Vehicle:
    law = found.search.equation
    if law is None or found.undecided:
        return found.vehicle
    file = equation_text.scaffold(law, folder / "proposed.py", name="proposed")
    return sysid.identify(training, found.vehicle.with_effect_file(file), OPTIONS).vehicle
