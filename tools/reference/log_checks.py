"""Every finding that the checks of a log can make, read from their sources: the sentence, and the way out."""

import ast
import inspect
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import sysid.logs
from tools.reference.markdown import plain, table

BLANK = "…"
"""In place of the figures and names of a sentence."""
LEVELS = ("error", "warning")
"""Functions of `sysid.logs.checks.finding` that make findings."""


@dataclass(frozen=True, slots=True)
class Finding:
    """One place in the sources where a finding is made."""

    level: str
    what: str
    sentence: str
    fix: str
    repaired: bool
    """Whether `goshawk log fix` can carry the fix out."""


def page() -> str:
    """A table for each module that makes findings, under the module's first line."""
    parts = []
    for source in sorted(Path(inspect.getfile(sysid.logs)).parent.rglob("*.py")):
        module = ast.parse(source.read_text())
        found = list(findings(module))
        if found:
            said = (ast.get_docstring(module) or source.stem).splitlines()[0].rstrip(".")
            rows = [(f.what, f.level, plain(f.sentence), plain(f.fix), "yes" if f.repaired else "") for f in found]
            parts += [f"## {said}", table(("finding", "level", "sentence", "way out", "`log fix`"), rows)]
    return "\n\n".join(parts)


def findings(module: ast.Module) -> Iterator[Finding]:
    """Every call of `error` or `warning`, in the order of the source."""
    for function in ast.walk(module):
        if not isinstance(function, ast.FunctionDef):
            continue
        for node in ast.walk(function):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in LEVELS:
                what, sentence, fix = (_text(argument, function, node.lineno) for argument in node.args[:3])
                repaired = any(keyword.arg == "repair" for keyword in node.keywords)
                yield Finding(node.func.id, what, sentence, fix, repaired)


def _text(node: ast.expr, function: ast.FunctionDef, line: int) -> str:
    """A string as the source has it, with blanks for what is known only when it runs."""
    if isinstance(node, ast.Constant):
        return str(node.value)
    if isinstance(node, ast.JoinedStr):
        return "".join(_text(part, function, line) for part in node.values)
    if isinstance(node, ast.IfExp):
        return f"{_text(node.body, function, line)} / {_text(node.orelse, function, line)}"
    if isinstance(node, ast.FormattedValue | ast.Name):
        name = node.value if isinstance(node, ast.FormattedValue) else node
        known = _assigned(name.id, function, line) if isinstance(name, ast.Name) else None
        return _text(known, function, known.lineno) if known is not None else BLANK
    return BLANK


def _assigned(name: str, function: ast.FunctionDef, line: int) -> ast.expr | None:
    """The text that the variable was last given above this line, if it is a text."""
    given = [
        node.value
        for node in ast.walk(function)
        if isinstance(node, ast.Assign)
        and node.lineno < line
        and any(isinstance(target, ast.Name) and target.id == name for target in node.targets)
    ]
    texts = [value for value in given if isinstance(value, ast.JoinedStr | ast.IfExp) or _is_text(value)]
    return max(texts, key=lambda value: value.lineno, default=None)


def _is_text(value: ast.expr) -> bool:
    return isinstance(value, ast.Constant) and isinstance(value.value, str)
