"""Every block of commands and of Python in README and docs runs from an empty folder, or in the test that it names."""

from pathlib import Path

import pytest

from tests.docs import blocks
from tests.docs.inputs import Inputs
from tests.docs.reader import Reader, long_sentences

ROOT, PAGES = blocks.ROOT, blocks.pages()
RUN = [page for page in PAGES if any(block.how in ("run", "run each") for block in blocks.read(page))]
FLYING, SITL = "flying", "goshawk sitl --vehicle vehicle.toml --at 0.8,0.8,0"
"""A vehicle that listens before the block."""
ALONE = "alone"
"""Nothing of the blocks above runs or is remembered any more."""


def name(page: Path) -> str:
    return str(page.relative_to(ROOT))


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_every_block_says_how_it_is_run(page: Path):
    for block in blocks.read(page):
        where = f"{name(page)}, line {block.line}"
        if block.how == "run by":
            for test in block.named:
                assert blocks.takes_its_blocks(test), f"{where}: {test} is no test that takes its blocks from the page"
        else:
            assert block.how in ("run", "run each"), f"{where}: say how it is run, see tests/docs/blocks.py"
            assert all(hasattr(Inputs, needed.replace("-", "_")) for needed in set(block.named) - {FLYING, ALONE}), (
                where
            )


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_no_command_is_set_as_an_indented_block(page: Path):
    """Indented ones would run nowhere."""
    indented = [line for line in page.read_text().splitlines() if line.startswith(("    goshawk ", "    python "))]
    assert not indented


@pytest.mark.slow
@pytest.mark.parametrize("page", RUN, ids=name)
def test_the_blocks_of_a_page_run_one_after_the_other(page: Path, tmp_path: Path, made_once, pillar_map: Path):
    inputs, reader = Inputs(made_once, pillar_map), Reader(tmp_path / "folder")
    try:
        for block in blocks.read(page):
            if block.how in ("run", "run each"):
                for needed in block.named:
                    if needed in (FLYING, ALONE):
                        reader.stop()  # one that landed elsewhere
                    if needed == FLYING:
                        reader.start(SITL)
                    elif needed != ALONE:
                        inputs.put(needed, reader.folder)
                (reader.type if block.how == "run" else reader.type_each)(block)
    finally:
        reader.stop()


@pytest.mark.parametrize(("count", "long"), [(30, False), (31, True)])
def test_a_long_sentence_that_a_command_prints_is_noticed(count: int, long: bool):
    said = " ".join(["word"] * count)
    assert bool(long_sentences(f"  {said} {said}\n{said}. {said}.")) == long


@pytest.mark.parametrize(
    ("test", "taken"),
    [
        ("tests/test_front_page.py::test_the_readmes_ten_lines_run_and_print_what_it_shows", True),
        ("tests/test_front_page.py::test_of_another_name", False),
        ("tests/test_front_page.py::test_coined_words_do_not_come_back", False),  # takes no block
        ("tests/test_front_page.py", False),
        ("tests/test_nothing.py::test_nothing", False),
    ],
)
def test_a_block_may_only_name_a_test_that_takes_it_from_the_page(test: str, taken: bool):
    assert blocks.takes_its_blocks(test) == taken
