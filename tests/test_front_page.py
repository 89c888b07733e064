"""What a newcomer reads first is true: the README's program runs and says what is printed, links lead somewhere."""

import os
import re
import subprocess
import sys
import tokenize
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.docs.blocks import Block
from tests.goshawk.test_grammar import VERBS, commands_in
from tests.waiting import PATIENCE_S
from tools import pictures, reference, two_styles

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()
EXAMPLES = sorted((ROOT / "examples").glob("[0-9][0-9]_*.py"))
DOCS = [page for page in (ROOT / "docs").rglob("*.md") if "_build" not in page.parts]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *DOCS]
NUMBER = re.compile(r"(?<![\w.])\d+\.?\d*(?:e-?\d+)?")


def block(language: str) -> str:
    """The README's block of that language that belongs to the ten lines."""
    section = README.split("## Ten lines of Python")[1].split("\n## ")[0]
    return section.split(f"```{language}\n")[1].split("```")[0]


def test_the_readmes_ten_lines_run_and_print_what_it_shows(documented: list[Block], tmp_path: Path):
    program = documented[0].text
    assert len([line for line in program.splitlines() if line and not line.startswith(("import", "from"))]) <= 10
    (tmp_path / "ten_lines.py").write_text(program)
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "-W", "error", "ten_lines.py"],
        cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=PATIENCE_S, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert_same_result(done.stdout, block("text"))


def assert_same_result(found: str, printed: str) -> None:
    """A plan has the same bits on every processor; an estimate from the same noise stays within half of its error."""
    plan, *estimates = found.splitlines()
    printed_plan, *printed_estimates = printed.splitlines()
    assert plan == printed_plan
    assert [NUMBER.sub("#", line) for line in estimates] == [NUMBER.sub("#", line) for line in printed_estimates]
    for line, printed_line in zip(estimates, printed_estimates, strict=True):
        (value, std, true), (said, said_std, said_true) = (
            [float(number) for number in NUMBER.findall(text.partition(": ")[2])][-3:] for text in (line, printed_line)
        )
        assert true == said_true
        assert std == pytest.approx(said_std, rel=0.15)
        assert abs(value - said) <= 0.5 * said_std


@pytest.mark.parametrize(
    ("right", "wrong"),
    [("0.0175 +-", "0.0176 +-"), ("+- 6.7e-05", "+- 6.7e-04"), ("true 0.0175", "true 0.0185"), ("4.8 s,", "5.5 s,")],
)
def test_a_wrong_figure_in_the_readme_would_be_noticed(right: str, wrong: str):
    printed = block("text")
    assert right in printed
    assert_same_result(printed, printed)
    with pytest.raises(AssertionError):
        assert_same_result(printed, printed.replace(right, wrong))


def test_every_verb_is_shown_at_work_in_a_tutorial_or_a_how_to():
    pages = [page.read_text() for kind in ("start", "how-to") for page in (ROOT / "docs" / kind).glob("*.md")]
    shown = {tuple(words[1:n]) for words in commands_in("\n".join(pages)) for n in (2, 3, 4)}
    assert not set(VERBS) - shown


