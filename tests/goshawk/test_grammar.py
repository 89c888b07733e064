"""The command line is one design: laws for every verb of the tree, and every command in the documents."""

import ast
import json
import re
import shlex
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import click
import pytest

from goshawk.cli import goshawk
from tests.goshawk.running import answer

ROOT = Path(__file__).parents[2]


def tree(command: click.Command, *words: str) -> Iterator[tuple[tuple[str, ...], click.Command]]:
    """Every verb with the words that call it; `plan` is one, and has one."""
    if not isinstance(command, click.Group):
        yield words, command
        return
    context = click.Context(command)
    if (own := getattr(command, "own", None)) is not None:
        yield words, own
    for name in command.list_commands(context):
        found = command.get_command(context, name)
        assert found is not None
        yield from tree(found, *words, name)


VERBS = dict(tree(goshawk))
EVERYWHERE = {
    "--json": "Print JSON on stdout instead of a table.",
    "--quiet": "Print no progress and no notes on stderr.",
    "--overwrite": "Replace existing results; the old ones are kept beside as NAME.old-1.",
    "--yes": "Do not ask for confirmation.",
    "--dry-run": "Show the changes without making them.",
}
"""The whole help of an option that asks for no more."""
BEGINS = {
    "--map": "Map folder", "--vehicle": "Vehicle file", "--url": "Address of the vehicle's MAVLink endpoint",
    "--jobs": "Processes that work at a time", "--scheduler": "Dask scheduler whose workers do the work instead",
    "--report": "HTML page to write",
}  # fmt: skip
"""How the help of an option begins, that says besides what the verb does with it."""


def options(verb: click.Command) -> dict[str, click.Option]:
    return {option.opts[-1]: option for option in verb.params if isinstance(option, click.Option)}


def meaning(option: click.Option) -> tuple[object, ...]:
    """What two verbs must have in common to share an option's name: the kind of value, and how its help begins."""
    said = (option.help or "").replace(" or ", ", ")
    kind = type(option.type).__name__.removesuffix("Range").removesuffix("ParamType")
    return option.is_flag, option.nargs, kind, re.split(r"[,:;.(\[]| to write", said)[0].strip()


@pytest.mark.parametrize("words", VERBS, ids=" ".join)
def test_every_verb_has_the_common_options_and_two_lines_to_paste(words):
    verb = VERBS[words]
    assert {"--json", "--quiet"} <= options(verb).keys()
    assert options(verb)["--quiet"].opts == ["-q", "--quiet"]
    assert verb.help is not None
    pasted = [line.strip() for line in verb.help.partition("\b")[2].splitlines()[1:3]]
    lines = [line for line in pasted if line.startswith("goshawk ")]
    assert lines, "the help begins with lines to paste"
    own = [line for line in lines if line.split()[1 : 1 + len(words)] == list(words)]
    assert lines[0] in own
    required = [option.opts for option in options(verb).values() if option.required]
    assert all(any(name in line for name in names) for line in own for names in required), "a line lacks an option"


@pytest.mark.parametrize("words", VERBS, ids=" ".join)
def test_shared_options_are_flags_or_take_one_value_and_say_the_same(words):
    for name, option in options(VERBS[words]).items():
        if name in EVERYWHERE:
            assert option.is_flag
            assert option.help == EVERYWHERE[name], name
        if name in BEGINS:
            assert (option.help or "").startswith(BEGINS[name]), name
        if name == "--out":
            assert " to write" in (option.help or "")


def test_an_option_means_one_thing_in_every_verb():
    meanings: dict[str, dict[tuple[object, ...], list[str]]] = defaultdict(lambda: defaultdict(list))
    for words, verb in VERBS.items():
        for name, option in options(verb).items():
            if name != "--out":  # what is written is each verb's own
                meanings[name][meaning(option)].append(" ".join(words))
    two = {name: {str(m): verbs for m, verbs in found.items()} for name, found in meanings.items() if len(found) > 1}
    assert not two


def test_short_and_long_help_are_the_same_and_no_error():
    for words in list(VERBS)[::7]:
        short, long = answer(*words, "-h"), answer(*words, "--help")
        assert short.returncode == long.returncode == 0
        assert short.stdout == long.stdout


