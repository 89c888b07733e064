"""Every block of commands and of Python in README and docs runs from an empty folder, or says which test runs it."""

from pathlib import Path

import pytest

from tests.docs import blocks
from tests.docs.inputs import Inputs
from tests.docs.reader import Reader

ROOT = Path(__file__).parents[2]
DOCS = sorted(page for page in (ROOT / "docs").rglob("*.md") if not {"_build", "studies"} & set(page.parts))
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *DOCS]
RUN = [page for page in PAGES if any(block.how in ("run", "run each") for block in blocks.read(page))]
FLYING, SITL = "flying", "goshawk sitl --vehicle vehicle.toml --at 0.8,0.8,0"
"""A vehicle that listens before the block."""


def name(page: Path) -> str:
    return str(page.relative_to(ROOT))


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_every_block_runs_or_says_why_not(page: Path):
    for block in blocks.read(page):
        where = f"{name(page)}, line {block.line}"
        if block.how == "run by":
            for test in block.named:
                assert (ROOT / test).is_file(), where
        elif block.how == "not run":
            assert set(block.named) <= set(blocks.REASONS), where
        else:
            assert block.how in ("run", "run each"), f"{where}: say how it is run, see tests/docs/blocks.py"
            assert all(hasattr(Inputs, needed.replace("-", "_")) for needed in set(block.named) - {FLYING}), where


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
                    if needed == FLYING:
                        reader.stop()  # one that landed elsewhere
                        reader.start(SITL)
                    else:
                        inputs.put(needed, reader.folder)
                (reader.type if block.how == "run" else reader.type_each)(block)
    finally:
        reader.stop()
