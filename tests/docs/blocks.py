"""Blocks of commands and of Python in a page, and what the comment above each says about running it.

`<!-- run -->` runs the block in the page's folder, after the blocks above it; `<!-- run: room, flights -->` first puts
the named files there (`tests/docs/inputs.py`). `<!-- run each: room -->` runs every line in a fresh copy of the folder:
they are alternatives. `<!-- run by: tests/test_a.py::test_b -->` names a test that takes the block from the page, by
the fixture `documented`, and runs it.
"""

import ast
import re
from dataclasses import dataclass
from pathlib import Path

COMMANDS = ("goshawk", "python", "python3", ".venv/bin/python", "make", "pip", "uv", "dask", "cmake", "git")
"""A block that begins with one of these is a block of commands."""
ROOT = Path(__file__).parents[2]
FENCE = re.compile(
    r"^(?P<margin> *)(?:<!-- (?P<how>run[^>]*?) -->\n+ *)?```(?P<language>\w*)\n(?P<body>.*?)^ *```$",
    re.M | re.S,
)


@dataclass(frozen=True, slots=True)
class Block:
    """One fenced block that a reader may copy."""

    line: int
    language: str
    text: str
    how: str
    """`run`, `run each`, `run by`, or empty where nothing is said."""
    named: tuple[str, ...]
    """What the comment names after its colon."""

    @property
    def commands(self) -> list[str]:
        """Lines to type, continued lines joined, without remarks; of a transcript those after `$ `."""
        lines = self.text.replace("\\\n", " ").splitlines()
        if any(line.startswith("$ ") for line in lines):
            lines = [line.removeprefix("$ ") for line in lines if line.startswith("$ ")]
        return [line.split("  #")[0].strip() for line in lines if line.strip() and not line.startswith("#")]

    def remark(self, command: str) -> str:
        """What stands behind a command."""
        return next((line.partition("  #")[2] for line in self.text.splitlines() if line.startswith(command)), "")


def read(page: Path) -> list[Block]:
    """The blocks of commands and of Python, in order."""
    text = page.read_text()
    found = []
    for fence in FENCE.finditer(text):
        body = "\n".join(line.removeprefix(fence["margin"]) for line in fence["body"].splitlines())
        how, _, named = (fence["how"] or "").partition(": ")
        names = tuple(name.strip() for name in named.split(",")) if named else ()
        block = Block(text[: fence.start()].count("\n") + 1, fence["language"], body, how, names)
        if fence["language"] == "python" or is_command(block):
            found.append(block)
    return found


def is_command(block: Block) -> bool:
    first = block.text.removeprefix("$ ").split(maxsplit=1)[:1]
    return block.language in ("", "text", "sh", "bash", "console") and first[0:1] != [] and first[0] in COMMANDS


def pages() -> list[Path]:
    """README, CONTRIBUTING and the docs; studies tell what was done, on data of others."""
    docs = sorted(page for page in (ROOT / "docs").rglob("*.md") if not {"_build", "studies"} & set(page.parts))
    return [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *docs]


def run_by(test: str) -> list[Block]:
    """The blocks that name this test (`tests/test_a.py::test_b`), page by page."""
    return [block for page in pages() for block in read(page) if block.how == "run by" and test in block.named]


def takes_its_blocks(test: str) -> bool:
    """Whether `tests/test_a.py::test_b` is a test function that asks for the fixture `documented`."""
    file, _, name = test.partition("::")
    if not name or not (ROOT / file).is_file():
        return False
    functions = [node for node in ast.parse((ROOT / file).read_text()).body if isinstance(node, ast.FunctionDef)]
    return any(f.name == name and "documented" in [argument.arg for argument in f.args.args] for f in functions)
