"""What the programs say: sentences of at most thirty words, in British spelling, in errors, reports and the page."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.goshawk.test_grammar import VERBS

ROOT = Path(__file__).parents[1]
PACKAGES = ("flight", "esdf", "vehicle", "mapping", "planner", "sysid", "firmware_bridge", "gcs_web", "goshawk")
PACKAGES += ("preflight",)
MODULES = [p for package in PACKAGES for p in (ROOT / package).rglob("*.py") if "generated" not in p.parts]
CLIENT = [p for p in (ROOT / "gcs_web" / "client" / "src").rglob("*") if p.suffix in (".ts", ".tsx")]
PAGES = [p for p in (ROOT / "docs").rglob("*.md") if "_build" not in p.parts]
PAGES += [ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")]
LONGEST = 30
"""Words of a sentence; STYLE: one that is longer is read twice."""
AMERICAN = re.compile(
    r"(?<![-\w])(colors?|colored|gray|behavior|neighbor\w*|the centers?|centered|meters?|millimeters?|catalogs?"
    r"|favor\w*|honor\w*|maneuvers?|artifacts?|analyz\w+|traveled|modeled|modeling|labeled|canceled|optimiz\w+"
    r"|normaliz\w+|minimiz\w+|maximiz\w+|initializ\w+|lineariz\w+|recogniz\w+|summariz\w+|factoriz\w+|synchroniz\w+"
    r"|penaliz\w+|stabiliz\w+)\b",
    re.IGNORECASE,
)
"""Spelling is British, with -ise; `localize` and `rasterize` are names of the API, and the field's words."""


def sentences(text: str) -> list[str]:
    """The sentences of a message; what stands in backticks or braces is one word."""
    plain = re.sub(r"`[^`]*`", "X", text)
    return re.split(r"(?<=[.?!])\s+|\n", plain)


def literal(node: ast.expr) -> str | None:
    """The text of a string or f-string, each value of it one word; None for anything else."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return node.value
    if isinstance(node, ast.JoinedStr):
        return "".join(str(part.value) if isinstance(part, ast.Constant) else "X" for part in node.values)
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        left, right = literal(node.left), literal(node.right)
        return None if left is None or right is None else left + right
    return None


def messages(node: ast.AST) -> Iterator[tuple[int, str]]:
    """Every string below the node with its line, joined strings once, without documentation."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.Expr) and isinstance(child.value, ast.Constant):
            continue
        if isinstance(child, ast.expr) and (text := literal(child)) is not None:
            yield child.lineno, text
        else:
            yield from messages(child)


def too_long(source: str) -> list[str]:
    """Lines of messages with a sentence that is too long; markup and style sheets are none."""
    return [
        f"line {line}: {sentence}"
        for line, text in messages(ast.parse(source))
        for sentence in sentences(text)
        if len(sentence.split()) > LONGEST and not re.search("[<{]", sentence)
    ]


def test_no_sentence_of_a_message_has_more_than_thirty_words():
    found = [f"{p.relative_to(ROOT)}, {said}" for p in MODULES for said in too_long(p.read_text())]
    assert not found, "say it in two sentences:\n" + "\n".join(found)


@pytest.mark.parametrize("words", VERBS, ids=" ".join)
def test_the_help_of_a_verb_has_no_longer_sentence(words: tuple[str, ...]):
    said = re.sub(r"^\s*\x08.*?(?:\n\s*\n|\Z)", "\n", VERBS[words].help or "", flags=re.MULTILINE | re.DOTALL)  # tables
    paragraphs = [" ".join(part.split()) for part in re.split(r"\n\s*\n", said)]
    assert not [s for part in paragraphs for s in sentences(part) if len(s.split()) > LONGEST]


@pytest.mark.parametrize("count", [30, 31])
def test_a_sentence_is_counted_over_joined_strings_and_values(count: int):
    half = "word " * (count - 16)
    source = f'raise ValueError(f"{half}" + f"{{a + b:.3f}} {"word " * 15}")\n"{"word " * 40}"\n'
    assert len(too_long(source)) == (count > LONGEST)


def prose(text: str, suffix: str) -> str:
    """What one reads: a page without code and links, the messages of Python, strings of TypeScript with a space."""
    if suffix == ".md":
        return re.sub(r"```.*?```|`[^`]*`|\]\([^)]*\)|https?:\S+", " ", text, flags=re.DOTALL)
    if suffix == ".py":
        said = (text for _, text in messages(ast.parse(text)) if " " in text and not re.search("[<{]", text))
        return "\n".join(re.sub(r"`[^`]*`", "X", each) for each in said)
    return "\n".join(re.findall(r'"[^"\n]* [^"\n]*"|(?<=>)[^<>{}\n]* [^<>{}\n]*(?=<)', text))


def test_spelling_is_british():
    found = [
        f"{path.relative_to(ROOT)}: {match[0]}"
        for path in (*PAGES, *MODULES, *CLIENT)
        for match in AMERICAN.finditer(prose(path.read_text(), path.suffix))
    ]
    assert not found, "; ".join(found)


@pytest.mark.parametrize("word", ["color", "optimizer", "centered", "neighboring"])
def test_american_spelling_would_be_noticed(word: str):
    assert AMERICAN.search(prose(f"the {word} of it", ".md"))
    assert AMERICAN.search(prose(f'raise ValueError(f"the {word} of {{it}}")', ".py"))
    assert AMERICAN.search(prose(f'<p title="the {word} of it">', ".tsx"))
    assert not AMERICAN.search(prose(f"the `{word}` of it", ".md"))
