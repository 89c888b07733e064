"""Runs the command line in this process."""

import pytest
from click.testing import CliRunner

from goshawk.cli import main


def run(*arguments: object, code: int = 0) -> str:
    """Standard output of the command; what it says on the other channel if it is to fail."""
    runner = CliRunner()
    with runner.isolation() as streams:
        with pytest.raises(SystemExit) as ended:
            main([str(a) for a in arguments])
        said, errors = streams[0].getvalue().decode(), streams[1].getvalue().decode()
    assert (ended.value.code or 0) == code, errors
    return said if code == 0 else errors
