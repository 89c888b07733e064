"""The command line, from the verbs' own options and help."""

import inspect
from collections import Counter
from collections.abc import Iterator

import click

from goshawk.cli import goshawk
from goshawk.cli import verbs as verbs_by_task
from tools.reference.markdown import code, plain, table

SHARED = 8
"""An option that so many verbs have with the same help is explained once, at the top of the page."""

Words = tuple[str, ...]


def page() -> str:
    """Options that many verbs share, then every verb by task."""
    verbs = dict(tree(goshawk))
    shared = _shared(verbs)
    parts = ["## Options of many verbs", table(("option", "meaning"), shared.items())]
    for task, names in verbs_by_task().items():
        parts.append(f"## {task}")
        parts += [_section(words, verb, shared) for words, verb in verbs.items() if words[0] in names]
    return "\n\n".join(parts)


def tree(command: click.Command, *words: str) -> Iterator[tuple[Words, click.Command]]:
    """Every verb with the words that call it; a group that is a verb itself comes before its verbs."""
    if not isinstance(command, click.Group):
        yield words, command
        return
    own = getattr(command, "own", None)
    if own is not None:
        yield words, own
    for name in command.list_commands(click.Context(command)):
        found = command.get_command(click.Context(command), name)
        if found is not None:
            yield from tree(found, *words, name)


def _section(words: Words, verb: click.Command, shared: dict[str, str]) -> str:
    context = _context(verb, ("goshawk", *words))
    usage = f"```text\n{' '.join(verb.get_usage(context).removeprefix('Usage: ').split())}\n```"
    rows = [_row(option, context) for option in _options(verb)]
    own = [row for row in rows if shared.get(row[0]) != row[1]]
    also = [row[0] for row in rows if row not in own]
    parts = [f"### goshawk {' '.join(words)}", _help(verb), usage]
    parts += [table(("option", "meaning"), own)] if own else []
    parts += [f"Also: {', '.join(also)}."] if also else []
    return "\n\n".join(parts)


def _context(verb: click.Command, words: Words) -> click.Context:
    """Context with the settings of `goshawk`: click keeps on the verb the help option that it makes first."""
    return click.Context(verb, info_name=" ".join(words), **goshawk.context_settings)


def _help(verb: click.Command) -> str:
    """Paragraphs of the help; one that click is not to wrap is a block of commands."""
    paragraphs = inspect.cleandoc(verb.help or "").split("\n\n")
    return "\n\n".join(_paragraph(text) for text in paragraphs)


def _paragraph(text: str) -> str:
    if not text.startswith("\b"):
        return plain(text)
    return "```text\n" + text.removeprefix("\b").strip("\n") + "\n```"


def _options(verb: click.Command) -> list[click.Option]:
    return [option for option in verb.params if isinstance(option, click.Option) and not option.hidden]


def _row(option: click.Option, context: click.Context) -> tuple[str, str]:
    """Names with what they take, and the help with its range and default as the terminal has it."""
    record = option.get_help_record(context)
    names, said = record if record is not None else (", ".join(option.opts), option.help or "")
    return code(names), plain(" ".join(said.split()))


def _shared(verbs: dict[Words, click.Command]) -> dict[str, str]:
    rows: Counter[tuple[str, str]] = Counter()
    for words, verb in verbs.items():
        context = _context(verb, words)
        rows.update(_row(option, context) for option in _options(verb))
    return {names: said for (names, said), count in rows.items() if count >= SHARED}
