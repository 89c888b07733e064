"""Runs the command line in this process."""

import shlex
import subprocess
from typing import Any, cast

import click
import pytest
from click.testing import CliRunner

from goshawk.cli import goshawk, main


def run(*arguments: object, code: int = 0) -> str:
    """Standard output of the command; what it says on the other channel if it is to fail."""
    ended = answer(*arguments)
    assert ended.returncode == code, ended.stderr
    return ended.stdout if code == 0 else ended.stderr


def answer(*arguments: object) -> subprocess.CompletedProcess[str]:
    """As if the command line had been run as a program, without the seconds that a new Python takes to start."""
    runner = CliRunner()
    with runner.isolation() as streams:
        with pytest.raises(SystemExit) as ended:
            main([str(a) for a in arguments])
        said, errors = streams[0].getvalue().decode(), streams[1].getvalue().decode()
    return subprocess.CompletedProcess([*map(str, arguments)], cast("int", ended.value.code or 0), said, errors)


def typed(line: str) -> list[str]:
    """The words after `goshawk` of a line that is to be typed; fails when the command line does not understand it."""
    words = shlex.split(line, comments=True)
    assert words[0] == "goshawk"
    command, name, rest = goshawk.get_command(cast("Any", None), words[1]), words[1], words[2:]
    while isinstance(command, click.Group) and rest[0] in command.commands:
        name, rest = rest[0], rest[1:]
        command = command.commands[name]
    assert command is not None
    command.make_context(name, list(rest), **goshawk.context_settings)  # click keeps the help option it makes first
    return words[1:]
