"""Blocks that install, and those for a copy of the repository, run in a clone, with a home folder of their own."""

import os
import re
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.docs.reader import LOOKED_AT_S
from tests.test_wheel import wheels
from tests.waiting import PATIENCE_S, until

ROOT = Path(__file__).parents[2]
PROGRAMS = Path(sys.executable).parent
SUBSETS = {
    "make test ": "-k spelling",
    "make test-quick ": "-k pillar",
    ".venv/bin/python -m pytest tests/planner -n": "-k pillar",
}
"""Commands that would run for minutes, and what makes pytest choose some of their tests."""
HOURS = re.compile(r"\bhours?\b")
"""In the remark behind a command that is ended once it works."""
MISSED = "exit code 1"
"""In the remark behind a check whose bar is missed."""

pytestmark = pytest.mark.slow


@dataclass(frozen=True, slots=True)
class Clone:
    """A copy of the repository as it stands here, and somebody's home folder."""

    folder: Path
    home: Path

    def environment(self, *programs: Path, **more: str) -> dict[str, str]:
        """With these folders first on the path; packages that were fetched before are not fetched again."""
        kept = {name: value for name, value in os.environ.items() if not name.startswith(("PYTEST_", "VIRTUAL_ENV"))}
        user = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache"))
        caches = {"UV_CACHE_DIR": str(user / "uv"), "PIP_CACHE_DIR": str(user / "pip")}
        path = os.pathsep.join([*map(str, programs), str(PROGRAMS), os.environ["PATH"]])
        own = {"HOME": str(self.home), "PATH": path, "SHELL": "/bin/bash", "PYTEST_DEBUG_TEMPROOT": str(self.home)}
        return {**caches, **kept, **own, **more}

    def type(self, script: str, environment: dict[str, str], *, folder: Path | None = None, code: int = 0) -> str:
        """What the script prints; fails where it does not end with this exit code."""
        done = subprocess.run(
            ["bash", "-e", "-c", script], cwd=folder or self.folder, env=environment,
            capture_output=True, text=True, timeout=3.0 * PATIENCE_S, check=False,
        )  # fmt: skip
        if done.returncode != code and re.search(r"\b(pip|uv) ", script) and not self._reaches_the_index():
            pytest.skip("the package index is out of reach")
        assert done.returncode == code, f"{script}\n{done.stdout[-3000:]}{done.stderr[-3000:]}"
        return done.stdout

    def _reaches_the_index(self) -> bool:
        asked = [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", "--no-cache-dir", "tomli-w"]
        return subprocess.run(asked, cwd=self.home, capture_output=True, check=False).returncode == 0


@pytest.fixture(scope="module")
def clone(tmp_path_factory) -> Clone:
    folder, home = tmp_path_factory.mktemp("copy") / "goshawk", tmp_path_factory.mktemp("home")
    subprocess.run(["git", "clone", "--quiet", ROOT, folder], check=True)
    changed = subprocess.run(
        ["git", "diff", "--binary", "HEAD"], cwd=ROOT, capture_output=True, check=True
    ).stdout  # what is not committed yet
    if changed:
        subprocess.run(["git", "apply"], cwd=folder, input=changed, check=True)
    return Clone(folder, home)


def test_the_documented_installation_puts_a_command_on_the_path(clone, documented):
    local = clone.home / ".local" / "bin"
    for command in dict.fromkeys(command for block in documented for command in block.commands):
        on_path = () if "update-shell" in command else (local,)
        clone.type(command, clone.environment(*on_path))
    assert str(local) in "".join(file.read_text() for file in clone.home.glob(".*") if file.is_file())
    assert clone.type("command -v goshawk", clone.environment(local)).strip() == str(local / "goshawk")
    assert "everything that is installed works" in clone.type("goshawk doctor", clone.environment(local))


def test_the_documented_wheel_is_installed_into_an_environment_of_its_own(clone, documented, tmp_path):
    wheel = wheels.build(sys.executable, tmp_path, isolated=False)
    (block,) = documented
    text, named = re.subn(r"goshawk-[\w.-]+\.whl", wheel.name, block.text)
    assert named == 1
    said = clone.type(f"{text}\ncommand -v goshawk\ngoshawk doctor", clone.environment(), folder=tmp_path)
    assert str(tmp_path / "env" / "bin" / "goshawk") in said


def test_the_documented_extra_brings_what_a_cluster_needs(clone, documented, tmp_path):
    subprocess.run([sys.executable, "-m", "venv", tmp_path / "env"], check=True)
    environment = clone.environment(tmp_path / "env" / "bin")
    for block in documented:
        clone.type(block.text, environment)
    said = clone.type("python -c 'import goshawk, distributed; print(goshawk.__file__)'", environment, folder=tmp_path)
    assert str(tmp_path / "env") in said


def test_the_documented_steps_of_a_contributor_work(clone, documented):
    for block in documented:
        for command in block.commands:
            chosen = next((some for begin, some in SUBSETS.items() if f"{command} ".startswith(begin)), "")
            said = clone.type(command, clone.environment(PYTEST_ADDOPTS=chosen))
            assert not chosen or re.search(r"\d+ passed", said), f"{command}\n{said[-1000:]}"
        if hook := re.search(r"\S+pre-commit install", block.text):
            clone.type(hook[0], clone.environment())
            assert (clone.folder / ".git" / "hooks" / "pre-commit").stat().st_mode & 0o100
    assert (clone.folder / "docs" / "_build" / "index.html").exists()


def test_the_documented_checks_of_the_embedded_c_run(clone, documented):
    _need("clang-19", "gcc", "cppcheck", "cmake", "arm-none-eabi-gcc", "qemu-system-arm")
    (block,) = documented
    for command in block.commands:
        remark = block.remark(command)
        if HOURS.search(remark):
            _works_until_it_is_ended(clone, command)
        else:
            clone.type(command, clone.environment(), code=1 if MISSED in remark else 0)


def _need(*tools: str) -> None:
    for tool in tools:
        if subprocess.run(["sh", "-c", f"command -v {tool}"], capture_output=True, check=False).returncode:
            pytest.skip(f"{tool} is not installed")


def _works_until_it_is_ended(clone: Clone, command: str) -> None:
    """It begins to write, and goes on."""
    before = _written(clone)
    process = subprocess.Popen(
        ["bash", "-c", f"exec {command}"], cwd=clone.folder, env=clone.environment(TMPDIR=str(clone.home)),
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, start_new_session=True,
    )  # fmt: skip
    try:
        until(lambda: process.poll() is not None or _written(clone) - before, f"something written by {command}")
        time.sleep(LOOKED_AT_S)
        assert process.poll() is None, process.communicate()[0]
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
        process.communicate()


def _written(clone: Clone) -> set[Path]:
    """Inputs that a fuzzer keeps, and programs of mutants."""
    return {path for folder in (clone.folder / "build", clone.home) for path in folder.rglob("*")}
