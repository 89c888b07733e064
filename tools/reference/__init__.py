"""The generated parts of the documentation: what code says of itself, in place of a comment that names it.

A page has a line `<!-- generated: effects -->`; when Sphinx reads the page, that line becomes the text made here.
Nothing generated is kept, so none of it can be out of date.
"""

import re
from collections.abc import Callable

from tools.reference import command_line, effects, log_checks, messages, parameters

MARK = re.compile(r"^<!-- generated: ([a-z_]+) -->$", re.MULTILINE)
MAKERS: dict[str, Callable[[], str]] = {
    "command_line": command_line.page,
    "compensation": effects.compensation,
    "effects": effects.page,
    "log_checks": log_checks.page,
    "error_kinds": messages.error_kinds,
    "exit_codes": messages.exit_codes,
    "vehicle_reasons": messages.vehicle_reasons,
    "parameters": parameters.page,
}


def expand(text: str) -> str:
    """A page's source with every generated part in its place.

    Raises:
        KeyError: a comment names a part that nothing makes.
    """
    return MARK.sub(lambda mark: MAKERS[mark[1]](), text)
