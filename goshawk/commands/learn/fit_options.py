"""How a fit is done, as options: the same for `identify`, `diagnose` and `compare`."""

import functools
import re
import shlex
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from flight import FlightError, InputError
from sysid.estimator.fit_to_use import Cause
from sysid.estimator.options import LEAST_NODES, HoverCommand, Options, RotorThrust
from sysid.logs.check import LogReport
from vehicle import Vehicle

FLAGS = {
    "gaps='split'": "--split-gaps",
    "robust=True": "--robust",
    "gusts='estimate'": "--gusts estimate",
    "most_nodes": "--most-nodes",
}
"""Arguments that the library's messages name, and the corresponding options."""
BALANCE_SHARE = 0.03
"""Standard deviation of a thrust on a balance that is given without one."""

anyway_option = click.option(
    "--anyway", is_flag=True, help="Write the vehicle file even if the verdict is `do not use`."
)

held_out_option = click.option(
    "--held-out",
    "held_out",
    multiple=True,
    type=click.Path(path_type=Path),
    help="Held-out flight: used for evaluation only. Repeatable.",
)

Chosen = Mapping[str, Any]
"""Values of the options, by the names of the verb's arguments."""

_NAMES = (
    "held",
    "free",
    "priors",
    "hovers",
    "rotor_thrusts",
    "split_gaps",
    "hold_unidentifiable",
    "robust",
    "gusts",
    "estimate_command_delay",
    "gravity_m_s2",
    "most_steps",
    "most_nodes",
)


_ANCHORS = (
    click.option(
        "--hover",
        "hovers",
        multiple=True,
        metavar="COMMAND[,STD][@VOLTS]",
        help="Of flights without a pose: the command, 0 to 1, that hovers; at a second voltage, too. Repeatable.",
    ),
    click.option(
        "--rotor-thrust",
        "rotor_thrusts",
        multiple=True,
        metavar="COMMAND,NEWTON[,STD]",
        help="Of flights without a pose: thrust of one rotor at a command, on a balance. Repeatable.",
    ),
)
"""Measurements beside flights without a pose."""


def fit_options() -> Callable[[Any], Any]:
    """A decorator that gives a verb these options; their values reach it as one argument `fit`.

    Errors of the library leave the verb with the names of options instead of arguments.
    """
    options = [
        click.option("--hold", "held", multiple=True, metavar="NAME", help="Keep this parameter as it is. Repeatable."),
        click.option(
            "--free",
            "free",
            multiple=True,
            metavar="NAME",
            help="Estimate only this, and the pose sensor's pose. Repeatable.",
        ),
        click.option(
            "--prior",
            "priors",
            multiple=True,
            metavar="NAME=STD",
            help="Gaussian prior about the file's value. Repeatable.",
        ),
        *_ANCHORS,
        click.option("--split-gaps", is_flag=True, help="Fit the pieces between gaps as separate flights."),
        click.option(
            "--hold-unidentifiable/--refuse-unidentifiable",
            default=True,
            show_default=True,
            help="Hold parameters that these flights do not identify, or refuse.",
        ),
        click.option(
            "--robust", is_flag=True, help="Robust loss on pose samples: outliers (a pose that jumps) have less weight."
        ),
        click.option(
            "--gusts",
            type=click.Choice(("estimate", "white")),
            default="estimate",
            show_default=True,
            help="Disturbances that last: estimate them with the states, or take all of them for white noise.",
        ),
        click.option(
            "--estimate-command-delay",
            is_flag=True,
            help="Of logs without rotor speed, whose commands another recorder stamped: estimate how late they are.",
        ),
        click.option(
            "--gravity",
            "gravity_m_s2",
            type=float,
            help="Gravity where it was flown, m/s2; a vehicle file that is written keeps it [default: the vehicle's].",
        ),
        click.option(
            "--steps",
            "most_steps",
            type=click.IntRange(1),
            default=30,
            show_default=True,
            help="Most iterations of the solver.",
        ),
        click.option(
            "--most-nodes",
            "most_nodes",
            type=click.IntRange(LEAST_NODES),
            default=Options().most_nodes,
            show_default=True,
            help="Of flights with more samples, the most informative segments are fitted: 40 % of so many.",
        ),
    ]

    def decorated(function: Callable[..., Any]) -> Callable[..., Any]:
        @functools.wraps(function)
        def verb(**arguments: Any) -> Any:
            fit = {name: arguments.pop(name) for name in _NAMES}
            try:
                return function(fit=fit, **arguments)
            except FlightError as error:
                raise type(error)(worded(str(error))) from error

        for option in reversed(options):
            option(verb)
        return verb

    return decorated


