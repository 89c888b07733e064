"""What a program can rely on when a verb fails: exit codes, kinds of errors, reasons of the vehicle."""

import re

import flight
from firmware_bridge.words import reason_text
from flight import FlightError
from goshawk import cli
from tools.reference.markdown import code, table


def exit_codes() -> str:
    """From the first lines of the command line's module."""
    said = " ".join((cli.__doc__ or "").partition("Exit codes: ")[2].split()).replace(". 70", "; 70").rstrip(".")
    rows = [re.split(r" (?:is )?", part, maxsplit=1) for part in said.split("; ")]
    return table(("code", "meaning"), rows)


def error_kinds() -> str:
    """Every class of expected errors, with the exit code that the command line gives it."""
    kinds = [kind for name in flight.__all__ if _is_error(kind := getattr(flight, name))]
    rows = [(code(kind.__name__), str(cli.explained(kind())[1]), kind.__doc__ or "") for kind in kinds]
    return table(("kind", "exit code", "meaning"), rows)


def _is_error(kind: object) -> bool:
    return isinstance(kind, type) and issubclass(kind, FlightError) and kind is not FlightError


def vehicle_reasons() -> str:
    """Every reason why the vehicle refused something or changed its state, by number."""
    said = [(str(number), reason_text(number)) for number in range(256)]
    unknown = reason_text(255)
    return table(("number", "reason"), [row for row in said if row[1] != unknown])
