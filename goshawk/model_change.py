"""One change of a vehicle model and its effect: refit, then compare prediction errors on held-out flights."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import sysid
from firmware_bridge import controller
from flight import FlightLog, InputError, Progress, file_format, silent
from sysid.estimator.comparison import HORIZONS_S, QUANTITIES
from sysid.estimator.verdict import Verdict
from sysid.report.pages import SHOWN
from vehicle import Vehicle
from vehicle.history import HeldOut, Step

if TYPE_CHECKING:
    from matplotlib.figure import Figure

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


def refitted(present: Vehicle, changed: Vehicle, flights: Flights, *, progress: Progress = silent) -> Change:
    """Fit the changed model and, for a fair comparison, the present one too, to the same flights.

    Raises:
        InputError: a flight cannot be used.
    """
    training, options = list(flights.training.values()), sysid.Options(unseen="hold")
    after = sysid.identify(training, changed, options, progress=progress)
    if not flights.held_out:
        return Change(after.vehicle, {}, None, after.findings, after.verdict)
    before = sysid.identify(training, present, options, progress=progress)
    models = {PRESENT: present, BEFORE: before.vehicle, AFTER: after.vehicle}
    errors, left_out = held_out_errors(models, list(flights.held_out.values()), progress=progress)
    evidence = HeldOut(named(flights.held_out), errors[BEFORE], errors[AFTER], verdict(errors[BEFORE], errors[AFTER]))
    fit = after.verdict
    if not before.converged:
        fit = fit.doubted("the present model, which the change is compared with, was refitted without converging")
    return Change(after.vehicle, errors, evidence, (*after.findings, *left_out), fit)


def evaluated(present: Vehicle, changed: Vehicle, flights: Flights, *, progress: Progress = silent) -> Change:
    """Compare the change, without fitting, with the present model on held-out flights."""
    models = {BEFORE: present, AFTER: changed}
    errors, left_out = held_out_errors(models, list(flights.held_out.values()), progress=progress)
    words = verdict(errors[BEFORE], errors[AFTER])
    return Change(
        changed, errors, HeldOut(named(flights.held_out), errors[BEFORE], errors[AFTER], words), left_out, None
    )


def held_out_errors(
    models: Mapping[str, Vehicle], logs: Sequence[FlightLog], *, progress: Progress = silent
) -> tuple[dict[str, dict[str, float]], tuple[str, ...]]:
    """Root mean square open-loop prediction error of each model after `HORIZON_S`, by quantity with its unit; and in
    words which stretches of the flights were left out, and which models' errors are not settled."""
    result = sysid.compare(logs, models, progress=progress)
    at = HORIZONS_S.index(HORIZON_S)
    errors = {
        model: {key: float(result.errors[model][quantity][at]) for quantity, key in KEYS.items()} for model in models
    }
    return errors, (*result.left_out, *result.not_converged)


def prediction_error(quantity: str, value: float) -> str:
    """An error of `sysid.compare` in the unit that people read: `130 mm`, `5.6 deg`."""
    unit, scale = SHOWN[quantity]
    return f"{scale * value:.3g} {unit}"


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
    said = ", ".join(f"{_plain(name)} {change[name]:+.0%}" for name in (*better, *worse))
    if not worse:
        return f"helped: {said}"
    if not better:
        return f"did not help, it made the model worse: {said}"
    return f"did not clearly help, some errors fall and others rise: {said}"


def _plain(name: str) -> str:
    return name.split("_")[0]


def differences(old: Vehicle, new: Vehicle) -> list[str]:
    """One line per effect and number that differs."""
    lines = [f"+ effect {name}" for name in new.effects if name not in old.effects]
    lines += [f"- effect {name}" for name in old.effects if name not in new.effects]
    for name in dict.fromkeys([*old.parameters, *new.parameters]):
        both = old.parameters.get(name), new.parameters.get(name)
        if len({p.value if p else None for p in both}) == 2:
            first, second = (f"{p.value:.5g}" if p else "none" for p in both)
            lines.append(f"  {name}: {first} -> {second} {next(p.unit for p in both if p)}")
    return lines


def compensations(model: Vehicle) -> dict[str, tuple[bool, str]]:
    """Every active effect: whether the controller compensates it, and how or why not."""
    table = controller.compensated_effects()
    try:
        left = controller.parameters_of(model).not_compensated
    except InputError as error:
        return dict.fromkeys(model.effects, (False, str(error)))
    found: dict[str, tuple[bool, str]] = {}
    for name in model.effects:
        entry = table.get(name)
        how = entry.how if entry else "an effect of your own, for which the controller has no compensation"
        if entry and entry.compensated and name in left:
            how = f"only together with {entry.only_with} alone"
        found[name] = (name not in left, how)
    return found


def staircase(steps: Sequence[Step], errors: Sequence[Mapping[str, float]], flights: Sequence[str], path: Path) -> None:
    """Draw the held-out errors over a model's versions, one panel per quantity; SVG or PNG by the file's name."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    if path.suffix not in (".svg", ".png"):
        raise InputError(f"{path}: a figure is an .svg or a .png")
    figure = Figure(figsize=(9.0, 0.9 + 0.3 * len(steps) + 1.2), layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    _draw(figure, [_label(step) for step in steps], errors)
    figure.suptitle(f"error after {HORIZON_S:g} s on {', '.join(flights)}", fontsize=9, x=0.01, ha="left")
    with file_format.atomic_file(path) as temporary:
        figure.savefig(temporary, format=path.suffix[1:], dpi=130)


def _label(step: Step) -> str:
    return f"{step.number}  {step.action} {step.effect}".rstrip()


def _draw(figure: "Figure", labels: list[str], errors: Sequence[Mapping[str, float]]) -> None:
    places = range(len(labels))
    panels = figure.subplots(1, len(QUANTITIES), sharey=True)
    for axes, (quantity, unit) in zip(panels, QUANTITIES.items(), strict=True):
        values = [error[KEYS[quantity]] for error in errors]
        axes.stairs(
            values, [p - 0.5 for p in range(len(labels) + 1)], orientation="horizontal", color="#1f6f8b", lw=1.6
        )
        for place, value in zip(places, values, strict=True):
            axes.annotate(f"{value:.3g}", (value, place), (3, 0), textcoords="offset points", va="center", fontsize=7.5)
        axes.set_xlim(0.0, 1.35 * max(values))
        axes.set_ylim(len(labels) - 0.5, -0.5)
        axes.set_title(f"{quantity} ({unit})", loc="left", fontsize=9)
        axes.set_yticks(list(places), labels, fontsize=8)
        axes.tick_params(axis="x", labelsize=7.5)
        axes.locator_params(axis="x", nbins=4)
        axes.spines[["top", "right"]].set_visible(False)