def read(fit: Chosen, believed: Vehicle) -> Options:
    """The options of the library, with names and patterns resolved for a vehicle.

    Raises:
        InputError: a name that the vehicle does not have, or a prior that is not a number.
    """
    return Options(
        held=named(fit["held"], believed),
        free=named(fit["free"], believed) if fit["free"] else None,
        prior_std=dict(_prior(text, believed) for text in fit["priors"]),
        anchors=(*map(_hover, fit["hovers"]), *map(_rotor_thrust, fit["rotor_thrusts"])),
        gaps="split" if fit["split_gaps"] else "refuse",
        unseen="hold" if fit["hold_unidentifiable"] else "refuse",
        robust=fit["robust"],
        gusts=fit["gusts"],
        estimate_command_delay=fit["estimate_command_delay"],
        max_iterations=fit["most_steps"],
        most_nodes=fit["most_nodes"],
    )


def at_place(fit: Chosen, believed: Vehicle) -> Vehicle:
    """The vehicle with the gravity that was given, if it was. Raises `InputError` if it is found nowhere on Earth."""
    return believed if fit["gravity_m_s2"] is None else believed.with_gravity(fit["gravity_m_s2"])


def typed(fit: Chosen) -> str:
    """The options as they are typed, those left at their defaults out; each with a space before it."""
    parameters = {p.name: p for p in click.get_current_context().command.params if isinstance(p, click.Option)}
    words: list[str] = []
    for name in given(fit):
        value, option = fit[name], parameters[name]
        if isinstance(value, bool):
            words += (option.opts if value else option.secondary_opts)[:1]
        else:
            values = value if isinstance(value, tuple) else (value,)
            words += [f"{option.opts[0]} {shlex.quote(str(v))}" for v in values]
    return "".join(f" {word}" for word in words)


def with_cause(typed: str, cause: Cause) -> str:
    """Options as they were typed, with what a trial found in place of or beside them."""
    if cause.steps:
        typed = re.sub(r" --steps [0-9]+", "", typed) + f" --steps {cause.steps}"
    return typed + "".join(f" --hold {shlex.quote(name)}" for name in cause.held)


def given(fit: Chosen) -> list[str]:
    """Names of the options that the user gave."""
    context = click.get_current_context()
    return [name for name in fit if context.get_parameter_source(name) is ParameterSource.COMMANDLINE]


def named(patterns: Iterable[str], believed: Vehicle) -> tuple[str, ...]:
    """Names of parameters: each given as such, as an effect, or as a pattern."""
    found: list[str] = []
    for name in patterns:
        matches = [p for p in believed.parameters if p.startswith(f"{name}.") or fnmatchcase(p, name)]
        if not matches:
            believed.parameter(name)  # raises, with the known names
        found += matches
    return tuple(dict.fromkeys(found))


def _prior(text: str, believed: Vehicle) -> tuple[str, float]:
    name, _, std = text.partition("=")
    believed.parameter(name)
    try:
        return name, float(std)
    except ValueError:
        raise InputError(f"--prior {text}: write NAME=STD, for example inertia_zz_kg_m2=1e-4") from None


def _hover(text: str) -> HoverCommand:
    numbers, _, volts = text.partition("@")
    found = _numbers(numbers, (1, 2), f"--hover {text}: write COMMAND[,STD][@VOLTS], for example 0.48,0.005@15.6")
    if not volts:
        return HoverCommand(*found)
    (voltage,) = _numbers(volts, (1,), f"--hover {text}: the voltage after @ is a number, for example 15.6")
    return HoverCommand(*found, battery_v=voltage)


def _rotor_thrust(text: str) -> RotorThrust:
    wanted = f"--rotor-thrust {text}: write COMMAND,NEWTON[,STD], for example 0.6,2.2,0.05"
    command, thrust_n, *std_n = _numbers(text, (2, 3), wanted)
    return RotorThrust(command, thrust_n, *(std_n or [BALANCE_SHARE * thrust_n]))


def _numbers(text: str, counts: tuple[int, ...], wanted: str) -> list[float]:
    """Numbers between commas, so many. Raises `InputError` with the form expected."""
    try:
        found = [float(part) for part in text.split(",")]
    except ValueError:
        raise InputError(wanted) from None
    if len(found) not in counts:
        raise InputError(wanted)
    return found


def worded_report(report: LogReport) -> LogReport:
    """The same findings about a log, their fixes with options instead of arguments."""
    findings = tuple(replace(finding, fix=worded(finding.fix)) for finding in report.findings)
    return replace(report, findings=findings)


def worded(sentence: str, names: Mapping[str, str] = FLAGS) -> str:
    """A message of the library with options, or what else stands in their place, instead of arguments."""
    for python, name in names.items():
        sentence = sentence.replace(python, name)
    return sentence
