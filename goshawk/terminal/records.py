"""Options of a verb as one record, so that a verb with many has few arguments, and two verbs can share them."""

import functools
from collections.abc import Callable, Sequence
from dataclasses import fields
from typing import Any


def options_as(
    kind: type, options: Sequence[Callable[[Any], Any]]
) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """A decorator that gives a verb these options; their values reach it as one argument `asked`.

    Args:
        kind: a dataclass with a field for each of the options.
    """

    def decorated(function: Callable[..., Any]) -> Callable[..., Any]:
        @functools.wraps(function)
        def verb(**arguments: Any) -> Any:
            values = {field.name: arguments.pop(field.name) for field in fields(kind)}
            return function(asked=kind(**values), **arguments)

        for option in reversed(options):
            option(verb)
        return verb

    return decorated
