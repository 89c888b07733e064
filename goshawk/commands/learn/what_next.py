"""Commands that follow a diagnosis: add the effect, make an effect of the curve, or fly the next manoeuvre."""

import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from flight import InputError
from goshawk.commands.learn import fit_options
from goshawk.commands.learn.flights import marked_file
from sysid.diagnosis import Diagnosis, OutsideFinding, curve, equation_text
from sysid.diagnosis.experiment_design import next_flight, outlook
from sysid.diagnosis.experiment_design.outlook import Outlook
from sysid.diagnosis.from_imu import UNEQUAL, WEAK, ImuDiagnosis
from sysid.estimator.verdict import Use

THRUST = "thrust_bem"
"""This candidate replaces the vehicle's thrust law, so `effect add` alone does not add it."""


@dataclass(frozen=True, slots=True)
class DiagnoseCall:
    """Arguments of the diagnosis, which its follow-up commands repeat."""

    flights: Sequence[Path]
    vehicle_file: Path
    held_out: Sequence[Path] = ()
    columns: Path | None = None
    out: Path | None = None
    """The vehicle file that was written, if any."""
    auto: bool = False
    fit: str = ""
    """Options of the fit, as they are typed."""
    refused: Path | None = None
    """The vehicle file that was asked for and not written, as the fit is not to be used."""

    @property
    def model_file(self) -> Path:
        """The newest vehicle file."""
        return self.out or self.vehicle_file

    def training(self) -> str:
        """FLIGHTS as arguments."""
        return _words(*self.flights)

    def judging(self) -> str:
        """Options for held-out flights and the column map."""
        return "".join(f" --held-out {_words(path)}" for path in self.held_out) + self.reading()

    def reading(self) -> str:
        return f" --columns {_words(self.columns)}" if self.columns else ""

    def refitting(self) -> str:
        """Flights and options of `goshawk vehicle effect add`."""
        return f" {self.training()}{self.judging()}"

    def adding(self, effect: str) -> str:
        """Add an effect to the vehicle file, fitted."""
        return f"goshawk vehicle effect add {_words(self.vehicle_file)} {effect}{self.refitting()}"

    def again(self, vehicle_file: Path) -> str:
        """The diagnosis once more."""
        return f"goshawk diagnose {self.training()} --vehicle {_words(vehicle_file)}{self.judging()}{self.fit}"


def lines(found: Diagnosis, call: DiagnoseCall, outlooks: Mapping[str, Outlook] | None = None) -> list[str]:
    """Follow-up commands, in order; a line in brackets is a remark.

    Args:
        outlooks: by candidate in doubt, whether a flight would tell; a flight that would not is not proposed.
    """
    marking, call = _marking(found, call)
    said = _fit_first(found, call)
    said += [*marking, *_after_additions(found, call)] if _added(found) else []
    said += _after_curve(found, call)
    return said + _next_flight(found, call, outlooks)


def lines_of_imu(found: ImuDiagnosis, call: DiagnoseCall) -> list[str]:
    """Of flights without a pose: add what was named."""
    named = (WEAK if name == UNEQUAL else name.partition("[")[0] for name in found.additions)
    return [] if call.out is not None else [call.adding(effect) for effect in dict.fromkeys(named)]


def _fit_first(found: Diagnosis, call: DiagnoseCall) -> list[str]:
    """What to do about a fit that is not to be used, before anything that rests on it."""
    if found.fit_verdict.use is not Use.REJECTED:
        return []
    fit = found.search.models[-1].fit
    asked = f"{' --auto' if call.auto else ''}{f' --out {_words(call.refused)}' if call.refused else ''}"
    if found.cause is not None:
        kept = [path for path in call.flights if found.cause.without not in (path.stem, str(path))]
        tried = replace(call, flights=kept, fit=fit_options.with_cause(call.fit, found.cause))
        return [f"({found.cause.sentence})", f"{tried.again(call.vehicle_file)}{asked}"]
    if fit.converged:
        return ["(the fit is not to be used: settle first what its verdict says)"]
    longer = f"{re.sub(r' --steps [0-9]+', '', call.fit)} --steps {2 * len(fit.solution.record)}"
    again = f"{replace(call, fit=longer).again(call.vehicle_file)}{asked}"
    return ["(the fit has not converged: let it go on, or mend what the log's checks find, before all else)", again]


