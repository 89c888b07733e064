"""Type a line at the command line, in this process, and read what is said."""

import os
import shlex
from pathlib import Path

import pytest
from click.testing import CliRunner

from goshawk.cli import main


def attempt(folder: Path, line: str) -> tuple[int, str, str]:
    """Type a line in a folder: exit code, what is said on standard output, what on the other channel."""
    before = Path.cwd()
    os.chdir(folder)
    try:
        with CliRunner().isolation() as streams:
            with pytest.raises(SystemExit) as ended:
                main(shlex.split(line))
            out, errors = (stream.getvalue().decode() for stream in streams[:2])
    finally:
        os.chdir(before)
    code = ended.value.code
    return code if isinstance(code, int) else 0, out, errors


def last_sentence(errors: str) -> str:
    said = [line for line in errors.splitlines() if line.strip()]
    assert said, "nothing was said"
    for word in ("Traceback", "Warning", "Error(", "KeyError", "TypeError", "ValueError"):
        assert word not in errors
    assert said[-1].startswith("goshawk: ")
    return said[-1]


def listing(folder: Path) -> dict[str, tuple[int, int]]:
    return {str(p.relative_to(folder)): (p.lstat().st_size, p.lstat().st_mtime_ns) for p in folder.rglob("*")}