@pytest.mark.parametrize("words", VERBS, ids=" ".join)
def test_wrong_usage_is_exit_code_2_and_json_says_why(words):
    ended = answer(*words, "--no-such-option", "--json")
    assert ended.returncode == 2
    assert "--no-such-option" in json.loads(ended.stdout)["error"]["message"]
    assert ended.stderr.startswith("goshawk: ")


def test_the_readme_says_what_the_exit_codes_mean():
    said = (ROOT / "README.md").read_text().partition("Exit codes:")[2].partition("\n")[0]
    assert re.findall(r"\b(\d+) [a-z]", said) == ["0", "1", "2", "130"]


def test_quiet_leaves_results_on_stdout_and_errors_on_stderr(tmp_path):
    out = ("--mass", "0.7", "--arm", "0.12", "--prop-diameter", "0.127")
    answer("vehicle", "new", tmp_path / "v.toml", *out, "-q")
    again = answer("vehicle", "new", tmp_path / "v.toml", *out, "--overwrite")
    quiet = answer("vehicle", "new", tmp_path / "v.toml", *out, "--overwrite", "-q")
    assert "version 2" in again.stderr or "kept" in again.stderr
    assert quiet.stderr == ""
    assert quiet.stdout == again.stdout
    refused = answer("vehicle", "show", tmp_path / "none.toml", "-q")
    assert refused.returncode == 2
    assert "none.toml" in refused.stderr


def commands_in(text: str) -> Iterator[list[str]]:
    """The words of each `goshawk ...` that stands in backticks or on a line of its own."""
    text = text.replace("\\\n", " ")
    for span in (*re.findall(r"`(goshawk [^`]*)`", text), *re.findall(r"^\s*(goshawk [^`#]*?)(?:  .*)?$", text, re.M)):
        try:
            yield shlex.split(" ".join(span.split()), comments=True)
        except ValueError:  # an apostrophe of a sentence
            continue


PAGES = [p for p in sorted((ROOT / "docs").rglob("*.md")) if not {"_build", "studies"} & set(p.parts)]
DOCUMENTS = ["README.md", *(str(p.relative_to(ROOT)) for p in PAGES)]


@pytest.mark.parametrize("document", [*DOCUMENTS, "packages"])
def test_commands_in_documents_and_sentences_exist_with_their_options(document):
    texts = [(ROOT / document).read_text()] if document != "packages" else package_texts()
    wrong: list[str] = []
    for text in texts:
        for words in commands_in(text):
            verb = next((VERBS[tuple(words[1:n])] for n in (4, 3, 2) if tuple(words[1:n]) in VERBS), None)
            if verb is None:
                group = any(verb[: len(words) - 1] == tuple(words[1:]) for verb in VERBS)
                stands_for_more = (
                    words[1].isupper() or words[1].startswith("-") or re.search(r"[|]|\.\.\.", words[1] + words[-1])
                )
                wrong += [] if group or stands_for_more else [" ".join(words)]
                continue
            known = {name for option in verb.params for name in (*option.opts, *option.secondary_opts)}
            given = {word.partition("=")[0] for word in words if word.startswith("--")}
            wrong += [f"{' '.join(words)}: {name}" for name in given - known - {"--help"}]
    assert not wrong


def package_texts() -> list[str]:
    packages = ("flight", "esdf", "vehicle", "mapping", "planner", "sysid", "firmware_bridge", "gcs_web", "goshawk")
    packages += ("preflight",)
    return [path.read_text() for package in packages for path in (ROOT / package).rglob("*.py")]


def test_sentences_name_no_file_that_is_not_in_the_wheel():
    """Pages and sources are not installed: a sentence that sends somebody there leaves them with nothing."""
    outside = re.compile(r"\b(?:docs|tests|benchmarks|examples|tools)/[\w./]+\.(?:md|py|sh|toml)\b")
    named = [f"{text[:60]!r}" for source in package_texts() for text in sentences(source) if outside.search(text)]
    named += [" ".join(words) for words, verb in VERBS.items() if outside.search(verb.help or "")]
    assert not named


def sentences(source: str) -> Iterator[str]:
    """The strings of a module that are no documentation."""
    read = ast.parse(source)
    notes = {id(node.value) for node in ast.walk(read) if isinstance(node, ast.Expr)}
    for node in ast.walk(read):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in notes:
            yield node.value