def anchors(page: Path) -> set[str]:
    """What a link may name after `#`: the page's headings, as GitHub and Sphinx write them."""
    headings = re.findall(r"^#+ (.+)$", reference.expand(page.read_text()), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def targets(text: str) -> list[str]:
    """Of a page's links and pictures."""
    return re.findall(r"\]\(([^)\s]+)\)", text) + two_styles.targets(text)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_and_pictures_of_a_page_lead_somewhere(page: Path):
    for target in targets(reference.expand(page.read_text())):
        if not target.startswith(("http:", "https:", "mailto:")):
            name, _, anchor = target.partition("#")
            goal = page.parent / name if name else page
            assert goal.exists(), target
            assert not anchor or anchor in anchors(goal), target


def test_the_gallery_shows_the_code_and_picture_of_every_example():
    gallery = (ROOT / "docs" / "start" / "examples.md").read_text()
    for script in EXAMPLES:
        assert f"{{literalinclude}} ../../examples/{script.name}\n" in gallery
    assert gallery.count("![") + gallery.count("<picture>") == len(EXAMPLES)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_a_picture_in_two_styles_is_written_so_that_the_documentation_shows_both(page: Path):
    text = page.read_text()
    found = two_styles.PICTURE.findall(text)
    assert text.count("<picture") == len(found), "not in the one form that tools/two_styles.py reads"
    for dark, words, light in found:
        assert dark == light.replace("_light.", "_dark.")
        assert len(words) > 20
    assert two_styles.for_sphinx(text).count("{image}") == text.count("{image}") + 2 * len(found)


def test_every_picture_is_shown_small_and_rebuilt_by_make_pictures():
    shown = {(page.parent / target).resolve() for page in PAGES for target in targets(page.read_text())}
    kept = {path for path in (ROOT / "docs" / "pictures").rglob("*") if path.is_file()}
    assert not kept - shown, "no page shows these"
    assert not [path.name for path in kept if path.stat().st_size >= pictures.MOST_BYTES]
    assert {re.sub("_(light|dark)$", "", path.stem) for path in kept} == set(pictures.NAMES)
    assert "-m tools.pictures" in (ROOT / "Makefile").read_text()


def test_every_term_of_the_glossary_is_explained_in_a_few_lines():
    lines = (ROOT / "docs" / "reference" / "glossary.md").read_text().splitlines()
    starts = [i for i, line in enumerate(lines) if line.startswith(": ")]
    assert len(starts) >= 60
    for i in starts:
        assert lines[i - 1]
        assert not lines[i - 1].startswith((":", "#", " "))
        following = [*lines, ""][i + 1 : i + 4]
        assert "" in following, f"{lines[i - 1]} takes more than three lines"


ROOMS = ("flight", "esdf", "vehicle", "planner", "mapping", "sysid", "gcs_web", "goshawk")
ROOMS += ("examples", "benchmarks", "tools", "docs", "tests")
COINED = re.compile(
    r"\b(suspects?|suspicious|convicts?|stand-ins?|look-alikes?|line-up|crumbs?|obituary|side door|sayings|leeway"
    r"|cannot be seen|virtual (vehicle|flight)s?|rare ways|usual tick|(is|are) wanted|from nil|(told|tells?) apart"
    r"|knows nothing|stands for|vehicle-sim)\b",
    re.IGNORECASE,
)
"""Words this project coined; the glossary has the field's."""
COINED_NAMES = re.compile(
    r"\b(?:def|class) +\w*(suspect|crumb|obituary|look_alike|unseen|silence|stand_in|line_?up|wanted)"
)
EARLIER_NAMES = {"test_front_page.py", "test_verb_groups.py"}
"""Files whose subject are the earlier names."""


def prose(path: Path) -> str:
    """Comments and strings with a space in Python, without the fields of f-strings; elsewhere all but quoted words."""
    if path.suffix != ".py":
        return re.sub(r"`[^`\n]*`|\"[^\"\n]*\"", "", path.read_text())
    with path.open("rb") as source:
        tokens = [t.string for t in tokenize.tokenize(source.readline) if t.type in (tokenize.COMMENT, tokenize.STRING)]
    return "\n".join(re.sub(r"\{[^{}]*\}", "", text) for text in tokens if " " in text)


def coined_names(path: Path) -> Iterator[re.Match[str]]:
    """Names of functions and classes; those of sysid are of its API (`Options.unseen`)."""
    return iter(()) if "sysid" in path.parts else COINED_NAMES.finditer(path.read_text())


def test_coined_words_do_not_come_back():
    files = [p for room in ROOMS for p in (ROOT / room).rglob("*") if p.suffix in (".py", ".cpp", ".hpp", ".md")]
    files += [ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
    found = [
        f"{path.relative_to(ROOT)}: {match[0]}"
        for path in files
        if path.name not in EARLIER_NAMES and "_build" not in path.parts
        for match in (*COINED.finditer(prose(path)), *coined_names(path))
    ]
    assert not found, "docs/reference/glossary.md has the standard terms; not: " + "; ".join(found)
