"""Effect files drafted from what a diagnosis found: the equation that it proposes, or the curve that it drew."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import click

from flight import FormatError, InputError
from goshawk.commands.learn import kept
from sysid.diagnosis import curve, equation_text

Function = Literal["equation", "spline", "polynomial"]


def diagnosed(flights: tuple[Path, ...], diagnosis: Path | None) -> Mapping[str, Any]:
    """A diagnosis in JSON: of a file, or the newest that is kept with the flights.

    Raises:
        InputError: there is none.
        FormatError: the file is no diagnosis.
    """
    if (diagnosis is None) == (not flights):
        raise click.UsageError("give the FLIGHTS that were diagnosed, or --diagnosis FILE")
    if diagnosis is None:
        found = kept.newest("diagnosis", flights)
        if found is None:
            raise InputError(f"no diagnosis of {' '.join(map(str, flights))} is kept; run goshawk diagnose on them")
        return found.document
    try:
        document = json.loads(diagnosis.read_text())
    except FileNotFoundError:
        raise InputError(f"{diagnosis} does not exist; write it with goshawk diagnose --json") from None
    except (ValueError, RecursionError) as error:
        raise FormatError(f"{diagnosis} is not JSON: {error}") from error
    if not isinstance(document, dict) or document.get("schema") != "goshawk-diagnosis":
        raise FormatError(f"{diagnosis} is not a diagnosis of goshawk diagnose --json")
    return document


def draft(document: Mapping[str, Any], file: Path, name: str, function: Function | None) -> dict[str, str]:
    """Write the effect file.

    Args:
        function: the equation if there is one and nothing is asked, else a spline through the curve.

    Returns:
        What was made: effect, channel, variable, form.

    Raises:
        InputError: the diagnosis found no curve (or proposes no equation), or no effect can be made of it.
    """
    equation, outside = (document.get(key) for key in ("equation", "outside"))
    chosen = function or ("equation" if isinstance(equation, dict) else "spline")
    if chosen == "equation":
        if not isinstance(equation, dict):
            raise InputError("the diagnosis proposes no equation; ask for --form spline")
        equation_text.scaffold(equation, file, name=name)
        law = equation_text.from_dict(equation)
        told = (law.channel, law.variable)
    else:
        if not isinstance(outside, dict):
            verdict = document.get("verdict", "nothing is outside the catalogue")
            raise InputError(f"the diagnosis has no residual curve: {verdict}")
        curve.scaffold(outside, file, name=name, form=chosen)
        told = (str(outside["channel"]), str(outside["variable"]))
    return {"effect": name, "channel": told[0], "variable": told[1], "form": chosen}