def _added(found: Diagnosis) -> tuple[str, ...]:
    """What the fitted vehicle holds beyond the given one: what is missing, and proxies that help."""
    return (*found.additions, *found.proxies)


def _after_additions(found: Diagnosis, call: DiagnoseCall) -> list[str]:
    if call.refused is not None:
        return []  # the fit comes first, and adds them again
    if call.out is not None:
        return [] if call.auto else [call.again(call.out)]
    effects = list(dict.fromkeys(name.partition("[")[0] for name in _added(found)))
    if THRUST in effects and THRUST not in found.base.effects:
        return [call.again(call.vehicle_file) + (" --auto" if call.auto else "") + " --out better.toml"]
    return [call.adding(effect) for effect in effects]


def _marking(found: Diagnosis, call: DiagnoseCall) -> tuple[list[str], DiagnoseCall]:
    """Commands that mark the logs of flights without the payload; the others need no mark.

    Returns:
        The commands, and the arguments with the marked logs.
    """
    paths = (*call.flights, *call.held_out)
    left = [path for path, carries in zip(paths, found.payload_carried, strict=False) if not carries]
    marked = [marked_file(path) if path in left else path for path in paths]
    many = len(call.flights)
    commands = [f"goshawk log mark {_words(path)}{call.reading()} --payload left" for path in left]
    return commands, replace(call, flights=marked[:many], held_out=marked[many:])


def _to_be_adopted(found: Diagnosis) -> OutsideFinding | None:
    """The curve; None while the diagnosis names confounded effects, none of which is confirmed."""
    return None if found.undecided else found.outside


def _after_curve(found: Diagnosis, call: DiagnoseCall) -> list[str]:
    """The command that adds the law of the curve, or the curve, as an own effect; a remark where none can be made."""
    outside, law = _to_be_adopted(found), found.search.equation
    if found.undecided or (outside is None and law is None) or call.refused is not None:
        return []
    if outside is not None and (advice := curve.advice(outside.channel, outside.variable)):
        return [f"({outside.channel} against {outside.variable}: {advice})"]
    name = equation_text.suggested_name(law) if law else curve.suggested_name(outside) if outside else ""
    return [f"goshawk vehicle effect add {_words(call.model_file)} {name}.py{call.refitting()} --proposed"]


def _next_flight(found: Diagnosis, call: DiagnoseCall, outlooks: Mapping[str, Outlook] | None) -> list[str]:
    """The command that proposes the next flight, if any candidate is in doubt."""
    worth_flying = None if outlooks is None else [name for name, view in outlooks.items() if view.would_tell]
    try:
        candidates = next_flight.in_doubt(found, worth_flying)
    except InputError:
        return []
    named = bool(set(candidates) & set(_added(found)))
    is_drawn = _to_be_adopted(found) is not None or found.search.equation is not None
    if not named and (is_drawn or (_added(found) and call.out is None)):
        return []
    size, corner = (_numbers(values) for values in outlook.space(found))
    model = _words(call.vehicle_file if named else call.model_file)
    options = "".join(f" --candidate {_words(name)}" for name in candidates)
    return [
        f"goshawk next-flight {call.training()} --vehicle {model}{call.reading()}{options}"
        f" --space {size} --corner={corner} --out waypoints.json  # in the space that these flights took up"
    ]


def _numbers(values: np.ndarray) -> str:
    return ",".join(f"{v:.1f}" for v in values)


def _words(*paths: object) -> str:
    return shlex.join(str(path) for path in paths)
