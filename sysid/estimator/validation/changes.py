"""One change of a vehicle model and its effect: refit, then compare prediction errors on held-out flights."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from flight import FlightLog, InputError, Progress, file_format, silent
from sysid.estimator.fit_to_use import fit_to_use
from sysid.estimator.identification import identify
from sysid.estimator.options import Gaps, Options
from sysid.estimator.validation.better import predicts
from sysid.estimator.validation.comparison import HORIZONS_S, QUANTITIES, SMOOTHING_STEPS, Comparison, compare
from sysid.estimator.verdict import Verdict, of_logs
from sysid.logs.check import check_log
from vehicle import Vehicle
from vehicle.history import HeldOut

HORIZON_S = 0.5
"""Horizon at which held-out predictions are compared."""
NOTHING = 0.01
"""A relative change of an error below this counts as none."""

KEYS = {quantity: f"{quantity}_{unit.replace('/', '_')}" for quantity, unit in QUANTITIES.items()}
"""What each quantity's error is called in files."""

PRESENT, BEFORE, AFTER = "as it was", "refitted, without the change", "refitted, with the change"


@dataclass(frozen=True, slots=True)
class Flights:
    """Flights for fitting, and held-out flights."""

    training: Mapping[Path, FlightLog]
    held_out: Mapping[Path, FlightLog]

    def __post_init__(self) -> None:
        hashes = {file_format.file_hash(path) for path in self.training}
        for path in self.held_out:
            if file_format.file_hash(path) in hashes:
                raise InputError(f"{path} is held out and used for fitting; it cannot be both")


@dataclass(frozen=True, slots=True)
class Change:
    """The model after a change, and its errors on held-out flights with and without the change."""

    vehicle: Vehicle
    errors: Mapping[str, Mapping[str, float]]
    """Model (`PRESENT`, `BEFORE`, `AFTER`) to quantity to error after `HORIZON_S`; empty without held-out flights."""
    held_out: HeldOut | None
    findings: tuple[str, ...]
    """What the user should know of the refit and of the held-out flights."""
    fit: Verdict | None
    """Verdict on the refit; None where nothing was refitted."""


def refitted(
    present: Vehicle, changed: Vehicle, flights: Flights, *, gaps: Gaps = "refuse", progress: Progress = silent
) -> Change:
    """Fit the changed model and, for a fair comparison, the present one too, to the same flights, as `identify` does.

    Args:
        gaps: as in `Options`, for fitting and judging alike.

    Raises:
        InputError: a flight cannot be used.
    """
    training = list(flights.training.values())
    made = fit_to_use(training, changed, Options(unseen="hold", gaps=gaps), progress=progress)
    after, findings = made.fit, (*made.said, *made.fit.findings)
    logs = (check_log(log, present) for log in (*training, *flights.held_out.values()))
    fit = of_logs(logs).beside(after.verdict)
    if not flights.held_out:
        return Change(after.vehicle, {}, None, findings, fit)
    before = identify(training, present, made.options, progress=progress)
    models = {PRESENT: present, BEFORE: before.vehicle, AFTER: after.vehicle}
    judged = _compared(models, list(flights.held_out.values()), gaps, progress)
    errors, left_out = _errors(judged), (*judged.left_out, *judged.not_converged)
    evidence = HeldOut(named(flights.held_out), errors[BEFORE], errors[AFTER], verdict(errors[BEFORE], errors[AFTER]))
    fit = replace(fit, predicts=predicts(judged, PRESENT, AFTER, "held-out flights"))
    if not before.converged:
        fit = fit.doubted("the present model, which the change is compared with, was refitted without converging")
    return Change(after.vehicle, errors, evidence, (*findings, *left_out), fit)


def evaluated(present: Vehicle, changed: Vehicle, flights: Flights, *, progress: Progress = silent) -> Change:
    """Compare the change, without fitting, with the present model on held-out flights."""
    models = {BEFORE: present, AFTER: changed}
    errors, left_out = held_out_errors(models, list(flights.held_out.values()), progress=progress)
    words = verdict(errors[BEFORE], errors[AFTER])
    return Change(
        changed, errors, HeldOut(named(flights.held_out), errors[BEFORE], errors[AFTER], words), left_out, None
    )


def held_out_errors(
    models: Mapping[str, Vehicle], logs: Sequence[FlightLog], *, gaps: Gaps = "refuse", progress: Progress = silent
) -> tuple[dict[str, dict[str, float]], tuple[str, ...]]:
    """Root mean square open-loop prediction error of each model after `HORIZON_S`, by quantity with its unit; and in
    words which stretches of the flights were left out, and which models' errors are not settled."""
    result = _compared(models, logs, gaps, progress)
    return _errors(result), (*result.left_out, *result.not_converged)


def _compared(models: Mapping[str, Vehicle], logs: Sequence[FlightLog], gaps: Gaps, progress: Progress) -> Comparison:
    return compare(logs, models, Options(max_iterations=SMOOTHING_STEPS, gaps=gaps), progress=progress)


def _errors(found: Comparison) -> dict[str, dict[str, float]]:
    """By model, after `HORIZON_S`."""
    at = HORIZONS_S.index(HORIZON_S)
    return {
        m: {key: float(errors[quantity][at]) for quantity, key in KEYS.items()} for m, errors in found.errors.items()
    }


def named(flights: Mapping[Path, FlightLog]) -> dict[str, str]:
    """Names of flight files with their hashes."""
    return {path.name: file_format.file_hash(path) for path in flights}


def verdict(before: Mapping[str, float], after: Mapping[str, float]) -> str:
    """Whether a change lowered the errors, over all quantities, as a sentence."""
    change = {name: after[name] / before[name] - 1.0 for name in before}
    better = [name for name, by in change.items() if by < -NOTHING]
    worse = [name for name, by in change.items() if by > NOTHING]
    if not better and not worse:
        return "did not help: no error changes by more than 1 %"
    said = ", ".join(f"{_plain(name)} {change[name]:+.0%}" for name in (*better, *worse)).replace("-", "−")
    if not worse:
        return f"helped: {said}"
    if not better:
        return f"did not help, it made the model worse: {said}"
    return f"did not clearly help, some errors fall and others rise: {said}"


def _plain(name: str) -> str:
    return name.split("_")[0]
